use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};
use serde::Deserialize;

use super::environment_file;
use crate::{Error, Result};

/// Distant light: a latitude-longitude image of radiance, constant within each pixel.
///
/// # Directions
/// In the image's own frame, as in OpenEXR's latitude-longitude maps: the top row looks up along +y, the middle of the
/// image along +z, a quarter of the width left of it along +x. The point (s, t), s in [0, 1] from left to right and t in
/// [0, 1] from top to bottom, has the longitude phi = pi (1 - 2 s), the latitude theta = pi (1/2 - t), and looks along
///
/// ```text
/// (cos theta sin phi, sin theta, cos theta cos phi).
/// ```
///
/// Pixel (x, y) of a w x h image, (0, 0) at the top left, covers s in [x/w, (x+1)/w) and t in [y/h, (y+1)/h).
///
/// The frame is then placed into the scene by [`Environment::oriented`].
#[derive(Clone, Debug)]
pub struct Environment {
    width: usize,
    height: usize,
    radiance: Arc<[Vec3]>,
    to_scene: DMat3,
}

/// The axis of the scene that an environment's +y becomes; the other axes follow cyclically, so that nothing is mirrored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// +x: the middle of the image looks along +y.
    X,
    /// +y: the middle of the image looks along +z.
    #[default]
    Y,
    /// +z: the middle of the image looks along +x.
    Z,
}

impl Environment {
    /// An environment from its pixels, row by row from the top left, y up and not rotated.
    ///
    /// # Errors
    /// No pixels, a number of pixels that does not fit, radiance that is not finite (the pixel is named).
    ///
    /// Negative radiance is kept as it is: photographs that were filtered or compressed with loss (DWA) ring around bright
    /// spots, and since all that is integrated is linear in the light, cutting the negative lobes off would add light.
    pub fn new(width: usize, height: usize, radiance: impl Into<Arc<[Vec3]>>) -> Result<Self> {
        let radiance = radiance.into();
        if radiance.is_empty() || width.checked_mul(height) != Some(radiance.len()) {
            return Err(Error::input(format!(
                "an image of {width} x {height} does not have {} pixels",
                radiance.len()
            )));
        }
        if let Some(i) = radiance.iter().position(|l| !l.is_finite()) {
            let ([x, y], l) = ([i % width, i / width], radiance[i]);
            return Err(Error::input(format!(
                "radiance of pixel ({x}, {y}) is ({}, {}, {}), not finite",
                l.x, l.y, l.z
            )));
        }
        Ok(Self { width, height, radiance, to_scene: DMat3::IDENTITY })
    }

    /// The same radiance from everywhere.
    ///
    /// # Errors
    /// Radiance that is negative or not finite.
    pub fn constant(radiance: Vec3) -> Result<Self> {
        if radiance.cmplt(Vec3::ZERO).any() {
            return Err(Error::input(format!(
                "a constant environment's radiance is {radiance}; it must not be negative"
            )));
        }
        Self::new(1, 1, vec![radiance])
    }

    /// Reads a latitude-longitude image: OpenEXR (`.exr`, any compression, channels R, G, B or Y) or Radiance (`.hdr`).
    /// Values are taken as linear radiance.
    ///
    /// # Errors
    /// A file that is missing, unreadable, truncated or of another kind; as for [`Self::new`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        environment_file::load(path.as_ref())
    }

    /// Places the image into the scene: its +y becomes `up`, then everything is turned about `up` by `rotation` degrees,
    /// counter-clockwise seen from above. What was set before is replaced.
    ///
    /// # Errors
    /// A rotation that is not finite.
    pub fn oriented(mut self, up: UpAxis, rotation: f64) -> Result<Self> {
        if !rotation.is_finite() {
            return Err(Error::input(format!("the environment's rotation is {rotation}; it must be finite")));
        }
        // Quarter turns come out exact.
        let quarters = rotation.rem_euclid(360.0) / 90.0;
        let (sin, cos) = match quarters {
            q if q.fract() == 0.0 => [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][q as usize % 4],
            q => (q * PI / 2.0).sin_cos(),
        };
        let about_y = DMat3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos));
        let axes = match up {
            UpAxis::X => [DVec3::Z, DVec3::X, DVec3::Y],
            UpAxis::Y => [DVec3::X, DVec3::Y, DVec3::Z],
            UpAxis::Z => [DVec3::Y, DVec3::Z, DVec3::X],
        };
        self.to_scene = DMat3::from_cols(axes[0], axes[1], axes[2]) * about_y;
        Ok(self)
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Radiance of all pixels, row by row from the top left.
    pub fn pixels(&self) -> &[Vec3] {
        &self.radiance
    }

    /// The radiance from everywhere, if it is the same.
    pub fn uniform(&self) -> Option<Vec3> {
        let first = self.radiance[0];
        self.radiance.iter().all(|l| *l == first).then_some(first)
    }

    /// The rotation from the image's frame to the scene's; its columns are where x, y and z of the image point.
    pub fn to_scene(&self) -> DMat3 {
        self.to_scene
    }

    /// The direction in the scene of the point (s, t) of the image.
    pub fn direction(&self, s: f64, t: f64) -> DVec3 {
        let ((sin_phi, cos_phi), (sin_theta, cos_theta)) =
            ((PI * (1.0 - 2.0 * s)).sin_cos(), (PI * (0.5 - t)).sin_cos());
        self.to_scene * DVec3::new(cos_theta * sin_phi, sin_theta, cos_theta * cos_phi)
    }

    /// The direction in the scene of the middle of pixel (x, y).
    pub fn pixel_direction(&self, x: usize, y: usize) -> DVec3 {
        self.direction((x as f64 + 0.5) / self.width as f64, (y as f64 + 0.5) / self.height as f64)
    }

    /// The pixel (x, y) that a direction of the scene, of any length, falls into.
    pub fn pixel(&self, direction: DVec3) -> [usize; 2] {
        let d = self.to_scene.transpose() * direction;
        let s = 0.5 - d.x.atan2(d.z) / TAU;
        let t = 0.5 - d.y.atan2(d.x.hypot(d.z)) / PI;
        // The seam belongs to the first column, the nadir to the last row.
        [(s * self.width as f64) as usize % self.width, ((t * self.height as f64) as usize).min(self.height - 1)]
    }

    /// Radiance from a direction of the scene, of any length.
    pub fn radiance(&self, direction: DVec3) -> Vec3 {
        let [x, y] = self.pixel(direction);
        self.radiance[y * self.width + x]
    }

    /// Solid angle of a pixel in row y, exactly: 2 pi / w (sin of the upper latitude - sin of the lower one).
    pub fn solid_angle(&self, y: usize) -> f64 {
        // The difference of sines as a product, which keeps all digits in fine rows.
        let step = PI / self.height as f64;
        let middle = PI * (0.5 - (y as f64 + 0.5) / self.height as f64);
        TAU / self.width as f64 * 2.0 * (step / 2.0).sin() * middle.cos()
    }

    /// Cuts every pixel into `split` x `split` patches of equal angles. For each of them: the integral of w over it,
    /// exactly (as a direction: where it lies; its solid angle is a little larger than its length), and its radiance.
    pub fn patches(&self, split: usize) -> impl Iterator<Item = (DVec3, Vec3)> {
        let longitudes = self.patch_longitudes(split);
        (0..self.height * split).flat_map(move |row| self.patch_row(split, row, longitudes.clone()))
    }

    /// Sines and cosines of the longitudes between which [patches](Self::patches) lie.
    pub(crate) fn patch_longitudes(&self, split: usize) -> Arc<[(f64, f64)]> {
        let columns = self.width * split;
        (0..=columns).map(|edge| (PI * (1.0 - 2.0 * edge as f64 / columns as f64)).sin_cos()).collect()
    }

    /// One row of the [patches](Self::patches).
    pub(crate) fn patch_row(
        &self,
        split: usize,
        row: usize,
        longitudes: Arc<[(f64, f64)]>,
    ) -> impl Iterator<Item = (DVec3, Vec3)> {
        let (columns, rows) = (self.width * split, self.height * split);
        let [top, bottom] = [row, row + 1].map(|edge| (PI * (0.5 - edge as f64 / rows as f64)).sin_cos());
        // Integrals over the latitudes of cos^2 and of sin cos.
        let squared = 0.5 * (PI / rows as f64 + top.0 * top.1 - bottom.0 * bottom.1);
        let mixed = 0.5 * (top.0 * top.0 - bottom.0 * bottom.0);
        (0..columns).map(move |column| {
            let (left, right) = (longitudes[column], longitudes[column + 1]);
            let moment =
                DVec3::new(squared * (right.1 - left.1), mixed * TAU / columns as f64, squared * (left.0 - right.0));
            (self.to_scene * moment, self.radiance[row / split * self.width + column / split])
        })
    }

    /// Mean radiance over the sphere.
    pub fn mean(&self) -> DVec3 {
        let row = |(y, row): (usize, &[Vec3])| row.iter().map(|l| l.as_dvec3()).sum::<DVec3>() * self.solid_angle(y);
        self.radiance.chunks_exact(self.width).enumerate().map(row).sum::<DVec3>() / (4.0 * PI)
    }

    /// The pixel (x, y) with the largest sum of colours; the first one of several.
    pub fn brightest(&self) -> [usize; 2] {
        let brightness = |i: usize| self.radiance[i].element_sum();
        let best = (1..self.radiance.len()).fold(0, |best, i| if brightness(i) > brightness(best) { i } else { best });
        [best % self.width, best / self.width]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blank(width: usize, height: usize) -> Environment {
        Environment::new(width, height, vec![Vec3::ONE; width * height]).unwrap()
    }

    #[test]
    fn documented_directions() {
        let image = blank(8, 4);
        for (s, t, expected) in [
            (0.5, 0.5, DVec3::Z),
            (0.25, 0.5, DVec3::X),
            (0.75, 0.5, DVec3::NEG_X),
            (0.0, 0.5, DVec3::NEG_Z),
            (0.3, 0.0, DVec3::Y),
            (0.3, 1.0, DVec3::NEG_Y),
        ] {
            assert!(image.direction(s, t).distance(expected) < 1e-15, "{s} {t}");
        }
        // Straight up, straight down and the seam fall into a pixel too.
        assert_eq!(image.pixel(DVec3::Y)[1], 0);
        assert_eq!(image.pixel(DVec3::NEG_Y)[1], 3);
        assert_eq!(image.pixel(DVec3::NEG_Z), [0, 2]);
        assert_eq!(image.pixel(DVec3::new(-0.0, 0.0, -1.0)), [0, 2]);
    }

    #[test]
    fn up_axis_and_rotation_turn_without_mirroring() {
        let oriented = |up, rotation| blank(8, 4).oriented(up, rotation).unwrap();
        for (up, top, middle) in
            [(UpAxis::X, DVec3::X, DVec3::Y), (UpAxis::Y, DVec3::Y, DVec3::Z), (UpAxis::Z, DVec3::Z, DVec3::X)]
        {
            let image = oriented(up, 0.0);
            assert_eq!(image.to_scene() * DVec3::Y, top);
            assert_eq!(image.to_scene() * DVec3::Z, middle);
            assert_eq!(image.to_scene().determinant(), 1.0);
            // A quarter turn counter-clockwise seen from above carries forward to up x forward.
            assert_eq!(oriented(up, 90.0).to_scene() * DVec3::Z, top.cross(middle));
            assert_eq!(oriented(up, -270.0).to_scene(), oriented(up, 90.0).to_scene());
            let turned = oriented(up, 30.0);
            assert!((turned.to_scene() * DVec3::Z).distance(middle * 0.75f64.sqrt() + top.cross(middle) * 0.5) < 1e-15);
        }
        assert!(blank(1, 1).oriented(UpAxis::Y, f64::NAN).is_err());
    }

    #[test]
    fn every_pixel_finds_itself() {
        for (up, rotation) in [(UpAxis::Y, 0.0), (UpAxis::Z, 33.0), (UpAxis::X, -720.5)] {
            let image = blank(37, 19).oriented(up, rotation).unwrap();
            for (x, y) in (0..19).flat_map(|y| (0..37).map(move |x| (x, y))) {
                let direction = image.pixel_direction(x, y);
                assert!((direction.length() - 1.0).abs() < 1e-15);
                assert_eq!(image.pixel(3.0 * direction), [x, y]);
                // So do points close to its corners.
                for (dx, dy) in [(1e-9, 1e-9), (1.0 - 1e-9, 1e-9), (1e-9, 1.0 - 1e-9), (1.0 - 1e-9, 1.0 - 1e-9)] {
                    let corner = image.direction((x as f64 + dx) / 37.0, (y as f64 + dy) / 19.0);
                    assert_eq!(image.pixel(corner), [x, y]);
                }
            }
        }
    }

    #[test]
    fn solid_angles_are_exact_and_add_up_to_the_sphere() {
        for (width, height) in [(1, 1), (2, 1), (37, 19), (4096, 2048)] {
            let image = blank(width, height);
            let sum: f64 = (0..height).map(|y| width as f64 * image.solid_angle(y)).sum();
            assert!((sum - 4.0 * PI).abs() < 1e-12, "{width} x {height}: {sum}");
        }
        // The upper half of a 2 x 4 image's quarter sphere: 2 pi / 2 (1 - sin 45 degrees).
        assert!((blank(2, 4).solid_angle(0) - PI * (1.0 - 0.5f64.sqrt())).abs() < 1e-15);
    }

    #[test]
    fn statistics() {
        let mut pixels = vec![Vec3::ZERO; 8];
        pixels[6] = Vec3::new(4.0, 2.0, -1.0);
        let image = Environment::new(4, 2, pixels).unwrap();
        // One of the four pixels of the lower half: an eighth of the sphere.
        assert!(image.mean().distance(DVec3::new(0.5, 0.25, -0.125)) < 1e-15);
        assert_eq!(image.brightest(), [2, 1]);
        assert_eq!(image.radiance(image.pixel_direction(2, 1)), Vec3::new(4.0, 2.0, -1.0));
        assert_eq!(image.uniform(), None);
        assert_eq!(Environment::constant(Vec3::ONE).unwrap().uniform(), Some(Vec3::ONE));
    }

    #[test]
    fn patches_add_up_to_the_vector_irradiance_of_their_pixels() {
        let pixels: Vec<Vec3> = (0..12).map(|i| Vec3::new(1.0, i as f32, (i * i) as f32)).collect();
        let image = Environment::new(4, 3, pixels).unwrap().oriented(UpAxis::Z, 33.0).unwrap();
        let total = |split| image.patches(split).map(|(w, l)| w * f64::from(l.y)).sum::<DVec3>();
        // One whole row: no moment but along its axis, 2 pi times the integral of sin cos over its latitudes.
        let top: DVec3 = image.patches(1).take(4).map(|(w, _)| w).sum();
        assert!(top.distance(image.to_scene() * DVec3::Y * (PI * 0.75)) < 1e-14);
        assert!(total(1).distance(total(7)) < 1e-13);
        let (w, l) = image.patches(8).nth(8 * 4 * 10 + 19).unwrap();
        assert_eq!(image.radiance(w), l);
        // In the row on the equator, where a patch of 11 by 7.5 degrees is as wide as it is high.
        let middle = image.solid_angle(1) * (PI / 48.0).cos() / 64.0;
        assert!((w.length() / middle - 1.0).abs() < 0.15);
    }

    #[test]
    fn bad_pixels_are_named() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut pixels = vec![Vec3::ONE; 6];
            pixels[4].z = bad;
            let message = Environment::new(3, 2, pixels).unwrap_err().to_string();
            assert!(message.contains("pixel (1, 1)") && message.contains(&bad.to_string()), "{message}");
        }
        assert!(Environment::new(3, 2, vec![Vec3::ONE; 5]).is_err());
        assert!(Environment::new(0, 0, vec![]).is_err());
        assert!(Environment::new(1, 1, vec![Vec3::splat(-1e-3)]).is_ok());
        assert!(Environment::constant(Vec3::NEG_ONE).is_err());
        assert!(Environment::constant(Vec3::NAN).is_err());
    }
}
