//! Does a ray cross a triangle: watertight, and with a definite answer on edges and vertices.
//!
//! The questions are signs of edge functions d.(A x B), with A and B the ends of an edge minus the ray's origin (rounded to
//! f64 once a vertex, hence alike for all triangles that share it) and d the direction. The signs are exact, by a
//! floating-point filter and then expansion arithmetic (Shewchuk 1997), so the triangles of an edge agree on them. A ray that meets an edge or a vertex exactly is
//! decided as if its direction were d + (e, e^2, e^3) with an infinitesimal e (simulation of simplicity, Edelsbrunner and
//! Muecke 1990), the same for all triangles, so that a closed surface is crossed an even number of times from outside.

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// A bound on the rounding error of d.(A x B), per |A|_1 |B|_1 and for |d| <= 1: two roundings of each product of the cross
/// product, one of their difference, one of the product with d, two of the sum, and the second order: below 7 units.
const EDGE_ERROR: f64 = 8.0 * 0.5 * f64::EPSILON;

/// A triangle to be crossed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// Positions in the order of the winding.
    pub corners: [[f32; 3]; 3],
    /// Index of the face.
    pub face: u32,
}

/// Where a ray crosses a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    /// Distance along the unit direction.
    pub t: f64,
    /// Weights of the corners in the order of the winding; they sum to one.
    pub barycentric: [f64; 3],
}

impl Triangle {
    /// The crossing of the ray from `origin` along the unit vector `direction`, if any, at t >= 0.
    ///
    /// A triangle whose plane holds the origin counts as seen from its positive side, as everywhere in this library: it is
    /// crossed by rays that leave the plane against its normal.
    #[inline]
    pub fn cross(&self, origin: DVec3, direction: DVec3) -> Option<Crossing> {
        let [p, q, r] = self.corners.map(|corner| DVec3::from(corner.map(f64::from)));
        let [a, b, c] = [p, q, r].map(|corner| corner - origin);
        let [la, lb, lc] = [a, b, c].map(|v| v.x.abs() + v.y.abs() + v.z.abs());
        let (ab, bc, ca) = (direction.dot(a.cross(b)), direction.dot(b.cross(c)), direction.dot(c.cross(a)));
        let normal = || (q - p).cross(r - p);
        let along = sign(direction, a, b, ab, la * lb, normal);
        if along != sign(direction, b, c, bc, lb * lc, normal) || along != sign(direction, c, a, ca, lc * la, normal) {
            return None;
        }
        // The ray's line crosses the triangle, with its normal if `along`; does the ray?
        let seen_from_positive_side = normal().dot(origin - p) >= 0.0;
        if along == seen_from_positive_side {
            return None;
        }
        let weights = [bc, ca, ab].map(|w| if along { w.max(0.0) } else { (-w).max(0.0) });
        let sum: f64 = weights.iter().sum();
        // All weights vanish only for a ray within the triangle's plane.
        let barycentric = if sum > 0.0 { weights.map(|w| w / sum) } else { [1.0 / 3.0; 3] };
        let t =
            barycentric[0] * direction.dot(a) + barycentric[1] * direction.dot(b) + barycentric[2] * direction.dot(c);
        Some(Crossing { t: t.max(0.0), barycentric })
    }

    /// Lowest and highest coordinates.
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        let [a, b, c] = self.corners;
        [std::array::from_fn(|k| a[k].min(b[k]).min(c[k])), std::array::from_fn(|k| a[k].max(b[k]).max(c[k]))]
    }
}

/// Whether d.(a x b), of which `value` is a rounding and `size` = |a|_1 |b|_1, counts as positive; `normal` is that of the
/// triangle.
#[inline(always)]
fn sign(d: DVec3, a: DVec3, b: DVec3, value: f64, size: f64, normal: impl Fn() -> DVec3) -> bool {
    if value.abs() > EDGE_ERROR * size { value > 0.0 } else { exact_sign(d, a, b, normal()) }
}

#[cold]
fn exact_sign(d: DVec3, a: DVec3, b: DVec3, normal: DVec3) -> bool {
    let point = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    let minor =
        |i: usize, j: usize| orient2d(Coord { x: a[i], y: a[j] }, Coord { x: b[i], y: b[j] }, Coord { x: 0.0, y: 0.0 });
    // An edge that holds the origin is seen as from a point moved off the triangle's plane along the normal, by nothing: the
    // triangle then has that edge's half of the plane's lower side. To first order a x b becomes (b - a) x normal.
    if a.cross(b) == DVec3::ZERO && a.dot(b) <= 0.0 {
        return d.dot((b - a).cross(normal)) > 0.0;
    }
    // d, then the perturbation's axes by falling size. All are zero for an edge in line with the origin and beside it: its
    // triangles are seen edge-on and their other two edges decide.
    let terms = [orient3d(point(d), point(a), point(b), point(DVec3::ZERO)), minor(1, 2), minor(2, 0), minor(0, 1)];
    terms.into_iter().find(|&term| term != 0.0).is_none_or(|term| term > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_signs_are_exact() {
        // a x b = (0, 0, -2^-60) by a cancellation that rounding hides.
        let a = DVec3::new(1.0 + 2f64.powi(-30), 1.0, 0.0);
        let b = DVec3::new(1.0, 1.0 - 2f64.powi(-30), 0.0);
        assert_eq!(a.cross(b).z, 0.0);
        assert!(!exact_sign(DVec3::Z, a, b, DVec3::X));
        assert!(exact_sign(-DVec3::Z, a, b, DVec3::X));
        assert!(exact_sign(DVec3::Z, b, a, DVec3::X));
    }

    #[test]
    fn distance_and_weights() {
        let corners = [[1.0, 0.0, 2.0], [3.0, 0.0, 2.0], [1.0, 2.0, 4.0]];
        for order in [[0, 1, 2], [1, 2, 0], [2, 1, 0]] {
            let corners = order.map(|k: usize| corners[k]);
            let triangle = Triangle { corners, face: 0 };
            let target = DVec3::new(1.5, 0.5, 2.5);
            for (origin, expected) in [(DVec3::ZERO, true), (2.0 * target, false)] {
                let direction = target.normalize();
                let crossing = triangle.cross(origin, direction);
                assert_eq!(crossing.is_some(), expected);
                let back = triangle.cross(origin, -direction);
                assert_eq!(back.is_some(), !expected);
                let crossing = crossing.or(back).unwrap();
                assert!((crossing.t - target.length()).abs() < 1e-14);
                let point: DVec3 =
                    (0..3).map(|k| crossing.barycentric[k] * DVec3::from(corners[k].map(f64::from))).sum();
                assert!((point - target).length() < 1e-14);
            }
        }
    }

    #[test]
    fn a_receiver_in_the_plane_counts_as_on_its_positive_side() {
        let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
        for (order, down) in [([0, 1, 2], true), ([0, 2, 1], false)] {
            let triangle = Triangle { corners: order.map(|k: usize| corners[k]), face: 0 };
            let crossed = |z: f64| triangle.cross(DVec3::ZERO, DVec3::new(0.1, 0.2, z).normalize()).is_some();
            assert_eq!((crossed(-1.0), crossed(1.0)), (down, !down));
        }
    }

    /// Seen from on its border a face hides its half of what is below its plane; two that meet there, all of it.
    #[test]
    fn a_receiver_on_an_edge_or_corner_counts_as_above_it() {
        let [a, b, c, d] = [[-2.0, -2.0, 0.0], [2.0, 2.0, 0.0], [-2.0, 2.0, 0.0], [2.0, -2.0, 0.0]];
        let (first, second) = (Triangle { corners: [a, b, c], face: 0 }, Triangle { corners: [b, a, d], face: 1 });
        for origin in [DVec3::ZERO, DVec3::new(0.5, 0.5, 0.0), DVec3::new(-2.0, -2.0, 0.0)] {
            let is_corner = origin.x == -2.0;
            for k in 0..200 {
                let (s, c) = (0.1 + f64::from(k)).sin_cos();
                let z = [-0.3, 0.4, -2.0, 1.0][k as usize % 4];
                let w = DVec3::new(c, s, z).normalize();
                let crossed = [&first, &second].map(|t| t.cross(origin, w).is_some());
                // From the corner only a quarter of the plane is covered, halved by the diagonal.
                let covered = !is_corner || c > 0.0 && s > 0.0;
                let expected = [z < 0.0 && covered && s > c, z < 0.0 && covered && s < c];
                assert_eq!(crossed, expected, "{origin} {w}");
            }
        }
    }
}
