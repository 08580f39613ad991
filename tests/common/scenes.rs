//! What the numerical tests share: numbers at random, small geometry, and a run of the engine.
#![allow(dead_code, reason = "each test takes what it needs")]

use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, DVec3};
use silhouette::bake::{Arrays, Method, Outcome, Receivers, Request, integrate};
use silhouette::scene::{Environment, Geometry, GeometryBuilder, Mesh};

/// SplitMix64 (Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Evenly in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Evenly over the unit sphere.
    pub fn direction(&mut self) -> DVec3 {
        let (z, (sin, cos)) = (self.between(-1.0, 1.0), self.between(0.0, TAU).sin_cos());
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }

    /// One rotation among all, not evenly.
    pub fn rotation(&mut self) -> DQuat {
        DQuat::from_axis_angle(self.direction(), self.between(0.0, TAU))
    }
}

/// The meshes, all moved by `rotation`, as one geometry.
pub fn assembled(meshes: impl IntoIterator<Item = Mesh>, rotation: DQuat) -> Geometry {
    let mut builder = GeometryBuilder::default();
    for mesh in meshes {
        builder.add(mesh, DAffine3::from_quat(rotation)).unwrap();
    }
    builder.build()
}

/// All that has a meaning at these receivers in this light.
pub fn request(receivers: &Receivers, environment: Option<&Environment>, order: usize) -> Request {
    let horizon = !receivers.normals.is_empty();
    Request {
        order,
        ambient_occlusion: horizon,
        visibility_sh: true,
        transfer_sh: horizon,
        bent_normal: true,
        irradiance: horizon && environment.is_some(),
        vector_irradiance: environment.is_some(),
        ..Request::default()
    }
}

/// Integrates all of it.
pub fn run(
    geometry: &Geometry,
    environment: Option<&Environment>,
    receivers: &Receivers,
    order: usize,
    method: Method,
) -> Outcome {
    let request = request(receivers, environment, order);
    integrate(geometry, environment, receivers, &request, method, None, &()).unwrap()
}

/// An array's numbers.
pub fn values<'a>(arrays: &'a Arrays, name: &str) -> &'a [f64] {
    &arrays.get(name).unwrap_or_else(|| panic!("no array {name}")).data
}

/// Root of the mean square.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (count, sum) = values.into_iter().fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x * x));
    f64::sqrt(sum / count)
}
