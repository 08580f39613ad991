use std::ops::Range;

use glam::DVec3;

use crate::choice::{All, Choice, Tally};
#[cfg(target_arch = "x86_64")]
use crate::choice::{Apart, OUTSIDE};
use crate::contours::{Contour, Contours};
#[cfg(target_arch = "x86_64")]
use crate::ends::CELLS;
use crate::ends::Ends;
use crate::face::{plane_value, sign};
use crate::numbering::Numbering;
#[cfg(target_arch = "x86_64")]
use crate::pairs::FACES;
use crate::pairs::Pairs;
use crate::search::Scratch;
use crate::{DualBvh, Incidence};

/// What a search found in one group: ranges of the candidates' numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Part {
    /// The group.
    pub group: u32,
    /// Its vertices.
    pub vertices: Range<usize>,
    /// Its faces.
    pub faces: Range<usize>,
    /// Its edges.
    pub edges: Range<usize>,
    /// Start of its incidences.
    pub(crate) first: usize,
    /// The first edges have two faces that run in opposite directions, that along the edge first.
    pub(crate) regular: usize,
    /// The next ones have one face.
    pub(crate) border: usize,
    /// What the first edges are divided into.
    pub(crate) blocks: Range<usize>,
    /// Tables of the edges' ends, where the processor can make use of them.
    pub(crate) tables: Range<usize>,
}

/// Whose contours are wanted, and in which parts, which follow one another.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub(crate) parts: &'a [Part],
    pub(crate) receiver: DVec3,
    pub(crate) excluded: &'a [u32],
}

/// Edges with two faces each in opposite directions, and their faces, which have numbers of their own in every block: so few, mostly,
/// that they fit into a table.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(crate) edges: Range<usize>,
    pub(crate) faces: Range<usize>,
}

impl Block {
    /// Whether the faces fit into a table, as they do but for many that must stay together: then the edges are among the [`Pairs`].
    #[cfg(target_arch = "x86_64")]
    pub(crate) fn is_paired(&self) -> bool {
        self.faces.len() <= FACES
    }
}

/// An edge that may be a contour for some receiver of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CandidateEdge {
    /// Start: an index into [`Candidates::vertices`]. Of the two ends, that of the smaller number in the mesh.
    pub a: u32,
    /// End, likewise.
    pub b: u32,
}

/// What a search found for a tile of receivers: the edges that may be contours for some of them, with the vertices and faces they
/// use, each once and numbered locally, group after group.
///
/// The order is the same for every search of the same tile. Keep one per thread and search into it again and again: all memory is
/// reused.
#[derive(Clone, Debug, Default)]
pub struct Candidates {
    // All buffers may be longer than what they hold.
    pub(crate) vertices: Numbering,
    /// Positions of the vertices, by component.
    pub(crate) positions: [Vec<f32>; 3],
    pub(crate) faces: Numbering,
    /// Normals of the faces, see [`crate::face_normal`], by component.
    pub(crate) normals: [Vec<f64>; 3],
    /// First corners of the faces, by component.
    pub(crate) anchors: [Vec<f32>; 3],
    pub(crate) edges: Vec<CandidateEdge>,
    /// Where the faces of every edge start among the incidences, with an end mark: apart, for few look there.
    pub(crate) uses: Vec<u32>,
    pub(crate) edge_count: usize,
    /// The faces of edges that have two in opposite directions, in parts of few faces, where the processor can make use of it.
    pub(crate) pairs: Pairs,
    /// The ends of all edges, likewise.
    pub(crate) ends: Ends,
    pub(crate) incidences: Vec<Incidence>,
    pub(crate) incidence_count: usize,
    pub(crate) blocks: Vec<Block>,
    pub(crate) parts: Vec<Part>,
    /// For every group the number of its part, plus one; zero if it has not been searched.
    part_of: Vec<u32>,
    pub(crate) nodes_tested: u64,
    pub(crate) edges_tested: u64,
    pub(crate) scratch: Scratch,
}

impl Candidates {
    /// Forgets everything and makes room for the numbers of another tree.
    pub(crate) fn clear(&mut self, bvh: &DualBvh) {
        self.vertices.clear(bvh.positions.len());
        self.faces.clear(bvh.triangles.len());
        (self.edge_count, self.incidence_count) = (0, 0);
        (self.nodes_tested, self.edges_tested) = (0, 0);
        self.blocks.clear();
        self.ends.clear();
        for part in self.parts.drain(..) {
            // Of a group of another tree, perhaps.
            if let Some(part_of) = self.part_of.get_mut(part.group as usize) {
                *part_of = 0;
            }
        }
        self.part_of.resize(bvh.groups(), 0);
    }

    /// Notes what was found in a group.
    pub(crate) fn push(&mut self, part: Part) {
        self.part_of[part.group as usize] = self.parts.len() as u32 + 1;
        self.parts.push(part);
    }

    /// What was found in every group that was searched, in the order of the searches.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// What was found in a group, if it has been searched.
    #[inline]
    pub fn part(&self, group: u32) -> Option<&Part> {
        self.parts.get((self.part_of[group as usize] as usize).wrapping_sub(1))
    }

    /// Numbers in the mesh of the candidates' vertices.
    pub fn vertices(&self) -> &[u32] {
        self.vertices.globals()
    }

    /// Position of a vertex by its local number.
    #[inline(always)]
    pub fn position(&self, vertex: u32) -> DVec3 {
        let [x, y, z] = &self.positions;
        let vertex = vertex as usize;
        DVec3::new(f64::from(x[vertex]), f64::from(y[vertex]), f64::from(z[vertex]))
    }

    /// Positions of all vertices, by component.
    #[inline(always)]
    pub fn coordinates(&self) -> [&[f32]; 3] {
        let count = self.vertices().len();
        [0, 1, 2].map(|axis| &self.positions[axis][..count])
    }

    /// Numbers in the mesh of the candidates' faces.
    pub fn faces(&self) -> &[u32] {
        self.faces.globals()
    }

    /// Normal of a face by its local number, see [`crate::face_normal`].
    pub fn normal(&self, face: u32) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|axis| self.normals[axis][face as usize]))
    }

    /// First corner of a face by its local number.
    pub fn anchor(&self, face: u32) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|axis| f64::from(self.anchors[axis][face as usize])))
    }

    /// The candidate edges.
    pub fn edges(&self) -> &[CandidateEdge] {
        &self.edges[..self.edge_count]
    }

    /// The faces, by local number, of all edges, one after the other.
    pub fn incidences(&self) -> &[Incidence] {
        &self.incidences[..self.incidence_count]
    }

    /// The faces, by local number, of one edge, an index into [`Candidates::edges`].
    pub fn faces_of(&self, edge: u32) -> &[Incidence] {
        let [start, end] = [0, 1].map(|next| self.uses[edge as usize + next] as usize);
        &self.incidences[start..end]
    }

    /// Local number of a face, if a candidate has it.
    pub fn local_face(&self, face: u32) -> Option<u32> {
        self.faces.get(face)
    }

    /// How many bounds of subtrees and leaves the search tested.
    pub fn nodes_tested(&self) -> u64 {
        self.nodes_tested
    }

    /// How many edges the search tested one by one.
    pub fn edges_tested(&self) -> u64 {
        self.edges_tested
    }

    /// Finds the contours of one receiver of the tile, leaving out the faces `excluded` (numbers in the mesh).
    ///
    /// The excluded faces must be among those the tile was given ([`crate::Tile::with_faces`]); otherwise the edges by which they
    /// hang together with the rest may be missing.
    pub fn contours(&self, receiver: DVec3, excluded: &[u32], out: &mut Contours) {
        self.contours_of(Asked { parts: &self.parts, receiver, excluded }, &mut All, out);
    }

    /// The same in one group, which has been searched.
    pub fn contours_in(&self, part: &Part, receiver: DVec3, excluded: &[u32], out: &mut Contours) {
        self.contours_of(Asked { parts: std::slice::from_ref(part), receiver, excluded }, &mut All, out);
    }

    /// The same, but only contours with ends in different cells, at least one of them not [`OUTSIDE`](crate::OUTSIDE), unless `all` are wanted; and
    /// how many there are. `cells` has a number for every vertex up to the last of this part, not negative and below 2^30, or marked.
    pub fn contours_apart(
        &self,
        part: &Part,
        cells: &[i32],
        all: bool,
        receiver: DVec3,
        excluded: &[u32],
        out: &mut Contours,
    ) -> Tally {
        #[cfg(target_arch = "x86_64")]
        if crate::features::has_lookup() && are_few(&cells[part.vertices.clone()]) {
            let mut divided = std::mem::take(&mut out.divided);
            // SAFETY: the processor has the features.
            unsafe { self.ends.divide(part.tables.clone(), cells, &mut divided) };
            let mut choice = Apart { divided: &divided, first: part.edges.start, all, tally: Tally::default() };
            self.contours_of(Asked { parts: std::slice::from_ref(part), receiver, excluded }, &mut choice, out);
            let tally = choice.tally;
            out.divided = divided;
            return tally;
        }
        self.contours_in(part, receiver, excluded, out);
        self.keep_apart(cells, all, out)
    }

    /// Counts contours, and unless `all` are wanted drops those with ends in one cell or [`OUTSIDE`](crate::OUTSIDE).
    pub(crate) fn keep_apart(&self, cells: &[i32], all: bool, out: &mut Contours) -> Tally {
        let (mut tally, mut count) = (Tally::default(), 0);
        let buffer = &mut out.buffer[..out.count];
        for i in 0..buffer.len() {
            let CandidateEdge { a, b } = self.edges[buffer[i].edge as usize];
            // All are written, those apart stay: which they are is hard to predict.
            buffer[count] = buffer[i];
            count += usize::from(tally.count([a, b].map(|end| cells[end as usize])) | all);
        }
        out.count = count;
        tally
    }

    fn contours_of(&self, asked: Asked, choice: &mut impl Choice, out: &mut Contours) {
        #[cfg(target_arch = "x86_64")]
        if crate::features::has_lookup() {
            // SAFETY: the processor has the features.
            return unsafe { self.contours_lookup(asked, choice, out) };
        } else if crate::has_avx512() {
            // SAFETY: the processor has the features.
            return unsafe { self.contours_avx512(asked, choice, out) };
        } else if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.contours_avx2(asked, choice, out) };
        }
        self.contours_inline::<false>(asked, choice, out);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx512vbmi,popcnt")]
    fn contours_lookup(&self, asked: Asked, choice: &mut impl Choice, out: &mut Contours) {
        self.contours_inline::<true>(asked, choice, out);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq")]
    pub(crate) fn contours_avx512(&self, asked: Asked, choice: &mut impl Choice, out: &mut Contours) {
        self.contours_inline::<false>(asked, choice, out);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    pub(crate) fn contours_avx2(&self, asked: Asked, choice: &mut impl Choice, out: &mut Contours) {
        self.contours_inline::<false>(asked, choice, out);
    }

    /// With `LOOKUP`, the processor must have the features of [`Pairs`].
    #[inline(always)]
    pub(crate) fn contours_inline<const LOOKUP: bool>(
        &self,
        asked: Asked,
        choice: &mut impl Choice,
        out: &mut Contours,
    ) {
        let Asked { parts, receiver, excluded } = asked;
        let (Some(first), Some(last)) = (parts.first(), parts.last()) else { return out.room(0, 0) };
        let faces = first.faces.start..last.faces.end;
        out.room(faces.end, last.edges.end - first.edges.start);
        let signs = &mut out.signs[..faces.end];
        self.signs(receiver, faces.start, &mut signs[faces.clone()]);
        // None of the faces from here on is excluded.
        let mut whole_from = faces.start;
        for &face in excluded {
            if let Some(local) = self.local_face(face).filter(|&local| faces.contains(&(local as usize))) {
                signs[local as usize] = 0;
                whole_from = whole_from.max(local as usize + 1);
            }
        }

        let buffer = &mut out.buffer[..];
        let mut count = 0;
        let jump = |use_: &Incidence| i32::from(use_.orientation()) * i32::from(signs[use_.face() as usize]);
        for part in parts {
            let (regular, rest) = self.incidences()[part.first..].split_at(2 * part.regular);
            let border = &rest[..part.border];
            let next = part.edges.start + part.regular;
            for block in &self.blocks[part.blocks.clone()] {
                let Block { edges, faces } = block;
                #[cfg(target_arch = "x86_64")]
                if LOOKUP && faces.start >= whole_from && block.is_paired() {
                    // SAFETY: the processor has the features.
                    count += unsafe {
                        self.pairs.contours(edges.clone(), &signs[faces.clone()], choice, &mut buffer[count..])
                    };
                    continue;
                }
                let uses = &regular[2 * (edges.start - part.edges.start)..];
                for (edge, uses) in edges.clone().zip(uses.chunks_exact(2)) {
                    let [f, g] = [0, 1].map(|side| i32::from(signs[uses[side].face() as usize]));
                    put(buffer, &mut count, edge, f - g, choice);
                }
            }
            for (edge, use_) in (next..).zip(border) {
                put(buffer, &mut count, edge, jump(use_), choice);
            }
            for edge in next + part.border..part.edges.end {
                put(buffer, &mut count, edge, self.faces_of(edge as u32).iter().map(jump).sum(), choice);
            }
        }
        out.count = count;
    }

    /// The sides of the faces from `first` on, on which the receiver lies.
    #[inline(always)]
    fn signs(&self, p: DVec3, first: usize, signs: &mut [i8]) {
        let count = signs.len();
        let [nx, ny, nz] = &self.normals;
        let [ax, ay, az] = &self.anchors;
        let (nx, ny, nz) = (&nx[first..][..count], &ny[first..][..count], &nz[first..][..count]);
        let (ax, ay, az) = (&ax[first..][..count], &ay[first..][..count], &az[first..][..count]);
        for i in 0..count {
            let anchor = DVec3::new(f64::from(ax[i]), f64::from(ay[i]), f64::from(az[i]));
            signs[i] = sign(plane_value(DVec3::new(nx[i], ny[i], nz[i]), anchor, p));
        }
    }
}

/// Whether there are so few cells that their numbers fit into tables.
#[cfg(target_arch = "x86_64")]
fn are_few(cells: &[i32]) -> bool {
    let mut digits = 0;
    for cell in cells {
        digits |= cell;
    }
    digits & !OUTSIDE < CELLS
}

/// Adds an edge, if it is a contour and chosen, to the first of a buffer.
#[inline(always)]
fn put(buffer: &mut [Contour], count: &mut usize, edge: usize, jump: i32, choice: &mut impl Choice) {
    // Every edge is written, contours stay: which they are is hard to predict.
    buffer[*count] = Contour { edge: edge as u32, jump };
    *count += usize::from(choice.has(edge, jump != 0));
}

/// Makes a buffer at least `len` long. What lies beyond the present length is garbage of earlier searches.
pub(crate) fn room<T: Clone + Default>(buffer: &mut Vec<T>, len: usize) {
    if buffer.len() < len {
        buffer.resize(len, T::default());
    }
}
