//! The visible pieces of edges, and of the horizon.

use glam::{DVec3, Vec3};

use super::bands::Bands;
use super::block::{DOUBT, NEAR};
use super::chains::Chain;
use super::chart::{TURN_END, azimuth};
use super::edges::{Edge, Edges, on_line};
use super::masks::Doubt;
use super::region::Region;

/// The end of a chain's edge.
pub(super) struct Ending<'a> {
    pub id: u32,
    pub chain: &'a Chain,
    pub end: DVec3,
    pub ends_above_horizon: bool,
    /// W just above the end, if that is above the horizon.
    pub depth_above: i32,
    /// Sum of the sizes of the jumps of all edges that have crossed it.
    pub crossed: i32,
}

/// A crossing on an edge.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    /// The other edge.
    edge: u32,
    /// Change of W just above the edge, in the direction of the sweep.
    change: i32,
}

/// A crossing that has been located.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Along the edge's chord, from 0 to 1, and what that is known to.
    along: f64,
    error: f64,
    /// The other edge, and change of W; none at the horizon.
    other: Option<Crossing>,
}

/// Where something visible begins or ends at the horizon.
#[derive(Clone, Copy, Debug)]
struct HorizonEnd {
    azimuth: f64,
    error: f64,
    point: DVec3,
    begins: bool,
}

/// Pieces under way.
#[derive(Debug, Default)]
pub(super) struct Pieces {
    /// Crossings of the edge at hand, and where along it they are.
    found: Vec<Crossing>,
    places: Vec<Place>,
    horizon: Option<Edge>,
    horizon_ends: Vec<HorizonEnd>,
    /// W just above the horizon at the seam.
    pub depth_at_seam: i32,
}

/// The side of an edge on which alone W is zero: +1 above, -1 below, 0 neither.
fn side(above: i32, jump: i32) -> i8 {
    i8::from(above == 0) - i8::from(above + jump == 0)
}

/// Parts of an edge, in each of which W is taken to fall before it rises: as low as it may come.
const PARTS: usize = 31;
const ROOM: usize = 2 * (PARTS + 1).next_power_of_two();

/// How W may fall along an edge, wherever within their errors its crossings are.
struct Worst {
    ends: (Vec3, Vec3),
    /// Changes of W, in each part that of all falls and that of all rises.
    changes: [i32; ROOM],
}

impl Worst {
    fn new((start, end): (DVec3, DVec3)) -> Self {
        Self { ends: (start.as_vec3(), end.as_vec3()), changes: [0; ROOM] }
    }

    /// Adds a crossing.
    #[inline(always)]
    fn add(&mut self, normal: Vec3, change: i32) {
        /// The numbers from here on are the integers, in the last bits.
        const INTEGERS: f32 = (1u32 << 23) as f32;
        let (a, b) = (normal.dot(self.ends.0), normal.dot(self.ends.1));
        let parts = PARTS as f32 / (a - b);
        // No branches: whether W falls or rises is hard to predict.
        let (rises, falls) = ((change >= 0) as usize, (change < 0) as u32);
        let error = 3.0 * NEAR * parts.abs();
        // What is not a number falls first and rises last: its error is infinite.
        let at = if a == 0.0 { 0.0 } else { a * parts };
        let at = at - 0.5 + f32::from_bits(error.to_bits() ^ falls << 31);
        let at = if at > 0.0 { at } else { 0.0 };
        let at = if at < PARTS as f32 { at } else { PARTS as f32 };
        let part = (at + INTEGERS).to_bits() as usize;
        self.changes[(2 * part + rises) % ROOM] += change;
    }

    /// Whether W stays positive on an edge that starts with this depth on the deeper side.
    fn stays_above_zero(&self, mut depth: i32) -> bool {
        let mut deepest = depth;
        for part in self.changes[..2 * PARTS + 2].chunks_exact(2) {
            deepest = deepest.min(depth + part[0]);
            depth += part[0] + part[1];
        }
        deepest > 0
    }
}

/// Calls back for the crossings of an edge that has ended, those found when others ended and those found now: the other edge,
/// its normal, rounded, and the change of W just above.
#[inline(always)]
fn each_crossing(bands: &Bands, &Ending { id, chain, .. }: &Ending, mut found: impl FnMut(u32, Vec3, i32)) {
    for band in chain.bands() {
        let slots = &bands.slots[band];
        slots.each_crossed(bands.slot(id, band), |crossed| found(crossed.edge, crossed.normal, crossed.change));
        slots.each_crossing(|other, normal, rises| {
            let other = &bands.chains[other as usize];
            found(other.edge, normal, (1 - 2 * i32::from(rises)) * other.jump);
        });
    }
}

impl Pieces {
    pub fn reset(&mut self, horizon: Option<Edge>) {
        self.horizon_ends.clear();
        self.horizon = horizon;
    }

    /// Adds the visible pieces of an edge that ends to the region.
    #[inline(always)]
    pub fn end(&mut self, edges: &Edges, bands: &Bands, ending: &Ending, region: &mut Region) -> Result<(), Doubt> {
        let chain = ending.chain;
        let is_hidden = match (chain.starts_above_horizon, ending.ends_above_horizon) {
            (false, false) => true,
            (true, true) if !chain.is_doubtful => {
                // What crosses it makes W rise or fall; the sum of both and the difference are known.
                let falls = (ending.crossed - (ending.depth_above - chain.above)) / 2;
                chain.above + chain.jump.min(0) > falls
            }
            _ => false,
        };
        if is_hidden { Ok(()) } else { self.look_closely(edges, bands, ending, region) }
    }

    /// The same for an edge that may be visible: finds what it crosses, and where.
    fn look_closely(
        &mut self,
        edges: &Edges,
        bands: &Bands,
        ending: &Ending,
        region: &mut Region,
    ) -> Result<(), Doubt> {
        let Ending { chain, end, .. } = *ending;
        let edge = &edges.edges[chain.edge as usize];
        let ends = (edges.start(edge), end);
        let mut depth = chain.above;
        if !chain.starts_above_horizon {
            depth = ending.depth_above;
            each_crossing(bands, ending, |_, _, change| depth -= change);
        }
        let deepest = depth + edge.jump.min(0);
        if deepest > 0 {
            let mut worst = Worst::new(ends);
            each_crossing(bands, ending, |_, normal, change| worst.add(normal, change));
            if worst.stays_above_zero(deepest) {
                return Ok(());
            }
        }
        if chain.is_doubtful {
            return Err(Doubt);
        }
        self.found.clear();
        each_crossing(bands, ending, |edge, _, change| self.found.push(Crossing { edge, change }));
        region.residuals.crossings += self.found.len() as u32;
        self.locate(edges, ends);
        if chain.starts_above_horizon != ending.ends_above_horizon {
            self.locate_horizon(ends);
        }
        self.walk(edges, ending, depth, region)
    }

    /// Finds where an edge is crossed.
    fn locate(&mut self, edges: &Edges, ends: (DVec3, DVec3)) {
        self.places.clear();
        self.places.extend(self.found.iter().map(|&other| {
            let (along, error) = along(ends, edges.edges[other.edge as usize].normal);
            Place { along, error, other: Some(other) }
        }));
    }

    fn locate_horizon(&mut self, ends: (DVec3, DVec3)) {
        let Some(horizon) = self.horizon else { return };
        let (along, error) = along(ends, horizon.normal);
        self.places.push(Place { along, error, other: None });
    }

    /// Follows an edge from its start, where W just above is `depth`, over the crossings located.
    fn walk(&mut self, edges: &Edges, ending: &Ending, mut depth: i32, region: &mut Region) -> Result<(), Doubt> {
        let edge = &edges.edges[ending.chain.edge as usize];
        let (start, end, jump) = (edges.start(edge), ending.end, edge.jump);
        self.places.sort_unstable_by(|a, b| a.along.total_cmp(&b.along));
        for pair in self.places.windows(2) {
            // An error that is not a number is one, too.
            let is_certain = pair[1].along - pair[0].along > pair[0].error + pair[1].error;
            if !is_certain {
                return Err(Doubt);
            }
        }
        let (mut from, mut is_inside) = (start, ending.chain.starts_above_horizon);
        for place in &self.places {
            let now = side(depth, jump);
            if is_inside && depth.min(depth + jump) < 0 {
                return Err(Doubt);
            }
            match place.other {
                Some(Crossing { edge: other, change }) => {
                    depth += change;
                    if is_inside && side(depth, jump) != now {
                        let point = crossing_point(edges, edge, &edges.edges[other as usize]);
                        region.push(edge, from, point, now);
                        from = point;
                    }
                }
                None => {
                    let point = point((start, end), place.along);
                    // Descending, the edge has what is below it before it along the horizon.
                    let (before, after) = if is_inside { (depth + jump, depth) } else { (depth, depth + jump) };
                    if before == 0 || after == 0 {
                        self.horizon_ends.push(HorizonEnd {
                            azimuth: azimuth(point.x, point.y),
                            error: place.error * (end - start).length(),
                            point,
                            begins: after == 0,
                        });
                    }
                    if is_inside {
                        region.push(edge, from, point, now);
                        return Ok(());
                    }
                    (is_inside, from) = (true, point);
                }
            }
        }
        if depth.min(depth + jump) < 0 {
            return Err(Doubt);
        }
        region.push(edge, from, end, side(depth, jump));
        Ok(())
    }

    /// Adds the horizon's visible pieces to the region.
    pub fn finish_horizon(&mut self, region: &mut Region) -> Result<(), Doubt> {
        let Some(horizon) = self.horizon else { return Ok(()) };
        self.horizon_ends.sort_unstable_by(|a, b| a.azimuth.total_cmp(&b.azimuth));
        for pair in self.horizon_ends.windows(2) {
            /// Azimuth over angle at most, this far from the pole.
            const STRETCH: f64 = 2.0;
            let is_certain = pair[1].azimuth - pair[0].azimuth > STRETCH * (pair[0].error + pair[1].error);
            if !is_certain {
                return Err(Doubt);
            }
        }
        let on_horizon = |azimuth: f64| on_line(horizon.normal, azimuth).normalize();
        let mut is_visible = match self.depth_at_seam {
            0 => true,
            depth if depth < 0 => return Err(Doubt),
            _ => false,
        };
        let (mut from, mut quarter) = (on_horizon(0.0), 1.0);
        let mut pass = |to: f64, point: DVec3, is_visible: bool| {
            // An arc of half a turn or more has no closed form.
            while quarter < to {
                let point = on_horizon(quarter);
                region.push(&horizon, from, point, i8::from(is_visible));
                from = point;
                quarter += 1.0;
            }
            region.push(&horizon, from, point, i8::from(is_visible));
            from = point;
        };
        for end in &self.horizon_ends {
            if end.begins == is_visible {
                return Err(Doubt);
            }
            pass(end.azimuth, end.point, is_visible);
            is_visible = end.begins;
        }
        pass(TURN_END, on_horizon(0.0), is_visible);
        if is_visible == (self.depth_at_seam == 0) { Ok(()) } else { Err(Doubt) }
    }
}

/// Where along its chord, from 0 to 1, an arc meets a plane between its ends, and what that is known to.
#[inline(always)]
fn along((start, end): (DVec3, DVec3), normal: DVec3) -> (f64, f64) {
    let (a, b) = (normal.dot(start), normal.dot(end));
    ((a / (a - b)).clamp(0.0, 1.0), DOUBT / (a - b).abs())
}

/// The point of an arc above a place along its chord.
fn point((start, end): (DVec3, DVec3), along: f64) -> DVec3 {
    (start + along * (end - start)).normalize()
}

/// Where two edges cross: a point of the one or the other, but for both the same.
fn crossing_point(edges: &Edges, one: &Edge, other: &Edge) -> DVec3 {
    let is_first = (one.start, one.end) < (other.start, other.end);
    let (edge, other) = if is_first { (one, other) } else { (other, one) };
    let ends = edges.ends(edge);
    point(ends, along(ends, other.normal).0)
}
