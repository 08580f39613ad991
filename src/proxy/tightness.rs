use std::f64::consts::PI;
use std::fmt;

use super::cover::Ball;
use super::solid::Solid;
use super::{Sphere, enclosed_volume, outside_volume};
use crate::scene::Geometry;

/// How closely spheres follow a mesh: the volumes that they have outside it; displays as a table.
///
/// Where the mesh is closed, wound outwards and free of overlaps, the spheres' volumes are exact, by [`outside_volume`].
/// Otherwise inside is what cannot be reached from outside between the points of a grid, 192 to the longest side, without
/// passing a face: the volumes are then as good as that grid. So is that of the union, always.
#[derive(Clone, Debug)]
pub struct Tightness {
    /// Volume of the mesh.
    pub volume: f64,
    /// Volume of every sphere.
    pub sphere_volumes: Vec<f64>,
    /// Volume of every sphere's part outside the mesh.
    pub outside: Vec<f64>,
    /// Volume of the part of the spheres' union outside the mesh.
    pub union_outside: f64,
    /// Whether volume and outside volumes are exact.
    pub is_exact: bool,
}

impl Tightness {
    /// Measures spheres in the world against a mesh.
    pub fn new(geometry: &Geometry, spheres: &[Sphere]) -> Self {
        Self::of_solid(geometry, &Solid::new(geometry), spheres)
    }

    pub(super) fn of_solid(geometry: &Geometry, solid: &Solid, spheres: &[Sphere]) -> Self {
        let balls: Vec<Ball> = spheres.iter().map(Ball::from).collect();
        let is_exact = solid.is_clean();
        let outside = |ball: &Ball| match is_exact {
            true => outside_volume(geometry, ball.center, ball.radius).max(0.0),
            false => solid.outside_volume(ball.center, ball.radius),
        };
        Self {
            volume: if is_exact { enclosed_volume(geometry) } else { solid.volume() },
            sphere_volumes: balls.iter().map(|ball| 4.0 / 3.0 * PI * ball.radius.powi(3)).collect(),
            outside: balls.iter().map(outside).collect(),
            union_outside: solid.union_outside_volume(&balls),
            is_exact,
        }
    }

    /// Sum of the spheres' volumes outside the mesh.
    pub fn total_outside(&self) -> f64 {
        self.outside.iter().sum()
    }
}

impl fmt::Display for Tightness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let relative = |volume: f64| match self.volume > 0.0 {
            true => format!("{volume:.6e}, {:.2} % of the mesh", 100.0 * volume / self.volume),
            false => format!("{volume:.6e}"),
        };
        let method = if self.is_exact { "exact" } else { "filled: not closed, or not free of overlaps" };
        writeln!(f, "{:<24}{:.6e} ({method})", "volume of the mesh", self.volume)?;
        writeln!(f, "{:<24}{}", "spheres", self.outside.len())?;
        writeln!(f, "{:<24}{}", "outside, sum", relative(self.total_outside()))?;
        writeln!(f, "{:<24}{}", "outside, union", relative(self.union_outside))?;
        write!(f, "{:>6} {:>12} {:>12} {:>8}", "sphere", "volume", "outside", "share")?;
        for (i, (volume, outside)) in self.sphere_volumes.iter().zip(&self.outside).enumerate() {
            write!(f, "\n{i:>6} {volume:>12.4e} {outside:>12.4e} {:>6.1} %", 100.0 * outside / volume)?;
        }
        Ok(())
    }
}
