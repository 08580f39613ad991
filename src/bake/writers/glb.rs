//! Binary glTF 2.0: the mesh with the results as application-specific vertex attributes.

use std::borrow::Cow;
use std::path::Path;

use gltf::binary::{Glb, Header};
use serde_json::{Value, json};

use crate::bake::channels::narrow;
use crate::bake::{Array, BakedVertices, components};
use crate::{Error, Result};

use super::atomic::atomically;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const POINTS: u32 = 0;
const TRIANGLES: u32 = 4;
/// Accessor types of one to four numbers.
const TYPES: [&str; 4] = ["SCALAR", "VEC2", "VEC3", "VEC4"];

/// Attributes beside `POSITION` and `NORMAL`, all float: `_AMBIENT_OCCLUSION` (scalar), `_BENT_NORMAL` (three), and
/// whatever has more than four components packed in fours, padded with zeros: `_SH_0` holds coefficients 0 to 3,
/// `_SH_1` 4 to 7 and so on, `_TRANSFER_0` likewise. Packing keeps order 4 within the sixteen attributes that graphics
/// interfaces guarantee. The mesh's `extras` tell what every lane holds, and the provenance.
pub(super) fn write(path: &Path, vertices: &BakedVertices) -> Result<()> {
    if vertices.positions.is_empty() {
        return Err(Error::file(path, "no vertices, and a glTF mesh needs one; write .npz"));
    }
    let mut asset = Asset::default();
    let mut attributes = serde_json::Map::new();
    let mut lanes = serde_json::Map::new();

    for (name, vectors) in [("POSITION", &vertices.positions), ("NORMAL", &vertices.normals)] {
        let data = vectors.iter().flat_map(|v| v.to_array()).map(|x| narrow(name, x)).collect::<Result<Vec<_>>>()?;
        let accessor = asset.push(&data, 3, ARRAY_BUFFER, FLOAT);
        attributes.insert(name.into(), accessor.into());
        if name == "POSITION" {
            asset.add_bounds(accessor, data.as_chunks().0);
        }
    }
    for array in &vertices.arrays {
        for attribute in Attribute::all(array)? {
            let accessor = asset.push(&attribute.data, attribute.width, ARRAY_BUFFER, FLOAT);
            attributes.insert(attribute.name.clone(), accessor.into());
            lanes.insert(attribute.name, attribute.lanes.into());
        }
    }

    let mut primitive = json!({ "attributes": attributes, "mode": POINTS });
    if !vertices.triangles.is_empty() {
        let accessor = asset.push(vertices.triangles.as_flattened(), 1, ELEMENT_ARRAY_BUFFER, UNSIGNED_INT);
        primitive["indices"] = accessor.into();
        primitive["mode"] = TRIANGLES.into();
    }
    let root = json!({
        "asset": { "version": "2.0", "generator": format!("silhouette {}", vertices.provenance.version) },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{
            "primitives": [primitive],
            "extras": { "provenance": vertices.provenance, "attributes": lanes },
        }],
        "buffers": [{ "byteLength": asset.binary.len() }],
        "bufferViews": asset.views,
        "accessors": asset.accessors,
    });
    let json = root.to_string().into_bytes();

    // Lengths stand in the file as 32-bit integers; 64 bytes cover headers and padding.
    if json.len() + asset.binary.len() + 64 > u32::MAX as usize {
        return Err(Error::file(path, "more than 4 GiB, the limit of binary glTF; write .npz"));
    }
    let glb = Glb {
        header: Header { magic: *b"glTF", version: 2, length: 0 },
        json: Cow::Owned(json),
        bin: Some(Cow::Owned(asset.binary)),
    };
    atomically(path, |file| glb.to_writer(file).map_err(|error| Error::file(path, error)))
}

/// Results as one vertex attribute.
struct Attribute {
    name: String,
    /// Numbers per vertex, 1 to 4.
    width: usize,
    data: Vec<f32>,
    /// Component that every number is.
    lanes: Vec<String>,
}

impl Attribute {
    /// The attributes that hold `array`.
    fn all(array: &Array) -> Result<Vec<Self>> {
        let components = components(array, 1);
        let count = components.len();
        let stem = array.name.strip_prefix("visibility_").filter(|&rest| rest == "sh");
        let stem = stem.unwrap_or_else(|| array.name.strip_suffix("_sh").unwrap_or(&array.name));
        let letters = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_uppercase() } else { '_' });
        let name: String = ['_'].into_iter().chain(letters).collect();
        let packed = count > 4 || array.name.ends_with("_sh");
        let width = if packed { 4 } else { count };

        let lanes = components.chunks(width.max(1)).enumerate();
        lanes
            .map(|(i, lanes)| {
                let row = |row: &[f64]| {
                    let mut numbers = [0.0; 4];
                    for (number, &x) in numbers.iter_mut().zip(&row[4 * i..]) {
                        *number = narrow(&array.name, x)?;
                    }
                    Ok(numbers)
                };
                let rows = array.data.chunks(count).map(row).collect::<Result<Vec<_>>>()?;
                Ok(Self {
                    name: if packed { format!("{name}_{i}") } else { name.clone() },
                    width,
                    data: rows.iter().flat_map(|row| &row[..width]).copied().collect(),
                    lanes: lanes.to_vec(),
                })
            })
            .collect()
    }
}

/// The growing buffer with its views and accessors, one of each per array of numbers.
#[derive(Default)]
struct Asset {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Asset {
    /// Appends `numbers`, all four bytes long so that everything stays aligned, and returns the accessor's index.
    fn push<T: bytemuck::NoUninit>(&mut self, numbers: &[T], width: usize, target: u32, kind: u32) -> usize {
        const { assert!(size_of::<T>() == 4) };
        let bytes: &[u8] = bytemuck::cast_slice(numbers);
        self.views.push(json!({
            "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len(), "target": target,
        }));
        self.binary.extend_from_slice(bytes);
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1,
            "componentType": kind,
            "count": numbers.len() / width,
            "type": TYPES[width - 1],
        }));
        self.accessors.len() - 1
    }

    /// The bounds that an accessor of positions must state.
    fn add_bounds(&mut self, accessor: usize, positions: &[[f32; 3]]) {
        let bound = |pick: fn(f32, f32) -> f32| {
            let positions = positions.iter().copied();
            positions.reduce(|a, b| std::array::from_fn(|axis| pick(a[axis], b[axis])))
        };
        self.accessors[accessor]["min"] = json!(bound(f32::min));
        self.accessors[accessor]["max"] = json!(bound(f32::max));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use gltf::Semantic;
    use gltf::accessor::Iter;
    use gltf::buffer::Data;

    use super::super::tests::tetrahedron;
    use super::*;

    fn written(vertices: &BakedVertices) -> (gltf::Document, Vec<Data>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        write(&path, vertices).unwrap();
        // `import` validates the whole document first.
        let (document, buffers, _) = gltf::import(&path).unwrap();
        (document, buffers)
    }

    fn floats<const N: usize>(document: &gltf::Document, buffers: &[Data], name: &str) -> Vec<[f32; N]>
    where
        [f32; N]: gltf::accessor::Item,
    {
        let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
        let accessor = primitive.get(&Semantic::Extras(name.into())).unwrap_or_else(|| panic!("no attribute {name}"));
        assert_eq!(accessor.dimensions().multiplicity(), N);
        Iter::new(accessor, |buffer| Some(&buffers[buffer.index()].0)).unwrap().collect()
    }

    #[test]
    fn reads_back_by_an_independent_reader() {
        let vertices = tetrahedron();
        let (document, buffers) = written(&vertices);
        let mesh = document.meshes().next().unwrap();
        let primitive = mesh.primitives().next().unwrap();
        let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()].0));
        let positions: Vec<_> = reader.read_positions().unwrap().collect();
        assert_eq!(positions, vertices.positions.iter().map(|p| p.as_vec3().to_array()).collect::<Vec<_>>());
        let normals: Vec<_> = reader.read_normals().unwrap().collect();
        assert_eq!(normals, vertices.normals.iter().map(|n| n.as_vec3().to_array()).collect::<Vec<_>>());
        let indices: Vec<_> = reader.read_indices().unwrap().into_u32().collect();
        assert_eq!(indices, vertices.triangles.as_flattened());
        assert_eq!(primitive.bounding_box().min, [0.0, 0.0, -3.0]);
        assert_eq!(primitive.bounding_box().max, [1.0, 2.0, 0.0]);

        let array = |name: &str| vertices.arrays.get(name).unwrap().data.iter().map(|&x| x as f32).collect::<Vec<_>>();
        // The reader strips the leading underscore.
        assert_eq!(floats::<3>(&document, &buffers, "BENT_NORMAL").as_flattened(), array("bent_normal"));
        assert_eq!(floats::<4>(&document, &buffers, "TRANSFER_0").as_flattened(), array("transfer_sh"));
        let (sh, first, last) = (
            array("visibility_sh"),
            floats::<4>(&document, &buffers, "SH_0"),
            floats::<4>(&document, &buffers, "SH_2"),
        );
        for i in 0..4 {
            assert_eq!(first[i], sh[9 * i..9 * i + 4]);
            assert_eq!(last[i], [sh[9 * i + 8], 0.0, 0.0, 0.0]);
        }
        let occlusion = primitive.get(&Semantic::Extras("AMBIENT_OCCLUSION".into())).unwrap();
        let read: Vec<f32> = Iter::new(occlusion, |buffer| Some(&buffers[buffer.index()].0)).unwrap().collect();
        assert_eq!(read, array("ambient_occlusion"));

        let extras: Value = serde_json::from_str(mesh.extras().as_ref().unwrap().get()).unwrap();
        assert_eq!(extras["attributes"]["_SH_0"], json!(["sh.l0.m0", "sh.l1.m-1", "sh.l1.m0", "sh.l1.m1"]));
        assert_eq!(extras["provenance"]["sh_phase"], "no Condon-Shortley");
    }

    #[test]
    fn the_file_keeps_the_letter_of_the_specification() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        write(&path, &tetrahedron()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!(&bytes[..4], b"glTF");
        assert_eq!((word(4), word(8)), (2, bytes.len()));
        assert_eq!(&bytes[16..20], b"JSON");
        let json_length = word(12);
        assert_eq!(json_length % 4, 0);
        assert_eq!(&bytes[20 + json_length + 4..20 + json_length + 8], b"BIN\0");
        assert_eq!(28 + json_length + word(20 + json_length), bytes.len());
        let root: Value = serde_json::from_slice(&bytes[20..20 + json_length]).unwrap();
        for view in root["bufferViews"].as_array().unwrap() {
            assert_eq!(view["byteOffset"].as_u64().unwrap() % 4, 0);
        }
        assert_eq!(root["buffers"][0]["byteLength"], word(20 + json_length));
    }

    #[test]
    fn loose_points_and_emptiness() {
        let mut vertices = tetrahedron();
        vertices.triangles = Arc::from([]);
        let (document, _) = written(&vertices);
        let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
        assert_eq!(primitive.mode(), gltf::mesh::Mode::Points);
        vertices.positions.clear();
        assert!(write(Path::new("a.glb"), &vertices).unwrap_err().to_string().contains("no vertices"));
    }
}
