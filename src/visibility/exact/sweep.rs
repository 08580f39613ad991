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

use std::ops::Range;

use glam::DVec3;

use super::chart::{Chart, TURN_END, at_azimuth, azimuth};
use super::crossings::{Crossing, Crossings};
use super::edges::{Edge, Edges, HORIZON_JUMP, NIL, NO_LANDMARK, SEAM, TOP, Vertex, on_line, on_seam};
use super::region::{Region, Residuals};
use crate::sphere::BoundaryArc;

/// Buffers of the sweep, kept between receivers.
#[derive(Debug, Default)]
pub(super) struct Queue {
    crossings: Crossings,
    ends: Vec<u32>,
    starts: Vec<u32>,
    landmarks: Landmarks,
    /// Where the boundary arcs under way began, of {W = 0} and of {W < 0}, for edges whose `visible` or `negative` is not 0.
    from: Vec<[DVec3; 2]>,
}

/// Every few edges of the order, from which searches set out. They may be out of date: they make searches short, not right.
#[derive(Debug, Default)]
struct Landmarks {
    /// Downwards; those that have ended without a successor are NIL.
    edges: Vec<u32>,
    /// Steps of searches since the landmarks were chosen.
    steps: u32,
    /// Steps that pay for choosing anew.
    budget: u32,
}

/// Edges from one landmark to the next.
const STRIDE: u32 = 8;

/// Sweeps over the edges and writes the boundary of {W = 0} and the residuals; `depth_at_pole` is W at the pole.
pub(super) fn sweep(edges: &mut Edges, queue: &mut Queue, chart: &Chart, depth_at_pole: i32, region: &mut Region) {
    region.boundary.clear();
    region.residuals = Residuals { unbalanced: edges.bad, ..Residuals::default() };
    queue.crossings.reset(edges.vertices.len());
    queue.landmarks = Landmarks { edges: std::mem::take(&mut queue.landmarks.edges), steps: 0, budget: 0 };
    queue.landmarks.edges.clear();
    queue.from.resize(edges.edges.len(), [DVec3::ZERO; 2]);
    let mut sweep = Sweep {
        edges: &mut edges.edges,
        vertices: &edges.vertices,
        queue,
        chart,
        now: 0.0,
        horizon: edges.horizon,
        residuals: &mut region.residuals,
        boundary: &mut region.boundary,
        solid_angle: 0.0,
    };
    sweep.begin(&mut edges.at_seam, depth_at_pole);
    let mut quarter = 1.0;
    for rank in 0..edges.vertices.len() {
        let vertex = edges.vertices[rank];
        while quarter <= vertex.azimuth && quarter < TURN_END {
            sweep.break_horizon(quarter);
            quarter += 1.0;
        }
        sweep.cross_until(vertex.azimuth);
        sweep.now = vertex.azimuth;
        sweep.vertex(&vertex, Edges::starts(sweep.vertices, sweep.edges, rank));
    }
    while quarter < TURN_END {
        sweep.break_horizon(quarter);
        quarter += 1.0;
    }
    sweep.cross_until(TURN_END);
    sweep.finish();
    region.solid_angle = sweep.solid_angle;
    region.residuals.closure = region.boundary.iter().map(|arc| arc.end - arc.start).sum::<DVec3>().length();
}

struct Sweep<'a> {
    edges: &'a mut [Edge],
    vertices: &'a [Vertex],
    queue: &'a mut Queue,
    chart: &'a Chart,
    /// Azimuth of the event being handled.
    now: f64,
    /// The horizon's edge, or NIL.
    horizon: u32,
    residuals: &'a mut Residuals,
    boundary: &'a mut Vec<BoundaryArc>,
    solid_angle: f64,
}

impl Sweep<'_> {
    fn edge(&self, id: u32) -> &Edge {
        &self.edges[id as usize]
    }

    fn edge_mut(&mut self, id: u32) -> &mut Edge {
        &mut self.edges[id as usize]
    }

    fn below(&self, id: u32) -> i32 {
        let edge = self.edge(id);
        edge.above + edge.jump
    }

    fn link(&mut self, upper: u32, lower: u32) {
        self.edge_mut(upper).next = lower;
        if lower != NIL {
            self.edge_mut(lower).prev = upper;
        }
    }

    /// Puts the edges that cross the seam in order.
    fn begin(&mut self, at_seam: &mut [u32], depth_at_pole: i32) {
        let latitude = |id: u32| on_seam(self.edges[id as usize].normal).z;
        at_seam.sort_by(|&a, &b| latitude(b).total_cmp(&latitude(a)).then(a.cmp(&b)));
        let top = self.edge_mut(TOP);
        (top.above, top.next) = (depth_at_pole, NIL);
        let mut upper = TOP;
        for &id in &*at_seam {
            self.link(upper, id);
            self.edge_mut(id).next = NIL;
            self.edge_mut(id).above = self.below(upper);
            upper = id;
        }
        for &id in &*at_seam {
            self.refresh(id, on_seam(self.edge(id).normal));
            let upper = self.edge(id).prev;
            self.expect_crossing(upper, id);
        }
    }

    /// Whether two neighbours cross before either of them ends.
    #[inline(always)]
    fn crosses(&self, upper: u32, lower: u32) -> bool {
        if lower == NIL {
            return false;
        }
        let (u, l) = (self.edge(upper), self.edge(lower));
        if l.end <= u.end {
            if l.end == u.end && l.end != SEAM {
                return false;
            }
            if upper == self.horizon { self.end_height(l) > 0.0 } else { u.normal.dot(self.end(l)) > 0.0 }
        } else if lower == self.horizon {
            self.end_height(u) <= 0.0
        } else {
            l.normal.dot(self.end(u)) < 0.0
        }
    }

    /// Last point of an edge.
    fn end(&self, edge: &Edge) -> DVec3 {
        self.vertices.get(edge.end as usize).map_or_else(|| on_seam(edge.normal), |vertex| vertex.position)
    }

    /// Height of an edge's end above the horizon.
    fn end_height(&self, edge: &Edge) -> f64 {
        match self.vertices.get(edge.end as usize) {
            Some(vertex) => vertex.height,
            None => self.edge(self.horizon).normal.dot(on_seam(edge.normal)),
        }
    }

    fn end_azimuth(&self, edge: &Edge) -> f64 {
        self.vertices.get(edge.end as usize).map_or(TURN_END, |vertex| vertex.azimuth)
    }

    /// Enters the crossing of two new neighbours, if they have one.
    #[inline]
    fn expect_crossing(&mut self, upper: u32, lower: u32) {
        if self.crosses(upper, lower) {
            let crossing = Crossing::new(self.crossing_azimuth(upper, lower), upper, lower);
            self.queue.crossings.push(crossing);
        }
    }

    /// Azimuth of the crossing, within what is left of both edges.
    fn crossing_azimuth(&self, upper: u32, lower: u32) -> f64 {
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

    fn cross_until(&mut self, azimuth: f64) {
        while let Some(crossing) = self.queue.crossings.pop_until(azimuth) {
            let (upper, lower) = (crossing.upper(), crossing.lower());
            // An edge that has ended has no next.
            if self.edge(upper).next == lower {
                self.now = crossing.azimuth();
                self.exchange(upper, lower, None);
            }
        }
    }

    /// Ends the horizon's boundary arc and begins another: an arc of half a turn or more has no closed form.
    fn break_horizon(&mut self, azimuth: f64) {
        if self.horizon != NIL {
            self.cross_until(azimuth);
            let point = on_line(self.edge(self.horizon).normal, azimuth).normalize();
            self.close_visible(self.horizon, point);
            self.close_negative(self.horizon, point);
            self.queue.from[self.horizon as usize] = [point; 2];
        }
    }

    /// Exchanges two neighbours at a point, or where they cross.
    fn exchange(&mut self, upper: u32, lower: u32, point: Option<DVec3>) {
        self.residuals.crossings += 1;
        let (before, after) = (self.edge(upper).prev, self.edge(lower).next);
        self.link(before, lower);
        self.link(lower, upper);
        self.link(upper, after);
        let (top, between) = (self.edge(upper).above, self.edge(lower).above);
        let bottom = self.below(lower);
        let between_now = top + self.edge(lower).jump;
        self.edge_mut(lower).above = top;
        self.edge_mut(upper).above = between_now;
        let was_and_is_hidden = top.min(bottom).min(between).min(between_now) > 0;
        if !was_and_is_hidden && (self.is_stale(upper) || self.is_stale(lower)) {
            let point = point.unwrap_or_else(|| self.crossing_point(upper, lower));
            self.refresh(upper, point);
            self.refresh(lower, point);
        }
        self.expect_crossing(before, lower);
        self.expect_crossing(upper, after);
    }

    /// A unit vector on both edges, or within rounding of them.
    fn crossing_point(&self, upper: u32, lower: u32) -> DVec3 {
        /// Sine of the angle below which the crossing of two lines is worse known than its azimuth has been clamped.
        const PARALLEL: f64 = 1e-4;
        let (u, l) = (self.edge(upper).normal, self.edge(lower).normal);
        let crossing = u.cross(l);
        let (uu, ll) = (u.length_squared(), l.length_squared());
        if crossing.length_squared() > PARALLEL * PARALLEL * uu * ll {
            let crossing = crossing.normalize();
            let (x, y) = at_azimuth(self.now);
            return if crossing.x * x + crossing.y * y < 0.0 { -crossing } else { crossing };
        }
        // The line further from the pole is the better known at an azimuth.
        let steady = if u.z * u.z * ll > l.z * l.z * uu { u } else { l };
        on_line(steady, self.now).normalize_or_zero()
    }

    /// Which sides of an edge are visible, which negative.
    fn sides(&self, id: u32) -> (i8, i8) {
        let above = self.edge(id).above;
        let below = self.below(id);
        ((above == 0) as i8 - (below == 0) as i8, (above < 0) as i8 - (below < 0) as i8)
    }

    fn is_stale(&self, id: u32) -> bool {
        let edge = self.edge(id);
        self.sides(id) != (edge.visible, edge.negative)
    }

    /// Ends and begins boundary arcs on an edge after W has changed beside it.
    fn refresh(&mut self, id: u32, point: DVec3) {
        let (visible, negative) = self.sides(id);
        if visible != self.edge(id).visible {
            self.close_visible(id, point);
            self.edge_mut(id).visible = visible;
            self.queue.from[id as usize][0] = point;
        }
        if negative != self.edge(id).negative {
            self.close_negative(id, point);
            self.edge_mut(id).negative = negative;
            self.queue.from[id as usize][1] = point;
        }
    }

    fn close_visible(&mut self, id: u32, to: DVec3) {
        let edge = self.edge(id);
        if let Some(arc) = self.arc(edge.normal, self.queue.from[id as usize][0], to, edge.visible) {
            self.solid_angle += arc.solid_angle_from(DVec3::Z);
            let chart = self.chart;
            self.boundary.push(BoundaryArc {
                start: chart.to_world(arc.start),
                end: chart.to_world(arc.end),
                normal: chart.to_world(arc.normal),
            });
        }
    }

    fn close_negative(&mut self, id: u32, to: DVec3) {
        let edge = self.edge(id);
        if let Some(arc) = self.arc(edge.normal, self.queue.from[id as usize][1], to, edge.negative) {
            self.residuals.negative += arc.solid_angle_from(DVec3::Z);
        }
    }

    /// The arc of a line between two points, its region on the left; none if there is no region or no line.
    fn arc(&mut self, normal: DVec3, from: DVec3, to: DVec3, side: i8) -> Option<BoundaryArc> {
        if side == 0 || normal == DVec3::ZERO {
            return None;
        }
        let normal = normal.normalize();
        let (off_start, off_end) = (normal.dot(from), normal.dot(to));
        self.residuals.gap = self.residuals.gap.max(off_start.abs()).max(off_end.abs());
        let (start, end) = (from - off_start * normal, to - off_end * normal);
        Some(if side > 0 {
            BoundaryArc { start, end, normal }
        } else {
            BoundaryArc { start: end, end: start, normal: -normal }
        })
    }

    /// Replaces the edges that end at a vertex by those that start there.
    fn vertex(&mut self, vertex: &Vertex, starts: Range<u32>) {
        let (position, is_below) = (vertex.position, vertex.height <= 0.0);
        self.collect(vertex.ends, starts, is_below);
        let (mut upper, lower) = match (self.queue.ends.is_empty(), self.queue.starts.is_empty()) {
            (true, true) => return,
            (true, false) => self.locate(position, is_below),
            _ => self.remove_ends(position, is_below),
        };
        let first = upper;
        for i in 0..self.queue.starts.len() {
            let id = self.queue.starts[i];
            self.link(upper, id);
            self.edge_mut(id).above = self.below(upper);
            self.refresh(id, position);
            upper = id;
        }
        self.link(upper, lower);
        let mut above = first;
        while above != lower {
            let below = self.edge(above).next;
            self.expect_crossing(above, below);
            above = below;
        }
    }

    /// Lists the edges that end and start at a vertex, the latter downwards; checks that their jumps cancel.
    fn collect(&mut self, mut ends: u32, starts: Range<u32>, is_below: bool) {
        let mut balance = 0;
        self.queue.ends.clear();
        while ends != NIL {
            self.queue.ends.push(ends);
            balance -= self.edge(ends).jump;
            ends = self.edge(ends).next_end;
        }
        self.queue.starts.clear();
        for start in starts {
            self.queue.starts.push(start);
            balance += self.edge(start).jump;
        }
        if balance != 0 && !is_below {
            self.residuals.unbalanced += 1;
        }
        // By insertion: rounding may make the comparison intransitive, which is harmless here and not in `sort_by`.
        for i in 1..self.queue.starts.len() {
            for j in (1..=i).rev() {
                let (upper, lower) = (self.queue.starts[j - 1], self.queue.starts[j]);
                if !self.crosses(upper, lower) {
                    break;
                }
                self.queue.starts.swap(j - 1, j);
            }
        }
    }

    /// The neighbours between which a vertex without ending edges lies.
    fn locate(&mut self, position: DVec3, is_below: bool) -> (u32, u32) {
        let mut upper = if is_below { self.horizon } else { self.landmark_above(position) };
        loop {
            let lower = self.edge(upper).next;
            if lower == NIL || lower == self.horizon || self.edge(lower).normal.dot(position) > 0.0 {
                return (upper, lower);
            }
            self.queue.landmarks.steps += 1;
            upper = lower;
        }
    }

    /// A landmark above a position above the horizon, near it if they are up to date.
    fn landmark_above(&mut self, position: DVec3) -> u32 {
        if self.queue.landmarks.steps >= self.queue.landmarks.budget {
            self.choose_landmarks();
        }
        let landmarks = &self.queue.landmarks.edges;
        let is_above = |id: u32| {
            let edge = self.edge(id);
            edge.above < HORIZON_JUMP / 2 && edge.normal.dot(position) <= 0.0
        };
        let below = landmarks.partition_point(|&id| id == NIL || is_above(id));
        landmarks[..below].iter().rev().copied().find(|&id| id != NIL && is_above(id)).unwrap_or(TOP)
    }

    fn choose_landmarks(&mut self) {
        let mut landmarks = std::mem::take(&mut self.queue.landmarks.edges);
        for id in landmarks.drain(..).filter(|&id| id != NIL) {
            self.edge_mut(id).landmark = NO_LANDMARK;
        }
        let (mut count, mut id) = (0, self.edge(TOP).next);
        while id != self.horizon && id != NIL {
            count += 1;
            if count % STRIDE == 0 && landmarks.len() < NO_LANDMARK as usize {
                self.edge_mut(id).landmark = landmarks.len() as u16;
                landmarks.push(id);
            }
            id = self.edge(id).next;
        }
        self.queue.landmarks = Landmarks { edges: landmarks, steps: 0, budget: 2 * count + STRIDE };
    }

    /// Takes the edges that end at a vertex out of the order; returns the neighbours of the gap.
    fn remove_ends(&mut self, position: DVec3, is_below: bool) -> (u32, u32) {
        let first = self.queue.ends[0];
        if is_below {
            for i in 0..self.queue.ends.len() {
                let id = self.queue.ends[i];
                // Above the horizon by rounding only.
                while self.edge(id).above < HORIZON_JUMP / 2 && self.edge(id).next != NIL {
                    self.force(id, self.edge(id).next, position);
                }
            }
        }
        let (mut highest, mut lowest) = (first, first);
        for i in 1..self.queue.ends.len() {
            let id = self.queue.ends[i];
            if self.is_below(highest, id) {
                while self.edge(id).prev != lowest {
                    self.force(self.edge(id).prev, id, position);
                }
                lowest = id;
            } else {
                while self.edge(id).next != highest {
                    self.force(id, self.edge(id).next, position);
                }
                highest = id;
            }
        }
        let (upper, lower) = (self.edge(highest).prev, self.edge(lowest).next);
        for i in 0..self.queue.ends.len() {
            let id = self.queue.ends[i];
            self.close_visible(id, position);
            self.close_negative(id, position);
            self.edge_mut(id).next = NIL;
            let landmark = self.edge(id).landmark;
            if landmark != NO_LANDMARK {
                let free = self.queue.starts.iter().copied().find(|&start| self.edge(start).landmark == NO_LANDMARK);
                self.queue.landmarks.edges[landmark as usize] = free.unwrap_or(NIL);
                if let Some(successor) = free {
                    self.edge_mut(successor).landmark = landmark;
                }
            }
        }
        self.link(upper, lower);
        (upper, lower)
    }

    fn force(&mut self, upper: u32, lower: u32, point: DVec3) {
        self.residuals.forced += 1;
        self.exchange(upper, lower, Some(point));
    }

    /// Whether `id` comes below `reference` in the order; walks both ways, as they are near each other.
    fn is_below(&self, reference: u32, id: u32) -> bool {
        let (mut up, mut down) = (reference, reference);
        loop {
            if down != NIL {
                down = self.edge(down).next;
                if down == id {
                    return true;
                }
            }
            if up != TOP {
                up = self.edge(up).prev;
                if up == id {
                    return false;
                }
            }
            if up == TOP && down == NIL {
                return true;
            }
        }
    }

    /// Ends all boundary arcs at the seam.
    fn finish(&mut self) {
        let mut id = self.edge(TOP).next;
        let mut last = TOP;
        while id != NIL {
            let to = on_seam(self.edge(id).normal);
            self.close_visible(id, to);
            self.close_negative(id, to);
            last = id;
            id = self.edge(id).next;
        }
        if self.horizon == NIL {
            // The boundary's excess about the pole counts what lies above it; the other pole adds the whole sphere.
            let turn = 4.0 * std::f64::consts::PI;
            match self.below(last) {
                0 => self.solid_angle += turn,
                depth if depth < 0 => self.residuals.negative += turn,
                _ => {}
            }
        }
    }
}
