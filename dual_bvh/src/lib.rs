//! Contour edges of a triangle mesh from any point.
//!
//! Seen from a point, the *receiver*, an edge is a *contour* where the mesh turns from one side to the other: silhouettes, borders,
//! and whatever edges non-manifold meshes add. This crate finds them all, exactly: the tree never loses one, and nothing depends
//! on a tolerance. Line drawing, shadow volumes and visibility integrals start from here.
//!
//! ```
//! use dual_bvh::{BuildOptions, Candidates, Contours, DualBvh, Tile};
//! use glam::{DVec3, Vec3};
//!
//! // A tetrahedron, wound to face outwards.
//! let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
//! let triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
//! let tree = DualBvh::build(positions.into(), triangles.into(), &BuildOptions::default())?;
//!
//! // From far down the z axis the base is seen, three edges around it.
//! let receiver = DVec3::new(0.2, 0.2, -9.0);
//! let (mut candidates, mut contours) = (Candidates::default(), Contours::default());
//! tree.search(&Tile::lone(receiver, None), &mut candidates);
//! candidates.contours(receiver, &[], &mut contours);
//!
//! let edges = contours.edges().iter().map(|contour| {
//!     let edge = candidates.edges()[contour.edge as usize];
//!     [edge.a, edge.b].map(|end| candidates.vertices()[end as usize])
//! });
//! assert_eq!(edges.collect::<std::collections::BTreeSet<_>>(), [[0, 1], [0, 2], [1, 2]].into());
//! # Ok::<(), dual_bvh::Error>(())
//! ```
//!
//! # Conventions
//!
//! - The *sign* of a face (a, b, c) is +1 if n . (p - a) >= 0 for the receiver p, n = (b - a) x (c - a), otherwise -1: see
//!   [`face_sign`]. A face that the receiver leaves out, because it lies on it, has the sign 0.
//! - The *jump* of the edge a -> b is the sum of o s over its faces, with s the sign and o = +1 if the face runs from a to b in its
//!   winding, otherwise -1. The edge is a contour if its jump is not zero. Edges have any number of faces; the winding may change
//!   from face to face, the jumps do not depend on it but where the receiver lies in the plane of a face.
//! - The jump is the change of the number of surfaces that a ray from the receiver crosses, as the ray passes the edge from its
//!   left, where (a x b) . w > 0 for the direction w and the ends relative to the receiver, to its right. At every vertex the jumps
//!   of the contours that leave it and of those that arrive agree: contours are closed.
//!
//! # Method
//!
//! A receiver p sees a face from the front if its dual, the pair of its normal n and offset d, has n . p + d >= 0. An edge is no
//! contour if the planes of all its faces have p on the same side, so a box around many duals, in four dimensions, lets one test
//! reject many edges (Hertzmann and Zorin, 2000; Johnson and Cohen, 2001). Here the boxes are taken around an origin of their own,
//! which makes them tighter and free of cancellation; each node tests eight in single precision, with bounds on all rounding; and
//! a ball of neighbouring receivers, a [`Tile`], shares one search.

mod brute;
mod build;
mod candidates;
mod check;
mod choice;
mod collect;
mod contours;
mod divided;
mod dual;
mod edge;
mod ends;
mod error;
mod face;
mod features;
mod groups;
mod node;
mod numbering;
mod pairs;
mod prefetch;
mod query;
mod search;
mod statistics;
mod tile;

use std::sync::Arc;

use glam::Vec3;

pub use crate::brute::brute_force;
pub use crate::build::BuildOptions;
pub use crate::candidates::{CandidateEdge, Candidates, Part};
pub use crate::check::Defect;
pub use crate::choice::{OUTSIDE, Tally};
pub use crate::contours::{Contour, Contours};
pub use crate::edge::Incidence;
pub use crate::error::Error;
pub use crate::face::{face_normal, face_sign};
#[cfg(target_arch = "x86_64")]
pub use crate::features::has_avx512;
pub use crate::prefetch::prefetch;
pub use crate::statistics::Statistics;
pub use crate::tile::Tile;

/// A bounding volume hierarchy over the edges of a triangle mesh and the planes of their faces.
#[derive(Clone, Debug)]
pub struct DualBvh {
    positions: Arc<[Vec3]>,
    triangles: Arc<[[u32; 3]]>,
    /// Group by group, those of the balanced tree, then those of the unbalanced one.
    edges: edge::Edges,
    groups: Vec<groups::Group>,
    boxes: Vec<Vec<[Vec3; 2]>>,
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

    /// Number of groups: bodies that share no vertex with others, or several small ones that are near one another. No edge belongs
    /// to faces of two groups, so the contours of one are closed, and can be searched alone: [`DualBvh::search_group`].
    pub fn groups(&self) -> usize {
        self.groups.len()
    }

    /// The lowest and highest corners of the boxes around the groups; then of those around the groups 8 i to 8 i + 7, around eight
    /// of these, and so on up to one box. Empty without faces.
    pub fn group_boxes(&self) -> &[Vec<[Vec3; 2]>] {
        &self.boxes
    }

    /// The group of a face.
    ///
    /// Panics if there is no such face.
    pub fn group_of(&self, face: u32) -> u32 {
        let edge = self.edges.of_faces[face as usize][0];
        self.groups.partition_point(|group| group.first <= edge) as u32 - 1
    }

    /// Edges of a group.
    ///
    /// Panics if there is no such group.
    pub fn group_edges(&self, group: u32) -> std::ops::Range<u32> {
        self.groups[group as usize].edges()
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
