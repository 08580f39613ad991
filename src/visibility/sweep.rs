use glam::DVec3;

use super::crossings::{Crossings, crossing};
use super::{Frame, Isolines};

/// A part of an isoline, inside one quadrant, that the receiver sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The isoline.
    pub line: usize,
    /// Its quadrant in the axes of [`Frame::axis`]; see [`Isolines`].
    pub quadrant: usize,
    /// Fraction of the quadrant where the part starts, in [0, 1].
    pub from: f64,
    /// Fraction where it ends, larger than `from`.
    pub to: f64,
}

/// What the sweep noticed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sweep {
    /// Isolines of which some part lies above the horizon.
    pub lines: usize,
    /// Halves of isolines on which W fell below zero, and isolines whose halves meet at the far corner with different W:
    /// failed bookkeeping.
    pub depth_alarms: usize,
}

/// Negative depth complexity over less than this length of an isoline (in fractions of a quadrant) is two crossings
/// at one place sorted by their rounding errors; a wrong base or a lost edge shows over whole intervals.
const TIE: f64 = 1e-9;

/// Follows the depth complexity W along both halves of every isoline, away from the spine, and reports where it is zero.
///
/// `base` is W on the spine at isoline `base_line`. Above the horizon only, where there is one; Nowrouzezahrai et al.
/// 2014, section 3.2, with W known from the start instead of shifted to a minimum of zero.
pub(super) fn sweep(
    isolines: &Isolines,
    frame: Frame,
    crossings: &Crossings,
    normal: Option<DVec3>,
    (base_line, base): (usize, i32),
    mut visible: impl FnMut(Interval),
) -> Sweep {
    let normal = normal.map(|n| frame.apply(n));
    let mut seen = Sweep::default();
    let mut follow = |line: usize, depth: i32| {
        let r = isolines.ratios()[line];
        // Without a horizon both halves end at the far corner.
        let ends = normal.map_or(Some([2.0; 2]), |n| horizon(n, r));
        let Some(ends) = ends else { return };
        seen.lines += 1;
        let mut last = [0; 2];
        for half in 0..2 {
            let mut emit = |from: f64, to: f64| emit(frame, line, half, from, to, &mut visible);
            let (w, lowest) = follow_half(crossings.along(line, half), ends[half], depth, &mut emit);
            seen.depth_alarms += usize::from(lowest < 0);
            last[half] = w;
        }
        seen.depth_alarms += usize::from(ends == [2.0; 2] && last[0] != last[1]);
    };
    let mut depth = base;
    follow(base_line, depth);
    for line in base_line + 1..isolines.len() {
        depth += crossings.spine(line);
        follow(line, depth);
    }
    depth = base;
    for line in (0..base_line).rev() {
        depth -= crossings.spine(line + 1);
        follow(line, depth);
    }
    seen
}

/// Follows W from `depth` along one half; returns W at its end and the lowest W over more than a tie's length.
fn follow_half(keys: &[u64], end: f64, mut depth: i32, emit: &mut impl FnMut(f64, f64)) -> (i32, i32) {
    let (mut from, mut lowest) = (0.0, 0);
    for &key in keys {
        let (s, jump) = crossing(key);
        // At the far corner itself crossings still count: the halves meet behind them.
        if s >= end && end < 2.0 {
            break;
        }
        if depth == 0 && s > from {
            emit(from, s);
        } else if depth < lowest && s - from > TIE {
            lowest = depth;
        }
        from = s;
        depth += jump;
    }
    if depth == 0 && end > from {
        emit(from, end);
    } else if depth < lowest && end - from > TIE {
        lowest = depth;
    }
    (depth, lowest)
}

/// Where the two halves of an isoline with ratio `r` sink below the horizon of normal `n` (in the chart's frame, facing
/// the spine); none if all of it lies below.
fn horizon(n: DVec3, r: f64) -> Option<[f64; 2]> {
    // What lies in the horizon to rounding counts as below it, a whole quadrant or a corner: contours there are clipped
    // either way.
    let level = 1e-12 * ((n.x * r).abs() + n.z);
    let spine = n.x * r + n.z;
    if spine <= level {
        return None;
    }
    let far = n.x * r - n.z;
    Some([1.0, -1.0].map(|side| {
        let fold = n.x * r + n.y * side;
        if fold <= level {
            spine / (spine - fold.min(0.0))
        } else if far <= level {
            (1.0 + fold / (fold - far.min(0.0))).min(2f64.next_down())
        } else {
            2.0
        }
    }))
}

/// Reports the part [from, to] of a half, cut at the fold, in quadrants before the frame's turns.
fn emit(frame: Frame, line: usize, half: usize, from: f64, to: f64, visible: &mut impl FnMut(Interval)) {
    for (leg, quadrant) in [[0, 1], [3, 2]][half].into_iter().enumerate() {
        let (from, to) = (from.max(leg as f64) - leg as f64, to.min(leg as f64 + 1.0) - leg as f64);
        if from < to {
            let quadrant = frame.quadrant(quadrant);
            let (from, to) = if half == 0 { (from, to) } else { (1.0 - to, 1.0 - from) };
            visible(Interval { line, quadrant, from, to });
        }
    }
}

/// The isoline next to u = 0 whose spine is above the horizon: where W is counted.
pub(super) fn base_line(isolines: &Isolines, frame: Frame, normal: Option<DVec3>) -> usize {
    let half = isolines.len() / 2;
    if normal.is_some_and(|n| frame.apply(n).x < 0.0) { half - 1 } else { half }
}
