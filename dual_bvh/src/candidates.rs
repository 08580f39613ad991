use glam::DVec3;

use crate::contours::{Contour, Contours};
use crate::face::{plane_value, sign};
use crate::numbering::Numbering;
use crate::search::Scratch;
use crate::{DualBvh, Incidence};

/// An edge that may be a contour for some receiver of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CandidateEdge {
    /// Start: an index into [`Candidates::vertices`]. Of the two ends, that of the smaller number in the mesh.
    pub a: u32,
    /// End, likewise.
    pub b: u32,
    /// Start of its faces in [`Candidates::incidences`].
    pub first: u32,
    /// Number of its faces.
    pub len: u32,
}

/// What a search found for a tile of receivers: the edges that may be contours for some of them, with the vertices and faces they
/// use, each once and numbered locally.
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
    pub(crate) edge_count: usize,
    pub(crate) incidences: Vec<Incidence>,
    pub(crate) incidence_count: usize,
    /// The first edges have two faces that run in opposite directions, that along the edge first.
    pub(crate) regular: usize,
    /// The next ones have one face.
    pub(crate) border: usize,
    pub(crate) nodes_tested: u64,
    pub(crate) edges_tested: u64,
    pub(crate) scratch: Scratch,
}

impl Candidates {
    /// Forgets everything and makes room for the numbers of another tree.
    pub(crate) fn clear(&mut self, bvh: &DualBvh) {
        self.vertices.clear(bvh.positions.len());
        self.faces.clear(bvh.triangles.len());
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

    /// The faces, by local number, of one edge.
    pub fn faces_of(&self, edge: &CandidateEdge) -> &[Incidence] {
        &self.incidences[edge.first as usize..(edge.first + edge.len) as usize]
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
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.contours_avx2(receiver, excluded, out) };
        }
        self.contours_inline(receiver, excluded, out);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn contours_avx2(&self, receiver: DVec3, excluded: &[u32], out: &mut Contours) {
        self.contours_inline(receiver, excluded, out);
    }

    #[inline(always)]
    pub(crate) fn contours_inline(&self, receiver: DVec3, excluded: &[u32], out: &mut Contours) {
        out.room(self.faces().len(), self.edges().len());
        let signs = &mut out.signs[..self.faces().len()];
        self.signs(receiver, signs);
        for &face in excluded {
            if let Some(local) = self.local_face(face) {
                signs[local as usize] = 0;
            }
        }

        // Every edge is written, contours stay: which they are is hard to predict.
        let buffer = &mut out.buffer[..self.edges().len()];
        let mut count = 0;
        let mut put = |edge: usize, jump: i32| {
            buffer[count] = Contour { edge: edge as u32, jump };
            count += usize::from(jump != 0);
        };
        let (regular, rest) = self.incidences().split_at(2 * self.regular);
        let border = &rest[..self.border];
        for (edge, uses) in regular.chunks_exact(2).enumerate() {
            put(edge, i32::from(signs[uses[0].face() as usize]) - i32::from(signs[uses[1].face() as usize]));
        }
        let jump = |use_: &Incidence| i32::from(use_.orientation()) * i32::from(signs[use_.face() as usize]);
        for (i, use_) in border.iter().enumerate() {
            put(self.regular + i, jump(use_));
        }
        for (edge, candidate) in self.edges().iter().enumerate().skip(self.regular + self.border) {
            put(edge, self.faces_of(candidate).iter().map(jump).sum());
        }
        out.count = count;
    }

    /// The sides of all faces on which the receiver lies.
    #[inline(always)]
    fn signs(&self, p: DVec3, signs: &mut [i8]) {
        let count = signs.len();
        let [nx, ny, nz] = &self.normals;
        let [ax, ay, az] = &self.anchors;
        let (nx, ny, nz) = (&nx[..count], &ny[..count], &nz[..count]);
        let (ax, ay, az) = (&ax[..count], &ay[..count], &az[..count]);
        for i in 0..count {
            let anchor = DVec3::new(f64::from(ax[i]), f64::from(ay[i]), f64::from(az[i]));
            signs[i] = sign(plane_value(DVec3::new(nx[i], ny[i], nz[i]), anchor, p));
        }
    }
}

/// Makes a buffer at least `len` long. What lies beyond the present length is garbage of earlier searches.
pub(crate) fn room<T: Clone + Default>(buffer: &mut Vec<T>, len: usize) {
    if buffer.len() < len {
        buffer.resize(len, T::default());
    }
}
