use std::ops::ControlFlow;

use dual_bvh::face_sign;
use glam::DVec3;

use super::contours::{arc_plane, sides};
use crate::scene::FaceTree;

/// Counts the depth complexity W in a direction that meets no edge, by a ray that counts every face once.
///
/// A face has the direction on one side of all its edges, the side that its sign tells; edges' planes are the contours'.
pub(super) fn count_along(faces: &FaceTree, position: DVec3, excluded: &[u32], direction: DVec3) -> i32 {
    let mut depth = 0;
    faces.visit(position, direction, |face| {
        if !excluded.contains(&face) {
            let [a, b, c] = faces.corners(face);
            let sign = i32::from(face_sign(position, a, b, c));
            let corners = [a, b, c].map(|x| x.as_dvec3());
            let is_inside = sides(faces.vertices(face)).into_iter().all(|(a, b, orientation)| {
                let plane = arc_plane(corners[a] - position, corners[a], corners[b]);
                f64::from(orientation * sign) * plane.dot(direction) < 0.0
            });
            depth += i32::from(is_inside);
        }
        ControlFlow::Continue(())
    });
    depth
}
