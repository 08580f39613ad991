use smallvec::SmallVec;

use super::sweep::{TIE, angle, follow, horizons};
use super::{Crossings, Outlook, Spans};
use crate::visibility::Sweep;

/// What is still uncovered of the isolines of one receiver, while one group of bodies after another is put before them.
///
/// The order does not matter: what is left in the end is where no group covers, and its ends are crossings as they are.
#[derive(Clone, Debug, Default)]
pub(in crate::visibility) struct Gaps {
    /// Tangents of the latitudes where the gaps of each isoline begin and end, in turn and ascending.
    lines: Vec<SmallVec<[f64; 4]>>,
    /// Where the isolines meet the horizon.
    horizons: Vec<f64>,
    /// Whether all that happens is followed on covered isolines, too: without a horizon all end in one direction.
    is_sphere: bool,
    /// Where a group's depth complexity was negative: isoline, begin and end.
    negative: Vec<(usize, f64, f64)>,
    /// Isolines at whose end a group's depth complexity was another than at the other ends.
    differing: usize,
    /// Number of isolines with gaps before each one, twice around the sphere.
    open: Vec<u32>,
    free: Vec<f64>,
    cut: Vec<f64>,
}

impl Gaps {
    /// Everything above the horizon.
    pub(in crate::visibility) fn reset(&mut self, outlook: Outlook) {
        self.horizons.clear();
        self.horizons.extend(horizons(outlook));
        let count = self.horizons.len();
        self.lines.resize(count, SmallVec::new());
        for (gaps, &horizon) in self.lines.iter_mut().zip(&self.horizons) {
            gaps.clear();
            gaps.extend_from_slice(&[-Spans::POLE, horizon]);
        }
        self.is_sphere = outlook.normal.is_none();
        self.negative.clear();
        self.differing = 0;
    }

    /// How many of the isolines before each one have gaps, twice around the sphere; nothing while that makes no difference.
    pub(in crate::visibility) fn open(&mut self) -> Option<&[u32]> {
        if self.is_sphere {
            return None;
        }
        let mut count = 0;
        self.open.clear();
        self.open.extend(self.lines.iter().chain(&self.lines).map(|gaps| {
            let before = count;
            count += u32::from(!gaps.is_empty());
            before
        }));
        self.open.push(count);
        (count < 2 * self.lines.len() as u32).then_some(&*self.open)
    }

    /// The gaps of all isolines: number of the isoline, begin and end.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64, f64)> {
        let lines = self.lines.iter().enumerate();
        lines.flat_map(|(line, gaps)| gaps.chunks_exact(2).map(move |gap| (line, gap[0], gap[1])))
    }

    /// Puts a group before the isolines that covers their start `depth` times, with its crossings.
    pub(in crate::visibility) fn cover(&mut self, crossings: &mut Crossings, depth: i32) {
        let crossed = crossings.lines();
        if depth > 0 {
            let (before, rest) = self.lines.split_at_mut(crossed.start);
            let after = &mut rest[crossed.len()..];
            before.iter_mut().chain(after).for_each(SmallVec::clear);
        }
        let mut last = (crossed.len() < self.lines.len()).then_some(depth);
        for line in crossed {
            if self.lines[line].is_empty() && !self.is_sphere {
                continue;
            }
            self.free.clear();
            let negative = |from: f64, to: f64| self.negative.push((line, from, to));
            let end = follow(crossings.sorted(line), depth, self.horizons[line], &mut self.free, negative);
            self.differing += usize::from(self.is_sphere && *last.get_or_insert(end) != end);
            let gaps = &mut self.lines[line];
            if gaps.is_empty() {
                continue;
            }
            intersection(gaps, &self.free, &mut self.cut);
            gaps.clear();
            gaps.extend_from_slice(&self.cut);
        }
    }

    /// What is left, and what was noticed: only what is left tells whether a negative depth complexity does any harm.
    pub(in crate::visibility) fn finish(&self, spans: &mut Spans) -> Sweep {
        let Spans { starts, ends } = spans;
        starts.clear();
        ends.clear();
        for gaps in &self.lines {
            starts.push(ends.len() as u32);
            ends.extend_from_slice(gaps);
        }
        starts.push(ends.len() as u32);
        let harms = |&&(line, from, to): &&(usize, f64, f64)| {
            self.lines[line].chunks_exact(2).any(|gap| angle(from.max(gap[0]), to.min(gap[1])) > TIE)
        };
        let depth_alarms = self.differing + self.negative.iter().filter(harms).count();
        Sweep { lines: self.lines.len(), depth_alarms }
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
