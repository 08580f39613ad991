use glam::DVec3;

use crate::Incidence;
use crate::contours::{Contour, Contours};
use crate::face::{plane_value, sign};
use crate::numbering::Numbering;
use crate::query::Scratch;

/// An edge that may be a contour for some receiver of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    pub(crate) vertices: Numbering,
    pub(crate) positions: Vec<DVec3>,
    pub(crate) faces: Numbering,
    /// Normals of the faces, see [`crate::face_normal`], by component.
    pub(crate) normals: [Vec<f64>; 3],
    /// First corners of the faces, by component.
    pub(crate) anchors: [Vec<f32>; 3],
    pub(crate) edges: Vec<CandidateEdge>,
    pub(crate) incidences: Vec<Incidence>,
    /// The first edges have two faces that run in opposite directions, that along the edge first.
    pub(crate) regular: usize,
    pub(crate) nodes_tested: u64,
    pub(crate) edges_tested: u64,
    pub(crate) scratch: Scratch,
}

impl Candidates {
    /// Numbers in the mesh of the candidates' vertices.
    pub fn vertices(&self) -> &[u32] {
        self.vertices.globals()
    }

    /// Positions of the vertices.
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
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
        &self.edges
    }

    /// The faces, by local number, of all edges, one after the other.
    pub fn incidences(&self) -> &[Incidence] {
        &self.incidences
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
    fn contours_inline(&self, receiver: DVec3, excluded: &[u32], out: &mut Contours) {
        let Contours { signs, buffer, len } = out;
        signs.clear();
        signs.resize(self.faces().len(), 0);
        self.signs(receiver.to_array(), signs);
        for &face in excluded {
            if let Some(local) = self.local_face(face) {
                signs[local as usize] = 0;
            }
        }

        if buffer.len() < self.edges.len() {
            buffer.resize(self.edges.len(), Contour::default());
        }
        let mut found = 0;
        let (regular, rest) = self.incidences.split_at(2 * self.regular);
        for (edge, pair) in regular.chunks_exact(2).enumerate() {
            let jump = signs[pair[0].face() as usize] - signs[pair[1].face() as usize];
            buffer[found] = Contour { edge: edge as u32, jump: i32::from(jump) };
            found += usize::from(jump != 0);
        }
        let offset = regular.len();
        for (edge, candidate) in self.edges.iter().enumerate().skip(self.regular) {
            let first = candidate.first as usize - offset;
            let jump = rest[first..first + candidate.len as usize]
                .iter()
                .map(|use_| i32::from(use_.orientation()) * i32::from(signs[use_.face() as usize]))
                .sum();
            buffer[found] = Contour { edge: edge as u32, jump };
            found += usize::from(jump != 0);
        }
        *len = found;
    }

    /// The sides of all faces on which the receiver lies.
    #[inline(always)]
    fn signs(&self, p: [f64; 3], signs: &mut [i8]) {
        let count = signs.len();
        let [nx, ny, nz] = self.normals.each_ref().map(|lanes| &lanes[..count]);
        let [ax, ay, az] = self.anchors.each_ref().map(|lanes| &lanes[..count]);
        for i in 0..count {
            let anchor = [ax[i], ay[i], az[i]].map(f64::from);
            signs[i] = sign(plane_value([nx[i], ny[i], nz[i]], anchor, p));
        }
    }
}
