use std::io::Write;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::thread;

use clap::Args;
use clap::builder::RangedU64ValueParser;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::bake::writers::atomically;
use crate::bake::{Arrays, Method, Outcome, Partial, PlanReport, Prepared, Provenance, Receivers, Request, Statistics};
use crate::{Error, Result};

use super::method::Choice;
use super::say;
use super::terminal::Terminal;
use super::update::Earlier;

/// What is to be integrated where, and how.
pub struct Work<'a> {
    pub prepared: &'a Prepared<'a>,
    /// All receivers, or a sample of those that are [read](RunOptions::stream) block by block.
    pub receivers: &'a Receivers,
    pub request: &'a Request,
    pub choice: Choice,
    /// A result from before something has moved.
    pub earlier: Option<&'a Earlier>,
    /// What else the numbers depend on.
    pub parameters: Provenance,
}

impl Work<'_> {
    /// Provenance of what `method` computes here, this process's command line included.
    pub(super) fn provenance(&self, method: Method) -> Provenance {
        let mut provenance = Provenance { command_line: command_line(), ..Provenance::of(method) };
        if let Choice::Goal(goal) = self.choice {
            provenance = provenance.with("error", format_args!("{:e}", goal.error));
        }
        provenance.parameters.extend_from_slice(&self.parameters.parameters);
        provenance
    }
}

/// The command that this process was given, as a shell would take it.
pub fn command_line() -> String {
    let words = std::env::args_os().map(|word| quoted(&word.to_string_lossy()));
    words.collect::<Vec<_>>().join(" ")
}

/// A word as a shell would take it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', r"'\''")) }
}

/// How the computation runs.
#[derive(Args)]
#[command(next_help_heading = "Run")]
pub struct RunOptions {
    /// Threads; the results do not depend on it [default: all processors]
    #[arg(long, value_name = "T", value_parser = RangedU64ValueParser::<usize>::new().range(1..=1024))]
    threads: Option<usize>,
    /// Write what was done, and how fast, as JSON
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Go on from what an interrupted run kept
    #[arg(long)]
    pub(super) resume: bool,
    /// No progress
    #[arg(long, short)]
    pub quiet: bool,
}

/// So many threads to work on, or as many as there are processors.
pub fn threads(wanted: Option<usize>) -> Result<ThreadPool> {
    let threads = wanted.or_else(|| thread::available_parallelism().ok().map(NonZero::get)).unwrap_or(1);
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| Error::input(format!("{threads} threads cannot be started ({error}); ask for fewer")))
}

impl RunOptions {
    /// The threads to work on.
    pub fn pool(&self) -> Result<ThreadPool> {
        threads(self.threads)
    }

    /// Integrates, for the file `out`: on from what an interrupted run kept if that is wanted, and by the method that it had chosen.
    ///
    /// # Errors
    /// [`Error::Interrupted`] after an interruption, of which the finished part is kept; otherwise as
    /// [`Prepared::integrate`], or when a file cannot be read or written.
    pub fn integrate(&self, work: &Work, out: &Path, pool: &ThreadPool) -> Result<(Arrays, Provenance)> {
        let terminal = Terminal::new(self.quiet);
        let (method, plan) = self.method(work, work.receivers.len(), out, pool, &terminal)?;
        let provenance = work.provenance(method);
        let resumed = match work.earlier {
            Some(earlier) => Some(earlier.part(work.receivers, &provenance, self.quiet)?),
            None => self.resumed(out, &provenance)?,
        };
        let outcome =
            pool.install(|| work.prepared.integrate(work.receivers, work.request, method, resumed, &terminal));
        terminal.finish();
        let mut outcome = outcome?;
        if let Some(plan) = plan {
            let estimate = plan.estimate(&outcome.arrays);
            if !self.quiet && outcome.done.iter().all(|&done| done) {
                say(format_args!("estimated error {estimate:.1e}, of {:.1e} asked for", plan.error));
            }
            outcome.statistics.estimated_error = Some(estimate);
            outcome.statistics.plan = Some(plan);
        }
        Ok((self.conclude(outcome, out, &provenance)?, provenance))
    }

    /// The method for so many receivers: as given, as noted by an earlier run, or planned for the error asked for.
    pub(super) fn method(
        &self,
        work: &Work,
        receivers: usize,
        out: &Path,
        pool: &ThreadPool,
        terminal: &Terminal,
    ) -> Result<(Method, Option<PlanReport>)> {
        match (work.choice, work.earlier) {
            (Choice::Method(method), _) => Ok((method, None)),
            (Choice::Goal(_), Some(earlier)) => Ok((earlier.method()?, None)),
            (Choice::Goal(_), None) if self.resume => match Partial::provenance(&kept(out)?)?.integrated_by() {
                Some(method) => Ok((method, None)),
                None => Err(Error::file(kept(out)?, "does not say by what method it was made; begin anew")),
            },
            (Choice::Goal(goal), None) => {
                let plan = pool.install(|| work.prepared.plan(work.receivers, work.request, goal, terminal));
                terminal.finish();
                let mut plan = plan?;
                plan.report.scale(receivers as f64 / work.receivers.len().max(1) as f64);
                if !self.quiet {
                    say(&plan);
                }
                Ok((plan.method, Some(plan.report)))
            }
        }
    }

    /// What an interrupted run of the same command has kept, if it is wanted.
    fn resumed(&self, out: &Path, provenance: &Provenance) -> Result<Option<Partial>> {
        if !self.resume {
            return Ok(None);
        }
        Partial::read(&kept(out)?, provenance).map(Some)
    }

    /// Removes what an interrupted run had kept, once `out` is written.
    ///
    /// # Errors
    /// When the file cannot be removed.
    pub fn discard_kept(&self, out: &Path) -> Result<()> {
        let part = Partial::path(out);
        match self.resume {
            true => std::fs::remove_file(&part).map_err(|error| Error::file(&part, error)),
            false => Ok(()),
        }
    }

    /// Writes the statistics of a finished run, and says what is worth saying.
    pub(super) fn report(&self, statistics: &Statistics) -> Result<()> {
        if let Some(stats) = &self.stats {
            let json = statistics.to_json();
            atomically(stats, |file| file.write_all(json.as_bytes()).map_err(|error| Error::file(stats, error)))?;
        }
        if let (Some(line), false) = (statistics.second_looks(), self.quiet) {
            say(line);
        }
        Ok(())
    }

    /// Ends a run that was to write `out`: gives the arrays of a finished one, keeps the finished part of an
    /// interrupted one and says so.
    ///
    /// # Errors
    /// [`Error::Interrupted`] after an interruption; otherwise when a file cannot be written.
    fn conclude(&self, outcome: Outcome, out: &Path, provenance: &Provenance) -> Result<Arrays> {
        let Outcome { arrays, done, statistics } = outcome;
        let part = Partial::path(out);
        if done.iter().all(|&done| done) {
            self.report(&statistics)?;
            return Ok(arrays);
        }
        let partial = Partial { arrays, done, provenance: provenance.clone() };
        match partial.finished() {
            0 => say("stopped before any receiver was finished: nothing is kept"),
            finished => {
                partial.write(&part)?;
                let (all, part) = (partial.done.len(), part.display());
                say(format_args!(
                    "stopped: {finished} of {all} receivers are kept in {part}; --resume goes on from there"
                ));
            }
        }
        Err(Error::Interrupted)
    }
}

/// The finished part of the run that was to write `out`, which must be there.
pub(super) fn kept(out: &Path) -> Result<PathBuf> {
    let part = Partial::path(out);
    match part.exists() {
        true => Ok(part),
        false => Err(Error::file(part, "there is nothing to go on from; leave --resume out")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{Array, Statistics};

    #[test]
    fn words_are_quoted_for_a_shell() {
        let words = ["bake", "--order=4", "my scene.toml", "it's", "", "$HOME"].map(quoted);
        assert_eq!(words, ["bake", "--order=4", "'my scene.toml'", r"'it'\''s'", "''", "'$HOME'"]);
    }

    #[test]
    fn an_interrupted_run_is_kept_and_a_finished_one_cleans_up() {
        let folder = tempfile::tempdir().unwrap();
        let (out, stats) = (folder.path().join("a.npz"), folder.path().join("stats.json"));
        let provenance = Provenance::new("isolines");
        let outcome = |done: [bool; 2]| {
            let mut arrays = Arrays::new();
            arrays.push(Array::new("ambient_occlusion", [2], vec![0.5, 0.0])).unwrap();
            Outcome { arrays, done: done.to_vec(), statistics: Statistics::default() }
        };
        let options = |resume| RunOptions { threads: None, stats: Some(stats.clone()), resume, quiet: true };

        let nothing = options(false).conclude(outcome([false; 2]), &out, &provenance);
        assert!(matches!(nothing, Err(Error::Interrupted)));
        assert!(!Partial::path(&out).exists());
        options(false).conclude(outcome([true, false]), &out, &provenance).unwrap_err();
        assert!(!stats.exists());
        assert!(options(false).resumed(&out, &provenance).unwrap().is_none());
        assert_eq!(options(true).resumed(&out, &provenance).unwrap().unwrap().done, [true, false]);

        options(true).conclude(outcome([true; 2]), &out, &provenance).unwrap();
        assert!(Partial::path(&out).exists(), "kept until the result is written");
        options(true).discard_kept(&out).unwrap();
        assert!(!Partial::path(&out).exists());
        let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&stats).unwrap()).unwrap();
        for key in "receivers method triangles threads build_seconds integrate_seconds contours_per_receiver depth_alarms skipped"
            .split(' ')
        {
            assert!(json.get(key).is_some(), "{key}");
        }
        assert!(json["skipped"].is_object());
    }
}
