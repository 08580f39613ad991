//! Active edges by latitude: a vertex is compared with those that come near its latitude alone.

use glam::DVec3;

use super::edges::{Edge, Edges, NIL};
use super::slots::{Slots, has, set};

/// Edges that a band should hold at a time.
const EDGES_PER_BAND: usize = 16;
const MOST_BANDS: usize = 64;
/// Equal parts of z from pole to pole, of which bands are made.
const PARTS: usize = 512;

/// What is known of an active edge since it started.
#[derive(Clone, Copy, Debug)]
pub(super) struct Active {
    pub start: DVec3,
    pub starts_above_horizon: bool,
    /// Some vertex could not be told to be above or below of it.
    pub is_doubtful: bool,
    /// The bands that it comes into, from the pole downwards.
    pub first_band: u32,
    pub last_band: u32,
    /// Where its slots in them are listed.
    slots: u32,
    /// W just above its start, if that is above the horizon.
    pub above: i32,
    /// The last of its crossings found, linked.
    pub crossings: u32,
    /// Sum of their changes of W, and of those that are negative.
    pub change: i32,
    pub fall: i32,
}

impl Active {
    pub fn new(above: i32, start: DVec3, starts_above_horizon: bool) -> Self {
        Self {
            start,
            starts_above_horizon,
            is_doubtful: false,
            first_band: 0,
            last_band: 0,
            slots: NIL,
            above,
            crossings: NIL,
            change: 0,
            fall: 0,
        }
    }

    pub fn bands(&self) -> std::ops::RangeInclusive<usize> {
        self.first_band as usize..=self.last_band as usize
    }
}

/// One band.
#[derive(Debug, Default)]
pub(super) struct Band {
    pub slots: Slots,
    /// Sum of the jumps of the active edges that lie above the band.
    jumps_above: i32,
    /// Which of its edges pass above the vertex at hand.
    pub above: Vec<u64>,
    /// Sum of their jumps.
    jumps: i32,
}

/// The active edges, each in all bands that it comes into.
#[derive(Debug, Default)]
pub(super) struct Bands {
    pub bands: Vec<Band>,
    count: usize,
    /// Band of each part of z.
    band_of: Vec<u8>,
    /// By edge.
    pub active: Vec<Active>,
    slots: Vec<u16>,
}

impl Bands {
    /// Makes bands of equal numbers of vertices.
    pub fn reset(&mut self, edges: &Edges) {
        self.count = (edges.mean_active / EDGES_PER_BAND).clamp(1, MOST_BANDS);
        let mut vertices = [0u32; PARTS];
        if self.count > 1 {
            edges.vertices.iter().for_each(|vertex| vertices[part(vertex.position.z)] += 1);
        }
        self.band_of.clear();
        let (mut before, total) = (0, edges.vertices.len().max(1));
        for count in vertices {
            self.band_of.push((before as usize * self.count / total).min(self.count - 1) as u8);
            before += count;
        }
        self.bands.resize_with(self.bands.len().max(self.count), Band::default);
        for band in &mut self.bands[..self.count] {
            band.slots.reset();
            band.above.clear();
            (band.jumps_above, band.jumps) = (0, 0);
        }
        self.slots.clear();
        self.active.resize(edges.edges.len(), Active::new(0, DVec3::ZERO, false));
    }

    /// The band of a unit vector with this z.
    pub fn band(&self, z: f64) -> usize {
        self.band_of[part(z)].into()
    }

    /// First and last band that an edge comes into.
    pub fn range(&self, (start, end): (DVec3, DVec3)) -> (u32, u32) {
        if self.count == 1 {
            return (0, 0);
        }
        // An arc is no further from its chord than half the square of half its length, and z of the chord is between those of
        // its ends; for rounding add a little.
        let bulge = 0.25 * start.distance_squared(end) + 1e-14;
        let (low, high) = (start.z.min(end.z) - bulge, start.z.max(end.z) + bulge);
        (self.band(high) as u32, self.band(low) as u32)
    }

    /// Asks the edges in some bands which of them pass above a unit vector; whether that is in doubt for one.
    pub fn look(&mut self, position: DVec3, bands: std::ops::RangeInclusive<usize>) -> bool {
        let mut is_near = false;
        for band in &mut self.bands[bands] {
            let (jumps, near) = band.slots.sides(position, &mut band.above);
            band.jumps = jumps;
            is_near |= near;
        }
        is_near
    }

    /// Marks the edges in some bands that pass within rounding of a unit vector.
    pub fn doubt_near(&mut self, position: DVec3, bands: std::ops::RangeInclusive<usize>) {
        let Self { bands: all, active, .. } = self;
        for band in &all[bands] {
            band.slots.near(position).for_each(|edge| active[edge as usize].is_doubtful = true);
        }
    }

    /// Jumps of all edges above the position last looked from, in its band.
    pub fn jumps_above(&self, band: usize) -> i32 {
        self.bands[band].jumps_above + self.bands[band].jumps
    }

    /// Adds an edge below all those that are marked as above.
    pub fn insert(&mut self, id: u32, edge: &Edge, ends: (DVec3, DVec3), mut active: Active) {
        (active.first_band, active.last_band) = self.range(ends);
        active.slots = self.slots.len() as u32;
        for band in &mut self.bands[active.bands()] {
            self.slots.push(band.slots.insert(id, edge.normal, edge.jump, &band.above) as u16);
        }
        self.weigh_below(&active, edge.jump);
        self.active[id as usize] = active;
    }

    /// Removes an edge.
    pub fn remove(&mut self, id: u32, jump: i32) {
        let active = self.active[id as usize];
        for band in active.bands() {
            let slot = self.slot(&active, band);
            self.bands[band].slots.remove(slot);
        }
        self.weigh_below(&active, -jump);
    }

    fn weigh_below(&mut self, active: &Active, jump: i32) {
        let below = active.last_band as usize + 1..self.count;
        self.bands[below].iter_mut().for_each(|band| band.jumps_above += jump);
    }

    /// The slot of an edge in one of its bands.
    fn slot(&self, active: &Active, band: usize) -> usize {
        self.slots[active.slots as usize + band - active.first_band as usize].into()
    }

    /// Marks nothing as above.
    pub fn clear_above(&mut self) {
        self.bands[..self.count].iter_mut().for_each(|band| band.above.clear());
    }

    /// Marks an edge as above.
    pub fn set_above(&mut self, id: u32) {
        let active = self.active[id as usize];
        for band in active.bands() {
            let slot = self.slot(&active, band);
            let Band { slots, above, .. } = &mut self.bands[band];
            above.resize(slots.words(), 0);
            set(above, slot);
        }
    }

    /// Appends, for each of its bands, which edges lay above an edge when the younger of the two started.
    pub fn above_at_start(&self, id: u32, masks: &mut Vec<u64>) {
        let active = &self.active[id as usize];
        for band in active.bands() {
            self.bands[band].slots.above_at_start(self.slot(active, band), masks);
        }
    }

    /// Whether `other` was above `id`, whose masks are given, when the younger of the two started; both come into `band`.
    pub fn was_above(&self, id: u32, masks: &[u64], other: u32, band: usize) -> bool {
        let (active, other) = (&self.active[id as usize], &self.active[other as usize]);
        let before = &self.bands[active.first_band as usize..band];
        let first: usize = before.iter().map(|band| band.slots.words()).sum();
        has(&masks[first..], self.slot(other, band))
    }

    /// The edges still active, without order.
    pub fn left(&self) -> impl Iterator<Item = u32> {
        self.bands[..self.count].iter().enumerate().flat_map(move |(number, band)| {
            let edges = band.slots.taken_edges();
            edges.filter(move |&edge| self.active[edge as usize].first_band as usize == number)
        })
    }

    /// Whether some band holds more than is good.
    pub fn is_crowded(&self, bands: std::ops::RangeInclusive<usize>) -> bool {
        self.bands[bands].iter().any(|band| band.slots.is_crowded())
    }
}

fn part(z: f64) -> usize {
    ((1.0 - z) * (PARTS as f64 / 2.0)).clamp(0.0, PARTS as f64 - 1.0) as usize
}
