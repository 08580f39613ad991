use glam::Vec3;

use super::Material;

/// An indexed triangle mesh in its own space, as read from a file or generated, before it joins a
/// [`Geometry`](super::Geometry).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Name in the source file, or the name of the shape.
    pub name: String,
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Indices into `positions`, counter-clockwise seen from outside where the source knows an outside.
    pub triangles: Vec<[u32; 3]>,
    /// The material of all its triangles.
    pub material: Material,
}

impl Mesh {
    /// A mesh with the default material.
    pub fn new(name: impl Into<String>, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        Self { name: name.into(), positions, triangles, material: Material::default() }
    }
}
