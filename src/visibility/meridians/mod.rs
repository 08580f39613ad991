//! The isolines of an equal-area chart of the hemisphere, for what needs no table of light.

mod crossings;
mod sweep;
mod vertices;

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use crate::{Error, Result};

pub use crossings::Counts;
pub(super) use crossings::{Crossings, above_horizon, crossed};
pub use sweep::Spans;
pub(super) use sweep::sweep;
pub(super) use vertices::Vertex;

/// Isolines of longitude: half great circles through the receiver's hemisphere, from one pole on its horizon to the other.
///
/// With the axes of a [`MeridianFrame`], a direction of the hemisphere is `(c cos u, c sin u, v)`, c^2 = 1 - v^2, with the
/// longitude u in \[0, pi\] and v the sine of the latitude in \[-1, 1\]: Lambert's equal-area cylinder (1772), in which the
/// solid angle is du dv. Isoline `i` has the longitude `u_i = (i + 1/2) pi / N`. None meets the horizon, all start in one
/// direction, the pole -z, and a great circle with normal `q` crosses them where the tangent of the latitude is
/// `-(q_x cos u + q_y sin u) / q_z`. On a full sphere either hemisphere has its own.
#[derive(Clone, Debug)]
pub struct Meridians {
    cos: Vec<f64>,
    sin: Vec<f64>,
}

impl Meridians {
    /// The largest number of isolines.
    pub const MAX: usize = 1 << 20;

    /// `count` isolines over the hemisphere.
    ///
    /// # Errors
    /// No isolines, or more than [`Meridians::MAX`].
    pub fn new(count: usize) -> Result<Self> {
        if count == 0 || count > Self::MAX {
            return Err(Error::input(format!(
                "the number of isolines must be between 1 and {}, but it is {count}",
                Self::MAX
            )));
        }
        let (sin, cos) = (0..count).map(|line| Self::longitude(count, line).sin_cos()).unzip();
        Ok(Self { cos, sin })
    }

    fn longitude(count: usize, line: usize) -> f64 {
        (line as f64 + 0.5) * PI / count as f64
    }

    /// Number of isolines N.
    pub fn len(&self) -> usize {
        self.cos.len()
    }

    /// Never: there is at least one isoline.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Longitude of isoline `line`.
    pub fn u(&self, line: usize) -> f64 {
        Self::longitude(self.len(), line)
    }
}

/// Axes of the chart for a receiver: x and z lie in its horizon, y is its normal, and the isolines run from -z to z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeridianFrame {
    axes: DMat3,
}

impl MeridianFrame {
    /// The frame about a unit normal. Frames of another `rank` have other poles.
    ///
    /// The poles keep away from the axes, along which many scenes have edges: an edge that points to a pole lies along the
    /// isolines, and all of it moves from one side of a line to the other at once.
    pub fn new(normal: DVec3, rank: usize) -> Self {
        let (sin, cos) = (0.37 + 1.1 * rank as f64).sin_cos();
        let (a, b) = normal.any_orthonormal_pair();
        let pole = a * cos + b * sin;
        Self { axes: DMat3::from_cols(normal.cross(pole), normal, pole) }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_rotations_with_poles_on_the_horizon() {
        for k in 0..200 {
            let k = f64::from(k);
            let n = DVec3::new((k * 0.7).sin(), (k * 1.3).cos(), (k * 2.1).sin()).normalize();
            for rank in 0..3 {
                let frame = MeridianFrame::new(n, rank);
                assert!((frame.axes().determinant() - 1.0).abs() < 1e-14);
                assert!(frame.start().dot(n).abs() < 1e-15);
                assert!((frame.apply(n) - DVec3::Y).length() < 1e-15);
            }
        }
    }

    #[test]
    fn no_isolines_and_too_many_are_refused() {
        assert!(Meridians::new(0).is_err() && Meridians::new(Meridians::MAX + 1).is_err());
        assert_eq!(Meridians::new(3).unwrap().u(1), PI / 2.0);
    }
}
