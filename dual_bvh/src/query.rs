//! The search: from a tile of receivers to the edges that may be contours for some of them.
#![expect(clippy::needless_range_loop, reason = "lane by lane, over several arrays")]

use glam::DVec3;

use crate::candidates::{CandidateEdge, Candidates};
use crate::edge::Incidence;
use crate::face::{face_normal, plane_value};
use crate::node::{FAN, Lanes, Leaf, Node, SLACK, STEPS, Tree, WIDTH, up};
use crate::prefetch::{ahead, prefetch};
use crate::{DualBvh, Tile};

/// How many edges, leaves or faces ahead memory is asked for.
const AHEAD: usize = 16;

/// How many nodes ahead.
const NODES_AHEAD: usize = 3;

/// Working memory of a search.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    nodes: Vec<u32>,
    children: Vec<u32>,
    leaves: Vec<LeafHit>,
    hits: Vec<u32>,
    /// Vertices and faces of the found edges with two faces in opposite directions.
    regular: Vec<([u32; 2], [u32; 2])>,
    /// Vertices and faces of the found edges with one face.
    border: Vec<([u32; 2], Incidence)>,
    /// The other found edges.
    other: Vec<u32>,
    /// One bit an edge: set for edges of excluded faces, which are found without the tree.
    excluded: Vec<u8>,
}

/// A leaf whose bounds hold a contour, and what its edges' fractions are multiplied with.
#[derive(Clone, Copy, Debug)]
struct LeafHit {
    leaf: u32,
    base: f32,
    factors: [f32; 4],
    margin: f32,
}

/// A tile in single precision.
struct Query {
    /// The centre as the sum of two singles.
    high: [f32; 3],
    low: [f32; 3],
    /// Distance from the centre that the planes' values must exceed to be certain.
    margin: f32,
    horizon: Option<Horizon>,
}

struct Horizon {
    normal: [f32; 3],
    half: [f32; 3],
    /// Bound of the normals' absolute components.
    size: [f32; 3],
    margin: f32,
}

impl Query {
    fn new(tile: &Tile<'_>) -> Self {
        let high = tile.center.to_array().map(|x| x as f32);
        let low = (tile.center - DVec3::from_array(high.map(f64::from))).to_array().map(|x| x as f32);
        // What two singles leave of the centre, and what underflows.
        let rest = tile.center.abs().element_sum() / (1u64 << 48) as f64 + 64.0 * f64::from(f32::MIN_POSITIVE);
        let distance = (tile.radius + rest) * (1.0 + SLACK);
        let horizon = tile.horizon.map(|(low, high)| {
            let normal = (0.5 * (low + high)).to_array().map(|x| x as f32);
            let middle = DVec3::from_array(normal.map(f64::from));
            let half = (high - middle).max(middle - low);
            let size = middle.abs() + half;
            let slack = SLACK * size.element_sum();
            Horizon {
                normal,
                half: half.to_array().map(|x| up(x * (1.0 + SLACK) + slack)),
                size: size.to_array().map(|x| up(x * (1.0 + SLACK))),
                margin: up(distance * size.length() * (1.0 + SLACK) + f64::from(f32::MIN_POSITIVE)),
            }
        });
        Self { high, low, margin: up(distance), horizon }
    }
}

/// What the test of a node found: its children that may hold contours, and for those the terms their leaves go on with.
struct NodeTest {
    kept: u32,
    /// The receiver relative to the children's centres.
    q: [Lanes; 3],
    /// Plane values in the middle of the bounds.
    middle: Lanes,
    /// Half widths of the plane values, without the tile's margin.
    spread: Lanes,
}

impl NodeTest {
    /// A child is dropped if all its planes have the same sign from anywhere in the tile, |n . q + d| > spread + margin for the
    /// middle of its bounds, or if its box lies below all horizons, n . (x - p) < 0 for all x, p and n. See [`SLACK`] for the
    /// rounding; comparisons with an overflown term are false and keep the child.
    #[inline(always)]
    fn new<const DUAL: bool>(node: &Node, query: &Query) -> Self {
        let mut q = [[0.0; WIDTH]; 3];
        for axis in 0..3 {
            for j in 0..WIDTH {
                q[axis][j] = (query.high[axis] - node.center[axis][j]) + query.low[axis];
            }
        }
        let (mut middle, mut spread) = ([0.0; WIDTH], [0.0; WIDTH]);
        let mut dropped = [false; WIDTH];
        if DUAL {
            for j in 0..WIDTH {
                let [x, y, z] = [q[0][j], q[1][j], q[2][j]];
                let [nx, ny, nz] = &node.normal;
                let [hx, hy, hz] = &node.normal_half;
                middle[j] = nx[j] * x + ny[j] * y + nz[j] * z + node.offset[j];
                spread[j] = hx[j] * x.abs() + hy[j] * y.abs() + hz[j] * z.abs() + node.offset_half[j];
                dropped[j] = middle[j].abs() > spread[j] + query.margin;
            }
        }
        if let Some(Horizon { normal: [nx, ny, nz], half: [hx, hy, hz], size: [sx, sy, sz], margin }) = &query.horizon {
            let [bx, by, bz] = &node.half;
            for j in 0..WIDTH {
                let [x, y, z] = [q[0][j], q[1][j], q[2][j]];
                let depth = nx * x + ny * y + nz * z;
                let reach = (sx * bx[j] + sy * by[j] + sz * bz[j]) + (hx * x.abs() + hy * y.abs() + hz * z.abs());
                dropped[j] |= depth > reach + margin;
            }
        }
        Self { kept: !bits(&dropped), q, middle, spread }
    }

    /// The terms of child `j`, a leaf.
    ///
    /// A plane's fractions are rounded to the grid by at most half a step, in sum at most spread / (2 STEPS). Rounding of its value
    /// is at most 16 u (|q|_1 + |d| + spread), and 2^-12 spread pays for the plane itself.
    #[inline(always)]
    fn leaf(&self, leaf: u32, j: usize, node: &Node, query: &Query) -> LeafHit {
        const GRID: f32 = 0.5 / STEPS + 1.0 / 4096.0 + SLACK as f32;
        let [x, y, z] = [self.q[0][j], self.q[1][j], self.q[2][j]];
        let rounding = SLACK as f32 * (x.abs() + y.abs() + z.abs() + node.offset[j].abs());
        LeafHit {
            leaf,
            base: self.middle[j],
            factors: [
                node.normal_half[0][j] * x * (1.0 / STEPS),
                node.normal_half[1][j] * y * (1.0 / STEPS),
                node.normal_half[2][j] * z * (1.0 / STEPS),
                node.offset_half[j] * (1.0 / STEPS),
            ],
            margin: query.margin + GRID * self.spread[j] + rounding,
        }
    }
}

impl LeafHit {
    /// The edges whose planes are not both certain and of the same sign.
    #[inline(always)]
    fn test(&self, leaf: &Leaf) -> u32 {
        let mut values = [[0.0; WIDTH]; 2];
        for (values, [kx, ky, kz, kd]) in values.iter_mut().zip(&leaf.planes) {
            let [fx, fy, fz, fd] = self.factors;
            for j in 0..WIDTH {
                values[j] = self.base
                    + fx * f32::from(kx[j])
                    + fy * f32::from(ky[j])
                    + fz * f32::from(kz[j])
                    + fd * f32::from(kd[j]);
            }
        }
        let mut dropped = [false; WIDTH];
        for j in 0..WIDTH {
            let (v, w, m) = (values[0][j], values[1][j], self.margin);
            let certain = (v > m) & (w > m) | (v < -m) & (w < -m);
            dropped[j] = certain & (leaf.planes[0][3][j] != FAN);
        }
        !bits(&dropped)
    }
}

/// One bit a lane.
#[inline(always)]
fn bits(lanes: &[bool; WIDTH]) -> u32 {
    let mut bits = [0u32; WIDTH];
    for j in 0..WIDTH {
        bits[j] = if lanes[j] { 1 << j } else { 0 };
    }
    bits.iter().fold(0, |all, bit| all | bit)
}

/// The side of a plane, through `anchor` with normal `n` of any length, on which all of a tile lies; none if that is not certain.
#[inline(always)]
pub(crate) fn certain_sign(tile: &Tile<'_>, n: DVec3, anchor: DVec3) -> Option<i8> {
    let value = plane_value(n, anchor, tile.center);
    // Rounding of the value, at the centre and at the receiver, is below 16 units of roundoff of the length of its terms.
    let arm = (tile.center - anchor).abs().element_sum() + tile.radius;
    let bound = n.length() * (tile.radius + 16.0 * f64::EPSILON * arm) + f64::MIN_POSITIVE;
    (value.abs() > bound).then(|| crate::face::sign(value))
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
        let mut append = |edges: std::ops::Range<usize>| {
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

    /// Turns the hits into candidates, in simple passes, each of which lets many loads overlap.
    #[inline(always)]
    fn collect(&self, tile: &Tile<'_>, scratch: &mut Scratch, out: &mut Candidates) {
        let Scratch { hits, regular, border, other, .. } = scratch;
        regular.clear();
        border.clear();
        other.clear();
        for &edge in ahead(hits, AHEAD, |&edge| prefetch(&self.edges.records[edge as usize])) {
            let record = self.edges.records[edge as usize];
            if let Some(faces) = record.regular() {
                regular.push((record.vertices(), faces));
            } else if let Some(use_) = record.lone() {
                border.push((record.vertices(), use_));
            } else if !record.fan().is_some_and(|fan| self.is_fan_certain(tile, &self.edges.fans[fan])) {
                other.push(edge);
            }
        }
        out.regular = regular.len();
        out.border = border.len();
        out.edge_count = regular.len() + border.len() + other.len();

        room(&mut out.edges, out.edge_count);
        out.vertices.reserve(2 * out.edge_count + 1);
        let (pairs, rest) = out.edges.split_at_mut(out.regular);
        let (lone, rest) = rest.split_at_mut(out.border);
        let mut first = 0;
        for i in 0..regular.len() {
            if let Some(&([a, b], _)) = regular.get(i + AHEAD) {
                out.vertices.prefetch(a);
                out.vertices.prefetch(b);
            }
            let ([a, b], _) = regular[i];
            pairs[i] = CandidateEdge { a: out.vertices.insert(a), b: out.vertices.insert(b), first, len: 2 };
            first += 2;
        }
        for (edge, &([a, b], _)) in lone.iter_mut().zip(&*border) {
            *edge = CandidateEdge { a: out.vertices.insert(a), b: out.vertices.insert(b), first, len: 1 };
            first += 1;
        }
        for (edge, &other) in rest.iter_mut().zip(&*other) {
            let [a, b] = self.edges.records[other as usize].vertices();
            let len = self.edges.incidences(other).len() as u32;
            *edge = CandidateEdge { a: out.vertices.insert(a), b: out.vertices.insert(b), first, len };
            first += len;
        }

        out.incidence_count = first as usize;
        room(&mut out.incidences, out.incidence_count);
        out.faces.reserve(out.incidence_count + 1);
        let (pairs, rest) = out.incidences.split_at_mut(2 * out.regular);
        let (lone, rest) = rest.split_at_mut(out.border);
        for i in 0..regular.len() {
            if let Some(&(_, [f, g])) = regular.get(i + AHEAD) {
                out.faces.prefetch(f);
                out.faces.prefetch(g);
            }
            let (_, [f, g]) = regular[i];
            pairs[2 * i] = Incidence::new(out.faces.insert(f), false);
            pairs[2 * i + 1] = Incidence::new(out.faces.insert(g), true);
        }
        let number =
            |(local, use_): (&mut Incidence, Incidence)| *local = use_.with_face(out.faces.insert(use_.face()));
        let others = other.iter().flat_map(|&edge| self.edge_faces(edge));
        lone.iter_mut().zip(border.iter().map(|&(_, use_)| use_)).chain(rest.iter_mut().zip(others)).for_each(number);

        let vertices = out.vertices.globals();
        room(&mut out.positions, vertices.len());
        let vertices = ahead(vertices, AHEAD, |&vertex| prefetch(&self.positions[vertex as usize]));
        for (position, &vertex) in out.positions.iter_mut().zip(vertices) {
            *position = self.positions[vertex as usize].as_dvec3();
        }
        self.collect_planes(out);
    }

    #[inline(always)]
    fn collect_planes(&self, out: &mut Candidates) {
        let faces = out.faces.globals();
        let triangles = ahead(faces, 2 * AHEAD, |&face| prefetch(&self.triangles[face as usize]));
        let corners = ahead(faces, AHEAD, |&face| {
            self.triangles[face as usize].iter().for_each(|&corner| prefetch(&self.positions[corner as usize]));
        });
        out.normals.iter_mut().for_each(|lanes| room(lanes, faces.len()));
        out.anchors.iter_mut().for_each(|lanes| room(lanes, faces.len()));
        let [nx, ny, nz] = &mut out.normals;
        let [ax, ay, az] = &mut out.anchors;
        for (i, (&face, _)) in triangles.zip(corners).enumerate() {
            let [a, b, c] = self.triangles[face as usize];
            let a = self.positions[a as usize];
            let n = face_normal(a, self.positions[b as usize], self.positions[c as usize]);
            (nx[i], ny[i], nz[i]) = (n.x, n.y, n.z);
            (ax[i], ay[i], az[i]) = (a.x, a.y, a.z);
        }
    }

    /// Whether a fan is certain to be no contour, unless one of its faces is excluded.
    fn is_fan_certain(&self, tile: &Tile<'_>, fan: &[Incidence]) -> bool {
        if !tile.excluded().is_empty() && fan.iter().any(|use_| tile.excluded().contains(&use_.face())) {
            return false;
        }
        let jump = fan.iter().try_fold(0, |jump, use_| {
            let [a, b, c] = self.triangles[use_.face() as usize].map(|vertex| self.positions[vertex as usize]);
            let sign = certain_sign(tile, face_normal(a, b, c), a.as_dvec3())?;
            Some(jump + i32::from(use_.orientation()) * i32::from(sign))
        });
        jump == Some(0)
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
    fn edges_of(&self, faces: &[u32]) -> impl Iterator<Item = u32> {
        faces.iter().filter_map(|&face| self.edges.of_faces.get(face as usize)).flatten().copied()
    }
}

impl Candidates {
    fn clear(&mut self, bvh: &DualBvh) {
        self.vertices.clear(bvh.positions.len());
        self.faces.clear(bvh.triangles.len());
    }
}

/// Makes a buffer at least `len` long. What lies beyond the present length is garbage of earlier searches.
fn room<T: Clone + Default>(buffer: &mut Vec<T>, len: usize) {
    if buffer.len() < len {
        buffer.resize(len, T::default());
    }
}
