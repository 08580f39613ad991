//! Choice among contours by the cells of their ends.

use crate::divided::Divided;

/// Marks the cells outside of those of interest: the bit of their numbers above all that count.
pub const OUTSIDE: i32 = 1 << 30;

/// What there is among the contours of a part, see [`Candidates::contours_apart`](crate::Candidates::contours_apart).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// All contours.
    pub contours: usize,
    /// Those with an end that is not [`OUTSIDE`].
    pub inside: usize,
    /// Those of them with ends in different cells.
    pub apart: usize,
}

impl Tally {
    /// Counts a contour with ends in these cells; returns whether they differ, and one is not [`OUTSIDE`].
    #[inline(always)]
    pub(crate) fn count(&mut self, [a, b]: [i32; 2]) -> bool {
        let is_inside = a & b & OUTSIDE == 0;
        let is_apart = is_inside & ((a ^ b) & !OUTSIDE != 0);
        self.contours += 1;
        self.inside += usize::from(is_inside);
        self.apart += usize::from(is_apart);
        is_apart
    }
}

/// Chooses among contours.
pub(crate) trait Choice {
    /// Of 64 edges, from this one on, those of some contours that are chosen.
    fn of(&mut self, edge: usize, contours: u64) -> u64;

    /// Whether an edge that is a contour, if it is one, is chosen.
    #[inline(always)]
    fn has(&mut self, edge: usize, is_contour: bool) -> bool {
        self.of(edge, is_contour.into()) != 0
    }
}

/// Chooses all.
pub(crate) struct All;

impl Choice for All {
    #[inline(always)]
    fn of(&mut self, _: usize, contours: u64) -> u64 {
        contours
    }
}

/// Chooses those with ends in different cells.
pub(crate) struct Apart<'a> {
    pub(crate) divided: &'a Divided,
    /// The part's first edge.
    pub(crate) first: usize,
    /// Whether the others are chosen as well.
    pub(crate) all: bool,
    pub(crate) tally: Tally,
}

impl Choice for Apart<'_> {
    #[inline(always)]
    fn of(&mut self, edge: usize, contours: u64) -> u64 {
        let bits = |mask: &[u64]| Divided::bits(mask, edge - self.first);
        let apart = contours & bits(&self.divided.apart);
        self.tally.contours += contours.count_ones() as usize;
        self.tally.inside += (contours & bits(&self.divided.inside)).count_ones() as usize;
        self.tally.apart += apart.count_ones() as usize;
        if self.all { contours } else { apart }
    }
}
