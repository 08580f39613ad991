use std::time::Instant;

use glam::DVec3;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::plan::{Candidate, Family, Law};
use super::tiles::TILE_RECEIVERS;
use super::{Arrays, Control, Method, Outcome, Prepared, Receivers, Request, Unmoved};
use crate::reference::{EmbreeKernel, EmbreeVariant};
use crate::{Error, Result};

/// A few receivers on which methods are measured before one is chosen for all.
pub(super) struct Pilot<'a> {
    prepared: &'a Prepared<'a>,
    request: &'a Request,
    control: &'a dyn Control,
    /// From all over: they show errors.
    scattered: Receivers,
    /// Neighbours, who share a search as in a bake: they show times.
    tiles: Receivers,
    /// Where there is nothing but the method to measure.
    alone: ThreadPool,
    /// The faster way to hand rays to Embree here.
    kernel: EmbreeKernel,
    /// The best values so far.
    reference: Option<Arrays>,
    /// Seconds of one receiver by the exact method, if it was measured.
    exact: Option<f64>,
    built: Vec<(Family, f64)>,
    /// What is known of isolines.
    lines: Option<Law>,
    /// What is known of rays, and the values they gave.
    rays: Option<(Family, [(Level, Arrays); 2])>,
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

/// Receivers that are measured for errors: this share of all, and not fewer nor more than these. Twice as many are measured for time, for a tile
/// has many, and places are few then.
const SHARE: usize = 64;
const LEAST: usize = 16;
const MOST: usize = 256;
/// Runs shorter than this, in seconds of processor time, are repeated: the clock and cold caches blur them.
const SHORT: f64 = 1e-3;
const REPEATS: usize = 3;
/// The errors that Embree's rays state are about this much too cautious; see [`crate::reference`].
const CAUTION: f64 = 1.4;
/// Trying isolines, and who judges them, may each take this share of the time expected for all.
const LOOK: f64 = 0.1;
/// Numbers of isolines that are tried at most.
const TRIALS: usize = 5;
/// About so many times as long takes a receiver whose search nobody shares.
const ALONE: f64 = 2.0;
/// Who judges others must have so many times as small an error.
const JUDGE: f64 = 4.0;
/// Where nothing better is known, rays are compared with so many times as many.
const BETTER: u32 = 4;
/// That is worth its while at this share of the receivers.
const FEW: usize = 16;

impl<'a> Pilot<'a> {
    pub(super) fn new(
        prepared: &'a Prepared,
        receivers: &Receivers,
        request: &'a Request,
        control: &'a dyn Control,
    ) -> Result<Self> {
        let alone = ThreadPoolBuilder::new().num_threads(1).build();
        let wanted = (receivers.len() / SHARE).clamp(LEAST, MOST);
        Ok(Self {
            prepared,
            request,
            control,
            scattered: receivers.pick(spread(receivers.len(), wanted)),
            tiles: receivers.pick(neighbourhoods(&receivers.positions, 2 * wanted)),
            alone: alone.map_err(|error| Error::input(format!("a thread cannot be started: {error}")))?,
            kernel: EmbreeKernel::default(),
            reference: None,
            exact: None,
            built: Vec::new(),
            lines: None,
            rays: None,
        })
    }

    /// Seconds it took to build what `family` searches in.
    pub(super) fn built(&self, family: Family) -> f64 {
        self.built.iter().filter(|(built, _)| *built == family).map(|(_, seconds)| seconds).sum()
    }

    /// A family's member as it is measured here.
    pub(super) fn method(&self, family: Family, count: u32) -> Method {
        match family.method(count) {
            Method::Embree { samples, seed, variant } => {
                let variant = EmbreeVariant { kernel: self.kernel, ..variant };
                Method::Embree { samples, seed, variant }
            }
            method => method,
        }
    }

    /// Receivers that are measured.
    pub(super) fn receivers(&self) -> usize {
        self.scattered.len() + self.tiles.len()
    }

    /// What `family` promises for `all` receivers at the error `aim`; nothing, if it cannot take less than `best` seconds.
    pub(super) fn try_family(&mut self, family: Family, aim: f64, all: usize, best: f64) -> Result<Option<Candidate>> {
        let started = Instant::now();
        self.prepared.build(family, &self.tiles)?;
        self.built.push((family, started.elapsed().as_secs_f64()));
        let [coarse, fine] = family.levels(aim);
        if family == Family::Embree {
            self.choose_kernel(coarse)?;
        }
        for &(receivers, share) in family.looks() {
            let look = self.tiles.pick(0..self.tiles.len().min(receivers));
            let seconds = self.measure(self.method(family, coarse), coarse, &look, REPEATS)?.0.seconds;
            if share * family.least(aim, f64::from(coarse)) * seconds * all as f64 > best {
                return Ok(None);
            }
        }
        if family == Family::Exact {
            let (level, _) = self.measure(self.method(family, coarse), coarse, &self.tiles, REPEATS)?;
            self.exact = Some(level.seconds);
            return Ok(Some(Candidate::exact(level, all)));
        }
        let (mut coarse, coarse_values) = self.level(family, coarse)?;
        let (fine, fine_values) = self.level(family, fine)?;
        if family == Family::Isolines {
            coarse.rmse = difference(&coarse_values, &fine_values);
            self.reference = Some(fine_values);
            let law = Law::new(family, [coarse, fine]);
            self.lines = Some(law);
            return Ok(Some(law.candidate(aim, all)));
        }
        let caution = if family == Family::Embree { CAUTION } else { 1.0 };
        coarse.rmse = coarse.stated / caution;
        self.rays = Some((family, [(coarse, coarse_values), (fine, fine_values)]));
        Ok(Some(self.revised_rays(aim, all).unwrap_or_else(|| Law::new(family, [coarse, fine]).candidate(aim, all))))
    }

    fn choose_kernel(&mut self, count: u32) -> Result<()> {
        let mut least = f64::INFINITY;
        for kernel in [EmbreeKernel::Packets, EmbreeKernel::Streams] {
            let other = std::mem::replace(&mut self.kernel, kernel);
            let method = self.method(Family::Embree, count);
            let seconds = self.measure(method, count, &self.tiles, REPEATS)?.0.seconds;
            if seconds < least {
                least = seconds;
            } else {
                self.kernel = other;
            }
        }
        Ok(())
    }

    /// What rays promise, now that isolines have told how wrong they are.
    pub(super) fn revised_rays(&self, aim: f64, all: usize) -> Option<Candidate> {
        let (family, levels) = self.rays.as_ref()?;
        let levels = [0, 1].map(|i| {
            let (level, values) = &levels[i];
            let rmse = difference(values, self.reference.as_ref()?);
            // Of what is left between two that are both wrong nobody knows whose fault it is.
            self.are_lines_better(rmse).then_some(Level { rmse, ..*level })
        });
        let [Some(coarse), Some(fine)] = levels else { return None };
        Some(Law::new(*family, [coarse, fine]).candidate(aim, all))
    }

    /// Whether the values along the finer isolines can judge others of this error.
    fn are_lines_better(&self, error: f64) -> bool {
        self.lines.is_some_and(|law| JUDGE * law.error(law.levels[1].count) < error)
    }

    /// What isolines promise after numbers of them near the one promised have been tried, if that takes little beside `best` seconds, the
    /// least that is known for `all` receivers: the fewest of those tried that reach the error `aim`.
    pub(super) fn settle_isolines(
        &self,
        promised: &Candidate,
        aim: f64,
        all: usize,
        best: f64,
    ) -> Result<Option<Candidate>> {
        let Some(law) = self.lines.filter(|_| FEW * self.scattered.len() <= all) else { return Ok(None) };
        let (budget, receivers) = (LOOK * best, self.scattered.len() as f64);
        let (better, lines) = if self.exact.is_some_and(|seconds| ALONE * receivers * seconds < budget) {
            (self.measure(Method::Exact, 0, &self.scattered, 1)?.1, f64::INFINITY)
        } else {
            let count = promised.count.saturating_mul(BETTER);
            if law.build(count.into()) + receivers * law.seconds(count.into()) > budget {
                return Ok(None);
            }
            (self.measure(self.method(Family::Isolines, count), count, &self.scattered, 1)?.1, f64::from(count))
        };
        let started = Instant::now();
        let (mut settled, mut is_reached, mut count) = (None, false, promised.count);
        for _ in 0..TRIALS {
            let cost = law.build(count.into()) + receivers * law.seconds(count.into());
            if started.elapsed().as_secs_f64() + cost > budget {
                break;
            }
            let (level, values) = self.measure(self.method(Family::Isolines, count), count, &self.scattered, 1)?;
            let error = error_beside(&values, &better, (level.count / lines).powf(1.5));
            let next = law.nearer(count, error, aim);
            if error > aim {
                if is_reached {
                    break;
                }
                // Until more have been tried.
                settled = Some(law.candidate_of(next, law.error_beyond(level.count, error, next.into()), all));
            } else {
                is_reached = true;
                settled = Some(law.candidate_of(count, error, all).with_stated(level.stated));
                if next >= count {
                    break;
                }
            }
            count = next;
        }
        Ok(settled)
    }

    /// What rays promise after half of those promised have been tried, and half of these, while they reach the error `aim`; and all, if
    /// half do not.
    pub(super) fn settle_rays(
        &self,
        promised: &Candidate,
        goal: f64,
        aim: f64,
        all: usize,
    ) -> Result<Option<Candidate>> {
        // It casts up to six times as many rays as the run will, at these receivers.
        let are_few = FEW * self.scattered.len() <= all;
        let Some((family, [coarse, fine])) = self.rays.as_ref().filter(|_| are_few) else { return Ok(None) };
        let (family, law) = (*family, Law::new(*family, [coarse.0, fine.0]));
        let (better, rays) = match &self.reference {
            Some(lines) if self.are_lines_better(aim) => (lines.clone(), f64::INFINITY),
            _ => {
                let count = promised.count.saturating_mul(BETTER);
                let other_rays = match self.method(family, count) {
                    Method::Qmc { samples, seed } => Method::Qmc { samples, seed: seed + 1 },
                    Method::Embree { samples, seed, variant } => Method::Embree { samples, seed: seed + 1, variant },
                    method => method,
                };
                (self.measure(other_rays, count, &self.scattered, 1)?.1, f64::from(count))
            }
        };
        let error = |count: u32| {
            let (_, values) = self.measure(self.method(family, count), count, &self.scattered, 1)?;
            Ok::<_, Error>(error_beside(&values, &better, (f64::from(count) / rays).powf(0.75)))
        };
        let mut settled = None;
        let mut count = promised.count / 2;
        while count >= Family::FEWEST_RAYS {
            let found = error(count)?;
            if found > aim {
                break;
            }
            settled = Some(law.candidate_of(count, found, all));
            count /= 2;
        }
        if settled.is_some() {
            return Ok(settled);
        }
        let whole_error = error(promised.count)?;
        if whole_error <= goal {
            return Ok(Some(law.candidate_of(promised.count, whole_error, all)));
        }
        let twice = promised.count.saturating_mul(2);
        Ok(Some(law.candidate_of(twice, 2f64.powf(-0.75) * whole_error, all)))
    }

    /// Time of neighbours, errors and values of scattered receivers.
    fn level(&self, family: Family, count: u32) -> Result<(Level, Arrays)> {
        let method = self.method(family, count);
        let (errors, arrays) = self.measure(method, count, &self.scattered, 1)?;
        let (time, _) = self.measure(method, count, &self.tiles, REPEATS)?;
        Ok((Level { stated: errors.stated, ..time }, arrays))
    }

    /// Time, the least of at most `repeats`, stated error and values of one method.
    fn measure(&self, method: Method, count: u32, receivers: &Receivers, repeats: usize) -> Result<(Level, Arrays)> {
        let control = Unmoved(self.control);
        let mut least = f64::INFINITY;
        for repeat in 1.. {
            let run = || self.prepared.integrate(receivers, self.request, method, None, &control);
            let Outcome { arrays, done, statistics } = self.alone.install(run)?;
            if done.iter().any(|done| !done) {
                return Err(Error::Interrupted);
            }
            least = least.min(statistics.processor_seconds);
            if repeat == repeats || least > SHORT {
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

/// `wanted` of `all` numbers, evenly spread.
fn spread(all: usize, wanted: usize) -> impl Iterator<Item = usize> {
    let wanted = wanted.min(all);
    (0..wanted).map(move |i| (2 * i + 1) * all / (2 * wanted))
}

/// About `wanted` receivers in groups as large as tiles, each of those nearest to one of them.
fn neighbourhoods(positions: &[DVec3], wanted: usize) -> Vec<usize> {
    let size = wanted.min(TILE_RECEIVERS).min(positions.len());
    let mut picked = Vec::with_capacity(wanted);
    for centre in spread(positions.len(), wanted.div_ceil(TILE_RECEIVERS)) {
        let centre = positions[centre];
        let mut near: Vec<(f64, usize)> =
            positions.iter().enumerate().map(|(i, p)| (p.distance_squared(centre), i)).collect();
        if size < near.len() {
            near.select_nth_unstable_by(size, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
        picked.extend(near[..size].iter().map(|&(_, index)| index));
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

/// The error of values, beside better ones whose own is this part of it.
fn error_beside(values: &Arrays, better: &Arrays, part: f64) -> f64 {
    difference(values, better) / part.hypot(1.0)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_spread_and_neighbourhoods_hold_the_nearest() {
        assert_eq!(spread(100, 4).collect::<Vec<_>>(), [12, 37, 62, 87]);
        assert_eq!(spread(3, 8).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(spread(0, 8).count(), 0);
        let positions: Vec<DVec3> = (0..1000).map(|i| DVec3::X * f64::from(i * 7 % 1000)).collect();
        let picked = neighbourhoods(&positions, 256);
        assert_eq!(picked.len(), 256);
        for group in picked.chunks(TILE_RECEIVERS) {
            let places: Vec<f64> = group.iter().map(|&i| positions[i].x).collect();
            let (low, high) = places.iter().fold((f64::MAX, f64::MIN), |(low, high), &x| (low.min(x), high.max(x)));
            assert_eq!(high - low, 127.0, "128 neighbours on a line, none left out");
        }
        assert_eq!(neighbourhoods(&positions[..5], 16).len(), 5);
        assert!(neighbourhoods(&[], 16).is_empty());
    }

    #[test]
    fn power_laws_are_extrapolated_exactly() {
        let level = |count: f64| Level {
            count,
            seconds: 1e-6 * (3.0 + 0.1 * count),
            build: 0.0,
            rmse: 2.0 * count.powf(-0.75),
            stated: 3.0 * count.powf(-0.75),
        };
        let both = Law::new(Family::Qmc, [level(64.0), level(512.0)]).candidate(2.0 * 2f64.powf(-9.0), 1000);
        assert_eq!(both.count, 4096);
        assert!((both.expected_error / 2.0 * 2f64.powf(9.0) - 1.0).abs() < 1e-9, "{both:?}");
        assert!((both.expected_seconds - 1e-3 * (3.0 + 409.6)).abs() < 1e-9, "{both:?}");
        // Without an error at the finer level the stated ones tell how it falls.
        let one = Law::new(Family::Qmc, [level(64.0), Level { rmse: 0.0, ..level(512.0) }]);
        assert_eq!(one.candidate(2.0 * 2f64.powf(-9.0), 1000).count, 4096);
        // Tables of light grow with the square of the lines; nothing is known to shrink.
        let built = |count: f64, square: f64| Level { build: 0.05 + square * count.powi(2), ..level(count) };
        for square in [0.0, 2e-6] {
            let law = Law::new(Family::Isolines, [built(32.0, square), built(128.0, square)]);
            assert!((law.build(4096.0) / built(4096.0, square).build - 1.0).abs() < 1e-9, "{square}");
        }
        let law = Law::new(Family::Isolines, [built(32.0, 1e-3), built(128.0, 0.0)]);
        assert_eq!(law.build(4096.0), 0.05);
        let law = Law::new(Family::Qmc, [built(64.0, 0.0), built(512.0, 2e-6)]);
        assert_eq!(law.build(65536.0), built(512.0, 2e-6).build, "what differs between rays is noise");
        // From what was measured at one count to another one.
        let law = Law::new(Family::Isolines, [level(32.0), level(128.0)]);
        assert_eq!(law.nearer(100, 1e-3, 1e-3), 108);
        assert_eq!(law.nearer(100, 1e-3 * 2f64.powf(0.9), 1e-3), 212, "up at the pace that was measured");
        assert_eq!(law.nearer(100, 1e-3 / 2f64.powf(1.7), 1e-3), 56, "down at the steepest");
        assert_eq!(law.nearer(100, 0.0, 1e-3), 4);
        assert!((law.error_beyond(50.0, 1e-3, 100.0) / 1e-3 - 2f64.powf(-0.9)).abs() < 1e-12);
        // Nothing wrong: the least that makes sense.
        let right = Level { rmse: 0.0, stated: 0.0, ..level(64.0) };
        assert_eq!(Law::new(Family::Isolines, [right, right]).candidate(1e-3, 10).count, 4);
    }
}
