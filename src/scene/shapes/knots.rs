use glam::{DAffine3, DQuat, DVec3};
use serde::Deserialize;

use super::super::Mesh;
use super::random::Random;
use super::{TorusKnot, check};
use crate::{Error, Result};

/// A field of trefoil torus knots on the plane y = 0, each turned at random: many bodies that hide one another.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Knots {
    /// Knots along z. Default 10.
    pub rows: u32,
    /// Knots along x. Default 10.
    pub columns: u32,
    /// About how many triangles to make in all, at least 30 a knot. Default 100,000.
    pub triangles: usize,
    /// Distance from knot to knot, which have a radius of 1.6. Default 3.2.
    pub spacing: f64,
    /// Another seed turns the knots otherwise. Default 1.
    pub seed: u64,
}

impl Default for Knots {
    fn default() -> Self {
        Self { rows: 10, columns: 10, triangles: 100_000, spacing: 3.2, seed: 1 }
    }
}

impl Knots {
    /// The field's triangles; it is centred at the origin and stands 0.1 above the plane y = 0.
    ///
    /// # Errors
    /// No knots, too few or too many triangles.
    pub fn mesh(&self) -> Result<Mesh> {
        let count = f64::from(self.rows) * f64::from(self.columns);
        if count == 0.0 {
            return Err(Error::input("knots: needs at least one row and one column"));
        }
        check("knots", &[self.spacing], self.triangles as f64)?;
        let shape = TorusKnot { triangles: (self.triangles as f64 / count) as usize, ..TorusKnot::default() };
        let knot = shape.mesh()?;
        let radius = shape.radius + shape.spread + shape.tube;
        let mut random = Random::new(self.seed);
        let mut mesh = Mesh { name: "knots".into(), ..Mesh::default() };
        for row in 0..self.rows {
            for column in 0..self.columns {
                let middle = |i: u32, n: u32| self.spacing * (f64::from(i) - 0.5 * f64::from(n - 1));
                let place = DVec3::new(middle(column, self.columns), radius + 0.1, middle(row, self.rows));
                let axis = random.in_ball().normalize_or(DVec3::Y);
                let turn = DQuat::from_axis_angle(axis, random.between(0.0, std::f64::consts::TAU));
                mesh.append(&knot.clone().transformed(DAffine3::from_rotation_translation(turn, place)));
            }
        }
        Ok(mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{euler_characteristic, geometry, is_closed};
    use super::*;

    #[test]
    fn sizes_of_the_benchmark_scenes() {
        for (triangles, made) in [(25_000, 25_000), (100_000, 100_000)] {
            let field = geometry(Knots { triangles, ..Knots::default() }.mesh());
            assert_eq!(field.triangles.len(), made);
            assert_eq!((field.topology().bodies(), euler_characteristic(&field)), (100, 0));
            assert!(is_closed(&field));
            let [low, high] = field.bounds().unwrap();
            assert!(low.y > 0.0 && high.y < 3.4 && low.x > -16.1 && high.x < 16.1);
        }
    }
}
