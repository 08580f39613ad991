use dual_bvh::OUTSIDE;
use glam::DVec3;

use super::chart::{Chart, Outlook};

/// Marks the places of vertices below the horizon, or in it to rounding.
pub(super) const BELOW: i32 = OUTSIDE;

/// What is above the horizon by less than this angle counts as below it: faces in the receiver's own plane, which rounding puts on
/// either side.
const IN_HORIZON: f64 = 1e-12;

/// Fills in the places of vertices for one receiver.
#[inline(always)]
pub(super) fn fill<C: Chart>(places: &mut [i32], [x, y, z]: [&[f32]; 3], outlook: Outlook<C>) {
    let Outlook { chart, position, normal, .. } = outlook;
    let count = places.len();
    let (x, y, z) = (&x[..count], &y[..count], &z[..count]);
    // A full sphere has no horizon.
    let (normal, level) = normal.map_or((DVec3::ZERO, -1.0), |normal| (normal, IN_HORIZON));
    for i in 0..count {
        let direction = DVec3::new(f64::from(x[i]), f64::from(y[i]), f64::from(z[i])) - position;
        let is_below = normal.dot(direction) <= level * (direction.x.abs() + direction.y.abs() + direction.z.abs());
        places[i] = chart.place(outlook.apply(direction)) | if is_below { BELOW } else { 0 };
    }
}
