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

use super::bands::{Active, Bands};
use super::chart::Chart;
use super::edges::{Edge, Edges, NIL, SEAM, Vertex, on_seam};
use super::pieces::{Ending, Pieces};
use super::region::Region;
use super::slots::DOUBT;

/// The sweep is not certain of its answer.
pub(super) struct Doubt;

/// Buffers of the sweep.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    bands: Bands,
    pieces: Pieces,
    /// Edges that end at a vertex; for each and its bands which edges were above it at the start; where each begins there.
    ends: Vec<u32>,
    above_at_start: Vec<u64>,
    first_mask: Vec<usize>,
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
    buffers.bands.reset(edges);
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
        let Buffers { bands, pieces, at_seam, .. } = &mut *self.buffers;
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
            let ends = self.edges.ends(edge);
            let height = self.horizon.map_or(1.0, |horizon| horizon.normal.dot(ends.0));
            if height > 0.0 {
                widen(&mut widest, previous, ends.0, above);
                at_horizon = above + edge.jump;
                previous = ends.0;
            }
            bands.insert(id, edge, ends, Active::new(above, ends.0, height > 0.0));
            // What comes next at the seam is below.
            bands.set_above(id);
            above += edge.jump;
            bands.active[id as usize].is_doubtful |= height.abs() < DOUBT;
            if k > 0 && at_seam[k - 1].0 - z < DOUBT {
                bands.active[id as usize].is_doubtful = true;
                bands.active[at_seam[k - 1].1 as usize].is_doubtful = true;
            }
        }
        widen(&mut widest, previous, last, at_horizon);
        pieces.depth_at_seam = at_horizon;
        (self.chart.world(widest.1), widest.2)
    }

    fn vertex(&mut self, vertex: &Vertex, starts: std::ops::Range<u32>) -> Result<(), Doubt> {
        let Buffers { bands, pieces, ends, above_at_start, first_mask, .. } = &mut *self.buffers;
        let is_above_horizon = vertex.height > 0.0;
        let band = bands.band(vertex.position.z);
        // The bands that the vertex's edges come into.
        let (mut first, mut last) = (band, band);
        let mut balance = 0;
        ends.clear();
        above_at_start.clear();
        first_mask.clear();
        let mut id = vertex.ends;
        while id != NIL {
            ends.push(id);
            id = self.edges.edges[id as usize].next_end;
        }
        // Nothing depends on the order of the contours.
        let place =
            |id: &u32| (self.edges.edges[*id as usize].start, self.edges.edges[*id as usize].normal.x.to_bits());
        ends.sort_unstable_by_key(place);
        for &id in &*ends {
            balance -= self.edges.edges[id as usize].jump;
            first_mask.push(above_at_start.len());
            bands.above_at_start(id, above_at_start);
            let active = &bands.active[id as usize];
            first = first.min(active.first_band as usize);
            last = last.max(active.last_band as usize);
        }
        for start in starts.clone() {
            let edge = &self.edges.edges[start as usize];
            balance += edge.jump;
            let (from, to) = bands.range(self.edges.ends(edge));
            first = first.min(from as usize);
            last = last.max(to as usize);
        }
        if balance != 0 && is_above_horizon {
            return Err(Doubt);
        }
        for &id in &*ends {
            bands.remove(id, self.edges.edges[id as usize].jump);
        }
        let is_near = bands.look(vertex.position, first..=last);
        if is_near {
            bands.doubt_near(vertex.position, first..=last);
            ends.iter().for_each(|&id| bands.active[id as usize].is_doubtful = true);
        }
        let depth = self.depth_at_pole + bands.jumps_above(band);
        for (k, &edge) in ends.iter().enumerate() {
            let above_at_start = &above_at_start[first_mask[k]..];
            let mut depth_above = depth;
            if ends.len() > 1 {
                // Those that end here too, above it.
                let siblings =
                    ends.iter().filter(|&&other| other != edge && bands.was_above(edge, above_at_start, other, band));
                depth_above += siblings.map(|&other| self.edges.edges[other as usize].jump).sum::<i32>();
            }
            let end = vertex.position;
            let ending = Ending { edge, above_at_start, end, ends_above_horizon: is_above_horizon, depth_above };
            pieces.end(self.edges, bands, &ending, self.chart, self.region)?;
        }
        self.start(vertex, starts, depth, is_near)?;
        if self.buffers.bands.is_crowded(first..=last) { Err(Doubt) } else { Ok(()) }
    }

    /// Starts edges at a vertex.
    fn start(&mut self, vertex: &Vertex, starts: std::ops::Range<u32>, depth: i32, is_near: bool) -> Result<(), Doubt> {
        self.buffers.starts.clear();
        self.buffers.starts.extend(starts);
        self.sort_starts(is_near);
        let Buffers { bands, starts, doubts, .. } = &mut *self.buffers;
        let mut above = depth;
        for (i, (&id, &is_doubtful)) in starts.iter().zip(&*doubts).enumerate() {
            let edge = &self.edges.edges[id as usize];
            let active = Active::new(above, vertex.position, vertex.height > 0.0);
            bands.insert(id, edge, self.edges.ends(edge), active);
            bands.active[id as usize].is_doubtful = is_doubtful;
            above += edge.jump;
            if i + 1 < starts.len() {
                bands.set_above(id);
            }
        }
        Ok(())
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
        let Buffers { bands, pieces, above_at_start, at_seam, .. } = &mut *self.buffers;
        at_seam.clear();
        at_seam.extend(bands.left().map(|id| (on_seam(self.edges.edges[id as usize].normal).z, id)));
        downwards(at_seam);
        for pair in at_seam.windows(2) {
            if pair[0].0 - pair[1].0 < DOUBT {
                pair.iter().for_each(|&(_, id)| bands.active[id as usize].is_doubtful = true);
            }
        }
        bands.clear_above();
        let mut depth = self.depth_at_pole;
        for &(_, id) in &*at_seam {
            let edge = &self.edges.edges[id as usize];
            debug_assert_eq!(edge.end, SEAM);
            let end = on_seam(edge.normal);
            let height = self.horizon.map_or(1.0, |horizon| horizon.normal.dot(end));
            bands.active[id as usize].is_doubtful |= height.abs() < DOUBT;
            above_at_start.clear();
            bands.above_at_start(id, above_at_start);
            bands.set_above(id);
            bands.remove(id, edge.jump);
            let ending = Ending { edge: id, above_at_start, end, ends_above_horizon: height > 0.0, depth_above: depth };
            pieces.end(self.edges, bands, &ending, self.chart, self.region)?;
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
