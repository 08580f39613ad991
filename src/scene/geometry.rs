use std::sync::Arc;

use glam::Vec3;

/// All triangles of a scene in world space: welded, cleaned, and kept exactly as loaded (f32, never re-centred).
#[derive(Clone, Debug)]
pub struct Geometry {
    /// Distinct vertex positions.
    pub positions: Arc<[Vec3]>,
    /// Vertex indices of every triangle; no triangle is degenerate, none occurs twice.
    pub triangles: Arc<[[u32; 3]]>,
    /// Index into `meshes` of every triangle.
    pub triangle_mesh: Vec<u32>,
    /// Index into `materials` of every triangle.
    pub triangle_material: Vec<u32>,
    /// Names of the meshes the triangles came from.
    pub meshes: Vec<String>,
    /// Materials.
    pub materials: Vec<Material>,
    /// What was dropped and merged on the way in.
    pub cleaning: Cleaning,
}

/// A diffuse material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the source file.
    pub name: String,
    /// Diffuse reflectance per colour, linear, in [0, 1].
    pub albedo: Vec3,
}

/// Counts of what assembling a [`Geometry`] dropped or merged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cleaning {
    /// Vertices merged into an earlier one with an equal position.
    pub welded_vertices: usize,
    /// Triangles of zero area dropped.
    pub degenerate_triangles: usize,
    /// Triangles dropped because an earlier one has the same three corners.
    pub duplicate_triangles: usize,
}
