use glam::DVec3;

use crate::{Error, Result};

/// A pinhole camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    position: DVec3,
    resolution: [u32; 2],
    /// From the pinhole to the top left corner of the image plane, and along its rows and columns from pixel to pixel.
    corner: DVec3,
    right: DVec3,
    down: DVec3,
}

impl Camera {
    /// A camera at `position` that looks at the point `look_at` and holds `up` upwards in the image, with a vertical
    /// field of view of `fov` degrees and `resolution` pixels across and down.
    ///
    /// # Errors
    /// Values that are not finite, nothing to look at, `up` along the view, a field of view outside (0, 180), no pixels.
    pub fn new(position: DVec3, look_at: DVec3, up: DVec3, fov: f64, resolution: [u32; 2]) -> Result<Self> {
        if !(position.is_finite() && look_at.is_finite() && up.is_finite()) {
            return Err(Error::input("camera: position, look_at and up must be finite"));
        }
        let forward = (look_at - position)
            .try_normalize()
            .ok_or_else(|| Error::input("camera: look_at is where the camera stands"))?;
        // A millionth of a radian between view and up leaves half the digits of the sideways direction.
        let sideways = forward.cross(up.normalize_or_zero());
        if sideways.length() < 1e-6 {
            return Err(Error::input("camera: up must not be zero or point along the view"));
        }
        if !(fov > 0.0 && fov < 180.0) {
            return Err(Error::input(format!("camera: fov must be in (0, 180) degrees, not {fov}")));
        }
        let [width, height] = resolution;
        if width == 0 || height == 0 || width.checked_mul(height).is_none() {
            return Err(Error::input(format!("camera: a resolution of {width} x {height} is not possible")));
        }
        let right = sideways.normalize();
        let down = forward.cross(right);
        let pixel = 2.0 * (fov.to_radians() / 2.0).tan() / f64::from(height);
        let (right, down) = (right * pixel, down * pixel);
        let corner = forward - right * f64::from(width) / 2.0 - down * f64::from(height) / 2.0;
        Ok(Self { position, resolution, corner, right, down })
    }

    /// The pinhole.
    pub fn position(&self) -> DVec3 {
        self.position
    }

    /// Pixels across and down.
    pub fn resolution(&self) -> [u32; 2] {
        self.resolution
    }

    /// The same camera with other pixels; what is seen from top to bottom stays the same.
    ///
    /// # Errors
    /// No pixels, or more than 32 bits count.
    pub fn with_resolution(&self, resolution: [u32; 2]) -> Result<Self> {
        let [width, height] = self.resolution.map(f64::from);
        let forward = self.corner + self.right * width / 2.0 + self.down * height / 2.0;
        let fov = 2.0 * (self.down.length() * height / 2.0).atan().to_degrees();
        Self::new(self.position, self.position + forward, -self.down, fov, resolution)
    }

    /// Unit direction in which the camera looks.
    pub fn forward(&self) -> DVec3 {
        self.right.cross(self.down).normalize()
    }

    /// The ray through the point (x, y) of the image, in pixels from its top left corner, as long as one unit along the view:
    /// the point at depth z lies at `position() + z * ray(x, y)`.
    pub fn ray(&self, x: f64, y: f64) -> DVec3 {
        self.corner + self.right * x + self.down * y
    }

    /// Where a point appears: (x, y) in pixels from the image's top left corner, and its depth, the distance along the view.
    /// Points with no positive depth lie behind the camera, and their x and y mean nothing.
    pub fn project(&self, point: DVec3) -> DVec3 {
        let d = point - self.position;
        let depth = d.dot(self.forward());
        let [width, height] = self.resolution.map(f64::from);
        let along = |axis: DVec3| d.dot(axis) / (depth * axis.length_squared());
        DVec3::new(along(self.right) + 0.5 * width, along(self.down) + 0.5 * height, depth)
    }

    /// Unit direction of the primary ray through the point (x, y) of the image, in pixels from its top left corner.
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        (self.corner + self.right * x + self.down * y).normalize()
    }

    /// Unit direction of the primary ray through the middle of pixel (x, y), (0, 0) at the top left.
    pub fn pixel_direction(&self, x: u32, y: u32) -> DVec3 {
        self.direction(f64::from(x) + 0.5, f64::from(y) + 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(resolution: [u32; 2]) -> Result<Camera> {
        Camera::new(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 90.0, resolution)
    }

    #[test]
    fn rays_go_where_the_image_shows() {
        let camera = camera([4, 2]).unwrap();
        assert!(camera.direction(2.0, 1.0).distance(DVec3::NEG_Z) < 1e-15);
        assert!(camera.direction(2.0, 0.0).distance(DVec3::new(0.0, 1.0, -1.0).normalize()) < 1e-15);
        assert!(camera.direction(4.0, 1.0).distance(DVec3::new(2.0, 0.0, -1.0).normalize()) < 1e-15);
        assert!(camera.pixel_direction(0, 0).distance(DVec3::new(-1.5, 0.5, -1.0).normalize()) < 1e-15);
    }

    #[test]
    fn points_appear_where_their_rays_go() {
        let tilted =
            Camera::new(DVec3::ONE, DVec3::new(3.0, -1.0, 0.5), DVec3::new(0.1, 0.9, 0.3), 35.0, [30, 20]).unwrap();
        for (x, y, depth) in [(0.0, 0.0, 1.0), (7.3, 19.0, 0.01), (40.0, -5.0, 100.0)] {
            let ray = tilted.ray(x, y);
            assert!((ray.dot(tilted.forward()) - 1.0).abs() < 1e-14);
            assert!(ray.normalize().distance(tilted.direction(x, y)) < 1e-14);
            let seen = tilted.project(tilted.position() + depth * ray);
            assert!(seen.distance(DVec3::new(x, y, depth)) < 1e-10, "{seen}");
        }
    }

    #[test]
    fn resolution_does_not_change_what_is_seen() {
        let tilted =
            Camera::new(DVec3::ONE, DVec3::new(3.0, -1.0, 0.5), DVec3::new(0.1, 0.9, 0.3), 35.0, [30, 20]).unwrap();
        let finer = tilted.with_resolution([60, 40]).unwrap();
        for (x, y) in [(0.0, 0.0), (30.0, 20.0), (7.0, 13.0)] {
            assert!(tilted.direction(x, y).distance(finer.direction(2.0 * x, 2.0 * y)) < 1e-14);
        }
    }

    #[test]
    fn impossible_cameras_are_refused() {
        let make = |position: DVec3, up, fov| Camera::new(position, DVec3::ZERO, up, fov, [2, 2]);
        for (camera, why) in [
            (make(DVec3::ZERO, DVec3::Y, 45.0), "where the camera stands"),
            (make(DVec3::NAN, DVec3::Y, 45.0), "finite"),
            (make(DVec3::Y, DVec3::Y, 45.0), "along the view"),
            (make(DVec3::Z, DVec3::ZERO, 45.0), "zero"),
            (make(DVec3::Z, DVec3::Y, 0.0), "fov"),
            (make(DVec3::Z, DVec3::Y, 180.0), "fov"),
            (make(DVec3::Z, DVec3::Y, f64::NAN), "fov"),
            (camera([0, 2]), "0 x 2"),
            (camera([u32::MAX, 2]), "not possible"),
        ] {
            let message = camera.unwrap_err().to_string();
            assert!(message.starts_with("camera: ") && message.contains(why), "{message}");
        }
    }
}
