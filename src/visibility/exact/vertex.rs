//! What happens at a vertex: the edges that end there give way to those that start there.

use std::ops::Range;

use glam::DVec3;

use super::edges::{HORIZON_JUMP, NIL, TOP, Vertex};
use super::landmarks::NO_LANDMARK;
use super::sweep::Sweep;

impl Sweep<'_> {
    /// Replaces the edges that end at a vertex by those that start there.
    pub(super) fn vertex(&mut self, vertex: &Vertex, ends: u32, starts: Range<u32>) {
        let (position, is_below) = (vertex.position, vertex.height <= 0.0);
        self.collect(ends, starts, is_below);
        let (mut upper, lower) = match (self.queue.ends.is_empty(), self.queue.starts.is_empty()) {
            (true, true) => return,
            (true, false) => self.locate(position, is_below),
            _ => self.remove_ends(position, is_below),
        };
        let first = upper;
        for i in 0..self.queue.starts.len() {
            let id = self.queue.starts[i];
            self.link(upper, id);
            self.status_mut(id).above = self.below(upper);
            self.refresh(id, position);
            upper = id;
        }
        self.link(upper, lower);
        let mut above = first;
        while above != lower {
            let below = self.status(above).next;
            self.expect_crossing(above, below);
            above = below;
        }
    }

    /// Lists the edges that end and start at a vertex, the latter downwards; checks that their jumps cancel.
    pub(super) fn collect(&mut self, mut ends: u32, starts: Range<u32>, is_below: bool) {
        let mut balance = 0;
        self.queue.ends.clear();
        while ends != NIL {
            self.queue.ends.push(ends);
            balance -= self.edge(ends).jump;
            ends = self.edge(ends).next_end;
        }
        self.queue.starts.clear();
        for start in starts {
            self.queue.starts.push(start);
            balance += self.edge(start).jump;
        }
        if balance != 0 && !is_below {
            self.region.residuals.unbalanced += 1;
        }
        // By insertion: rounding may make the comparison intransitive, which is harmless here and not in `sort_by`.
        for i in 1..self.queue.starts.len() {
            for j in (1..=i).rev() {
                let (upper, lower) = (self.queue.starts[j - 1], self.queue.starts[j]);
                if !self.crosses(upper, lower) {
                    break;
                }
                self.queue.starts.swap(j - 1, j);
            }
        }
    }

    /// Takes the edges that end at a vertex out of the order; returns the neighbours of the gap.
    pub(super) fn remove_ends(&mut self, position: DVec3, is_below: bool) -> (u32, u32) {
        let first = self.queue.ends[0];
        if is_below {
            for i in 0..self.queue.ends.len() {
                let id = self.queue.ends[i];
                // Above the horizon by rounding only.
                while self.status(id).above < HORIZON_JUMP / 2 && self.status(id).next != NIL {
                    self.force(id, self.status(id).next, position);
                }
            }
        }
        let (mut highest, mut lowest) = (first, first);
        for i in 1..self.queue.ends.len() {
            let id = self.queue.ends[i];
            if self.is_below(highest, id) {
                while self.status(id).prev != lowest {
                    self.force(self.status(id).prev, id, position);
                }
                lowest = id;
            } else {
                while self.status(id).next != highest {
                    self.force(id, self.status(id).next, position);
                }
                highest = id;
            }
        }
        let (upper, lower) = (self.status(highest).prev, self.status(lowest).next);
        for i in 0..self.queue.ends.len() {
            let id = self.queue.ends[i];
            self.close_visible(id, position);
            self.close_negative(id, position);
            self.status_mut(id).next = NIL;
            let landmark = self.status(id).landmark;
            if landmark != NO_LANDMARK {
                let free = self.queue.starts.iter().copied().find(|&start| self.status(start).landmark == NO_LANDMARK);
                self.queue.landmarks.replace(landmark, free.unwrap_or(NIL));
                if let Some(successor) = free {
                    self.status_mut(successor).landmark = landmark;
                }
            }
        }
        self.link(upper, lower);
        (upper, lower)
    }

    pub(super) fn force(&mut self, upper: u32, lower: u32, point: DVec3) {
        self.region.residuals.forced += 1;
        self.exchange(upper, lower, Some(point));
    }

    /// Whether `id` comes below `reference` in the order; walks both ways, as they are near each other.
    pub(super) fn is_below(&self, reference: u32, id: u32) -> bool {
        let (mut up, mut down) = (reference, reference);
        loop {
            if down != NIL {
                down = self.status(down).next;
                if down == id {
                    return true;
                }
            }
            if up != TOP {
                up = self.status(up).prev;
                if up == id {
                    return false;
                }
            }
            if up == TOP && down == NIL {
                return true;
            }
        }
    }
}
