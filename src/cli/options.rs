//! Options that several commands share.

use std::fmt;
use std::path::{Path, PathBuf};

use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueEnum};
use glam::DVec3;

use crate::bake::{Phase, Provenance, Receivers};
use crate::scene::{Camera, Environment, Geometry, Scene, UpAxis};
use crate::sphere::{Lobe, Order};
use crate::{Error, Result};

use super::say;

/// Spherical harmonics.
#[derive(Args)]
#[command(next_help_heading = "Spherical harmonics")]
pub struct HarmonicsOptions {
    /// Number of bands; order n gives n^2 coefficients
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = RangedU64ValueParser::<usize>::new().range(1..=10))]
    order: usize,
    /// As few bands as this material's lobe needs, instead of --order: `diffuse`, or the exponent of a Phong-like cosine power
    #[arg(long, value_name = "diffuse|S", value_parser = lobe, allow_negative_numbers = true, conflicts_with = "order")]
    lobe: Option<Lobe>,
    /// What the lobe may lose beyond its bands, relative to its L2 norm
    #[arg(long, value_name = "E", value_parser = positive, allow_negative_numbers = true, default_value_t = 0.1, requires = "lobe")]
    lobe_error: f64,
    /// Sign of the coefficients with odd |m|
    #[arg(long, value_enum, default_value_t = PhaseName::Plain)]
    sh_phase: PhaseName,
}

#[derive(Clone, Copy, ValueEnum)]
enum PhaseName {
    /// Y_1 = sqrt(3/4pi) (y, z, x)
    Plain,
    /// Times (-1)^m: Y_1 = sqrt(3/4pi) (-y, z, -x)
    CondonShortley,
}

impl HarmonicsOptions {
    /// The bands asked for, or those that the lobe needs; notes in `provenance` what decided.
    pub fn order(&self, provenance: Provenance, quiet: bool) -> Result<(Order, Provenance)> {
        let Some(lobe) = self.lobe else {
            let order = Order::new(self.order)?;
            return Ok((order, provenance.with("order", order.bands())));
        };
        let order = lobe.order(self.lobe_error)?;
        let (bands, lost) = (order.bands(), lobe.error(order));
        if !quiet {
            say(format_args!("the lobe {lobe} takes {bands} bands: beyond them it loses {lost:.1e} of itself"));
        }
        let provenance = provenance.with("order", bands).with("lobe", lobe).with("lobe_error", self.lobe_error);
        Ok((order, provenance))
    }

    /// The phase convention asked for.
    pub fn phase(&self) -> Phase {
        match self.sh_phase {
            PhaseName::Plain => Phase::Plain,
            PhaseName::CondonShortley => Phase::CondonShortley,
        }
    }
}

/// Light from far away.
#[derive(Args)]
#[command(next_help_heading = "Light")]
pub struct LightOptions {
    /// Lat-long environment image, .exr or .hdr
    #[arg(long, value_name = "FILE")]
    pub environment: Option<PathBuf>,
    /// Axis of the scene that points to the top of the environment
    #[arg(long, value_enum, value_name = "AXIS", requires = "environment")]
    pub up: Option<Up>,
    /// Degrees by which the environment is turned about the up axis, counter-clockwise seen from above
    #[arg(long, value_name = "DEG", requires = "environment", value_parser = finite, allow_negative_numbers = true)]
    pub rotation: Option<f64>,
}

/// An axis with its direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Up {
    /// +x
    X,
    /// +y
    #[default]
    Y,
    /// +z
    Z,
}

impl fmt::Display for Up {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        })
    }
}

impl LightOptions {
    /// The environment, if one is named.
    pub fn load(&self) -> Result<Option<Environment>> {
        let Some(file) = &self.environment else { return Ok(None) };
        let up = match self.up.unwrap_or_default() {
            Up::X => UpAxis::X,
            Up::Y => UpAxis::Y,
            Up::Z => UpAxis::Z,
        };
        Environment::load(file)?.oriented(up, self.rotation.unwrap_or_default()).map(Some)
    }

    /// Adds what the light depends on to `provenance`.
    pub fn record(&self, provenance: Provenance) -> Provenance {
        match &self.environment {
            Some(file) => provenance
                .with("environment", file.display())
                .with("up", self.up.unwrap_or_default())
                .with("rotation", self.rotation.unwrap_or_default()),
            None => provenance,
        }
    }
}

/// Parses a lobe: its exponent, or the diffuse one.
fn lobe(text: &str) -> std::result::Result<Lobe, String> {
    match text.parse() {
        _ if text == "diffuse" => Ok(Lobe::DIFFUSE),
        Ok(exponent) => Lobe::new(exponent).map_err(|error| error.to_string()),
        Err(_) => Err("neither `diffuse` nor an exponent".into()),
    }
}

/// Parses a number that is neither infinite nor NaN.
pub fn finite(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err("not a finite number".into()),
    }
}

/// Parses a number that is finite and positive.
pub fn positive(text: &str) -> std::result::Result<f64, String> {
    finite(text).ok().filter(|x| *x > 0.0).ok_or_else(|| "not a finite number above 0".into())
}

/// Parses a number that is finite and not negative.
pub fn magnitude(text: &str) -> std::result::Result<f64, String> {
    finite(text).ok().filter(|x| *x >= 0.0).ok_or_else(|| "not a finite number of at least 0".into())
}

/// The scene that a command works on: a scene file, a mesh, the name of a built-in scene, or the default one.
pub fn scene(named: Option<&Path>) -> Result<Scene> {
    match named {
        None => Scene::builtin("default"),
        Some(path) => match builtin_name(path) {
            Some(name) => Scene::builtin(name),
            None => Scene::load(path),
        },
    }
}

/// The name of a built-in scene, if this can be nothing else.
fn builtin_name(path: &Path) -> Option<&str> {
    path.to_str().filter(|_| path.extension().is_none() && !path.exists())
}

/// Tells early that a scene is not there, before other scenes take their time.
pub fn expect_scene(path: &Path) -> Result<()> {
    match builtin_name(path) {
        Some(name) if Scene::builtin_names().any(|known| known == name) => Ok(()),
        Some(name) => Scene::builtin(name).map(|_| ()),
        None => std::fs::metadata(path).map(|_| ()).map_err(|error| Error::file(path, error)),
    }
}

/// The vertices of the geometry as receivers.
pub fn vertices(geometry: &Geometry) -> Receivers {
    let (receivers, undirected) = Receivers::vertices(geometry);
    if let Some(first) = undirected.first() {
        let count = undirected.len();
        say(format_args!(
            "note: at {count} vertices (the first is {first}) the normals of the faces cancel; +z is used"
        ));
    }
    receivers
}

/// A camera that sees all of the geometry, obliquely from above, for scenes without one of their own.
pub fn framing(geometry: &Geometry) -> Result<Camera> {
    let [low, high] = geometry.bounds().ok_or_else(|| Error::input("there is nothing to look at: no triangles"))?;
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    let (centre, radius) = (low.midpoint(high), 0.5 * low.distance(high));
    /// Degrees; the ball around the scene fills the image's height.
    const FOV: f64 = 40.0;
    let distance = radius / (0.5 * FOV).to_radians().sin();
    let towards = DVec3::new(0.5, 0.6, 1.0).normalize();
    Camera::new(centre + towards * distance, centre, DVec3::Y, FOV, [640, 480])
}
