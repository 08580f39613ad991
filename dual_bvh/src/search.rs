//! The search: from a tile of receivers to the edges that may be contours for some of them.

use std::ops::Range;

use glam::DVec3;

use crate::candidates::{Candidates, room};
use crate::edge::Incidence;
use crate::node::{Node, Tree, WIDTH};
use crate::prefetch::{AHEAD, ahead, prefetch};
use crate::query::{LeafHit, NodeTest, Query};
use crate::{DualBvh, Tile};

/// How many nodes ahead memory is asked for.
const NODES_AHEAD: usize = 3;

/// Working memory of a search.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    nodes: Vec<u32>,
    children: Vec<u32>,
    leaves: Vec<LeafHit>,
    pub(crate) hits: Vec<u32>,
    /// Vertices and faces of the found edges with two faces in opposite directions.
    pub(crate) regular: Vec<([u32; 2], [u32; 2])>,
    /// Vertices and faces of the found edges with one face.
    pub(crate) border: Vec<([u32; 2], Incidence)>,
    /// The other found edges.
    pub(crate) other: Vec<u32>,
    /// One bit an edge: set for edges of excluded faces, which are found without the tree.
    excluded: Vec<u8>,
}

impl Scratch {
    /// Marks the edges of the excluded faces and makes them the first hits.
    fn exclude(&mut self, bvh: &DualBvh, tile: &Tile<'_>) {
        self.hits.clear();
        if tile.excluded().is_empty() {
            return self.excluded.clear();
        }
        self.excluded.resize(bvh.edges.records.len().div_ceil(8), 0);
        for edge in bvh.edges_of(tile.excluded()) {
            let (bits, bit) = (&mut self.excluded[edge as usize / 8], 1 << (edge % 8));
            if *bits & bit == 0 {
                *bits |= bit;
                self.hits.push(edge);
            }
        }
    }

    /// Takes the marks away.
    fn readmit(&mut self, bvh: &DualBvh, tile: &Tile<'_>) {
        for edge in bvh.edges_of(tile.excluded()) {
            self.excluded[edge as usize / 8] = 0;
        }
    }
}

impl DualBvh {
    /// Finds the candidates of a tile: all edges that are contours for some receiver in its ball, but those below the horizon of
    /// every receiver, and all edges of the excluded faces. What `out` held is replaced; nothing is allocated once its memory has
    /// grown to the size that the searches need.
    pub fn search(&self, tile: &Tile<'_>, out: &mut Candidates) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.search_avx2(tile, out) };
        }
        self.search_inline(tile, out);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn search_avx2(&self, tile: &Tile<'_>, out: &mut Candidates) {
        self.search_inline(tile, out);
    }

    /// Makes every edge a candidate, for receivers anywhere: the twin of [`DualBvh::search`] without the tree, which finds the same
    /// contours, and does it faster in small meshes if it serves many receivers.
    pub fn all_edges(&self, out: &mut Candidates) {
        out.clear(self);
        let mut scratch = std::mem::take(&mut out.scratch);
        scratch.hits.clear();
        scratch.hits.extend(0..self.edge_count() as u32);
        (out.nodes_tested, out.edges_tested) = (0, self.edge_count() as u64);
        let mut everywhere = Tile::lone(DVec3::ZERO, None);
        everywhere.radius = f64::INFINITY;
        self.collect(&everywhere, &mut scratch, out);
        out.scratch = scratch;
    }

    #[inline(always)]
    fn search_inline(&self, tile: &Tile<'_>, out: &mut Candidates) {
        let query = Query::new(tile);
        out.clear(self);
        let mut scratch = std::mem::take(&mut out.scratch);
        scratch.exclude(self, tile);
        let [nodes, edges] = self.balanced_hits(&query, &mut scratch);
        let unbalanced = self.unbalanced_hits(&query, &mut scratch);
        (out.nodes_tested, out.edges_tested) = (nodes + unbalanced, edges);
        self.collect(tile, &mut scratch, out);
        scratch.readmit(self, tile);
        out.scratch = scratch;
    }

    /// Appends the edges of the balanced tree to the hits. Returns the numbers of bounds and of edges tested.
    #[inline(always)]
    fn balanced_hits(&self, query: &Query, scratch: &mut Scratch) -> [u64; 2] {
        let Scratch { nodes, children, leaves, hits, excluded, .. } = scratch;
        leaves.clear();
        let tested = descend::<true>(&self.balanced, query, nodes, children, |test, node, leaf, j| {
            leaves.push(test.leaf(leaf, j, node, query));
        });
        let mut edges = 0;
        let mut found = hits.len();
        room(hits, found + WIDTH * leaves.len());
        for hit in ahead(leaves, AHEAD, |hit| prefetch(&self.balanced.leaves[hit.leaf as usize])) {
            let live = (self.balanced.edges - WIDTH * hit.leaf as usize).min(WIDTH);
            edges += live as u64;
            let mut kept = hit.test(&self.balanced.leaves[hit.leaf as usize]) & ((1 << live) - 1);
            if let Some(&bits) = excluded.get(hit.leaf as usize) {
                kept &= !u32::from(bits);
            }
            // All are written, the kept ones stay: how many there are is hard to predict.
            let hits = &mut hits[found..found + WIDTH];
            let mut next = 0;
            for j in 0..WIDTH {
                hits[next] = (WIDTH * hit.leaf as usize + j) as u32;
                next += (kept >> j & 1) as usize;
            }
            found += next;
        }
        hits.truncate(found);
        [tested, edges]
    }

    /// Appends the edges of the unbalanced tree to the hits. Returns the number of bounds tested.
    #[inline(always)]
    fn unbalanced_hits(&self, query: &Query, scratch: &mut Scratch) -> u64 {
        let Scratch { nodes, children, hits, excluded, .. } = scratch;
        let first = self.balanced.edges;
        let mut append = |edges: Range<usize>| {
            for edge in first + edges.start..first + edges.end {
                if excluded.get(edge / 8).is_none_or(|bits| bits >> (edge % 8) & 1 == 0) {
                    hits.push(edge as u32);
                }
            }
        };
        if query.horizon.is_none() {
            append(0..self.unbalanced.edges);
            return 0;
        }
        descend::<false>(&self.unbalanced, query, nodes, children, |_, _, leaf, _| {
            append(self.unbalanced.edges_below(0, leaf as usize));
        })
    }

    fn edges_of(&self, faces: &[u32]) -> impl Iterator<Item = u32> {
        faces.iter().filter_map(|&face| self.edges.of_faces.get(face as usize)).flatten().copied()
    }
}

/// Goes through the children of all nodes of a tree that may hold contours, level by level, and calls `leaf` with the test, the
/// node and the number of every leaf and its lane. Returns the number of bounds tested.
#[inline(always)]
fn descend<const DUAL: bool>(
    tree: &Tree,
    query: &Query,
    nodes: &mut Vec<u32>,
    children: &mut Vec<u32>,
    mut leaf: impl FnMut(&NodeTest, &Node, u32, usize),
) -> u64 {
    nodes.clear();
    if !tree.levels.is_empty() {
        nodes.push(0);
    }
    let mut tested = 0;
    for (height, level) in tree.levels.iter().enumerate().rev() {
        let count = match height {
            0 => tree.edges.div_ceil(WIDTH),
            _ => tree.levels[height - 1].len(),
        };
        children.clear();
        for &index in ahead(nodes, NODES_AHEAD, |&index| prefetch(&level[index as usize])) {
            let node = &level[index as usize];
            let test = NodeTest::new::<DUAL>(node, query);
            let live = (count - WIDTH * index as usize).min(WIDTH);
            tested += live as u64;
            let mut kept = test.kept & ((1 << live) - 1);
            while kept != 0 {
                let j = kept.trailing_zeros();
                let child = WIDTH as u32 * index + j;
                if height == 0 {
                    leaf(&test, node, child, j as usize);
                } else {
                    children.push(child);
                }
                kept &= kept - 1;
            }
        }
        std::mem::swap(nodes, children);
    }
    tested
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;

    use super::*;
    use crate::{BuildOptions, Contours};

    #[test]
    fn the_portable_search_finds_the_same_bits() {
        // A wavy sheet, wound at random in one corner.
        let side = 30;
        let positions: Arc<[Vec3]> = (0..side * side)
            .map(|i| ((i % side) as f32, (i / side) as f32))
            .map(|(x, y)| Vec3::new(x, y, 2.0 * (0.7 * x).sin() * (0.4 * y).cos()))
            .collect();
        let cells = (0..(side - 1) * (side - 1)).map(|i| i % (side - 1) + i / (side - 1) * side);
        let triangles: Arc<[[u32; 3]]> =
            cells.flat_map(|i| [[i, i + 1, i + side], [i + 1, i + side + 1, i + side]]).collect();
        let triangles = triangles.iter().map(|&[a, b, c]| if a % 7 < 2 { [b, a, c] } else { [a, b, c] }).collect();
        let tree = DualBvh::build(positions, triangles, &BuildOptions::default()).unwrap();
        let (mut candidates, mut portable) = (Candidates::default(), Candidates::default());
        let (mut contours, mut portable_contours) = (Contours::default(), Contours::default());
        for i in 0..40 {
            let p = DVec3::new(0.7 * f64::from(i), 11.3, 0.1 * f64::from(i % 5));
            let normal = (i % 2 == 0).then_some(DVec3::Z);
            let tile = Tile::new([(p, normal), (p + 0.01 * f64::from(i), normal)].into_iter());
            tree.search(&tile, &mut candidates);
            tree.search_inline(&tile, &mut portable);
            assert!(!candidates.edges().is_empty());
            assert_eq!(candidates.edges(), portable.edges());
            assert_eq!(candidates.incidences(), portable.incidences());
            assert_eq!(candidates.vertices(), portable.vertices());
            assert_eq!(candidates.faces(), portable.faces());
            assert_eq!(candidates.nodes_tested(), portable.nodes_tested());
            candidates.contours(p, &[3, 4], &mut contours);
            portable.contours_inline(p, &[3, 4], &mut portable_contours);
            assert_eq!(contours.signs(), portable_contours.signs());
            assert_eq!(contours.edges(), portable_contours.edges());
        }
    }
}
