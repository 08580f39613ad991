use std::f64::consts::TAU;

use dual_bvh::Candidates;
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

/// Fills in the places of all candidates' vertices for one receiver.
#[inline(always)]
pub(super) fn fill(places: &mut Vec<i32>, candidates: &Candidates, outlook: Outlook) {
    let Outlook { meridians, frame, position, normal } = outlook;
    let lines = meridians.len();
    let [x, y, z] = candidates.coordinates();
    let count = x.len();
    places.resize(count, 0);
    let (y, z, places) = (&y[..count], &z[..count], &mut places[..count]);
    // A full sphere has no horizon.
    let (normal, level) = normal.map_or((DVec3::ZERO, -1.0), |normal| (normal, IN_HORIZON));
    for i in 0..count {
        let direction = DVec3::new(f64::from(x[i]), f64::from(y[i]), f64::from(z[i])) - position;
        let is_below = normal.dot(direction) <= level * (direction.x.abs() + direction.y.abs() + direction.z.abs());
        places[i] = place(frame.apply(direction), lines) | if is_below { BELOW } else { 0 };
    }
}
