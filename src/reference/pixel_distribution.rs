//! Sampling of directions in proportion to the pixels of a latitude-longitude image.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use crate::scene::Environment;
use crate::{Error, Result};

/// A density over the sphere, constant on every pixel of a latitude-longitude image.
///
/// In the image's own frame row 0 starts at +z and the last row ends at -z, all rows equally high in angle, and column 0
/// starts at +x and columns go on towards +y: pixel (column, row) holds longitudes 2 pi column / width and polar angles
/// pi row / height onwards. A matrix turns that frame to the world's.
#[derive(Clone, Debug)]
pub struct PixelDistribution {
    width: usize,
    height: usize,
    /// Orthogonal.
    to_world: DMat3,
    /// Share of the rows above, `height + 1` values from 0 to 1.
    rows: Vec<f64>,
    /// Per row: share of the columns before, `width + 1` values from 0 to 1.
    columns: Vec<f64>,
}

impl PixelDistribution {
    /// The distribution of an environment's power: the sum of its colours (without sign: lossy files hold small
    /// negative values) times solid angle.
    ///
    /// # Errors
    /// [`Error::Input`] if the sum is not finite.
    pub fn of(environment: &Environment) -> Result<Self> {
        let (width, height) = (environment.width(), environment.height());
        let weights: Vec<f64> = environment
            .pixels()
            .iter()
            .enumerate()
            .map(|(i, radiance)| f64::from(radiance.abs().element_sum()) * environment.solid_angle(i / width))
            .collect();
        // The image's first column begins at -z, its columns go on towards +x, and its top is +y.
        let columns = DMat3::from_cols(DVec3::NEG_Z, DVec3::X, DVec3::Y);
        Self::new(width, height, &weights, environment.to_scene() * columns)
    }

    /// The distribution with pixel `row * width + column` of probability proportional to `weights` (luminance times solid
    /// angle, say), uniform in solid angle within the pixel. If all weights are zero, uniform over the sphere. `to_world` is an
    /// orthogonal matrix, mirrors included.
    ///
    /// # Errors
    /// [`Error::Input`] unless there is one weight for each of `width` x `height` > 0 pixels, each finite and not negative,
    /// with a finite sum.
    pub fn new(width: usize, height: usize, weights: &[f64], to_world: DMat3) -> Result<Self> {
        if width == 0 || height == 0 || width.checked_mul(height) != Some(weights.len()) {
            return Err(Error::input(format!(
                "a distribution over {width} x {height} pixels cannot take {} weights: give one for every pixel",
                weights.len()
            )));
        }
        if let Some(at) = weights.iter().position(|w| !(w.is_finite() && *w >= 0.0)) {
            return Err(Error::input(format!(
                "the weight of pixel ({}, {}) is {}: weights are finite and not negative",
                at % width,
                at / width,
                weights[at]
            )));
        }
        if !weights.iter().sum::<f64>().is_finite() {
            return Err(Error::input("the weights of the pixels sum to infinity: scale them down"));
        }
        let mut columns = Vec::with_capacity(height * (width + 1));
        let mut totals = Vec::with_capacity(height);
        for row in weights.chunks_exact(width) {
            totals.push(row.iter().sum::<f64>());
            columns.extend(cumulative(row.iter().copied()));
        }
        if totals.iter().all(|&total| total == 0.0) {
            totals = (0..height).map(|row| polar_step(row, height)).collect();
        }
        Ok(Self { width, height, to_world, rows: cumulative(totals.into_iter()), columns })
    }

    /// The direction of the point (x, y) of the unit square, and its density per solid angle.
    pub fn sample(&self, [x, y]: [f64; 2]) -> (DVec3, f64) {
        let (row, v, row_share) = invert(&self.rows, y);
        let (column, u, column_share) = invert(self.row(row), x);
        let longitude = TAU * (column as f64 + u) / self.width as f64;
        // Uniform in z between the row's bounds, from the nearer pole for the sake of the last bits.
        let half_step = PI / (2 * self.height) as f64;
        let (above, below) = (2.0 * half_step * row as f64, 2.0 * half_step * (row + 1) as f64);
        let (z, r) = if 2 * row < self.height {
            let drop = 2.0 * ((1.0 - v) * (0.5 * above).sin().powi(2) + v * (0.5 * below).sin().powi(2));
            (1.0 - drop, (drop * (2.0 - drop)).sqrt())
        } else {
            let rise = 2.0 * ((1.0 - v) * (0.5 * above).cos().powi(2) + v * (0.5 * below).cos().powi(2));
            (rise - 1.0, (rise * (2.0 - rise)).sqrt())
        };
        let (sine, cosine) = longitude.sin_cos();
        let density = row_share * column_share / self.pixel_solid_angle(row);
        (self.to_world * DVec3::new(r * cosine, r * sine, z), density)
    }

    /// The density per solid angle in the unit direction `w`.
    pub fn density(&self, w: DVec3) -> f64 {
        let local = self.to_world.transpose() * w;
        let polar = local.truncate().length().atan2(local.z);
        let row = ((polar / PI * self.height as f64) as usize).min(self.height - 1);
        let turn = local.y.atan2(local.x) / TAU;
        let turn = if turn < 0.0 { turn + 1.0 } else { turn };
        let column = ((turn * self.width as f64) as usize).min(self.width - 1);
        let columns = self.row(row);
        (self.rows[row + 1] - self.rows[row]) * (columns[column + 1] - columns[column]) / self.pixel_solid_angle(row)
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.columns[row * (self.width + 1)..][..self.width + 1]
    }

    fn pixel_solid_angle(&self, row: usize) -> f64 {
        TAU / self.width as f64 * polar_step(row, self.height)
    }
}

/// cos(pi row / height) - cos(pi (row + 1) / height), without cancellation.
fn polar_step(row: usize, height: usize) -> f64 {
    let half = PI / (2 * height) as f64;
    2.0 * half.sin() * (half * (2 * row + 1) as f64).sin()
}

/// Running sums from 0 to exactly 1; of all-zero weights, equal steps.
fn cumulative(weights: impl ExactSizeIterator<Item = f64> + Clone) -> Vec<f64> {
    let count = weights.len();
    let total: f64 = weights.clone().sum();
    let mut sum = 0.0;
    let mut sums = Vec::with_capacity(count + 1);
    sums.push(0.0);
    for (k, weight) in weights.enumerate() {
        sum += weight;
        sums.push(if total > 0.0 { (sum / total).min(1.0) } else { (k + 1) as f64 / count as f64 });
    }
    sums
}

/// The step of `sums` that holds `x` in (0, 1), how far into the step it lies, and the step's height, which is not zero.
fn invert(sums: &[f64], x: f64) -> (usize, f64, f64) {
    let step = sums.partition_point(|&sum| sum <= x).clamp(1, sums.len() - 1) - 1;
    let height = sums[step + 1] - sums[step];
    (step, ((x - sums[step]) / height).clamp(0.0, 1.0), height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::sobol::Sobol;

    fn distribution(to_world: DMat3) -> PixelDistribution {
        // A dark row, a dark column, a bright pixel.
        let weights: Vec<f64> = (0..15)
            .map(|k| match (k % 5, k / 5) {
                (_, 1) | (4, _) => 0.0,
                (2, 2) => 20.0,
                _ => 1.0,
            })
            .collect();
        PixelDistribution::new(5, 3, &weights, to_world).unwrap()
    }

    #[test]
    fn samples_have_the_density_they_claim() {
        let turn = DMat3::from_rotation_x(0.4)
            * DMat3::from_rotation_z(1.0)
            * DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
        for map in [DMat3::IDENTITY, turn] {
            let distribution = distribution(map);
            let sobol = Sobol::new(1);
            for k in 0..4096 {
                let (w, density) = distribution.sample(sobol.point(k));
                assert!((w.length() - 1.0).abs() < 1e-14);
                assert!(density > 0.0 && (distribution.density(w) / density - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn densities_integrate_to_one_and_samples_integrate_the_sphere() {
        let distribution = distribution(DMat3::IDENTITY);
        let sobol = Sobol::new(2);
        let uniform = |[x, y]: [f64; 2]| {
            let (z, (s, c)) = (2.0 * x - 1.0, (TAU * y).sin_cos());
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * c, r * s, z)
        };
        let mean = |f: &dyn Fn([f64; 2]) -> f64| (0..65536).map(|k| f(sobol.point(k))).sum::<f64>() / 65536.0;
        let total = mean(&|p| 4.0 * PI * distribution.density(uniform(p)));
        assert!((total - 1.0).abs() < 1e-3, "{total}");
        // Solid angle and first moment of the pixels that are not dark, by samples of either kind.
        let lit = |w: DVec3| f64::from(u8::from(distribution.density(w) > 0.0));
        for f in [&|_: DVec3| 1.0, &|w: DVec3| w.z + 2.0 * w.x] as [&dyn Fn(DVec3) -> f64; 2] {
            let expected = mean(&|p| 4.0 * PI * lit(uniform(p)) * f(uniform(p)));
            let value = mean(&|p| {
                let (w, density) = distribution.sample(p);
                f(w) / density
            });
            assert!((value - expected).abs() < 5e-3, "{value} {expected}");
        }
    }

    #[test]
    fn no_light_is_sampled_uniformly() {
        let distribution = PixelDistribution::new(4, 3, &[0.0; 12], DMat3::IDENTITY).unwrap();
        for k in 0..64 {
            let (_, density) = distribution.sample(Sobol::new(0).point(k));
            assert!((density * 4.0 * PI - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn empty_steps_are_never_chosen() {
        let sums = cumulative([0.0, 2.0, 0.0, 2.0, 0.0].into_iter());
        assert_eq!(sums, [0.0, 0.0, 0.5, 0.5, 1.0, 1.0]);
        assert_eq!(invert(&sums, 0.25), (1, 0.5, 0.5));
        assert_eq!(invert(&sums, 0.5), (3, 0.0, 0.5));
        assert_eq!(invert(&sums, 1.0f64.next_down()).0, 3);
    }

    #[test]
    fn bad_weights_are_named() {
        let message = |weights: &[f64]| PixelDistribution::new(2, 1, weights, DMat3::IDENTITY).unwrap_err().to_string();
        assert!(message(&[1.0]).contains("2 x 1"));
        assert!(message(&[1.0, f64::NAN]).contains("(1, 0)"));
        assert!(message(&[-1.0, 1.0]).contains("(0, 0)"));
        assert!(message(&[f64::MAX, f64::MAX]).contains("infinity"));
    }
}
