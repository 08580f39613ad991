use std::path::PathBuf;

use clap::{Args, ValueEnum};

use std::f64::consts::FRAC_1_PI;

use crate::bake::writers::{Layout, check_target, write};
use crate::bake::{Array, Baked, BakedImage, Pixels, Prepared, Provenance, Request};
use crate::scene::Geometry;

use super::Failure;
use super::method::MethodOptions;
use super::options::{LightOptions, framing, scene};
use super::run::{RunOptions, Work};

/// Renders occlusion or direct light, pixel by pixel
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Render {
    /// Scene file (.toml) or mesh; without it, a built-in scene
    scene: Option<PathBuf>,
    /// Image to write: .exr, .png or .npz
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// What to render [default: light where the scene or --environment gives some, else occlusion]
    #[arg(long, value_enum)]
    show: Option<Show>,
    /// Pixels in a row [default: the camera's]
    #[arg(long, value_name = "W", value_parser = clap::value_parser!(u32).range(1..=16384))]
    width: Option<u32>,
    /// Rows [default: the camera's]
    #[arg(long, value_name = "H", value_parser = clap::value_parser!(u32).range(1..=16384))]
    height: Option<u32>,
    #[command(flatten)]
    method: MethodOptions,
    #[command(flatten)]
    light: LightOptions,
    #[command(flatten)]
    run: RunOptions,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Show {
    /// Ambient occlusion, 1 = open
    Occlusion,
    /// Diffuse reflection of the environment, shadows of every frequency
    Light,
}

const EXAMPLES: &str = "\
Examples:
  silhouette render -o teapot.png
  silhouette render room.toml --show occlusion --width 1920 --height 1080 -o room.exr
  silhouette render bunny.obj --environment sky.hdr --rotation 90 -o bunny.png";

impl Render {
    /// Renders and writes the image.
    pub fn run(&self) -> Result<(), Failure> {
        let choice = self.method.choice()?;
        if self.show == Some(Show::Occlusion) && self.light.environment.is_some() {
            return Err(Failure::Usage("--environment means nothing to --show occlusion".into()));
        }
        check_target(&self.output, Layout::Image)?;
        let scene = scene(self.scene.as_deref())?;
        let named = self.light.load()?;
        let environment = named.as_ref().or(scene.environment.as_ref());
        let light = match self.show {
            Some(Show::Light) => true,
            Some(Show::Occlusion) => false,
            None => environment.is_some(),
        };
        if light && environment.is_none() {
            let message = "--show light needs an environment: name one by --environment or in the scene file";
            return Err(Failure::Usage(message.into()));
        }
        let request = Request { order: 1, ambient_occlusion: !light, irradiance: light, ..Request::default() };
        let camera = match &scene.camera {
            Some(camera) => camera.clone(),
            None => framing(&scene.geometry)?,
        };
        let [width, height] = camera.resolution();
        // One side alone keeps the picture's shape.
        let scaled = |side: u32, by: u32, from: u32| (f64::from(side) * f64::from(by) / f64::from(from)).round() as u32;
        let resolution = match (self.width, self.height) {
            (None, None) => [width, height],
            (Some(w), None) => [w, scaled(height, w, width).max(1)],
            (None, Some(h)) => [scaled(width, h, height).max(1), h],
            (Some(w), Some(h)) => [w, h],
        };
        let camera = camera.with_resolution(resolution)?;
        let name = self.scene.as_ref().map_or("built-in".into(), |scene| scene.display().to_string());
        let parameters = Provenance::default()
            .with("scene", name)
            .with("show", if light { "light" } else { "occlusion" })
            .with("width", resolution[0])
            .with("height", resolution[1]);
        let pool = self.run.pool()?;
        let prepared = &Prepared::new(&scene.geometry, environment);
        let pixels = pool.install(|| Pixels::new(&scene.geometry, prepared.faces(), &camera));
        let parameters = self.light.record(parameters);

        let receivers = &pixels.receivers;
        let work = Work { prepared, receivers, request: &request, choice, earlier: None, parameters };
        let (mut arrays, provenance) = self.run.integrate(&work, &self.output, &pool)?;
        if let Some(irradiance) = arrays.get("irradiance") {
            let radiance = reflected(&scene.geometry, &pixels.faces, irradiance);
            arrays.push(radiance)?;
        }
        let [width, height] = camera.resolution().map(|side| side as usize);
        let image = BakedImage::from_rows(width, height, &pixels.indices, arrays, provenance)?;
        write(&self.output, &Baked::Image(image))?;
        Ok(self.run.discard_kept(&self.output)?)
    }
}

/// Radiance that diffuse faces reflect: albedo / pi times irradiance.
fn reflected(geometry: &Geometry, faces: &[u32], irradiance: &Array) -> Array {
    let rows = irradiance.data.chunks_exact(3).zip(faces);
    let radiance = rows.flat_map(|(irradiance, &face)| {
        let material = &geometry.materials[geometry.triangle_material[face as usize] as usize];
        let albedo = material.albedo.as_dvec3().to_array();
        [0, 1, 2].map(|colour| albedo[colour] * FRAC_1_PI * irradiance[colour])
    });
    Array::new("radiance", irradiance.shape.clone(), radiance.collect())
}
