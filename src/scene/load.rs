use std::path::Path;

use super::{Mesh, gltf, obj, ply};
use crate::{Error, Result};

/// Reads the meshes of a file by its extension: `.obj`, `.ply`, `.gltf` or `.glb`, in world space of that file.
///
/// # Errors
/// A file that is missing, unreadable, malformed, without triangles, or of an unknown extension: one line that names it.
pub fn load_meshes(path: impl AsRef<Path>) -> Result<Vec<Mesh>> {
    let path = path.as_ref();
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match extension.as_str() {
        "obj" => obj::load(path),
        "ply" => ply::load(path).map(|mesh| vec![mesh]),
        "gltf" | "glb" => gltf::load(path),
        _ => Err(Error::file(path, "not a mesh by its extension; known are .obj, .ply, .gltf and .glb")),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use glam::{DAffine3, Vec3};

    use super::super::shapes::TorusKnot;
    use super::super::{Geometry, GeometryBuilder};
    use super::*;

    fn geometry(meshes: Vec<Mesh>) -> Geometry {
        let mut builder = GeometryBuilder::default();
        for mesh in meshes {
            builder.add(mesh, DAffine3::IDENTITY).unwrap();
        }
        builder.build()
    }

    #[test]
    fn all_formats_give_the_same_bits() {
        let knot = TorusKnot { triangles: 300, ..TorusKnot::default() }.mesh().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);

        let mut text = String::new();
        for Vec3 { x, y, z } in &knot.positions {
            text += &format!("v {x} {y} {z}\n");
        }
        for [a, b, c] in &knot.triangles {
            text += &format!("f {} {} {}\n", a + 1, b + 1, c + 1);
        }
        fs::write(path("knot.obj"), text).unwrap();

        let (vertices, faces) = (knot.positions.len(), knot.triangles.len());
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
             property float z\nelement face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
        );
        let positions: Vec<u8> = knot.positions.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect();
        let indices: Vec<u8> = knot.triangles.iter().flatten().copied().flat_map(u32::to_le_bytes).collect();
        let polygons: Vec<u8> = indices.chunks_exact(12).flat_map(|t| [&[3], t].concat()).collect();
        fs::write(path("knot.ply"), [header.as_bytes(), &positions, &polygons].concat()).unwrap();

        let json = format!(
            r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1}}]}}],
            "accessors": [
              {{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": {vertices}, "min": [-2, -2, -2], "max": [2, 2, 2]}},
              {{"bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": {}}}],
            "bufferViews": [
              {{"buffer": 0, "byteOffset": 0, "byteLength": {}}},
              {{"buffer": 0, "byteOffset": {}, "byteLength": {}}}],
            "buffers": [{{"byteLength": {}, "uri": "knot.bin"}}]}}"#,
            3 * faces,
            positions.len(),
            positions.len(),
            indices.len(),
            positions.len() + indices.len()
        );
        fs::write(path("knot.gltf"), json).unwrap();
        fs::write(path("knot.bin"), [positions, indices].concat()).unwrap();

        let expected = geometry(vec![knot]);
        for name in ["knot.obj", "knot.ply", "knot.gltf"] {
            let loaded = geometry(load_meshes(path(name)).unwrap());
            assert_eq!(loaded.positions.len(), expected.positions.len(), "{name}");
            assert!((0..faces as u32).all(|t| loaded.corners(t) == expected.corners(t)), "{name}");
        }
    }

    #[test]
    fn unknown_extensions_are_refused() {
        for name in ["mesh.stl", "mesh"] {
            let message = load_meshes(name).unwrap_err().to_string();
            assert!(message.starts_with(&format!("{name}: ")) && message.contains(".obj, .ply, .gltf and .glb"));
        }
    }
}
