//! The sweep by masks: no order is kept, and only what may be visible is located.
//!
//! Events are the vertices alone, in order of azimuth. At a vertex all active edges are asked which of them pass above it;
//! the sum of their jumps is W there. For each two edges it is kept which was above at the last vertex of either; where that is
//! another one at the next, they have crossed. How far W falls along an edge follows from W at its ends and the number of
//! edges that cross it, wherever that is; where it cannot become zero nothing else is computed. Most edges start where one of
//! the same jump has ended, and take over its place in all masks.
//!
//! All this is sound while every answer is certain: then the edges between the rounded vertices are in one real
//! arrangement. Answers within rounding make the edges they concern doubtful, and where a doubtful edge may be visible the
//! sweep gives up: [`sweep`](super::sweep), which keeps an order, needs no certainty.

use std::ops::Range;

use glam::DVec3;

use super::bands::Bands;
use super::block::{DOUBT, MOST_JUMP};
use super::chains::Chain;
use super::chart::Chart;
use super::edges::{Edge, Edges, NIL, Vertex, on_seam};
use super::pieces::{Ending, Pieces};
use super::region::Region;

/// The sweep is not certain of its answer.
pub(super) struct Doubt;

/// Buffers of the sweep.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    bands: Bands,
    pieces: Pieces,
    /// The chain of an edge.
    chains: Vec<u32>,
    /// Edges that end at a vertex.
    ends: Vec<u32>,
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
    if edges.bad > 0 || edges.steepest > MOST_JUMP {
        return Err(Doubt);
    }
    buffers.bands.reset(edges.latitudes.count());
    buffers.chains.resize(edges.edges.len(), NIL);
    let horizon = edges.edges.get(edges.horizon as usize);
    buffers.pieces.reset(horizon.copied());
    let mut sweep = Masks { edges, buffers, chart, horizon, depth_at_pole, region };
    let check = sweep.begin();
    sweep.vertices()?;
    sweep.finish()?;
    region.finish(chart);
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
        let Buffers { bands, pieces, at_seam, chains, .. } = &mut *self.buffers;
        let ids = self.edges.at_seam.iter().copied().filter(|&id| id != self.edges.horizon);
        at_seam.clear();
        at_seam.extend(ids.map(|id| (on_seam(self.edges.edges[id as usize].normal).z, id)));
        downwards(at_seam);

        let mut above = self.depth_at_pole;
        let mut widest = (0.0, DVec3::Z, above);
        let mut previous = DVec3::Z;
        let last = self.horizon.map_or(-DVec3::Z, |horizon| on_seam(horizon.normal));
        let mut at_horizon = above;
        for k in 0..at_seam.len() {
            let (z, id) = at_seam[k];
            let edge = &self.edges.edges[id as usize];
            let start = on_seam(edge.normal);
            let height = self.horizon.map_or(1.0, |horizon| horizon.normal.dot(start));
            if height > 0.0 {
                widen(&mut widest, previous, start, above);
                at_horizon = above + edge.jump;
                previous = start;
            }
            let mut chain = Chain::new(id, edge, above, height > 0.0, height.abs() < DOUBT);
            if k > 0 && at_seam[k - 1].0 - z < DOUBT {
                chain.is_doubtful = true;
                bands.chains[chains[at_seam[k - 1].1 as usize] as usize].is_doubtful = true;
            }
            let chain = bands.insert(chain);
            chains[id as usize] = chain;
            // What comes next at the seam is below.
            bands.set_above(chain);
            above += edge.jump;
        }
        widen(&mut widest, previous, last, at_horizon);
        pieces.depth_at_seam = at_horizon;
        (self.chart.world(widest.1), widest.2)
    }

    /// Passes all vertices.
    fn vertices(&mut self) -> Result<(), Doubt> {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("popcnt") {
            // SAFETY: the processor has these features.
            return unsafe { self.vertices_avx2() };
        }
        self.vertices_inline()
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,popcnt")]
    fn vertices_avx2(&mut self) -> Result<(), Doubt> {
        self.vertices_inline()
    }

    #[inline(always)]
    fn vertices_inline(&mut self) -> Result<(), Doubt> {
        let edges = self.edges;
        for (rank, vertex) in edges.vertices.iter().enumerate() {
            let (ended, starts) = (edges.ends[rank], edges.starts(rank));
            if ended != NIL && starts.len() == 1 {
                let [end, start] = [ended, starts.start].map(|id| &edges.edges[id as usize]);
                if end.next_end == NIL && end.jump == start.jump {
                    self.proceed(vertex, ended, starts.start)?;
                    continue;
                }
            }
            self.branch(vertex, ended, starts)?;
        }
        Ok(())
    }

    /// One edge ends at a vertex, and another takes its place.
    #[inline(always)]
    fn proceed(&mut self, vertex: &Vertex, ended: u32, started: u32) -> Result<(), Doubt> {
        let Buffers { bands, pieces, chains, .. } = &mut *self.buffers;
        let is_above_horizon = vertex.height > 0.0;
        let id = chains[ended as usize];
        let started_edge = &self.edges.edges[started as usize];
        let chain = &bands.chains[id as usize];
        let first = chain.first_band.min(started_edge.first_band).into();
        let last = usize::from(chain.last_band.max(started_edge.last_band));
        bands.hide(id);
        let is_near = bands.look(self.edges, vertex.position, first..last + 1);
        bands.chains[id as usize].is_doubtful |= is_near;
        let depth = self.depth_at_pole + bands.jumps_above(self.edges.latitudes.band(vertex.position.z));
        let ending = Ending {
            id,
            crossed: bands.cross(id),
            chain: &bands.chains[id as usize],
            end: vertex.position,
            ends_above_horizon: is_above_horizon,
            depth_above: depth,
        };
        pieces.end(self.edges, bands, &ending, self.region)?;
        bands.proceed(id, Chain::new(started, started_edge, depth, is_above_horizon, is_near));
        chains[started as usize] = id;
        Ok(())
    }

    /// Any number of edges end and start at a vertex.
    #[inline(always)]
    fn branch(&mut self, vertex: &Vertex, mut ended: u32, starts: Range<u32>) -> Result<(), Doubt> {
        if ended == NIL && starts.is_empty() {
            return Ok(());
        }
        let ends = &mut self.buffers.ends;
        ends.clear();
        while ended != NIL {
            ends.push(ended);
            ended = self.edges.edges[ended as usize].next_end;
        }
        // Where a contour turns there are two of them. Numbers known beforehand keep the processor from guessing.
        match (ends.len(), starts.len()) {
            (2, 0) => self.exchange(vertex, 2, starts.start..starts.start),
            (0, 2) => self.exchange(vertex, 0, starts.start..starts.start + 2),
            (count, _) => self.exchange(vertex, count, starts),
        }
    }

    /// Ends the first edges listed at a vertex and starts others.
    #[inline(always)]
    fn exchange(&mut self, vertex: &Vertex, ends: usize, starts: Range<u32>) -> Result<(), Doubt> {
        let Buffers { bands, pieces, ends: list, chains, .. } = &mut *self.buffers;
        let Some(ends) = list.get_mut(..ends) else { return Ok(()) };
        let is_above_horizon = vertex.height > 0.0;
        let band = self.edges.latitudes.band(vertex.position.z);
        // The bands that the vertex's edges come into.
        let (mut first, mut last) = (band, band);
        let mut balance = 0;
        for end in &mut *ends {
            *end = chains[*end as usize];
            let chain = &bands.chains[*end as usize];
            balance -= chain.jump;
            first = first.min(chain.first_band);
            last = last.max(chain.last_band);
        }
        for start in starts.clone() {
            let edge = &self.edges.edges[start as usize];
            balance += edge.jump;
            first = first.min(edge.first_band);
            last = last.max(edge.last_band);
        }
        if balance != 0 && is_above_horizon {
            return Err(Doubt);
        }
        for &id in &*ends {
            bands.remove(id);
        }
        let is_near = bands.look(self.edges, vertex.position, first.into()..usize::from(last) + 1);
        let depth = self.depth_at_pole + bands.jumps_above(band);
        for &id in &*ends {
            bands.chains[id as usize].is_doubtful |= is_near;
            let mut depth_above = depth;
            for &other in ends.iter().filter(|&&other| other != id) {
                // It ends here too, above.
                depth_above += bands.chains[other as usize].jump * i32::from(bands.was_above(id, other, band));
            }
            let ending = Ending {
                id,
                crossed: bands.cross(id),
                chain: &bands.chains[id as usize],
                end: vertex.position,
                ends_above_horizon: is_above_horizon,
                depth_above,
            };
            pieces.end(self.edges, bands, &ending, self.region)?;
        }
        ends.iter().for_each(|&id| bands.free(id));
        self.start(vertex, starts, depth, is_near);
        if self.buffers.bands.is_crowded { Err(Doubt) } else { Ok(()) }
    }

    /// Starts edges at a vertex.
    #[inline(always)]
    fn start(&mut self, vertex: &Vertex, starts: Range<u32>, depth: i32, is_near: bool) {
        let count = starts.len();
        self.buffers.starts.clear();
        self.buffers.starts.extend(starts);
        self.sort_starts(vertex.position, is_near);
        let Buffers { bands, starts, doubts, chains, .. } = &mut *self.buffers;
        let mut above = depth;
        for (i, (&id, &is_doubtful)) in starts.iter().zip(&*doubts).enumerate().take(count) {
            let edge = &self.edges.edges[id as usize];
            let chain = bands.insert(Chain::new(id, edge, above, vertex.height > 0.0, is_doubtful));
            chains[id as usize] = chain;
            above += edge.jump;
            if i + 1 < count {
                bands.set_above(chain);
            }
        }
    }

    /// Puts the edges that start at a vertex in order, downwards, by insertion.
    fn sort_starts(&mut self, vertex: DVec3, is_near: bool) {
        let Buffers { starts, doubts, .. } = &mut *self.buffers;
        doubts.clear();
        doubts.resize(starts.len(), is_near);
        for i in 1..starts.len() {
            for j in (1..=i).rev() {
                // Positive if they are in order.
                let order = self.edges.order(starts[j - 1], starts[j], vertex);
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
        let Buffers { bands, pieces, at_seam, chains, .. } = &mut *self.buffers;
        at_seam.clear();
        let left = bands.left().map(|id| bands.chains[id as usize]);
        at_seam.extend(left.map(|chain| (on_seam(self.edges.edges[chain.edge as usize].normal).z, chain.edge)));
        downwards(at_seam);
        for pair in at_seam.windows(2) {
            if pair[0].0 - pair[1].0 < DOUBT {
                pair.iter().for_each(|&(_, id)| bands.chains[chains[id as usize] as usize].is_doubtful = true);
            }
        }
        // Of those that are left when one is removed all are below it.
        bands.clear_above();
        let mut depth = self.depth_at_pole;
        for &(_, edge) in &*at_seam {
            let id = chains[edge as usize];
            let end = on_seam(self.edges.edges[edge as usize].normal);
            let height = self.horizon.map_or(1.0, |horizon| horizon.normal.dot(end));
            bands.chains[id as usize].is_doubtful |= height.abs() < DOUBT;
            bands.remove(id);
            let ending = Ending {
                id,
                crossed: bands.cross(id),
                chain: &bands.chains[id as usize],
                end,
                ends_above_horizon: height > 0.0,
                depth_above: depth,
            };
            pieces.end(self.edges, bands, &ending, self.region)?;
            depth += ending.chain.jump;
        }
        match self.horizon {
            Some(_) => pieces.finish_horizon(self.region),
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
