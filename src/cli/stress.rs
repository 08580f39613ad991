use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use crate::bake::Method;
use crate::report::draw_view;
use crate::stress::{Case, Row, Settings, Table, Truth, Verdict, at_random, battery, try_case};
use crate::{Error, Result};

use super::options::scene;
use super::terminal::Terminal;
use super::{Failure, print};

/// Tries to break things: degenerate scenes and receivers, by every method, against closed forms, twins and rays
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Stress {
    /// Meshes (.obj, .ply, .gltf, .glb), scenes (.toml) or names of built-in scenes to try as well, with receivers all over them
    #[arg(value_name = "MESH")]
    meshes: Vec<PathBuf>,
    /// Receivers per mesh, and per built-in case where their places are not what matters
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1 << 28))]
    receivers: u32,
    /// Another seed places other receivers on the meshes and casts other rays
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u32,
    /// Lines of the isolines
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(4..=1 << 20))]
    isolines: u32,
    /// Rays per receiver; sixteen times as many, and again, where they seem to contradict
    #[arg(long, value_name = "N", default_value_t = 1 << 10, value_parser = clap::value_parser!(u32).range(8..=1 << 20))]
    samples: u32,
    /// Leave the built-in cases out
    #[arg(long, requires = "meshes")]
    only: bool,
    /// Picture to write: what the worst receiver sees, by rays and, its boundary in red, by the exact method
    #[arg(short, long, value_name = "PNG")]
    output: Option<PathBuf>,
    /// No progress
    #[arg(long, short)]
    quiet: bool,
}

const EXAMPLES: &str = "\
Exit code 1 if any case is bad.

Examples:
  silhouette stress
  silhouette stress bunny.obj chair.obj --receivers 100000 -o worst.png
  silhouette stress room --only --samples 65536";

impl Stress {
    /// Runs all cases, prints the table and draws the worst receiver.
    pub fn run(&self) -> std::result::Result<(), Failure> {
        let settings = Settings { samples: self.samples, seed: self.seed, ..Settings::default() };
        let terminal = Terminal::new(self.quiet);
        let mut table = Table::default();
        let mut worst: Option<(Row, Case)> = None;
        for case in self.cases()? {
            for method in [Method::Exact, Method::Isolines { lines: self.isolines }] {
                let row = try_case(&case, method, settings, &terminal)?;
                if row.strain > worst.as_ref().map_or(0.0, |(row, _)| row.strain) {
                    worst = Some((row.clone(), case.clone()));
                }
                table.0.push(row);
            }
        }
        terminal.finish();
        print(&table)?;
        if let (Some(path), Some((row, case))) = (&self.output, &worst)
            && let Some(receiver) = row.receiver
        {
            draw_view(&case.geometry, case.receivers.get(receiver))?.write(path)?;
            let (method, share) = (row.method, row.strain);
            print(format_args!(
                "{}: receiver {receiver} of `{}`, which takes {share:.2} of what {method} is allowed\n",
                path.display(),
                case.name
            ))?;
        }
        let bad = table.0.iter().filter(|row| row.verdict != Verdict::Good).count();
        match bad {
            0 => Ok(()),
            _ => Err(Error::input(format!("{bad} of {} rows are bad", table.0.len())).into()),
        }
    }

    fn cases(&self) -> Result<Vec<Case>> {
        let mut cases = if self.only { Vec::new() } else { battery(self.receivers as usize)? };
        for mesh in &self.meshes {
            let geometry = Arc::new(scene(Some(mesh))?.geometry);
            let receivers = at_random(&geometry, self.receivers as usize, self.seed.into());
            let name = mesh.file_name().unwrap_or(mesh.as_os_str()).to_string_lossy().into_owned();
            cases.push(Case { name, geometry, receivers, truth: Truth::Rays });
        }
        Ok(cases)
    }
}
