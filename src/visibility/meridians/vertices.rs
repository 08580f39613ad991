use std::f64::consts::PI;

use dual_bvh::Candidates;
use glam::DVec3;

use super::MeridianFrame;
use crate::sphere::angle;

/// A vertex in the chart.
#[derive(Clone, Copy, Debug)]
pub(in crate::visibility) struct Vertex {
    /// How many isolines have a smaller longitude; [`Vertex::BELOW`] below the horizon.
    ///
    /// This integer *is* the vertex's position between the isolines for everything that follows: all arcs that share the
    /// vertex use the same one, so that the jumps along every isoline add up whatever the rounding.
    pub(in crate::visibility) place: i32,
    /// Direction along the chart's x.
    pub(super) east: f64,
    /// Height above the horizon, in the same unit.
    pub(super) up: f64,
    /// Towards the pole z.
    pub(super) north: f64,
}

impl Vertex {
    /// The place of everything below the horizon.
    pub(in crate::visibility) const BELOW: i32 = -1;

    /// The vertex in the direction `w` of the chart, of any length, among so many `lines`.
    #[inline(always)]
    pub(in crate::visibility) fn new(w: DVec3, lines: usize) -> Self {
        let (lines, up) = (lines as f64, w.y.abs());
        let before = (angle(w.x, up) * (lines / PI) - 0.5).ceil();
        // NaN, in the direction of a pole, becomes zero.
        let place = before.max(0.0).min(lines) as i32;
        Self { place: if w.y < 0.0 { Self::BELOW } else { place }, east: w.x, up: w.y, north: w.z }
    }
}

/// The vertices of all candidates in the chart of one receiver, by component.
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    pub(super) places: Vec<i32>,
    pub(super) east: Vec<f64>,
    pub(super) up: Vec<f64>,
    pub(super) north: Vec<f64>,
}

impl Vertices {
    #[inline(always)]
    pub(super) fn fill(&mut self, candidates: &Candidates, position: DVec3, frame: MeridianFrame, lines: usize) {
        let [x, y, z] = candidates.coordinates();
        let count = x.len();
        self.places.resize(count, 0);
        for lanes in [&mut self.east, &mut self.up, &mut self.north] {
            lanes.resize(count, 0.0);
        }
        let (y, z) = (&y[..count], &z[..count]);
        let (places, east) = (&mut self.places[..count], &mut self.east[..count]);
        let (up, north) = (&mut self.up[..count], &mut self.north[..count]);
        for i in 0..count {
            let direction = DVec3::new(f64::from(x[i]), f64::from(y[i]), f64::from(z[i])) - position;
            let vertex = Vertex::new(frame.apply(direction), lines);
            places[i] = vertex.place;
            east[i] = vertex.east;
            up[i] = vertex.up;
            north[i] = vertex.north;
        }
    }

    #[inline(always)]
    pub(super) fn get(&self, vertex: u32) -> Vertex {
        let i = vertex as usize;
        Vertex { place: self.places[i], east: self.east[i], up: self.up[i], north: self.north[i] }
    }
}
