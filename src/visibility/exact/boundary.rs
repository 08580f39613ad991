//! Boundary arcs: where one side of an edge alone has W = 0.

use glam::DVec3;

use super::chart::{Chart, at_azimuth};
use super::edges::{Edge, on_line};
use super::region::{Region, Residuals};
use super::sweep::Sweep;
use crate::sphere::BoundaryArc;

/// A part of an edge with the region on its left, from one point to another, in the chart.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Piece {
    /// Of the edge's plane, of any length.
    normal: DVec3,
    from: DVec3,
    to: DVec3,
    /// The region is that of W < 0.
    is_negative: bool,
}

/// Pieces settled side by side.
const LANES: usize = 4;

/// Vectors side by side, by component.
type Lanes3 = [[f64; LANES]; 3];

/// What pieces become.
struct Settled {
    start: Lanes3,
    end: Lanes3,
    normal: Lanes3,
    /// Distance of the given ends from the circle.
    gap: [f64; LANES],
    /// Of the triangle with the chart's pole.
    solid_angle: [f64; LANES],
}

impl Region {
    pub(super) fn clear(&mut self) {
        self.pieces.clear();
        self.boundary.clear();
        self.sources.clear();
        self.solid_angle = 0.0;
        self.residuals = Residuals::default();
    }

    /// Adds the part of an edge between two points, with the region on its side `side` (+1 above, -1 below, 0 neither).
    #[inline(always)]
    pub(super) fn push(&mut self, edge: &Edge, from: DVec3, to: DVec3, side: i8) {
        if self.note(edge, from, to, side, false) {
            self.sources.push(edge.source);
        }
    }

    /// The same for the boundary of W < 0.
    pub(super) fn push_negative(&mut self, edge: &Edge, from: DVec3, to: DVec3, side: i8) {
        self.note(edge, from, to, side, true);
    }

    /// Notes a piece; returns whether there is a region, and a line.
    #[inline(always)]
    fn note(&mut self, edge: &Edge, from: DVec3, to: DVec3, side: i8, is_negative: bool) -> bool {
        let normal = edge.normal;
        if side == 0 || normal == DVec3::ZERO {
            return false;
        }
        self.pieces.push(match side > 0 {
            true => Piece { normal, from, to, is_negative },
            false => Piece { normal: -normal, from: to, to: from, is_negative },
        });
        true
    }

    /// Turns the pieces into arcs and closes the books: loops add up to nothing.
    pub(super) fn finish(&mut self, chart: &Chart) {
        self.settle(chart);
        self.residuals.closure = self.boundary.iter().map(|arc| arc.end - arc.start).sum::<DVec3>().length();
    }

    /// Compares W in a direction to what it is expected to be.
    pub(super) fn check(&mut self, direction: DVec3, expected: i32, depth: impl Fn(DVec3) -> i32) {
        self.known = (direction, expected == 0);
        self.residuals.depth_mismatch = depth(direction) - expected;
    }

    /// Turns the pieces into arcs.
    fn settle(&mut self, chart: &Chart) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.settle_avx2(chart) };
        }
        self.settle_inline(chart);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn settle_avx2(&mut self, chart: &Chart) {
        self.settle_inline(chart);
    }

    #[inline(always)]
    fn settle_inline(&mut self, chart: &Chart) {
        for chunk in self.pieces.chunks(LANES) {
            let settled = Settled::new(chunk, chart);
            for (lane, piece) in chunk.iter().enumerate() {
                self.residuals.gap = self.residuals.gap.max(settled.gap[lane]);
                if piece.is_negative {
                    self.residuals.negative += settled.solid_angle[lane];
                } else {
                    self.solid_angle += settled.solid_angle[lane];
                    let [start, end, normal] = [&settled.start, &settled.end, &settled.normal]
                        .map(|[x, y, z]| DVec3::new(x[lane], y[lane], z[lane]));
                    self.boundary.push(BoundaryArc { start, end, normal });
                }
            }
        }
    }
}

impl Settled {
    /// The last piece is repeated until all lanes are full.
    #[inline(always)]
    fn new(pieces: &[Piece], chart: &Chart) -> Self {
        let zero = [[0.0; LANES]; 3];
        let (mut normals, mut froms, mut tos) = (zero, zero, zero);
        for lane in 0..LANES {
            let Piece { normal, from, to, .. } = pieces[lane.min(pieces.len() - 1)];
            for axis in 0..3 {
                (normals[axis][lane], froms[axis][lane], tos[axis][lane]) = (normal[axis], from[axis], to[axis]);
            }
        }
        let lane = [0.0; LANES];
        let mut out = Self { start: zero, end: zero, normal: zero, gap: lane, solid_angle: lane };
        for i in 0..LANES {
            let at = |[x, y, z]: &Lanes3| DVec3::new(x[i], y[i], z[i]);
            let (normal, from, to) = (at(&normals).normalize(), at(&froms), at(&tos));
            let (off_start, off_end) = (normal.dot(from), normal.dot(to));
            let (start, end) = (from - off_start * normal, to - off_end * normal);
            let (off_start, off_end) = (off_start.abs(), off_end.abs());
            out.gap[i] = if off_start > off_end { off_start } else { off_end };
            out.solid_angle[i] = BoundaryArc { start, end, normal }.solid_angle_from(DVec3::Z);
            for (lanes, local) in [(&mut out.start, start), (&mut out.end, end), (&mut out.normal, normal)] {
                let world = chart.world(local);
                (lanes[0][i], lanes[1][i], lanes[2][i]) = (world.x, world.y, world.z);
            }
        }
        out
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
        self.region.push(edge, self.queue.from[id as usize][0], to, visible);
    }

    pub(super) fn close_negative(&mut self, id: u32, to: DVec3) {
        let edge = &self.edges[id as usize];
        let negative = self.queue.status[id as usize].negative;
        self.region.push_negative(edge, self.queue.from[id as usize][1], to, negative);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::exact::tests::scenes::Random;

    #[test]
    fn portable_and_dispatched_arcs_agree_to_the_bit() {
        let mut random = Random(23);
        let mut piece = |i: usize| {
            let (from, to) = (random.direction(), random.direction());
            Piece { normal: 0.1 * from.cross(to), from, to, is_negative: i.is_multiple_of(7) }
        };
        let mut settled = Region { pieces: (0..30).map(&mut piece).collect(), ..Region::default() };
        let mut portable = settled.clone();
        let chart = Chart::new(random.direction(), 0);
        settled.settle(&chart);
        portable.settle_inline(&chart);
        assert_eq!(settled.boundary.len(), 25);
        assert_eq!((&settled.boundary, settled.solid_angle), (&portable.boundary, portable.solid_angle));
        assert_eq!(settled.residuals, portable.residuals);
        for (arc, piece) in settled.boundary.iter().zip(settled.pieces.iter().filter(|piece| !piece.is_negative)) {
            assert!(
                arc.start.distance(chart.world(piece.from)) < 1e-15 && arc.end.distance(chart.world(piece.to)) < 1e-15
            );
        }
    }
}
