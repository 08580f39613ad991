use std::fs;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DQuat, DVec3, Vec3};
use serde::Deserialize;
use toml::Spanned;

use super::shapes::Shape;
use super::{
    Camera, Environment, GeometryBuilder, Material, Mesh, Point, Scene, Sky, UpAxis, load_meshes, load_points,
};
use crate::{Error, Result};

/// Where a scene wants light to be gathered.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ReceiverSource {
    /// At the vertices of the geometry, with angle-weighted normals.
    #[default]
    Vertices,
    /// At what the camera sees through every pixel.
    Pixels,
    /// At these points.
    Points(Vec<Point>),
}

/// Reads a scene file; see [`Scene::load`].
pub(super) fn load(path: &Path) -> Result<Scene> {
    let text = fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
    read(&text, path)
}

/// Reads the text of a scene file, which is called `path` in errors and whose paths are relative to its folder.
pub(super) fn read(text: &str, path: &Path) -> Result<Scene> {
    let at = |offset: usize| 1 + text.as_bytes().iter().take(offset).filter(|byte| **byte == b'\n').count();
    let refuse = |offset: usize, message: &dyn ToString| Error::line(path, at(offset), message.to_string());
    let file: File = toml::from_str(text).map_err(|e| {
        let message = e.message().replace('\n', ", ");
        refuse(e.span().map_or(0, |span| span.start), &message)
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));

    let mut builder = GeometryBuilder::default();
    for entry in file.mesh {
        let offset = entry.span().start;
        let transform = entry.as_ref().transform().map_err(|e| refuse(offset, &e))?;
        for mesh in entry.into_inner().meshes(folder).map_err(|e| placed(e, &|e| refuse(offset, e)))? {
            builder.add(mesh, transform).map_err(|e| refuse(offset, &e))?;
        }
    }
    let environment = file.environment.map(|entry| {
        let offset = entry.span().start;
        entry.into_inner().environment(folder).map_err(|e| placed(e, &|e| refuse(offset, e)))
    });
    let camera = file.camera.map(|entry| {
        let offset = entry.span().start;
        let CameraEntry { position, look_at, up, fov, resolution } = entry.into_inner();
        Camera::new(position.into(), look_at.into(), up.into(), fov, resolution).map_err(|e| refuse(offset, &e))
    });
    let camera = camera.transpose()?;
    let receivers = match file.receivers {
        None => ReceiverSource::Vertices,
        Some(entry) => {
            let offset = entry.span().start;
            match entry.into_inner() {
                Receivers::Vertices => ReceiverSource::Vertices,
                Receivers::Pixels if camera.is_none() => {
                    return Err(refuse(offset, &"receivers = \"pixels\" needs a [camera]"));
                }
                Receivers::Pixels => ReceiverSource::Pixels,
                Receivers::Points(file) => ReceiverSource::Points(load_points(folder.join(file))?),
            }
        }
    };
    Ok(Scene { geometry: builder.build(), environment: environment.transpose()?, camera, receivers })
}

/// Errors that name a file stay; others get their place in the scene file.
fn placed(error: Error, place: &dyn Fn(&dyn ToString) -> Error) -> Error {
    match error {
        Error::Input(message) => place(&message),
        other => other,
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    mesh: Vec<Spanned<MeshEntry>>,
    environment: Option<Spanned<EnvironmentEntry>>,
    camera: Option<Spanned<CameraEntry>>,
    receivers: Option<Spanned<Receivers>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshEntry {
    file: Option<PathBuf>,
    shape: Option<Shape>,
    name: Option<String>,
    albedo: Option<Albedo>,
    scale: Option<Scale>,
    rotate: Option<Rotation>,
    #[serde(default)]
    translate: [f64; 3],
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number or an array of three numbers")]
enum Albedo {
    Grey(f32),
    Colour([f32; 3]),
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number or an array of three numbers")]
enum Scale {
    Uniform(f64),
    Axes([f64; 3]),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Rotation {
    axis: [f64; 3],
    degrees: f64,
}

impl MeshEntry {
    /// Scales, then rotates, then translates.
    fn transform(&self) -> Result<DAffine3> {
        let scale = match self.scale {
            None => DVec3::ONE,
            Some(Scale::Uniform(scale)) => DVec3::splat(scale),
            Some(Scale::Axes(scale)) => DVec3::from(scale),
        };
        if !scale.is_finite() || scale.cmpeq(DVec3::ZERO).any() {
            return Err(Error::input("scale must be finite and not zero"));
        }
        let rotation = match &self.rotate {
            None => DQuat::IDENTITY,
            Some(Rotation { axis, degrees }) => match DVec3::from(*axis).try_normalize() {
                Some(axis) if degrees.is_finite() => DQuat::from_axis_angle(axis, degrees.to_radians()),
                _ => return Err(Error::input("rotate needs an axis that is not zero and a finite angle")),
            },
        };
        if !DVec3::from(self.translate).is_finite() {
            return Err(Error::input("translate must be finite"));
        }
        Ok(DAffine3::from_scale_rotation_translation(scale, rotation, self.translate.into()))
    }

    fn meshes(self, folder: &Path) -> Result<Vec<Mesh>> {
        let mut meshes = match (self.file, self.shape) {
            (Some(file), None) => load_meshes(folder.join(file))?,
            (None, Some(shape)) => vec![shape.mesh()?],
            _ => return Err(Error::input("a mesh needs either a file or a shape")),
        };
        let albedo = self.albedo.map(|albedo| match albedo {
            Albedo::Grey(albedo) => Vec3::splat(albedo),
            Albedo::Colour(albedo) => albedo.into(),
        });
        for mesh in &mut meshes {
            if let Some(name) = &self.name {
                mesh.name.clone_from(name);
            }
            if let Some(albedo) = albedo {
                mesh.material = Material { name: mesh.name.clone(), albedo };
            }
        }
        Ok(meshes)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EnvironmentEntry {
    file: Option<PathBuf>,
    sky: Option<Sky>,
    constant: Option<Albedo>,
    #[serde(default)]
    up: UpAxis,
    #[serde(default)]
    rotation: f64,
}

impl EnvironmentEntry {
    fn environment(self, folder: &Path) -> Result<Environment> {
        let environment = match (self.file, self.sky, self.constant) {
            (Some(file), None, None) => Environment::load(folder.join(file))?,
            (None, Some(sky), None) => sky.environment()?,
            (None, None, Some(Albedo::Grey(radiance))) => Environment::constant(Vec3::splat(radiance))?,
            (None, None, Some(Albedo::Colour(radiance))) => Environment::constant(radiance.into())?,
            _ => return Err(Error::input("an environment needs one of file, sky and constant")),
        };
        environment.oriented(self.up, self.rotation)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraEntry {
    position: [f64; 3],
    look_at: [f64; 3],
    #[serde(default = "up")]
    up: [f64; 3],
    #[serde(default = "fov")]
    fov: f64,
    #[serde(default = "resolution")]
    resolution: [u32; 2],
}

fn up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn fov() -> f64 {
    45.0
}

fn resolution() -> [u32; 2] {
    [640, 480]
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Receivers {
    Vertices,
    Pixels,
    Points(PathBuf),
}
