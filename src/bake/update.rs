use std::collections::{HashMap, HashSet};

use glam::{DVec3, Vec3};

use super::{Array, Arrays, Partial, Provenance, Receivers};
use crate::scene::{FaceTree, Geometry};
use crate::{Error, Result};

/// What of a scene has moved since an earlier bake: the triangles that are only in the one or only in the other.
pub struct Changes {
    /// Boxes around what has gone and what has come, one for each mesh before and after.
    boxes: Vec<[DVec3; 2]>,
    /// Faces of the scene after that were there before.
    stayed: Vec<bool>,
    /// Those faces alone, which may hide what has moved.
    standing: FaceTree,
}

/// A triangle by its corners' bits, whichever stands first.
type Corners = [[u32; 3]; 3];

impl Changes {
    /// Compares two states of a scene. Triangles are the same if their corners are, to the bit; names do not matter.
    pub fn between(before: &Geometry, after: &Geometry) -> Self {
        let corners = |geometry: &Geometry| geometry.triangles.iter().map(|&face| key(geometry, face)).collect();
        let [old, new]: [Vec<Corners>; 2] = [before, after].map(corners);
        let [old_set, new_set]: [HashSet<&Corners>; 2] = [&old, &new].map(|keys| keys.iter().collect());
        let stayed: Vec<bool> = new.iter().map(|corners| old_set.contains(corners)).collect();
        let mut boxes = changed_boxes(before, |face| !new_set.contains(&old[face]));
        boxes.extend(changed_boxes(after, |face| !stayed[face]));
        let faces = after.triangles.iter().zip(&stayed).filter(|(_, stayed)| **stayed).map(|(&face, _)| face);
        let standing = FaceTree::new(after.positions.clone(), faces.collect());
        Self { boxes, stayed, standing }
    }

    /// Whether something has moved.
    pub fn is_empty(&self) -> bool {
        self.boxes.is_empty()
    }

    /// The part of an earlier result, `earlier` with its `positions` and `normals`, that holds for `receivers` after the
    /// changes: that of the vertices where nothing that has moved is above the horizon, unless one face that stands still
    /// hides all of it.
    ///
    /// A receiver is known by its position, normal and own faces; it takes over the row of its old self to the bit. What is
    /// computed anew may differ from that by rounding, as vertices have other numbers.
    ///
    /// # Errors
    /// An earlier result without positions or normals, or whose arrays are not of one length.
    pub fn still_valid(&self, earlier: &Arrays, receivers: &Receivers, provenance: &Provenance) -> Result<Partial> {
        let vectors = |name: &str| {
            let array = earlier.get(name).filter(|array| matches!(array.shape[..], [_, 3]));
            array.ok_or_else(|| Error::input(format!("no array `{name}` of three columns: not the result of a bake")))
        };
        let (positions, normals) = (vectors("positions")?, vectors("normals")?);
        let count = positions.shape[0];
        let rows: Vec<&Array> = earlier.iter().filter(|array| !OTHERS.contains(&array.name.as_str())).collect();
        if let Some(array) = rows.iter().copied().chain([normals]).find(|array| array.shape.first() != Some(&count)) {
            return Err(Error::input(format!("array {}: not one row for each of {count} positions", array.name)));
        }
        let bits = |p: &[f64], n: &[f64]| [p[0], p[1], p[2], n[0], n[1], n[2]].map(f64::to_bits);
        let points = positions.data.chunks_exact(3).zip(normals.data.chunks_exact(3));
        let row_of: HashMap<_, usize> = points.enumerate().map(|(row, (p, n))| (bits(p, n), row)).collect();

        let old_row = |index: usize| {
            let receiver = receivers.get(index);
            let normal = receiver.normal?;
            let row = *row_of.get(&bits(&receiver.position.to_array(), &normal.to_array()))?;
            let is_the_same = receiver.excluded.iter().all(|&face| self.stayed[face as usize]);
            (is_the_same && !self.may_matter(receiver.position, normal)).then_some(row)
        };
        let old_rows: Vec<Option<usize>> = (0..receivers.len()).map(old_row).collect();
        let mut arrays = Arrays::new();
        for array in rows {
            let width = array.data.len() / count.max(1);
            let row = |old: &Option<usize>| match old {
                Some(row) => array.data[row * width..(row + 1) * width].to_vec(),
                None => vec![0.0; width],
            };
            let shape: Vec<usize> = [receivers.len()].into_iter().chain(array.shape[1..].iter().copied()).collect();
            arrays.push(Array::new(array.name.as_str(), shape, old_rows.iter().flat_map(row).collect()))?;
        }
        Ok(Partial { arrays, done: old_rows.iter().map(Option::is_some).collect(), provenance: provenance.clone() })
    }

    /// Whether the result of a receiver can depend on what has moved.
    fn may_matter(&self, position: DVec3, normal: DVec3) -> bool {
        self.boxes.iter().any(|&[low, high]| {
            let highest = DVec3::select(normal.cmpgt(DVec3::ZERO), high, low);
            // What lies in the horizon to rounding is above it.
            let reach = highest - position;
            normal.dot(reach) > -1e-9 * reach.abs().element_sum() && !self.is_hidden([low, high], position)
        })
    }

    /// Whether one face that stands still hides a box.
    fn is_hidden(&self, [low, high]: [DVec3; 2], position: DVec3) -> bool {
        let mut is_hidden = false;
        self.standing.visit(position, 0.5 * (low + high) - position, |face| {
            let [a, b, c] = self.standing.corners(face).map(|corner| corner.as_dvec3() - position);
            // Planes through the receiver and a side, and the face's own, all facing away from the inside of the shadow.
            let plane = (b - a).cross(c - a);
            let facing = plane.dot(a);
            let sides = [a.cross(b), b.cross(c), c.cross(a)];
            let outside = |normal: DVec3, offset: f64| {
                let toward = if facing > 0.0 { normal } else { -normal };
                let nearest = DVec3::select(toward.cmpgt(DVec3::ZERO), low, high) - position;
                let offset = if facing > 0.0 { offset } else { -offset };
                // Rounding must not hide anything.
                let slack = 1e-9 * toward.abs().dot(nearest.abs().max(low.abs().max(high.abs())));
                toward.dot(nearest) <= offset + slack
            };
            is_hidden = facing != 0.0 && !outside(plane, facing) && sides.iter().all(|&side| !outside(side, 0.0));
            if is_hidden { std::ops::ControlFlow::Break(()) } else { std::ops::ControlFlow::Continue(()) }
        });
        is_hidden
    }
}

/// What stands beside the results of a bake.
const OTHERS: [&str; 3] = ["positions", "normals", "triangles"];

fn key(geometry: &Geometry, face: [u32; 3]) -> Corners {
    // Adding zero makes the one zero of the other.
    let [a, b, c] = face.map(|vertex| (geometry.positions[vertex as usize] + Vec3::ZERO).to_array().map(f32::to_bits));
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().expect("there are three")
}

/// A box for each mesh around those of its triangles that have changed.
fn changed_boxes(geometry: &Geometry, has_changed: impl Fn(usize) -> bool) -> Vec<[DVec3; 2]> {
    let mut boxes = vec![[DVec3::INFINITY, DVec3::NEG_INFINITY]; geometry.meshes.len()];
    for (face, &mesh) in geometry.triangle_mesh.iter().enumerate().filter(|(face, _)| has_changed(*face)) {
        let [low, high] = &mut boxes[mesh as usize];
        for corner in geometry.corners(face as u32) {
            (*low, *high) = (low.min(corner), high.max(corner));
        }
    }
    boxes.retain(|[low, high]| low.cmple(*high).all());
    boxes
}
