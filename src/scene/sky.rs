use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use serde::Deserialize;

use super::Environment;
use crate::{Error, Result};

/// A clear sky with a soft sun for previews, in the image's frame of an [`Environment`] (y up).
///
/// The sky's luminance and chromaticity are those of Preetham, Shirley and Smits (1999), table 2 and appendix A.2, as
/// linear Rec. 709. The sun is a lobe `exp(k (cos - 1))` of 3 degrees instead of a disc, so that few pixels carry it, and
/// gives two thirds of the light that falls on the ground. The ground below is a grey of reflectance 0.2. Everything is
/// scaled so that an unoccluded horizontal surface receives an irradiance of pi in the mean of its colours: a white one
/// then has radiance 1.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sky {
    /// Height of the sun over the horizon in degrees, in (0, 90]. Default 40.
    pub elevation: f64,
    /// Longitude of the sun in degrees: 0 is the middle of the image, counter-clockwise seen from above. Default 40.
    pub azimuth: f64,
    /// Haziness, from 2 (clear) to 10 (hazy). Default 3.
    pub turbidity: f64,
    /// Rows of the image; it has twice as many columns. Default 128.
    pub height: usize,
}

impl Default for Sky {
    fn default() -> Self {
        Self { elevation: 40.0, azimuth: 40.0, turbidity: 3.0, height: 128 }
    }
}

/// Width of the sun's lobe.
const SUN_RADIUS: f64 = 3.0 * PI / 180.0;
/// Share of the sun in the irradiance of the ground.
const SUN_SHARE: f64 = 2.0 / 3.0;
const GROUND_REFLECTANCE: f64 = 0.2;

impl Sky {
    /// Direction towards the sun in the image's frame.
    pub fn sun(&self) -> DVec3 {
        let ((sin_phi, cos_phi), (sin, cos)) =
            (self.azimuth.to_radians().sin_cos(), self.elevation.to_radians().sin_cos());
        DVec3::new(cos * sin_phi, sin, cos * cos_phi)
    }

    /// The sky as an environment, y up and not rotated.
    ///
    /// # Errors
    /// Parameters out of their domain.
    pub fn environment(&self) -> Result<Environment> {
        if !(self.elevation > 0.0 && self.elevation <= 90.0 && self.azimuth.is_finite()) {
            return Err(Error::input("sky: the sun's elevation must be in (0, 90] degrees and its azimuth finite"));
        }
        if !(2.0..=10.0).contains(&self.turbidity) || !(8..=4096).contains(&self.height) {
            return Err(Error::input("sky: turbidity must be in [2, 10] and height in [8, 4096]"));
        }
        let (width, height) = (2 * self.height, self.height);
        let frame = Environment::new(width, height, vec![Vec3::ZERO; width * height])?;
        let sun = self.sun();
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let directions: Vec<DVec3> = pixels.map(|(x, y)| frame.pixel_direction(x, y)).collect();
        let irradiance = |radiance: &dyn Fn(DVec3) -> DVec3| -> DVec3 {
            let above = directions.iter().enumerate().filter(|(_, d)| d.y > 0.0);
            above.map(|(i, &d)| radiance(d) * d.y * frame.solid_angle(i / width)).sum()
        };
        let sky = |d: DVec3| self.clear_sky(d, sun);
        // Sunlight is white beside the sky's blue; both are brought to their share.
        let lobe = |d: DVec3| DVec3::splat(((d.dot(sun) - 1.0) * 2.0 / SUN_RADIUS.powi(2)).exp());
        let mean = |e: DVec3| e.element_sum() / 3.0;
        let sky_scale = PI * (1.0 - SUN_SHARE) / mean(irradiance(&sky));
        let sun_scale = PI * SUN_SHARE / mean(irradiance(&lobe));
        let light = |d: DVec3| sky(d) * sky_scale + lobe(d) * sun_scale;
        let ground = irradiance(&light) * GROUND_REFLECTANCE / PI;
        let radiance = |d: &DVec3| if d.y > 0.0 { light(*d) } else { ground }.as_vec3();
        Environment::new(width, height, directions.iter().map(radiance).collect::<Vec<_>>())
    }

    /// Radiance of the sky without its sun, up to a factor: Perez' formula for luminance and chromaticity.
    fn clear_sky(&self, direction: DVec3, sun: DVec3) -> DVec3 {
        let t = self.turbidity;
        let zenith_angle = sun.y.clamp(-1.0, 1.0).acos();
        let powers = [zenith_angle.powi(3), zenith_angle.powi(2), zenith_angle, 1.0];
        let zenith_chroma = |m: [[f64; 4]; 3]| -> f64 {
            let rows = m.map(|row| row.iter().zip(powers).map(|(a, b)| a * b).sum::<f64>());
            t * t * rows[0] + t * rows[1] + rows[2]
        };
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * zenith_angle);
        let zenith_luminance = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
        let zenith_x = zenith_chroma([
            [0.00166, -0.00375, 0.00209, 0.0],
            [-0.02903, 0.06377, -0.03202, 0.00394],
            [0.11693, -0.21196, 0.06052, 0.25886],
        ]);
        let zenith_y = zenith_chroma([
            [0.00275, -0.00610, 0.00317, 0.0],
            [-0.04214, 0.08970, -0.04153, 0.00516],
            [0.15346, -0.26756, 0.06670, 0.26688],
        ]);
        // The horizon itself is a pole of the formula.
        let cos_theta = direction.y.max(0.01);
        let cos_gamma = direction.dot(sun).clamp(-1.0, 1.0);
        let perez = |[a, b, c, d, e]: [f64; 5], cos_theta: f64, gamma: f64| {
            (1.0 + a * (b / cos_theta).exp()) * (1.0 + c * (d * gamma).exp() + e * gamma.cos().powi(2))
        };
        let relative = |slope: [f64; 5], offset: [f64; 5]| {
            let coefficients = std::array::from_fn(|i| slope[i] * t + offset[i]);
            perez(coefficients, cos_theta, cos_gamma.acos()) / perez(coefficients, 1.0, zenith_angle)
        };
        let luminance = zenith_luminance
            * relative([0.1787, -0.3554, -0.0227, 0.1206, -0.0670], [-1.4630, 0.4275, 5.3251, -2.5771, 0.3703]);
        let x = zenith_x
            * relative([-0.0193, -0.0665, -0.0004, -0.0641, -0.0033], [-0.2592, 0.0008, 0.2125, -0.8989, 0.0452]);
        let y = zenith_y
            * relative([-0.0167, -0.0950, -0.0079, -0.0441, -0.0109], [-0.2608, 0.0092, 0.2102, -1.6537, 0.0529]);
        let xyz = DVec3::new(x / y, 1.0, (1.0 - x - y) / y) * luminance.max(0.0);
        // XYZ to linear Rec. 709 (IEC 61966-2-1).
        DVec3::new(
            DVec3::new(3.2406, -1.5372, -0.4986).dot(xyz),
            DVec3::new(-0.9689, 1.8758, 0.0415).dot(xyz),
            DVec3::new(0.0557, -0.2040, 1.0570).dot(xyz),
        )
        .max(DVec3::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ground_receives_pi_and_reflects_its_share() {
        for (elevation, turbidity) in [(90.0, 2.0), (40.0, 3.0), (10.0, 8.0)] {
            let sky = Sky { elevation, turbidity, ..Sky::default() };
            let image = sky.environment().unwrap();
            let mut irradiance = DVec3::ZERO;
            for (i, l) in image.pixels().iter().enumerate() {
                let d = image.pixel_direction(i % image.width(), i / image.width());
                irradiance += l.as_dvec3() * d.y.max(0.0) * image.solid_angle(i / image.width());
            }
            assert!((irradiance.element_sum() / 3.0 - PI).abs() < 1e-5, "{irradiance}");
            let below = image.radiance(DVec3::new(0.3, -1.0, 0.2)).as_dvec3();
            assert!(below.distance(irradiance * 0.2 / PI) < 1e-5);
        }
    }

    #[test]
    fn sun_is_where_it_was_put_and_the_sky_is_blue() {
        let sky = Sky { elevation: 30.0, azimuth: -70.0, ..Sky::default() };
        let image = sky.environment().unwrap();
        let [x, y] = image.brightest();
        assert!(image.pixel_direction(x, y).angle_between(sky.sun()).to_degrees() < 1.5);
        let opposite = image.radiance(DVec3::new(-sky.sun().x, 1.0, -sky.sun().z));
        assert!(opposite.z > 1.5 * opposite.x, "{opposite}");
    }

    #[test]
    fn bad_parameters_are_refused() {
        for sky in [
            Sky { elevation: 0.0, ..Sky::default() },
            Sky { elevation: f64::NAN, ..Sky::default() },
            Sky { azimuth: f64::INFINITY, ..Sky::default() },
            Sky { turbidity: 1.0, ..Sky::default() },
            Sky { height: 0, ..Sky::default() },
        ] {
            assert!(sky.environment().unwrap_err().to_string().starts_with("sky: "));
        }
    }
}
