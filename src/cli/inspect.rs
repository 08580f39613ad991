//! `silhouette inspect`.

use std::path::PathBuf;

use crate::Result;
use crate::report::{EnvironmentInspection, Inspection, draw_environment, draw_geometry};
use crate::scene::{Environment, Scene};

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
pub fn run(args: &Args) -> Result<()> {
    let extension = args.file.extension().map(|extension| extension.to_ascii_lowercase());
    if extension.is_some_and(|extension| extension == "exr" || extension == "hdr") {
        let environment = Environment::load(&args.file)?;
        println!("{}", EnvironmentInspection::new(&environment));
        return match &args.output {
            Some(path) => draw_environment(&environment)?.write(path),
            None => Ok(()),
        };
    }
    let scene = match args.file.to_str() {
        Some(name) if args.file.extension().is_none() && !args.file.exists() => Scene::builtin(name)?,
        _ => Scene::load(&args.file)?,
    };
    println!("{}", Inspection::new(&scene.geometry));
    if let Some(environment) = &scene.environment {
        println!("{}", EnvironmentInspection::new(environment));
    }
    match &args.output {
        Some(path) => draw_geometry(&scene.geometry)?.write(path),
        None => Ok(()),
    }
}
