use std::path::PathBuf;

use clap::Args;
use glam::{DMat3, DVec3};

use crate::bake::Control;
use crate::proxy::{DistantLight, Engine, FrameStatistics};
use crate::report::Film;
use crate::{Error, Result};

use super::options::positive;
use super::proxy_options::{Device, ProxyOptions};
use super::stage::{StageOptions, pose};
use super::{Failure, print};

/// Renders a film of moving bodies by sphere proxies: soft shadows and reflected light, in real time
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Animate {
    #[command(flatten)]
    stage: StageOptions,
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
    /// Degrees per second by which the light turns about the y axis
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    turn_light: f64,
    #[command(flatten)]
    proxies: ProxyOptions,
}

const EXAMPLES: &str = "\
Written are frame_0000.png, ..., contact_sheet.png, frames.csv, frames.json and a plot of the times, frames.png. Times are of
rendering alone, from the bodies' pose to the radiance of every pixel.

Examples:
  silhouette animate -o film
  silhouette animate walkers.toml --frames 240 --fps 24 --bake 64 -o film
  silhouette animate --device gpu -o film
  silhouette animate --environment studio.exr --turn-light 30 --exponential hyb --self-shadowing replaced -o film";

impl Animate {
    /// Renders and writes the frames.
    pub fn run(&self) -> std::result::Result<(), Failure> {
        let settings = self.proxies.settings()?;
        let stage = self.stage.load()?;
        let [width, height] = stage.camera.resolution();
        let camera = stage.camera.with_resolution([self.width.unwrap_or(width), self.height.unwrap_or(height)])?;

        let pool = self.stage.pool()?;
        let terminal = self.stage.terminal();
        let film = pool.install(|| -> Result<(Film, String)> {
            let actors = stage.actors(stage.spheres, &terminal)?;
            let set = stage.set(settings.order, &terminal)?;
            let mut probes = stage.probes(&actors, settings.order)?;
            let environment = &stage.environment;
            let light = DistantLight::new(environment, settings.order);
            let engine = match self.device {
                Device::Cpu => Engine::cpu,
                Device::Gpu => Engine::gpu,
            };
            let mut renderer = engine(settings, &camera, &set, &light, Some(environment))?;
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
                    renderer.set_light(&light.rotated(turn), Some(environment));
                }
                let (mut bodies, proxies) = pose(&actors, time)?;
                if let Some(probes) = &mut probes {
                    probes.shade(&mut bodies, &terminal)?;
                }
                let statistics = renderer.render(&bodies, &proxies)?;
                let [width, height] = renderer.size();
                let picture = film.add(width, height, renderer.radiance(), statistics);
                picture.write(&self.output.join(format!("frame_{frame:04}.png")))?;
                terminal.advance(1);
            }
            film.contact_sheet().write(&self.output.join("contact_sheet.png"))?;
            film.write_statistics(&self.output)?;
            Ok((film, renderer.device().to_owned()))
        });
        terminal.finish();
        let (film, device) = film?;
        if let Some(first) = film.frames().first() {
            let [least, median, most] = spread(film.frames(), |frame| frame.seconds);
            type Seconds = fn(&FrameStatistics) -> f64;
            let stages: [(&str, Seconds); 6] = [
                ("set-up", |frame| frame.setup_seconds),
                ("splat", |frame| frame.splat_seconds),
                ("exponentiate", |frame| frame.exponentiate_seconds),
                ("indirect", |frame| frame.indirect_seconds),
                ("shade", |frame| frame.shade_seconds),
                ("upsample", |frame| frame.upsample_seconds),
            ];
            let stages = stages.map(|(name, seconds)| format!("{name} {:.1}", spread(film.frames(), seconds)[1]));
            print(format_args!(
                "{}: {} frames, {} spheres, on {device}: {median:.1} ms in the median, {least:.1} to {most:.1} ms\n{}\n",
                self.output.display(),
                film.frames().len(),
                first.proxies,
                stages.join(", ")
            ))?;
        }
        if film.frames().len() < self.frames as usize { Err(Error::Interrupted.into()) } else { Ok(()) }
    }
}

/// The least, the median and the greatest of all frames' times, in milliseconds.
fn spread(frames: &[FrameStatistics], seconds: impl Fn(&FrameStatistics) -> f64) -> [f64; 3] {
    let mut times: Vec<f64> = frames.iter().map(|frame| 1e3 * seconds(frame)).collect();
    times.sort_by(f64::total_cmp);
    [0, times.len() / 2, times.len() - 1].map(|i| times[i])
}
