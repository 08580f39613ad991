//! Boundary arcs: where one side of an edge alone has W = 0.

use glam::DVec3;

use super::chart::{Chart, at_azimuth};
use super::edges::{Edge, on_line};
use super::region::{Region, Residuals};
use super::sweep::Sweep;
use crate::sphere::BoundaryArc;

impl Region {
    pub(super) fn clear(&mut self) {
        self.boundary.clear();
        self.sources.clear();
        self.solid_angle = 0.0;
        self.residuals = Residuals::default();
    }

    /// Adds the part of an edge between two points, with the region on its side `side` (+1 above, -1 below, 0 neither).
    pub(super) fn push(&mut self, chart: &Chart, edge: &Edge, from: DVec3, to: DVec3, side: i8) {
        if let Some(arc) = self.arc(edge.normal, from, to, side) {
            self.sources.push(edge.source);
            self.solid_angle += arc.solid_angle_from(DVec3::Z);
            self.boundary.push(BoundaryArc {
                start: chart.world(arc.start),
                end: chart.world(arc.end),
                normal: chart.world(arc.normal),
            });
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

    /// Closes the books: loops add up to nothing.
    pub(super) fn finish(&mut self) {
        self.residuals.closure = self.boundary.iter().map(|arc| arc.end - arc.start).sum::<DVec3>().length();
    }
}

impl Sweep<'_> {
    /// A unit vector on both edges, or within rounding of them.
    pub(super) fn crossing_point(&self, upper: u32, lower: u32) -> DVec3 {
        /// Sine of the angle below which the crossing of two lines is worse known than its azimuth has been clamped.
        const PARALLEL: f64 = 1e-4;
        let (u, l) = (self.edge(upper).normal, self.edge(lower).normal);
        let crossing = u.cross(l);
        let (uu, ll) = (u.length_squared(), l.length_squared());
        // An edge that is a point has no line: the crossing is where it is.
        if uu == 0.0 || ll == 0.0 {
            return self.end(self.edge(if uu == 0.0 { upper } else { lower }));
        }
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
    pub(super) fn sides(&self, id: u32) -> (i8, i8) {
        let above = self.status(id).above;
        let below = self.below(id);
        ((above == 0) as i8 - (below == 0) as i8, (above < 0) as i8 - (below < 0) as i8)
    }

    pub(super) fn is_stale(&self, id: u32) -> bool {
        let status = self.status(id);
        self.sides(id) != (status.visible, status.negative)
    }

    /// Ends and begins boundary arcs on an edge after W has changed beside it.
    pub(super) fn refresh(&mut self, id: u32, point: DVec3) {
        let (visible, negative) = self.sides(id);
        if visible != self.status(id).visible {
            self.close_visible(id, point);
            self.status_mut(id).visible = visible;
            self.queue.from[id as usize][0] = point;
        }
        if negative != self.status(id).negative {
            self.close_negative(id, point);
            self.status_mut(id).negative = negative;
            self.queue.from[id as usize][1] = point;
        }
    }

    pub(super) fn close_visible(&mut self, id: u32, to: DVec3) {
        let edge = &self.edges[id as usize];
        let visible = self.queue.status[id as usize].visible;
        self.region.push(self.chart, edge, self.queue.from[id as usize][0], to, visible);
    }

    pub(super) fn close_negative(&mut self, id: u32, to: DVec3) {
        let edge = &self.edges[id as usize];
        let negative = self.queue.status[id as usize].negative;
        if let Some(arc) = self.region.arc(edge.normal, self.queue.from[id as usize][1], to, negative) {
            self.region.residuals.negative += arc.solid_angle_from(DVec3::Z);
        }
    }
}
