//! The isolines of an equal-area chart, for what needs no table of light.

mod crossings;
mod front;
mod gaps;
mod sweep;
mod vertices;

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

use crate::{Error, Result};

pub use crossings::Counts;
pub(super) use crossings::{Crossings, Outlook, Way};
pub(super) use front::{Front, distance_squared};
pub(super) use gaps::Gaps;
pub use sweep::Spans;
pub(super) use sweep::{horizons, sweep};
pub(super) use vertices::place;

/// Isolines of longitude: half great circles from one pole to the opposite one.
///
/// With the axes of a [`MeridianFrame`], a direction is `(c cos u, c sin u, v)`, c^2 = 1 - v^2, with the longitude u and the sine
/// v of the latitude: Lambert's equal-area cylinder (1772), in which the solid angle is du dv. Isoline `i` has the longitude
/// `u_i = (i + 1/2) 2 pi / N`. All start in one direction, the pole -z, well above the horizon, and end where they meet it; a
/// great circle with normal `q` crosses them where the tangent of the latitude is `-(q_x cos u + q_y sin u) / q_z`.
#[derive(Clone, Debug)]
pub struct Meridians {
    cos: Vec<f64>,
    sin: Vec<f64>,
}

impl Meridians {
    /// The largest number of isolines.
    pub const MAX: usize = 1 << 21;

    /// `count` isolines around the sphere, even.
    ///
    /// # Errors
    /// A count that is odd, below 4 or above [`Meridians::MAX`].
    pub fn new(count: usize) -> Result<Self> {
        if !(4..=Self::MAX).contains(&count) || !count.is_multiple_of(2) {
            return Err(Error::input(format!(
                "the number of meridians must be even and between 4 and {}, but it is {count}",
                Self::MAX
            )));
        }
        let (sin, cos) = (0..count).map(|line| Self::longitude(count, line).sin_cos()).unzip();
        Ok(Self { cos, sin })
    }

    fn longitude(count: usize, line: usize) -> f64 {
        (line as f64 + 0.5) * TAU / count as f64
    }

    /// Number of isolines N.
    pub fn len(&self) -> usize {
        self.cos.len()
    }

    /// Never: there are at least four isolines.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Longitude of isoline `line`.
    pub fn u(&self, line: usize) -> f64 {
        Self::longitude(self.len(), line)
    }
}

/// Axes of the chart for a receiver: one of eight, by the octant of its normal.
///
/// The isolines start near the octant's diagonal. That is never further from the normal than 55 degrees, so that they cross the
/// horizon steeply; and it is far from the planes of the axes, in which edges of many scenes are seen: an edge that lies in
/// a plane through the pole is seen along the isolines, and all of it moves from one side of a line to the other at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeridianFrame {
    octant: u8,
    axes: DMat3,
}

impl MeridianFrame {
    /// Number of frames.
    pub const COUNT: usize = 8;

    /// Where the isolines of the first octant start: off the diagonal, where the diagonals of cubes and squares are.
    const START: DVec3 = DVec3::new(0.523, 0.615, 0.590);

    /// The best frame for a receiver with this normal (a probe takes any), or the second best for another look.
    pub fn facing(normal: Option<DVec3>, second: bool) -> Self {
        let normal = normal.unwrap_or(DVec3::ONE);
        let mut octant = (0..3).fold(0, |octant, axis| octant | usize::from(normal[axis] < 0.0) << axis);
        if second {
            // Beyond the nearest of its octant's sides.
            let size = normal.abs();
            let nearest = (0..3).min_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or_default();
            octant ^= 1 << nearest;
        }
        Self::of_octant(octant)
    }

    /// The frame of an octant, 0 to 7; bits: negative along x, y, z.
    pub fn of_octant(octant: usize) -> Self {
        let sign = |axis: usize| if octant >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let start = (DVec3::new(sign(0), sign(1), sign(2)) * Self::START).normalize();
        let x = start.cross(DVec3::Y).normalize();
        Self { octant: octant as u8, axes: DMat3::from_cols(x, x.cross(start), -start) }
    }

    /// Its octant.
    pub fn octant(self) -> usize {
        self.octant as usize
    }

    /// The rotation from the chart's axes to the world's.
    pub fn axes(self) -> DMat3 {
        self.axes
    }

    /// Where the isolines start.
    pub fn start(self) -> DVec3 {
        -self.axes.z_axis
    }

    /// World to chart.
    #[inline(always)]
    pub(super) fn apply(self, w: DVec3) -> DVec3 {
        DVec3::new(self.axes.x_axis.dot(w), self.axes.y_axis.dot(w), self.axes.z_axis.dot(w))
    }
}

/// What is above the horizon by less than this angle counts as below it: faces in the receiver's own plane, which rounding puts on
/// either side.
const IN_HORIZON: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_rotations_and_start_well_above_the_horizon() {
        for k in 0..2000 {
            let k = f64::from(k);
            let n = DVec3::new((k * 0.7).sin(), (k * 1.3).cos(), (k * 2.1).sin()).normalize();
            for (second, steepest) in [(false, 0.5), (true, 0.25)] {
                let frame = MeridianFrame::facing(Some(n), second);
                assert!((frame.axes().determinant() - 1.0).abs() < 1e-14);
                assert!(frame.start().dot(n) > steepest, "{n} {second} {}", frame.start().dot(n));
                assert_eq!(frame, MeridianFrame::of_octant(frame.octant()));
            }
        }
    }

    #[test]
    fn odd_counts_few_and_too_many_are_refused() {
        for count in [0, 2, 5, Meridians::MAX + 2] {
            assert!(Meridians::new(count).is_err());
        }
        assert_eq!(Meridians::new(4).unwrap().u(1), 0.75 * TAU / 2.0);
    }
}
