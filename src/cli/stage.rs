//! What the commands share that render moving bodies: the scene with its characters, its light, and who works on it.

use std::path::PathBuf;

use clap::Args;
use clap::builder::RangedU64ValueParser;
use rayon::ThreadPool;

use crate::bake::{Control, Method};
use crate::proxy::{Actor, Posed, Probes, Proxy, Surface, baked_surface, static_surface};
use crate::scene::{Body, Camera, Environment, Geometry, Scene};
use crate::sphere::Order;
use crate::{Error, Result};

use super::Failure;
use super::options::{LightOptions, framing, scene};
use super::run::threads;
use super::terminal::Terminal;

/// Moving bodies, the set on which they move, and light.
#[derive(Args)]
pub struct StageOptions {
    /// Scene file (.toml) or name of a built-in scene; without it, one of walking figures
    scene: Option<PathBuf>,
    /// Spheres in all, shared evenly by the characters [default: the scene's]
    #[arg(long, value_name = "N")]
    spheres: Option<usize>,
    /// Shadows of what stands still, on itself and on the bodies: bake its visibility along N isolines per vertex, and multiply it
    /// in; 0 leaves them out
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=1 << 16))]
    bake: u32,
    #[command(flatten)]
    light: LightOptions,
    /// Threads; the pictures do not depend on it [default: all processors]
    #[arg(long, value_name = "T", value_parser = RangedU64ValueParser::<usize>::new().range(1..=1024))]
    threads: Option<usize>,
    /// No progress
    #[arg(long, short)]
    quiet: bool,
}

impl StageOptions {
    /// Loads the stage.
    pub fn load(&self) -> std::result::Result<Stage, Failure> {
        let scene = match self.scene.as_deref() {
            None => Scene::builtin("walkers")?,
            named => scene(named)?,
        };
        if scene.characters.is_empty() {
            let message = "the scene has no [[character]], so nothing moves; `walkers` is one that has";
            return Err(Error::input(message).into());
        }
        let Some(environment) = self.light.load()?.or(scene.environment) else {
            let message = "proxies need light: name an environment by --environment or in the scene file";
            return Err(Failure::Usage(message.into()));
        };
        let camera = match scene.camera {
            Some(camera) => camera,
            None => framing(&scene.geometry)?,
        };
        let bake = (self.bake > 0).then_some(Method::Isolines { lines: self.bake.max(4) });
        Ok(Stage {
            geometry: scene.geometry,
            bodies: scene.characters,
            camera,
            environment,
            spheres: self.spheres,
            bake,
        })
    }

    /// The threads to work on.
    pub fn pool(&self) -> Result<ThreadPool> {
        threads(self.threads)
    }

    /// Where progress is shown.
    pub fn terminal(&self) -> Terminal {
        Terminal::new(self.quiet)
    }
}

/// A scene ready to be filmed.
pub struct Stage {
    /// What stands still.
    pub geometry: Geometry,
    bodies: Vec<Body>,
    /// Where it is seen from.
    pub camera: Camera,
    /// Its light.
    pub environment: Environment,
    /// Spheres in all that were asked for.
    pub spheres: Option<usize>,
    /// How the visibility of what stands still is baked, if at all.
    pub bake: Option<Method>,
}

/// All bodies at one time: what is seen, and what stands for it.
pub type Bodies = (Vec<Surface>, Vec<Proxy>);

impl Stage {
    /// The characters, with `spheres` in all if that is given.
    pub fn actors(&self, spheres: Option<usize>, control: &dyn Control) -> Result<Vec<Actor>> {
        let count = self.bodies.len();
        let actor = |(i, body): (usize, &Body)| {
            let mut body = body.clone();
            if let Some(spheres) = spheres {
                *body.spheres_mut() = spheres / count + usize::from(i < spheres % count);
                body.check()?;
            }
            Actor::new(&body, control)
        };
        self.bodies.iter().enumerate().map(actor).collect()
    }

    /// The surface of what stands still, with baked visibility if that is asked for.
    pub fn set(&self, order: Order, control: &dyn Control) -> Result<Surface> {
        let eye = self.camera.position();
        match self.bake {
            None => Ok(static_surface(&self.geometry, eye)),
            Some(method) => baked_surface(&self.geometry, eye, order, method, control),
        }
    }

    /// Where the visibility of what stands still is baked for bodies, if that is asked for: an eighth of a body apart.
    pub fn probes(&self, actors: &[Actor], order: Order) -> Result<Option<Probes<'_>>> {
        let Some(method) = self.bake else { return Ok(None) };
        let (bodies, _) = pose(actors, 0.0)?;
        let sizes = bodies.iter().map(|body| {
            let first = body.positions.first().copied().unwrap_or_default();
            let bounds = |(low, high): (glam::Vec3, glam::Vec3), p: &glam::Vec3| (low.min(*p), high.max(*p));
            let (low, high) = body.positions.iter().fold((first, first), bounds);
            f64::from(low.distance(high))
        });
        let least = sizes.fold(f64::INFINITY, f64::min);
        Probes::new(&self.geometry, least / 8.0, order, method).map(Some)
    }
}

/// The actors `time` seconds after they started.
pub fn pose(actors: &[Actor], time: f64) -> Result<Bodies> {
    let (mut bodies, mut spheres) = (Vec::new(), Vec::new());
    for actor in actors {
        let Posed { surface, proxies } = actor.pose(time)?;
        bodies.push(surface);
        spheres.extend(proxies);
    }
    Ok((bodies, spheres))
}
