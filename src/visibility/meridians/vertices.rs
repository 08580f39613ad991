use std::f64::consts::{PI, TAU};

use dual_bvh::Candidates;
use glam::DVec3;

use super::Outlook;
use crate::sphere::angle;

/// A vertex in the chart.
#[derive(Clone, Copy, Debug)]
pub(in crate::visibility) struct Vertex {
    /// How many isolines have a smaller longitude, or all: none.
    ///
    /// This integer *is* the vertex's position between the isolines for everything that follows: all arcs that share the
    /// vertex use the same one, so that the jumps along every isoline add up whatever the rounding.
    pub(in crate::visibility) place: i32,
    /// Direction, of any length.
    pub(in crate::visibility) direction: DVec3,
}

impl Vertex {
    /// The vertex in the direction `w` of the chart among so many `lines`.
    #[inline(always)]
    pub(in crate::visibility) fn new(w: DVec3, lines: usize) -> Self {
        let lines = lines as f64;
        let longitude = angle(w.x, w.y.abs());
        let longitude = if w.y < 0.0 { TAU - longitude } else { longitude };
        let before = (longitude * (0.5 * lines / PI) - 0.5).ceil();
        // NaN, in the direction of a pole, becomes zero.
        let before = before.max(0.0).min(lines);
        Self { place: if before == lines { 0 } else { before as i32 }, direction: w }
    }
}

/// The vertices of all candidates in the chart of one receiver, by component.
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    pub(super) places: Vec<i32>,
    /// Whether a vertex lies below the horizon.
    pub(super) below: Vec<bool>,
    /// Directions.
    pub(super) axes: [Vec<f64>; 3],
}

impl Vertices {
    #[inline(always)]
    pub(super) fn fill(&mut self, candidates: &Candidates, outlook: Outlook) {
        let Outlook { meridians, frame, position, normal } = outlook;
        let lines = meridians.len();
        let [x, y, z] = candidates.coordinates();
        let count = x.len();
        self.places.resize(count, 0);
        self.below.resize(count, false);
        self.axes.iter_mut().for_each(|lanes| lanes.resize(count, 0.0));
        let (y, z) = (&y[..count], &z[..count]);
        let (places, below) = (&mut self.places[..count], &mut self.below[..count]);
        let [east, up, north] = &mut self.axes;
        let (east, up, north) = (&mut east[..count], &mut up[..count], &mut north[..count]);
        // A full sphere has no horizon.
        let normal = normal.unwrap_or(DVec3::ZERO);
        for i in 0..count {
            let direction = DVec3::new(f64::from(x[i]), f64::from(y[i]), f64::from(z[i])) - position;
            let vertex = Vertex::new(frame.apply(direction), lines);
            places[i] = vertex.place;
            below[i] = normal.dot(direction) < 0.0;
            east[i] = vertex.direction.x;
            up[i] = vertex.direction.y;
            north[i] = vertex.direction.z;
        }
    }
}
