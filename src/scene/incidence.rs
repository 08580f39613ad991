//! On which faces a point lies, decided exactly.

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::FaceTree;

/// The faces on which every one of `points` lies, exactly: in their inside, on an edge or on a corner. Ascending.
///
/// There is no tolerance. Faces and points are taken as the numbers they are, and the signs of Shewchuk's determinants
/// (1997) are exact; so a point that was computed and rounded mostly lies beside the face it was meant for, while corners,
/// points of axis-aligned faces and whatever was derived without rounding lie on theirs. (What these determinants cannot see
/// is a step off the face so small that its products are below the double range: some 1e-300 times the face's area.)
pub fn faces_at(tree: &FaceTree, points: impl IntoIterator<Item = DVec3>) -> Vec<Vec<u32>> {
    let at = |point| {
        let mut faces = Vec::new();
        tree.visit_around(point, |face| {
            if holds(tree.corners(face).map(|corner| corner.as_dvec3()), point) {
                faces.push(face);
            }
        });
        faces.sort_unstable();
        faces
    };
    points.into_iter().map(at).collect()
}

/// Whether the closed triangle holds the point.
fn holds([a, b, c]: [DVec3; 3], p: DVec3) -> bool {
    let space = |v: DVec3| Coord3D { x: v.x, y: v.y, z: v.z };
    if orient3d(space(a), space(b), space(c), space(p)) != 0.0 {
        return false;
    }
    // Seen along an axis the triangle is not edge-on to, coplanar points keep their place.
    (0..3).find_map(|axis| {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        let side = |a: DVec3, b: DVec3, c: DVec3| {
            orient2d(Coord { x: a[i], y: a[j] }, Coord { x: b[i], y: b[j] }, Coord { x: c[i], y: c[j] })
        };
        let area = side(a, b, c);
        (area != 0.0).then(|| [(a, b), (b, c), (c, a)].iter().all(|&(a, b)| side(a, b, p) * area.signum() >= 0.0))
    }) == Some(true)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// A square in the plane x + y + z = 0 scaled by 2^-20, cut along a diagonal, a copy of one half wound the other way, and
    /// a triangle above.
    fn scene() -> (Vec<Vec3>, FaceTree) {
        let s = 2f32.powi(-20);
        let positions = [(1, -1, 0), (0, 1, -1), (-1, 1, 0), (0, -1, 1), (5, 5, 5), (6, 5, 5), (5, 6, 5)];
        let positions: Vec<Vec3> =
            positions.iter().map(|&(x, y, z)| s * Vec3::new(x as f32, y as f32, z as f32)).collect();
        let triangles = vec![[0, 1, 2], [0, 2, 3], [2, 1, 0], [4, 5, 6]];
        (positions.clone(), FaceTree::new(positions.into(), triangles.into()))
    }

    #[test]
    fn corners_edges_insides_and_copies() {
        let (positions, tree) = scene();
        let p = |k: usize| positions[k].as_dvec3();
        let at = |point| faces_at(&tree, [point]).remove(0);
        assert_eq!(at(p(0)), [0, 1, 2], "corner");
        assert_eq!(at(p(3)), [1]);
        assert_eq!(at(p(0).midpoint(p(2))), [0, 1, 2], "edge");
        assert_eq!(at(p(0).midpoint(p(3))), [1], "boundary edge");
        assert_eq!(at(p(0).midpoint(p(1).midpoint(p(2)))), [0, 2], "inside of coincident faces");
        assert_eq!(at(p(4).midpoint(p(5))), [3]);
        // In the plane, beyond the faces.
        assert!(at(3.0 * p(0)).is_empty());
        assert!(at(2.0 * p(1) - p(0)).is_empty());
    }

    /// The least step in any direction off the plane leaves it.
    #[test]
    fn neighbours_in_double_precision_lie_beside() {
        let (positions, tree) = scene();
        let p = |k: usize| positions[k].as_dvec3();
        // No coordinate is zero, whose neighbours are too near for products.
        let inside = p(2).midpoint(p(0).midpoint(p(1)));
        assert_eq!(faces_at(&tree, [inside]), [[0, 2]]);
        for axis in 0..3 {
            let mut up = inside;
            up[axis] = up[axis].next_up();
            let mut down = inside;
            down[axis] = down[axis].next_down();
            assert!(faces_at(&tree, [up, down]).iter().all(Vec::is_empty), "axis {axis}");
        }
    }

    #[test]
    fn nothing_lies_on_no_face() {
        assert_eq!(faces_at(&FaceTree::new(Vec::new().into(), Vec::new().into()), [DVec3::ZERO]), [Vec::<u32>::new()]);
    }
}
