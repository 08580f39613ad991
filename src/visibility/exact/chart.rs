//! Azimuth about a pole near the normal: the coordinate the sweep moves along.

use glam::{DMat3, DVec3};

/// Tilt of the pole off the normal in radians. Off the normal, because vertical edges all meet there; far from the horizon,
/// where arcs would be long in azimuth.
const TILT: f64 = 0.3819660112501051;
/// Golden angle: no two tilts lie near each other, and none near an axis-aligned plane.
const TURN: f64 = 2.399963229728653;

/// An orthonormal frame about the pole. In chart coordinates z points to the pole.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chart {
    to_world: DMat3,
}

impl Chart {
    /// A pole tilted off `normal`, another one for every `attempt`.
    pub fn new(normal: DVec3, attempt: u32) -> Self {
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let (s, c) = (TURN * (attempt as f64 + 0.71)).sin_cos();
        let aside = c * tangent + s * bitangent;
        let (s, c) = (TILT / (1.0 + 0.1 * attempt as f64)).sin_cos();
        let pole = c * normal + s * aside;
        // The seam, too, is turned away from the planes a scene is likely to have.
        let (u, v) = pole.any_orthonormal_pair();
        let (s, c) = (TURN * 0.37).sin_cos();
        let x = c * u + s * v;
        Self { to_world: DMat3::from_cols(x, pole.cross(x), pole) }
    }

    pub fn pole(&self) -> DVec3 {
        self.to_world.z_axis
    }

    pub fn local(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.to_world.x_axis.dot(v), self.to_world.y_axis.dot(v), self.to_world.z_axis.dot(v))
    }

    pub fn world(&self, v: DVec3) -> DVec3 {
        self.to_world * v
    }
}

/// Azimuth at the seam after a full turn.
pub(super) const TURN_END: f64 = 4.0;

/// Azimuth of (x, y) on the unit diamond |x| + |y| = 1 instead of the circle: monotone in the angle, no trigonometry, in
/// [0, 4]. Opposite directions differ by 2, as half-turns should. (0, 0), the pole, has azimuth 0.
pub(super) fn azimuth(x: f64, y: f64) -> f64 {
    // Zeros have no sign here: the order of azimuths is taken from their bits.
    let p = y / (x.abs() + y.abs()) + 0.0;
    if x < 0.0 {
        2.0 - p
    } else if y < 0.0 {
        4.0 + p
    } else if p >= 0.0 {
        p
    } else {
        0.0
    }
}

/// The point of the diamond at an azimuth.
pub(super) fn at_azimuth(p: f64) -> (f64, f64) {
    if p < 2.0 {
        (1.0 - p, if p < 1.0 { p } else { 2.0 - p })
    } else {
        (p - 3.0, if p < 3.0 { 2.0 - p } else { p - 4.0 })
    }
}
