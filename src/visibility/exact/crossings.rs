//! The crossings ahead of the sweep, in order of azimuth.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::chart::TURN_END;
use super::edges::NIL;

/// Where two edges cross, unless the order has changed before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Crossing {
    /// Bits of the azimuth: those of a positive double sort as the double does.
    pub key: u64,
    pub upper: u32,
    pub lower: u32,
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
        let bucket = self.bucket(crossing.key);
        if bucket <= self.day {
            self.today.push(Reverse(crossing));
        } else {
            let entry = self.entries.len() as u32;
            let next = std::mem::replace(&mut self.first[bucket], entry);
            self.entries.push((crossing, next));
        }
    }

    /// The first crossing, unless it comes after `key`.
    pub fn pop_until(&mut self, key: u64) -> Option<Crossing> {
        loop {
            if let Some(&Reverse(crossing)) = self.today.peek() {
                if crossing.key > key {
                    return None;
                }
                self.today.pop();
                return Some(crossing);
            }
            if self.day >= self.bucket(key) {
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

    fn bucket(&self, key: u64) -> usize {
        ((f64::from_bits(key) * self.buckets_per_azimuth) as usize).min(self.first.len() - 1)
    }
}
