use std::sync::OnceLock;

use glam::DVec3;

use super::Method;
use super::assembly::{Assembly, Seen};
use super::gradients::Gradients;
use super::integrate::{Baker, Counts};
use super::layout::Layout;
use super::{Prepared, Receivers, Request};
use crate::integrand::{LightMoments, LightRegion, LightTable, LineHarmonics, LineMoments};
use crate::reference::{self, PixelDistribution, Qmc};
use crate::scene::Environment;
use crate::sphere::{self, Order};
use crate::visibility::{
    self, Frame, Isolines, MeridianFrame, Meridians, Receiver, Sight, Skips, Spans, View, Viewer, open_spans,
};
use crate::{Error, Result};

/// Visibility by contours: along isolines or exactly, and each as the other's second opinion.
///
/// A receiver whose result raises an alarm is solved again in a rotated frame, then by the other method, then by rays.
pub(super) struct Solver<'a> {
    prepared: &'a Prepared<'a>,
    viewer: Viewer<'a>,
    method: Method,
    skips: Skips,
    assembly: Assembly<'a>,
    gradients: bool,
    layout: &'a Layout,
    lines: OnceLock<Lines>,
    region_light: OnceLock<LightRegion>,
    /// Where a textured light is bright, for rays as the last resort.
    bright: OnceLock<Option<PixelDistribution>>,
}

/// The isolines and their tables, for harmonics and for textured light.
struct Lines {
    harmonics: Option<(Meridians, LineHarmonics)>,
    light: Option<(Isolines, LightTable)>,
}

/// A way to solve one receiver.
#[derive(Clone, Copy)]
enum Attempt {
    Isolines { frame: usize },
    Exact { frame: u32 },
    Rays,
}

/// Isolines that serve as the exact method's second opinion.
const SECOND_LINES: usize = 4096;
/// Rays of the last resort.
const LAST_RAYS: u32 = 1 << 16;

/// Working memory of one thread.
#[derive(Default)]
pub(super) struct Memory {
    view: View,
    moments: LineMoments,
    light: LightMoments,
    open: Spans,
    /// Harmonics in the axes of a chart.
    local: Vec<f64>,
    seen: Seen,
    gradients: Gradients,
    /// For looks at a receiver's neighbourhood, which leave the tile's search alone.
    aside: View,
}

impl<'a> Solver<'a> {
    pub(super) fn new(
        prepared: &'a Prepared,
        environment: Option<&'a Environment>,
        request: &Request,
        layout: &'a Layout,
        method: Method,
    ) -> Result<Self> {
        let solver = Self {
            prepared,
            viewer: prepared.viewer()?,
            method,
            skips: prepared.skips(),
            assembly: Assembly::new(environment, request, layout)?,
            gradients: request.gradients,
            layout,
            lines: OnceLock::new(),
            region_light: OnceLock::new(),
            bright: OnceLock::new(),
        };
        // What the method itself needs is built now, what only a second opinion needs when it is asked for.
        match method {
            Method::Isolines { lines } => {
                let isolines = Isolines::new(lines as usize)?;
                solver.lines.get_or_init(|| Lines::new(isolines, &solver.assembly));
            }
            Method::Exact => {
                solver.region_light();
            }
            Method::Qmc { .. } | Method::Embree { .. } => unreachable!("rays need no contours"),
        }
        Ok(solver)
    }

    fn region_light(&self) -> Option<&LightRegion> {
        let environment = self.assembly.textured?;
        Some(self.region_light.get_or_init(|| LightRegion::new(environment)))
    }

    /// The attempts on one receiver, in order; the last one always succeeds.
    fn attempts(&self) -> [Attempt; 4] {
        match self.method {
            Method::Exact => [
                Attempt::Exact { frame: 0 },
                Attempt::Exact { frame: 1 },
                Attempt::Isolines { frame: 0 },
                Attempt::Rays,
            ],
            _ => [
                Attempt::Isolines { frame: 0 },
                Attempt::Isolines { frame: 1 },
                Attempt::Exact { frame: 0 },
                Attempt::Rays,
            ],
        }
    }

    /// Everything asked for at one receiver of the tile that `memory.view` approached.
    fn receiver(&self, index: usize, receiver: Receiver, row: &mut [f64], memory: &mut Memory) -> Result<Counts> {
        let mut counts = Counts::default();
        // On an edge that is not its own the receiver sees that edge in all directions of a half circle, which the contours
        // do not tell.
        let first = if self.is_on_foreign_edge(receiver, &mut memory.view) { self.attempts().len() - 1 } else { 0 };
        for (number, attempt) in self.attempts().into_iter().enumerate().skip(first) {
            let alarm = match attempt {
                Attempt::Isolines { frame } => self.along_isolines(frame, receiver, memory, &mut counts),
                Attempt::Exact { frame } => self.exactly(frame, receiver, memory, &mut counts),
                Attempt::Rays => self.by_rays(index, receiver, &mut memory.seen)?,
            };
            if !alarm {
                if self.gradients && !matches!(attempt, Attempt::Exact { .. }) {
                    self.differentiate(receiver, memory);
                }
                counts.depth_alarms = u64::from(number > 0);
                if let Some(fallback) = number.checked_sub(1) {
                    counts.fallbacks[fallback] = 1;
                }
                break;
            }
        }
        self.assembly.fill(&memory.seen, receiver.normal, row);
        if self.gradients {
            self.assembly.fill_gradients(&memory.gradients, receiver.normal, row);
        }
        match row.iter().all(|value| value.is_finite()) {
            true => Ok(counts),
            false => Err(Error::input(format!("receiver {index}: no method gives a finite result; this is a bug"))),
        }
    }

    /// Whether the receiver lies, as far as its contours can tell, on an edge or a corner of a face that it does not leave out.
    fn is_on_foreign_edge(&self, receiver: Receiver, view: &mut View) -> bool {
        let Receiver { position, excluded, .. } = receiver;
        let mut found = false;
        self.viewer.visit_around(receiver, view, |face| {
            let [a, b, c] = self.viewer.faces.corners(face).map(|corner| corner.as_dvec3() - position);
            let is_between = |a: DVec3, b: DVec3| a.dot(b) <= 0.0 && a.cross(b - a) == DVec3::ZERO;
            let holds = is_between(a, b) || is_between(b, c) || is_between(c, a);
            found |= holds && !excluded.contains(&face);
        });
        found
    }

    /// Solves along isolines; returns whether an alarm fired.
    fn along_isolines(&self, rank: usize, receiver: Receiver, memory: &mut Memory, counts: &mut Counts) -> bool {
        let lines = self.lines.get_or_init(|| {
            let isolines = Isolines::new(SECOND_LINES).expect("the number of isolines is a constant");
            Lines::new(isolines, &self.assembly)
        });
        let mut alarm = false;
        if let Some(harmonics) = &lines.harmonics {
            alarm |= self.along_meridians(harmonics, rank, receiver, memory, counts);
        }
        if let Some((isolines, table)) = &lines.light {
            alarm |= self.light_along_isolines(isolines, table, rank, receiver, memory, counts);
        }
        alarm
    }

    /// The harmonics of what a receiver sees.
    fn along_meridians(
        &self,
        (meridians, table): &(Meridians, LineHarmonics),
        rank: usize,
        receiver: Receiver,
        memory: &mut Memory,
        counts: &mut Counts,
    ) -> bool {
        let Memory { view, moments, local, seen, .. } = memory;
        let order = table.order();
        let frame = MeridianFrame::facing(receiver.normal, rank > 0);
        let sight = self.viewer.trace(meridians, frame, receiver, self.skips, view);
        counts.take(view.counts(), sight);
        seen.visibility.clear();
        seen.visibility.resize(order.len(), 0.0);
        seen.visibility_error = ROUNDING;
        match sight {
            Sight::Open => open_sky(order, receiver.normal, &mut seen.visibility),
            Sight::Enclosed => {}
            Sight::Part(_) => {
                table.integrate(view.spans(), moments);
                let [even, odd] = &moments.sets;
                local.clear();
                local.extend(even.iter().zip(odd).map(|(even, odd)| even + odd));
                table.turn(frame, local, &mut seen.visibility);
                // Turning keeps the length of the difference.
                let difference = even.iter().zip(odd).map(|(even, odd)| (even - odd).powi(2)).sum::<f64>();
                seen.visibility_error += NESTED * (difference / order.len() as f64).sqrt();
            }
        }
        matches!(sight, Sight::Part(sweep) if sweep.depth_alarms > 0)
    }

    /// The vector irradiance of a textured environment, along the isolines that all receivers share.
    fn light_along_isolines(
        &self,
        isolines: &Isolines,
        table: &LightTable,
        rank: usize,
        receiver: Receiver,
        memory: &mut Memory,
        counts: &mut Counts,
    ) -> bool {
        let Memory { view, light: moments, open, seen, .. } = memory;
        let frame = Frame::facing(receiver.normal, rank);
        let sight = self.viewer.follow(isolines, frame, receiver, self.skips, view);
        if self.assembly.bands.is_none() {
            counts.take(view.counts(), sight);
        }
        (seen.light, seen.light_error) = ([DVec3::ZERO; 3], [DVec3::ZERO; 3]);
        if sight != Sight::Enclosed {
            if sight == Sight::Open {
                open_spans(isolines, frame, receiver.normal, open);
            }
            let spans = if sight == Sight::Open { open } else { view.spans() };
            table.integrate(frame, spans, moments);
            seen.light = moments.vectors();
            let scale: f64 = seen.light.iter().map(|light| light.length()).sum();
            let errors = table.errors(frame, spans, moments);
            seen.light_error = errors.map(|error| EXPECTED * error + ROUNDING * scale);
        }
        matches!(sight, Sight::Part(sweep) if sweep.depth_alarms > 0)
    }

    /// Solves exactly; returns whether an alarm fired.
    fn exactly(&self, frame: u32, receiver: Receiver, memory: &mut Memory, counts: &mut Counts) -> bool {
        let Memory { view, seen, gradients, .. } = memory;
        self.viewer.solve(frame, receiver, self.skips, view);
        counts.contours = view.counts().above as u64;
        counts.hidden_bodies = view.counts().hidden as u64;
        counts.bodies_below_horizon = view.counts().sunken as u64;
        let has_contours = view.counts().above > 0;
        let region = view.region();
        let residuals = region.residuals();
        if !has_contours {
            counts.open += u64::from(region.solid_angle() > 0.0);
            counts.enclosed += u64::from(region.solid_angle() == 0.0);
        }
        let rounding = ROUNDING * (1.0 + (region.boundary().len() as f64).sqrt());
        let missed = residuals.closure + residuals.gap + residuals.negative.abs();
        if let Some(bands) = self.assembly.bands {
            seen.visibility.clear();
            seen.visibility.resize(bands.len(), 0.0);
            region.harmonics(bands, &mut seen.visibility);
            // Two ways to the same number: band 1 by the recurrence, and Lambert's sum.
            let lambert = (bands.bands() > 1)
                .then(|| crate::integrand::visible_moment(&seen.visibility).distance(region.vector_area()));
            // A harmonic of band l is at most sqrt((2l + 1) / 4 pi), and its gradient l times that.
            let steepest = (bands.bands() as f64).powf(1.5) * 0.4;
            seen.visibility_error = rounding + steepest * missed + lambert.unwrap_or(0.0);
        }
        if let Some(light) = self.region_light() {
            let (vectors, error) = light.vectors(region.boundary(), region.solid_angle());
            let scale: f64 = vectors.iter().map(|light| light.length()).sum();
            seen.light = vectors;
            seen.light_error = [DVec3::splat(error + (rounding + missed) * scale); 3];
        }
        let alarm = residuals.alarm();
        let is_finite = seen.visibility.iter().all(|v| v.is_finite()) && seen.light.iter().all(|v| v.is_finite());
        let mut is_smooth = true;
        if let (true, Some(bands)) = (self.gradients, self.assembly.bands) {
            gradients.take(bands, view, missed);
            is_smooth = gradients.error.is_finite() && gradients.by_axis.iter().flatten().all(|g| g.is_finite());
        }
        alarm || !is_finite || !is_smooth
    }

    /// Gradients where the exact method has none: from its results nearby.
    fn differentiate(&self, receiver: Receiver, memory: &mut Memory) {
        /// Of the scene's diagonal: rounding errors of the differences are below 1e-9 of a harmonic's largest slope.
        const STEP: f64 = 1e-5;
        let (Some(bands), Some([low, high])) = (self.assembly.bands, self.prepared.geometry().bounds()) else { return };
        let step = STEP * low.as_dvec3().distance(high.as_dvec3());
        let Memory { gradients, aside, .. } = memory;
        gradients.take_differences(bands, self.viewer, receiver, step, self.skips, aside);
    }

    /// Solves by rays, which raise no alarm.
    fn by_rays(&self, index: usize, receiver: Receiver, seen: &mut Seen) -> Result<bool> {
        let environment = self.assembly.textured;
        if self.bright.get().is_none() {
            // Whoever comes second finds the same built.
            let _ = self.bright.set(environment.map(PixelDistribution::of).transpose()?);
        }
        let bright = self.bright.get().and_then(Option::as_ref);
        let radiance = environment.map(|light| move |w: DVec3| light.radiance(w).as_dvec3().to_array());
        let request = reference::Request {
            visibility_sh: self.assembly.bands,
            vector_irradiance: radiance.is_some(),
            light: radiance.as_ref().map(|radiance| reference::Light { radiance, distribution: bright }),
            ..reference::Request::default()
        };
        let columns = request.columns();
        let (mut values, mut errors) = (vec![0.0; columns.len()], vec![0.0; columns.len()]);
        let qmc = Qmc { samples: LAST_RAYS, seed: 0 };
        qmc.integrate_one(self.prepared.rays(), index, &receiver, &request, &mut values, &mut errors)?;
        let worst = |range: std::ops::Range<usize>| 4.0 * errors[range].iter().fold(0.0f64, |worst, e| worst.max(*e));
        seen.visibility.clear();
        seen.visibility.extend_from_slice(&values[columns.visibility_sh.clone()]);
        seen.visibility_error = ROUNDING + worst(columns.visibility_sh.clone());
        if radiance.is_some() {
            let [light, error] = [&values, &errors].map(|all| &all[columns.vector_irradiance.clone()]);
            seen.light = [0, 3, 6].map(|at| DVec3::from_slice(&light[at..at + 3]));
            seen.light_error = [0, 3, 6].map(|at| 4.0 * DVec3::from_slice(&error[at..at + 3]));
        }
        Ok(false)
    }
}

/// Rounding of an exact result: a few units in the last place of a sum of order one.
const ROUNDING: f64 = 4e-15;

/// From the difference of two interleaved sets of isolines to a bound on the error of their sum: the error of one receiver in
/// a hundred is 1.5 times the difference of occlusion on random scenes (tests/certificates.rs).
const NESTED: f64 = 4.0;

/// From the expected error of textured light to a bound: on the same scenes the error of one number in a hundred is twice the
/// expected one, and 2.3 times that under a small sun along 8 isolines.
const EXPECTED: f64 = 3.0;

impl Lines {
    /// An octahedral isoline is a loop around the sphere, a meridian half of one: there are twice as many.
    fn new(isolines: Isolines, assembly: &Assembly) -> Self {
        let harmonics = assembly.bands.map(|bands| {
            let meridians = Meridians::new(2 * isolines.len()).expect("the isolines are as many as they may be");
            let harmonics = LineHarmonics::new(bands, &meridians);
            (meridians, harmonics)
        });
        let light = assembly.textured.map(|environment| {
            let light = LightTable::new(&isolines, environment);
            (isolines, light)
        });
        Self { harmonics, light }
    }
}

impl Counts {
    /// Takes over what became of the contours of a receiver that sees this.
    fn take(&mut self, contours: visibility::Counts, sight: Sight) {
        self.contours = contours.above as u64;
        self.below_horizon = contours.below as u64;
        self.between_isolines = contours.between as u64;
        self.hidden_bodies = contours.hidden as u64;
        self.bodies_below_horizon = contours.sunken as u64;
        self.open += u64::from(sight == Sight::Open);
        self.enclosed += u64::from(sight == Sight::Enclosed);
    }
}

impl Baker for Solver<'_> {
    type Memory = Memory;

    fn lend(&self) -> Memory {
        // What other requests have seen is not looked at.
        Memory { seen: Seen::default(), ..self.prepared.lend() }
    }

    fn give_back(&self, memory: Memory) {
        self.prepared.give_back(memory);
    }

    fn tile(&self, receivers: &Receivers, tile: &[u32], rows: &mut [f64], memory: &mut Memory) -> Result<Counts> {
        let mut counts = Counts::default();
        let together = if self.skips.shared_searches { tile.len() } else { 1 };
        for (tile, rows) in tile.chunks(together).zip(rows.chunks_mut(together * self.layout.width)) {
            let neighbours = tile.iter().map(|&index| receivers.get(index as usize));
            if self.skips.below_horizon {
                self.viewer.approach(neighbours.clone(), &mut memory.view);
            } else {
                let all_around = neighbours.clone().map(|receiver| Receiver { normal: None, ..receiver });
                self.viewer.approach(all_around, &mut memory.view);
            }
            counts.shared_searches += tile.len() as u64 - 1;
            for ((&index, receiver), row) in tile.iter().zip(neighbours).zip(rows.chunks_exact_mut(self.layout.width)) {
                counts += self.receiver(receivers.number(index as usize), receiver, row, memory)?;
            }
        }
        Ok(counts)
    }
}

/// Harmonics of a receiver that sees all of its hemisphere, or of a probe that sees the whole sphere.
fn open_sky(order: Order, normal: Option<DVec3>, out: &mut [f64]) {
    match normal {
        Some(normal) => out.copy_from_slice(&sphere::hemisphere(order, normal)),
        None => out[0] = (4.0 * std::f64::consts::PI).sqrt(),
    }
}
