//! The visible region without discretisation: the boundary of {W = 0} as arcs of great circles, for closed-form integrals.
//!
//! One receiver's life: contours -> vertices and edges in a chart, azimuth about a pole near the normal (`chart`, `edges`)
//! -> one sweep through a full turn -> the arcs where W turns zero, and the horizon's where nothing hides it -> [`Region`].
//!
//! There are two sweeps. The fast one for many edges (`masks`) compares each vertex with the active edges near its latitude
//! (`latitudes`, `bands`, `slots`, `block`), in which runs of edges (`chains`) keep their places, and locates only what may be visible
//! (`pieces`). It gives up where rounding leaves a choice about something visible; then the other one (`sweep`, `vertex`,
//! `landmarks`, `crossings`, `boundary`) keeps the active edges in one order from the pole downwards, carries W along with
//! them, and is right whatever coincides.

mod bands;
mod block;
mod boundary;
mod chains;
mod chart;
mod crossings;
mod edges;
mod gradient;
mod landmarks;
mod latitudes;
mod masks;
mod pieces;
mod ranks;
mod region;
mod slots;
mod sweep;
#[cfg(test)]
mod tests;
mod vertex;

use glam::DVec3;

pub use region::{Region, Residuals};

use super::ReceiverContours;
use chart::Chart;
use edges::Edges;
use sweep::Queue;

/// Buffers of [`solve`], to be kept from one receiver to the next.
#[derive(Debug, Default)]
pub struct Scratch {
    edges: Edges,
    masks: masks::Buffers,
    queue: Queue,
    region: Region,
}

impl Scratch {
    /// The region that was last solved.
    pub fn region(&self) -> &Region {
        &self.region
    }
}

/// Contours below which one order is kept in no more time than masks: the room's 240 take 30 microseconds either way.
const FEW: usize = 512;

/// Frames to try before an edge through the pole is taken as it is: each is met with a chance of 1e-10 an edge.
const ATTEMPTS: u32 = 8;

/// A full sphere has no preferred direction: any pole will do.
const ANY_AXIS: DVec3 = DVec3::Z;

/// The visible region of one receiver: within the hemisphere of `normal` (a unit vector), or on the full sphere.
///
/// `depth` returns W in a direction, the number of surfaces its ray crosses, counted with the same signs of faces as the
/// contours' jumps; it is asked twice, near the normal and for a check well away from all contours. Another `frame` solves
/// the same in another chart. Vertices at or below the horizon (`heights` <= 0) are cut off by it.
/// The result depends on the input alone. Edges that rounding cannot tell apart, duplicate and collinear ones among them,
/// are legal; what is not (a vertex whose jumps do not cancel, a zero direction) shows in [`Region::residuals`].
pub fn solve<'a>(
    contours: &ReceiverContours,
    normal: Option<DVec3>,
    frame: u32,
    depth: impl Fn(DVec3) -> i32,
    scratch: &'a mut Scratch,
) -> &'a Region {
    let is_solved = contours.arcs.len() >= FEW && solve_certainly(contours, normal, frame, &depth, scratch);
    if !is_solved {
        solve_in_order(contours, normal, frame, depth, scratch);
    }
    scratch.region()
}

/// The direction in which W is counted first.
pub(super) fn pole(normal: DVec3, frame: u32) -> DVec3 {
    Chart::new(normal, frame * ATTEMPTS).pole()
}

/// The same by masks, in the first frame only, and without a doubt or an alarm; returns whether that succeeded. Then contours in
/// directions that cannot be seen anyway have changed no bit of the region.
pub(super) fn solve_certainly(
    contours: &ReceiverContours,
    normal: Option<DVec3>,
    frame: u32,
    depth: impl Fn(DVec3) -> i32,
    Scratch { edges, masks, region, .. }: &mut Scratch,
) -> bool {
    let chart = Chart::new(normal.unwrap_or(ANY_AXIS), frame * ATTEMPTS);
    if edges.fill(contours, normal, &chart, false).is_err() {
        return false;
    }
    let Ok((check, expected)) = masks::sweep(edges, masks, &chart, depth(chart.pole()), region) else { return false };
    region.check(check, expected, depth);
    !region.residuals.alarm()
}

/// The same with all edges in one order.
pub(super) fn solve_in_order(
    contours: &ReceiverContours,
    normal: Option<DVec3>,
    frame: u32,
    depth: impl Fn(DVec3) -> i32,
    Scratch { edges, queue, region, .. }: &mut Scratch,
) {
    for attempt in 0..ATTEMPTS {
        let chart = Chart::new(normal.unwrap_or(ANY_AXIS), frame * ATTEMPTS + attempt);
        let is_last = attempt + 1 == ATTEMPTS;
        if edges.fill(contours, normal, &chart, is_last).is_ok() {
            let (check, expected) = sweep::sweep(edges, queue, &chart, depth(chart.pole()), region);
            region.check(check, expected, depth);
            region.residuals.retries = attempt;
            region.residuals.pole_met = is_last;
            break;
        }
    }
}
