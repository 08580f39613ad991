use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::morton::{MORTON_BITS, morton};

/// Faces in groups of at most [`FaceGroups::MOST`] neighbours: the leaves of a tree that then has a sixth as many nodes to
/// build and to keep as one over single faces.
///
/// The faces stand in the order of the Morton codes of their centres, cut where the highest bit changes until no group is
/// too large (the leaves of Lauterbach et al. 2009).
pub(super) struct FaceGroups {
    /// Faces, group by group.
    pub(super) faces: Vec<u32>,
    /// Where each group starts, and the end.
    pub(super) starts: Vec<u32>,
}

impl FaceGroups {
    /// Most faces in a group: their test costs more than a box's.
    pub(super) const MOST: usize = 8;

    /// Groups the faces `triangles`, which index into `positions`.
    pub(super) fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let centre = |face: &[u32; 3]| face.iter().map(|&v| positions[v as usize].as_dvec3()).sum::<DVec3>() / 3.0;
        let bounds = || (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let join = |(a, b): (DVec3, DVec3), (c, d): (DVec3, DVec3)| (a.min(c), b.max(d));
        let (low, high) = triangles.par_iter().map(|face| (centre(face), centre(face))).reduce(bounds, join);
        let cell = ((high - low).max_element() / f64::from(1u32 << MORTON_BITS)).max(f64::MIN_POSITIVE);
        let mut order: Vec<(u64, u32)> = triangles
            .par_iter()
            .zip(0..triangles.len() as u32)
            .map(|(face, i)| (morton((centre(face) - low) / cell), i))
            .collect();
        order.par_sort_unstable();

        let mut starts = Vec::with_capacity(triangles.len() / 2 + 1);
        // Ends of the ranges yet to be cut, the nearest last.
        let mut todo = Vec::from_iter((!order.is_empty()).then_some(order.len()));
        let mut start = 0;
        while let Some(&end) = todo.last() {
            if end - start <= Self::MOST {
                starts.push(start as u32);
                start = end;
                todo.pop();
            } else {
                todo.push(start + cut(&order[start..end]));
            }
        }
        starts.push(order.len() as u32);
        let mut faces: Vec<u32> = order.into_iter().map(|(_, face)| face).collect();
        // They stand in the memory of the pairs, four times as large, which would be kept.
        faces.shrink_to_fit();
        Self { faces, starts }
    }
}

/// Where the highest bit in which the codes of a sorted range differ turns to one; the middle where they are all equal.
fn cut(range: &[(u64, u32)]) -> usize {
    let differing = range[0].0 ^ range[range.len() - 1].0;
    match differing.checked_ilog2() {
        Some(bit) => range.partition_point(|(code, _)| code >> bit & 1 == 0),
        None => range.len() / 2,
    }
}

#[cfg(test)]
mod tests {
    use super::super::shapes::TorusKnot;
    use super::*;

    fn group(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
        let groups = FaceGroups::new(positions, triangles);
        let pairs = groups.starts.windows(2);
        pairs.map(|pair| groups.faces[pair[0] as usize..pair[1] as usize].to_vec()).collect()
    }

    #[test]
    fn every_face_is_in_one_small_group_of_neighbours() {
        let knot = TorusKnot { triangles: 5000, ..TorusKnot::default() }.mesh().unwrap();
        let groups = group(&knot.positions, &knot.triangles);
        let mut faces: Vec<u32> = groups.concat();
        faces.sort_unstable();
        assert!(faces.iter().copied().eq(0..knot.triangles.len() as u32));
        assert!(groups.iter().all(|group| (1..=FaceGroups::MOST).contains(&group.len())));
        assert!(groups.len() < knot.triangles.len() / 2, "{}", groups.len());
        let centre =
            |face: u32| knot.triangles[face as usize].iter().map(|&v| knot.positions[v as usize]).sum::<Vec3>() / 3.0;
        let spread = groups.iter().map(|group| centre(group[0]).distance(centre(group[group.len() - 1]))).sum::<f32>();
        // Triangles are about 0.1 long.
        assert!(spread / (groups.len() as f32) < 0.2, "{}", spread / groups.len() as f32);
    }

    #[test]
    fn equal_and_no_faces() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        assert!(group(&positions, &[]).is_empty());
        assert_eq!(group(&positions, &[[0, 1, 2]; 17]).iter().map(Vec::len).collect::<Vec<_>>(), [8, 4, 5]);
    }
}
