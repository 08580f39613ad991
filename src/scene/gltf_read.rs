//! Reading the numbers that a glTF file refers to.

use glam::{DAffine3, DMat3, DMat4, DVec3, Vec3};
use gltf::accessor::{DataType, Dimensions, Item, Iter};
use gltf::mesh::Mode;
use gltf::{Accessor, Node, Primitive, Semantic, Skin, buffer};
use smallvec::SmallVec;

/// What is wrong is told in one line; the caller names the file.
pub(crate) type Checked<T> = std::result::Result<T, String>;

/// The triangles of a primitive; `None` for points and lines.
pub(crate) fn triangles(primitive: &Primitive, buffers: &[buffer::Data]) -> Checked<Option<Vec<[u32; 3]>>> {
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

/// The positions of a primitive with its morph targets at these weights.
pub(crate) fn morphed_positions(
    primitive: &Primitive,
    weights: &[f32],
    buffers: &[buffer::Data],
) -> Checked<Vec<Vec3>> {
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

/// The joints that hold a vertex, by their place in the skin, each with its weight; none of them 0.
pub(crate) type Influences = SmallVec<[(u16, f64); 4]>;

/// What holds every vertex of a primitive whose skin has so many joints.
pub(crate) fn influences(
    primitive: &Primitive,
    vertices: usize,
    joints: usize,
    buffers: &[buffer::Data],
) -> Checked<Vec<Influences>> {
    let mut influences = vec![Influences::new(); vertices];
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
        if indices.len() != vertices || weights.len() != vertices {
            return Err("joints or weights have another number of vertices".into());
        }
        for (influences, (indices, weights)) in influences.iter_mut().zip(indices.into_iter().zip(weights)) {
            influences.extend(indices.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0));
        }
    }
    for (i, influences) in influences.iter().enumerate() {
        if let Some((index, _)) = influences.iter().find(|(index, _)| usize::from(*index) >= joints) {
            return Err(format!("there is no joint {index}"));
        }
        let total: f64 = influences.iter().map(|(_, weight)| weight).sum();
        if total.is_nan() || total <= 0.0 {
            return Err(format!("no joint holds vertex {i}: its weights add up to {total}"));
        }
    }
    Ok(influences)
}

/// Where the joints of a skin carry a vertex: linear blending.
pub(crate) fn skinned(p: Vec3, influences: &Influences, joints: &[DAffine3]) -> Vec3 {
    let (mut sum, mut total) = (DAffine3::from_mat3(DMat3::ZERO), 0.0);
    for &(index, weight) in influences {
        let joint = &joints[usize::from(index)];
        sum.matrix3 += joint.matrix3 * weight;
        sum.translation += joint.translation * weight;
        total += weight;
    }
    (sum.transform_point3(p.as_dvec3()) / total).as_vec3()
}

/// The joints of a skin: their nodes, and what carries a vertex from the mesh's space into theirs.
pub(crate) fn joints(skin: &Skin, buffers: &[buffer::Data]) -> Checked<Vec<(usize, DAffine3)>> {
    let inverse_bind = match skin.inverse_bind_matrices() {
        Some(accessor) => values::<[[f32; 4]; 4]>(&accessor, Dimensions::Mat4, DataType::F32, buffers)?,
        None => Vec::new(),
    };
    let joint = |(i, joint): (usize, Node)| match inverse_bind.get(i) {
        Some(matrix) => Ok((joint.index(), affine(*matrix))),
        None if inverse_bind.is_empty() => Ok((joint.index(), DAffine3::IDENTITY)),
        None => Err(format!("skin {} has fewer inverse bind matrices than joints", skin.index())),
    };
    skin.joints().enumerate().map(joint).collect()
}

/// A matrix as the format stores it, column by column.
pub(crate) fn affine(columns: [[f32; 4]; 4]) -> DAffine3 {
    DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns.map(|column| column.map(f64::from))))
}

/// An accessor's values, after checks that keep the reader from panicking.
pub(crate) fn values<T: Item>(
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
