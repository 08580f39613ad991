//! Directed arcs of great circles, and what their closed forms say about the region on their left.

use glam::DVec3;
use smallvec::SmallVec;

use super::angle::signed_angle;

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
    #[inline(always)]
    pub fn angle(&self) -> f64 {
        signed_angle(self.start.dot(self.end), self.normal.dot(self.start.cross(self.end)))
    }

    /// Signed solid angle of the spherical triangle (apex, start, end), in steradians, counter-clockwise positive:
    /// tan(E/2) = apex . (start x end) / (1 + apex.start + start.end + end.apex) (van Oosterom and Strackee 1983, eq. 8).
    #[inline(always)]
    pub fn solid_angle_from(&self, apex: DVec3) -> f64 {
        let (a, b) = (self.start, self.end);
        2.0 * signed_angle(1.0 + apex.dot(a) + a.dot(b) + b.dot(apex), apex.dot(a.cross(b - a)))
    }
}

/// Arcs handled side by side.
const LANES: usize = 4;

/// The [angles](BoundaryArc::angle) of arcs.
pub(super) fn angles(arcs: &[BoundaryArc]) -> SmallVec<[f64; 64]> {
    let mut angles = SmallVec::from_elem(0.0, arcs.len());
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        unsafe { angles_avx2(arcs, &mut angles) };
        return angles;
    }
    angles_portable(arcs, &mut angles);
    angles
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn angles_avx2(arcs: &[BoundaryArc], angles: &mut [f64]) {
    angles_portable(arcs, angles);
}

#[inline(always)]
fn angles_portable(arcs: &[BoundaryArc], angles: &mut [f64]) {
    for (arcs, angles) in arcs.chunks(LANES).zip(angles.chunks_mut(LANES)) {
        let (mut cosines, mut sines, mut lanes) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            // The last lanes repeat the last arc.
            let arc = &arcs[lane.min(arcs.len() - 1)];
            (cosines[lane], sines[lane]) = (arc.start.dot(arc.end), arc.normal.dot(arc.start.cross(arc.end)));
        }
        for lane in 0..LANES {
            lanes[lane] = signed_angle(cosines[lane], sines[lane]);
        }
        angles.copy_from_slice(&lanes[..angles.len()]);
    }
}

/// Integral of w over the region bounded by `arcs`: half the sum of angle times normal (Lambert 1760; Baum et al. 1989).
///
/// Its dot product with a unit normal is the cosine-weighted solid angle, pi for an open hemisphere.
pub fn vector_area(arcs: &[BoundaryArc]) -> DVec3 {
    0.5 * arcs.iter().zip(angles(arcs)).map(|(arc, angle)| angle * arc.normal).sum::<DVec3>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn portable_and_dispatched_angles_agree_to_the_bit_and_are_the_angles() {
        let arcs: Vec<BoundaryArc> = (0..31)
            .map(|i| {
                let (sin, cos) = (f64::from(i - 15) * 0.2).sin_cos();
                let start = DVec3::new(0.48, 0.6, 0.64);
                let normal = DVec3::new(0.6, -0.8, 0.3).cross(start).normalize();
                BoundaryArc { start, end: cos * start + sin * normal.cross(start), normal }
            })
            .collect();
        let mut portable = vec![0.0; arcs.len()];
        angles_portable(&arcs, &mut portable);
        assert_eq!(angles(&arcs)[..], portable);
        for (i, angle) in portable.into_iter().enumerate() {
            assert!((angle - (i as f64 - 15.0) * 0.2).abs() < 1e-15, "{i}: {angle}");
        }
        assert!(angles(&[]).is_empty());
    }
}
