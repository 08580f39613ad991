use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use crate::proxy::{Character, MAX_SPHERES, Sphere, SphereSet, Tightness, fit};
use crate::report::draw_spheres;
use crate::scene::Geometry;
use crate::{Error, Result};

use super::options::{finite, scene};
use super::terminal::Terminal;
use super::{Failure, print, say};

/// Spheres that stand for a mesh: fits them, shows them
#[derive(Args)]
pub struct Proxies {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    Fit(Fit),
    Show(Show),
}

/// Fits spheres to a mesh, all of it inside them and as little as possible of what is outside
#[derive(Args)]
#[command(after_help = FIT_EXAMPLES)]
struct Fit {
    /// Mesh (.obj, .ply, .gltf, .glb), scene (.toml) or the name of a built-in scene; skinned glTF files keep their joints
    mesh: PathBuf,
    /// Number of spheres
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=MAX_SPHERES as i64))]
    spheres: u32,
    /// Sphere set to write
    #[arg(short, long, value_name = "SET.json")]
    output: PathBuf,
    /// Picture to write: the mesh above the spheres, from three sides
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    /// Leave out the mesh of this node of a skinned glTF file; can be given again
    #[arg(long, value_name = "NAME")]
    without: Vec<String>,
    /// No progress
    #[arg(long, short)]
    quiet: bool,
}

const FIT_EXAMPLES: &str = "\
Examples:
  silhouette proxies fit bunny.obj --spheres 64 -o bunny.json --picture bunny.png
  silhouette proxies fit knight.glb --spheres 100 -o knight.json --without Round_Shield";

/// Tells and draws what is in a sphere set, in a pose of its character if one is named
#[derive(Args)]
#[command(after_help = SHOW_EXAMPLES)]
struct Show {
    /// Sphere set (.json)
    set: PathBuf,
    /// What the spheres stand for: mesh, scene or skinned glTF file
    mesh: Option<PathBuf>,
    /// Picture to write: the mesh, if named, above the spheres, from three sides
    #[arg(short, long, value_name = "PNG")]
    output: Option<PathBuf>,
    /// Clip of the skinned glTF file [default: its rest pose]
    #[arg(long, value_name = "NAME", requires = "mesh")]
    clip: Option<String>,
    /// Seconds into the clip
    #[arg(long, value_name = "S", requires = "clip", default_value_t = 0.0, value_parser = finite)]
    time: f64,
    /// Leave out the mesh of this node of a skinned glTF file; can be given again
    #[arg(long, value_name = "NAME", requires = "mesh")]
    without: Vec<String>,
}

const SHOW_EXAMPLES: &str = "\
Examples:
  silhouette proxies show robot_arm.json robot_arm.obj -o robot_arm.png
  silhouette proxies show knight.json knight.glb --clip Walking_A --time 0.4 -o walking.png";

impl Proxies {
    /// Runs the subcommand.
    pub fn run(&self) -> std::result::Result<(), Failure> {
        match &self.task {
            Task::Fit(fit) => fit.run(),
            Task::Show(show) => show.run(),
        }
    }
}

impl Fit {
    fn run(&self) -> std::result::Result<(), Failure> {
        let character = character(&self.mesh, &self.without)?;
        let geometry = match &character {
            Some(character) => character.geometry(&character.rest())?,
            None => scene(Some(&self.mesh))?.geometry,
        };
        let terminal = Terminal::new(self.quiet);
        let fitted = fit(&geometry, self.spheres as usize, &terminal);
        terminal.finish();
        let (set, tightness) = fitted?;
        let kept = match &character {
            Some(character) => character.attach(&set)?,
            None => set.clone(),
        };
        kept.save(&self.output)?;
        if let Some(path) = &self.picture {
            let drawn: Vec<Sphere> =
                set.spheres.iter().zip(&kept.spheres).map(|(s, kept)| Sphere { joint: kept.joint, ..*s }).collect();
            draw_spheres(Some(&geometry), &drawn)?.write(path)?;
        }
        print(format_args!("{tightness}\n"))
    }
}

impl Show {
    fn run(&self) -> std::result::Result<(), Failure> {
        let set = SphereSet::load(&self.set)?;
        let (spheres, geometry) = self.placed(&set)?;
        match &geometry {
            Some(geometry) => {
                print(format_args!("{}\n", Tightness::new(geometry, &spheres)))?;
                let diagonal = geometry.bounds().map_or(0.0, |[low, high]| f64::from(low.distance(high)));
                match SphereSet::uncovered(geometry, &spheres, 1e-4 * diagonal) {
                    None => print("the spheres hold all of the surface\n")?,
                    Some(p) => print(format_args!("part of the surface lies outside, as around {p:.4}\n"))?,
                }
            }
            None => print(table(&set))?,
        }
        match &self.output {
            Some(path) => Ok(draw_spheres(geometry.as_ref(), &spheres)?.write(path)?),
            None => Ok(()),
        }
    }

    /// The spheres in the world, and the mesh that they stand for.
    fn placed(&self, set: &SphereSet) -> Result<(Vec<Sphere>, Option<Geometry>)> {
        let Some(mesh) = &self.mesh else { return Ok((set.spheres.clone(), None)) };
        let character = match &self.clip {
            // A clip needs a character: what is missing is said.
            Some(_) => Some(Character::load(mesh)?.without(&self.without)?),
            None => character(mesh, &self.without)?,
        };
        let Some(character) = character else {
            if let Some(joint) = set.joints.first() {
                let message =
                    format!("is no skinned glTF file, but the spheres hang on joints such as `{}`", joint.name);
                return Err(Error::file(mesh, message));
            }
            return Ok((set.spheres.clone(), Some(scene(Some(mesh))?.geometry)));
        };
        let pose = match &self.clip {
            Some(name) => {
                let clip = character.clip(name)?;
                if self.time > clip.duration {
                    say(format_args!("note: `{name}` ends after {:.3} s", clip.duration));
                }
                character.pose(clip, self.time)
            }
            None => character.rest(),
        };
        Ok((character.place(set, &pose)?, Some(character.geometry(&pose)?)))
    }
}

/// The character in a file; none where it is another kind of file or has no skin.
fn character(path: &Path, without: &[String]) -> Result<Option<Character>> {
    let is_gltf = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf"));
    let found = if is_gltf { Character::find(path)? } else { None };
    match found {
        Some(character) => character.without(without).map(Some),
        None if without.is_empty() => Ok(None),
        None => Err(Error::file(path, "is no skinned glTF file, so --without names nothing in it")),
    }
}

fn table(set: &SphereSet) -> String {
    let mut table = format!("{:>6} {:>12} {:>12} {:>12} {:>12} joint\n", "sphere", "x", "y", "z", "radius");
    for (i, sphere) in set.spheres.iter().enumerate() {
        let joint = sphere.joint.map_or("-", |joint| &set.joints[joint as usize].name);
        let [x, y, z] = sphere.center.to_array();
        table += &format!("{i:>6} {x:>12.6} {y:>12.6} {z:>12.6} {:>12.6} {joint}\n", sphere.radius);
    }
    table
}
