use std::path::PathBuf;

use clap::Args;

use crate::bake::{Control, Method};
use crate::proxy::{
    Actor, DistantLight, Exponential, IndirectOperator, Interpolant, Proxy, Renderer, SelfShadowing, Settings, Surface,
    Truth, Upsampling, static_surface,
};
use crate::report::{Deviation, Judgement, Verdict};
use crate::scene::{Camera, Environment};
use crate::sphere::Order;
use crate::{Error, Result};

use super::animate::{Stage, animated, lighting, with_spheres};
use super::options::{LightOptions, framing, magnitude};
use super::run::threads;
use super::terminal::Terminal;
use super::{Failure, print};

/// Compares the sphere proxies' shadows with exact ones: every mode against the same spheres and against the true surfaces
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Judge {
    /// Scene file (.toml) or name of a built-in scene; without it, that of `animate`
    scene: Option<PathBuf>,
    /// Folder for the tables and the pictures of differences
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Seconds after the start at which the frame is taken
    #[arg(long, value_name = "T", default_value_t = 0.0, value_parser = magnitude)]
    time: f64,
    /// Pixels in a row and rows of the frame
    #[arg(long, value_name = "N", default_value_t = 192, value_parser = clap::value_parser!(u32).range(8..=2048))]
    size: u32,
    /// Spheres in all [default: the scene's]
    #[arg(long, value_name = "N")]
    spheres: Option<usize>,
    /// Rays per pixel against the spheres
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u32).range(8..=1 << 16))]
    samples: u32,
    /// Isolines per pixel against the true surfaces
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(4..=1 << 16))]
    isolines: u32,
    #[command(flatten)]
    light: LightOptions,
    /// Threads; the results do not depend on it [default: all processors]
    #[arg(long, value_name = "T", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1024))]
    threads: Option<usize>,
    /// No progress
    #[arg(long, short)]
    quiet: bool,
}

const EXAMPLES: &str = "\
Written are judgement.csv, judgement.md and, for every mode, a picture of its errors: differences.png. Errors are those of
irradiance over its greatest value without shadows, in the same light of as many bands; shadows among what stands still are left
out.

Examples:
  silhouette judge -o verdict
  silhouette judge walkers --time 0.7 --size 256 --samples 4096 -o verdict";

/// One way to render the frame.
struct Case {
    group: &'static str,
    mode: String,
    settings: Settings,
    spheres: Option<usize>,
}

impl Judge {
    /// Renders the frame in all ways, compares and writes.
    pub fn run(&self) -> std::result::Result<(), Failure> {
        let scene = animated(self.scene.as_deref())?;
        let environment = lighting(&self.light, scene.environment)?;
        let camera = match &scene.camera {
            Some(camera) => camera.clone(),
            None => framing(&scene.geometry)?,
        };
        let camera = camera.with_resolution([self.size; 2])?;
        std::fs::create_dir_all(&self.output).map_err(|error| Error::file(&self.output, error))?;
        let set = static_surface(&scene.geometry, camera.position());
        let terminal = Terminal::new(self.quiet);
        let pool = threads(self.threads)?;
        let judgement = pool.install(|| -> Result<Judgement> {
            let mut court = Court { judge: self, camera, set, environment, surfaces: None, truths: Vec::new() };
            let mut judgement = Judgement::default();
            let mut stages: Vec<(Option<usize>, Stage)> = Vec::new();
            for case in cases()? {
                // Fitting takes a while: once for every number of spheres.
                let wanted = case.spheres.or(self.spheres);
                if stages.iter().all(|(spheres, _)| *spheres != wanted) {
                    let bodies = with_spheres(scene.characters.clone(), wanted)?;
                    let actors = bodies.iter().map(|body| Actor::new(body, &terminal)).collect::<Result<Vec<_>>>()?;
                    stages.push((wanted, Stage::new(&actors, self.time)?));
                }
                let Some((_, stage)) = stages.iter().find(|(spheres, _)| *spheres == wanted) else { continue };
                court.judge(&case, stage, &mut judgement, &terminal)?;
            }
            judgement.write(&self.output)?;
            Ok(judgement)
        });
        terminal.finish();
        print(judgement?)
    }
}

/// What all cases share.
struct Court<'a> {
    judge: &'a Judge,
    camera: Camera,
    set: Surface,
    environment: Environment,
    surfaces: Option<Truth>,
    /// By their spheres: cases share them.
    truths: Vec<(Vec<Proxy>, Truth)>,
}

impl Court<'_> {
    fn judge(&mut self, case: &Case, stage: &Stage, judgement: &mut Judgement, control: &dyn Control) -> Result<()> {
        let Case { group, mode, settings, .. } = case;
        let light = DistantLight::new(&self.environment, settings.order);
        let mut renderer = Renderer::new(*settings, &self.camera, &self.set, &light, None)?;
        renderer.render(&stage.bodies, &stage.proxies)?;
        let display = renderer.display();
        if self.surfaces.is_none() {
            let method = Method::Isolines { lines: self.judge.isolines };
            self.surfaces = Some(Truth::of_surfaces(display, &stage.bodies, None, method, control)?);
        }
        if !self.truths.iter().any(|(spheres, _)| *spheres == stage.proxies) {
            let samples = self.judge.samples;
            // Cases of all orders share it.
            let light = DistantLight::new(&self.environment, Order::new(6)?);
            let truth = Truth::of_spheres(display, &stage.proxies, &light, None, samples, control)?;
            self.truths.push((stage.proxies.clone(), truth));
        }
        let spheres = self.truths.iter().find(|(spheres, _)| *spheres == stage.proxies).map(|(_, truth)| truth);
        let (Some(spheres), Some(surfaces)) = (spheres, &self.surfaces) else { return Ok(()) };

        // Irradiance, direct and reflected, by which the frame differs from one without proxies.
        let [width, height] = renderer.size();
        let greatest = light.greatest_irradiance();
        let reflects = settings.indirect.is_some();
        let change = |i: usize| {
            let place = display.index(i % width, i / width);
            display.is_seen(place).then(|| {
                let (with, without) = (renderer.radiance()[i], renderer.unshadowed()[i]);
                let albedo = display.albedo.each_ref().map(|plane| plane[place]);
                let change: [f64; 3] = std::array::from_fn(|c| {
                    std::f64::consts::PI * f64::from(with[c] - without[c]) / f64::from(albedo[c].max(1e-6))
                });
                (place, change)
            })
        };
        let errors = |truth: &Truth| -> Vec<Option<[f64; 3]>> {
            let error = |i: usize| {
                let (place, change) = change(i)?;
                let hidden = truth.hidden(place, &light)?;
                let reflected = if reflects { truth.reflected(place)? } else { [0.0; 3] };
                Some(std::array::from_fn(|c| (change[c] + hidden[c] - reflected[c]) / greatest))
            };
            (0..width * height).map(error).collect()
        };
        let deviation = |errors: &[Option<[f64; 3]>]| Deviation::new(errors.iter().flatten().flatten().copied());
        let against_spheres = errors(spheres);
        let verdict = Verdict {
            group: (*group).into(),
            mode: mode.clone(),
            spheres: deviation(&against_spheres),
            surfaces: (!reflects).then(|| deviation(&errors(surfaces))),
        };
        let magnitude = |error: &Option<[f64; 3]>| error.map(|e| (e.iter().map(|x| x * x).sum::<f64>() / 3.0).sqrt());
        let magnitudes: Vec<Option<f64>> = against_spheres.iter().map(magnitude).collect();
        judgement.add(verdict, width, height, &magnitudes)
    }
}

/// All modes: one thing at a time differs from order 4, `ps2`, the clipped rule and receivers as fine as the display.
fn cases() -> Result<Vec<Case>> {
    let order = |bands| Order::new(bands);
    let base = Settings { receiver_scale: 1, indirect: None, error: 1.0 / 256.0, ..Settings::default() };
    let mut cases = Vec::new();
    let mut add = |group, mode: String, settings, spheres| cases.push(Case { group, mode, settings, spheres });
    for bands in 2..=6 {
        let order = order(bands)?;
        add("order", bands.to_string(), Settings { order, internal_order: order, ..base }, None);
    }
    for exponential in [Exponential::Ol, Exponential::Hyb, Exponential::Ps2, Exponential::Matrix, Exponential::Direct] {
        add("exponential", exponential.to_string(), Settings { exponential, ..base }, None);
    }
    for exponential in [Exponential::Hyb, Exponential::Ps2] {
        let settings = Settings { exponential, internal_order: order(6)?, ..base };
        add("exponential", format!("{exponential}, order 6 inside"), settings, None);
    }
    for self_shadowing in [SelfShadowing::Whole, SelfShadowing::Replaced, SelfShadowing::Clipped] {
        add("self-shadowing", self_shadowing.to_string(), Settings { self_shadowing, ..base }, None);
    }
    for receiver_scale in [1, 2, 4] {
        add("receivers", format!("1 / {receiver_scale}"), Settings { receiver_scale, ..base }, None);
    }
    for upsampling in [Upsampling::Bilinear, Upsampling::Bilateral] {
        for interpolant in [Interpolant::Shades, Interpolant::Vectors] {
            let settings = Settings { receiver_scale: 4, upsampling, interpolant, ..base };
            add("upsampling 4x4", format!("{upsampling}, {interpolant}"), settings, None);
        }
    }
    for error in [1.0 / 32.0, 1.0 / 64.0, 1.0 / 128.0, 1.0 / 256.0] {
        add("reach", format!("error 1/{}", (1.0 / error) as u32), Settings { error, ..base }, None);
    }
    for spheres in [40, 80, 120, 200, 400, 800] {
        add("spheres", spheres.to_string(), base, Some(spheres));
    }
    for operator in [IndirectOperator::PointSampled, IndirectOperator::Averaged, IndirectOperator::Exact] {
        add("with reflected light", operator.to_string(), Settings { indirect: Some(operator), ..base }, None);
    }
    Ok(cases)
}
