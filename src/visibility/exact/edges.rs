//! Contours in the chart: the vertices in order of azimuth, the edges between them as directed lines.

use glam::DVec3;

use super::chart::{Chart, TURN_END, at_azimuth, azimuth};
use crate::visibility::ReceiverContours;

/// No edge, no vertex.
pub(super) const NIL: u32 = u32::MAX;
/// The edge that stands for the pole: above all others, never ending.
pub(super) const TOP: u32 = 0;
/// Rank of the end of edges that reach the seam.
pub(super) const SEAM: u32 = u32::MAX;
/// Not a landmark.
pub(super) const NO_LANDMARK: u16 = u16::MAX;
/// Jump of the horizon: more than any scene's depth, so nothing below it is visible.
pub(super) const HORIZON: i32 = 1 << 29;

/// An event of the sweep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// Unit vector in chart coordinates.
    pub position: DVec3,
    pub azimuth: f64,
    /// Positive above the horizon. Its sign alone decides, and it alone decides.
    pub height: f64,
    /// First of the edges that end here, linked by `next_end`.
    pub ends: u32,
    /// First of the edges that start here, linked by `next_start`.
    pub starts: u32,
}

/// A piece of a contour, from its first vertex to its second in the order of azimuth. What the order needs fills the first
/// of its two cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Edge {
    /// first x second in chart coordinates, not normalised: positive above the edge. Zero for edges too short to have a
    /// direction: they are points, on neither side of which anything lies.
    pub normal: DVec3,
    /// Position of the second vertex.
    pub end: DVec3,
    pub end_rank: u32,
    /// Neighbours in the status, downwards and upwards.
    pub next: u32,
    pub prev: u32,
    /// W just above.
    pub above: i32,
    /// Change of W on crossing it downwards.
    pub jump: i32,
    pub next_end: u32,
    pub next_start: u32,
    /// Place among the landmarks of the status, if it is one.
    pub landmark: u16,
    /// Side of the edge on which W = 0 alone (+1 above, -1 below, 0 neither or both), and where that began.
    pub visible: i8,
    /// The same for W < 0.
    pub negative: i8,
    pub visible_from: DVec3,
    pub negative_from: DVec3,
}

impl Edge {
    fn new(normal: DVec3, jump: i32) -> Self {
        Self {
            normal,
            end: DVec3::ZERO,
            end_rank: SEAM,
            next: NIL,
            prev: NIL,
            above: 0,
            jump,
            next_end: NIL,
            next_start: NIL,
            landmark: NO_LANDMARK,
            visible: 0,
            negative: 0,
            visible_from: DVec3::ZERO,
            negative_from: DVec3::ZERO,
        }
    }
}

/// Where the line with this normal, its z positive, is at an azimuth; not normalised.
pub(super) fn on_line(normal: DVec3, azimuth: f64) -> DVec3 {
    let (x, y) = at_azimuth(azimuth);
    DVec3::new(x * normal.z, y * normal.z, -(normal.x * x + normal.y * y))
}

/// Where it crosses the seam, the half-plane y = 0, x > 0.
pub(super) fn on_seam(normal: DVec3) -> DVec3 {
    on_line(normal, 0.0).normalize_or_zero()
}

/// Arcs shorter than this many radians are points: unit vectors carry no direction below it.
const SHORTEST: f64 = 1e-14;
/// Sine of the least angle between the plane of an edge and the pole, and of the least distance between a vertex and the pole.
const NEAREST_TO_POLE: f64 = 1e-10;

/// An edge or a vertex meets the pole: another chart is needed.
pub(super) struct MeetsPole;

/// Vertices and edges of one receiver in one chart.
#[derive(Debug, Default)]
pub(super) struct Edges {
    pub vertices: Vec<Vertex>,
    pub edges: Vec<Edge>,
    /// Vertices in use, by azimuth.
    pub order: Vec<(u64, u32)>,
    /// Edges that cross the seam, to begin with.
    pub at_seam: Vec<u32>,
    /// The edges from here on are the horizon's.
    pub horizon: u32,
    /// Directions that are zero or not finite.
    pub bad: u32,
}

impl Edges {
    /// Fills this from contours. Arcs between two vertices below the horizon are left out. With `lenient`, edges that meet
    /// the pole are kept, wherever rounding puts them.
    pub fn fill(
        &mut self,
        contours: &ReceiverContours,
        normal: Option<DVec3>,
        chart: &Chart,
        lenient: bool,
    ) -> Result<(), MeetsPole> {
        let horizon = normal.map(|n| chart.to_chart(n));
        self.vertices.clear();
        self.edges.clear();
        self.order.clear();
        self.at_seam.clear();
        self.bad = 0;
        self.horizon = NIL;
        self.edges.push(Edge::new(DVec3::ZERO, 0));

        let height = |v: usize| if normal.is_some() { contours.heights[v] } else { 1.0 };
        self.vertices.extend(contours.directions.iter().enumerate().map(|(v, &direction)| {
            // The scale keeps squares in range for all of f32's exponents and beyond.
            let scale = direction.abs().max_element();
            let position = chart.to_chart(direction / scale).normalize_or_zero();
            let azimuth = azimuth(position.x, position.y);
            Vertex { position, azimuth, height: height(v), ends: NIL, starts: NIL }
        }));

        for arc in &contours.arcs {
            let (a, b) = (arc.a as usize, arc.b as usize);
            let (va, vb) = (&self.vertices[a], &self.vertices[b]);
            if va.height <= 0.0 && vb.height <= 0.0 {
                continue;
            }
            if va.position == DVec3::ZERO || vb.position == DVec3::ZERO {
                self.bad += 1;
                continue;
            }
            // The difference is taken before any rounding of the rotation: short arcs keep their direction.
            let (da, db) = (contours.directions[a], contours.directions[b]);
            let (sa, sb) = (da.abs().max_element().recip(), db.abs().max_element().recip());
            let mut cross = chart.to_chart((sa * da).cross(sb * (db - da)));
            let sine_square = cross.length_squared() / ((sa * da).length_squared() * (sb * db).length_squared());
            if sine_square < SHORTEST * SHORTEST {
                cross = DVec3::ZERO;
            } else if cross.z * cross.z < NEAREST_TO_POLE * NEAREST_TO_POLE * cross.length_squared() && !lenient {
                return Err(MeetsPole);
            }
            let a_first = (va.azimuth, a) < (vb.azimuth, b);
            let wraps = (va.azimuth - vb.azimuth).abs() > 0.5 * TURN_END;
            let (first, second) = if a_first != wraps { (a, b) } else { (b, a) };
            let edge = if first == a { Edge::new(cross, arc.jump) } else { Edge::new(-cross, -arc.jump) };
            if wraps {
                self.push(Some(first), None, edge);
                self.push(None, Some(second), edge);
            } else {
                self.push(Some(first), Some(second), edge);
            }
        }
        if let Some(n) = horizon {
            self.push_horizon(n);
        }
        self.sort();
        Ok(())
    }

    /// Adds an edge between two vertices; none stands for the seam.
    fn push(&mut self, first: Option<usize>, second: Option<usize>, mut edge: Edge) {
        let id = self.edges.len() as u32;
        match first {
            Some(v) => edge.next_start = std::mem::replace(&mut self.vertices[v].starts, id),
            None => self.at_seam.push(id),
        }
        match second {
            Some(v) => {
                let vertex = &mut self.vertices[v];
                edge.next_end = std::mem::replace(&mut vertex.ends, id);
                edge.end = vertex.position;
            }
            None => edge.end = on_seam(edge.normal),
        }
        self.edges.push(edge);
    }

    /// Adds the horizon as four edges of a quarter turn each: an arc of half a turn or more has no closed form.
    fn push_horizon(&mut self, n: DVec3) {
        self.horizon = self.edges.len() as u32;
        let mut first = None;
        for quarter in 0..4 {
            let second = (quarter < 3).then(|| {
                let azimuth = (quarter + 1) as f64;
                let position = on_line(n, azimuth).normalize();
                self.vertices.push(Vertex { position, azimuth, height: 1.0, ends: NIL, starts: NIL });
                self.vertices.len() - 1
            });
            self.push(first, second, Edge::new(n, HORIZON));
            first = second;
        }
    }

    /// Puts the vertices in use in order of azimuth, ties by index, and tells the edges the ranks of their ends.
    fn sort(&mut self) {
        let used = self.vertices.iter().enumerate().filter(|(_, v)| v.ends != NIL || v.starts != NIL);
        // The bits of a positive double sort as the double does.
        self.order.extend(used.map(|(i, v)| (v.azimuth.to_bits(), i as u32)));
        self.order.sort_unstable();
        for (rank, &(_, v)) in self.order.iter().enumerate() {
            let mut edge = self.vertices[v as usize].ends;
            while edge != NIL {
                self.edges[edge as usize].end_rank = rank as u32;
                edge = self.edges[edge as usize].next_end;
            }
        }
    }
}
