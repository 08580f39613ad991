use glam::DVec3;
use serde::Deserialize;

use super::super::Mesh;
use super::check;
use super::grid::append_grid;
use crate::Result;

/// A rectangle in the plane y = 0, centred at the origin, facing up.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Plane {
    /// Lengths of the sides along x and z. Default 10 each.
    pub size: [f64; 2],
    /// Cells along x and z; two triangles to a cell. Default 1 each.
    pub divisions: [u32; 2],
}

impl Default for Plane {
    fn default() -> Self {
        Self { size: [10.0; 2], divisions: [1; 2] }
    }
}

impl Plane {
    /// The rectangle's triangles.
    ///
    /// # Errors
    /// Sizes that are not positive, no cells, too many cells.
    pub fn mesh(&self) -> Result<Mesh> {
        let [x, z] = self.size;
        check("plane", &self.size, 2.0 * f64::from(self.divisions[0]) * f64::from(self.divisions[1]))?;
        let mut mesh = Mesh { name: "plane".into(), ..Mesh::default() };
        let point = |u: f64, v: f64| DVec3::new(x * (u - 0.5), 0.0, z * (0.5 - v));
        append_grid(&mut mesh, self.divisions, point, |_, _| true);
        Ok(mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{area, geometry};
    use super::*;

    #[test]
    fn area_and_side() {
        let plane = geometry(Plane { size: [3.0, 2.0], divisions: [5, 7] }.mesh());
        assert_eq!(plane.triangles.len(), 70);
        assert!((area(&plane) - 6.0).abs() < 1e-6);
        assert!(plane.angle_weighted_normals().iter().all(|n| *n == Some(DVec3::Y)));
    }
}
