use glam::DVec3;

use super::crossing::Triangle;
use crate::scene::FaceTree;

/// The first surface along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index of the triangle.
    pub face: u32,
    /// Distance from the origin.
    pub t: f64,
    /// Weights of the triangle's corners, which sum to one.
    pub barycentric: [f64; 3],
}

/// The nearest of the triangles offered; of those at the same distance the one with the lowest index.
#[derive(Default)]
pub(super) struct Nearest(Option<Hit>);

impl Nearest {
    /// Takes a triangle if the ray crosses it nearer than those before.
    #[inline(always)]
    pub(super) fn offer(&mut self, triangle: &Triangle, origin: DVec3, direction: DVec3) {
        let Some(crossing) = triangle.cross(origin, direction) else { return };
        let face = triangle.face;
        if self.0.is_none_or(|hit| (crossing.t, face) < (hit.t, hit.face)) {
            self.0 = Some(Hit { face, t: crossing.t, barycentric: crossing.barycentric });
        }
    }

    /// The distance beyond which boxes hold nothing nearer.
    #[inline(always)]
    pub(super) fn limit(&self) -> f64 {
        // The boxes' distances round otherwise than the triangles'.
        self.0.map_or(f64::INFINITY, |hit| hit.t * (1.0 + 1e-12))
    }

    pub(super) fn hit(self) -> Option<Hit> {
        self.0
    }
}

/// A primary ray: the nearest face along the ray from `origin` along the unit vector `direction`; of faces at the same distance the
/// one with the lowest index.
///
/// The same hit, to the bit, as [`RayScene::first_hit`](super::RayScene::first_hit) gives. Primary rays judge nothing, so they go
/// through the tree that the integrator has anyway.
pub fn first_hit(faces: &FaceTree, origin: DVec3, direction: DVec3) -> Option<Hit> {
    let mut nearest = Nearest::default();
    faces.visit_ordered(origin, direction, |face| {
        let corners = faces.corners(face).map(|corner| corner.to_array());
        nearest.offer(&Triangle { corners, face }, origin, direction);
        nearest.limit()
    });
    nearest.hit()
}
