//! What is looked at: geometry, environment light, camera, receivers; loaders, built-in shapes and scene files.

mod body;
mod builtin;
mod camera;
mod environment;
mod environment_file;
mod face_groups;
mod face_tree;
mod file;
mod geometry;
pub(crate) mod gltf;
pub(crate) mod gltf_read;
mod incidence;
mod load;
mod mesh;
mod morton;
mod mtl;
pub(crate) mod npy;
mod obj;
mod ply;
mod points;
mod polygon;
pub mod shapes;
mod sky;
mod topology;
mod walker;

use std::path::Path;

use glam::DAffine3;

pub use body::{Body, SkinnedBody};
pub use camera::Camera;
pub use environment::{Environment, UpAxis};
pub use face_tree::FaceTree;
pub(crate) use face_tree::grow_tree;
pub use file::ReceiverSource;
pub use geometry::{Cleaning, Geometry, GeometryBuilder, MAX_COORDINATE, Material, VertexFaces};
pub use incidence::faces_at;
pub use load::load_meshes;
pub use mesh::Mesh;
pub use points::{NORMAL_TOLERANCE, Point, PointReader, load_points, survey_points};
pub use sky::Sky;
pub use topology::{Direction, EdgeFace, EdgeId, EdgeKind, Topology, TriangleId, VertexId};
pub use walker::Walker;

use crate::{Error, Result};

/// Everything a scene file describes.
#[derive(Clone, Debug)]
pub struct Scene {
    /// All triangles.
    pub geometry: Geometry,
    /// Light from afar.
    pub environment: Option<Environment>,
    /// Who looks.
    pub camera: Option<Camera>,
    /// Where light is to be gathered.
    pub receivers: ReceiverSource,
    /// Bodies that move, for the renderer of sphere proxies alone; the geometry stands still.
    pub characters: Vec<Body>,
}

impl Scene {
    /// Reads a scene file (`.toml`) or a single mesh file (as [`load_meshes`]).
    ///
    /// # The scene file
    /// Tables in TOML; paths are relative to the file. All lengths are in the scene's own unit, angles in degrees, y is up
    /// in the built-in shapes.
    ///
    /// ```toml
    /// receivers = "vertices"             # or "pixels", or { points = "points.npy" }
    ///
    /// [[mesh]]                           # any number of them
    /// file = "bunny.obj"                 # a mesh file, or a built-in shape:
    /// # shape.torus_knot = { windings = [2, 3], triangles = 4000 }
    /// name = "bunny"
    /// scale = 2.0                        # or one factor per axis; then
    /// rotate = { axis = [0, 1, 0], degrees = 90 }
    /// translate = [0, 1, 0]              # scaled first, translated last
    /// albedo = [0.8, 0.5, 0.3]           # or one number; replaces the file's materials
    ///
    /// [environment]
    /// file = "studio.exr"                # or sky = { elevation = 40 }, or constant = 1.0
    /// up = "y"                           # see Environment::oriented
    /// rotation = 30
    ///
    /// [camera]
    /// position = [0, 2, 6]
    /// look_at = [0, 1, 0]
    /// up = [0, 1, 0]
    /// fov = 45                           # vertical
    /// resolution = [640, 480]
    ///
    /// [[character]]                      # bodies that move, for `animate` and `judge`; any number of them
    /// walker = { center = [0, 0, 0], circle = 2.0, spheres = 50, albedo = [0.7, 0.4, 0.3] }
    ///
    /// [[character]]
    /// file = "knight.glb"                # skinned; its spheres are fitted, or read: set = "knight.json"
    /// clip = "Walking_A"
    /// translate = [1, 0, 0]
    /// ```
    ///
    /// The shapes and their parameters are those of [`shapes`]: `plane`, `box`, `icosphere`, `torus_knot`, `knots`,
    /// `teapot`, `foliage`, `room`, `building`; the sky's those of [`Sky`],
    /// the walker's those of [`Walker`], a character's those of [`SkinnedBody`].
    ///
    /// # Errors
    /// A file that is missing or malformed, an unknown key or a value out of its domain: the line is named. As
    /// [`load_meshes`], [`Environment::load`] and [`load_points`] for the files it names.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        match path.extension() {
            Some(extension) if extension.eq_ignore_ascii_case("toml") => file::load(path),
            _ => Self::from_meshes([path]),
        }
    }

    /// The meshes of files, placed as they are, without light or camera; the receivers are the vertices.
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
        Ok(Self {
            geometry: builder.build(),
            environment: None,
            camera: None,
            receivers: ReceiverSource::Vertices,
            characters: Vec::new(),
        })
    }

    /// A built-in scene by its name, one of [`Scene::builtin_names`].
    ///
    /// # Errors
    /// An unknown name; the message lists the known ones.
    pub fn builtin(name: &str) -> Result<Self> {
        builtin::scene(name)
    }

    /// Names of the built-in scenes: `default`, and those of the benchmarks.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        builtin::names()
    }
}
