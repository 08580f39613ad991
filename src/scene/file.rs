use std::fs;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DQuat, DVec3, Vec3};
use serde::Deserialize;
use toml::Spanned;

use super::shapes::Shape;
use super::{
    Body, Camera, Environment, GeometryBuilder, Material, Mesh, Point, Scene, SkinnedBody, Sky, UpAxis, Walker,
    load_meshes, load_points,
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
    let characters = file.character.into_iter().map(|entry| {
        let offset = entry.span().start;
        let body = match entry.into_inner() {
            CharacterEntry::Walker(WalkerEntry { walker }) => Body::Walker(walker),
            CharacterEntry::Skinned(mut body) => {
                body.file = folder.join(body.file);
                body.set = body.set.map(|set| folder.join(set));
                Body::Skinned(body)
            }
        };
        body.check().map_err(|e| refuse(offset, &e))?;
        Ok(body)
    });
    let characters = characters.collect::<Result<Vec<_>>>()?;
    Ok(Scene { geometry: builder.build(), environment: environment.transpose()?, camera, receivers, characters })
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
    #[serde(default)]
    character: Vec<Spanned<CharacterEntry>>,
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
#[serde(untagged, expecting = "expected either a walker or a file, with known keys")]
enum CharacterEntry {
    Walker(WalkerEntry),
    Skinned(SkinnedBody),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WalkerEntry {
    walker: Walker,
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Scene> {
        read(text, Path::new("folder/scene.toml"))
    }

    #[track_caller]
    fn refused(text: &str, line: usize, why: &str) {
        let message = read_text(text).unwrap_err().to_string();
        assert!(message.starts_with(&format!("folder/scene.toml:{line}: ")) && message.contains(why), "{message}");
        assert!(!message.contains('\n'), "{message}");
    }

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    #[test]
    fn everything_is_read_relative_to_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        write("triangle.obj", TRIANGLE);
        write("points.txt", "1 2 3 0 0 1\n");
        write(
            "scene.toml",
            r#"
            receivers = { points = "points.txt" }
            [[mesh]]
            file = "triangle.obj"
            scale = [2, 3, 1]
            rotate = { axis = [0, 0, 2], degrees = 90 }
            translate = [10, 0, 0]
            albedo = 0.25
            name = "left"
            [[mesh]]
            file = "triangle.obj"
            [environment]
            constant = [1, 2, 3]
            up = "z"
            rotation = 90
            [camera]
            position = [0, 0, 5]
            look_at = [0, 0, 0]
            resolution = [4, 3]
            "#,
        );
        let scene = Scene::load(folder.path().join("scene.toml")).unwrap();
        let expected = [[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [7.0, 0.0, 0.0]].map(Vec3::from_array);
        for (position, expected) in scene.geometry.positions.iter().zip(expected) {
            assert!(position.distance(expected) < 1e-6, "{position}");
        }
        assert_eq!(scene.geometry.meshes, ["left", "unnamed_object"]);
        assert_eq!(scene.geometry.materials[0], Material { name: "left".into(), albedo: Vec3::splat(0.25) });
        assert_eq!(scene.geometry.materials[1], Material::default());
        let environment = scene.environment.unwrap();
        assert_eq!(environment.uniform(), Some(Vec3::new(1.0, 2.0, 3.0)));
        assert_eq!(environment.to_scene() * DVec3::Z, DVec3::Y);
        assert_eq!(scene.camera.unwrap().resolution(), [4, 3]);
        assert_eq!(
            scene.receivers,
            ReceiverSource::Points(vec![Point { position: DVec3::new(1.0, 2.0, 3.0), normal: DVec3::Z }])
        );
    }

    #[test]
    fn mesh_files_are_scenes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("triangle.obj");
        fs::write(&path, TRIANGLE).unwrap();
        let scene = Scene::load(&path).unwrap();
        assert_eq!((scene.geometry.triangles.len(), scene.receivers), (1, ReceiverSource::Vertices));
        assert!(scene.environment.is_none() && scene.camera.is_none());
        // The same mesh twice is welded into one.
        assert_eq!(Scene::from_meshes([&path, &path]).unwrap().geometry.cleaning.duplicate_triangles, 1);
    }

    #[test]
    fn empty_scene_is_legal() {
        assert_eq!(read_text("").unwrap().geometry.triangles.len(), 0);
    }

    #[test]
    fn unknown_keys_name_their_line() {
        refused("\ncolour = 3\n", 2, "unknown field `colour`");
        refused("[[mesh]]\nshape.teapot = {}\ncolour = 3\n", 3, "unknown field `colour`");
        refused("[[mesh]]\n\nshape.cone = {}\n", 3, "unknown variant `cone`");
        refused("[[mesh]]\nshape.box.size = [1, 1, 1]\nshape.box.height = 2\n", 3, "unknown field `height`");
        refused("[[mesh]]\nshape.room = { opening = \"door\" }\n", 2, "unknown variant `door`");
        refused("[environment]\nsky = {}\n\ntilt = 3\n", 4, "unknown field `tilt`");
        refused("[environment]\nsky = { sun = 3 }\n", 2, "unknown field `sun`");
        refused("[camera]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\nzoom = 2\n", 4, "unknown field `zoom`");
        refused("receivers = \"texels\"\n", 1, "unknown variant `texels`");
    }

    #[test]
    fn bad_values_name_their_line() {
        refused("[[mesh]\n", 1, "");
        refused("\n\n[[mesh]]\nname = \"x\"\n", 3, "either a file or a shape");
        refused("[[mesh]]\nfile = \"a.obj\"\nshape.teapot = {}\n", 1, "either a file or a shape");
        refused("[[mesh]]\nshape.teapot = {}\nscale = \"big\"\n", 3, "a number or an array of three");
        refused("[[mesh]]\nshape.teapot = {}\ntranslate = [1, 2]\n", 3, "");
        refused("[[mesh]]\nshape.teapot = {}\nscale = 0\n", 1, "scale must be");
        refused("[[mesh]]\nshape.teapot = {}\nrotate = { axis = [0, 0, 0], degrees = 1 }\n", 1, "rotate needs");
        refused("[[mesh]]\nshape.teapot = {}\ntranslate = [0, nan, 0]\n", 1, "translate must be finite");
        refused("[[mesh]]\nshape.teapot = {}\nscale = 1e20\n", 1, "accepted range");
        refused("[[mesh]]\nshape.teapot = {}\nalbedo = 2\n", 1, "albedo");
        refused("[[mesh]]\nshape.teapot = { divisions = 0 }\n", 1, "teapot: ");
        refused("[environment]\nup = \"y\"\n", 1, "one of file, sky and constant");
        refused("[environment]\nup = \"w\"\nconstant = 1\n", 2, "unknown variant `w`");
        refused("[environment]\nconstant = -1\n", 1, "not be negative");
        refused("[environment]\nconstant = 1\nrotation = inf\n", 1, "rotation");
        refused("[environment]\nsky = { turbidity = 0 }\n", 1, "turbidity");
        refused("[camera]\nposition = [0, 0, 1]\n", 1, "look_at");
        refused("\n[camera]\nposition = [0, 0, 1]\nlook_at = [0, 0, 1]\n", 2, "where the camera stands");
        refused("receivers = \"pixels\"\n", 1, "needs a [camera]");
    }

    #[test]
    fn files_that_fail_name_themselves() {
        for (text, file) in [
            ("[[mesh]]\nfile = \"missing.obj\"\n", "folder/missing.obj: "),
            ("[environment]\nfile = \"missing.exr\"\n", "folder/missing.exr: "),
            ("[environment]\nfile = \"missing.png\"\n", "folder/missing.png: "),
            ("receivers.points = \"missing.npy\"\n", "folder/missing.npy: "),
        ] {
            let message = read_text(text).unwrap_err().to_string();
            assert!(message.starts_with(file), "{message}");
        }
        assert!(Scene::load("missing.toml").unwrap_err().to_string().starts_with("missing.toml: "));
    }
}
