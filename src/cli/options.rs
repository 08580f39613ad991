//! Options that several commands share.

use std::fmt;
use std::io::Write;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::thread;

use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueEnum};
use glam::DVec3;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::bake::writers::atomically;
use crate::bake::{Arrays, Method, Outcome, Partial, Phase, Provenance, Receivers};
use crate::scene::{Camera, Environment, Geometry, Scene, UpAxis};
use crate::{Error, Result};

use super::{Failure, say};

/// How visibility is integrated.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub struct MethodOptions {
    /// How visibility is integrated
    #[arg(long, value_enum, default_value_t = MethodName::Isolines)]
    method: MethodName,
    /// Number of isolines; the error falls as its power 1.5 [default: 256]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=1 << 20))]
    isolines: Option<u32>,
    /// Rays per receiver [default: 1024]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 28))]
    samples: Option<u32>,
    /// Seed of the ray directions' scrambling [default: 0]
    #[arg(long, value_name = "S")]
    seed: Option<u32>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum MethodName {
    /// Octahedral isolines: analytic along one direction, no noise
    Isolines,
    /// The visible region itself, closed forms over its boundary: no knob
    Exact,
    /// Quasi-Monte Carlo by ray casting: the independent judge
    Qmc,
}

impl MethodOptions {
    /// The method with its settings.
    pub fn method(&self) -> std::result::Result<Method, Failure> {
        let stray = |option: &str, method: &str| Failure::Usage(format!("{option} means nothing to --method {method}"));
        match self.method {
            MethodName::Isolines if self.samples.is_some() => Err(stray("--samples", "isolines")),
            MethodName::Isolines if self.seed.is_some() => Err(stray("--seed", "isolines")),
            MethodName::Isolines => Ok(Method::Isolines { lines: self.isolines.unwrap_or(256) }),
            MethodName::Exact if self.isolines.is_some() => Err(stray("--isolines", "exact")),
            MethodName::Exact if self.samples.is_some() => Err(stray("--samples", "exact")),
            MethodName::Exact if self.seed.is_some() => Err(stray("--seed", "exact")),
            MethodName::Exact => Ok(Method::Exact),
            MethodName::Qmc if self.isolines.is_some() => Err(stray("--isolines", "qmc")),
            MethodName::Qmc => {
                Ok(Method::Qmc { samples: self.samples.unwrap_or(1024), seed: self.seed.unwrap_or_default() })
            }
        }
    }
}

/// Provenance of results by `method`, this process's command line included.
pub fn provenance(method: Method) -> Provenance {
    let words = std::env::args_os().map(|word| quoted(&word.to_string_lossy()));
    let command_line = words.collect::<Vec<_>>().join(" ");
    let provenance = Provenance { command_line, ..Provenance::new(method.to_string()) };
    match method {
        Method::Isolines { lines } => provenance.with("isolines", lines),
        Method::Exact => provenance,
        Method::Qmc { samples, seed } => provenance.with("samples", samples).with("seed", seed),
    }
}

/// A word as a shell would take it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', r"'\''")) }
}

/// Spherical harmonics.
#[derive(Args)]
#[command(next_help_heading = "Spherical harmonics")]
pub struct HarmonicsOptions {
    /// Number of bands; order n gives n^2 coefficients
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = RangedU64ValueParser::<usize>::new().range(1..=10))]
    pub order: usize,
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

/// Parses a number that is neither infinite nor NaN.
fn finite(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err("not a finite number".into()),
    }
}

/// Parses a number that is finite and not negative.
pub fn magnitude(text: &str) -> std::result::Result<f64, String> {
    finite(text).ok().filter(|x| *x >= 0.0).ok_or_else(|| "not a finite number of at least 0".into())
}

/// The scene that a command works on: a scene file, a mesh, the name of a built-in scene, or the default one.
pub fn scene(named: Option<&Path>) -> Result<Scene> {
    match named {
        None => Scene::builtin("default"),
        Some(path) => match path.to_str() {
            Some(name) if path.extension().is_none() && !path.exists() => Scene::builtin(name),
            _ => Scene::load(path),
        },
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

/// How the computation runs.
#[derive(Args)]
#[command(next_help_heading = "Run")]
pub struct RunOptions {
    /// Threads; the results do not depend on it [default: all processors]
    #[arg(long, value_name = "T", value_parser = RangedU64ValueParser::<usize>::new().range(1..=1024))]
    threads: Option<usize>,
    /// Write what was done, and how fast, as JSON
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Go on from what an interrupted run kept
    #[arg(long)]
    resume: bool,
    /// No progress
    #[arg(long, short)]
    pub quiet: bool,
}

impl RunOptions {
    /// The threads to work on.
    pub fn pool(&self) -> Result<ThreadPool> {
        let threads = self.threads.or_else(|| thread::available_parallelism().ok().map(NonZero::get)).unwrap_or(1);
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        pool.map_err(|error| Error::input(format!("{threads} threads cannot be started ({error}); ask for fewer")))
    }

    /// What an interrupted run of the same command has kept, if it is wanted.
    pub fn resumed(&self, out: &Path, provenance: &Provenance) -> Result<Option<Partial>> {
        let part = Partial::path(out);
        match self.resume {
            false => Ok(None),
            true if part.exists() => Partial::read(&part, provenance).map(Some),
            true => Err(Error::file(part, "there is nothing to go on from; leave --resume out")),
        }
    }

    /// Ends a run that was to write `out`: gives the arrays of a finished one, keeps the finished part of an
    /// interrupted one and says so.
    ///
    /// # Errors
    /// [`Error::Interrupted`] after an interruption; otherwise when a file cannot be written.
    pub fn conclude(&self, outcome: Outcome, out: &Path, provenance: &Provenance) -> Result<Arrays> {
        let Outcome { arrays, done, statistics } = outcome;
        let part = Partial::path(out);
        if done.iter().all(|&done| done) {
            if let Some(stats) = &self.stats {
                let json = statistics.to_json();
                atomically(stats, |file| file.write_all(json.as_bytes()).map_err(|error| Error::file(stats, error)))?;
            }
            if self.resume {
                std::fs::remove_file(&part).map_err(|error| Error::file(&part, error))?;
            }
            return Ok(arrays);
        }
        let partial = Partial { arrays, done, provenance: provenance.clone() };
        match partial.finished() {
            0 => say("stopped before any receiver was finished: nothing is kept"),
            finished => {
                partial.write(&part)?;
                let (all, part) = (partial.done.len(), part.display());
                say(format_args!(
                    "stopped: {finished} of {all} receivers are kept in {part}; --resume goes on from there"
                ));
            }
        }
        Err(Error::Interrupted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{Array, Statistics};

    #[test]
    fn words_are_quoted_for_a_shell() {
        let words = ["bake", "--order=4", "my scene.toml", "it's", "", "$HOME"].map(quoted);
        assert_eq!(words, ["bake", "--order=4", "'my scene.toml'", r"'it'\''s'", "''", "'$HOME'"]);
    }

    #[test]
    fn an_interrupted_run_is_kept_and_a_finished_one_cleans_up() {
        let folder = tempfile::tempdir().unwrap();
        let (out, stats) = (folder.path().join("a.npz"), folder.path().join("stats.json"));
        let provenance = Provenance::new("isolines");
        let outcome = |done: [bool; 2]| {
            let mut arrays = Arrays::new();
            arrays.push(Array::new("ambient_occlusion", [2], vec![0.5, 0.0])).unwrap();
            Outcome { arrays, done: done.to_vec(), statistics: Statistics::default() }
        };
        let options = |resume| RunOptions { threads: None, stats: Some(stats.clone()), resume, quiet: true };

        let nothing = options(false).conclude(outcome([false; 2]), &out, &provenance);
        assert!(matches!(nothing, Err(Error::Interrupted)));
        assert!(!Partial::path(&out).exists());
        options(false).conclude(outcome([true, false]), &out, &provenance).unwrap_err();
        assert!(!stats.exists());
        assert!(options(false).resumed(&out, &provenance).unwrap().is_none());
        assert_eq!(options(true).resumed(&out, &provenance).unwrap().unwrap().done, [true, false]);

        options(true).conclude(outcome([true; 2]), &out, &provenance).unwrap();
        assert!(!Partial::path(&out).exists());
        let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&stats).unwrap()).unwrap();
        for key in "receivers method triangles threads build_seconds integrate_seconds contours_per_receiver depth_alarms skipped"
            .split(' ')
        {
            assert!(json.get(key).is_some(), "{key}");
        }
        assert!(json["skipped"].is_object());
    }
}
