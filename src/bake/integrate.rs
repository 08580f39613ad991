use std::time::Instant;

use dual_bvh::{BuildOptions, DualBvh};
use glam::DVec3;
use rayon::prelude::*;

use super::layout::Layout;
use super::tiles::{TILE_RADIUS, tiles};
use super::{Control, Method, Receivers, Request};
use crate::integrand::{self, LightMoments, LightPatch, LightTable, LineHarmonics, LineMoments};
use crate::scene::{FaceTree, Geometry};
use crate::sphere::{self, Order};
use crate::visibility::{Frame, Isolines, Sight, View, Viewer};
use crate::{Error, Result};

/// What was computed, receiver by receiver.
#[derive(Clone, Debug)]
pub struct Solution {
    layout: Layout,
    values: Vec<f64>,
    /// Which receivers are finished: all, unless the work was cancelled.
    pub done: Vec<bool>,
    /// What it took.
    pub statistics: Statistics,
}

/// What a bake took and what it skipped.
#[derive(Clone, Debug, Default)]
pub struct Statistics {
    /// Receivers finished.
    pub receivers: usize,
    /// Triangles of the scene.
    pub triangles: usize,
    /// Threads at work.
    pub threads: usize,
    /// Time to build trees and tables, seconds.
    pub build_seconds: f64,
    /// Time from the first receiver to the last, seconds.
    pub integrate_seconds: f64,
    /// Counts over all receivers.
    pub counts: Counts,
}

/// Counts that add up over receivers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Contour arcs above the horizon.
    pub contours: u64,
    /// Crossings of contours with isolines.
    pub crossings: u64,
    /// Receivers on which the depth complexity's bookkeeping failed somewhere.
    pub depth_alarms: u64,
    /// Receivers that see everything above their horizon: solved in closed form.
    pub open: u64,
    /// Receivers that see nothing.
    pub enclosed: u64,
    /// Contour searches made; the other receivers shared a neighbour's.
    pub searches: u64,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.contours += other.contours;
        self.crossings += other.crossings;
        self.depth_alarms += other.depth_alarms;
        self.open += other.open;
        self.enclosed += other.enclosed;
        self.searches += other.searches;
    }
}

impl Solution {
    /// The arrays' names, the shape of one receiver's part, and all values, row by row.
    pub fn arrays(&self) -> impl Iterator<Item = (&'static str, &[usize], Vec<f64>)> {
        self.layout.arrays.iter().map(|(name, offset, shape)| {
            let size: usize = shape.iter().product();
            let rows = self.values.chunks(self.layout.width);
            (*name, &shape[..], rows.flat_map(|row| row[*offset..*offset + size].iter().copied()).collect())
        })
    }
}

/// Computes what `request` asks for at every receiver, on the threads of the current rayon pool.
///
/// The result does not depend on the number of threads, bit for bit. When `control` asks to stop, what is under way is
/// finished and [`Solution::done`] tells which receivers are valid; the others hold zeros.
pub fn integrate(
    geometry: &Geometry,
    environment: Option<&[LightPatch]>,
    receivers: &Receivers,
    request: &Request,
    method: Method,
    control: &dyn Control,
) -> Result<Solution> {
    let layout = Layout::new(request, receivers.normals.is_empty())?;
    let light = match (request.irradiance || request.vector_irradiance, environment) {
        (false, _) => None,
        (true, None) => return Err(Error::input("irradiance was asked for, but the scene has no environment")),
        (true, light) => light,
    };
    match method {
        Method::Isolines { lines } => {
            let started = Instant::now();
            let isolines = Isolines::new(lines as usize)?;
            let edges = DualBvh::build(geometry.positions.clone(), geometry.triangles.clone(), &BuildOptions::default())?;
            let faces = FaceTree::new(geometry.positions.clone(), geometry.triangles.clone());
            let harmonics = visibility_order(request)?.map(|order| LineHarmonics::new(order, &isolines));
            let light = light.map(|environment| LightTable::new(&isolines, environment.iter().copied()));
            let viewer = Viewer { edges: &edges, faces: &faces, isolines: &isolines };
            let baker = AlongIsolines { viewer, harmonics, light, order: Order::new(request.order)?, layout };
            run(&baker, &baker.layout, geometry, receivers, started, control)
        }
        Method::Qmc { .. } => todo!(),
    }
}

/// Bands of visibility from which everything asked for follows; none, if only light is.
///
/// The cosine is a harmonic of band 1, so that occlusion and the bent normal need two bands, and the transfer vector
/// one more than it has itself.
fn visibility_order(request: &Request) -> Result<Option<Order>> {
    let order = Order::new(request.order)?;
    let wanted = [
        (request.ambient_occlusion || request.bent_normal).then_some(Order::new(2)?),
        request.visibility_sh.then_some(order),
        request.transfer_sh.then_some(order.raised()),
    ];
    Ok(wanted.into_iter().flatten().max())
}

/// A method at work on one tile of receivers after another.
trait Baker: Sync {
    type Memory: Default;

    /// Fills the rows of the tile's receivers.
    fn tile(&self, receivers: &Receivers, tile: &[u32], rows: &mut [f64], memory: &mut Self::Memory) -> Counts;
}

fn run<B: Baker>(
    baker: &B,
    layout: &Layout,
    geometry: &Geometry,
    receivers: &Receivers,
    started: Instant,
    control: &dyn Control,
) -> Result<Solution> {
    let diagonal = geometry.bounds().map_or(0.0, |[low, high]| low.as_dvec3().distance(high.as_dvec3()));
    let tiles = tiles(&receivers.positions, TILE_RADIUS * diagonal);
    let build_seconds = started.elapsed().as_secs_f64();
    let started = Instant::now();
    let finished: Vec<Option<(Vec<f64>, Counts)>> = tiles
        .par_iter()
        .map_init(B::Memory::default, |memory, tile| {
            if control.cancelled() {
                return None;
            }
            let mut rows = vec![0.0; tile.len() * layout.width];
            let counts = baker.tile(receivers, tile, &mut rows, memory);
            control.advance(tile.len() as u64);
            Some((rows, counts))
        })
        .collect();
    let mut solution = Solution {
        values: vec![0.0; receivers.len() * layout.width],
        done: vec![false; receivers.len()],
        statistics: Statistics {
            triangles: geometry.triangles.len(),
            threads: rayon::current_num_threads(),
            build_seconds,
            integrate_seconds: started.elapsed().as_secs_f64(),
            ..Statistics::default()
        },
        layout: layout.clone(),
    };
    let width = solution.layout.width;
    for (tile, (rows, counts)) in tiles.iter().zip(finished).filter_map(|(tile, done)| Some((tile, done?))) {
        solution.statistics.receivers += tile.len();
        solution.statistics.counts += counts;
        for (&receiver, row) in tile.iter().zip(rows.chunks(width.max(1))) {
            solution.values[receiver as usize * width..][..width].copy_from_slice(row);
            solution.done[receiver as usize] = true;
        }
    }
    Ok(solution)
}

struct AlongIsolines<'a> {
    viewer: Viewer<'a>,
    harmonics: Option<LineHarmonics>,
    light: Option<LightTable>,
    order: Order,
    layout: Layout,
}

#[derive(Default)]
struct IsolineMemory {
    view: View,
    moments: Option<LineMoments>,
    visibility: Vec<f64>,
}

impl Baker for AlongIsolines<'_> {
    type Memory = IsolineMemory;

    fn tile(&self, receivers: &Receivers, tile: &[u32], rows: &mut [f64], memory: &mut IsolineMemory) -> Counts {
        let receiver = |index: &u32| receivers.get(*index as usize);
        self.viewer.approach(tile.iter().map(receiver), &mut memory.view);
        let mut counts = Counts { searches: 1, ..Counts::default() };
        for (index, row) in tile.iter().zip(rows.chunks_mut(self.layout.width.max(1))) {
            self.receiver(receivers, *index as usize, row, memory, &mut counts);
        }
        counts
    }
}

impl AlongIsolines<'_> {
    /// Everything asked for at one receiver.
    fn receiver(
        &self,
        receivers: &Receivers,
        index: usize,
        row: &mut [f64],
        memory: &mut IsolineMemory,
        counts: &mut Counts,
    ) {
        let receiver = receivers.get(index);
        let mut light = LightMoments::default();
        if let (None, Some(table)) = (&memory.moments, &self.harmonics) {
            memory.moments = Some(LineMoments::new(table));
        }
        let IsolineMemory { view, moments, visibility } = memory;
        let axis = Frame::facing(receiver.normal).axis();
        let sight = self.viewer.see(receiver, view, |interval| {
            if let (Some(table), Some(moments)) = (&self.harmonics, moments.as_mut()) {
                moments.add(table, interval);
            }
            if let Some(table) = &self.light {
                light.add(table, axis, interval);
            }
        });
        counts.contours += view.contours().arcs.len() as u64;
        match sight {
            Sight::Open => counts.open += 1,
            Sight::Enclosed => counts.enclosed += 1,
            Sight::Part(sweep) => {
                counts.crossings += view.crossings() as u64;
                counts.depth_alarms += u64::from(sweep.depth_alarms > 0);
            }
        }
        if let (Some(table), Some(moments)) = (&self.harmonics, moments.as_mut()) {
            visibility.clear();
            visibility.resize(table.order().len(), 0.0);
            match sight {
                Sight::Open => open_sky(table.order(), receiver.normal, visibility),
                Sight::Enclosed => {}
                Sight::Part(_) => moments.finish(table, axis, visibility),
            }
            from_harmonics(self.order, &self.layout, visibility, receiver.normal, row);
        }
        if let Some(table) = &self.light {
            if sight == Sight::Open {
                self.viewer.see_all(receiver.normal, |interval| light.add(table, axis, interval));
            }
            from_light(&self.layout, light.vectors(), receiver.normal, row);
        }
    }
}

/// Harmonics of a receiver that sees all of its hemisphere, or of a probe that sees the whole sphere.
fn open_sky(order: Order, normal: Option<DVec3>, out: &mut [f64]) {
    match normal {
        Some(normal) => out.copy_from_slice(&sphere::hemisphere(order, normal)),
        None => out[0] = (4.0 * std::f64::consts::PI).sqrt(),
    }
}

/// Fills in what follows from the harmonics of the visibility, clamped to the hemisphere.
fn from_harmonics(order: Order, layout: &Layout, visibility: &[f64], normal: Option<DVec3>, row: &mut [f64]) {
    if let Some(out) = layout.slice("visibility_sh", row) {
        out.copy_from_slice(&visibility[..out.len()]);
    }
    if let Some(out) = layout.slice("bent_normal", row) {
        out.copy_from_slice(&integrand::bent_normal(visibility).to_array());
    }
    let Some(normal) = normal else { return };
    if let Some(out) = layout.slice("ambient_occlusion", row) {
        out[0] = integrand::ambient_occlusion(visibility, normal);
    }
    if let Some(out) = layout.slice("transfer_sh", row) {
        integrand::transfer(order, visibility, normal, out);
    }
}

/// Fills in what follows from the vector irradiance of each colour.
fn from_light(layout: &Layout, vectors: [DVec3; 3], normal: Option<DVec3>, row: &mut [f64]) {
    if let Some(out) = layout.slice("vector_irradiance", row) {
        for (out, vector) in out.chunks_mut(3).zip(vectors) {
            out.copy_from_slice(&vector.to_array());
        }
    }
    if let (Some(out), Some(normal)) = (layout.slice("irradiance", row), normal) {
        for (out, vector) in out.iter_mut().zip(vectors) {
            *out = vector.dot(normal);
        }
    }
}
