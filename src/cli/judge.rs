use std::path::PathBuf;

use clap::Args;

use crate::bake::{Control, Method};
use crate::proxy::{
    DistantLight, Exponential, IndirectOperator, Interpolant, Overlap, Proxy, Renderer, SelfShadowing, Settings,
    StaticScene, Surface, Truth, Upsampling, Viewport, draw,
};
use crate::report::{Deviation, Judgement, Verdict};
use crate::scene::Camera;
use crate::sphere::Order;
use crate::{Error, Result};

use super::options::magnitude;
use super::stage::{Bodies, Stage, StageOptions, pose};
use super::{Failure, print};

/// Compares the sphere proxies' shadows with exact ones: every mode against the same spheres and against the true surfaces
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Judge {
    #[command(flatten)]
    stage: StageOptions,
    /// Folder for the tables and the pictures of differences
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Seconds after the start at which the frame is taken
    #[arg(long, value_name = "T", default_value_t = 0.0, value_parser = magnitude)]
    time: f64,
    /// Pixels in a row and rows of the frame
    #[arg(long, value_name = "N", default_value_t = 192, value_parser = clap::value_parser!(u32).range(8..=2048))]
    size: u32,
    /// Rays per pixel against the spheres
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u32).range(8..=1 << 16))]
    samples: u32,
    /// Isolines per pixel against the true surfaces
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(4..=1 << 16))]
    isolines: u32,
}

const EXAMPLES: &str = "\
Written are judgement.csv, judgement.md and, for every mode, a picture of its errors: differences.png. Errors are those of
irradiance over its greatest value without shadows, in the same light of as many bands. Shadows of what stands still are left
out, of the truth too, unless they are baked.

Examples:
  silhouette judge -o verdict
  silhouette judge walkers --time 0.7 --size 256 --samples 4096 -o verdict
  silhouette judge --bake 64 -o verdict";

/// One way to render the frame.
struct Case {
    group: &'static str,
    mode: String,
    settings: Settings,
    spheres: Option<usize>,
    subject: Subject,
}

/// What is judged.
#[derive(Clone, Copy, PartialEq)]
enum Subject {
    /// The whole frame.
    Frame,
    /// Bodies in the shadows of what stands still, without spheres: with their probes or, to show what these are worth, without.
    Bodies { probes: bool },
}

impl Judge {
    /// Renders the frame in all ways, compares and writes.
    pub fn run(&self) -> std::result::Result<(), Failure> {
        let stage = self.stage.load()?;
        let camera = stage.camera.with_resolution([self.size; 2])?;
        std::fs::create_dir_all(&self.output).map_err(|error| Error::file(&self.output, error))?;
        let terminal = self.stage.terminal();
        let pool = self.stage.pool()?;
        let judgement = pool.install(|| -> Result<Judgement> {
            let static_scene = stage.bake.map(|_| StaticScene::new(&stage.geometry));
            let mut court = Court {
                judge: self,
                stage: &stage,
                camera,
                static_scene,
                sets: Vec::new(),
                surfaces: None,
                truths: Vec::new(),
            };
            let mut judgement = Judgement::default();
            let mut posed: Vec<(Option<usize>, Bodies)> = Vec::new();
            for case in cases(stage.bake.is_some())? {
                // Fitting takes a while: once for every number of spheres.
                let wanted = case.spheres.or(stage.spheres);
                if posed.iter().all(|(spheres, _)| *spheres != wanted) {
                    posed.push((wanted, pose(&stage.actors(wanted, &terminal)?, self.time)?));
                }
                let Some((_, bodies)) = posed.iter().find(|(spheres, _)| *spheres == wanted) else { continue };
                court.judge(&case, bodies, &mut judgement, &terminal)?;
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
    stage: &'a Stage,
    camera: Camera,
    /// Where shadows of what stands still count.
    static_scene: Option<StaticScene>,
    /// The set, and the transfer vectors of the bodies' vertices, by their order.
    sets: Vec<(Order, Surface, Vec<Surface>)>,
    surfaces: Option<Truth>,
    /// By their spheres: cases share them.
    truths: Vec<(Vec<Proxy>, Truth)>,
}

impl Court<'_> {
    /// The set and the bodies, with what was baked for this order.
    fn baked(&mut self, order: Order, bodies: &[Surface], control: &dyn Control) -> Result<(Surface, Vec<Surface>)> {
        if self.sets.iter().all(|(known, ..)| *known != order) {
            let set = self.stage.set(order, control)?;
            let mut bodies = bodies.to_vec();
            let actors = self.stage.actors(self.stage.spheres, control)?;
            if let Some(mut probes) = self.stage.probes(&actors, order)? {
                probes.shade(&mut bodies, control)?;
            }
            self.sets.push((order, set, bodies));
        }
        let found = self.sets.iter().find(|(known, ..)| *known == order);
        Ok(found.map(|(_, set, bodies)| (set.clone(), bodies.clone())).unwrap_or_default())
    }

    fn judge(
        &mut self,
        case: &Case,
        (bodies, proxies): &Bodies,
        judgement: &mut Judgement,
        control: &dyn Control,
    ) -> Result<()> {
        let Case { group, mode, settings, subject, .. } = case;
        let (set, shaded) = self.baked(settings.order, bodies, control)?;
        let bodies_alone = matches!(subject, Subject::Bodies { .. });
        let light = DistantLight::new(&self.stage.environment, settings.order);
        let mut renderer = Renderer::new(*settings, &self.camera, &set, &light, None)?;
        let spheres = if bodies_alone { &[][..] } else { proxies };
        renderer.render(if *subject == (Subject::Bodies { probes: false }) { bodies } else { &shaded }, spheres)?;
        let display = renderer.display();
        if self.surfaces.is_none() {
            let method = Method::Isolines { lines: self.judge.isolines };
            let set = self.static_scene.is_some().then_some(&self.stage.geometry);
            self.surfaces = Some(Truth::of_surfaces(display, bodies, set, method, control)?);
        }
        if !self.truths.iter().any(|(spheres, _)| spheres == proxies) {
            let samples = self.judge.samples;
            // Cases of all orders share it.
            let light = DistantLight::new(&self.stage.environment, Order::new(6)?);
            let truth = Truth::of_spheres(display, proxies, &light, self.static_scene.as_ref(), samples, control)?;
            self.truths.push((proxies.clone(), truth));
        }
        let spheres = self.truths.iter().find(|(spheres, _)| spheres == proxies).map(|(_, truth)| truth);
        let (Some(spheres), Some(surfaces)) = (spheres, &self.surfaces) else { return Ok(()) };

        let viewport = Viewport { camera: self.camera.clone(), scale: 1 };
        let mut still = viewport.nothing(set.transfer_len);
        draw(&viewport, &set, &mut still);
        let is_judged = |place: usize| !bodies_alone || display.depth[place] != still.depth[place];

        let [width, height] = renderer.size();
        let greatest = light.greatest_irradiance();
        let reflects = settings.indirect.is_some();
        // Irradiance in the picture, and how far it is from the truth.
        let irradiance = |i: usize| {
            let place = display.index(i % width, i / width);
            (display.is_seen(place) && is_judged(place)).then(|| {
                let (radiance, albedo) = (renderer.radiance()[i], display.albedo.each_ref().map(|plane| plane[place]));
                let colour = |c: usize| std::f64::consts::PI * f64::from(radiance[c]) / f64::from(albedo[c].max(1e-6));
                (place, [0, 1, 2].map(colour))
            })
        };
        let errors = |truth: &Truth| -> Vec<Option<[f64; 3]>> {
            let error = |i: usize| {
                let (place, found) = irradiance(i)?;
                let open = surfaces.open(place, &light)?;
                let hidden = if bodies_alone { [0.0; 3] } else { truth.hidden(place, &light)? };
                let reflected = if reflects { truth.reflected(place)? } else { [0.0; 3] };
                // No surface is darker than black, and bands that ring would have it.
                let expected = |c: usize| (open[c] - hidden[c] + reflected[c]).max(0.0);
                Some(std::array::from_fn(|c| (found[c] - expected(c)) / greatest))
            };
            (0..width * height).map(error).collect()
        };
        let deviation = |errors: &[Option<[f64; 3]>]| Deviation::new(errors.iter().flatten().flatten().copied());
        let against_spheres = errors(spheres);
        let verdict = Verdict {
            group: (*group).into(),
            mode: mode.clone(),
            spheres: deviation(&against_spheres),
            surfaces: (!reflects && !bodies_alone).then(|| deviation(&errors(surfaces))),
        };
        let magnitude = |error: &Option<[f64; 3]>| error.map(|e| (e.iter().map(|x| x * x).sum::<f64>() / 3.0).sqrt());
        let magnitudes: Vec<Option<f64>> = against_spheres.iter().map(magnitude).collect();
        judgement.add(verdict, width, height, &magnitudes)
    }
}

/// All modes: one thing at a time differs from order 4, `ps2`, the clipped rule and receivers as fine as the display.
fn cases(is_baked: bool) -> Result<Vec<Case>> {
    let order = |bands| Order::new(bands);
    let base = Settings { receiver_scale: 1, indirect: None, error: 1.0 / 256.0, ..Settings::default() };
    let mut cases = Vec::new();
    let mut add = |group, mode: String, settings, spheres| {
        cases.push(Case { group, mode, settings, spheres, subject: Subject::Frame });
    };
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
    for error in [1.0 / 64.0, 1.0 / 128.0, 1.0 / 256.0, 1.0 / 512.0, 1.0 / 1024.0] {
        add("reach", format!("error 1/{}", (1.0 / error) as u32), Settings { error, ..base }, None);
    }
    let inside = Settings { internal_order: order(6)?, ..base };
    for (group, overlap, settings) in [
        ("spheres", Overlap::Shared, base),
        ("spheres, multiplied", Overlap::Multiplied, base),
        ("spheres, order 6 inside", Overlap::Shared, inside),
        ("spheres, multiplied, order 6 inside", Overlap::Multiplied, inside),
        ("spheres, direct", Overlap::Shared, Settings { exponential: Exponential::Direct, ..base }),
    ] {
        for spheres in [40, 80, 120, 200, 400, 800] {
            add(group, spheres.to_string(), Settings { overlap, ..settings }, Some(spheres));
        }
    }
    for operator in [IndirectOperator::PointSampled, IndirectOperator::Averaged, IndirectOperator::Exact] {
        add("with reflected light", operator.to_string(), Settings { indirect: Some(operator), ..base }, None);
    }
    if is_baked {
        for (mode, probes) in [("none", false), ("probes", true)] {
            let (group, mode, subject) = ("static shadows on bodies", mode.into(), Subject::Bodies { probes });
            cases.push(Case { group, mode, settings: base, spheres: None, subject });
        }
    }
    Ok(cases)
}
