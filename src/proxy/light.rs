use std::f64::consts::PI;

use glam::{DMat3, DVec3, Vec3};

use crate::integrand::environment_harmonics;
use crate::scene::Environment;
use crate::sphere::{Order, TripleProduct, clamped_cosine, evaluate, rotate};

/// Distant light in spherical harmonics, with what the stages need of it.
#[derive(Clone, Debug)]
pub struct DistantLight {
    order: Order,
    /// Radiance, per colour.
    coefficients: [Vec<f64>; 3],
}

/// The light as proxies reflect it: unshadowed irradiance over pi in three bands, as polynomials of the normal.
///
/// A white proxy's surface with the normal w has the radiance constant + linear . w + w . (quadratic w), per colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectedLight {
    /// Band 0, per colour.
    pub constant: [f32; 3],
    /// Band 1, per colour.
    pub linear: [[f32; 3]; 3],
    /// Band 2, per colour: xx, yy, zz, xy, yz, zx of the symmetric matrix, without trace.
    pub quadratic: [[f32; 6]; 3],
}

impl ReflectedLight {
    /// Radiance of a white surface with the unit normal `n`.
    pub fn radiance(&self, n: Vec3) -> [f32; 3] {
        let Vec3 { x, y, z } = n;
        std::array::from_fn(|colour| {
            let [xx, yy, zz, xy, yz, zx] = self.quadratic[colour];
            let [lx, ly, lz] = self.linear[colour];
            let squares = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + yz * y * z + zx * z * x);
            self.constant[colour] + (lx * x + ly * y + lz * z) + squares
        })
    }

    /// Whether there is nothing to reflect.
    pub fn is_dark(&self) -> bool {
        let all = self.constant.iter().chain(self.linear.as_flattened()).chain(self.quadratic.as_flattened());
        all.into_iter().all(|x| *x == 0.0)
    }
}

impl DistantLight {
    /// The projection of an environment.
    pub fn new(environment: &Environment, order: Order) -> Self {
        Self { order, coefficients: environment_harmonics(environment, order) }
    }

    /// Light given by coefficients per colour, `order.len()` each.
    ///
    /// # Panics
    /// If there are more or fewer.
    pub fn from_coefficients(order: Order, coefficients: [Vec<f64>; 3]) -> Self {
        assert!(coefficients.iter().all(|colour| colour.len() == order.len()));
        Self { order, coefficients }
    }

    /// The number of bands.
    pub fn order(&self) -> Order {
        self.order
    }

    /// Radiance per colour in spherical harmonics.
    pub fn coefficients(&self) -> &[Vec<f64>; 3] {
        &self.coefficients
    }

    /// The light turned by `rotation`.
    pub fn rotated(&self, rotation: DMat3) -> Self {
        let turn = |colour: &Vec<f64>| {
            let mut out = vec![0.0; colour.len()];
            rotate(self.order, rotation, colour, &mut out);
            out
        };
        Self { order: self.order, coefficients: self.coefficients.each_ref().map(turn) }
    }

    /// Radiance from a direction.
    pub fn radiance(&self, w: DVec3) -> [f64; 3] {
        let mut y = vec![0.0; self.order.len()];
        evaluate(self.order, w, &mut y);
        self.coefficients.each_ref().map(|colour| dot(colour, &y))
    }

    /// Irradiance of an unshadowed surface of normal `n`.
    pub fn irradiance(&self, n: DVec3) -> [f64; 3] {
        let cosine = clamped_cosine(self.order, n);
        self.coefficients.each_ref().map(|colour| dot(colour, &cosine))
    }

    /// The product matrix of every colour, row-major: `matrix[colour] O` are the coefficients of the light that the visibility O
    /// leaves.
    pub fn product_matrices(&self) -> [Vec<f32>; 3] {
        let product = TripleProduct::new(self.order);
        self.coefficients.each_ref().map(|colour| product.matrix(colour).iter().map(|x| *x as f32).collect())
    }

    /// The light as proxies reflect it.
    pub fn reflected(&self) -> ReflectedLight {
        let mut light = ReflectedLight { constant: [0.0; 3], linear: [[0.0; 3]; 3], quadratic: [[0.0; 6]; 3] };
        let order = Order::new(3).expect("three bands are an order");
        // Convolution with the clamped cosine: sqrt(4 pi / (2l + 1)) times its zonal coefficient; over pi.
        let zonal = clamped_cosine(order, DVec3::Z);
        let factor = |l: usize| (4.0 * PI / (2 * l + 1) as f64).sqrt() * zonal[l * l + l] / PI;
        for (colour, coefficients) in self.coefficients.iter().enumerate() {
            let at = |i: usize| coefficients.get(i).copied().unwrap_or_default();
            light.constant[colour] = (factor(0) * at(0) * 0.5 / PI.sqrt()) as f32;
            let first = factor(1) * (0.75 / PI).sqrt();
            light.linear[colour] = [first * at(3), first * at(1), first * at(2)].map(|x| x as f32);
            // Y_2 = sqrt(15/4pi) (xy, yz, (2zz - xx - yy) / sqrt(12), zx, (xx - yy) / 2).
            let second = factor(2) * (3.75 / PI).sqrt();
            let (zz, xx_yy) = (at(6) / 12f64.sqrt(), 0.5 * at(8));
            let quadratic = [xx_yy - zz, -xx_yy - zz, 2.0 * zz, 0.5 * at(4), 0.5 * at(5), 0.5 * at(7)];
            light.quadratic[colour] = quadratic.map(|x| (second * x) as f32);
        }
        light
    }

    /// The greatest unshadowed irradiance over normals, of the brightest colour.
    pub fn greatest_irradiance(&self) -> f64 {
        normals().flat_map(|n| self.irradiance(n)).fold(0.0, f64::max)
    }
}

/// Directions spread over the sphere: a spiral of golden-section steps.
pub(super) fn normals() -> impl Iterator<Item = DVec3> {
    const COUNT: usize = 256;
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..COUNT).map(move |i| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / COUNT as f64;
        let (s, c) = (golden * i as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * c, r * s, z)
    })
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Coefficients of the clamped cosine about `n` in three bands, single precision: all that there is up to four bands, since the
/// fourth is zero.
#[inline(always)]
pub(super) fn cosine_harmonics(n: Vec3) -> [f32; 9] {
    // Products of the zonal coefficients sqrt(pi)/2, sqrt(pi/3), sqrt(5 pi)/8, of sqrt(4 pi / (2l + 1)) and of the
    // harmonics' own factors sqrt(1/4pi), sqrt(3/4pi), sqrt(15/4pi).
    const C0: f32 = 0.886_226_9;
    const C1: f32 = 1.023_326_7;
    const C2: f32 = 0.858_085_5;
    // sqrt(12) in the denominator of the zonal harmonic of band 2.
    const ZONAL: f32 = 0.288_675_13;
    let Vec3 { x, y, z } = n;
    [
        C0,
        C1 * y,
        C1 * z,
        C1 * x,
        C2 * x * y,
        C2 * y * z,
        C2 * ZONAL * (2.0 * z * z - x * x - y * y),
        C2 * z * x,
        C2 * 0.5 * (x * x - y * y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light() -> DistantLight {
        let order = Order::new(4).unwrap();
        let colour = |k: usize| (0..16).map(|i| ((i * 7 + 3 * k) % 11) as f64 / 11.0 - 0.3).collect();
        DistantLight::from_coefficients(order, [colour(0), colour(1), colour(2)])
    }

    #[test]
    fn cosine_equals_double_precision() {
        for n in normals() {
            let exact = clamped_cosine(Order::new(3).unwrap(), n);
            for (value, exact) in cosine_harmonics(n.as_vec3()).iter().zip(exact) {
                assert!((f64::from(*value) - exact).abs() < 1e-6, "{value} {exact}");
            }
        }
    }

    #[test]
    fn reflected_light_is_irradiance_over_pi() {
        let light = light();
        let reflected = light.reflected();
        for n in normals() {
            let irradiance = light.irradiance(n);
            let radiance = reflected.radiance(n.as_vec3());
            for colour in 0..3 {
                let value = radiance[colour];
                // The cosine has no fourth band.
                assert!((f64::from(value) - irradiance[colour] / PI).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn turning_the_light_turns_what_it_does() {
        let light = light();
        let turn = DMat3::from_rotation_y(0.7);
        let turned = light.rotated(turn);
        for n in normals().take(9) {
            let (a, b) = (light.irradiance(n), turned.irradiance(turn * n));
            assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-13));
        }
    }
}
