use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::RangedU64ValueParser;

use crate::Result;
use crate::race::{Quantity, Settings, Track, over_plane, race};
use crate::scene::load_meshes;

use super::options::{expect_scene, positive, scene};
use super::run::command_line;
use super::terminal::Terminal;
use super::{Failure, print};

/// Races the methods against each other and against rays: time at equal error, every value checked first
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Race {
    /// Built-in scenes, scene files (.toml) or meshes [default: all built-in scenes that are meant for it]
    #[arg(value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// Folder for race.md, race.csv and the plots
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Set mesh files, brought to a half-size of 1, over a plane
    #[arg(long)]
    over_plane: bool,
    /// What is integrated
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = Load::ALL)]
    quantities: Vec<Load>,
    /// Threads; on all but the first number each method runs at one setting only
    #[arg(long, value_name = "T", value_delimiter = ',', default_values_t = [1],
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=1024))]
    threads: Vec<usize>,
    /// Receivers, about: whole tiles of the bake of a light map [default: 1024; quick: 64]
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..=131_072))]
    receivers: Option<usize>,
    /// Points along a side of the light map: how many neighbours share a tile, up to 128 [default: 1024; quick: 256]
    #[arg(long, value_name = "SIDE", value_parser = RangedU64ValueParser::<usize>::new().range(1..=8192))]
    light_map: Option<usize>,
    /// Seconds that a run may take; dearer settings are left out [default: 8; quick: 0.05]
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    budget: Option<f64>,
    /// Rounds; the least time counts [default: 2; quick: 1]
    #[arg(long, value_name = "R", value_parser = clap::value_parser!(u32).range(1..=100))]
    repeats: Option<u32>,
    /// A small race, to see that it works: icosphere alone unless scenes are named
    #[arg(long)]
    quick: bool,
    /// No progress
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Load {
    /// Ambient occlusion
    Occlusion,
    /// Visibility in four bands of spherical harmonics
    Harmonics,
    /// Irradiance from a textured sky with a small sun
    Light,
}

impl Load {
    const ALL: [Self; 3] = [Self::Occlusion, Self::Harmonics, Self::Light];

    fn quantity(self) -> Quantity {
        match self {
            Self::Occlusion => Quantity::Occlusion,
            Self::Harmonics => Quantity::Harmonics,
            Self::Light => Quantity::Light,
        }
    }
}

/// Scenes of the default race.
const SCENES: [&str; 10] = [
    "icosphere",
    "knots_25k",
    "knots_100k",
    "knots_400k",
    "knots_2m",
    "foliage",
    "room_closed",
    "room",
    "room_open",
    "building",
];

const EXAMPLES: &str = "\
Isolines, exact, rays, rays on Embree (in builds with the feature `embree`) and the planner (auto) solve the same
receivers in bake order. What is finished is in DIR at any time, after Ctrl-C too.

Examples:
  silhouette race --quick -o race
  silhouette race -o race
  silhouette race knots_25k knots_100k --quantities occlusion --threads 1,2 -o race
  silhouette race bunny.obj dragon.obj --over-plane -o race";

impl Race {
    /// Races, and prints the report.
    pub fn run(&self) -> std::result::Result<(), Failure> {
        let names: Vec<PathBuf> = match (&self.scenes[..], self.quick) {
            ([], true) => vec![SCENES[0].into()],
            ([], false) => SCENES.map(PathBuf::from).into(),
            (named, _) => named.to_vec(),
        };
        names.iter().try_for_each(|name| expect_scene(name))?;
        let receivers = self.receivers.unwrap_or(if self.quick { 64 } else { 1024 });
        let settings = Settings {
            repeats: self.repeats.unwrap_or(if self.quick { 1 } else { 2 }),
            budget: self.budget.unwrap_or(if self.quick { 0.05 } else { 8.0 }),
        };
        let quantities: Vec<Quantity> = self.quantities.iter().map(|load| load.quantity()).collect();
        let terminal = Terminal::new(self.quiet);
        let side = self.light_map.unwrap_or(if self.quick { 256 } else { 1024 });
        let tracks = names.iter().map(|name| self.track(name, receivers, side));
        let result = race(tracks, &quantities, &self.threads, settings, command_line(), &self.output, &terminal);
        terminal.finish();
        print(result?.markdown())?;
        Ok(())
    }

    fn track(&self, path: &Path, receivers: usize, side: usize) -> Result<Track> {
        let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let is_mesh = path.extension().is_some_and(|extension| extension != "toml");
        if self.over_plane && is_mesh {
            return Track::new(name, over_plane(load_meshes(path)?)?, None, receivers, side);
        }
        let scene = scene(Some(path))?;
        Track::new(name, scene.geometry, scene.environment, receivers, side)
    }
}
