use super::curve::{Curve, Time};
use super::{Quantity, Row};

/// How many times as fast as Embree a scene is to be solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Names of scenes that it is meant for.
    pub scenes: &'static [&'static str],
    /// What is integrated.
    pub quantity: Quantity,
    /// At this error.
    pub error: f64,
    /// Embree's time over ours, at least.
    pub ratio: f64,
}

const fn targets<const N: usize>(scenes: &'static [&'static str], ratios: [f64; 5], out: &mut [Target; N], at: usize) {
    use Quantity::{Harmonics, Occlusion};
    let columns = [(Occlusion, 1e-2), (Occlusion, 1e-3), (Occlusion, 1e-4), (Harmonics, 1e-3), (Harmonics, 1e-4)];
    let mut i = 0;
    while i < 5 {
        out[at + i] = Target { scenes, quantity: columns[i].0, error: columns[i].1, ratio: ratios[i] };
        i += 1;
    }
}

/// What this library is meant to reach, on one core with receivers in bake order.
pub const TARGETS: [Target; 30] = {
    let none = Target { scenes: &[], quantity: Quantity::Occlusion, error: 0.0, ratio: 0.0 };
    let mut all = [none; 30];
    targets(&["icosphere", "bunny"], [3.0, 30.0, 250.0, 40.0, 300.0], &mut all, 0);
    targets(&["room", "room_open"], [1.0, 8.0, 60.0, 10.0, 80.0], &mut all, 5);
    targets(&["dragon", "knots_100k"], [1.0, 5.0, 35.0, 8.0, 60.0], &mut all, 10);
    targets(&["knots_2m"], [1.0, 3.0, 20.0, 5.0, 40.0], &mut all, 15);
    targets(&["foliage", "oak"], [1.0, 1.0, 3.0, 1.0, 4.0], &mut all, 20);
    targets(&["building"], [5.0, 20.0, 100.0, 25.0, 120.0], &mut all, 25);
    all
};

/// A slower share than this of the best single method is what planning and round numbers of rays may cost.
pub const SLACK: f64 = 1.15;

/// Times at one error in one event.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// The scene's name.
    pub scene: String,
    /// What was integrated.
    pub quantity: Quantity,
    /// At this error.
    pub error: f64,
    /// By method: rows that count, read off at equal error.
    pub times: Vec<(String, Time)>,
    /// Embree's time over the better of isolines and exact.
    pub ratio: Option<f64>,
    /// What is to be reached, if anything was set.
    pub target: Option<f64>,
    /// The planner's time over that of the best single method, and the error it reached over the one asked for.
    pub auto: Option<(f64, f64)>,
}

/// Errors that are compared.
pub const ERRORS: [f64; 6] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

impl Comparison {
    /// One for every error, of the rows of one event.
    pub fn of(rows: &[&Row]) -> Vec<Self> {
        let Some(first) = rows.first() else { return Vec::new() };
        let mut names: Vec<&str> = Vec::new();
        for row in rows {
            if !names.contains(&row.method.as_str()) {
                names.push(&row.method);
            }
        }
        let curves: Vec<(&str, Curve)> = names
            .into_iter()
            .map(|name| (name, Curve::new(rows.iter().copied().filter(|row| row.method == name))))
            .collect();
        let compare = |error: f64| {
            let auto = rows.iter().find(|row| row.method == "auto" && row.count == error && row.counts());
            let singles = || curves.iter().filter(|(name, _)| *name != "auto");
            let times: Vec<(String, Time)> =
                singles().filter_map(|(name, curve)| Some(((*name).to_owned(), curve.at(error)?))).collect();
            let time = |wanted: &str| times.iter().find(|(name, _)| name == wanted).map(|(_, time)| time.seconds);
            let ours = [time("isolines"), time("exact")].into_iter().flatten().reduce(f64::min);
            // Rays come in powers of two.
            let achievable = singles().filter_map(|(name, curve)| match *name {
                "qmc" | "embree" => curve.reaching(error),
                _ => curve.at(error),
            });
            let best = achievable.map(|time| time.seconds).reduce(f64::min);
            let target = TARGETS.iter().find(|target| {
                target.scenes.contains(&first.scene.as_str())
                    && target.quantity == first.quantity
                    && target.error == error
            });
            Self {
                scene: first.scene.clone(),
                quantity: first.quantity,
                error,
                ratio: time("embree").zip(ours).map(|(embree, ours)| embree / ours),
                target: target.map(|target| target.ratio),
                auto: auto.zip(best).map(|(row, best)| (row.total() / best, row.rmse / error)),
                times,
            }
        };
        ERRORS.map(compare).into()
    }

    /// Whether the target is met; where it asks for no more than a draw, the planner may call rays.
    pub fn is_met(&self) -> Option<bool> {
        let (ratio, target) = self.ratio.zip(self.target)?;
        let by_rays = target == 1.0 && self.auto.is_some_and(|(slowness, _)| slowness <= SLACK);
        Some(ratio >= target || by_rays)
    }
}
