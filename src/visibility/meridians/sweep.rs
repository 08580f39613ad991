use super::crossings::{Crossings, FARTHEST, Outlook, crossing};
use crate::visibility::Sweep;

/// The visible spans of all isolines of one receiver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spans {
    /// Number of ends before each isoline, with an end mark.
    starts: Vec<u32>,
    /// Tangents of the latitudes where spans begin and end, in turn and ascending along each isoline.
    ends: Vec<f64>,
}

impl Spans {
    /// Tangent of the latitude that stands for a pole; its negative for the other.
    pub const POLE: f64 = FARTHEST;

    /// The given spans of each isoline.
    pub fn new(lines: &[&[(f64, f64)]]) -> Self {
        let mut spans = Self { starts: vec![0], ends: Vec::new() };
        for line in lines {
            spans.ends.extend(line.iter().flat_map(|&(from, to)| [from, to]));
            spans.starts.push(spans.ends.len() as u32);
        }
        spans
    }

    pub(super) fn clear(&mut self) {
        self.starts.clear();
        self.ends.clear();
    }

    /// What is added from now on belongs to the next isoline.
    pub(super) fn begin_line(&mut self) {
        self.starts.push(self.ends.len() as u32);
    }

    /// Adds a part beyond all others of its isoline, unless it is a tie; returns whether it is none. Parts without anything between
    /// them become one.
    #[inline(always)]
    pub(super) fn add(&mut self, from: f64, to: f64) -> bool {
        let is_apart = are_apart(from, to);
        if is_apart {
            let first = self.starts.last().map_or(0, |&start| start as usize);
            match self.ends[first..].last_mut() {
                Some(last) if *last == from => *last = to,
                _ => self.ends.extend([from, to]),
            }
        }
        is_apart
    }

    pub(super) fn end(&mut self) {
        self.begin_line();
    }

    /// Tangents of the latitudes where visible spans begin and end, for all isolines one after another.
    pub fn ends(&self) -> &[f64] {
        &self.ends
    }

    /// Which of the ends belong to an isoline.
    pub fn of(&self, line: usize) -> std::ops::Range<usize> {
        self.starts[line] as usize..self.starts[line + 1] as usize
    }
}

/// Crossings within this angle of each other may have been sorted by their rounding errors, and W between them may be wrong by
/// one or the other surface: nothing is seen there, nor is it an alarm if W is negative. A wrong base or a lost edge shows over
/// whole spans.
const TIE: f64 = 1e-9;

/// Follows the depth complexity W along every isoline, from `depth` at its start down to the [horizon](horizons), if there is one, and notes
/// where nothing is crossed.
///
/// Nowrouzezahrai et al. 2014, section 3.2, with W known from the start instead of shifted to a minimum of zero.
pub(in crate::visibility) fn sweep(
    outlook: Outlook,
    crossings: &mut Crossings,
    depth: i32,
    horizons: &[f64],
    spans: &mut Spans,
) -> Sweep {
    spans.clear();
    let mut seen = Sweep { lines: outlook.meridians.len(), depth_alarms: 0 };
    let mut last = None;
    for (line, &horizon) in horizons.iter().enumerate() {
        spans.begin_line();
        let mut is_below = false;
        let end = follow(crossings.sorted(line), depth, horizon, |from, to, depth| {
            is_below |= spans.add(from, to) && depth < 0;
        });
        // Whatever an isoline passes on its way around, all end in the same direction.
        let differs = outlook.normal.is_none() && *last.get_or_insert(end) != end;
        seen.depth_alarms += usize::from(is_below || differs);
    }
    spans.end();
    seen
}

/// Tangents of the latitudes where the isolines meet the horizon, or end.
pub(in crate::visibility) fn horizons(outlook: Outlook, out: &mut Vec<f64>) {
    let Outlook { meridians, frame, normal, .. } = outlook;
    let lines = meridians.len();
    out.resize(lines, 0.0);
    let Some(n) = normal.map(|n| frame.apply(n)) else { return out.fill(Spans::POLE) };
    let (cos, sin) = (&meridians.cos[..lines], &meridians.sin[..lines]);
    for (line, out) in out.iter_mut().enumerate() {
        *out = (n.x * cos[line] + n.y * sin[line]) / -n.z;
    }
}

/// Whether two latitudes on one isoline, by their tangents, are further apart than ties are.
#[inline(always)]
pub(super) fn are_apart(from: f64, to: f64) -> bool {
    to - from > TIE * (1.0 + from.abs().min(to.abs()).powi(2))
}

/// Follows W along one isoline up to `end`, and calls `visible` with every part between two crossings where it is not positive, and
/// with W. Returns W at the end.
#[inline(always)]
pub(super) fn follow(keys: &[i64], mut depth: i32, end: f64, mut visible: impl FnMut(f64, f64, i32)) -> i32 {
    let mut from = -Spans::POLE;
    for &key in keys {
        let (tangent, jump) = crossing(key);
        // At the pole itself crossings still count.
        if tangent >= end && end < Spans::POLE {
            break;
        }
        if depth <= 0 {
            visible(from, tangent, depth);
        }
        (depth, from) = (depth + jump, tangent);
    }
    if depth <= 0 {
        visible(from, end, depth);
    }
    depth
}
