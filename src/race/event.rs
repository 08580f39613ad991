use crate::Result;
use crate::bake::Control;

use super::contestant::{Contestant, Run};
use super::{Quantity, Row, Track, Truth, Verdict};

/// How hard a race tries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Rounds; of the times the least counts, of the errors the root mean square.
    pub repeats: u32,
    /// Seconds that a single run may take: dearer settings are left out.
    pub budget: f64,
}

/// Steps of progress that an event counts as.
pub(super) const EVENT_STEPS: u64 = 1000;
/// Errors below this are not aimed at: nobody asks for them, and the reference has its own.
const FLOOR: f64 = 3e-8;
/// Runs shorter than this, in seconds, are repeated at once: cold caches blur them.
const SHORT: f64 = 5e-3;
const SHORT_REPEATS: usize = 3;

/// One contestant on its way up the ladder.
struct Lane<'a> {
    contestant: &'a dyn Contestant,
    ladder: Vec<f64>,
    rows: Vec<Row>,
    finished: bool,
}

/// Lets the contestants run against each other setting by setting, each in turn, so that whatever else
/// the machine does hits all alike. What is finished is in `rows` even when an error ends the event.
///
/// # Errors
/// As [`Contestant::run`] and [`Truth::measure`].
pub fn run_event(
    track: &Track,
    quantity: Quantity,
    contestants: &[&dyn Contestant],
    truth: &Truth,
    settings: Settings,
    control: &dyn Control,
    rows: &mut Vec<Row>,
) -> Result<()> {
    let mut lanes: Vec<Lane> = contestants
        .iter()
        .map(|&contestant| Lane { contestant, ladder: contestant.ladder(), rows: Vec::new(), finished: false })
        .collect();
    let highest = lanes.iter().map(|lane| lane.ladder.len()).max().unwrap_or(0);
    let turns = u64::from(settings.repeats) * highest as u64;
    let result = (0..settings.repeats).try_for_each(|round| {
        for level in 0..highest {
            for lane in &mut lanes {
                lane.step(track, quantity, truth, settings, round, level, control)?;
            }
            let turn = u64::from(round) * highest as u64 + level as u64;
            control.advance(EVENT_STEPS * (turn + 1) / turns - EVENT_STEPS * turn / turns);
        }
        Ok(())
    });
    rows.extend(lanes.into_iter().flat_map(|lane| lane.rows));
    result
}

impl Lane<'_> {
    #[expect(clippy::too_many_arguments, reason = "the parts of one event")]
    fn step(
        &mut self,
        track: &Track,
        quantity: Quantity,
        truth: &Truth,
        settings: Settings,
        round: u32,
        level: usize,
        control: &dyn Control,
    ) -> Result<()> {
        let first = round == 0;
        if first && (self.finished || level >= self.ladder.len()) || !first && level >= self.rows.len() {
            return Ok(());
        }
        let setting = self.ladder[level];
        let mut run = self.contestant.run(setting, round, control)?;
        let mut all = vec![times(&run)];
        while all.len() < SHORT_REPEATS && all[0].0 < SHORT {
            run = self.contestant.run(setting, round, control)?;
            all.push(times(&run));
        }
        // The middle one: a processor's clock that loses a tick would make the least of short times absurd.
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (seconds, clock) = all[all.len() / 2];
        let distance = truth.measure(&run.outcome.arrays, self.contestant.allowance())?;
        let receivers = track.receivers.len();
        if !first {
            let row = &mut self.rows[level];
            row.seconds = row.seconds.min(seconds / receivers as f64);
            row.clock = row.clock.min(clock / receivers as f64);
            row.planning = row.planning.min(run.planning);
            let rounds = f64::from(round);
            row.rmse = ((row.rmse.powi(2) * rounds + distance.rmse.powi(2)) / (rounds + 1.0)).sqrt();
            row.worst = row.worst.max(distance.worst);
            if row.counts() {
                row.verdict = distance.verdict;
            }
            return Ok(());
        }
        self.rows.push(Row {
            scene: track.name.clone(),
            triangles: track.geometry.triangles.len(),
            quantity,
            method: self.contestant.name().to_owned(),
            setting: run.setting,
            count: setting,
            threads: rayon::current_num_threads(),
            receivers,
            tiles: track.tiles,
            build_seconds: run.build_seconds,
            seconds: seconds / receivers as f64,
            clock: clock / receivers as f64,
            planning: run.planning,
            rmse: distance.rmse,
            worst: distance.worst,
            stated: distance.stated,
            verdict: distance.verdict,
        });
        let before = self.rows.len().checked_sub(2).map(|i| self.rows[i].seconds * receivers as f64);
        let growth = before.map_or(2.0, |before| (seconds / before).clamp(1.0, 4.0));
        // Tables are built for one setting alone: they may cost as much as the run. Of errors asked for, all are wanted.
        let tables = run.outcome.statistics.build_seconds;
        let growth = if self.ladder[0] < 1.0 { 1.0 } else { growth };
        let dearest = (seconds * growth).max(tables * growth);
        self.finished = dearest > settings.budget || distance.rmse < FLOOR && self.ladder[0] > 1.0;
        Ok(())
    }
}

/// Seconds that count, and those on the clock.
fn times(run: &Run) -> (f64, f64) {
    let statistics = &run.outcome.statistics;
    let clock = statistics.integrate_seconds;
    (if rayon::current_num_threads() == 1 { statistics.processor_seconds } else { clock }, clock)
}

impl Row {
    /// Whether the row is worth a place in a curve.
    pub(super) fn is_point(&self) -> bool {
        self.verdict == Verdict::Counts && self.rmse > 0.0 && self.seconds > 0.0
    }
}
