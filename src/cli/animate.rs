use std::path::PathBuf;

use clap::Args;
use glam::{DMat3, DVec3};

use crate::bake::{Control, Method};
use crate::proxy::{Actor, DistantLight, Engine, Posed, baked_surface, static_surface};
use crate::report::Film;
use crate::scene::{Body, Environment, Scene};
use crate::{Error, Result};

use super::options::{LightOptions, framing, magnitude, scene};
use super::proxy_options::{Device, ProxyOptions};
use super::run::threads;
use super::terminal::Terminal;
use super::{Failure, print};

/// Renders a film of moving bodies by sphere proxies: soft shadows and reflected light, in real time
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Animate {
    /// Scene file (.toml) or name of a built-in scene; without it, one of walking figures
    scene: Option<PathBuf>,
    /// Folder for the frames, a contact sheet and their times
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Number of frames
    #[arg(long, value_name = "N", default_value_t = 36, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: u32,
    /// Frames per second
    #[arg(long, value_name = "F", default_value_t = 12.0, value_parser = positive)]
    fps: f64,
    /// Pixels in a row [default: the camera's]
    #[arg(long, value_name = "W", value_parser = clap::value_parser!(u32).range(1..=8192))]
    width: Option<u32>,
    /// Rows [default: the camera's]
    #[arg(long, value_name = "H", value_parser = clap::value_parser!(u32).range(1..=8192))]
    height: Option<u32>,
    /// What the frames are computed on
    #[arg(long, value_enum, default_value_t = Device::Cpu)]
    device: Device,
    /// Spheres in all, shared evenly by the characters [default: the scene's]
    #[arg(long, value_name = "N")]
    spheres: Option<usize>,
    /// Degrees per second by which the light turns about the y axis
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    turn_light: f64,
    /// Bake the visibility of what stands still along N isolines per vertex, and multiply it in; 0 leaves it out
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=1 << 16))]
    bake: u32,
    #[command(flatten)]
    proxies: ProxyOptions,
    #[command(flatten)]
    light: LightOptions,
    /// Threads; the pictures do not depend on it [default: all processors]
    #[arg(long, value_name = "T", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1024))]
    threads: Option<usize>,
    /// No progress
    #[arg(long, short)]
    quiet: bool,
}

const EXAMPLES: &str = "\
Written are frame_0000.png, ..., contact_sheet.png, frames.csv, frames.json and a plot of the times, frames.png.

Examples:
  silhouette animate -o film
  silhouette animate walkers.toml --frames 240 --fps 24 --bake 64 -o film
  silhouette animate --device gpu -o film
  silhouette animate --environment studio.exr --turn-light 30 --exponential hyb --self-shadowing replaced -o film";

impl Animate {
    /// Renders and writes the frames.
    pub fn run(&self) -> std::result::Result<(), Failure> {
        let settings = self.proxies.settings()?;
        let scene = animated(self.scene.as_deref())?;
        let bodies = with_spheres(scene.characters, self.spheres)?;
        let environment = lighting(&self.light, scene.environment)?;
        let camera = match &scene.camera {
            Some(camera) => camera.clone(),
            None => framing(&scene.geometry)?,
        };
        let [width, height] = camera.resolution();
        let camera = camera.with_resolution([self.width.unwrap_or(width), self.height.unwrap_or(height)])?;

        let pool = threads(self.threads)?;
        let terminal = Terminal::new(self.quiet);
        let film = pool.install(|| -> Result<Film> {
            let actors = bodies.iter().map(|body| Actor::new(body, &terminal)).collect::<Result<Vec<_>>>()?;
            let set = match self.bake {
                0 => static_surface(&scene.geometry, camera.position()),
                lines => {
                    let method = Method::Isolines { lines: lines.max(4) };
                    baked_surface(&scene.geometry, camera.position(), settings.order, method, &terminal)?
                }
            };
            let light = DistantLight::new(&environment, settings.order);
            let engine = match self.device {
                Device::Cpu => Engine::cpu,
                Device::Gpu => Engine::gpu,
            };
            let mut renderer = engine(settings, &camera, &set, &light, Some(&environment))?;
            std::fs::create_dir_all(&self.output).map_err(|error| Error::file(&self.output, error))?;
            let mut film = Film::default();
            terminal.begin("rendering", self.frames.into());
            for frame in 0..self.frames {
                if terminal.cancelled() {
                    break;
                }
                let time = f64::from(frame) / self.fps;
                if self.turn_light != 0.0 && frame > 0 {
                    let turn = DMat3::from_axis_angle(DVec3::Y, (self.turn_light * time).to_radians());
                    renderer.set_light(&light.rotated(turn), Some(&environment));
                }
                let Stage { bodies, proxies } = Stage::new(&actors, time)?;
                let statistics = renderer.render(&bodies, &proxies)?;
                let [width, height] = renderer.size();
                let picture = film.add(width, height, renderer.radiance(), statistics);
                picture.write(&self.output.join(format!("frame_{frame:04}.png")))?;
                terminal.advance(1);
            }
            film.contact_sheet().write(&self.output.join("contact_sheet.png"))?;
            film.write_statistics(&self.output)?;
            Ok(film)
        });
        terminal.finish();
        let film = film?;
        let mut times: Vec<f64> = film.frames().iter().map(|frame| 1e3 * frame.seconds).collect();
        times.sort_by(f64::total_cmp);
        if let (Some(least), Some(most)) = (times.first(), times.last()) {
            print(format_args!(
                "{}: {} frames, {} spheres, {:.1} ms in the median, {least:.1} to {most:.1} ms\n",
                self.output.display(),
                times.len(),
                film.frames()[0].proxies,
                times[times.len() / 2]
            ))?;
        }
        if film.frames().len() < self.frames as usize { Err(Error::Interrupted.into()) } else { Ok(()) }
    }
}

/// All bodies at one time.
pub struct Stage {
    /// What is seen.
    pub bodies: Vec<crate::proxy::Surface>,
    /// What stands for it.
    pub proxies: Vec<crate::proxy::Proxy>,
}

impl Stage {
    /// The actors `time` seconds after they started.
    pub fn new(actors: &[Actor], time: f64) -> Result<Self> {
        let mut stage = Self { bodies: Vec::new(), proxies: Vec::new() };
        for actor in actors {
            let Posed { surface, proxies } = actor.pose(time)?;
            stage.bodies.push(surface);
            stage.proxies.extend(proxies);
        }
        Ok(stage)
    }
}

/// The scene with its characters.
pub fn animated(named: Option<&std::path::Path>) -> Result<Scene> {
    let scene = match named {
        None => Scene::builtin("walkers")?,
        named => scene(named)?,
    };
    if scene.characters.is_empty() {
        return Err(Error::input("the scene has no [[character]], so nothing moves; `walkers` is one that has"));
    }
    Ok(scene)
}

/// The characters with `spheres` in all, if that is given.
pub fn with_spheres(mut bodies: Vec<Body>, spheres: Option<usize>) -> Result<Vec<Body>> {
    if let Some(spheres) = spheres {
        let count = bodies.len();
        for (i, body) in bodies.iter_mut().enumerate() {
            *body.spheres_mut() = spheres / count + usize::from(i < spheres % count);
            body.check()?;
        }
    }
    Ok(bodies)
}

/// The light named on the command line, else the scene's.
pub fn lighting(options: &LightOptions, own: Option<Environment>) -> std::result::Result<Environment, Failure> {
    match options.load()?.or(own) {
        Some(environment) => Ok(environment),
        None => {
            Err(Failure::Usage("proxies need light: name an environment by --environment or in the scene file".into()))
        }
    }
}

fn positive(text: &str) -> std::result::Result<f64, String> {
    magnitude(text).ok().filter(|x| *x > 0.0).ok_or_else(|| "not a finite number above 0".into())
}
