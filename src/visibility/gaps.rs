use smallvec::SmallVec;

use super::chart::Chart;
use super::crossings::Crossings;
use super::spans::Spans;
use super::sweep::follow;

/// What is still uncovered of the isolines of one receiver, while one group of bodies after another is put before them.
///
/// The order does not matter: what is left in the end is where no group covers, cut at all crossings in it.
#[derive(Clone, Debug, Default)]
pub(super) struct Gaps {
    /// Where the gaps of each isoline begin and end, in turn and ascending.
    lines: Vec<SmallVec<[f64; 4]>>,
    /// Whether a group's depth complexity was negative, but for ties, or partners did not agree on it.
    has_failed: bool,
    /// Number of isolines with gaps before each one, twice around the sphere.
    open: Vec<u32>,
    /// Where a group leaves an isoline free.
    free: Vec<[f64; 2]>,
    /// A group's depth complexity where the isolines end, as far as it is known.
    finals: Vec<Option<i32>>,
}

impl Gaps {
    /// Everything above the [horizon](Chart::horizons).
    pub(super) fn reset<C: Chart>(&mut self, horizons: &[f64]) {
        self.lines.resize(horizons.len(), SmallVec::new());
        for (gaps, &horizon) in self.lines.iter_mut().zip(horizons) {
            gaps.clear();
            if horizon > C::START {
                gaps.extend_from_slice(&[C::START, horizon]);
            }
        }
        self.has_failed = false;
    }

    /// Whether the bookkeeping failed: a group's depth complexity was negative somewhere, or different at one place.
    pub(super) fn has_failed(&self) -> bool {
        self.has_failed
    }

    /// How many of the isolines before each one have gaps, twice around the sphere; nothing while all have.
    pub(super) fn open(&mut self) -> Option<&[u32]> {
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

    /// Calls `visit` with the gaps of all isolines: number of the isoline, begin and end.
    #[inline(always)]
    pub(super) fn each(&self, mut visit: impl FnMut(usize, f64, f64)) {
        for (line, gaps) in self.lines.iter().enumerate() {
            for gap in gaps.chunks_exact(2) {
                visit(line, gap[0], gap[1]);
            }
        }
    }

    /// Puts groups before the isolines that cover the place where W is counted `depth` times, with their crossings. Returns the number
    /// of isolines with gaps that they cross.
    pub(super) fn cover<C: Chart>(
        &mut self,
        chart: &C,
        crossings: &mut Crossings<C::Piece>,
        depth: i32,
        horizons: &[f64],
    ) -> usize {
        let crossed = crossings.lines();
        self.finals.clear();
        self.finals.resize(crossed.len(), None);
        let mut count = 0;
        for line in crossed.clone() {
            let gaps = &mut self.lines[line];
            if gaps.is_empty() {
                continue;
            }
            count += 1;
            self.free.clear();
            let base = depth + crossings.base(line);
            let end = follow::<C>(crossings.sorted(line), base, horizons[line], |from, to, depth| {
                self.free.push([from, to]);
                self.has_failed |= depth < 0 && C::are_apart(from, to);
            });
            *gaps = intersection(gaps, &self.free);
            self.finals[line - crossed.start] = Some(end);
            if let (true, Some(partner)) = (horizons[line] == C::END, chart.partner(line)) {
                // What is not crossed ends as it starts; of what is covered not all crossings are known.
                let other = match crossed.contains(&partner) {
                    true => self.finals[partner - crossed.start],
                    false => (!self.lines[partner].is_empty()).then(|| depth + crossings.base(partner)),
                };
                self.has_failed |= horizons[partner] == C::END && other.is_some_and(|other| other != end);
            }
        }
        if depth != 0 || !crossings.start_alike() {
            for line in (0..crossed.start).chain(crossed.end..horizons.len()) {
                let depth = depth + crossings.base(line);
                if depth > 0 {
                    self.lines[line].clear();
                }
                self.has_failed |= depth < 0 && !self.lines[line].is_empty();
            }
        }
        count
    }

    /// What is left.
    pub(super) fn finish<C: Chart>(&self, spans: &mut Spans) {
        spans.clear(self.lines.len());
        for gaps in &self.lines {
            spans.begin_line();
            for gap in gaps.chunks_exact(2) {
                spans.add::<C>(gap[0], gap[1]);
            }
        }
        spans.end();
    }
}

/// The parts of positive length that two ascending rows of intervals have in common.
#[inline(always)]
fn intersection(gaps: &[f64], free: &[[f64; 2]]) -> SmallVec<[f64; 4]> {
    let mut common = SmallVec::new();
    let mut free = free.iter();
    let Some(mut next) = free.next() else { return common };
    for gap in gaps.chunks_exact(2) {
        loop {
            let (from, to) = (gap[0].max(next[0]), gap[1].min(next[1]));
            if from < to {
                common.push(from);
                common.push(to);
            }
            if gap[1] < next[1] {
                break;
            }
            match free.next() {
                Some(later) => next = later,
                None => return common,
            }
        }
    }
    common
}
