use clap::{Args, ValueEnum};

use crate::bake::{Family, Goal, Method};
use crate::reference::EmbreeVariant;

use super::Failure;
use super::options::positive;

/// How visibility is integrated.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub struct MethodOptions {
    /// How visibility is integrated [default: isolines; auto with --error]
    #[arg(long, value_enum)]
    method: Option<MethodName>,
    /// Error to reach in the least time: root mean square over all receivers, in the worst array [auto: 1e-3]
    #[arg(long, value_name = "E", value_parser = positive, allow_negative_numbers = true)]
    error: Option<f64>,
    /// Number of isolines; the error falls as its power 1.5 [default: 256]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=1 << 20))]
    isolines: Option<u32>,
    /// Rays per receiver [default: 1024]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 28))]
    samples: Option<u32>,
    /// Seed of the ray directions' scrambling [default: 0]
    #[arg(long, value_name = "S")]
    seed: Option<u32>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum MethodName {
    /// Whatever reaches --error in the least time, as far as a few receivers can tell
    Auto,
    /// Isolines: analytic along one direction, no noise
    Isolines,
    /// The visible region itself, closed forms over its boundary: no knob
    Exact,
    /// Quasi-Monte Carlo by ray casting: the independent judge
    Qmc,
    /// The same on Embree 3, in builds with the feature `embree`: the peer
    Embree,
}

/// The method asked for, or what it is to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Choice {
    /// This one.
    Method(Method),
    /// The one that reaches this in the least time.
    Goal(Goal),
}

impl MethodOptions {
    /// What was chosen, which must give gradients if those are wanted.
    pub fn choice_with(&self, gradients: bool) -> std::result::Result<Choice, Failure> {
        match self.choice()? {
            choice @ (Choice::Method(Method::Exact) | Choice::Goal(Goal { family: None, .. })) => Ok(choice),
            _ if gradients => Err(Failure::Usage("--gradients needs --method exact".into())),
            choice => Ok(choice),
        }
    }

    /// What was chosen.
    pub fn choice(&self) -> std::result::Result<Choice, Failure> {
        let name = self.method.unwrap_or(if self.error.is_some() { MethodName::Auto } else { MethodName::Isolines });
        let stray = |option: &str, to: &str| Err(Failure::Usage(format!("{option} means nothing to {to}")));
        let counts = [("--isolines", self.isolines), ("--samples", self.samples), ("--seed", self.seed)];
        let given = counts.into_iter().filter(|(_, value)| value.is_some()).map(|(option, _)| option);
        let family = match name {
            MethodName::Auto => None,
            MethodName::Isolines => Some(Family::Isolines),
            MethodName::Exact => Some(Family::Exact),
            MethodName::Qmc => Some(Family::Qmc),
            MethodName::Embree => Some(Family::Embree),
        };
        if self.error.is_some() || family.is_none() {
            if let Some(option) = given.into_iter().next() {
                return stray(option, "--error, which decides it itself");
            }
            if family == Some(Family::Exact) {
                return stray("--error", "--method exact");
            }
            if let Some(family) = family {
                family.method(0).check()?;
            }
            return Ok(Choice::Goal(Goal { error: self.error.unwrap_or(1e-3), family }));
        }
        let (samples, seed) = (self.samples.unwrap_or(1024), self.seed.unwrap_or_default());
        let (method, taken): (_, &[&str]) = match name {
            MethodName::Auto | MethodName::Isolines => {
                (Method::Isolines { lines: self.isolines.unwrap_or(256) }, &["--isolines"])
            }
            MethodName::Exact => (Method::Exact, &[]),
            MethodName::Qmc => (Method::Qmc { samples, seed }, &["--samples", "--seed"]),
            MethodName::Embree => {
                (Method::Embree { samples, seed, variant: EmbreeVariant::default() }, &["--samples", "--seed"])
            }
        };
        if let Some(option) = given.into_iter().find(|option| !taken.contains(option)) {
            return stray(option, &format!("--method {method}"));
        }
        method.check()?;
        Ok(Choice::Method(method))
    }
}
