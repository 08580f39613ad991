//! Contours in the chart: the vertices in order of azimuth, the edges between them as directed lines.

use std::hint::select_unpredictable;

use glam::DVec3;

use super::chart::{Chart, TURN_END, at_azimuth, azimuth};
use super::latitudes::Latitudes;
use super::ranks::Ranks;
use crate::visibility::{Arc, ReceiverContours};

/// No edge, no vertex.
pub(super) const NIL: u32 = u32::MAX;
/// The edge that stands for the pole: above all others, never ending.
pub(super) const TOP: u32 = 0;
/// The edge that stands for the horizon, if there is one.
const HORIZON_EDGE: u32 = 1;
/// The second vertex of edges that reach the seam.
pub(super) const SEAM: u32 = u32::MAX;
/// Jump of the horizon: more than any scene's depth, so nothing below it is visible.
pub(super) const HORIZON_JUMP: i32 = 1 << 29;

/// A vertex of the contours, an event of the sweep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// Unit vector in chart coordinates.
    pub position: DVec3,
    pub azimuth: f64,
    /// Positive above the horizon. Its sign alone decides, and it alone decides.
    pub height: f64,
}

/// A piece of a contour, from its first vertex to its second in the order of azimuth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    /// first x second in chart coordinates, about as long as the edge: positive above the edge. Zero for edges too short to
    /// have a direction: they are points, on neither side of which anything lies.
    pub normal: DVec3,
    /// First and second vertex, or SEAM.
    pub start: u32,
    pub end: u32,
    /// Change of W on crossing it downwards.
    pub jump: i32,
    /// Index of the contours' arc it is a piece of, NIL for the pole and the horizon.
    pub source: u32,
    pub next_end: u32,
    /// The bands of latitude that it comes into.
    pub first_band: u8,
    pub last_band: u8,
}

impl Edge {
    fn new(normal: DVec3, jump: i32, source: u32) -> Self {
        Self { normal, start: SEAM, end: SEAM, jump, source, next_end: NIL, first_band: 0, last_band: 0 }
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
    /// By azimuth, ties by position.
    pub vertices: Vec<Vertex>,
    /// For each vertex the first of the edges that end there, linked by `next_end`, in the order of `edges`.
    pub ends: Vec<u32>,
    /// For each vertex the first of the edges that start there, and the number of edges: they lie side by side.
    starts: Vec<u32>,
    /// The pole, the horizon if there is one, then the edges at the seam, then the others, both by first vertex, then by second: the
    /// sweep reads memory in order, and nothing depends on the order of the contours.
    pub edges: Vec<Edge>,
    /// Edges that cross the seam, to begin with.
    pub at_seam: Vec<u32>,
    /// The horizon's edge, or NIL.
    pub horizon: u32,
    /// Directions that are zero or not finite.
    pub bad: u32,
    /// The largest size of a jump.
    pub steepest: u32,
    pub latitudes: Latitudes,
    /// One over the lengths of the vertices' directions.
    inverses: Vec<f64>,
    /// Both in the order of the contours.
    unsorted: Vec<(Vertex, f64)>,
    /// From there to `vertices`.
    ranks: Vec<u32>,
    order: Ranks,
    spans: Vec<Span>,
    /// The same as `edges` have them.
    arranged: Vec<Span>,
}

/// An arc of the contours that is not left out, by its vertices: by their places in the contours, then by their ranks.
#[derive(Clone, Copy, Debug, Default)]
struct Span {
    arc: u32,
    first: u32,
    second: u32,
    /// Whether `first` is where the arc begins.
    is_forward: bool,
    wraps: bool,
}

/// Edges that a band should hold at a time.
const EDGES_PER_BAND: usize = 24;

impl Edges {
    /// Fills this from contours. Arcs between two vertices below the horizon are left out. With `lenient`, edges that meet
    /// the pole are kept, wherever rounding puts them.
    pub fn fill(
        &mut self,
        contours: &ReceiverContours,
        horizon: Option<DVec3>,
        chart: &Chart,
        lenient: bool,
    ) -> Result<(), MeetsPole> {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.fill_avx2(contours, horizon, chart, lenient) };
        }
        self.fill_inline(contours, horizon, chart, lenient)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn fill_avx2(
        &mut self,
        contours: &ReceiverContours,
        horizon: Option<DVec3>,
        chart: &Chart,
        lenient: bool,
    ) -> Result<(), MeetsPole> {
        self.fill_inline(contours, horizon, chart, lenient)
    }

    #[inline(always)]
    fn fill_inline(
        &mut self,
        contours: &ReceiverContours,
        horizon: Option<DVec3>,
        chart: &Chart,
        lenient: bool,
    ) -> Result<(), MeetsPole> {
        self.collect(contours, horizon.is_some(), chart);
        self.sort();

        let mut seam = if horizon.is_some() { HORIZON_EDGE + 1 } else { TOP + 1 };
        let first = seam + self.spans.iter().filter(|span| span.wraps).count() as u32;
        self.arrange(first);
        // Every place is written below: what is there already need not be cleared.
        self.edges.resize(first as usize + self.spans.len(), Edge::new(DVec3::ZERO, 0, NIL));
        self.edges[TOP as usize] = Edge::new(DVec3::ZERO, 0, NIL);
        self.at_seam.clear();
        self.horizon = NIL;
        if let Some(n) = horizon {
            self.horizon = HORIZON_EDGE;
            self.at_seam.push(HORIZON_EDGE);
            self.edges[HORIZON_EDGE as usize] = Edge::new(chart.local(n), HORIZON_JUMP, NIL);
        }
        self.at_seam.extend(seam..first);
        seam = first;

        let Self { vertices, inverses, ends, edges, arranged, latitudes, .. } = self;
        let (vertices, inverses) = (&vertices[..], &inverses[..]);
        let (ends, edges) = (&mut ends[..], &mut edges[..]);
        let mut steepest = 0;
        // Backwards, so that lists of ends run forwards.
        for (place, &span) in arranged.iter().enumerate().rev() {
            let (place, Span { arc: source, first, second, is_forward, wraps }) = (first + place as u32, span);
            let arc = &contours.arcs[source as usize];
            let [start, end] = [first, second].map(|rank| vertices[rank as usize].position);
            let cosine = start.dot(end);
            // No branches: which way an arc runs is hard to predict.
            let sign = 2 * i32::from(is_forward) - 1;
            let [from, to] = [first, second].map(|rank| inverses[rank as usize]);
            let lengths = select_unpredictable(is_forward, [from, to], [to, from]);
            let normal = f64::from(sign) * chart.local(normal(contours, arc, lengths, cosine));
            let jump = sign * arc.jump;
            if normal.z * normal.z < NEAREST_TO_POLE * NEAREST_TO_POLE * normal.length_squared() && !lenient {
                return Err(MeetsPole);
            }
            steepest = steepest.max(jump.unsigned_abs());
            let mut edge = Edge { start: first, ..Edge::new(normal, jump, source) };
            (edge.first_band, edge.last_band) = latitudes.range(start, end, cosine);
            let mut last = place;
            if wraps {
                let at_seam = on_seam(normal);
                (edge.first_band, edge.last_band) = latitudes.range(start, at_seam, start.dot(at_seam));
                edges[place as usize] = edge;
                (edge.first_band, edge.last_band) = latitudes.range(at_seam, end, at_seam.dot(end));
                edge.start = SEAM;
                seam -= 1;
                last = seam;
            }
            edge.end = second;
            edge.next_end = std::mem::replace(&mut ends[second as usize], last);
            edges[last as usize] = edge;
        }
        self.steepest = steepest;
        Ok(())
    }

    /// Puts the arcs in the order of their vertices' ranks; the first edge's number is given. Before, `starts` has the number of
    /// those that start at each vertex.
    #[inline(always)]
    fn arrange(&mut self, first: u32) {
        let mut place = first;
        for next_place in &mut self.starts {
            let count = std::mem::replace(next_place, place);
            place += count;
        }
        self.arranged.resize(self.spans.len(), Span::default());
        for &span in &self.spans {
            let next_place = &mut self.starts[span.first as usize];
            self.arranged[(*next_place - first) as usize] = span;
            *next_place += 1;
        }
        let mut start = first;
        for end in &mut self.starts {
            // What has become the end of each is the start of the next.
            let (from, to) = (start as usize, *end as usize);
            if to - from > 1 {
                let range = from - first as usize..to - first as usize;
                self.arranged[range].sort_unstable_by_key(|span| (span.second, span.arc));
            }
            start = std::mem::replace(end, start);
        }
    }

    /// The edges that start at a vertex.
    #[inline(always)]
    pub fn starts(&self, rank: usize) -> std::ops::Range<u32> {
        self.starts[rank]..self.starts[rank + 1]
    }

    /// First and last point of an edge.
    pub fn ends(&self, edge: &Edge) -> (DVec3, DVec3) {
        (self.start(edge), self.end(edge))
    }

    /// First point of an edge.
    pub fn start(&self, edge: &Edge) -> DVec3 {
        self.point(edge, edge.start)
    }

    /// Last point of an edge.
    #[inline(always)]
    pub fn end(&self, edge: &Edge) -> DVec3 {
        self.point(edge, edge.end)
    }

    #[inline(always)]
    fn point(&self, edge: &Edge, rank: u32) -> DVec3 {
        self.vertices.get(rank as usize).map_or_else(|| on_seam(edge.normal), |v| v.position)
    }

    /// Positive if two edges that start at a point come downwards in this order, and as sure as it is far from zero.
    pub fn order(&self, upper: u32, lower: u32, start: DVec3) -> f64 {
        let (u, l) = (&self.edges[upper as usize], &self.edges[lower as usize]);
        match l.end == u.end && l.end != SEAM {
            // They enclose nothing.
            true => f64::INFINITY,
            false => l.normal.cross(u.normal).dot(start),
        }
    }

    /// Lists the vertices, and the arcs to keep, in the order of the contours.
    #[inline(always)]
    fn collect(&mut self, contours: &ReceiverContours, has_horizon: bool, chart: &Chart) {
        self.bad = 0;
        self.unsorted.clear();
        self.unsorted.extend(contours.directions.iter().zip(&contours.heights).map(|(&direction, &height)| {
            let (direction, inverse) = unit(direction);
            let position = chart.local(direction);
            let azimuth = azimuth(position.x, position.y);
            (Vertex { position, azimuth, height: if has_horizon { height } else { 1.0 } }, inverse)
        }));
        self.spans.clear();
        for (arc, &Arc { a, b, .. }) in contours.arcs.iter().enumerate() {
            let [(first, from), (second, to)] = [a, b].map(|v| &self.unsorted[v as usize]);
            if (first.height <= 0.0) & (second.height <= 0.0) {
                continue;
            }
            if (*from == NO_LENGTH) | (*to == NO_LENGTH) {
                self.bad += 1;
                continue;
            }
            self.spans.push(Span { arc: arc as u32, first: a, second: b, is_forward: true, wraps: false });
        }
    }

    /// Puts the vertices in the order of the sweep, and chooses bands.
    #[inline(always)]
    fn sort(&mut self) {
        let unsorted = &self.unsorted[..];
        self.vertices.clear();
        self.inverses.clear();
        self.ranks.clear();
        self.ranks.resize(unsorted.len(), 0);
        let keys = self.order.sort(unsorted.iter().map(|(vertex, _)| vertex.azimuth), |a, b| {
            let [a, b] = [a, b].map(|place| unsorted[place as usize]);
            let coordinates = |(vertex, inverse): (Vertex, f64)| {
                let [x, y, z] = vertex.position.to_array();
                [z, x, y, inverse].map(f64::to_bits)
            };
            coordinates(a).cmp(&coordinates(b))
        });
        for (rank, &(_, v)) in keys.iter().enumerate() {
            self.ranks[v as usize] = rank as u32;
            let (vertex, inverse) = unsorted[v as usize];
            self.vertices.push(vertex);
            self.inverses.push(inverse);
        }
        let (mut passed, count) = (0, self.vertices.len());
        self.ends.clear();
        self.ends.resize(count, NIL);
        self.starts.clear();
        self.starts.resize(count + 1, 0);
        for span in &mut self.spans {
            let ranks = [span.first, span.second].map(|place| self.ranks[place as usize]);
            let [va, vb] = [span.first, span.second].map(|place| unsorted[place as usize].0.azimuth);
            span.wraps = (va - vb).abs() > 0.5 * TURN_END;
            let between = ranks[0].abs_diff(ranks[1]) as usize;
            passed += if span.wraps { count - between } else { between };
            span.is_forward = (ranks[0] < ranks[1]) != span.wraps;
            let backward = usize::from(!span.is_forward);
            (span.first, span.second) = (ranks[backward], ranks[1 - backward]);
            self.starts[span.first as usize] += 1;
        }
        let mean_active = passed / count.max(1);
        let positions = self.unsorted.iter().map(|(vertex, _)| vertex.position);
        self.latitudes.divide(mean_active / EDGES_PER_BAND, positions);
    }
}

/// The normal a x b of unit vectors that an arc runs between, about its length long and known to a few 1e-16; zero if they
/// are one point. `inverses` are one over the lengths of its ends, `cosine` is that of its own.
#[inline(always)]
fn normal(contours: &ReceiverContours, arc: &Arc, inverses: [f64; 2], cosine: f64) -> DVec3 {
    let [a, b] = inverses;
    let normal = arc.plane * a * b;
    if normal.length_squared() < SHORTEST * SHORTEST {
        return DVec3::ZERO;
    }
    // The plane is a x (b - a), rounded to its factors' size: where b - a is longer than b, that counts.
    if b > 2.0 * a * cosine {
        let [from, to] = [arc.a, arc.b].map(|v| contours.directions[v as usize]);
        return arc.plane * a * (to - from).length_recip();
    }
    normal
}

/// One over a length that is zero or not finite.
const NO_LENGTH: f64 = 0.0;

/// A vector at unit length, and one over its length, or zero and `NO_LENGTH`.
#[inline(always)]
fn unit(v: DVec3) -> (DVec3, f64) {
    let square = v.length_squared();
    // Squares of all single precision numbers but zero are within these bounds.
    if (1e-200..1e200).contains(&square) {
        let inverse = square.sqrt().recip();
        return (v * inverse, inverse);
    }
    let scale = v.abs().max_element();
    let unit = (v / scale).normalize_or_zero();
    (unit, if unit == DVec3::ZERO { NO_LENGTH } else { (v / scale).length_recip() / scale })
}
