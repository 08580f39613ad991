//! Groups of faces: bodies, which share no vertices with each other, each with a tree of its own.

use std::ops::Range;

use glam::Vec3;

use crate::build::arrange_points;
use crate::node::{Tree, WIDTH};

/// The edges of some bodies: with an even number of faces, then with an odd one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Group {
    /// Number of its first edge.
    pub(crate) first: u32,
    /// Edges with an even number of faces: no contours where all flipped planes have the same sign.
    pub(crate) balanced: Tree,
    /// Edges with an odd number of faces: contours for every receiver.
    pub(crate) unbalanced: Tree,
}

impl Group {
    /// Its edges.
    pub(crate) fn edges(&self) -> Range<u32> {
        self.first..self.first + (self.balanced.edges + self.unbalanced.edges) as u32
    }
}

/// Lowest and highest corner of a box.
pub(crate) type Box3 = [Vec3; 2];

const EMPTY: Box3 = [Vec3::INFINITY, Vec3::NEG_INFINITY];

fn union(a: Box3, b: Box3) -> Box3 {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Which group every vertex belongs to, and the boxes of the groups.
pub(crate) struct Grouping {
    pub(crate) of_vertices: Vec<u32>,
    /// Boxes of the groups; above them those of eight neighbours each, up to one; empty without groups.
    pub(crate) boxes: Vec<Vec<Box3>>,
}

impl Grouping {
    /// Bodies are sets of faces that hang together by vertices. Those of fewer than `least` faces are put together with
    /// neighbours until there are as many.
    pub(crate) fn new(positions: &[Vec3], triangles: &[[u32; 3]], least: usize) -> Self {
        let (mut of_vertices, bodies) = bodies(positions.len(), triangles);
        let (mut boxes, mut faces) = (vec![EMPTY; bodies], vec![0usize; bodies]);
        for corners in triangles {
            let body = of_vertices[corners[0] as usize] as usize;
            faces[body] += 1;
            boxes[body] = corners.iter().map(|&c| positions[c as usize]).fold(boxes[body], |all, p| union(all, [p, p]));
        }
        let groups = merge(&boxes, &faces, least);
        let mut joined = vec![EMPTY; groups.iter().max().map_or(0, |last| *last as usize + 1)];
        for (&group, &box_) in groups.iter().zip(&boxes) {
            joined[group as usize] = union(joined[group as usize], box_);
        }
        // Numbered so that neighbours have neighbouring numbers.
        let order = arrange_points(joined.iter().map(|&[low, high]| 0.5 * low + 0.5 * high));
        let mut renumbered = vec![0; joined.len()];
        order.iter().enumerate().for_each(|(new, &old)| renumbered[old as usize] = new as u32);
        for group in of_vertices.iter_mut().filter(|group| **group != NONE) {
            *group = renumbered[groups[*group as usize] as usize];
        }
        let mut levels: Vec<Vec<Box3>> = vec![order.iter().map(|&group| joined[group as usize]).collect()];
        while levels[levels.len() - 1].len() > 1 {
            let below = &levels[levels.len() - 1];
            levels.push(below.chunks(WIDTH).map(|boxes| boxes.iter().copied().fold(EMPTY, union)).collect());
        }
        levels.retain(|level| !level.is_empty());
        Self { of_vertices, boxes: levels }
    }
}

/// Stands for the body of a vertex without faces.
const NONE: u32 = u32::MAX;

/// The body of every vertex, numbered in the order of their first vertices, and the number of bodies: by union of corners (Galler
/// and Fischer, 1964, with path halving).
fn bodies(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, usize) {
    fn root(parent: &mut [u32], mut vertex: u32) -> u32 {
        while parent[vertex as usize] != vertex {
            parent[vertex as usize] = parent[parent[vertex as usize] as usize];
            vertex = parent[vertex as usize];
        }
        vertex
    }
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    let mut used = vec![false; vertices];
    for &[a, b, c] in triangles {
        for corner in [a, b, c] {
            used[corner as usize] = true;
        }
        for other in [b, c] {
            let (x, y) = (root(&mut parent, a), root(&mut parent, other));
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    // The root of a body is its first vertex.
    let mut count = 0;
    let mut body = vec![NONE; vertices];
    for vertex in 0..vertices as u32 {
        if used[vertex as usize] {
            let first = root(&mut parent, vertex);
            if first == vertex {
                body[vertex as usize] = count;
                count += 1;
            } else {
                body[vertex as usize] = body[first as usize];
            }
        }
    }
    (body, count as usize)
}

/// A group of more bodies needs more faces, 8/3 of the number that is enough for fewer: leaves hide little of one another. Eight neighbours
/// in the order of a tree of that width are a whole node of it, so their box is small.
const FEW: usize = 8;

/// The group of every body, in no particular order.
fn merge(boxes: &[Box3], faces: &[usize], least: usize) -> Vec<u32> {
    let mut groups = vec![NONE; boxes.len()];
    let mut count = 0;
    for (group, _) in groups.iter_mut().zip(faces).filter(|(_, faces)| **faces >= least) {
        *group = count;
        count += 1;
    }
    let small: Vec<u32> = (0..boxes.len() as u32).filter(|&body| groups[body as usize] == NONE).collect();
    let centers = small.iter().map(|&body| boxes[body as usize]).map(|[low, high]| 0.5 * low + 0.5 * high);
    let (mut gathered, mut bodies) = (0, 0);
    for index in arrange_points(centers) {
        let body = small[index as usize] as usize;
        groups[body] = count;
        gathered += faces[body];
        bodies += 1;
        if gathered >= (if bodies > FEW { least.saturating_mul(8) / 3 } else { least }) {
            count += 1;
            (gathered, bodies) = (0, 0);
        }
    }
    // The last few go with the last group before them.
    if gathered > 0 && count > 0 {
        groups.iter_mut().filter(|group| **group == count).for_each(|group| *group = count - 1);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of strips, each of so many triangles.
    fn strips(sizes: &[u32]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (strip, &size) in sizes.iter().enumerate() {
            let first = positions.len() as u32;
            positions
                .extend((0..size + 2).map(|i| Vec3::new(strip as f32, 0.1 * (i / 2) as f32, 0.1 * (i % 2) as f32)));
            triangles.extend((0..size).map(|i| [first + i, first + i + 1, first + i + 2]));
        }
        positions.push(Vec3::ONE);
        (positions, triangles)
    }

    #[test]
    fn large_bodies_stand_alone_and_small_ones_together() {
        let (positions, triangles) = strips(&[9, 1, 2, 3, 12, 2, 2, 1]);
        let grouping = Grouping::new(&positions, &triangles, 4);
        let group = |face: usize| grouping.of_vertices[triangles[face][0] as usize];
        let strip = [0, 9, 10, 12, 15, 27, 29, 31].map(group);
        // 9 | 1 2 3 | 12 | 2 2 1: the last, too few, go with those before them.
        assert!(
            strip[1] == strip[2] && strip[2] == strip[3] && strip[5] == strip[6] && strip[6] == strip[7],
            "{strip:?}"
        );
        assert_eq!([0, 1, 4, 5].map(|i| strip[i]).iter().collect::<std::collections::BTreeSet<_>>().len(), 4);
        assert_eq!(grouping.of_vertices.last(), Some(&NONE));
        assert_eq!(grouping.boxes.iter().map(Vec::len).collect::<Vec<_>>(), [4, 1]);
        for (face, corners) in triangles.iter().enumerate() {
            let [low, high] = grouping.boxes[0][group(face) as usize];
            for &corner in corners {
                let p = positions[corner as usize];
                assert_eq!(grouping.of_vertices[corner as usize], group(face));
                assert!(p.cmpge(low).all() && p.cmple(high).all());
            }
        }
    }

    #[test]
    fn nothing_and_little_make_at_most_one_group() {
        assert!(Grouping::new(&[Vec3::ONE], &[], 4).boxes.is_empty());
        let (positions, triangles) = strips(&[1, 1]);
        assert_eq!(Grouping::new(&positions, &triangles, 4).boxes.iter().map(Vec::len).collect::<Vec<_>>(), [1]);
        assert_eq!(Grouping::new(&positions, &triangles, 1).boxes[0].len(), 2);
    }

    #[test]
    fn boxes_enclose_those_below_them() {
        let (positions, triangles) = strips(&[4; 70]);
        let boxes = Grouping::new(&positions, &triangles, 4).boxes;
        assert_eq!(boxes.iter().map(Vec::len).collect::<Vec<_>>(), [70, 9, 2, 1]);
        for levels in boxes.windows(2) {
            for (i, &[low, high]) in levels[0].iter().enumerate() {
                let [outer_low, outer_high] = levels[1][i / WIDTH];
                assert!(low.cmpge(outer_low).all() && high.cmple(outer_high).all());
            }
        }
        // Neighbours in a row have neighbouring numbers.
        assert!(boxes[1].iter().all(|[low, high]| high.x - low.x <= 8.0), "{:?}", boxes[1]);
    }
}
