use dual_bvh::{Candidates, Contours, DualBvh, Tile};
use glam::DVec3;

use super::crossings::Crossings;
use super::depth::count_on_spine;
use super::sweep::{Interval, Sweep, base_line, sweep};
use super::{Frame, Isolines, ReceiverContours};
use crate::scene::FaceTree;

/// A point from which the scene is seen.
#[derive(Clone, Copy, Debug)]
pub struct Receiver<'a> {
    /// Where it is.
    pub position: DVec3,
    /// Unit normal of the surface it lies on, whose horizon bounds its view; none for a probe, which sees all around.
    pub normal: Option<DVec3>,
    /// Faces it does not see: those of its own surface that meet in it.
    pub excluded: &'a [u32],
}

/// Finds what receivers see of a scene.
#[derive(Clone, Copy)]
pub struct Viewer<'a> {
    /// Finds contours.
    pub edges: &'a DualBvh,
    /// Finds the faces along a ray.
    pub faces: &'a FaceTree,
    /// The isolines along which visibility is followed.
    pub isolines: &'a Isolines,
}

/// How much of its hemisphere (or sphere) a receiver sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// Everything: no contour above the horizon and nothing overhead.
    Open,
    /// Nothing: no contour above the horizon, but something overhead.
    Enclosed,
    /// Part of it: the intervals that were reported.
    Part(Sweep),
}

/// Working memory for one thread: reused, so that nothing is allocated from one receiver to the next.
#[derive(Default)]
pub struct View {
    candidates: Candidates,
    contours: Contours,
    projected: ReceiverContours,
    crossings: Crossings,
}

impl View {
    /// Contours that the last receiver had above its horizon.
    pub fn contours(&self) -> &ReceiverContours {
        &self.projected
    }

    /// Crossings of the last receiver's contours with the isolines.
    pub fn crossings(&self) -> usize {
        self.crossings.len()
    }
}

impl Viewer<'_> {
    /// Searches the edges that may be contours for any of the `receivers`, neighbours of each other.
    pub fn approach<'r>(&self, receivers: impl Iterator<Item = Receiver<'r>> + Clone, view: &mut View) {
        let excluded = receivers.clone().flat_map(|r| r.excluded.iter().copied());
        let tile = Tile::new(receivers.clone().map(|r| (r.position, r.normal))).with_faces(excluded);
        self.edges.search(&tile, &mut view.candidates);
    }

    /// One receiver's life: from the candidates of its tile to the intervals of the isolines that it sees.
    pub fn see(&self, receiver: Receiver, view: &mut View, visible: impl FnMut(Interval)) -> Sight {
        let Receiver { position, normal, excluded } = receiver;
        view.candidates.contours(position, excluded, &mut view.contours);
        view.projected.project(&view.candidates, &view.contours, position, normal);

        let frame = Frame::facing(normal);
        let line = base_line(self.isolines, normal);
        let depth = count_on_spine(self.faces, self.isolines, frame, position, excluded, line);
        if view.projected.arcs.is_empty() {
            return if depth == 0 { Sight::Open } else { Sight::Enclosed };
        }

        view.crossings.collect(self.isolines, frame, &view.projected);
        Sight::Part(sweep(self.isolines, frame, &view.crossings, normal, (line, depth), visible))
    }

    /// The intervals of a receiver that sees everything above its horizon.
    pub fn see_all(&self, normal: Option<DVec3>, visible: impl FnMut(Interval)) {
        let mut nothing = Crossings::default();
        let frame = Frame::facing(normal);
        nothing.collect(self.isolines, frame, &ReceiverContours::default());
        sweep(self.isolines, frame, &nothing, normal, (base_line(self.isolines, normal), 0), visible);
    }
}
