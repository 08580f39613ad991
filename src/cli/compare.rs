use std::path::PathBuf;

use clap::Args;

use crate::Error;
use crate::report::{Comparison, Results};

use super::options::magnitude;
use super::{Failure, print};

/// Compares two results, array by array
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Compare {
    /// Result to judge: .npz or .exr
    a: PathBuf,
    /// Reference of the same kind
    b: PathBuf,
    /// Picture of the differences: .png, for archives also .svg
    #[arg(short, long, value_name = "DIFF")]
    output: Option<PathBuf>,
    /// Only these arrays or channels
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    arrays: Vec<String>,
    /// Fail, with exit code 1, when the RMSE of an array is above this
    #[arg(long, value_name = "E", value_parser = magnitude, allow_negative_numbers = true)]
    fail_above: Option<f64>,
}

const EXAMPLES: &str = "\
Prints for every array: number of values, root of the mean squared difference, largest absolute difference and where
it is, mean of A - B, and RMSE over the root mean square of B. Pixels that one of the files does not cover are left out.

Examples:
  silhouette compare fast.npz exact.npz
  silhouette compare fast.npz exact.npz --arrays ambient_occlusion --fail-above 1e-3
  silhouette compare a.exr b.exr -o difference.png";

impl Compare {
    /// Prints the table, draws the picture, and fails above the bound.
    pub fn run(&self) -> Result<(), Failure> {
        let (a, b) = (Results::read(&self.a)?, Results::read(&self.b)?);
        let comparison = Comparison::new(&a, &b, &self.arrays)?;
        print(&comparison)?;
        if let Some(path) = &self.output {
            comparison.write_picture(path)?;
        }
        match (self.fail_above, comparison.worst()) {
            (Some(bound), Some(worst)) if worst.rmse > bound => {
                let message = format!("array {}: RMSE {:.3e} is above {bound:e}", worst.name, worst.rmse);
                Err(Error::input(message).into())
            }
            _ => Ok(()),
        }
    }
}
