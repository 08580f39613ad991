//! The search without a tree.

use glam::{DVec3, Vec3};

use crate::edge::sides;
use crate::face_sign;

/// The contour edges of `receiver`, leaving out the faces `excluded`, from the definition: the twin of a search, which it must
/// equal.
///
/// Each edge is given by its vertices, the smaller number first, with its jump (see [`crate::Contour`]), in lexicographic order.
/// Panics if a corner is out of range.
pub fn brute_force(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    receiver: DVec3,
    excluded: &[u32],
) -> Vec<([u32; 2], i32)> {
    let mut edges = Vec::new();
    for (face, triangle) in triangles.iter().enumerate() {
        if excluded.contains(&(face as u32)) {
            continue;
        }
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
        let sign = i32::from(face_sign(receiver, a, b, c));
        edges.extend(sides(triangle).map(|(u, v)| if u < v { ([u, v], sign) } else { ([v, u], -sign) }));
    }
    edges.sort_unstable_by_key(|&(edge, _)| edge);
    let total = |uses: &[([u32; 2], i32)]| (uses[0].0, uses.iter().map(|(_, jump)| jump).sum());
    edges.chunk_by(|x, y| x.0 == y.0).map(total).filter(|&(_, jump)| jump != 0).collect()
}
