//! The command line: one file per subcommand, no logic.

pub mod inspect;

use std::process::ExitCode;

/// Runs the command line on the process's arguments.
pub fn run() -> ExitCode {
    ExitCode::SUCCESS
}
