use std::collections::HashMap;

use glam::DVec3;
use serde::Deserialize;

use super::super::Mesh;
use super::check;
use crate::Result;

/// A sphere centred at the origin: an icosahedron whose triangles are cut in four, again and again, with every vertex on
/// the sphere.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Icosphere {
    /// Default 1.
    pub radius: f64,
    /// How often the triangles are cut in four: 20 x 4^n triangles. Default 4 (5120 triangles).
    pub subdivisions: u32,
}

impl Default for Icosphere {
    fn default() -> Self {
        Self { radius: 1.0, subdivisions: 4 }
    }
}

impl Icosphere {
    /// The sphere's triangles.
    ///
    /// # Errors
    /// A radius that is not positive, too many subdivisions.
    pub fn mesh(&self) -> Result<Mesh> {
        check("icosphere", &[self.radius], 20.0 * 4f64.powf(f64::from(self.subdivisions)))?;
        // Cyclic permutations of (0, ±1, ±golden ratio).
        let long = (1.0 + 5f64.sqrt()) / 2.0;
        let mut directions: Vec<DVec3> = (0..12)
            .map(|i| {
                let mut p = DVec3::ZERO;
                p[i / 4] = if i & 1 == 0 { 1.0 } else { -1.0 };
                p[(i / 4 + 1) % 3] = if i & 2 == 0 { long } else { -long };
                p.normalize()
            })
            .collect();
        let mut triangles = Vec::new();
        for a in 0..12u32 {
            for b in a + 1..12 {
                for c in b + 1..12 {
                    let [p, q, r] = [a, b, c].map(|v| directions[v as usize]);
                    let is_side = |x: DVec3, y: DVec3| x.dot(y) > 0.4;
                    if is_side(p, q) && is_side(q, r) && is_side(r, p) {
                        triangles.push(if p.dot(q.cross(r)) > 0.0 { [a, b, c] } else { [a, c, b] });
                    }
                }
            }
        }
        for _ in 0..self.subdivisions {
            let mut middles = HashMap::new();
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    directions.push((directions[a as usize] + directions[b as usize]).normalize());
                    directions.len() as u32 - 1
                })
            };
            let mut finer = Vec::with_capacity(4 * triangles.len());
            for [a, b, c] in triangles {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
            triangles = finer;
        }
        let positions = directions.iter().map(|&d| (self.radius * d).as_vec3()).collect();
        Ok(Mesh::new("icosphere", positions, triangles))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{area, euler_characteristic, geometry, is_closed, volume};
    use super::*;

    #[test]
    fn icosahedron_has_its_closed_forms() {
        let solid = geometry(Icosphere { radius: 2.0, subdivisions: 0 }.mesh());
        assert_eq!((solid.positions.len(), solid.triangles.len()), (12, 20));
        // Edge of an icosahedron inscribed in the sphere of radius r: 4 r / sqrt(10 + 2 sqrt 5).
        let edge = 8.0 / (10.0 + 2.0 * 5f64.sqrt()).sqrt();
        assert!((area(&solid) - 5.0 * 3f64.sqrt() * edge.powi(2)).abs() < 1e-5);
        assert!((volume(&solid) - 5.0 / 12.0 * (3.0 + 5f64.sqrt()) * edge.powi(3)).abs() < 1e-5);
    }

    #[test]
    fn converges_to_the_sphere_at_second_order() {
        let error = |subdivisions| {
            let sphere = geometry(Icosphere { radius: 1.0, subdivisions }.mesh());
            assert_eq!(sphere.triangles.len(), 20 << (2 * subdivisions));
            assert!(is_closed(&sphere));
            assert_eq!(euler_characteristic(&sphere), 2);
            4.0 / 3.0 * std::f64::consts::PI - volume(&sphere)
        };
        let errors = [2, 3, 4].map(error);
        for pair in errors.windows(2) {
            let slope = (pair[0] / pair[1]).log2();
            assert!((1.9..2.1).contains(&slope), "{errors:?}");
        }
    }
}
