use std::f64::consts::TAU;

use dual_bvh::{Candidates, Contours, Part};
use glam::DVec3;

use super::{IN_HORIZON, Outlook};
use crate::sphere::rough_angle;

/// How many of the `lines` have a smaller longitude than the direction `w` of the chart, of any length; or all: none.
///
/// This integer *is* a vertex's position between the isolines for everything that follows: all arcs that share the vertex
/// use the same one, so that the jumps along every isoline add up whatever the rounding. A vertex beside an isoline may so get
/// to its other side, by less than a crossing is wide: crossings are kept between the latitudes of their arc's ends.
#[inline(always)]
pub(in crate::visibility) fn place(w: DVec3, lines: usize) -> i32 {
    let longitude = rough_angle(w.x, w.y.abs());
    let longitude = if w.y < 0.0 { TAU - longitude } else { longitude };
    // The nearest whole number stands in the low bits of the sum with 2^52. NaN, in the direction of a pole, becomes zero.
    let before = (longitude * (lines as f64 / TAU)).max(0.0) + (1u64 << 52) as f64;
    let before = before.to_bits() as i32;
    if before == lines as i32 { 0 } else { before }
}

/// Marks the places of vertices below the horizon, or in it to rounding.
pub(super) const BELOW: i32 = 1 << 30;

/// Fills in the places of a group's vertices for one receiver, at least those of its contours.
#[inline(always)]
pub(super) fn fill(places: &mut Vec<i32>, candidates: &Candidates, part: &Part, contours: &Contours, outlook: Outlook) {
    let vertices = part.vertices.clone();
    if places.len() < vertices.end {
        places.resize(vertices.end, 0);
    }
    let coordinates = candidates.coordinates();
    if contours.edges().len() < vertices.len() / FEW {
        let edges = candidates.edges();
        for chunk in contours.edges().chunks(LANES / 2) {
            let (mut ends, mut lanes, mut out) = ([0; LANES], [[0.0; LANES]; 3], [0; LANES]);
            for lane in 0..LANES {
                // The last lanes repeat the last contour.
                let edge = &edges[chunk[(lane / 2).min(chunk.len() - 1)].edge as usize];
                let vertex = if lane % 2 == 0 { edge.a } else { edge.b } as usize;
                ends[lane] = vertex;
                for axis in 0..3 {
                    lanes[axis][lane] = coordinates[axis][vertex];
                }
            }
            fill_all(&mut out, [&lanes[0], &lanes[1], &lanes[2]], outlook);
            for lane in 0..LANES {
                places[ends[lane]] = out[lane];
            }
        }
    } else {
        fill_all(&mut places[vertices.clone()], coordinates.map(|lanes| &lanes[vertices.clone()]), outlook);
    }
}

/// With fewer contours than this share of the vertices, only the places of their ends are needed.
const FEW: usize = 3;

/// Ends of contours placed at once.
const LANES: usize = 8;

#[inline(always)]
fn fill_all(places: &mut [i32], [x, y, z]: [&[f32]; 3], Outlook { meridians, frame, position, normal }: Outlook) {
    let lines = meridians.len();
    let count = places.len();
    let (x, y, z) = (&x[..count], &y[..count], &z[..count]);
    // A full sphere has no horizon.
    let (normal, level) = normal.map_or((DVec3::ZERO, -1.0), |normal| (normal, IN_HORIZON));
    for i in 0..count {
        let direction = DVec3::new(f64::from(x[i]), f64::from(y[i]), f64::from(z[i])) - position;
        let is_below = normal.dot(direction) <= level * (direction.x.abs() + direction.y.abs() + direction.z.abs());
        places[i] = place(frame.apply(direction), lines) | if is_below { BELOW } else { 0 };
    }
}
