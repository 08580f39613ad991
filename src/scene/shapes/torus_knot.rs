use std::f64::consts::TAU;

use glam::DVec3;
use serde::Deserialize;

use super::super::Mesh;
use super::check;
use crate::{Error, Result};

/// A tube around a (p, q) torus knot about the y axis:
/// `c(t) = ((R + r cos qt) cos pt, r sin qt, (R + r cos qt) sin pt)`.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TorusKnot {
    /// Windings p around the axis and q around the core of the torus. Default 2, 3: the trefoil.
    pub windings: [u32; 2],
    /// Radius R of the torus' core. Default 1.
    pub radius: f64,
    /// Radius r of the torus on which the knot runs. Default 0.4.
    pub spread: f64,
    /// Radius of the tube. Default 0.2.
    pub tube: f64,
    /// About how many triangles to make, at least 30. Default 4000.
    ///
    /// The tube has m sides and n segments, m = sqrt(triangles / 10) and n = triangles / (2 m), rounded.
    pub triangles: usize,
}

impl Default for TorusKnot {
    fn default() -> Self {
        Self { windings: [2, 3], radius: 1.0, spread: 0.4, tube: 0.2, triangles: 4000 }
    }
}

impl TorusKnot {
    /// The tube's triangles.
    ///
    /// # Errors
    /// Radii that are not positive, no windings, too few or too many triangles.
    pub fn mesh(&self) -> Result<Mesh> {
        check("torus_knot", &[self.radius, self.spread, self.tube], self.triangles as f64)?;
        if self.windings == [0, 0] || self.triangles < 30 {
            return Err(Error::input("torus_knot: needs at least one winding and 30 triangles"));
        }
        let sides = (self.triangles as f64 / 10.0).sqrt().round().max(3.0) as u32;
        let segments = (self.triangles as f64 / (2.0 * f64::from(sides))).round().max(3.0) as u32;
        let [p, q] = self.windings.map(f64::from);
        let mut positions = Vec::with_capacity((sides * segments) as usize);
        for i in 0..segments {
            let t = TAU * f64::from(i) / f64::from(segments);
            let ((sin_p, cos_p), (sin_q, cos_q)) = ((p * t).sin_cos(), (q * t).sin_cos());
            let distance = self.radius + self.spread * cos_q;
            let centre = DVec3::new(distance * cos_p, self.spread * sin_q, distance * sin_p);
            // The knot lies on the torus, so that the torus' normal is a normal of the knot, and periodic.
            let outward = DVec3::new(cos_q * cos_p, sin_q, cos_q * sin_p);
            let around = DVec3::new(-sin_p, 0.0, cos_p) * p * distance;
            let over = DVec3::new(-sin_q * cos_p, cos_q, -sin_q * sin_p) * q * self.spread;
            let sideways = (around + over).normalize().cross(outward);
            for j in 0..sides {
                let (sin, cos) = (TAU * f64::from(j) / f64::from(sides)).sin_cos();
                positions.push((centre + self.tube * (outward * cos + sideways * sin)).as_vec3());
            }
        }
        let mut triangles = Vec::with_capacity(2 * positions.len());
        for i in 0..segments {
            for j in 0..sides {
                let at = |i: u32, j: u32| (i % segments) * sides + j % sides;
                let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        Ok(Mesh::new("torus_knot", positions, triangles))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{euler_characteristic, geometry, is_closed, volume};
    use super::*;

    #[test]
    fn every_knot_is_a_closed_torus_wound_outwards() {
        for windings in [[2, 3], [3, 2], [1, 0], [0, 1], [5, 7]] {
            let knot = geometry(TorusKnot { windings, ..TorusKnot::default() }.mesh());
            assert_eq!(knot.triangles.len(), 4000);
            assert!(is_closed(&knot));
            assert_eq!(euler_characteristic(&knot), 0);
            assert!(volume(&knot) > 0.0);
        }
    }

    #[test]
    fn unknot_has_the_volume_of_a_faceted_torus() {
        // With n segments of m sides: n sin(2 pi/n) times the m-gon's area times the distance of its centre.
        let torus = TorusKnot { windings: [1, 0], radius: 2.0, spread: 1.0, tube: 0.5, triangles: 1000 };
        let (sides, segments) = (10.0, 50.0);
        let polygon = sides / 2.0 * 0.25 * (TAU / sides).sin();
        let expected = segments * (TAU / segments).sin() * polygon * 3.0;
        assert!((volume(&geometry(torus.mesh())) - expected).abs() < 1e-5);
    }
}
