//! Edges divided by where their ends are, and the contours among them.

use crate::candidates::{CandidateEdge, room};
use crate::ends::LANES;

/// Marks the cells outside of those of interest: the bit of their numbers above all that count.
pub const OUTSIDE: i32 = 1 << 30;

/// Cells of this number and beyond do not fit into tables.
#[cfg(target_arch = "x86_64")]
pub(crate) const CELLS: i32 = 1 << 15;

/// Which of a part's edges have their ends in different cells, at least one of them not [`OUTSIDE`], and which have such an end at all:
/// see [`Candidates::divide`](crate::Candidates::divide). Keep it and use it again: its memory is reused.
#[derive(Clone, Debug, Default)]
pub struct Divided {
    // A bit each, from the part's first edge on. Buffers may be longer than what they hold.
    pub(crate) apart: Vec<u64>,
    pub(crate) inside: Vec<u64>,
}

impl Divided {
    /// Makes room for so many words.
    pub(crate) fn room(&mut self, words: usize) {
        // One more, so that 64 bits can be taken from anywhere.
        room(&mut self.apart, words + 1);
        room(&mut self.inside, words + 1);
    }

    /// Divides edges one by one.
    #[inline(always)]
    pub(crate) fn fill(&mut self, edges: &[CandidateEdge], cells: &[i32]) {
        self.room(edges.len().div_ceil(LANES));
        let masks = self.apart.iter_mut().zip(&mut self.inside);
        for (edges, (apart, inside)) in edges.chunks(LANES).zip(masks) {
            (*apart, *inside) = (0, 0);
            for (bit, edge) in edges.iter().enumerate() {
                let [a, b] = [edge.a, edge.b].map(|end| cells[end as usize]);
                let is_inside = a & b & OUTSIDE == 0;
                *inside |= u64::from(is_inside) << bit;
                *apart |= u64::from(is_inside & ((a ^ b) & !OUTSIDE != 0)) << bit;
            }
        }
    }
}

/// What was found among divided edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// All contours.
    pub contours: usize,
    /// Those with an end that is not [`OUTSIDE`].
    pub inside: usize,
    /// Those of them with ends in different cells.
    pub apart: usize,
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
        let (word, bit) = ((edge - self.first) / LANES, (edge - self.first) % LANES);
        let bits = |mask: &[u64]| mask[word] >> bit | mask[word + 1] << 1 << (LANES - 1 - bit);
        let apart = contours & bits(&self.divided.apart);
        self.tally.contours += contours.count_ones() as usize;
        self.tally.inside += (contours & bits(&self.divided.inside)).count_ones() as usize;
        self.tally.apart += apart.count_ones() as usize;
        if self.all { contours } else { apart }
    }
}
