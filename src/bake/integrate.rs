use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use cpu_time::ProcessTime;
use rayon::prelude::*;

use super::layout::Layout;
use super::tiles::tiles;
use super::{Array, Arrays, Control, Method, Outcome, Partial, Prepared, Receivers, Request, Statistics};
use crate::scene::{Environment, Geometry};
use crate::{Error, Result};

/// Computes what `request` asks for at every receiver by `method`, on the threads of the current rayon pool.
///
/// The result does not depend on the number of threads, bit for bit, nor on which receivers `resume` holds finished from an
/// earlier run. When `control` asks to stop, what is under way is finished, and [`Outcome::done`] tells which receivers are
/// valid; the rows of the others are zero.
///
/// # Errors
/// A request that the receivers or the scene cannot meet; a method's parameter out of its domain; a `resume` of other
/// receivers or arrays; a value that is not finite (which is a bug: none is ever written).
pub fn integrate(
    geometry: &Geometry,
    environment: Option<&Environment>,
    receivers: &Receivers,
    request: &Request,
    method: Method,
    resume: Option<Partial>,
    control: &dyn Control,
) -> Result<Outcome> {
    Prepared::new(geometry, environment).integrate(receivers, request, method, resume, control)
}

/// A method at work on one tile of neighbouring receivers after another.
pub(super) trait Baker: Sync {
    /// Working memory of one thread.
    type Memory: Default;

    /// Memory that has grown in earlier work, or new.
    fn lend(&self) -> Self::Memory {
        Self::Memory::default()
    }

    /// Takes memory back.
    fn give_back(&self, _: Self::Memory) {}

    /// Fills the rows of the tile's receivers.
    fn tile(&self, receivers: &Receivers, tile: &[u32], rows: &mut [f64], memory: &mut Self::Memory) -> Result<Counts>;
}

/// Counts that add up over receivers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    /// Contour arcs above the horizon.
    pub(super) contours: u64,
    /// Receivers that raised an alarm: the depth complexity's bookkeeping, or another identity, failed somewhere.
    pub(super) depth_alarms: u64,
    /// Receivers solved again in a rotated frame, by the other method, by rays.
    pub(super) fallbacks: [u64; 3],
    /// Receivers that see everything above their horizon: solved in closed form.
    pub(super) open: u64,
    /// Receivers that see nothing.
    pub(super) enclosed: u64,
    /// Receivers for which a neighbour's contour search served.
    pub(super) shared_searches: u64,
    /// Contours below the horizon that the search did not leave out.
    pub(super) below_horizon: u64,
    /// Contours between two isolines.
    pub(super) between_isolines: u64,
    /// Groups of bodies that were not looked at because they are hidden.
    pub(super) hidden_bodies: u64,
    /// Groups of bodies that were not looked at because they lie below the horizon.
    pub(super) bodies_below_horizon: u64,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.contours += other.contours;
        self.depth_alarms += other.depth_alarms;
        self.fallbacks.iter_mut().zip(other.fallbacks).for_each(|(sum, other)| *sum += other);
        self.open += other.open;
        self.enclosed += other.enclosed;
        self.shared_searches += other.shared_searches;
        self.below_horizon += other.below_horizon;
        self.between_isolines += other.between_isolines;
        self.hidden_bodies += other.hidden_bodies;
        self.bodies_below_horizon += other.bodies_below_horizon;
    }
}

/// What is tried after an alarm, in this order.
const FALLBACKS: [&str; 3] = ["rotated_frame", "other_method", "rays"];

#[expect(clippy::too_many_arguments, reason = "the parts of one integration, split off for the generic method")]
pub(super) fn run<B: Baker>(
    baker: &B,
    layout: &Layout,
    geometry: &Geometry,
    receivers: &Receivers,
    method: Method,
    request: &Request,
    resume: Option<Partial>,
    started: Instant,
    control: &dyn Control,
) -> Result<Outcome> {
    if let Some(partial) = &resume {
        partial.check(receivers.len())?;
    }
    let tiles = match &resume {
        None => tiles(geometry, &receivers.positions, &receivers.normals),
        Some(partial) => {
            let todo: Vec<u32> = (0..receivers.len() as u32).filter(|&i| !partial.done[i as usize]).collect();
            let left = receivers.pick(todo.iter().map(|&i| i as usize));
            let mut tiles = tiles(geometry, &left.positions, &left.normals);
            tiles.iter_mut().flatten().for_each(|index| *index = todo[*index as usize]);
            tiles
        }
    };
    let todo: usize = tiles.iter().map(Vec::len).sum();
    let finished_before = (receivers.len() - todo) as u64;
    // After the tiles, which need memory of their own for a while.
    let results = Results::new(layout, receivers.len(), resume)?;
    let build_seconds = started.elapsed().as_secs_f64();

    control.begin("integrating", todo as u64);
    let (started, processor) = (Instant::now(), ProcessTime::try_now());
    // One at a time: what is written is little beside what is computed, and each value is in memory once.
    let results = Mutex::new(results);
    tiles.par_iter().try_for_each_init(
        || (Lent::new(baker), Vec::new()),
        |(lent, rows), tile| {
            if control.cancelled() {
                return Ok(());
            }
            rows.clear();
            rows.resize(tile.len() * layout.width, 0.0);
            let counts = baker.tile(receivers, tile, rows, &mut lent.memory)?;
            results.lock().unwrap_or_else(PoisonError::into_inner).set(layout, tile, rows, counts);
            control.advance(tile.len() as u64);
            Ok::<_, Error>(())
        },
    )?;
    let Results { columns, done, counts, solved } = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    let integrate_seconds = started.elapsed().as_secs_f64();
    // Where there is no such clock, all threads are taken to have worked all the time.
    let processor_seconds = match processor.and_then(|clock| clock.try_elapsed()) {
        Ok(time) => time.as_secs_f64(),
        Err(_) => integrate_seconds * rayon::current_num_threads() as f64,
    };
    let skipped = [
        ("finished_before", finished_before),
        ("open_receivers", counts.open),
        ("enclosed_receivers", counts.enclosed),
        ("shared_searches", counts.shared_searches),
        ("contours_below_horizon", counts.below_horizon),
        ("contours_between_isolines", counts.between_isolines),
        ("hidden_bodies", counts.hidden_bodies),
        ("bodies_below_horizon", counts.bodies_below_horizon),
    ];
    let statistics = Statistics {
        receivers: solved,
        method: method.to_string(),
        order: request.order,
        triangles: geometry.triangles.len() as u64,
        threads: rayon::current_num_threads(),
        build_seconds,
        integrate_seconds,
        processor_seconds,
        contours_per_receiver: counts.contours as f64 / solved.max(1) as f64,
        depth_alarms: counts.depth_alarms,
        fallbacks: FALLBACKS.iter().zip(counts.fallbacks).map(|(name, count)| ((*name).to_owned(), count)).collect(),
        plan: None,
        estimated_error: None,
        skipped: skipped.into_iter().map(|(name, count)| (name.to_owned(), count)).collect(),
    };
    let mut arrays = Arrays::new();
    for ((name, _, shape), data) in layout.arrays.iter().zip(columns) {
        let shape: Vec<usize> = [receivers.len()].into_iter().chain(shape.iter().copied()).collect();
        arrays.push(Array::new(name.as_str(), shape, data))?;
    }
    Ok(Outcome { arrays, done, statistics })
}

/// A baker's memory, for as long as a part of the work takes.
struct Lent<'a, B: Baker> {
    baker: &'a B,
    memory: B::Memory,
}

impl<'a, B: Baker> Lent<'a, B> {
    fn new(baker: &'a B) -> Self {
        Self { baker, memory: baker.lend() }
    }
}

impl<B: Baker> Drop for Lent<'_, B> {
    fn drop(&mut self) {
        // What a panic has left half done is nobody's.
        if !std::thread::panicking() {
            self.baker.give_back(std::mem::take(&mut self.memory));
        }
    }
}

/// What has been found so far.
struct Results {
    /// The values of each array, a row for each receiver.
    columns: Vec<Vec<f64>>,
    done: Vec<bool>,
    counts: Counts,
    solved: u64,
}

impl Results {
    /// Nothing done, or what `resume` has.
    fn new(layout: &Layout, receivers: usize, resume: Option<Partial>) -> Result<Self> {
        let (counts, solved) = (Counts::default(), 0);
        let Some(mut partial) = resume else {
            let columns = layout.arrays.iter().map(|(_, _, shape)| vec![0.0; receivers * size(shape)]).collect();
            return Ok(Self { columns, done: vec![false; receivers], counts, solved });
        };
        let columns = layout.arrays.iter().map(|(name, _, shape)| match partial.arrays.remove(name) {
            Some(array) if array.shape[1..] == shape[..] => Ok(array.data),
            _ => Err(Error::input(format!("the finished part has no array {name} as asked for; begin anew"))),
        });
        Ok(Self { columns: columns.collect::<Result<_>>()?, done: partial.done, counts, solved })
    }

    /// Takes in the rows of a tile.
    fn set(&mut self, layout: &Layout, tile: &[u32], rows: &[f64], counts: Counts) {
        for (&receiver, row) in tile.iter().zip(rows.chunks_exact(layout.width)) {
            for ((_, offset, shape), column) in layout.arrays.iter().zip(&mut self.columns) {
                let size = size(shape);
                column[receiver as usize * size..][..size].copy_from_slice(&row[*offset..][..size]);
            }
            self.done[receiver as usize] = true;
        }
        self.counts += counts;
        self.solved += tile.len() as u64;
    }
}

/// Numbers of one receiver.
fn size(shape: &[usize]) -> usize {
    shape.iter().product()
}
