//! The sweep by masks: no order is kept, and only what may be visible is located.
//!
//! Events are the vertices alone, in order of azimuth. At a vertex all active edges are asked which of them pass above it;
//! the sum of their jumps is W there. Two edges cross if one was above the other when the younger of them started, and is
//! not when the first of them ends. What an edge's W can fall to follows from the edges that it crosses, wherever that
//! is; where it cannot become zero nothing else is computed.
//!
//! All this is sound while every answer is certain: then the edges between the rounded vertices are in one real
//! arrangement. Answers within rounding make the edges they concern doubtful, and where a doubtful edge may be visible the
//! sweep gives up: [`sweep`](super::sweep), which keeps an order, needs no certainty.

use glam::DVec3;

use super::chart::Chart;
use super::edges::{Edge, Edges, NIL, SEAM, Vertex, on_seam};
use super::pieces::{Ending, Pieces};
use super::region::Region;
use super::slots::{Active, DOUBT, Slots, has, set, slots_of};

/// The sweep is not certain of its answer.
pub(super) struct Doubt;

/// Buffers of the sweep.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    slots: Slots,
    pieces: Pieces,
    /// Slot of each active edge.
    slot_of: Vec<u32>,
    /// Which edges pass above the vertex.
    above: Vec<u64>,
    /// Slots of the edges that end at a vertex, and the masks of those above each when it or they started.
    ends: Vec<usize>,
    above_at_start: Vec<u64>,
    row: Vec<u64>,
    /// Edges that start at a vertex, downwards, and whether their order is in doubt.
    starts: Vec<u32>,
    doubts: Vec<bool>,
    /// Latitudes at the seam.
    at_seam: Vec<(f64, u32)>,
}

/// Sweeps over the edges and writes the boundary of {W = 0}; `depth_at_pole` is W at the pole. Returns a direction away from
/// pole and edges, and W there as the sweep has it.
pub(super) fn sweep(
    edges: &Edges,
    buffers: &mut Buffers,
    chart: &Chart,
    depth_at_pole: i32,
    region: &mut Region,
) -> Result<(DVec3, i32), Doubt> {
    region.clear();
    if edges.bad > 0 {
        return Err(Doubt);
    }
    buffers.slots.reset();
    buffers.slot_of.resize(edges.edges.len(), NIL);
    let horizon = edges.edges.get(edges.horizon as usize);
    buffers.pieces.reset(horizon.copied());
    let mut sweep = Masks { edges, buffers, chart, horizon, depth_at_pole, region };
    let check = sweep.begin();
    for (rank, vertex) in edges.vertices.iter().enumerate() {
        sweep.vertex(vertex, Edges::starts(&edges.vertices, &edges.edges, rank))?;
    }
    sweep.finish()?;
    region.finish();
    /// Rounding of a few thousand arcs, less than any piece that could be missing.
    const CLOSED: f64 = 1e-11;
    if region.residuals.closure < CLOSED { Ok(check) } else { Err(Doubt) }
}

struct Masks<'a> {
    edges: &'a Edges,
    buffers: &'a mut Buffers,
    chart: &'a Chart,
    horizon: Option<&'a Edge>,
    depth_at_pole: i32,
    region: &'a mut Region,
}

impl Masks<'_> {
    /// Starts the edges that cross the seam; returns the middle of the widest gap between them, and W there.
    fn begin(&mut self) -> (DVec3, i32) {
        let ids = self.edges.at_seam.iter().copied().filter(|&id| id != self.edges.horizon);
        self.buffers.at_seam.clear();
        self.buffers.at_seam.extend(ids.map(|id| (on_seam(self.edges.edges[id as usize].normal).z, id)));
        downwards(&mut self.buffers.at_seam);

        let mut above = self.depth_at_pole;
        let mut widest = (0.0, DVec3::Z, above);
        let mut previous = DVec3::Z;
        let last = self.horizon.map_or(-DVec3::Z, |horizon| on_seam(horizon.normal));
        let mut at_horizon = above;
        self.buffers.above.clear();
        for k in 0..self.buffers.at_seam.len() {
            let (z, id) = self.buffers.at_seam[k];
            let edge = &self.edges.edges[id as usize];
            let start = on_seam(edge.normal);
            let height = self.horizon.map_or(1.0, |horizon| horizon.normal.dot(start));
            if height > 0.0 {
                widen(&mut widest, previous, start, above);
                at_horizon = above + edge.jump;
                previous = start;
            }
            let slot = self.insert(Active::new(id, above, start, height > 0.0));
            if height.abs() < DOUBT || k > 0 && self.buffers.at_seam[k - 1].0 - z < DOUBT {
                self.buffers.slots.doubt(slot);
                if k > 0 {
                    let upper = self.buffers.at_seam[k - 1].1;
                    self.buffers.slots.doubt(self.buffers.slot_of[upper as usize] as usize);
                }
            }
            // What comes next at the seam is below.
            self.buffers.above.resize(self.buffers.slots.words(), 0);
            set(&mut self.buffers.above, slot);
            above += edge.jump;
        }
        widen(&mut widest, previous, last, at_horizon);
        self.buffers.pieces.depth_at_seam = at_horizon;
        (self.chart.world(widest.1), widest.2)
    }

    fn insert(&mut self, active: Active) -> usize {
        let edge = &self.edges.edges[active.edge as usize];
        let slot = self.buffers.slots.insert(active, edge.normal, edge.jump, &self.buffers.above);
        self.buffers.slot_of[active.edge as usize] = slot as u32;
        slot
    }

    fn vertex(&mut self, vertex: &Vertex, starts: std::ops::Range<u32>) -> Result<(), Doubt> {
        let Buffers { slots, pieces, slot_of, above, ends, above_at_start, row, .. } = &mut *self.buffers;
        let is_above_horizon = vertex.height > 0.0;
        let mut balance = 0;
        ends.clear();
        above_at_start.clear();
        let mut id = vertex.ends;
        while id != NIL {
            let edge = &self.edges.edges[id as usize];
            balance -= edge.jump;
            let slot = slot_of[id as usize] as usize;
            ends.push(slot);
            slots.above_at_start(slot, row);
            above_at_start.extend_from_slice(row);
            id = edge.next_end;
        }
        for start in starts.clone() {
            balance += self.edges.edges[start as usize].jump;
        }
        if balance != 0 && is_above_horizon {
            return Err(Doubt);
        }
        for &slot in &*ends {
            slots.remove(slot);
        }
        let (jumps, is_near) = slots.sides(vertex.position, above);
        if is_near {
            slots.doubt_near(vertex.position);
            ends.iter().for_each(|&slot| slots.doubt(slot));
        }
        let depth = self.depth_at_pole + jumps;
        for (k, &slot) in ends.iter().enumerate() {
            let above_at_start = &above_at_start[k * above.len()..(k + 1) * above.len()];
            // Those that end here too, above it.
            let siblings = ends.iter().filter(|&&other| has(above_at_start, other));
            let depth = depth + siblings.map(|&other| slots.jump(other)).sum::<i32>();
            let ending = Ending {
                slot,
                above_at_start,
                above_at_end: above,
                end: vertex.position,
                ends_above_horizon: is_above_horizon,
                depth_above: depth,
            };
            pieces.end(self.edges, slots, &ending, self.chart, self.region)?;
        }
        self.start(vertex, starts, depth, is_near)
    }

    /// Starts edges at a vertex.
    fn start(&mut self, vertex: &Vertex, starts: std::ops::Range<u32>, depth: i32, is_near: bool) -> Result<(), Doubt> {
        self.buffers.starts.clear();
        self.buffers.starts.extend(starts);
        self.sort_starts(is_near);
        let mut above = depth;
        for i in 0..self.buffers.starts.len() {
            let id = self.buffers.starts[i];
            let starts_above_horizon = vertex.height > 0.0;
            let slot = self.insert(Active::new(id, above, vertex.position, starts_above_horizon));
            if self.buffers.doubts[i] {
                self.buffers.slots.doubt(slot);
            }
            above += self.edges.edges[id as usize].jump;
            if i + 1 < self.buffers.starts.len() {
                self.buffers.above.resize(self.buffers.slots.words(), 0);
                set(&mut self.buffers.above, slot);
            }
        }
        if self.buffers.slots.words() * 64 > Slots::MOST { Err(Doubt) } else { Ok(()) }
    }

    /// Puts the edges that start at a vertex in order, downwards, by insertion.
    fn sort_starts(&mut self, is_near: bool) {
        let Buffers { starts, doubts, .. } = &mut *self.buffers;
        doubts.clear();
        doubts.resize(starts.len(), is_near);
        for i in 1..starts.len() {
            for j in (1..=i).rev() {
                // Positive if they are in order.
                let order = self.edges.order(starts[j - 1], starts[j]);
                if order.abs() < DOUBT {
                    doubts[j - 1] = true;
                    doubts[j] = true;
                }
                if order >= 0.0 {
                    break;
                }
                starts.swap(j - 1, j);
                doubts.swap(j - 1, j);
            }
        }
    }

    /// Ends all edges at the seam, and the horizon.
    fn finish(&mut self) -> Result<(), Doubt> {
        let Buffers { slots, pieces, slot_of, above, row, at_seam, .. } = &mut *self.buffers;
        at_seam.clear();
        for slot in slots_of(slots.taken()) {
            let id = slots.get(slot).edge;
            at_seam.push((on_seam(self.edges.edges[id as usize].normal).z, id));
        }
        downwards(at_seam);
        for pair in at_seam.windows(2) {
            if pair[0].0 - pair[1].0 < DOUBT {
                pair.iter().for_each(|&(_, id)| slots.doubt(slot_of[id as usize] as usize));
            }
        }
        above.clear();
        above.resize(slots.words(), 0);
        let mut depth = self.depth_at_pole;
        for &(_, id) in &*at_seam {
            let slot = slot_of[id as usize] as usize;
            let edge = &self.edges.edges[id as usize];
            debug_assert_eq!(edge.end, SEAM);
            let end = on_seam(edge.normal);
            let height = self.horizon.map_or(1.0, |horizon| horizon.normal.dot(end));
            if height.abs() < DOUBT {
                slots.doubt(slot);
            }
            slots.above_at_start(slot, row);
            slots.remove(slot);
            let ending = Ending {
                slot,
                above_at_start: row,
                above_at_end: above,
                end,
                ends_above_horizon: height > 0.0,
                depth_above: depth,
            };
            pieces.end(self.edges, slots, &ending, self.chart, self.region)?;
            set(above, slot);
            depth += edge.jump;
        }
        match self.horizon {
            Some(_) => pieces.finish_horizon(self.chart, self.region),
            None => match depth {
                // The boundary's excess about the pole counts what lies above it; the other pole adds the whole sphere.
                0 => {
                    self.region.solid_angle += 4.0 * std::f64::consts::PI;
                    Ok(())
                }
                depth if depth < 0 => Err(Doubt),
                _ => Ok(()),
            },
        }
    }
}

/// Sorts edges at the seam by latitude.
fn downwards(at_seam: &mut [(f64, u32)]) {
    at_seam.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
}

/// Keeps the wider of two gaps, each as its width, its middle and W there.
fn widen(widest: &mut (f64, DVec3, i32), from: DVec3, to: DVec3, depth: i32) {
    let width = from.z - to.z;
    if width > widest.0 {
        // The sum vanishes between the poles alone.
        *widest = (width, (from + to).try_normalize().unwrap_or(DVec3::X), depth);
    }
}
