use glam::DVec3;
use serde::Deserialize;

use super::super::Mesh;
use super::check;
use super::grid::{append_grid, mix};
use crate::Result;

/// An axis-aligned box centred at the origin.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Cuboid {
    /// Lengths along x, y and z. Default 1 each.
    pub size: [f64; 3],
    /// Cells along every side; two triangles to a cell. Default 1.
    pub divisions: u32,
}

impl Default for Cuboid {
    fn default() -> Self {
        Self { size: [1.0; 3], divisions: 1 }
    }
}

impl Cuboid {
    /// The box's triangles.
    ///
    /// # Errors
    /// Sizes that are not positive, no cells, too many cells.
    pub fn mesh(&self) -> Result<Mesh> {
        check("box", &self.size, 12.0 * f64::from(self.divisions).powi(2))?;
        let mut mesh = Mesh { name: "box".into(), ..Mesh::default() };
        let half = DVec3::from_array(self.size) / 2.0;
        for face in Face::ALL {
            append_grid(&mut mesh, [self.divisions; 2], |u, v| face.point(-half, half, u, v), |_, _| true);
        }
        Ok(mesh)
    }
}

/// A face of an axis-aligned box: its outward axis and the side it lies on.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Face {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Whether the face lies at the upper end of its axis.
    pub is_upper: bool,
}

impl Face {
    /// All six.
    pub(super) const ALL: [Self; 6] = {
        let mut all = [Self { axis: 0, is_upper: false }; 6];
        let mut i = 0;
        while i < 6 {
            all[i] = Self { axis: i / 2, is_upper: i % 2 == 1 };
            i += 1;
        }
        all
    };

    /// A point of the face, wound to face outwards; equal bits on the edges that faces share.
    pub(super) fn point(self, low: DVec3, high: DVec3, u: f64, v: f64) -> DVec3 {
        let [next, last] = [(self.axis + 1) % 3, (self.axis + 2) % 3];
        let (s, t) = if self.is_upper { (u, v) } else { (v, u) };
        let mut point = DVec3::ZERO;
        point[self.axis] = if self.is_upper { high[self.axis] } else { low[self.axis] };
        point[next] = mix(low[next], high[next], s);
        point[last] = mix(low[last], high[last], t);
        point
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{area, euler_characteristic, geometry, is_closed, volume};
    use super::*;

    #[test]
    fn area_volume_and_topology() {
        for divisions in [1, 3] {
            let cuboid = geometry(Cuboid { size: [0.1, 2.0, 3.0], divisions }.mesh());
            assert_eq!(cuboid.triangles.len(), 12 * divisions.pow(2) as usize);
            assert!(is_closed(&cuboid));
            assert_eq!(euler_characteristic(&cuboid), 2);
            assert!((area(&cuboid) - 2.0 * (0.2 + 0.3 + 6.0)).abs() < 1e-6);
            assert!((volume(&cuboid) - 0.6).abs() < 1e-6);
        }
    }
}
