use std::path::PathBuf;

use clap::{Args, ValueEnum};

use std::path::Path;

use crate::bake::writers::{Layout, check_target, write};
use crate::bake::{Arrays, Baked, BakedVertices, Prepared, Provenance, Request};
use crate::integrand::{environment_harmonics, relit};
use crate::report;
use crate::scene::{FaceTree, Scene, Sky};
use crate::sphere::Order;
use crate::{Error, Result};

use super::Failure;
use super::method::MethodOptions;
use super::options::{HarmonicsOptions, framing, scene, vertices};
use super::run::{RunOptions, Work};
use super::update::UpdateOptions;

/// Bakes visibility at the vertices of a scene
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Bake {
    /// Scene file (.toml) or mesh; without it, a built-in scene
    scene: Option<PathBuf>,
    /// File to write: .npz, .ply, .exr or .glb
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// What to bake
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = Quantity::ALL)]
    quantities: Vec<Quantity>,
    /// Picture of the result under a built-in sky [default: beside OUT for the built-in scene, else none]
    #[arg(long, value_name = "PNG")]
    preview: Option<PathBuf>,
    /// Derivatives by the position as well: NAME_gradient beside occlusion, visibility and transfer vectors
    #[arg(long)]
    gradients: bool,
    #[command(flatten)]
    method: MethodOptions,
    #[command(flatten)]
    harmonics: HarmonicsOptions,
    #[command(flatten)]
    update: UpdateOptions,
    #[command(flatten)]
    run: RunOptions,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Quantity {
    /// Cosine transfer vectors in spherical harmonics
    Transfer,
    /// Visibility of the upper hemisphere in spherical harmonics
    Visibility,
    /// Ambient occlusion; 1 = open
    Occlusion,
    /// Mean unoccluded direction
    BentNormal,
}

impl Quantity {
    const ALL: [Self; 4] = [Self::Transfer, Self::Visibility, Self::Occlusion, Self::BentNormal];
}

const EXAMPLES: &str = "\
Coefficients are real and orthonormal, index l*l + l + m, Y_1 = sqrt(3/4pi) (y, z, x). By extension:
  .npz  transfer_sh, visibility_sh, ambient_occlusion, bent_normal, positions, normals, triangles
  .ply  one property per coefficient: sh_l1_m-1, transfer_l1_m-1, ...
  .exr  one channel per coefficient: sh.l1.m-1, ...; vertex i at pixel (i mod 1024, i div 1024)
  .glb  attributes _SH_0 (coefficients 0 to 3), _SH_1, ..., _TRANSFER_0, ..., _AMBIENT_OCCLUSION, _BENT_NORMAL

Examples:
  silhouette bake -o teapot.glb
  silhouette bake room.toml -o room.npz --order 6 --isolines 512
  silhouette bake dragon.obj -o dragon.ply --quantities occlusion,bent-normal
  silhouette bake room.toml -o room.npz --quantities transfer --lobe diffuse
  silhouette bake dragon.obj -o dragon.npz --error 1e-3  in the least time
  silhouette bake dragon.obj -o dragon.ply --resume      after Ctrl-C
  silhouette bake moved.toml -o moved.npz --update room.npz --before room.toml
                                                         only what the move can change";

impl Bake {
    /// Bakes and writes the file, and the preview.
    pub fn run(&self) -> std::result::Result<(), Failure> {
        let choice = self.method.choice_with(self.gradients)?;
        check_target(&self.output, Layout::Vertices)?;
        let preview = match (&self.preview, &self.scene) {
            (None, None) => Some(self.output.with_extension("png")),
            (preview, _) => preview.clone(),
        };
        if let Some(preview) = &preview {
            check_target(preview, Layout::Image)?;
        }
        let (order, parameters) = self.harmonics.order(Provenance::default(), self.run.quiet)?;
        let wanted = |quantity| self.quantities.contains(&quantity);
        let request = Request {
            order: order.bands(),
            ambient_occlusion: wanted(Quantity::Occlusion),
            visibility_sh: wanted(Quantity::Visibility),
            transfer_sh: wanted(Quantity::Transfer) || preview.is_some(),
            bent_normal: wanted(Quantity::BentNormal),
            gradients: self.gradients,
            ..Request::default()
        };
        let name = self.scene.as_ref().map_or("built-in".into(), |scene| scene.display().to_string());
        let parameters = parameters.with("scene", name).with("gradients", self.gradients);
        let scene = scene(self.scene.as_deref())?;
        let receivers = vertices(&scene.geometry);
        let earlier = self.update.earlier(&scene.geometry)?;

        let prepared = Prepared::new(&scene.geometry, None);
        let work = Work {
            prepared: &prepared,
            receivers: &receivers,
            request: &request,
            choice,
            earlier: earlier.as_ref(),
            parameters,
        };
        let pool = self.run.pool()?;
        let (mut arrays, provenance) = self.run.integrate(&work, &self.output, &pool)?;
        match &preview {
            Some(preview) => pool.install(|| draw(&scene, &prepared.into_faces(), &arrays, order, preview))?,
            None => drop(prepared),
        }
        if !wanted(Quantity::Transfer) {
            arrays.remove("transfer_sh");
            arrays.remove("transfer_sh_error");
        }
        let baked = Baked::Vertices(BakedVertices {
            positions: receivers.positions,
            normals: receivers.normals,
            triangles: scene.geometry.triangles,
            arrays,
            provenance,
        });
        write(&self.output, &baked.in_phase(self.harmonics.phase())?)?;
        Ok(self.run.discard_kept(&self.output)?)
    }
}

/// Draws the scene from its camera, relit by its environment, or a built-in sky, through the transfer vectors.
fn draw(scene: &Scene, faces: &FaceTree, arrays: &Arrays, order: Order, path: &Path) -> Result<()> {
    let environment = match &scene.environment {
        Some(environment) => environment.clone(),
        None => Sky::default().environment()?,
    };
    let camera = match &scene.camera {
        Some(camera) => camera.clone(),
        None => framing(&scene.geometry)?,
    };
    let transfer = arrays.get("transfer_sh").ok_or_else(|| Error::input("a preview needs transfer vectors"))?;
    let light = environment_harmonics(&environment, order);
    let radiance: Vec<[f64; 3]> = transfer.data.chunks_exact(order.len()).map(|row| relit(row, &light)).collect();
    report::preview(&scene.geometry, faces, &radiance, &environment, &camera).write(path)
}
