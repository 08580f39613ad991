//! What is looked at: geometry, environment light, camera, scene files.

mod camera;
mod environment;
mod environment_file;
mod face_tree;
mod geometry;
mod load;
mod mesh;
mod mtl;
mod obj;
mod points;
mod polygon;
pub mod shapes;
mod sky;
mod topology;

use std::path::Path;

use glam::DAffine3;

pub use camera::Camera;
pub use environment::{Environment, UpAxis};
pub use face_tree::FaceTree;
pub use geometry::{Cleaning, Geometry, GeometryBuilder, MAX_COORDINATE, Material, VertexFaces};
pub use load::load_meshes;
pub use mesh::Mesh;
pub use points::{NORMAL_TOLERANCE, Point, load_points};
pub use sky::Sky;
pub use topology::{Direction, EdgeFace, EdgeId, EdgeKind, Topology, TriangleId, VertexId};

use crate::{Error, Result};

/// Everything a scene file describes.
#[derive(Clone, Debug)]
pub struct Scene {
    /// All triangles.
    pub geometry: Geometry,
}

impl Scene {
    /// The meshes of files, placed as they are, without light, camera or receivers other than the vertices.
    ///
    /// # Errors
    /// As [`load_meshes`] and [`GeometryBuilder::add`].
    pub fn from_meshes<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Result<Self> {
        let mut builder = GeometryBuilder::default();
        for path in paths {
            for mesh in load_meshes(&path)? {
                builder.add(mesh, DAffine3::IDENTITY).map_err(|e| Error::file(&path, e))?;
            }
        }
        Ok(Self { geometry: builder.build() })
    }
}
