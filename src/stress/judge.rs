use std::f64::consts::TAU;

use rayon::prelude::*;

use super::{Case, Row, Truth, Verdict};
use crate::bake::{self, Control, Method, Receivers};
use crate::reference::{self, Qmc, RayScene};
use crate::scene::Geometry;
use crate::sphere::{Order, rotate};
use crate::{Error, Result};

/// Bands of the harmonics that are compared.
pub(super) const ORDER: usize = 4;

pub(super) fn order() -> Order {
    Order::new(ORDER).expect("four bands are on offer")
}

/// How hard the judges try.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Rays per receiver; where they seem to contradict, 16 times as many are cast, and again, up to `most_samples`.
    pub samples: u32,
    /// Rays that a receiver gets at most.
    pub most_samples: u32,
    /// Another seed casts other rays.
    pub seed: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { samples: 1 << 10, most_samples: 1 << 18, seed: 1 }
    }
}

/// Solves a case by `method` and compares every receiver with the truth and with rays.
///
/// An error of the library is a bad verdict like a wrong answer.
///
/// # Errors
/// [`Error::Interrupted`] when `control` asks to stop.
pub fn try_case(case: &Case, method: Method, settings: Settings, control: &dyn Control) -> Result<Row> {
    let mut row = Row {
        case: case.name.clone(),
        method,
        receivers: case.receivers.len(),
        alarms: 0,
        fallbacks: 0,
        worst: 0.0,
        receiver: None,
        strain: 0.0,
        verdict: Verdict::Good,
    };
    match fill(case, method, settings, control, &mut row) {
        Err(Error::Interrupted) => return Err(Error::Interrupted),
        Err(error) => row.verdict = Verdict::Bad(error.to_string()),
        Ok(()) => {}
    }
    Ok(row)
}

fn fill(case: &Case, method: Method, settings: Settings, control: &dyn Control, row: &mut Row) -> Result<()> {
    let Case { geometry, receivers, truth, .. } = case;
    let answers = solve(geometry, receivers, method, control)?;
    (row.alarms, row.fallbacks) = (answers.alarms, answers.fallbacks);
    let exact = match (truth, method) {
        (Truth::Rays, Method::Isolines { .. }) => Some(solve(geometry, receivers, Method::Exact, control)?.rows),
        _ => None,
    };
    let expected = match truth {
        Truth::Known(rows) => Some(rows.clone()),
        Truth::Sum(_) => Some(sum(truth, method, control)?),
        Truth::AtMost(brighter) => Some(solve(brighter, receivers, method, control)?.rows),
        Truth::Rays => exact,
    };
    let tolerances: Vec<f64> = answers.errors.iter().map(|error| floor(method) + STATED * error).collect();
    let mut wrong = Vec::new();
    if let Some(expected) = &expected {
        for (index, (answer, expected)) in answers.rows.iter().zip(expected).enumerate() {
            let difference = match truth {
                Truth::AtMost(_) => brighter(answer, expected),
                _ => distance(answer, expected),
            };
            row.worst = row.worst.max(difference);
            let tolerance = tolerances[index];
            row.strain_by(index, difference / tolerance);
            if difference > tolerance {
                wrong.push(format!("receiver {index} is off by {difference:.1e}, allowed are {tolerance:.1e}"));
            }
        }
    }

    control.begin("casting rays", receivers.len() as u64);
    let rays = RayScene::new(geometry);
    let judged: Vec<_> = (0..receivers.len())
        .into_par_iter()
        .map(|index| {
            if control.cancelled() {
                return Err(Error::Interrupted);
            }
            control.advance(1);
            ask_rays(&rays, receivers, index, &answers.rows[index], tolerances[index], settings)
        })
        .collect::<Result<_>>()?;
    for (index, Rays { difference, allowed }) in judged.into_iter().enumerate() {
        if expected.is_none() {
            row.worst = row.worst.max(difference);
        }
        if expected.is_none() || difference > allowed {
            row.strain_by(index, difference / allowed);
        }
        if difference > allowed {
            wrong.push(format!("receiver {index} is {difference:.1e} from rays, allowed are {allowed:.1e}"));
        }
    }
    if let Some(first) = wrong.first() {
        let receiver = row.receiver.map(|index| receivers.get(index));
        let place =
            receiver.map_or_else(String::new, |r| format!("; receiver at {:?}, normal {:?}", r.position, r.normal));
        row.verdict = Verdict::Bad(format!("{} wrong: {first}{place}", wrong.len()));
    }
    Ok(())
}

/// A good answer may be off by this many times the error it states.
const STATED: f64 = 4.0;

/// What a method may be off by whatever it states, in a coefficient or in the ambient occlusion.
fn floor(method: Method) -> f64 {
    match method {
        // Rounding of hundreds of arcs, in scenes whose receivers may be a million sizes away or 1e-12 sizes near.
        Method::Exact => 1e-9,
        // An edge along the lines moves from one side of a line to the other at once, an error of first order: half the
        // lines' distance, 1/N in u, times the edge's length.
        Method::Isolines { lines } => 4.0 / f64::from(lines),
        Method::Qmc { samples, .. } | Method::Embree { samples, .. } => TAU * f64::from(samples).powf(-0.5),
    }
}

/// The answers of all receivers.
struct Answers {
    rows: Vec<Vec<f64>>,
    /// The largest error that each states.
    errors: Vec<f64>,
    alarms: u64,
    fallbacks: u64,
}

fn solve(geometry: &Geometry, receivers: &Receivers, method: Method, control: &dyn Control) -> Result<Answers> {
    let is_directed = !receivers.normals.is_empty();
    let request =
        bake::Request { order: ORDER, ambient_occlusion: is_directed, visibility_sh: true, ..bake::Request::default() };
    let outcome = bake::integrate(geometry, None, receivers, &request, method, None, control)?;
    if !outcome.done.iter().all(|&done| done) {
        return Err(Error::Interrupted);
    }
    let harmonics = outcome.arrays.get("visibility_sh").map_or(&[][..], |array| &array.data);
    let mut rows: Vec<Vec<f64>> = harmonics.chunks_exact(ORDER * ORDER).map(<[f64]>::to_vec).collect();
    if let Some(occlusion) = outcome.arrays.get("ambient_occlusion") {
        rows.iter_mut().zip(&occlusion.data).for_each(|(row, &value)| row.push(value));
    }
    let mut errors = vec![0.0f64; rows.len()];
    for name in ["visibility_sh_error", "ambient_occlusion_error"] {
        let Some(array) = outcome.arrays.get(name) else { continue };
        let width = (array.data.len() / rows.len().max(1)).max(1);
        for (error, stated) in errors.iter_mut().zip(array.data.chunks_exact(width)) {
            *error = stated.iter().fold(*error, |worst, stated| worst.max(*stated));
        }
    }
    let statistics = outcome.statistics;
    Ok(Answers { rows, errors, alarms: statistics.depth_alarms, fallbacks: statistics.fallbacks.values().sum() })
}

fn sum(truth: &Truth, method: Method, control: &dyn Control) -> Result<Vec<Vec<f64>>> {
    let Truth::Sum(terms) = truth else { return Ok(Vec::new()) };
    let mut total: Vec<Vec<f64>> = Vec::new();
    let mut rotated = [0.0; ORDER * ORDER];
    for term in terms {
        let rows = solve(&term.geometry, &term.receivers, method, control)?.rows;
        total.resize_with(rows.len(), Vec::new);
        for (sum, mut row) in total.iter_mut().zip(rows) {
            rotate(order(), term.rotation, &row[..ORDER * ORDER], &mut rotated);
            row[..ORDER * ORDER].copy_from_slice(&rotated);
            sum.resize(row.len(), 0.0);
            sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += term.weight * value);
        }
    }
    Ok(total)
}

/// Largest difference; of what both have, for probes have no occlusion.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// By how much the mean of the visibility, or the ambient occlusion, is larger than the other.
fn brighter(a: &[f64], b: &[f64]) -> f64 {
    let excess = |k: usize| a.get(k).zip(b.get(k)).map_or(0.0, |(a, b)| a - b);
    excess(0).max(excess(ORDER * ORDER)).max(0.0)
}

/// What rays say about an answer.
struct Rays {
    difference: f64,
    allowed: f64,
}

fn ask_rays(
    rays: &RayScene,
    receivers: &Receivers,
    index: usize,
    answer: &[f64],
    tolerance: f64,
    settings: Settings,
) -> Result<Rays> {
    /// Standard errors that a good answer may be away: each comes of eight randomisations alone, so that of the 17 numbers
    /// of a receiver one is beyond this once in a thousand times. Such a receiver gets more rays, independent ones.
    const STANDARD_ERRORS: f64 = 8.0;
    /// Solid angle, in shares of one ray's, that eight randomisations may all miss.
    const MISSED: f64 = 4.0;
    let receiver = receivers.get(index);
    let request = reference::Request {
        ambient_occlusion: receiver.normal.is_some(),
        visibility_sh: Some(order()),
        ..reference::Request::default()
    };
    let columns = request.columns();
    let (mut values, mut errors) = (vec![0.0; columns.len()], vec![0.0; columns.len()]);
    let mut samples = settings.samples;
    loop {
        let qmc = Qmc { samples, seed: settings.seed };
        qmc.integrate_one(rays, index, &receiver, &request, &mut values, &mut errors)?;
        // The answer has its occlusion last.
        let occlusion = columns.ambient_occlusion.clone();
        let places = columns.visibility_sh.clone().chain(occlusion).zip(answer);
        let missed = MISSED * 2.0 * TAU / f64::from(samples);
        let worst = places
            .map(|(place, value)| {
                let allowed = STANDARD_ERRORS * errors[place] + missed + tolerance;
                Rays { difference: (values[place] - value).abs(), allowed }
            })
            .fold(Rays { difference: 0.0, allowed: f64::INFINITY }, |worst, one| {
                if one.difference * worst.allowed > worst.difference * one.allowed || one.difference.is_nan() {
                    one
                } else {
                    worst
                }
            });
        if worst.difference <= worst.allowed || samples >= settings.most_samples {
            return Ok(worst);
        }
        samples = samples.saturating_mul(16).min(settings.most_samples);
    }
}
