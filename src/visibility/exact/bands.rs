//! Active chains by latitude: a vertex is compared with those that come near its latitude alone.

use std::ops::Range;

use glam::DVec3;

use super::chains::Chain;
use super::edges::Edges;
use super::slots::Slots;

/// The active chains, each in all bands that it comes into.
#[derive(Debug, Default)]
pub(super) struct Bands {
    pub slots: Vec<Slots>,
    /// For each band, sum of the jumps of the chains that lie above it.
    jumps_above: Vec<i32>,
    pub chains: Vec<Chain>,
    /// Chains that have ended.
    free: Vec<u32>,
    /// The slot of chain c in band b at `c * count + b`.
    slot_of: Vec<u16>,
    /// Some band has held more than is good.
    pub is_crowded: bool,
}

impl Bands {
    /// Empties all bands.
    pub fn reset(&mut self, count: usize) {
        self.slots.resize_with(self.slots.len().max(count), Slots::default);
        self.slots[..count].iter_mut().for_each(Slots::reset);
        self.jumps_above.clear();
        self.jumps_above.resize(count, 0);
        self.chains.clear();
        self.free.clear();
        self.is_crowded = false;
    }

    fn count(&self) -> usize {
        self.jumps_above.len()
    }

    /// Asks the edges in some bands which of them pass above a unit vector; whether that is in doubt for one.
    #[inline(always)]
    pub fn look(&mut self, edges: &Edges, position: DVec3, bands: Range<usize>) -> bool {
        let mut is_near = false;
        let rounded = position.as_vec3();
        for slots in &mut self.slots[bands] {
            is_near |= slots.look(position, rounded, edges, &mut self.chains);
        }
        is_near
    }

    /// Jumps of all edges above the position last looked from, in its band.
    #[inline(always)]
    pub fn jumps_above(&self, band: u8) -> i32 {
        self.jumps_above[band as usize] + self.slots[band as usize].jumps_above()
    }

    /// The slot of a chain in one of its bands.
    #[inline(always)]
    pub fn slot(&self, chain: u32, band: usize) -> usize {
        self.slot_of[chain as usize * self.count() + band].into()
    }

    /// Adds a chain below all those that are marked as above.
    #[inline(always)]
    pub fn insert(&mut self, chain: Chain) -> u32 {
        let id = self.free.pop().unwrap_or(self.chains.len() as u32);
        if id as usize == self.chains.len() {
            self.chains.push(chain);
            let room = self.chains.len() * self.count();
            self.slot_of.resize(self.slot_of.len().max(room), 0);
        } else {
            self.chains[id as usize] = chain;
        }
        for band in chain.bands() {
            self.enter(id, &chain, band);
        }
        self.jumps_above[chain.last_band as usize + 1..].iter_mut().for_each(|sum| *sum += chain.jump);
        id
    }

    /// Takes a slot for a chain in one of its bands.
    #[inline(always)]
    fn enter(&mut self, id: u32, chain: &Chain, band: usize) {
        let slots = &mut self.slots[band];
        let slot = slots.insert(id, chain, band > chain.first_band.into());
        self.is_crowded |= slots.is_crowded();
        let place = id as usize * self.count() + band;
        self.slot_of[place] = slot as u16;
    }

    /// Lets a chain out of comparisons.
    #[inline(always)]
    pub fn hide(&mut self, id: u32) {
        for band in self.chains[id as usize].bands() {
            let slot = self.slot(id, band);
            self.slots[band].hide(slot);
        }
    }

    /// Frees the slots of a chain. What lay above it can be asked until another one is inserted.
    #[inline(always)]
    pub fn remove(&mut self, id: u32) {
        let chain = self.chains[id as usize];
        for band in chain.bands() {
            let slot = self.slot(id, band);
            self.slots[band].remove(slot);
        }
        self.jumps_above[chain.last_band as usize + 1..].iter_mut().for_each(|sum| *sum -= chain.jump);
    }

    /// Frees the number of a chain that has been removed.
    pub fn free(&mut self, id: u32) {
        self.free.push(id);
    }

    /// Brings a chain to its next edge, which starts at the vertex last looked from.
    #[inline(always)]
    pub fn proceed(&mut self, id: u32, next: Chain) {
        let chain = std::mem::replace(&mut self.chains[id as usize], next);
        let (old, new) = (chain.bands(), next.bands());
        for band in old.clone().filter(|band| !new.contains(band)) {
            let slot = self.slot(id, band);
            self.slots[band].remove(slot);
        }
        for band in new.start..new.end {
            let slot = self.slot(id, band);
            let is_old = old.contains(&band);
            if is_old && !self.slots[band].is_astray(slot) {
                self.slots[band].follow(slot, &next, band > next.first_band.into());
            } else {
                if is_old {
                    self.slots[band].remove(slot);
                }
                self.enter(id, &next, band);
            }
        }
        if old.end < new.end {
            self.jumps_above[old.end..new.end].iter_mut().for_each(|sum| *sum -= next.jump);
        } else {
            self.jumps_above[new.end..old.end].iter_mut().for_each(|sum| *sum += next.jump);
        }
    }

    /// Marks nothing as above.
    pub fn clear_above(&mut self) {
        let count = self.count();
        self.slots[..count].iter_mut().for_each(Slots::clear_above);
    }

    /// Marks a chain as above.
    #[inline(always)]
    pub fn set_above(&mut self, id: u32) {
        for band in self.chains[id as usize].bands() {
            let slot = self.slot(id, band);
            self.slots[band].set_above(slot);
        }
    }

    /// Whether `other` was above `id` at the last vertex of either; both come into `band`.
    #[inline(always)]
    pub fn was_above(&self, id: u32, other: u32, band: u8) -> bool {
        let band = usize::from(band);
        self.slots[band].was_above(self.slot(id, band), self.slot(other, band))
    }

    /// Enters all that the edge of a chain, which ends at the vertex last looked from, has crossed. Returns the sum of the sizes of
    /// the jumps of all edges that have crossed it.
    #[inline(always)]
    pub fn cross(&mut self, id: u32) -> i32 {
        let chain = self.chains[id as usize];
        let first = usize::from(chain.first_band);
        let mut sum = 0;
        for band in chain.bands() {
            let slot = self.slot(id, band);
            sum += self.slots[band].cross(slot, band == first, &chain);
        }
        sum
    }

    /// The chains still active, without order.
    pub fn left(&self) -> impl Iterator<Item = u32> {
        self.slots[..self.count()].iter().enumerate().flat_map(move |(band, slots)| {
            let chains = slots.taken();
            chains.filter(move |&chain| usize::from(self.chains[chain as usize].first_band) == band)
        })
    }
}
