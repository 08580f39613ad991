use std::path::Path;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3};
use gltf::accessor::{DataType, Dimensions, Item, Iter};
use gltf::mesh::Mode;
use gltf::scene::Transform;
use gltf::{Accessor, Document, Gltf, Node, Primitive, Semantic, Skin, buffer};

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

type Checked<T> = std::result::Result<T, String>;

fn read(path: &Path) -> Checked<Vec<Mesh>> {
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
    let scene = document.default_scene().or_else(|| document.scenes().next()).ok_or("no scene in this file")?;

    // Nodes of the scene in file order, with their place in the world.
    let mut worlds = vec![None; document.nodes().len()];
    let mut nodes = Vec::new();
    let mut pending: Vec<(Node, DAffine3)> = scene.nodes().map(|node| (node, DAffine3::IDENTITY)).collect();
    pending.reverse();
    while let Some((node, parent)) = pending.pop() {
        let world = parent * local(&node);
        if worlds[node.index()].replace(world).is_some() {
            return Err(format!("node {} is reached twice; nodes must form a tree", node.index()));
        }
        let children = pending.len();
        pending.extend(node.children().map(|child| (child, world)));
        pending[children..].reverse();
        nodes.push(node);
    }

    let mut meshes = Vec::new();
    for node in &nodes {
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
                skin(&mut positions, &primitive, joints, &buffers).map_err(place)?;
                // Where the skinned node itself stands does not count.
                transform = DAffine3::IDENTITY;
            }
            let [red, green, blue, _] = primitive.material().pbr_metallic_roughness().base_color_factor();
            let material = Material {
                name: primitive.material().name().unwrap_or("default").to_owned(),
                albedo: Vec3::new(red, green, blue),
            };
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

fn local(node: &Node) -> DAffine3 {
    match node.transform() {
        Transform::Matrix { matrix } => {
            DAffine3::from_mat4(DMat4::from_cols_array_2d(&matrix.map(|c| c.map(f64::from))))
        }
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
    let inverse_bind = match skin.inverse_bind_matrices() {
        Some(accessor) => values::<[[f32; 4]; 4]>(&accessor, Dimensions::Mat4, DataType::F32, buffers)?,
        None => Vec::new(),
    };
    let joints = skin.joints().enumerate().map(|(i, joint)| {
        let world = worlds[joint.index()].ok_or_else(|| format!("joint node {} is not in the scene", joint.index()))?;
        let bind = match inverse_bind.get(i) {
            Some(matrix) => DAffine3::from_mat4(DMat4::from_cols_array_2d(&matrix.map(|c| c.map(f64::from)))),
            None if inverse_bind.is_empty() => DAffine3::IDENTITY,
            None => return Err(format!("skin {} has fewer inverse bind matrices than joints", skin.index())),
        };
        Ok(world * bind)
    });
    joints.collect()
}

/// The triangles of a primitive; `None` for points and lines.
fn triangles(primitive: &Primitive, buffers: &[buffer::Data]) -> Checked<Option<Vec<[u32; 3]>>> {
    let mode = primitive.mode();
    if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        return Ok(None);
    }
    let positions = primitive.get(&Semantic::Positions).ok_or("no positions")?;
    let indices: Vec<u32> = match primitive.indices() {
        None => (0..u32::try_from(positions.count()).map_err(|e| e.to_string())?).collect(),
        Some(accessor) => match accessor.data_type() {
            DataType::U8 => {
                values::<u8>(&accessor, Dimensions::Scalar, DataType::U8, buffers)?.into_iter().map(u32::from).collect()
            }
            DataType::U16 => values::<u16>(&accessor, Dimensions::Scalar, DataType::U16, buffers)?
                .into_iter()
                .map(u32::from)
                .collect(),
            _ => values::<u32>(&accessor, Dimensions::Scalar, DataType::U32, buffers)?,
        },
    };
    if let Some(index) = indices.iter().find(|&&index| index as usize >= positions.count()) {
        return Err(format!("refers to vertex {index}, but there are only {}", positions.count()));
    }
    if mode == Mode::Triangles && !indices.len().is_multiple_of(3) {
        return Err(format!("{} indices do not make whole triangles", indices.len()));
    }
    Ok(Some(match mode {
        Mode::Triangles => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        Mode::TriangleFan => indices.windows(2).skip(1).map(|pair| [indices[0], pair[0], pair[1]]).collect(),
        // Every other triangle of a strip is turned round.
        _ => (indices.windows(3).enumerate())
            .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
            .collect(),
    }))
}

fn morphed_positions(primitive: &Primitive, weights: &[f32], buffers: &[buffer::Data]) -> Checked<Vec<Vec3>> {
    let read = |accessor: &Accessor| values::<[f32; 3]>(accessor, Dimensions::Vec3, DataType::F32, buffers);
    let base = read(&primitive.get(&Semantic::Positions).ok_or("no positions")?)?;
    let mut positions: Vec<DVec3> = base.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
    let targets = primitive.morph_targets().zip(weights).filter(|(_, weight)| **weight != 0.0);
    for (accessor, &weight) in targets.filter_map(|(target, weight)| Some((target.positions()?, weight))) {
        let offsets = read(&accessor)?;
        if offsets.len() != positions.len() {
            return Err("a morph target has another number of vertices".into());
        }
        for (p, offset) in positions.iter_mut().zip(offsets) {
            *p += f64::from(weight) * DVec3::from_array(offset.map(f64::from));
        }
    }
    Ok(positions.iter().map(|p| p.as_vec3()).collect())
}

/// Moves vertices to where their joints carry them: linear blending.
fn skin(positions: &mut [Vec3], primitive: &Primitive, joints: &[DAffine3], buffers: &[buffer::Data]) -> Checked<()> {
    let mut blended = vec![(DAffine3::from_mat3(DMat3::ZERO), 0.0); positions.len()];
    for set in 0.. {
        let Some(accessor) = primitive.get(&Semantic::Joints(set)) else { break };
        let indices: Vec<[u16; 4]> = match accessor.data_type() {
            DataType::U8 => values::<[u8; 4]>(&accessor, Dimensions::Vec4, DataType::U8, buffers)?
                .into_iter()
                .map(|j| j.map(u16::from))
                .collect(),
            _ => values(&accessor, Dimensions::Vec4, DataType::U16, buffers)?,
        };
        let accessor = primitive.get(&Semantic::Weights(set)).ok_or("joints without weights")?;
        let weights: Vec<[f64; 4]> = match accessor.data_type() {
            DataType::U8 => values::<[u8; 4]>(&accessor, Dimensions::Vec4, DataType::U8, buffers)?
                .into_iter()
                .map(|w| w.map(f64::from))
                .collect(),
            DataType::U16 => values::<[u16; 4]>(&accessor, Dimensions::Vec4, DataType::U16, buffers)?
                .into_iter()
                .map(|w| w.map(f64::from))
                .collect(),
            _ => values::<[f32; 4]>(&accessor, Dimensions::Vec4, DataType::F32, buffers)?
                .into_iter()
                .map(|w| w.map(f64::from))
                .collect(),
        };
        if indices.len() != positions.len() || weights.len() != positions.len() {
            return Err("joints or weights have another number of vertices".into());
        }
        for ((sum, total), (indices, weights)) in blended.iter_mut().zip(indices.into_iter().zip(weights)) {
            for (index, weight) in indices.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0) {
                let joint = joints.get(usize::from(index)).ok_or_else(|| format!("there is no joint {index}"))?;
                sum.matrix3 += joint.matrix3 * weight;
                sum.translation += joint.translation * weight;
                *total += weight;
            }
        }
    }
    for (i, (p, (sum, total))) in positions.iter_mut().zip(blended).enumerate() {
        if total.is_nan() || total <= 0.0 {
            return Err(format!("no joint holds vertex {i}: its weights add up to {total}"));
        }
        *p = (sum.transform_point3(p.as_dvec3()) / total).as_vec3();
    }
    Ok(())
}

/// An accessor's values, after checks that keep the reader from panicking.
fn values<T: Item>(
    accessor: &Accessor,
    shape: Dimensions,
    kind: DataType,
    buffers: &[buffer::Data],
) -> Checked<Vec<T>> {
    let refuse = |why: &str| Err(format!("accessor {} {why}", accessor.index()));
    if accessor.dimensions() != shape || accessor.data_type() != kind {
        return refuse(&format!("must hold {shape:?} of {kind:?}"));
    }
    let views = [
        accessor.view(),
        accessor.sparse().map(|sparse| sparse.indices().view()),
        accessor.sparse().map(|sparse| sparse.values().view()),
    ];
    let sparse_count = accessor.sparse().map_or(1, |sparse| sparse.count());
    // Sizes and offsets below these cannot overflow when they are multiplied and added.
    let is_sane = |view: &buffer::View| {
        let offsets = [view.offset(), view.length()];
        offsets.iter().all(|&n| n < 1 << 40) && view.stride().is_none_or(|stride| (1..1 << 16).contains(&stride))
    };
    let is_counted = [accessor.count(), sparse_count].iter().all(|n| (1..1 << 32).contains(n));
    if !is_counted || accessor.offset() >= 1 << 40 || !views.iter().flatten().all(is_sane) {
        return refuse("has an impossible size");
    }
    if views[0].as_ref().is_some_and(|view| view.stride().is_some_and(|stride| stride < size_of::<T>())) {
        return refuse("has a stride below the size of its elements");
    }
    if views[0].is_none() && accessor.sparse().is_none() {
        return refuse("has no buffer view");
    }
    match Iter::new(accessor.clone(), |buffer: buffer::Buffer| buffers.get(buffer.index()).map(|data| &data.0[..])) {
        Some(values) => Ok(values.collect()),
        None => refuse("reaches beyond its buffer"),
    }
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
