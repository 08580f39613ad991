use glam::{DAffine3, Vec3};

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

    /// The mesh moved by `transform`: applied in f64, then rounded; the identity changes no bit but the sign of zeros.
    ///
    /// A transform that mirrors also turns the triangles round, so that what was counter-clockwise from outside stays so.
    pub fn transformed(mut self, transform: DAffine3) -> Self {
        self.positions.iter_mut().for_each(|p| *p = transform.transform_point3(p.as_dvec3()).as_vec3());
        if transform.matrix3.determinant() < 0.0 {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        self
    }

    /// Appends the triangles of another mesh; name and material stay.
    pub fn append(&mut self, other: &Self) {
        let base = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| base + v)));
    }
}
