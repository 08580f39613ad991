use std::ops::ControlFlow;

use dual_bvh::face_sign;
use glam::DVec3;

use super::contours::{arc_plane, sides};
use crate::scene::FaceTree;

/// Counts the depth complexity W in a direction that meets no edge, by a ray that counts every face once, of those that are `wanted`.
pub(super) fn count_along(
    faces: &FaceTree,
    position: DVec3,
    excluded: &[u32],
    direction: DVec3,
    wanted: impl Fn(u32) -> bool,
) -> i32 {
    let mut depth = 0;
    faces.visit(position, direction, |face| {
        let is_counted = covers(faces, face, position, direction) && !excluded.contains(&face) && wanted(face);
        depth += i32::from(is_counted);
        ControlFlow::Continue(())
    });
    depth
}

/// Whether that is above zero.
pub(super) fn is_covered(
    faces: &FaceTree,
    position: DVec3,
    excluded: &[u32],
    direction: DVec3,
    wanted: impl Fn(u32) -> bool,
) -> bool {
    let mut is_covered = false;
    faces.visit_ordered(position, direction, |face| {
        is_covered |= covers(faces, face, position, direction) && !excluded.contains(&face) && wanted(face);
        if is_covered { f64::NEG_INFINITY } else { f64::INFINITY }
    });
    is_covered
}

/// Whether a face has a direction on one side of all its edges, the side that its sign tells; edges' planes are the contours'.
#[inline(always)]
fn covers(faces: &FaceTree, face: u32, position: DVec3, direction: DVec3) -> bool {
    let [a, b, c] = faces.corners(face);
    let sign = i32::from(face_sign(position, a, b, c));
    let corners = [a, b, c].map(|x| x.as_dvec3());
    sides(faces.vertices(face)).into_iter().all(|(a, b, orientation)| {
        let plane = arc_plane(corners[a] - position, corners[a], corners[b]);
        f64::from(orientation * sign) * plane.dot(direction) < 0.0
    })
}
