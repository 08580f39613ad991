//! The crossings ahead of the sweep, in order of azimuth.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::chart::TURN_END;
use super::edges::NIL;

/// Where two edges cross, unless the order has changed before: bits of the azimuth, upper edge, lower edge. In one number,
/// since heaps compare without branches then. The bits of a positive double sort as the double does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Crossing(u128);

impl Crossing {
    pub fn new(azimuth: f64, upper: u32, lower: u32) -> Self {
        Self((azimuth.to_bits() as u128) << 64 | (upper as u128) << 32 | lower as u128)
    }

    pub fn azimuth(self) -> f64 {
        f64::from_bits((self.0 >> 64) as u64)
    }

    pub fn upper(self) -> u32 {
        (self.0 >> 32) as u32
    }

    pub fn lower(self) -> u32 {
        self.0 as u32
    }
}

/// A calendar queue (Brown 1988): buckets of azimuth, of which only the one at hand is kept in order, by a heap.
#[derive(Debug, Default)]
pub(super) struct Crossings {
    today: BinaryHeap<Reverse<Crossing>>,
    /// Bucket of `today`.
    day: usize,
    /// First entry of each later bucket.
    first: Vec<u32>,
    /// Entries of later buckets, each with the next one in its bucket.
    entries: Vec<(Crossing, u32)>,
    buckets_per_azimuth: f64,
}

impl Crossings {
    /// Empties the queue and makes it ready for about this many crossings.
    pub fn reset(&mut self, expected: usize) {
        let buckets = expected.clamp(8, 1 << 20);
        self.today.clear();
        self.entries.clear();
        self.first.clear();
        self.first.resize(buckets + 1, NIL);
        self.day = 0;
        self.buckets_per_azimuth = buckets as f64 / TURN_END;
    }

    pub fn push(&mut self, crossing: Crossing) {
        let bucket = self.bucket(crossing.azimuth());
        if bucket <= self.day {
            self.today.push(Reverse(crossing));
        } else {
            let entry = self.entries.len() as u32;
            let next = std::mem::replace(&mut self.first[bucket], entry);
            self.entries.push((crossing, next));
        }
    }

    /// The first crossing, unless it comes after `azimuth`.
    pub fn pop_until(&mut self, azimuth: f64) -> Option<Crossing> {
        loop {
            if let Some(&Reverse(crossing)) = self.today.peek() {
                if crossing.azimuth() > azimuth {
                    return None;
                }
                self.today.pop();
                return Some(crossing);
            }
            if self.day >= self.bucket(azimuth) {
                return None;
            }
            self.day += 1;
            let mut entry = self.first[self.day];
            while entry != NIL {
                let (crossing, next) = self.entries[entry as usize];
                self.today.push(Reverse(crossing));
                entry = next;
            }
        }
    }

    fn bucket(&self, azimuth: f64) -> usize {
        ((azimuth * self.buckets_per_azimuth) as usize).min(self.first.len() - 1)
    }
}
