use std::path::PathBuf;

use clap::Args;

use crate::Error;
use crate::bake::writers::{Format, Layout, check_target, npz};
use crate::bake::{Prepared, Provenance, Request, flip_phase};
use crate::scene::{Scene, survey_points};

use super::Failure;
use super::method::MethodOptions;
use super::options::{HarmonicsOptions, LightOptions, vertices};
use super::run::{RunOptions, Work};
use super::stream::{BLOCK, on_surface};

/// Integrates visibility and light at any points
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Integrate {
    /// Meshes that cast shadows: .obj, .gltf, .glb, .ply
    #[arg(required = true, value_name = "MESH")]
    meshes: Vec<PathBuf>,
    /// NumPy archive to write
    #[arg(short, long, value_name = "OUT.npz")]
    output: PathBuf,
    /// Receivers: .npy of N x 6, or text with six columns: position and unit normal [default: all vertices]
    #[arg(long, value_name = "FILE")]
    points: Option<PathBuf>,
    /// Derivatives by the position as well: NAME_gradient beside occlusion, visibility and transfer vectors
    #[arg(long)]
    gradients: bool,
    #[command(flatten)]
    method: MethodOptions,
    #[command(flatten)]
    harmonics: HarmonicsOptions,
    #[command(flatten)]
    light: LightOptions,
    #[command(flatten)]
    run: RunOptions,
}

const EXAMPLES: &str = "\
Writes doubles, row i for point i:
  ambient_occlusion [N]         1/pi integral of V max(0, n.w); 1 = open
  visibility_sh [N, order^2]    integral of V [n.w > 0] y
  transfer_sh [N, order^2]      1/pi integral of V max(0, n.w) y
and with --environment
  irradiance [N, 3]             integral of L V max(0, n.w)
  vector_irradiance [N, 3, 3]   integral of L V [n.w > 0] w; colours, then axes
and with --gradients (--method exact), per unit of length of the scene
  ambient_occlusion_gradient [N, 3], visibility_sh_gradient and transfer_sh_gradient [N, order^2, 3]
A point exactly on a face, an edge or a corner is not hidden by the faces that meet there.

Examples:
  silhouette integrate bunny.obj -o bunny.npz
  silhouette integrate bunny.obj --points probes.npy --isolines 512 -o probes.npz
  silhouette integrate a.glb b.ply --environment sky.exr --up z --stats stats.json -o light.npz
  silhouette integrate bunny.obj --points probes.npy --method exact --gradients -o probes.npz
  silhouette integrate bunny.obj --lobe 8 --lobe-error 0.2 -o glossy.npz
  silhouette integrate bunny.obj --method qmc --samples 65536 -o judge.npz";

impl Integrate {
    /// Integrates and writes the archive.
    pub fn run(&self) -> Result<(), Failure> {
        let choice = self.method.choice_with(self.gradients)?;
        if Format::of(&self.output, Layout::Vertices)? != Format::Npz {
            return Err(Error::file(&self.output, "integrate writes .npz").into());
        }
        check_target(&self.output, Layout::Vertices)?;
        let (order, parameters) = self.harmonics.order(Provenance::default(), self.run.quiet)?;
        let lit = self.light.environment.is_some();
        let request = Request {
            order: order.bands(),
            ambient_occlusion: true,
            visibility_sh: true,
            transfer_sh: true,
            bent_normal: false,
            irradiance: lit,
            vector_irradiance: lit,
            gradients: self.gradients,
        };
        let meshes = self.meshes.iter().map(|mesh| mesh.display().to_string()).collect::<Vec<_>>().join(", ");
        let points = self.points.as_ref().map_or("vertices".into(), |points| points.display().to_string());
        let parameters = parameters.with("meshes", meshes).with("points", points).with("gradients", self.gradients);
        let parameters = self.light.record(parameters);

        let scene = Scene::from_meshes(&self.meshes)?;
        let environment = self.light.load()?;
        let prepared = Prepared::new(&scene.geometry, environment.as_ref());
        let (count, receivers) = match &self.points {
            Some(points) => {
                let (count, sample) = survey_points(points, BLOCK)?;
                (count, on_surface(sample, &prepared))
            }
            None => (scene.geometry.positions.len(), vertices(&scene.geometry)),
        };
        let work =
            Work { prepared: &prepared, receivers: &receivers, request: &request, choice, earlier: None, parameters };
        let (pool, phase) = (self.run.pool()?, self.harmonics.phase());
        if let Some(points) = self.points.as_ref().filter(|_| count > BLOCK) {
            return Ok(self.run.stream(&work, points, count, phase, &self.output, &pool)?);
        }
        let (arrays, provenance) = self.run.integrate(&work, &self.output, &pool)?;
        let arrays = if phase == provenance.sh_phase { arrays } else { flip_phase(arrays, 1)? };
        npz::write(&self.output, &arrays, &Provenance { sh_phase: phase, ..provenance })?;
        Ok(self.run.discard_kept(&self.output)?)
    }
}
