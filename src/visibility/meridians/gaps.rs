use smallvec::SmallVec;

use super::sweep::{are_apart, follow};
use super::{Crossings, Spans};

/// What is still uncovered of the isolines of one receiver, while one group of bodies after another is put before them.
///
/// The order does not matter: what is left in the end is where no group covers, cut at all crossings in it.
#[derive(Clone, Debug, Default)]
pub(in crate::visibility) struct Gaps {
    /// Tangents of the latitudes where the gaps of each isoline begin and end, in turn and ascending.
    lines: Vec<SmallVec<[f64; 4]>>,
    /// Whether a group's depth complexity was negative, but for ties.
    is_negative: bool,
    /// Number of isolines with gaps before each one, twice around the sphere.
    open: Vec<u32>,
    free: Vec<f64>,
    cut: Vec<f64>,
}

impl Gaps {
    /// Everything above the [horizon](super::horizons).
    pub(in crate::visibility) fn reset(&mut self, horizons: &[f64]) {
        self.lines.resize(horizons.len(), SmallVec::new());
        for (gaps, &horizon) in self.lines.iter_mut().zip(horizons) {
            gaps.clear();
            gaps.extend_from_slice(&[-Spans::POLE, horizon]);
        }
        self.is_negative = false;
    }

    /// Whether a group's depth complexity was negative somewhere: failed bookkeeping.
    pub(in crate::visibility) fn is_negative(&self) -> bool {
        self.is_negative
    }

    /// How many of the isolines before each one have gaps, twice around the sphere; nothing while all have.
    pub(in crate::visibility) fn open(&mut self) -> Option<&[u32]> {
        let lines = self.lines.len();
        self.open.resize(2 * lines + 1, 0);
        let (once, twice) = self.open.split_at_mut(lines);
        let mut count = 0;
        for (before, gaps) in once.iter_mut().zip(&self.lines) {
            *before = count;
            count += u32::from(!gaps.is_empty());
        }
        twice.iter_mut().zip(once).for_each(|(after, before)| *after = *before + count);
        twice[lines] = 2 * count;
        (count < lines as u32).then_some(&*self.open)
    }

    /// Number of gaps.
    pub(super) fn count(&self) -> usize {
        self.lines.iter().map(|gaps| gaps.len() / 2).sum()
    }

    /// The gaps of all isolines: number of the isoline, begin and end.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64, f64)> {
        let lines = self.lines.iter().enumerate();
        lines.flat_map(|(line, gaps)| gaps.chunks_exact(2).map(move |gap| (line, gap[0], gap[1])))
    }

    /// Puts groups before the isolines that cover their start `depth` times, with their crossings. Returns the number of isolines
    /// with gaps that they cross.
    pub(in crate::visibility) fn cover(&mut self, crossings: &mut Crossings, depth: i32, horizons: &[f64]) -> usize {
        let crossed = crossings.lines();
        if depth > 0 {
            let (before, rest) = self.lines.split_at_mut(crossed.start);
            let after = &mut rest[crossed.len()..];
            before.iter_mut().chain(after).for_each(SmallVec::clear);
        }
        let mut count = 0;
        for line in crossed {
            let gaps = &mut self.lines[line];
            if gaps.is_empty() {
                continue;
            }
            count += 1;
            self.free.clear();
            follow(crossings.sorted(line), depth, horizons[line], |from, to, depth| {
                self.free.extend([from, to]);
                self.is_negative |= depth < 0 && are_apart(from, to);
            });
            intersection(gaps, &self.free, &mut self.cut);
            gaps.clear();
            gaps.extend_from_slice(&self.cut);
        }
        count
    }

    /// What is left.
    pub(in crate::visibility) fn finish(&self, spans: &mut Spans) {
        spans.clear();
        for gaps in &self.lines {
            spans.begin_line();
            for gap in gaps.chunks_exact(2) {
                spans.add(gap[0], gap[1]);
            }
        }
        spans.end();
    }
}

/// The parts of positive length that two ascending rows of intervals have in common.
fn intersection(a: &[f64], b: &[f64], out: &mut Vec<f64>) {
    out.clear();
    let (mut i, mut j) = (0, 0);
    while i < a.len() && j < b.len() {
        let (from, to) = (a[i].max(b[j]), a[i + 1].min(b[j + 1]));
        if from < to {
            out.extend([from, to]);
        }
        if a[i + 1] < b[j + 1] {
            i += 2;
        } else {
            j += 2;
        }
    }
}
