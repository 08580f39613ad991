use std::ops::ControlFlow;

use dual_bvh::face_sign;
use glam::DVec3;

use super::contours::arc_plane;
use super::crossings::{Passage, Place, passage, spine_jump};
use super::meridians::{Way, place};
use super::{Frame, Isolines, MeridianFrame, Meridians};
use crate::scene::FaceTree;

/// Counts the depth complexity W where isoline `line` meets the spine, by a ray that counts every face once.
///
/// Whether the ray crosses a face is decided by where the face's edges pass the spine, with the very predicates and signs
/// that the contours use. So the count belongs to the same (symbolically perturbed) picture as the jumps, and stays
/// consistent with them when the ray meets vertices or edges, or the receiver lies in a face's plane.
pub(super) fn count_on_spine(
    faces: &FaceTree,
    isolines: &Isolines,
    frame: Frame,
    position: DVec3,
    excluded: &[u32],
    line: usize,
) -> i32 {
    let u = isolines.u(line);
    let ray = frame.invert(DVec3::new(u, 0.0, 1.0 - u.abs()));
    let mut depth = 0;
    faces.visit(position, ray, |face| {
        if !excluded.contains(&face) {
            depth += covers(faces, isolines, frame, position, face, line as u32);
        }
        ControlFlow::Continue(())
    });
    depth
}

/// W of one face alone at isoline `line` on the spine: 1 if the face covers the place, else 0 (or -1 on the sliver of a
/// face whose plane holds the receiver to rounding, as its contours have it).
fn covers(faces: &FaceTree, isolines: &Isolines, frame: Frame, position: DVec3, face: u32, line: u32) -> i32 {
    let vertices = faces.vertices(face);
    let [a, b, c] = faces.corners(face);
    let sign = face_sign(position, a, b, c);
    let corners = [a, b, c].map(|x| x.as_dvec3());
    let directions = corners.map(|x| x - position);
    let places = directions.map(|d| Place::of(frame.apply(d), isolines));
    let (mut here, mut total) = (0, 0);
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        // Edges run from the smaller vertex id to the larger, as they do among the candidates.
        let (a, b, orientation) = if vertices[i] < vertices[j] { (i, j, 1) } else { (j, i, -1) };
        let plane = frame.apply(arc_plane(directions[a], corners[a], corners[b]));
        if let Some(Passage::Spine(below)) = passage(places[a], places[b], plane, isolines) {
            let jump = spine_jump(orientation * i32::from(sign), places[b]);
            total += jump;
            here += if below <= line { jump } else { 0 };
        }
    }
    // A face left on the way up the spine and not entered there was entered below its start, the pole -x.
    here + (-total).max(0)
}

/// Calls `covers` with the faces that cover the start of the meridians, and how often each does, found by a ray that looks at every
/// face once: their sum is the depth complexity W there.
///
/// A face covers the start if the isolines leave it once more often than they enter it, on whichever of them: decided with
/// the very predicates and signs that the contours use, as in [`count_on_spine`].
pub(super) fn faces_at_start(
    faces: &FaceTree,
    meridians: &Meridians,
    frame: MeridianFrame,
    position: DVec3,
    excluded: &[u32],
    mut covers: impl FnMut(u32, i32),
) {
    let lines = meridians.len();
    faces.visit(position, frame.start(), |face| {
        if !excluded.contains(&face) {
            let [a, b, c] = faces.corners(face);
            let corners = [a, b, c].map(|x| x.as_dvec3());
            let [u, v, w] = corners.map(|x| frame.apply(x - position));
            if are_beside_axis(u.x, v.x, w.x) || are_beside_axis(u.y, v.y, w.y) {
                // Seen from one side of the axis, whatever the rounding, no face lies around it.
                return ControlFlow::Continue(());
            }
            let vertices = faces.vertices(face);
            let sign = i32::from(face_sign(position, a, b, c));
            let places = [place(u, lines), place(v, lines), place(w, lines)];
            let mut total = 0;
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let (a, b, orientation) = if vertices[i] < vertices[j] { (i, j, 1) } else { (j, i, -1) };
                let plane = || frame.apply(arc_plane(corners[a] - position, corners[a], corners[b]));
                let way = Way::new(places[a], places[b], lines as i32, plane);
                total += if way.crosses(0, lines) { orientation * sign * way.sense() } else { 0 };
            }
            if total < 0 {
                covers(face, -total);
            }
        }
        ControlFlow::Continue(())
    });
}

/// Whether three coordinates have one sign, and none is much smaller than the others.
fn are_beside_axis(a: f64, b: f64, c: f64) -> bool {
    const MARGIN: f64 = 1e-6;
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    low > MARGIN * high || high < MARGIN * low
}

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
