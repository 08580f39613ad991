//! The sweep: one total order of the active edges, from the pole downwards, followed through a full turn of azimuth.
//!
//! The order changes only by exchanges of two neighbours, and W is carried along with it: just above an edge it is what it
//! is just below the edge before. Whatever rounding does to the positions of crossings, at every azimuth the edges are in
//! *some* order, so the visible intervals' ends pair up and the boundary closes; edges that rounding cannot tell apart
//! bound slivers of no area, in whichever order they are taken (Bentley and Ottmann 1979, with the topology deciding as
//! in Sugihara and Iri 1989).
//!
//! Whether two neighbours cross is decided by one predicate, on which side of the one that ends later the other's last
//! vertex lies. It does not depend on when it is asked, so no pair is exchanged twice by it.

use glam::DVec3;

use super::chart::{Chart, TURN_END, azimuth};
use super::crossings::{Crossing, Crossings};
use super::edges::{Edge, Edges, NIL, SEAM, TOP, Vertex, on_line, on_seam};
use super::landmarks::{Landmarks, NO_LANDMARK};
use super::region::Region;

/// Buffers of the sweep, kept between receivers.
#[derive(Debug, Default)]
pub(super) struct Queue {
    pub(super) crossings: Crossings,
    pub(super) ends: Vec<u32>,
    pub(super) starts: Vec<u32>,
    pub(super) landmarks: Landmarks,
    /// By edge.
    pub(super) status: Vec<Status>,
    /// Where the boundary arcs under way began, of {W = 0} and of {W < 0}, for edges whose `visible` or `negative` is not 0.
    pub(super) from: Vec<[DVec3; 2]>,
}

/// An edge's place in the order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Status {
    /// Neighbours, downwards and upwards.
    pub next: u32,
    pub prev: u32,
    /// W just above.
    pub above: i32,
    /// Place among the landmarks, if it is one.
    pub landmark: u16,
    /// Side of the edge on which W = 0 alone (+1 above, -1 below, 0 neither or both).
    pub visible: i8,
    /// The same for W < 0.
    pub negative: i8,
}

impl Default for Status {
    fn default() -> Self {
        Self { next: NIL, prev: NIL, above: 0, landmark: NO_LANDMARK, visible: 0, negative: 0 }
    }
}

/// Sweeps over the edges and writes the boundary of {W = 0} and the residuals; `depth_at_pole` is W at the pole. Returns
/// a direction away from pole and edges, and W there as the sweep has it.
pub(super) fn sweep(
    edges: &Edges,
    queue: &mut Queue,
    chart: &Chart,
    depth_at_pole: i32,
    region: &mut Region,
) -> (DVec3, i32) {
    region.clear();
    region.residuals.unbalanced = edges.bad;
    queue.crossings.reset(edges.vertices.len());
    queue.landmarks.reset();
    queue.status.clear();
    queue.status.resize(edges.edges.len(), Status::default());
    queue.from.resize(edges.edges.len(), [DVec3::ZERO; 2]);
    let mut sweep =
        Sweep { edges: &edges.edges, vertices: &edges.vertices, queue, now: 0.0, horizon: edges.horizon, region };
    sweep.begin(&edges.at_seam, depth_at_pole);
    let (check, depth) = sweep.widest_gap();
    let mut quarter = 1.0;
    for rank in 0..edges.vertices.len() {
        let vertex = edges.vertices[rank];
        while quarter <= vertex.azimuth && quarter < TURN_END {
            sweep.break_horizon(quarter);
            quarter += 1.0;
        }
        sweep.cross_until(vertex.azimuth);
        sweep.now = vertex.azimuth;
        sweep.vertex(&vertex, edges.ends[rank], edges.starts(rank));
    }
    while quarter < TURN_END {
        sweep.break_horizon(quarter);
        quarter += 1.0;
    }
    sweep.cross_until(TURN_END);
    sweep.finish();
    region.finish(chart);
    (chart.world(check), depth)
}

/// The state of one sweep: the order as a linked list through the active edges.
pub(super) struct Sweep<'a> {
    pub(super) edges: &'a [Edge],
    pub(super) vertices: &'a [Vertex],
    pub(super) queue: &'a mut Queue,
    /// Azimuth of the event being handled.
    pub(super) now: f64,
    /// The horizon's edge, or NIL.
    pub(super) horizon: u32,
    pub(super) region: &'a mut Region,
}

impl Sweep<'_> {
    pub(super) fn edge(&self, id: u32) -> &Edge {
        &self.edges[id as usize]
    }

    pub(super) fn status(&self, id: u32) -> &Status {
        &self.queue.status[id as usize]
    }

    pub(super) fn status_mut(&mut self, id: u32) -> &mut Status {
        &mut self.queue.status[id as usize]
    }

    pub(super) fn below(&self, id: u32) -> i32 {
        self.status(id).above + self.edge(id).jump
    }

    pub(super) fn link(&mut self, upper: u32, lower: u32) {
        self.status_mut(upper).next = lower;
        if lower != NIL {
            self.status_mut(lower).prev = upper;
        }
    }

    /// Puts the edges that cross the seam in order.
    pub(super) fn begin(&mut self, at_seam: &[u32], depth_at_pole: i32) {
        let latitude = |id: u32| on_seam(self.edges[id as usize].normal).z;
        let mut at_seam = at_seam.to_vec();
        at_seam.sort_by(|&a, &b| latitude(b).total_cmp(&latitude(a)).then(a.cmp(&b)));
        let top = self.status_mut(TOP);
        (top.above, top.next) = (depth_at_pole, NIL);
        let mut upper = TOP;
        for &id in &at_seam {
            self.link(upper, id);
            self.status_mut(id).next = NIL;
            self.status_mut(id).above = self.below(upper);
            upper = id;
        }
        for &id in &at_seam {
            self.refresh(id, on_seam(self.edge(id).normal));
            let upper = self.status(id).prev;
            self.expect_crossing(upper, id);
        }
    }

    /// The middle of the widest gap between edges at the seam, where nothing rounds to the wrong side, and W there.
    fn widest_gap(&self) -> (DVec3, i32) {
        let mut widest = (0.0, DVec3::Z, self.status(TOP).above);
        let (mut id, mut from) = (TOP, DVec3::Z);
        loop {
            let next = self.status(id).next;
            // Below the last edge lies the other pole.
            let to = if next == NIL { -DVec3::Z } else { on_seam(self.edge(next).normal) };
            let width = from.z - to.z;
            if width > widest.0 {
                // The sum vanishes between the poles alone.
                let middle = (from + to).try_normalize().unwrap_or(DVec3::X);
                widest = (width, middle, self.below(id));
            }
            if next == NIL || next == self.horizon {
                return (widest.1, widest.2);
            }
            (id, from) = (next, to);
        }
    }

    /// Whether two neighbours cross before either of them ends.
    #[inline(always)]
    pub(super) fn crosses(&self, upper: u32, lower: u32) -> bool {
        if upper == TOP || lower == NIL {
            return false;
        }
        let (u, l) = (self.edge(upper), self.edge(lower));
        if l.end <= u.end {
            if l.end == u.end {
                // At the seam heights decide, so that no rounding can make both of two orders wrong.
                return l.end == SEAM && on_seam(l.normal).z > on_seam(u.normal).z;
            }
            if upper == self.horizon { self.end_height(l) > 0.0 } else { u.normal.dot(self.end(l)) > 0.0 }
        } else if lower == self.horizon {
            self.end_height(u) <= 0.0
        } else {
            l.normal.dot(self.end(u)) < 0.0
        }
    }

    /// Last point of an edge.
    pub(super) fn end(&self, edge: &Edge) -> DVec3 {
        self.vertices.get(edge.end as usize).map_or_else(|| on_seam(edge.normal), |vertex| vertex.position)
    }

    /// Height of an edge's end above the horizon.
    pub(super) fn end_height(&self, edge: &Edge) -> f64 {
        match self.vertices.get(edge.end as usize) {
            Some(vertex) => vertex.height,
            None => self.edge(self.horizon).normal.dot(on_seam(edge.normal)),
        }
    }

    pub(super) fn end_azimuth(&self, edge: &Edge) -> f64 {
        self.vertices.get(edge.end as usize).map_or(TURN_END, |vertex| vertex.azimuth)
    }

    /// Enters the crossing of two new neighbours, if they have one.
    #[inline]
    pub(super) fn expect_crossing(&mut self, upper: u32, lower: u32) {
        if self.crosses(upper, lower) {
            let crossing = Crossing::new(self.crossing_azimuth(upper, lower), upper, lower);
            self.queue.crossings.push(crossing);
        }
    }

    /// Azimuth of the crossing, within what is left of both edges.
    pub(super) fn crossing_azimuth(&self, upper: u32, lower: u32) -> f64 {
        let (u, l) = (self.edge(upper), self.edge(lower));
        // Of the two intersections of the circles this is the one behind which u is below l. Where edges touch, rounding
        // may have made a crossing of it, and then it may be the other one: take the one nearer to the range.
        let crossing = u.normal.cross(l.normal);
        let (now, end) = (self.now, self.end_azimuth(if u.end < l.end { u } else { l }));
        let half_turn = 0.5 * TURN_END;
        let middle = 0.5 * (now + end);
        let mut ahead = azimuth(crossing.x, crossing.y) - middle;
        if ahead.abs() > 0.5 * half_turn {
            ahead -= half_turn.copysign(ahead);
            if ahead.abs() > 0.5 * half_turn {
                ahead -= half_turn.copysign(ahead);
            }
        }
        (middle + ahead).min(end).max(now)
    }

    pub(super) fn cross_until(&mut self, azimuth: f64) {
        while let Some(crossing) = self.queue.crossings.pop_until(azimuth) {
            let (upper, lower) = (crossing.upper(), crossing.lower());
            // An edge that has ended has no next.
            if self.status(upper).next == lower {
                self.now = crossing.azimuth();
                self.exchange(upper, lower, None);
            }
        }
    }

    /// Ends the horizon's boundary arc and begins another: an arc of half a turn or more has no closed form.
    pub(super) fn break_horizon(&mut self, azimuth: f64) {
        if self.horizon != NIL {
            self.cross_until(azimuth);
            let point = on_line(self.edge(self.horizon).normal, azimuth).normalize();
            self.close_visible(self.horizon, point);
            self.close_negative(self.horizon, point);
            self.queue.from[self.horizon as usize] = [point; 2];
        }
    }

    /// Exchanges two neighbours at a point, or where they cross.
    pub(super) fn exchange(&mut self, upper: u32, lower: u32, point: Option<DVec3>) {
        self.region.residuals.crossings += 1;
        let (before, after) = (self.status(upper).prev, self.status(lower).next);
        self.link(before, lower);
        self.link(lower, upper);
        self.link(upper, after);
        let (top, between) = (self.status(upper).above, self.status(lower).above);
        let bottom = self.below(lower);
        let between_now = top + self.edge(lower).jump;
        self.status_mut(lower).above = top;
        self.status_mut(upper).above = between_now;
        let was_and_is_hidden = top.min(bottom).min(between).min(between_now) > 0;
        if !was_and_is_hidden && (self.is_stale(upper) || self.is_stale(lower)) {
            let point = point.unwrap_or_else(|| self.crossing_point(upper, lower));
            self.refresh(upper, point);
            self.refresh(lower, point);
        }
        self.expect_crossing(before, lower);
        self.expect_crossing(upper, after);
    }

    /// Ends all boundary arcs at the seam.
    pub(super) fn finish(&mut self) {
        let mut id = self.status(TOP).next;
        let mut last = TOP;
        while id != NIL {
            let to = on_seam(self.edge(id).normal);
            self.close_visible(id, to);
            self.close_negative(id, to);
            last = id;
            id = self.status(id).next;
        }
        if self.horizon == NIL {
            // The boundary's excess about the pole counts what lies above it; the other pole adds the whole sphere.
            let turn = 4.0 * std::f64::consts::PI;
            match self.below(last) {
                0 => self.region.solid_angle += turn,
                depth if depth < 0 => self.region.residuals.negative += turn,
                _ => {}
            }
        }
    }
}
