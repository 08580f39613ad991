//! Receivers of which a file may hold any number: they are read, integrated and put aside block by block.

use std::path::Path;

use rayon::ThreadPool;

use crate::bake::writers::Spool;
use crate::bake::{Control, Outcome, Phase, Prepared, Provenance, Receivers, Statistics, flip_phase};
use crate::scene::{Point, PointReader};
use crate::{Error, Result};

use super::run::{RunOptions, Work, kept};
use super::say;
use super::terminal::Terminal;

/// Receivers in memory at a time; fewer are integrated at once.
pub const BLOCK: usize = 1 << 17;

/// Receivers at these points, on whose own faces they do not look.
pub fn on_surface(points: Vec<Point>, prepared: &Prepared) -> Receivers {
    Receivers::points(points.into_iter().map(|p| (p.position, p.normal))).on_surface(prepared.faces())
}

impl RunOptions {
    /// Integrates at the `count` points of a file and writes the archive `out`, as [`RunOptions::integrate`] and a writer would, but
    /// in memory that does not grow with their number. An interrupted run keeps the blocks that it has finished.
    ///
    /// # Errors
    /// As [`RunOptions::integrate`].
    pub fn stream(
        &self,
        work: &Work,
        points: &Path,
        count: usize,
        phase: Phase,
        out: &Path,
        pool: &ThreadPool,
    ) -> Result<()> {
        let terminal = Terminal::new(self.quiet);
        let (method, plan) = self.method(work, count, out, pool, &terminal)?;
        let provenance = Provenance { sh_phase: phase, ..work.provenance(method) };
        let mut spool = Spool::new(out);
        if self.resume {
            kept(out)?;
            spool = Spool::reopen(out, &provenance)?;
        }
        let mut reader = PointReader::open(points)?;
        let next = |reader: &mut PointReader, most: usize| match reader.block(most)? {
            block if block.is_empty() => Err(Error::file(points, format!("has no longer {count} points; begin anew"))),
            block => Ok(block),
        };
        let mut skipped = 0;
        while skipped < spool.rows() {
            skipped += next(&mut reader, BLOCK.min(spool.rows() - skipped))?.len();
        }
        terminal.begin("integrating", (count - spool.rows()) as u64);
        let (mut statistics, mut squares) = (None, 0.0);
        while spool.rows() < count {
            let first = spool.rows();
            let receivers = on_surface(next(&mut reader, BLOCK)?, work.prepared).numbered_from(first);
            let progress = Blocks(&terminal);
            let run = || work.prepared.integrate(&receivers, work.request, method, None, &progress);
            let Outcome { arrays, done, statistics: more } = pool.install(run)?;
            if !done.iter().all(|&done| done) {
                terminal.finish();
                return self.stop(spool, count, &provenance);
            }
            if let Some(plan) = &plan {
                squares += plan.estimate(&arrays).powi(2) * receivers.len() as f64;
            }
            spool.append(&if phase == Phase::default() { arrays } else { flip_phase(arrays, 1)? })?;
            statistics = Some(match statistics {
                None => more,
                Some(before) => Statistics::then(before, more),
            });
        }
        terminal.finish();
        spool.write(&provenance)?;
        let mut statistics = statistics.unwrap_or_default();
        if let Some(plan) = plan {
            let estimate = (squares / count as f64).sqrt();
            if !self.quiet {
                say(format_args!("estimated error {estimate:.1e}, of {:.1e} asked for", plan.error));
            }
            (statistics.estimated_error, statistics.plan) = (Some(estimate), Some(plan));
        }
        self.report(&statistics)?;
        self.discard_kept(out)
    }

    /// Keeps what is finished.
    fn stop(&self, mut spool: Spool, count: usize, provenance: &Provenance) -> Result<()> {
        match spool.rows() {
            0 => say("stopped before the first block of receivers was finished: nothing is kept"),
            rows => {
                let part = spool.keep(provenance)?;
                let part = part.display();
                say(format_args!(
                    "stopped: {rows} of {count} receivers are kept in {part}; --resume goes on from there"
                ));
            }
        }
        Err(Error::Interrupted)
    }
}

/// Progress over all blocks.
struct Blocks<'a>(&'a Terminal);

impl Control for Blocks<'_> {
    fn advance(&self, steps: u64) {
        self.0.advance(steps);
    }

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}
