use serde::Deserialize;

use crate::{Error, Result};

/// A figure of rounded limbs that walks in circles, its trunk, head and arms swinging along.
///
/// Its surface is that of balls whose radius and centre change evenly along each limb (a rounded cone); its proxies are some of
/// these balls, so that more of them come as close to it as one likes, from within.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Walker {
    /// Middle of the circle, on the ground; y is up.
    pub center: [f64; 3],
    /// Radius of the circle. Default 2.
    pub circle: f64,
    /// Height of the figure. Default 1.8.
    pub height: f64,
    /// Steps (of one leg) per second. Default 1.6.
    pub pace: f64,
    /// Where on the circle it starts, in degrees.
    pub start: f64,
    /// Number of spheres. Default 50.
    pub spheres: usize,
    /// Diffuse reflectance.
    pub albedo: [f32; 3],
}

impl Default for Walker {
    fn default() -> Self {
        Self {
            center: [0.0; 3],
            circle: 2.0,
            height: 1.8,
            pace: 1.6,
            start: 0.0,
            spheres: 50,
            albedo: [0.7, 0.45, 0.3],
        }
    }
}

impl Walker {
    /// Trunk, neck with head, and two parts of each arm and leg: the fewest spheres that can stand for it.
    pub const LIMBS: usize = 10;
    /// The most spheres.
    pub const MAX_SPHERES: usize = 1 << 16;

    /// Fails where a value is out of its domain.
    ///
    /// # Errors
    /// One line that names the value.
    pub fn check(&self) -> Result<()> {
        let lengths = [self.circle, self.height, self.pace];
        if !lengths.iter().all(|x| x.is_finite() && *x > 0.0) {
            return Err(Error::input("walker: circle, height and pace must be positive and finite"));
        }
        if !(self.start.is_finite() && self.center.iter().all(|x| x.is_finite())) {
            return Err(Error::input("walker: center and start must be finite"));
        }
        if !(Self::LIMBS..=Self::MAX_SPHERES).contains(&self.spheres) {
            let (least, most) = (Self::LIMBS, Self::MAX_SPHERES);
            return Err(Error::input(format!("walker: {} spheres; it needs {least} to {most}", self.spheres)));
        }
        if !self.albedo.iter().all(|x| (0.0..=1.0).contains(x)) {
            return Err(Error::input("walker: albedo must lie in [0, 1]"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_walkers_are_refused() {
        assert!(Walker::default().check().is_ok());
        for bad in [
            Walker { spheres: 3, ..Walker::default() },
            Walker { spheres: 1 << 17, ..Walker::default() },
            Walker { height: -1.0, ..Walker::default() },
            Walker { start: f64::NAN, ..Walker::default() },
            Walker { albedo: [2.0, 0.0, 0.0], ..Walker::default() },
        ] {
            assert!(bad.check().unwrap_err().to_string().starts_with("walker: "));
        }
    }
}
