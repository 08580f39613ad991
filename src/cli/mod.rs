//! The command line: one file per subcommand, no logic.

mod animate;
mod bake;
mod compare;
mod inspect;
mod integrate;
mod interrupt;
mod judge;
mod memory;
mod method;
mod options;
mod proxies;
mod proxy_options;
mod race;
mod render;
mod run;
mod stage;
mod stream;
mod stress;
mod terminal;
mod update;

use std::io::{self, Write};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::Error;

/// Exact visibility for rendering: what every point sees of the sky, without noise.
#[derive(Parser)]
#[command(name = "silhouette", version, arg_required_else_help = true, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Bake(bake::Bake),
    Render(render::Render),
    Integrate(integrate::Integrate),
    Compare(compare::Compare),
    Inspect(inspect::Args),
    Proxies(proxies::Proxies),
    Stress(stress::Stress),
    Animate(Box<animate::Animate>),
    Judge(judge::Judge),
    Race(race::Race),
}

const EXAMPLES: &str = "\
Examples:
  silhouette bake -o teapot.glb              the built-in scene, and a picture of it
  silhouette bake room.toml -o room.exr      a scene file
  silhouette integrate bunny.obj -o bunny.npz
  silhouette compare fast.npz exact.npz

Exit codes: 0 done, 1 error, 2 wrong usage, 130 interrupted.";

/// Why a command did not end well.
enum Failure {
    /// The arguments contradict each other.
    Usage(String),
    /// Anything else.
    Error(Error),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

/// Runs the command line on the process's arguments.
pub fn run() -> ExitCode {
    let command = match Cli::try_parse() {
        Ok(cli) => cli.command,
        Err(error) => {
            // Help and version come this way, too.
            let _ = error.print();
            return ExitCode::from(error.exit_code() as u8);
        }
    };
    memory::return_freed();
    interrupt::listen();
    let result = match command {
        Command::Bake(bake) => bake.run(),
        Command::Render(render) => render.run(),
        Command::Integrate(integrate) => integrate.run(),
        Command::Compare(compare) => compare.run(),
        Command::Inspect(args) => inspect::run(&args),
        Command::Proxies(proxies) => proxies.run(),
        Command::Stress(stress) => stress.run(),
        Command::Animate(animate) => animate.run(),
        Command::Judge(judge) => judge.run(),
        Command::Race(race) => race.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Error(Error::Interrupted)) => ExitCode::from(interrupt::EXIT_CODE),
        Err(Failure::Error(error)) => {
            say(format!("error: {}", error.to_string().replace('\n', " ")));
            ExitCode::FAILURE
        }
        Err(Failure::Usage(message)) => {
            say(format!("error: {message}\n\nFor more information, try '--help'."));
            ExitCode::from(2)
        }
    }
}

/// A line on standard error; where nobody can read it, it is not missed.
fn say(line: impl std::fmt::Display) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Text on standard output. A reader that has gone, as in `| head`, is no error.
fn print(text: impl std::fmt::Display) -> Result<(), Failure> {
    match write!(io::stdout(), "{text}").and_then(|()| io::stdout().flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::file("standard output", error).into()),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn arguments_are_consistent() {
        super::Cli::command().debug_assert();
    }
}
