use super::IN_HORIZON;
use super::crossings::{Crossings, FARTHEST, Outlook, crossing};
use crate::visibility::Sweep;

/// The visible spans of all isolines of one receiver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spans {
    /// Number of ends before each isoline, with an end mark.
    pub(super) starts: Vec<u32>,
    /// Tangents of the latitudes where spans begin and end, in turn and ascending along each isoline.
    pub(super) ends: Vec<f64>,
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

    /// Tangents of the latitudes where visible spans begin and end, for all isolines one after another.
    pub fn ends(&self) -> &[f64] {
        &self.ends
    }

    /// Which of the ends belong to an isoline.
    pub fn of(&self, line: usize) -> std::ops::Range<usize> {
        self.starts[line] as usize..self.starts[line + 1] as usize
    }
}

/// Negative depth complexity over less than this angle is two crossings at one place sorted by their rounding errors; a wrong
/// base or a lost edge shows over whole spans.
pub(super) const TIE: f64 = 1e-9;

/// Follows the depth complexity W along every isoline, from `depth` at its start down to the horizon, if there is one, and notes
/// where nothing is crossed.
///
/// Nowrouzezahrai et al. 2014, section 3.2, with W known from the start instead of shifted to a minimum of zero.
pub(in crate::visibility) fn sweep(
    outlook: Outlook,
    crossings: &mut Crossings,
    depth: i32,
    spans: &mut Spans,
) -> Sweep {
    let Spans { starts, ends } = spans;
    starts.clear();
    ends.clear();
    let mut seen = Sweep { lines: outlook.meridians.len(), depth_alarms: 0 };
    let mut last = None;
    for (line, horizon) in horizons(outlook).enumerate() {
        starts.push(ends.len() as u32);
        let mut is_below = false;
        let end = follow(crossings.sorted(line), depth, horizon, ends, |_, _| is_below = true);
        // Whatever an isoline passes on its way around, all end in the same direction.
        let differs = outlook.normal.is_none() && *last.get_or_insert(end) != end;
        seen.depth_alarms += usize::from(is_below || differs);
    }
    starts.push(ends.len() as u32);
    seen
}

/// Tangents of the latitudes where the isolines meet the horizon, or end.
pub(super) fn horizons(outlook: Outlook) -> impl Iterator<Item = f64> {
    let Outlook { meridians, frame, normal, .. } = outlook;
    let normal = normal.map(|n| frame.apply(n));
    let lines = meridians.cos.iter().zip(&meridians.sin);
    lines.map(move |(cos, sin)| normal.map_or(Spans::POLE, |n| (n.x * cos + n.y * sin) / -n.z))
}

/// Angle between two latitudes on one isoline, or a bit less, by their tangents.
pub(super) fn angle(from: f64, to: f64) -> f64 {
    (to - from) / (1.0 + from.abs().min(to.abs()).powi(2))
}

/// Follows W along one isoline up to `end`, and adds where it is zero to `ends`; returns W there. Calls `below` with every part
/// over which it is negative, but for ties.
#[inline(always)]
pub(super) fn follow(
    keys: &[i64],
    mut depth: i32,
    end: f64,
    ends: &mut Vec<f64>,
    mut below: impl FnMut(f64, f64),
) -> i32 {
    let mut from = -Spans::POLE;
    let mut since = from;
    for &key in keys {
        let (tangent, jump) = crossing(key);
        // At the pole itself crossings still count.
        if tangent >= end && end < Spans::POLE {
            break;
        }
        if depth < 0 && angle(since, tangent) > TIE {
            below(since, tangent);
        }
        let next = depth + jump;
        match (depth <= 0, next <= 0) {
            (true, false) if tangent > from => ends.extend([from, tangent]),
            (false, true) => from = tangent,
            _ => {}
        }
        (depth, since) = (next, tangent);
    }
    if depth <= 0 && angle(from, end) > IN_HORIZON {
        ends.extend([from, end]);
    }
    if depth < 0 && angle(since, end) > TIE {
        below(since, end);
    }
    depth
}
