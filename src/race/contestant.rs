use cpu_time::ProcessTime;

use crate::bake::{Control, Family, Goal, Method, Outcome, Prepared, Receivers, Request, Unmoved};
use crate::reference::EmbreeVariant;
use crate::{Error, Result};

use super::{Quantity, Track};

/// Something that races: a method with a knob.
pub trait Contestant {
    /// Its name in tables.
    fn name(&self) -> &str;

    /// Settings of the knob, from the cheapest to the dearest.
    fn ladder(&self) -> Vec<f64>;

    /// Integrates on the threads of the current pool. Other repeats may draw other samples.
    ///
    /// # Errors
    /// As [`Prepared::integrate`].
    fn run(&self, setting: f64, repeat: u32, control: &dyn Control) -> Result<Run>;

    /// By how much the true error may exceed the stated one in the root mean square: 1 for bounds, more for standard
    /// errors, which are themselves estimates.
    fn allowance(&self) -> f64 {
        1.0
    }
}

/// A contestant whose knob is stuck.
pub(super) struct AtOneSetting<'a> {
    pub(super) contestant: &'a dyn Contestant,
    pub(super) setting: f64,
}

impl Contestant for AtOneSetting<'_> {
    fn name(&self) -> &str {
        self.contestant.name()
    }

    fn ladder(&self) -> Vec<f64> {
        vec![self.setting]
    }

    fn run(&self, setting: f64, repeat: u32, control: &dyn Control) -> Result<Run> {
        self.contestant.run(setting, repeat, control)
    }

    fn allowance(&self) -> f64 {
        self.contestant.allowance()
    }
}

/// What a contestant's run gave.
pub struct Run {
    /// Values and times.
    pub outcome: Outcome,
    /// The setting in words.
    pub setting: String,
    /// Seconds that planning took for a whole bake, spread over its receivers.
    pub planning: f64,
    /// Seconds to build all that was needed, from nothing.
    pub build_seconds: f64,
}

/// One of this library's methods, or the planner.
pub struct Entrant<'a> {
    prepared: &'a Prepared<'a>,
    track: &'a Track,
    request: Request,
    kind: Kind,
    name: &'static str,
    /// Seconds to build what the kind searches in.
    build_seconds: f64,
}

#[derive(Clone, Copy)]
enum Kind {
    Family(Family, EmbreeVariant),
    Auto,
}

impl<'a> Entrant<'a> {
    /// All that this build has: isolines, exact, rays, rays on Embree, and the planner.
    ///
    /// Of Embree's variants the fastest in this scene is taken, by a run that nobody is charged for.
    ///
    /// # Errors
    /// As [`Prepared::integrate`].
    pub fn all(
        prepared: &'a Prepared,
        track: &'a Track,
        quantity: Quantity,
        builds: &Builds,
        control: &dyn Control,
    ) -> Result<Vec<Self>> {
        let request = quantity.request();
        let entrant = |name, kind, build_seconds| Self { prepared, track, request, kind, name, build_seconds };
        let plain = EmbreeVariant::default();
        let mut all = vec![
            entrant("isolines", Kind::Family(Family::Isolines, plain), builds.contours),
            entrant("exact", Kind::Family(Family::Exact, plain), builds.contours),
            entrant("qmc", Kind::Family(Family::Qmc, plain), builds.rays),
        ];
        let mut best: Option<(f64, EmbreeVariant, f64)> = None;
        for &(variant, seconds) in &builds.embree {
            let pilot = Method::Embree { samples: 256, seed: 0, variant };
            let run = || integrate(prepared, &track.receivers, &request, pilot, control);
            let time = run()?.statistics.processor_seconds.min(run()?.statistics.processor_seconds);
            if best.is_none_or(|best| time < best.0) {
                best = Some((time, variant, seconds));
            }
        }
        if let Some((_, variant, seconds)) = best {
            all.push(entrant("embree", Kind::Family(Family::Embree, variant), seconds));
        }
        all.push(entrant("auto", Kind::Auto, builds.contours));
        Ok(all)
    }
}

/// Seconds to build what methods search in, from nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Builds {
    contours: f64,
    rays: f64,
    embree: Vec<(EmbreeVariant, f64)>,
}

impl Builds {
    /// Builds everything that `prepared` does not have yet, on the threads of the current pool.
    ///
    /// # Errors
    /// As [`Prepared::integrate`].
    pub fn measure(prepared: &Prepared, track: &Track, control: &dyn Control) -> Result<Self> {
        let (one, request) = (track.receivers.pick([0]), Quantity::Occlusion.request());
        let build = |method: Method| {
            let outcome = integrate(prepared, &one, &request, method, control)?;
            Ok::<_, Error>(outcome.statistics.build_seconds)
        };
        let mut builds = Self {
            contours: build(Method::Exact)?,
            rays: build(Method::Qmc { samples: 8, seed: 0 })?,
            embree: Vec::new(),
        };
        for variant in EmbreeVariant::ALL {
            let method = Method::Embree { samples: 8, seed: 0, variant };
            if method.check().is_ok() {
                // Variants of one quality share a tree.
                let known = builds.embree.iter().find(|(known, _)| known.quality == variant.quality);
                let seconds = known.map_or_else(|| build(method), |&(_, seconds)| Ok(seconds))?;
                builds.embree.push((variant, seconds));
            }
        }
        Ok(builds)
    }
}

/// Integrates to the end or not at all.
pub(super) fn integrate(
    prepared: &Prepared,
    receivers: &Receivers,
    request: &Request,
    method: Method,
    control: &dyn Control,
) -> Result<Outcome> {
    let outcome = prepared.integrate(receivers, request, method, None, &Unmoved(control))?;
    match outcome.done.iter().all(|&done| done) {
        true => Ok(outcome),
        false => Err(Error::Interrupted),
    }
}

impl Contestant for Entrant<'_> {
    fn name(&self) -> &str {
        self.name
    }

    fn ladder(&self) -> Vec<f64> {
        let powers = |range: std::ops::RangeInclusive<i32>| range.map(|power| 2f64.powi(power)).collect();
        match self.kind {
            Kind::Family(Family::Exact, _) => vec![0.0],
            Kind::Family(Family::Isolines, _) => powers(3..=14),
            Kind::Family(..) => powers(3..=24),
            Kind::Auto => (1..=6).map(|power| 10f64.powi(-power)).collect(),
        }
    }

    fn run(&self, setting: f64, repeat: u32, control: &dyn Control) -> Result<Run> {
        let count = setting as u32;
        let (method, words, planning) = match self.kind {
            Kind::Family(family, variant) => match family.method(count) {
                Method::Qmc { samples, .. } => (Method::Qmc { samples, seed: repeat }, format!("{samples} rays"), 0.0),
                Method::Embree { samples, .. } => {
                    (Method::Embree { samples, seed: repeat, variant }, format!("{samples} rays, {variant}"), 0.0)
                }
                method => (method, if count == 0 { "-".into() } else { format!("{count} lines") }, 0.0),
            },
            Kind::Auto => {
                let goal = Goal { error: setting, family: None };
                let clock = ProcessTime::try_now();
                let plan = self.prepared.plan(&self.track.bake, &self.request, goal, &Unmoved(control))?;
                let taken = clock.and_then(|clock| clock.try_elapsed());
                let taken = taken.map_or(plan.report.seconds, |time| time.as_secs_f64());
                let words = match plan.method {
                    Method::Isolines { lines } => format!("{setting:.0e}: {lines} isolines"),
                    Method::Exact => format!("{setting:.0e}: exact"),
                    Method::Qmc { samples, .. } => format!("{setting:.0e}: {samples} rays"),
                    Method::Embree { samples, .. } => format!("{setting:.0e}: {samples} rays on Embree"),
                };
                (plan.method, words, taken / self.track.bake.len() as f64)
            }
        };
        let outcome = integrate(self.prepared, &self.track.receivers, &self.request, method, control)?;
        let build_seconds = self.build_seconds + outcome.statistics.build_seconds;
        Ok(Run { outcome, setting: words, planning, build_seconds })
    }

    fn allowance(&self) -> f64 {
        match self.kind {
            Kind::Family(Family::Qmc | Family::Embree, _) | Kind::Auto => 1.5,
            Kind::Family(..) => 1.0,
        }
    }
}
