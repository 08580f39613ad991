use glam::DVec3;
use serde::Deserialize;

use super::super::Mesh;
use super::check;
use super::random::Random;
use crate::Result;

/// Loose small triangles of random orientation, spread evenly over a ball around the origin.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Foliage {
    /// Number of triangles. Default 50,000.
    pub triangles: usize,
    /// Radius of the ball that holds their centres. Default 1.
    pub radius: f64,
    /// Largest distance of a corner from its triangle's centre. Default 0.03.
    pub leaf: f64,
    /// Another seed gives other triangles. Default 1.
    pub seed: u64,
}

impl Default for Foliage {
    fn default() -> Self {
        Self { triangles: 50_000, radius: 1.0, leaf: 0.03, seed: 1 }
    }
}

impl Foliage {
    /// The triangles.
    ///
    /// # Errors
    /// Lengths that are not positive, no triangles or too many.
    pub fn mesh(&self) -> Result<Mesh> {
        check("foliage", &[self.radius, self.leaf], self.triangles as f64)?;
        let mut random = Random::new(self.seed);
        let mut positions = Vec::with_capacity(3 * self.triangles);
        for _ in 0..self.triangles {
            let centre = self.radius * random.in_ball();
            let corners: [DVec3; 3] = std::array::from_fn(|_| centre + self.leaf * random.in_ball());
            positions.extend(corners.map(|p| p.as_vec3()));
        }
        let triangles = (0..self.triangles as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        Ok(Mesh::new("foliage", positions, triangles))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::geometry;
    use super::*;

    #[test]
    fn triangles_are_loose_small_and_repeatable() {
        let foliage = Foliage { triangles: 1000, radius: 2.0, ..Foliage::default() };
        let mesh = foliage.mesh().unwrap();
        assert_eq!(mesh, foliage.mesh().unwrap());
        assert_ne!(mesh, Foliage { seed: 2, ..foliage.clone() }.mesh().unwrap());
        let soup = geometry(Ok(mesh));
        assert_eq!((soup.triangles.len(), soup.topology().bodies()), (1000, 1000));
        for t in 0..1000 {
            let [a, b, c] = soup.corners(t);
            assert!(a.length() <= 2.03 + 1e-6 && a.distance(b).max(b.distance(c)) <= 0.06 + 1e-6);
        }
    }
}
