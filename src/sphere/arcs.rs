//! Directed arcs of great circles, and what their closed forms say about the region on their left.

use glam::DVec3;

/// A directed arc of a great circle, part of the boundary of a region on its left: `normal . w > 0` inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryArc {
    /// First point, a unit vector.
    pub start: DVec3,
    /// Last point, a unit vector.
    pub end: DVec3,
    /// Unit normal of the circle's plane, `start x end` normalised for arcs shorter than half a turn.
    pub normal: DVec3,
}

impl BoundaryArc {
    /// Signed angle from start to end about the normal, in (-pi, pi].
    pub fn angle(&self) -> f64 {
        self.normal.dot(self.start.cross(self.end)).atan2(self.start.dot(self.end))
    }

    /// Signed solid angle of the spherical triangle (apex, start, end), in steradians, counter-clockwise positive:
    /// tan(E/2) = apex . (start x end) / (1 + apex.start + start.end + end.apex) (van Oosterom and Strackee 1983, eq. 8).
    pub fn solid_angle_from(&self, apex: DVec3) -> f64 {
        let (a, b) = (self.start, self.end);
        2.0 * apex.dot(a.cross(b - a)).atan2(1.0 + apex.dot(a) + a.dot(b) + b.dot(apex))
    }
}

/// Integral of w over the region bounded by `arcs`: half the sum of angle times normal (Lambert 1760; Baum et al. 1989).
///
/// Its dot product with a unit normal is the cosine-weighted solid angle, pi for an open hemisphere.
pub fn vector_area(arcs: &[BoundaryArc]) -> DVec3 {
    0.5 * arcs.iter().map(|arc| arc.angle() * arc.normal).sum::<DVec3>()
}
