//! The search: from a tile of receivers to the edges that may be contours for some of them.

use std::ops::Range;

use glam::DVec3;

use crate::candidates::{Candidates, room};
use crate::edge::Incidence;
use crate::groups::Group;
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
    /// The first hits, of excluded faces.
    pub(crate) excluded_hits: usize,
    /// Vertices and faces of the found edges with two faces in opposite directions.
    pub(crate) regular: Vec<([u32; 2], [u32; 2])>,
    /// Vertices and faces of the found edges with one face.
    pub(crate) border: Vec<([u32; 2], Incidence)>,
    /// The other found edges.
    pub(crate) other: Vec<u32>,
    /// The excluded faces by group, in the order in which they were given.
    excluded_faces: Vec<(u32, u32, u32)>,
    /// One bit an edge of the group being searched: set for edges of excluded faces, which are found without the tree.
    excluded: Vec<u8>,
}

impl Scratch {
    /// Sorts the excluded faces into their groups.
    fn sort_excluded(&mut self, bvh: &DualBvh, tile: &Tile<'_>) {
        self.excluded_faces.clear();
        let faces = tile.excluded().iter().filter(|&&face| (face as usize) < bvh.triangles.len());
        self.excluded_faces.extend((0..).zip(faces).map(|(i, &face)| (bvh.group_of(face), i, face)));
        self.excluded_faces.sort_unstable();
    }

    /// Marks the edges of the group's excluded faces and makes them the first hits.
    fn exclude(&mut self, bvh: &DualBvh, group: u32, tile: &Tile<'_>) {
        let Self { hits, excluded_hits, excluded, excluded_faces, .. } = self;
        hits.clear();
        excluded.clear();
        let edges = bvh.group_edges(group);
        let mut mark = |face: u32| {
            excluded.resize(edges.len().div_ceil(8), 0);
            for edge in bvh.face_edges(face) {
                let local = (edge - edges.start) as usize;
                let (bits, bit) = (&mut excluded[local / 8], 1 << (local % 8));
                if *bits & bit == 0 {
                    *bits |= bit;
                    hits.push(edge);
                }
            }
        };
        if tile.excluded().len() < excluded_faces.len() {
            // The few of a part of the tile.
            let faces = tile.excluded().iter().filter(|&&face| (face as usize) < bvh.triangles.len());
            faces.filter(|&&face| bvh.group_of(face) == group).for_each(|&face| mark(face));
        } else {
            let [start, end] = [group, group + 1].map(|group| excluded_faces.partition_point(|face| face.0 < group));
            excluded_faces[start..end].iter().for_each(|&(_, _, face)| mark(face));
        }
        *excluded_hits = hits.len();
    }
}

impl DualBvh {
    /// Finds the candidates of a tile: all edges that are contours for some receiver in its ball, but those below the horizon of
    /// every receiver, and all edges of the excluded faces. What `out` held is replaced; nothing is allocated once its memory has
    /// grown to the size that the searches need.
    pub fn search(&self, tile: &Tile<'_>, out: &mut Candidates) {
        self.begin(tile, out);
        (0..self.groups() as u32).for_each(|group| self.search_group(group, tile, out));
    }

    /// Begins the search for a tile, whose candidates are then found group by group, in any order: none yet.
    pub fn begin(&self, tile: &Tile<'_>, out: &mut Candidates) {
        out.clear(self);
        out.scratch.sort_excluded(self, tile);
    }

    /// Finds the candidates in one group for a tile for which the search was [begun](DualBvh::begin), or for a part of that tile
    /// that excludes some of the same faces. If the group has been searched before, it is the newer [part](Candidates::part) that
    /// counts, but the older one is still there.
    pub fn search_group(&self, group: u32, tile: &Tile<'_>, out: &mut Candidates) {
        self.search_few(group, tile, usize::MAX, out);
    }

    /// The same, but only if there are at most so many edges that the tree does not rule out; returns their number.
    pub fn search_few(&self, group: u32, tile: &Tile<'_>, most: usize, out: &mut Candidates) -> usize {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.search_avx2(group, tile, most, out) };
        }
        self.search_inline(group, tile, most, out)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn search_avx2(&self, group: u32, tile: &Tile<'_>, most: usize, out: &mut Candidates) -> usize {
        self.search_inline(group, tile, most, out)
    }

    /// Makes every edge a candidate, for receivers anywhere: the twin of [`DualBvh::search`] without the tree, which finds the same
    /// contours, and does it faster in small meshes if it serves many receivers.
    pub fn all_edges(&self, out: &mut Candidates) {
        out.clear(self);
        let mut scratch = std::mem::take(&mut out.scratch);
        let mut everywhere = Tile::lone(DVec3::ZERO, None);
        (everywhere.radius, everywhere.half) = (f64::INFINITY, DVec3::INFINITY);
        for group in 0..self.groups() as u32 {
            scratch.hits.clear();
            scratch.hits.extend(self.group_edges(group));
            // Receivers may exclude any.
            scratch.excluded_hits = scratch.hits.len();
            self.collect(group, &everywhere, &mut scratch, out);
        }
        (out.nodes_tested, out.edges_tested) = (0, self.edge_count() as u64);
        out.scratch = scratch;
    }

    #[inline(always)]
    fn search_inline(&self, group: u32, tile: &Tile<'_>, most: usize, out: &mut Candidates) -> usize {
        let query = Query::new(tile);
        let mut scratch = std::mem::take(&mut out.scratch);
        scratch.exclude(self, group, tile);
        let searched = &self.groups[group as usize];
        let [nodes, edges] = searched.balanced_hits(&query, &mut scratch);
        let unbalanced = searched.unbalanced_hits(&query, &mut scratch);
        out.nodes_tested += nodes + unbalanced;
        out.edges_tested += edges;
        let count = scratch.hits.len();
        if count <= most {
            self.collect(group, tile, &mut scratch, out);
        }
        out.scratch = scratch;
        count
    }
}

impl Group {
    /// Appends the edges of the balanced tree to the hits. Returns the numbers of bounds and of edges tested.
    #[inline(always)]
    fn balanced_hits(&self, query: &Query, scratch: &mut Scratch) -> [u64; 2] {
        let Scratch { nodes, children, leaves, hits, excluded, .. } = scratch;
        leaves.clear();
        let tested = descend::<true>(&self.balanced, query, nodes, children, |test, node, leaf, j| {
            leaves.push(test.leaf(leaf, j, node));
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
                hits[next] = self.first + (WIDTH * hit.leaf as usize + j) as u32;
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
        let before = self.balanced.edges;
        let mut append = |edges: Range<usize>| {
            for edge in before + edges.start..before + edges.end {
                if excluded.get(edge / 8).is_none_or(|bits| bits >> (edge % 8) & 1 == 0) {
                    hits.push(self.first + edge as u32);
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
    use crate::candidates::Asked;
    use crate::choice::{All, OUTSIDE};
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
            tree.begin(&tile, &mut portable);
            for group in 0..tree.groups() as u32 {
                tree.search_inline(group, &tile, usize::MAX, &mut portable);
            }
            assert!(!candidates.edges().is_empty());
            assert_eq!(candidates.edges(), portable.edges());
            assert_eq!(candidates.incidences(), portable.incidences());
            assert_eq!(candidates.vertices(), portable.vertices());
            assert_eq!(candidates.faces(), portable.faces());
            assert_eq!(candidates.nodes_tested(), portable.nodes_tested());
            // Cells at random, some marked.
            let cells: Vec<i32> = (0..candidates.vertices().len() as i32)
                .map(|vertex| vertex.wrapping_mul(0x9e37) >> 3 & 3 | if vertex % 3 == 0 { OUTSIDE } else { 0 })
                .collect();
            for part in candidates.parts() {
                let tally = candidates.contours_apart(part, &cells, false, p, &[3, 4], &mut contours);
                let asked = Asked { parts: std::slice::from_ref(part), receiver: p, excluded: &[3, 4] };
                portable.contours_inline::<false>(asked, &mut All, &mut portable_contours);
                assert_eq!(portable.keep_apart(&cells, false, &mut portable_contours), tally);
                assert_eq!(contours.edges(), portable_contours.edges());
                assert!(0 < tally.apart && tally.apart < tally.inside && tally.inside < tally.contours);
            }
            for excluded in [&[][..], &[3, 4]] {
                candidates.contours(p, excluded, &mut contours);
                let agree = |portable: &Contours| {
                    assert_eq!(contours.signs(), portable.signs());
                    assert_eq!(contours.edges(), portable.edges());
                };
                let asked = Asked { parts: portable.parts(), receiver: p, excluded };
                portable.contours_inline::<false>(asked, &mut All, &mut portable_contours);
                agree(&portable_contours);
                #[cfg(target_arch = "x86_64")]
                if is_x86_feature_detected!("avx2") {
                    // SAFETY: the processor has the feature.
                    unsafe { portable.contours_avx2(asked, &mut All, &mut portable_contours) };
                    agree(&portable_contours);
                }
                #[cfg(target_arch = "x86_64")]
                if crate::has_avx512() {
                    // SAFETY: the processor has the features.
                    unsafe { portable.contours_avx512(asked, &mut All, &mut portable_contours) };
                    agree(&portable_contours);
                }
            }
        }
    }
}
