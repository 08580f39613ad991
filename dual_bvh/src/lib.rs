//! Contour edges of a triangle mesh from any point.

mod brute;
mod build;
mod candidates;
mod check;
mod contours;
mod dual;
mod edge;
mod error;
mod face;
mod node;
mod numbering;
mod query;
mod statistics;
mod tile;

use std::sync::Arc;

use glam::Vec3;

pub use crate::brute::brute_force;
pub use crate::build::BuildOptions;
pub use crate::candidates::{CandidateEdge, Candidates};
pub use crate::check::Defect;
pub use crate::contours::{Contour, Contours};
pub use crate::edge::Incidence;
pub use crate::error::Error;
pub use crate::face::{face_normal, face_sign};
pub use crate::statistics::Statistics;
pub use crate::tile::Tile;

/// A bounding volume hierarchy over the edges of a triangle mesh and the planes of their faces.
#[derive(Clone, Debug)]
pub struct DualBvh {
    positions: Arc<[Vec3]>,
    triangles: Arc<[[u32; 3]]>,
    /// Those of the balanced tree, then those of the unbalanced one.
    edges: edge::Edges,
    /// Edges with an even number of faces: no contours where all flipped planes have the same sign.
    balanced: node::Tree,
    /// Edges with an odd number of faces: contours for every receiver.
    unbalanced: node::Tree,
}

impl DualBvh {
    /// Vertices.
    pub fn positions(&self) -> &Arc<[Vec3]> {
        &self.positions
    }

    /// Corners of the faces.
    pub fn triangles(&self) -> &Arc<[[u32; 3]]> {
        &self.triangles
    }

    /// Number of edges.
    pub fn edge_count(&self) -> usize {
        self.edges.records.len()
    }

    /// Vertices of an edge, the smaller number first.
    ///
    /// Panics if there is no such edge.
    pub fn edge_vertices(&self, edge: u32) -> [u32; 2] {
        self.edges.records[edge as usize].vertices()
    }

    /// Faces of an edge.
    ///
    /// Panics if there is no such edge.
    pub fn edge_faces(&self, edge: u32) -> impl ExactSizeIterator<Item = Incidence> {
        let uses = self.edges.incidences(edge);
        (0..uses.len()).map(move |i| uses[i])
    }

    /// Edges of a face: from its first corner to the second, from there to the third, and back.
    ///
    /// Panics if there is no such face.
    pub fn face_edges(&self, face: u32) -> [u32; 3] {
        self.edges.of_faces[face as usize]
    }
}
