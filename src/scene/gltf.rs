use std::path::Path;

use glam::{DAffine3, DQuat, DVec3, Vec3};
use gltf::scene::Transform;
use gltf::{Document, Gltf, Node, Primitive, Skin, buffer};

use super::gltf_read::{Checked, affine, influences, joints, morphed_positions, skinned, triangles};
use super::{Material, Mesh};
use crate::{Error, Result};

/// Reads the meshes of the default scene of a glTF 2 file, text (`.gltf`) or binary (`.glb`), placed by their nodes: one
/// mesh per primitive.
///
/// A material's base colour factor is its albedo; textures are left out. Skinned meshes stand in the pose that the nodes
/// have without any animation, morph targets have their default weights. Points and lines are left out.
///
/// # Errors
/// A malformed or truncated file, a missing or short buffer, a required extension that is not supported, accessors of a
/// wrong type or reaching beyond their buffer, indices out of range, nodes in a circle, no scene or no triangles.
pub(super) fn load(path: &Path) -> Result<Vec<Mesh>> {
    read(path).map_err(|message| Error::file(path, message.split_whitespace().collect::<Vec<_>>().join(" ")))
}

/// A document whose parts can be looked up without surprises, and what its buffers hold.
pub(crate) fn open(path: &Path) -> Checked<(Document, Vec<buffer::Data>)> {
    let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
    let Gltf { document, blob } = Gltf::from_slice_without_validation(&bytes).map_err(|e| e.to_string())?;
    let json = document.into_json();
    check_attributes(&json)?;
    let document = Document::from_json(json).map_err(|e| e.to_string())?;
    let version = &document.as_json().asset.version;
    if !version.starts_with("2.") {
        return Err(format!("glTF version {version}; only 2 is supported"));
    }
    for buffer in document.buffers() {
        if let buffer::Source::Uri(uri) = buffer.source()
            && urlencoding::decode(uri).is_err()
        {
            return Err(format!("buffer {}: the URI `{uri}` is not valid", buffer.index()));
        }
    }
    let buffers = gltf::import_buffers(&document, path.parent(), blob).map_err(|e| e.to_string())?;
    Ok((document, buffers))
}

/// The nodes of the default scene in file order, each with its parent, which comes before it.
pub(crate) fn scene_nodes(document: &Document) -> Checked<Vec<(Node<'_>, Option<usize>)>> {
    let scene = document.default_scene().or_else(|| document.scenes().next()).ok_or("no scene in this file")?;
    let mut seen = vec![false; document.nodes().len()];
    let mut nodes = Vec::new();
    let mut pending: Vec<(Node, Option<usize>)> = scene.nodes().map(|node| (node, None)).collect();
    pending.reverse();
    while let Some((node, parent)) = pending.pop() {
        let index = node.index();
        if std::mem::replace(&mut seen[index], true) {
            return Err(format!("node {index} is reached twice; nodes must form a tree"));
        }
        let children = pending.len();
        pending.extend(node.children().map(|child| (child, Some(index))));
        pending[children..].reverse();
        nodes.push((node, parent));
    }
    Ok(nodes)
}

/// The name of a node, or its number.
pub(crate) fn node_name(node: &Node) -> String {
    node.name().map_or_else(|| format!("node {}", node.index()), str::to_owned)
}

/// The name and colour of a primitive's material.
pub(crate) fn material(primitive: &Primitive) -> Material {
    let [red, green, blue, _] = primitive.material().pbr_metallic_roughness().base_color_factor();
    Material { name: primitive.material().name().unwrap_or("default").to_owned(), albedo: Vec3::new(red, green, blue) }
}

fn read(path: &Path) -> Checked<Vec<Mesh>> {
    let (document, buffers) = open(path)?;
    let nodes = scene_nodes(&document)?;
    let mut worlds = vec![None; document.nodes().len()];
    for (node, parent) in &nodes {
        let parent = parent.and_then(|parent| worlds[parent]).unwrap_or(DAffine3::IDENTITY);
        worlds[node.index()] = Some(parent * local(node));
    }

    let mut meshes = Vec::new();
    for (node, _) in &nodes {
        let Some(mesh) = node.mesh() else { continue };
        let name = node.name().or(mesh.name()).map_or_else(|| format!("node {}", node.index()), str::to_owned);
        let weights = node.weights().or(mesh.weights()).unwrap_or(&[]);
        let joints = node.skin().map(|skin| joint_transforms(&skin, &worlds, &buffers)).transpose()?;
        for primitive in mesh.primitives() {
            let place = |e: String| format!("mesh `{name}`, primitive {}: {e}", primitive.index());
            let Some(triangles) = triangles(&primitive, &buffers).map_err(place)? else { continue };
            let mut positions = morphed_positions(&primitive, weights, &buffers).map_err(place)?;
            let mut transform = worlds[node.index()].unwrap_or(DAffine3::IDENTITY);
            if let Some(joints) = &joints {
                let influences = influences(&primitive, positions.len(), joints.len(), &buffers).map_err(place)?;
                for (p, influences) in positions.iter_mut().zip(&influences) {
                    *p = skinned(*p, influences, joints);
                }
                // Where the skinned node itself stands does not count.
                transform = DAffine3::IDENTITY;
            }
            let material = material(&primitive);
            let mesh = Mesh { name: name.clone(), positions, triangles, material };
            meshes.push(mesh.transformed(transform));
        }
    }
    if meshes.iter().all(|mesh| mesh.triangles.is_empty()) {
        return Err("no triangles in this file".into());
    }
    Ok(meshes)
}

/// The parser's own validation looks the accessor of the positions up before it asks whether there is one, and panics
/// (gltf-json 1.4.1, mesh.rs, `primitive_validate_hook`): this comes before it.
fn check_attributes(json: &gltf::json::Root) -> Checked<()> {
    let accessors = json.accessors.len();
    for (i, mesh) in json.meshes.iter().enumerate() {
        let mut indices = mesh.primitives.iter().flat_map(|primitive| primitive.attributes.values());
        if let Some(bad) = indices.find(|index| index.value() >= accessors) {
            return Err(format!("mesh {i} refers to accessor {}, but there are only {accessors}", bad.value()));
        }
    }
    Ok(())
}

/// Where a node stands in its parent's frame.
pub(crate) fn local(node: &Node) -> DAffine3 {
    match node.transform() {
        Transform::Matrix { matrix } => affine(matrix),
        Transform::Decomposed { translation, rotation, scale } => {
            let rotation = DQuat::from_array(rotation.map(f64::from));
            let length = rotation.length();
            let rotation = if length > 0.0 { rotation / length } else { DQuat::IDENTITY };
            let [scale, translation] = [scale, translation].map(|v| DVec3::from_array(v.map(f64::from)));
            DAffine3::from_scale_rotation_translation(scale, rotation, translation)
        }
    }
}

/// What carries a vertex from the mesh's space into the world, for every joint.
fn joint_transforms(skin: &Skin, worlds: &[Option<DAffine3>], buffers: &[buffer::Data]) -> Checked<Vec<DAffine3>> {
    let place = |(joint, bind): (usize, DAffine3)| {
        let world = worlds[joint].ok_or_else(|| format!("joint node {joint} is not in the scene"))?;
        Ok(world * bind)
    };
    joints(skin, buffers)?.into_iter().map(place).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use serde_json::{Value, json};

    use super::*;

    /// A right angle at the origin with legs of 1 along x and y, drawn twice: as it is and, by the second node, mirrored.
    /// Its buffer holds three positions, three indices padded to four, three joints, three weights and two bind matrices.
    fn document() -> Value {
        json!({
            "asset": { "version": "2.0" },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [
                { "name": "right", "mesh": 0, "translation": [10, 0, 0], "children": [1] },
                { "name": "left", "mesh": 0, "scale": [-2, 1, 1], "rotation": [0, 0, 0.5f64.sqrt(), 0.5f64.sqrt()] }
            ],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }] }],
            "materials": [{ "name": "red", "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 0.125, 1] } }],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3, "min": [0, 0, 0], "max": [1, 1, 0] },
                { "bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 3 },
                { "bufferView": 2, "componentType": 5121, "type": "VEC4", "count": 3 },
                { "bufferView": 3, "componentType": 5121, "type": "VEC4", "count": 3, "normalized": true },
                { "bufferView": 4, "componentType": 5126, "type": "MAT4", "count": 2 }
            ],
            "bufferViews": [
                { "buffer": 0, "byteOffset": 0, "byteLength": 36 },
                { "buffer": 0, "byteOffset": 36, "byteLength": 8 },
                { "buffer": 0, "byteOffset": 44, "byteLength": 12 },
                { "buffer": 0, "byteOffset": 56, "byteLength": 12 },
                { "buffer": 0, "byteOffset": 68, "byteLength": 128 }
            ],
            "buffers": [{ "byteLength": 196, "uri": "mesh.bin" }]
        })
    }

    fn buffer() -> Vec<u8> {
        let positions = [[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.]];
        let mut bytes: Vec<u8> = positions.as_flattened().iter().copied().flat_map(f32::to_le_bytes).collect();
        bytes.extend([0u16, 1, 2, 0].into_iter().flat_map(u16::to_le_bytes));
        // The first corner hangs on joint 0, the second on joint 1, the third on both alike.
        bytes.extend([0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]);
        bytes.extend([255, 0, 0, 0, 200, 0, 0, 0, 100, 100, 0, 0]);
        // Bind matrices: moves by -x and by -y.
        for offset in [[-1f32, 0.], [0., -1.]] {
            let columns = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.], [offset[0], offset[1], 0., 1.]];
            bytes.extend(columns.as_flattened().iter().copied().flat_map(f32::to_le_bytes));
        }
        bytes
    }

    fn load_document(document: &Value) -> Result<Vec<Mesh>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.gltf");
        fs::write(&path, document.to_string()).unwrap();
        fs::write(folder.path().join("mesh.bin"), buffer()).unwrap();
        load(&path)
    }

    fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let chunk = |kind: &[u8; 4], data: &[u8]| [&(data.len() as u32).to_le_bytes(), &kind[..], data].concat();
        let chunks = [chunk(b"JSON", &text), chunk(b"BIN\0", binary)].concat();
        [&b"glTF"[..], &2u32.to_le_bytes(), &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
    }

    #[test]
    fn nodes_place_meshes_and_mirrors_keep_the_outside() {
        let meshes = load_document(&document()).unwrap();
        assert_eq!(meshes.iter().map(|mesh| mesh.name.as_str()).collect::<Vec<_>>(), ["right", "left"]);
        let expected = [[10., 0., 0.], [11., 0., 0.], [10., 1., 0.]].map(Vec3::from_array);
        assert_eq!((&meshes[0].positions[..], &meshes[0].triangles[..]), (&expected[..], &[[0, 1, 2]][..]));
        // Scaled to (-2, 0, 0) and (0, 1, 0), turned a quarter, moved with the parent.
        let expected = [[10., 0., 0.], [10., -2., 0.], [9., 0., 0.]].map(Vec3::from_array);
        for (position, expected) in meshes[1].positions.iter().zip(expected) {
            assert!(position.distance(expected) < 1e-6, "{position}");
        }
        assert_eq!(meshes[1].triangles, [[0, 2, 1]]);
        let material = Material { name: "red".into(), albedo: Vec3::new(0.5, 0.25, 0.125) };
        assert!(meshes.iter().all(|mesh| mesh.material == material));
    }

    #[test]
    fn binary_files_and_matrices_are_read() {
        let mut document = document();
        document["buffers"][0].as_object_mut().unwrap().remove("uri");
        document["nodes"] = json!([{ "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 7, 1] }]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.glb");
        let whole = glb(&document, &buffer());
        fs::write(&path, &whole).unwrap();
        let meshes = load(&path).unwrap();
        assert_eq!((meshes[0].name.as_str(), meshes[0].positions[1]), ("node 0", Vec3::new(1.0, 0.0, 7.0)));
        for length in (0..whole.len()).step_by(7) {
            fs::write(&path, &whole[..length]).unwrap();
            let message = load(&path).unwrap_err().to_string();
            assert!(message.contains("mesh.glb: ") && !message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn strips_fans_and_missing_indices() {
        let triangles = |mode: u32, indices: bool| {
            let mut document = document();
            document["nodes"] = json!([{ "mesh": 0 }]);
            let primitive = &mut document["meshes"][0]["primitives"][0];
            primitive["mode"] = mode.into();
            match indices {
                true => document["accessors"][1]["count"] = 4.into(),
                false => drop(primitive.as_object_mut().unwrap().remove("indices")),
            }
            load_document(&document).map(|meshes| meshes[0].triangles.clone())
        };
        assert_eq!(triangles(4, false).unwrap(), [[0, 1, 2]]);
        assert_eq!(triangles(5, true).unwrap(), [[0, 1, 2], [2, 1, 0]]);
        assert_eq!(triangles(6, true).unwrap(), [[0, 1, 2], [0, 2, 0]]);
        assert!(triangles(4, true).unwrap_err().to_string().contains("4 indices do not make whole triangles"));
        assert!(triangles(1, true).unwrap_err().to_string().contains("no triangles"));
    }

    #[test]
    fn skins_stand_in_rest_pose() {
        let mut document = document();
        document["nodes"] = json!([
            { "mesh": 0, "skin": 0, "translation": [99, 99, 99], "children": [1, 2] },
            { "translation": [1, 0, 5], "name": "joint that undoes its bind matrix, and lifts" },
            { "translation": [0, 1, -5] }
        ]);
        // Joints hang below the skinned node here, so that its own place counts through them and only once.
        document["skins"] = json!([{ "joints": [1, 2], "inverseBindMatrices": 4 }]);
        document["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3 });
        let meshes = load_document(&document).unwrap();
        let expected = [[99., 99., 104.], [100., 99., 94.], [99., 100., 99.]].map(Vec3::from_array);
        assert_eq!(meshes[0].positions, expected);

        document["skins"][0]["joints"] = json!([1]);
        assert!(load_document(&document).unwrap_err().to_string().contains("no joint 1"));
        document["scenes"][0]["nodes"] = json!([3]);
        document["nodes"].as_array_mut().unwrap().push(json!({ "mesh": 0, "skin": 0 }));
        assert!(load_document(&document).unwrap_err().to_string().contains("joint node 1 is not in the scene"));
    }

    #[test]
    fn morph_targets_have_their_default_weights() {
        let mut document = document();
        document["nodes"] = json!([{ "mesh": 0 }]);
        document["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 0 }]);
        document["meshes"][0]["weights"] = json!([0.5]);
        assert_eq!(load_document(&document).unwrap()[0].positions[1], Vec3::new(1.5, 0.0, 0.0));
        document["nodes"][0]["weights"] = json!([0.0]);
        assert_eq!(load_document(&document).unwrap()[0].positions[1], Vec3::X);
    }

    #[test]
    fn bad_files_are_refused_in_one_line() {
        let refused = |path: &str, value: Value, why: &str| {
            let mut document = document();
            *document.pointer_mut(path).unwrap() = value;
            let message = load_document(&document).expect_err(path).to_string();
            assert!(message.contains("mesh.gltf: ") && message.contains(why), "{message}");
            assert!(!message.contains('\n'), "{message}");
        };
        refused("/asset/version", json!("1.0"), "version 1.0; only 2");
        refused("/scenes", json!([]), "");
        refused("/scenes/0/nodes", json!([]), "no triangles");
        refused("/scenes/0/nodes", json!([9]), "");
        refused("/nodes/1", json!({ "children": [0] }), "node 0 is reached twice");
        refused("/nodes/0/children", json!([1, 1]), "node 1 is reached twice");
        refused("/accessors/0/componentType", json!(5125), "must hold Vec3 of F32");
        refused("/accessors/0/type", json!("VEC2"), "must hold Vec3 of F32");
        refused("/accessors/1/componentType", json!(5126), "must hold Scalar of U32");
        refused("/accessors/1/bufferView", json!(3), "refers to vertex 255");
        refused("/accessors/1/count", json!(0), "impossible size");
        refused("/accessors/1/count", json!(1_000), "reaches beyond its buffer");
        refused("/accessors/1/count", json!(u64::MAX / 2), "impossible size");
        refused("/accessors/1/bufferView", json!(17), "");
        refused("/bufferViews/0/byteOffset", json!(u64::MAX - 3), "impossible size");
        refused("/bufferViews/0/byteLength", json!(1_000_000), "reaches beyond its buffer");
        refused("/bufferViews/0", json!({ "buffer": 0, "byteLength": 36, "byteStride": 4 }), "stride below");
        refused("/buffers/0/byteLength", json!(1_000_000), "");
        refused("/buffers/0/uri", json!("missing.bin"), "");
        refused("/buffers/0/uri", json!("%ff.bin"), "URI `%ff.bin` is not valid");
        let mut document = document();
        document["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
        let message = load_document(&document).unwrap_err().to_string();
        assert!(message.contains("extensionsRequired") && !message.contains('\n'), "{message}");
        assert!(load(Path::new("missing.glb")).unwrap_err().to_string().starts_with("missing.glb: "));
    }
}
