use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::Walker;
use crate::{Error, Result};

/// A body that moves.
#[derive(Clone, Debug, PartialEq)]
pub enum Actor {
    /// A built-in figure.
    Walker(Walker),
    /// A glTF file.
    Model(Model),
}

impl Actor {
    /// Fails where a value is out of its domain.
    ///
    /// # Errors
    /// One line that names the value.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Walker(walker) => walker.check(),
            Self::Model(model) => model.check(),
        }
    }

    /// The same with so many spheres; those of a model are fitted anew.
    #[must_use]
    pub fn with_spheres(self, count: usize) -> Self {
        match self {
            Self::Walker(walker) => Self::Walker(Walker { spheres: count, ..walker }),
            Self::Model(model) => Self::Model(Model { spheres: ModelSpheres::Count(count), ..model }),
        }
    }
}

/// A skinned glTF file that plays a clip in a loop.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// The file, relative to the scene file.
    pub file: PathBuf,
    /// Its spheres: a sphere set fitted to it, relative to the scene file, or how many to fit. Default 64.
    #[serde(default)]
    pub spheres: ModelSpheres,
    /// Name of the clip; without one it stands in its rest pose.
    pub clip: Option<String>,
    /// Seconds by which it is ahead.
    #[serde(default)]
    pub ahead: f64,
    /// Its scale. Default 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// Degrees by which it is then turned about the y axis.
    #[serde(default)]
    pub turn: f64,
    /// By how much it is then moved.
    #[serde(default)]
    pub translate: [f64; 3],
    /// Diffuse reflectance; without it, that of its materials.
    pub albedo: Option<[f32; 3]>,
    /// Names of nodes whose meshes are left out, such as tools that are not in hand.
    #[serde(default)]
    pub without: Vec<String>,
}

/// Where the spheres of a model come from.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum ModelSpheres {
    /// So many are fitted.
    Count(usize),
    /// They are read from a file.
    File(PathBuf),
}

impl Default for ModelSpheres {
    fn default() -> Self {
        Self::Count(64)
    }
}

fn one() -> f64 {
    1.0
}

impl Model {
    /// Fails where a value is out of its domain.
    ///
    /// # Errors
    /// One line that names the value.
    pub fn check(&self) -> Result<()> {
        if !(self.scale.is_finite() && self.scale > 0.0) {
            return Err(Error::input(format!("model: scale must be positive and finite, not {}", self.scale)));
        }
        if !(self.ahead.is_finite() && self.turn.is_finite() && self.translate.iter().all(|x| x.is_finite())) {
            return Err(Error::input("model: ahead, turn and translate must be finite"));
        }
        if !self.albedo.iter().flatten().all(|x| (0.0..=1.0).contains(x)) {
            return Err(Error::input("model: albedo must lie in [0, 1]"));
        }
        Ok(())
    }

    /// The model with its files found from `folder`.
    pub(super) fn placed_in(mut self, folder: &Path) -> Self {
        self.file = folder.join(&self.file);
        if let ModelSpheres::File(file) = &mut self.spheres {
            *file = folder.join(&*file);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_read_from_a_line_and_find_their_files() {
        let text = r#"file = "a.glb"
            spheres = "a.json"
            clip = "walk"
            turn = 90"#;
        let model: Model = toml::from_str(text).unwrap();
        let model = model.placed_in(Path::new("scenes"));
        assert_eq!(model.file, Path::new("scenes").join("a.glb"));
        assert_eq!(model.spheres, ModelSpheres::File(Path::new("scenes").join("a.json")));
        assert!(model.check().is_ok() && model.scale == 1.0);
        let model: Model = toml::from_str("file = \"a.glb\"\nspheres = 30").unwrap();
        assert_eq!(model.spheres, ModelSpheres::Count(30));
        for (bad, why) in [
            (Model { scale: 0.0, ..model.clone() }, "scale"),
            (Model { turn: f64::NAN, ..model.clone() }, "turn"),
            (Model { albedo: Some([2.0, 0.0, 0.0]), ..model.clone() }, "albedo"),
        ] {
            assert!(bad.check().unwrap_err().to_string().contains(why));
        }
    }
}
