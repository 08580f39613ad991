//! `silhouette inspect`.

use std::path::PathBuf;

use crate::report::{EnvironmentInspection, Inspection, draw_environment, draw_geometry};
use crate::scene::Environment;

use super::options::scene;
use super::{Failure, print};

/// Print and draw what is found in a mesh, a scene or an environment.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  silhouette inspect bunny.obj\n  silhouette inspect scene.toml -o scene.png\n  \
    silhouette inspect studio.exr\n  silhouette inspect room")]
pub struct Args {
    /// Mesh (.obj, .ply, .gltf, .glb), scene (.toml), environment (.exr, .hdr), or the name of a built-in scene
    pub file: PathBuf,
    /// Picture to write: three views with irregular edges marked, or the environment
    #[arg(short, long, value_name = "PNG")]
    pub output: Option<PathBuf>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> Result<(), Failure> {
    let extension = args.file.extension().map(|extension| extension.to_ascii_lowercase());
    if extension.is_some_and(|extension| extension == "exr" || extension == "hdr") {
        let environment = Environment::load(&args.file)?;
        print(format_args!("{}\n", EnvironmentInspection::new(&environment)))?;
        return match &args.output {
            Some(path) => Ok(draw_environment(&environment)?.write(path)?),
            None => Ok(()),
        };
    }
    let scene = scene(Some(&args.file))?;
    print(format_args!("{}\n", Inspection::new(&scene.geometry)))?;
    if let Some(environment) = &scene.environment {
        print(format_args!("{}\n", EnvironmentInspection::new(environment)))?;
    }
    match &args.output {
        Some(path) => Ok(draw_geometry(&scene.geometry)?.write(path)?),
        None => Ok(()),
    }
}
