use dual_bvh::{Candidates, Contours, Part};
use glam::DVec3;

use super::chart::{Chart, Outlook};

/// Marks the places of vertices below the horizon, or in it to rounding.
pub(super) const BELOW: i32 = 1 << 30;

/// Fills in the places of a group's vertices for one receiver, at least those of its contours.
#[inline(always)]
pub(super) fn fill<C: Chart>(
    places: &mut Vec<i32>,
    candidates: &Candidates,
    part: &Part,
    contours: &Contours,
    outlook: Outlook<C>,
) {
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

/// What is above the horizon by less than this angle counts as below it: faces in the receiver's own plane, which rounding puts on
/// either side.
const IN_HORIZON: f64 = 1e-12;

#[inline(always)]
fn fill_all<C: Chart>(places: &mut [i32], [x, y, z]: [&[f32]; 3], outlook: Outlook<C>) {
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
