use std::path::PathBuf;

use serde::Deserialize;

use super::Walker;
use crate::{Error, Result};

/// A body that moves, as a scene file describes it.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// A figure made up.
    Walker(Walker),
    /// A character from a file.
    Skinned(SkinnedBody),
}

/// A character from a skinned glTF file, one of its clips running over and over.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkinnedBody {
    /// The file, `.glb` or `.gltf`.
    pub file: PathBuf,
    /// Name of the clip; without it, the rest pose.
    pub clip: Option<String>,
    /// Meshes to be left out, by the names of their nodes.
    #[serde(default)]
    pub without: Vec<String>,
    /// File of its spheres, as `silhouette proxies fit` writes it; without it, spheres are fitted.
    pub set: Option<PathBuf>,
    /// How many spheres are fitted. Default 50.
    #[serde(default = "spheres")]
    pub spheres: usize,
    /// Seconds into the clip at which it starts.
    #[serde(default)]
    pub start: f64,
    /// Factor on its size.
    #[serde(default = "one")]
    pub scale: f64,
    /// Degrees by which it is turned about the y axis, after scaling.
    #[serde(default)]
    pub turn: f64,
    /// Where its origin stands.
    #[serde(default)]
    pub translate: [f64; 3],
    /// Diffuse reflectance of all of it, in place of the file's materials.
    pub albedo: Option<[f32; 3]>,
}

fn spheres() -> usize {
    50
}

fn one() -> f64 {
    1.0
}

impl Body {
    /// Fails where a value is out of its domain.
    ///
    /// # Errors
    /// One line that names the value.
    pub fn check(&self) -> Result<()> {
        let body = match self {
            Self::Walker(walker) => return walker.check(),
            Self::Skinned(body) => body,
        };
        if !(body.scale.is_finite() && body.scale > 0.0) {
            return Err(Error::input(format!("character: scale must be positive and finite, not {}", body.scale)));
        }
        if !(body.turn.is_finite() && body.start.is_finite() && body.translate.iter().all(|x| x.is_finite())) {
            return Err(Error::input("character: start, turn and translate must be finite"));
        }
        if !body.albedo.is_none_or(|albedo| albedo.iter().all(|x| (0.0..=1.0).contains(x))) {
            return Err(Error::input("character: albedo must lie in [0, 1]"));
        }
        Ok(())
    }

    /// The number of spheres that stand for it, unless a file says otherwise.
    pub fn spheres_mut(&mut self) -> &mut usize {
        match self {
            Self::Walker(walker) => &mut walker.spheres,
            Self::Skinned(body) => &mut body.spheres,
        }
    }
}
