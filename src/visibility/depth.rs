use std::ops::ControlFlow;

use dual_bvh::face_sign;
use glam::DVec3;

use super::contours::arc_plane;
use crate::scene::FaceTree;

/// Counts the depth complexity W in a direction that meets no edge, by a ray that counts every face once.
///
/// A face has the direction on one side of all its edges, the side that its sign tells; edges' planes are the contours'.
pub(super) fn count_along(faces: &FaceTree, position: DVec3, excluded: &[u32], direction: DVec3) -> i32 {
    let mut depth = 0;
    faces.visit(position, direction, |face| {
        if !excluded.contains(&face) {
            let vertices = faces.vertices(face);
            let [a, b, c] = faces.corners(face);
            let sign = f64::from(face_sign(position, a, b, c));
            let corners = [a, b, c].map(|x| x.as_dvec3());
            let is_inside = [(0, 1), (1, 2), (2, 0)].into_iter().all(|(i, j)| {
                let (a, b, orientation) = if vertices[i] < vertices[j] { (i, j, 1.0) } else { (j, i, -1.0) };
                let plane = arc_plane(corners[a] - position, corners[a], corners[b]);
                orientation * sign * plane.dot(direction) < 0.0
            });
            depth += i32::from(is_inside);
        }
        ControlFlow::Continue(())
    });
    depth
}
