//! The place of a vertex in the order.

use glam::DVec3;

use super::edges::{HORIZON_JUMP, NIL, TOP};
use super::sweep::Sweep;

/// Every few edges of the order, from which searches set out. They may be out of date: they make searches short, not right.
#[derive(Debug, Default)]
pub(super) struct Landmarks {
    /// Downwards; those that have ended without a successor are NIL.
    edges: Vec<u32>,
    /// Steps of searches since the landmarks were chosen.
    steps: u32,
    /// Steps that pay for choosing anew.
    budget: u32,
}

/// Not a landmark.
pub(super) const NO_LANDMARK: u16 = u16::MAX;
/// Edges from one landmark to the next.
const STRIDE: u32 = 8;

impl Landmarks {
    pub fn reset(&mut self) {
        self.edges.clear();
        (self.steps, self.budget) = (0, 0);
    }

    /// Replaces an edge that has ended.
    pub fn replace(&mut self, landmark: u16, successor: u32) {
        self.edges[landmark as usize] = successor;
    }
}

impl Sweep<'_> {
    /// The neighbours between which a vertex without ending edges lies.
    pub(super) fn locate(&mut self, position: DVec3, is_below: bool) -> (u32, u32) {
        let mut upper = if is_below { self.horizon } else { self.landmark_above(position) };
        loop {
            let lower = self.status(upper).next;
            if lower == NIL || lower == self.horizon || self.edge(lower).normal.dot(position) > 0.0 {
                return (upper, lower);
            }
            self.queue.landmarks.steps += 1;
            upper = lower;
        }
    }

    /// A landmark above a position above the horizon, near it if they are up to date.
    pub(super) fn landmark_above(&mut self, position: DVec3) -> u32 {
        if self.queue.landmarks.steps >= self.queue.landmarks.budget {
            self.choose_landmarks();
        }
        let landmarks = &self.queue.landmarks.edges;
        let is_above = |id: u32| self.status(id).above < HORIZON_JUMP / 2 && self.edge(id).normal.dot(position) <= 0.0;
        let below = landmarks.partition_point(|&id| id == NIL || is_above(id));
        landmarks[..below].iter().rev().copied().find(|&id| id != NIL && is_above(id)).unwrap_or(TOP)
    }

    pub(super) fn choose_landmarks(&mut self) {
        let mut landmarks = std::mem::take(&mut self.queue.landmarks.edges);
        for id in landmarks.drain(..).filter(|&id| id != NIL) {
            self.status_mut(id).landmark = NO_LANDMARK;
        }
        let (mut count, mut id) = (0, self.status(TOP).next);
        while id != self.horizon && id != NIL {
            count += 1;
            if count % STRIDE == 0 && landmarks.len() < NO_LANDMARK as usize {
                self.status_mut(id).landmark = landmarks.len() as u16;
                landmarks.push(id);
            }
            id = self.status(id).next;
        }
        self.queue.landmarks = Landmarks { edges: landmarks, steps: 0, budget: 2 * count + STRIDE };
    }
}
