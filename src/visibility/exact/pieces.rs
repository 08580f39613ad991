//! The visible pieces of edges, and of the horizon.

use glam::DVec3;

use super::chart::{Chart, TURN_END, azimuth};
use super::edges::{Edge, Edges, NIL, on_line};
use super::masks::Doubt;
use super::region::Region;
use super::slots::{DOUBT, Slots};

/// The end of an active edge.
pub(super) struct Ending<'a> {
    pub slot: usize,
    /// The edges that were above this one when the younger of the two started, and those that are now.
    pub above_at_start: &'a [u64],
    pub above_at_end: &'a [u64],
    pub end: DVec3,
    pub ends_above_horizon: bool,
    /// W just above the end, if that is above the horizon.
    pub depth_above: i32,
}

/// An edge that crosses the one that ends.
struct Crossed {
    slot: usize,
    /// Whether the one that ends rises above it.
    rises: bool,
}

impl Ending<'_> {
    /// The edges among those still active that it has crossed.
    fn crossed(&self, word: usize, active: u64) -> impl Iterator<Item = Crossed> + use<> {
        let was_above = self.above_at_start[word];
        let mut left = (was_above ^ self.above_at_end[word]) & active;
        std::iter::from_fn(move || {
            let bit = (left != 0).then(|| left.trailing_zeros())?;
            left &= left - 1;
            Some(Crossed { slot: 64 * word + bit as usize, rises: was_above >> bit & 1 != 0 })
        })
    }
}

/// A crossing on an edge, after others.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    /// The other edge.
    edge: u32,
    /// Change of W just above the edge, in the direction of the sweep.
    change: i32,
    /// The one before.
    next: u32,
}

/// A crossing that has been located.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Along the edge.
    order: f64,
    /// What `order` is known to.
    error: f64,
    point: DVec3,
    /// Change of W; none at the horizon.
    change: Option<i32>,
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
    crossings: Vec<Crossing>,
    /// Those of the edge at hand, and where along it they are.
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

impl Pieces {
    pub fn reset(&mut self, horizon: Option<Edge>) {
        self.crossings.clear();
        self.horizon_ends.clear();
        self.horizon = horizon;
    }

    /// Notes the crossings of an edge that ends with those still active, and adds its visible pieces to the region.
    pub fn end(
        &mut self,
        edges: &Edges,
        slots: &mut Slots,
        ending: &Ending,
        chart: &Chart,
        region: &mut Region,
    ) -> Result<(), Doubt> {
        let active = *slots.get(ending.slot);
        let jump = slots.jump(ending.slot);
        let (mut change, mut fall) = (active.change, active.fall);
        let words = 0..ending.above_at_end.len();
        for word in 0..ending.above_at_end.len() {
            for crossed in ending.crossed(word, slots.taken()[word]) {
                let of_other = slots.jump(crossed.slot);
                let step = if crossed.rises { -of_other } else { of_other };
                change += step;
                fall += step.min(0);
                // In the other's books, too, for when it ends.
                let step = if crossed.rises { jump } else { -jump };
                let other = slots.get_mut(crossed.slot);
                other.change += step;
                other.fall += step.min(0);
                let next = std::mem::replace(&mut other.crossings, self.crossings.len() as u32);
                self.crossings.push(Crossing { edge: active.edge, change: step, next });
            }
        }
        let depth = if active.starts_above_horizon {
            active.above
        } else if ending.ends_above_horizon {
            ending.depth_above - change
        } else {
            return Ok(());
        };
        let deepest = depth + jump.min(0);
        if deepest + fall > 0 {
            return Ok(());
        }
        self.found.clear();
        let mut next = active.crossings;
        while next != NIL {
            let crossing = self.crossings[next as usize];
            self.found.push(crossing);
            next = crossing.next;
        }
        for crossed in words.flat_map(|word| ending.crossed(word, slots.taken()[word])) {
            let of_other = slots.jump(crossed.slot);
            let change = if crossed.rises { -of_other } else { of_other };
            self.found.push(Crossing { edge: slots.get(crossed.slot).edge, change, next: NIL });
        }
        let ends = (active.start, ending.end);
        if self.stays_above_zero(edges, ends, deepest) {
            return Ok(());
        }
        if slots.is_doubtful(ending.slot) {
            return Err(Doubt);
        }
        region.residuals.crossings += self.found.len() as u32;
        let edge = &edges.edges[active.edge as usize];
        self.locate(edges, edge, active.edge, ends);
        if active.starts_above_horizon != ending.ends_above_horizon {
            self.locate_horizon(ends);
        }
        self.walk(edge, depth, (active.start, active.starts_above_horizon), ending.end, chart, region)
    }

    /// Whether W stays positive on an edge that starts with this depth on the deeper side, wherever within their errors its
    /// crossings are.
    fn stays_above_zero(&self, edges: &Edges, (start, end): (DVec3, DVec3), mut depth: i32) -> bool {
        /// Parts of the edge, in each of which W falls before it rises.
        const PARTS: usize = 32;
        let (mut falls, mut rises) = ([0; PARTS], [0; PARTS]);
        for crossing in &self.found {
            let normal = edges.edges[crossing.edge as usize].normal;
            let (a, b) = (normal.dot(start), normal.dot(end));
            let parts = PARTS as f64 / (a - b);
            let (at, error) = (a * parts, DOUBT * parts.abs());
            if crossing.change < 0 {
                // What is no number falls first.
                falls[((at - error) as usize).min(PARTS - 1)] += crossing.change;
            } else if at + error < PARTS as f64 {
                rises[(at + error) as usize] += crossing.change;
            }
        }
        depth > 0
            && falls.iter().zip(&rises).all(|(fall, rise)| {
                let deepest = depth + fall;
                depth = deepest + rise;
                deepest > 0
            })
    }

    /// Finds where an edge is crossed.
    fn locate(&mut self, edges: &Edges, edge: &Edge, id: u32, (start, end): (DVec3, DVec3)) {
        self.places.clear();
        for &Crossing { edge: other_id, change, .. } in &self.found {
            let other = &edges.edges[other_id as usize];
            // On the one or the other, but for both the same point.
            let (point, error) =
                if id < other_id { meet((start, end), other.normal) } else { meet(edges.ends(other), edge.normal) };
            self.places.push(Place { order: point.dot(end - start), error, point, change: Some(change) });
        }
    }

    fn locate_horizon(&mut self, (start, end): (DVec3, DVec3)) {
        let Some(horizon) = self.horizon else { return };
        let (point, error) = meet((start, end), horizon.normal);
        self.places.push(Place { order: point.dot(end - start), error, point, change: None });
    }

    /// Follows an edge from its start over the crossings located.
    fn walk(
        &mut self,
        edge: &Edge,
        mut depth: i32,
        (start, starts_above_horizon): (DVec3, bool),
        end: DVec3,
        chart: &Chart,
        region: &mut Region,
    ) -> Result<(), Doubt> {
        let jump = edge.jump;
        self.places.sort_unstable_by(|a, b| a.order.total_cmp(&b.order));
        let length = (end - start).length();
        for pair in self.places.windows(2) {
            // An error that is not a number is one, too.
            let is_certain = pair[1].order - pair[0].order > length * (pair[0].error + pair[1].error);
            if !is_certain {
                return Err(Doubt);
            }
        }
        let (mut from, mut is_inside) = (start, starts_above_horizon);
        for place in &self.places {
            let now = side(depth, jump);
            if is_inside && depth.min(depth + jump) < 0 {
                return Err(Doubt);
            }
            match place.change {
                Some(change) => {
                    depth += change;
                    if is_inside && side(depth, jump) != now {
                        region.push(chart, edge, from, place.point, now);
                        from = place.point;
                    }
                }
                None => {
                    // Descending, the edge has what is below it before it along the horizon.
                    let (before, after) = if is_inside { (depth + jump, depth) } else { (depth, depth + jump) };
                    if before == 0 || after == 0 {
                        self.horizon_ends.push(HorizonEnd {
                            azimuth: azimuth(place.point.x, place.point.y),
                            error: place.error,
                            point: place.point,
                            begins: after == 0,
                        });
                    }
                    if is_inside {
                        region.push(chart, edge, from, place.point, now);
                        return Ok(());
                    }
                    (is_inside, from) = (true, place.point);
                }
            }
        }
        if depth.min(depth + jump) < 0 {
            return Err(Doubt);
        }
        region.push(chart, edge, from, end, side(depth, jump));
        Ok(())
    }

    /// Adds the horizon's visible pieces to the region.
    pub fn finish_horizon(&mut self, chart: &Chart, region: &mut Region) -> Result<(), Doubt> {
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
                region.push(chart, &horizon, from, point, i8::from(is_visible));
                from = point;
                quarter += 1.0;
            }
            region.push(chart, &horizon, from, point, i8::from(is_visible));
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

/// Where an arc meets a plane between its ends, and what that place is known to, in radians.
fn meet((start, end): (DVec3, DVec3), normal: DVec3) -> (DVec3, f64) {
    let (a, b) = (normal.dot(start), normal.dot(end));
    let along = (a / (a - b)).clamp(0.0, 1.0);
    let step = end - start;
    ((start + along * step).normalize(), DOUBT * step.length() / (a - b).abs())
}
