use std::fmt;
use std::time::Instant;

use serde::Serialize;

use super::pilot::{Level, Pilot, stated};
use super::{Arrays, Control, Method, Prepared, Receivers, Request};
use crate::reference::EmbreeVariant;
use crate::{Error, Result};

/// What a plan has to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// Root mean square of the error over all receivers and components of an array, in the worst array asked for, in the
    /// array's own unit.
    pub error: f64,
    /// The only family to choose from; any that this build has, if there is none.
    pub family: Option<Family>,
}

/// Methods that differ by a count alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// [`Method::Isolines`], of any number of lines.
    Isolines,
    /// [`Method::Exact`].
    Exact,
    /// [`Method::Qmc`], of any number of samples.
    Qmc,
    /// [`Method::Embree`], of any number of samples.
    Embree,
}

/// The method that reaches an error in the least time, as far as a few receivers could tell.
///
/// The choice follows from measured times and so may differ from one run to the next; the method that was chosen gives the
/// same bits again.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What to run.
    pub method: Method,
    /// How it came about.
    pub report: PlanReport,
}

/// What a plan rests on.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PlanReport {
    /// The error asked for.
    pub error: f64,
    /// The error expected of the method chosen; above `error` only if no method reaches that.
    pub expected_error: f64,
    /// Seconds of one processor expected for all receivers, what is still to be built included.
    pub expected_seconds: f64,
    /// Every family that was tried, the one chosen first.
    pub candidates: Vec<Candidate>,
    /// Receivers that were measured.
    pub pilot_receivers: usize,
    /// Seconds that the planning took, what it built included.
    pub seconds: f64,
    /// Of these, seconds of building what the method chosen needs anyway.
    pub build_seconds: f64,
    /// The true error is about this share of the root mean square of the errors that the method states.
    pub share_of_stated: f64,
}

/// One family's prospects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// Which.
    pub family: Family,
    /// Lines or samples that reach the error; 0 where there is nothing to count.
    pub count: u32,
    /// Error expected.
    pub expected_error: f64,
    /// Seconds of one processor expected for all receivers, what is still to be built included.
    pub expected_seconds: f64,
    #[serde(skip)]
    share_of_stated: f64,
}

impl PlanReport {
    /// The report for so many times as many receivers, of which those it is for are a sample.
    pub fn scale(&mut self, factor: f64) {
        self.expected_seconds *= factor;
        self.candidates.iter_mut().for_each(|candidate| candidate.expected_seconds *= factor);
    }

    /// The error of a finished run, from the errors that it states.
    pub fn estimate(&self, arrays: &Arrays) -> f64 {
        self.share_of_stated * stated(arrays)
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PlanReport { expected_error, expected_seconds, .. } = self.report;
        match self.method {
            Method::Isolines { lines } => write!(f, "{lines} isolines")?,
            Method::Exact => f.write_str("exact")?,
            Method::Qmc { samples, .. } => write!(f, "{samples} rays")?,
            Method::Embree { samples, .. } => write!(f, "{samples} rays on Embree")?,
        }
        write!(f, ": error {expected_error:.1e} and {expected_seconds:.2} s of processor time expected")
    }
}

impl Family {
    /// Rays come at least in such numbers.
    pub(super) const FEWEST_RAYS: u32 = 8;

    /// The member with `count` lines or samples.
    pub fn method(self, count: u32) -> Method {
        match self {
            Self::Isolines => Method::Isolines { lines: count },
            Self::Exact => Method::Exact,
            Self::Qmc => Method::Qmc { samples: count, seed: 0 },
            Self::Embree => Method::Embree { samples: count, seed: 0, variant: EmbreeVariant::default() },
        }
    }

    /// Receivers of first looks, which decide whether the family is worth measuring, and the share of the time they take that
    /// it takes at least when all share a search, at its fewest lines.
    pub(super) fn looks(self) -> &'static [(usize, f64)] {
        match self {
            Self::Exact => &[(4, 0.1), (32, 0.5)],
            _ => &[(64, 0.5)],
        }
    }

    /// Two counts at which it is measured, far enough apart to tell how error and time go on. Where few rays will do, few tell it.
    pub(super) fn levels(self, error: f64) -> [u32; 2] {
        match self {
            Self::Isolines => [32, 128],
            Self::Exact => [0; 2],
            Self::Qmc | Self::Embree if error > FEW_RAYS => [16, 64],
            Self::Qmc | Self::Embree => [64, 512],
        }
    }

    /// The least share of `count` that can reach `error`.
    pub(super) fn least(self, error: f64, count: f64) -> f64 {
        match self {
            Self::Isolines | Self::Exact => 1.0,
            Self::Qmc | Self::Embree => (LEAST_RAY_ERROR / error).powf(4.0 / 3.0).max(Self::FEWEST_RAYS.into()) / count,
        }
    }

    /// The least count of at least `count` that makes sense.
    fn round(self, count: f64) -> u32 {
        match self {
            Self::Isolines => (count.clamp(4.0, f64::from(1 << 20)) / 4.0).ceil() as u32 * 4,
            Self::Exact => 0,
            // Sobol sets are best, and only then sorted into packets, at powers of two.
            Self::Qmc | Self::Embree => {
                let (fewest, most) = (f64::from(Self::FEWEST_RAYS), f64::from(1 << 28));
                (count.clamp(fewest, most).ceil() as u32).next_power_of_two()
            }
        }
    }

    /// Exponents of the error's fall that are credible: N^-1.5 in solid scenes, less in foliage; rays N^-0.75.
    fn exponents(self) -> std::ops::RangeInclusive<f64> {
        match self {
            Self::Isolines | Self::Exact => 0.9..=1.7,
            Self::Qmc | Self::Embree => 0.5..=0.85,
        }
    }
}

/// How a family's error and time depend on its count.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    family: Family,
    pub(super) levels: [Level; 2],
    exponent: f64,
}

impl Law {
    pub(super) fn new(family: Family, levels: [Level; 2]) -> Self {
        let [coarse, fine] = levels;
        let falls = if fine.rmse > 0.0 { coarse.rmse / fine.rmse } else { coarse.stated / fine.stated };
        let exponent = falls.ln() / (fine.count / coarse.count).ln();
        let credible = family.exponents();
        let exponent = if exponent.is_finite() { exponent.clamp(*credible.start(), *credible.end()) } else { 1.0 };
        Self { family, levels, exponent }
    }

    /// RMSE of a single line or sample, if the law held so far down.
    fn scale(&self) -> f64 {
        let scale = |level: Level| level.rmse * level.count.powf(self.exponent);
        let [coarse, fine] = self.levels.map(scale);
        if fine > 0.0 { (coarse * fine).sqrt() } else { coarse }
    }

    /// RMSE of `count` lines or samples.
    pub(super) fn error(&self, count: f64) -> f64 {
        self.scale() * count.powf(-self.exponent)
    }

    fn count(&self, error: f64) -> u32 {
        self.family.round((self.scale() / error).powf(1.0 / self.exponent))
    }

    /// Seconds of building what `count` lines or samples need: for lines a fixed part and one in proportion to the count's square, for
    /// tables of light grow like that; for rays nothing grows.
    pub(super) fn build(&self, count: f64) -> f64 {
        let [coarse, fine] = self.levels;
        if self.family != Family::Isolines {
            return fine.build;
        }
        let slope = (fine.build - coarse.build) / (fine.count.powi(2) - coarse.count.powi(2));
        (fine.build + slope.max(0.0) * (count.powi(2) - fine.count.powi(2))).max(0.0)
    }

    /// Seconds of one receiver: a fixed part and one in proportion to the count.
    pub(super) fn seconds(&self, count: f64) -> f64 {
        let [coarse, fine] = self.levels;
        let slope = ((fine.seconds - coarse.seconds) / (fine.count - coarse.count)).max(0.0);
        // Below the coarse level nothing is known to be cheaper than in proportion.
        let line = coarse.seconds + slope * (count - coarse.count);
        line.max(coarse.seconds * (count / coarse.count).min(1.0))
    }

    /// From a number of isolines at which the error was measured, one nearer to where it is `aim`, on the safe side of it.
    pub(super) fn nearer(&self, count: u32, error: f64, aim: f64) -> u32 {
        /// Steps down fall short by this, and steps up go too far.
        const SAFETY: f64 = 1.05;
        let steepest = *self.family.exponents().end();
        let exponent = if error > aim { self.exponent } else { steepest };
        self.family.round(SAFETY * f64::from(count) * (error / aim).powf(exponent.recip()))
    }

    /// RMSE of so many lines or samples, given that of fewer.
    pub(super) fn error_beyond(&self, known: f64, error: f64, count: f64) -> f64 {
        error * (known / count).powf(self.exponent)
    }

    /// As many lines or samples as reach `error`.
    pub(super) fn candidate(&self, error: f64, receivers: usize) -> Candidate {
        let count = self.count(error);
        self.candidate_of(count, self.error(f64::from(count)), receivers)
    }

    /// So many lines or samples, of which this error is expected.
    pub(super) fn candidate_of(&self, count: u32, expected_error: f64, receivers: usize) -> Candidate {
        let [coarse, _] = self.levels;
        Candidate {
            family: self.family,
            count,
            expected_error,
            expected_seconds: self.build(f64::from(count)) + receivers as f64 * self.seconds(f64::from(count)),
            share_of_stated: if coarse.stated > 0.0 { coarse.rmse / coarse.stated } else { 1.0 },
        }
    }
}

/// Those that reach `error` first, the fastest first; then the others, the best first.
fn rank(candidates: &mut [Candidate], error: f64) {
    candidates.sort_by(|a, b| match [a, b].map(|candidate| candidate.expected_error > error) {
        [false, false] => a.expected_seconds.total_cmp(&b.expected_seconds),
        [true, true] => a.expected_error.total_cmp(&b.expected_error),
        [a, b] => a.cmp(&b),
    });
}

impl Candidate {
    /// The same where this root mean square of errors was stated with the error expected.
    pub(super) fn with_stated(self, stated: f64) -> Self {
        let share_of_stated = if stated > 0.0 { self.expected_error / stated } else { self.share_of_stated };
        Self { share_of_stated, ..self }
    }

    /// The exact method, as measured for `all` receivers.
    pub(super) fn exact(level: Level, all: usize) -> Self {
        Self {
            family: Family::Exact,
            count: 0,
            expected_error: level.stated,
            expected_seconds: level.build + all as f64 * level.seconds,
            share_of_stated: 1.0,
        }
    }
}

/// By how much the errors that are aimed for lie below those asked for: what the pilot's few receivers may miss.
const MARGIN: f64 = 1.1;
/// No ray costs less, in seconds: sorted packets in a scene of a few triangles.
const LEAST_RAY: f64 = 15e-9;
/// Rays have at least this error times N^-3/4 wherever much is hidden: 0.09 in a room, 0.4 beside a sphere.
const LEAST_RAY_ERROR: f64 = 0.05;
/// Building what finds contours takes at least this much time for each triangle, in seconds.
const LEAST_BUILD: f64 = 0.3e-6;

/// This error takes not many more than a hundred rays anywhere.
const FEW_RAYS: f64 = 3e-2;

/// Fewer isolines than the two numbers first measured let expect may take up to so many times less.
const DOUBT: f64 = 4.0;

/// Above this error rays are tried first.
const COARSE: f64 = 3e-3;

impl Prepared<'_> {
    /// Finds the method that reaches `goal` for `receivers` in the least time, from measurements of a few
    /// of them. What is built meanwhile is kept for the run.
    ///
    /// Error along isolines is the difference between two numbers of lines, extrapolated by the exponent that their own
    /// estimates show, and then tried where that leads, beside exact values or four times as many lines; of rays, their difference from those lines, or from four times as many rays. Which power of two suffices for rays is
    /// tried: it depends on the luck of one set of directions.
    ///
    /// # Errors
    /// As [`Prepared::integrate`], and [`Error::Interrupted`] when `control` asks to stop.
    pub fn plan(&self, receivers: &Receivers, request: &Request, goal: Goal, control: &dyn Control) -> Result<Plan> {
        if !(goal.error.is_finite() && goal.error > 0.0) {
            return Err(Error::input(format!("an error of {} cannot be reached; ask for more than 0", goal.error)));
        }
        let started = Instant::now();
        control.begin("planning", 0);
        let mut pilot = Pilot::new(self, receivers, request, control)?;
        let aim = goal.error / MARGIN;
        // Only the boundary of the visible region gives gradients.
        let family = if request.gradients { Some(Family::Exact) } else { goal.family };
        let rays = if cfg!(feature = "embree") { Family::Embree } else { Family::Qmc };
        let all = receivers.len();
        let mut candidates: Vec<Candidate> = Vec::new();
        let mut attempt = |family, least: f64| {
            let best = candidates.iter().map(|known| known.expected_seconds).fold(f64::INFINITY, f64::min);
            if least < best {
                candidates.extend(pilot.try_family(family, aim, all, best)?);
            }
            Ok::<_, Error>(())
        };
        match family {
            Some(family) => attempt(family, 0.0)?,
            None => {
                // The cheaper way is likelier to end the search, and what it promises bounds what else is worth building.
                let least_rays = rays.least(aim, 1.0) * LEAST_RAY * all as f64;
                let least_build = LEAST_BUILD * self.geometry().triangles.len() as f64;
                if aim > COARSE {
                    attempt(rays, least_rays)?;
                    attempt(Family::Isolines, least_build)?;
                } else {
                    attempt(Family::Isolines, least_build)?;
                    attempt(rays, least_rays)?;
                }
                attempt(Family::Exact, least_build)?;
            }
        }
        if let Some(better_known) = pilot.revised_rays(aim, all) {
            candidates.retain(|candidate| candidate.family != rays);
            candidates.push(better_known);
        }
        rank(&mut candidates, goal.error);
        if let Some(at) =
            candidates.iter().position(|candidate| matches!(candidate.family, Family::Qmc | Family::Embree))
            && candidates[at].expected_seconds < 2.0 * candidates[0].expected_seconds
            && let Some(settled) = pilot.settle_rays(&candidates[at], goal.error, aim, all)?
        {
            candidates[at] = settled;
            rank(&mut candidates, goal.error);
        }
        if let Some(at) = candidates.iter().position(|candidate| candidate.family == Family::Isolines)
            && candidates[at].expected_seconds < DOUBT * candidates[0].expected_seconds
            && let Some(settled) = pilot.settle_isolines(&candidates[at], aim, all, candidates[0].expected_seconds)?
        {
            candidates[at] = settled;
            rank(&mut candidates, goal.error);
        }
        let best = &candidates[0];
        Ok(Plan {
            method: pilot.method(best.family, best.count),
            report: PlanReport {
                error: goal.error,
                expected_error: best.expected_error,
                expected_seconds: best.expected_seconds,
                pilot_receivers: pilot.receivers(),
                seconds: started.elapsed().as_secs_f64(),
                build_seconds: pilot.built(best.family),
                share_of_stated: best.share_of_stated,
                candidates,
            },
        })
    }
}
