use std::cell::Cell;
use std::time::Instant;

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::plan::{Candidate, Family, Law};
use super::tiles::{TILE_RADIUS, tiles};
use super::{Arrays, Control, Outcome, Prepared, Receivers, Request};
use crate::{Error, Result};

/// A few receivers on which methods are measured before one is chosen for all.
pub(super) struct Pilot<'a> {
    prepared: &'a Prepared<'a>,
    request: &'a Request,
    control: &'a dyn Control,
    pub(super) receivers: Receivers,
    /// Where there is nothing but the method to measure.
    alone: ThreadPool,
    /// The best values so far.
    reference: Option<Arrays>,
    /// Mean number of contours, once they have been searched.
    contours: Cell<f64>,
    built: Vec<(Family, f64)>,
}

/// One family measured at one count.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Level {
    pub(super) count: f64,
    /// Processor time per receiver.
    pub(super) seconds: f64,
    /// Time of building what depends on the count.
    pub(super) build: f64,
    pub(super) rmse: f64,
    /// Root mean square of the errors that the method states.
    pub(super) stated: f64,
}

/// Receivers that are measured: this share of all, and not fewer nor more than these.
const SHARE: usize = 64;
const LEAST: usize = 32;
const MOST: usize = 512;
/// A tile's receivers share a search: fewer than these would make it look dearer than it is.
const TILE: usize = 64;
/// Runs shorter than this, in seconds of processor time, are repeated: the clock and cold caches blur them.
const SHORT: f64 = 5e-3;
const REPEATS: usize = 3;
/// One in so many of the pilot's receivers is solved exactly: there is no error to be estimated, only time.
const EXACT_SHARE: usize = 8;
/// The errors that Embree's rays state are about this much too cautious; see [`crate::reference`].
const CAUTION: f64 = 1.4;
/// Counts beyond this many times the finer level are looked at before they are believed.
const TRUSTED: f64 = 4.0;

/// Cancels, but does not count: what is measured is no part of the work.
struct Silent<'a>(&'a dyn Control);

impl Control for Silent<'_> {
    fn advance(&self, _: u64) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

impl<'a> Pilot<'a> {
    pub(super) fn new(
        prepared: &'a Prepared,
        receivers: &Receivers,
        request: &'a Request,
        control: &'a dyn Control,
    ) -> Result<Self> {
        let alone = ThreadPoolBuilder::new().num_threads(1).build();
        let bounds = prepared.geometry().bounds();
        let diagonal = bounds.map_or(0.0, |[low, high]| low.as_dvec3().distance(high.as_dvec3()));
        let tiles = tiles(&receivers.positions, TILE_RADIUS * diagonal);
        let wanted = (receivers.len() / SHARE).clamp(LEAST, MOST);
        Ok(Self {
            prepared,
            request,
            control,
            receivers: receivers.pick(spread(&tiles, wanted)),
            alone: alone.map_err(|error| Error::input(format!("a thread cannot be started: {error}")))?,
            reference: None,
            contours: Cell::new(0.0),
            built: Vec::new(),
        })
    }

    /// Mean number of contours of a receiver, as far as known.
    pub(super) fn contours(&self) -> f64 {
        self.contours.get()
    }

    /// Seconds it took to build what `family` searches in.
    pub(super) fn built(&self, family: Family) -> f64 {
        self.built.iter().filter(|(built, _)| *built == family).map(|(_, seconds)| seconds).sum()
    }

    /// What `family` promises for `all` receivers at the error `aim`.
    pub(super) fn try_family(&mut self, family: Family, aim: f64, all: usize) -> Result<Candidate> {
        let started = Instant::now();
        self.prepared.build(family, &self.receivers)?;
        self.built.push((family, started.elapsed().as_secs_f64()));
        if family == Family::Exact {
            let few = self.receivers.pick(0..self.receivers.len().div_ceil(EXACT_SHARE));
            let (level, _) = self.measure(family, 0, &few)?;
            return Ok(Candidate::exact(level, all));
        }
        let [coarse, fine] = family.levels();
        let (mut coarse, coarse_values) = self.measure(family, coarse, &self.receivers)?;
        let (mut fine, fine_values) = self.measure(family, fine, &self.receivers)?;
        match family {
            Family::Isolines => {
                coarse.rmse = difference(&coarse_values, &fine_values);
                self.reference = Some(fine_values);
            }
            _ => {
                let caution = if family == Family::Embree { CAUTION } else { 1.0 };
                coarse.rmse = match &self.reference {
                    Some(reference) => difference(&coarse_values, reference),
                    None => coarse.stated / caution,
                };
            }
        }
        let law = Law::new(family, [coarse, fine]);
        let count = law.count(aim);
        if family == Family::Isolines && f64::from(count) > TRUSTED * fine.count {
            (fine, _) = self.measure(family, count, &self.receivers)?;
            return Ok(Law::new(family, [coarse, fine]).candidate(aim, all));
        }
        Ok(law.candidate(aim, all))
    }

    /// Time, stated error and values of one method.
    fn measure(&self, family: Family, count: u32, receivers: &Receivers) -> Result<(Level, Arrays)> {
        let control = Silent(self.control);
        let method = family.method(count);
        let mut least = f64::INFINITY;
        for repeat in 1.. {
            let run = || self.prepared.integrate(receivers, self.request, method, None, &control);
            let Outcome { arrays, done, statistics } = self.alone.install(run)?;
            if done.iter().any(|done| !done) {
                return Err(Error::Interrupted);
            }
            least = least.min(statistics.processor_seconds);
            if statistics.contours_per_receiver > 0.0 {
                self.contours.set(statistics.contours_per_receiver);
            }
            if repeat == REPEATS || least > SHORT {
                let level = Level {
                    count: count.into(),
                    seconds: least / receivers.len().max(1) as f64,
                    build: statistics.build_seconds,
                    rmse: 0.0,
                    stated: stated(&arrays),
                };
                return Ok((level, arrays));
            }
        }
        unreachable!("the loop ends by its repeats")
    }
}

/// About `wanted` receivers, as many whole tiles as hold them and two at least, evenly spread.
fn spread(tiles: &[Vec<u32>], wanted: usize) -> Vec<usize> {
    let count = wanted.div_ceil(TILE).clamp(2, tiles.len().max(2));
    let each = wanted.div_ceil(count);
    let chosen = (0..count.min(tiles.len())).map(|i| &tiles[(2 * i + 1) * tiles.len() / (2 * count)]);
    let mut picked: Vec<usize> = chosen.flat_map(|tile| &tile[..tile.len().min(each)]).map(|&i| i as usize).collect();
    // Tiles of loose points hold few: then many more of them are taken.
    let step = (tiles.len() / wanted.max(1)).max(1);
    let mut more = tiles.iter().step_by(step).flatten().map(|&i| i as usize);
    while picked.len() < wanted.min(tiles.iter().map(Vec::len).sum()) {
        let Some(next) = more.next() else { break };
        if !picked.contains(&next) {
            picked.push(next);
        }
    }
    picked
}

/// Root mean square of the difference in the worst array.
pub(super) fn difference(a: &Arrays, b: &Arrays) -> f64 {
    let estimated = a.iter().filter(|array| !array.name.ends_with("_error"));
    let rms =
        estimated.filter_map(|array| Some(rms(array.data.iter().zip(&b.get(&array.name)?.data).map(|(a, b)| a - b))));
    rms.fold(0.0, f64::max)
}

/// Root mean square of the stated errors in the worst array.
pub(super) fn stated(arrays: &Arrays) -> f64 {
    let errors = arrays.iter().filter(|array| array.name.ends_with("_error"));
    errors.map(|array| rms(array.data.iter().copied())).fold(0.0, f64::max)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x * x));
    (sum / f64::max(count, 1.0)).sqrt()
}
