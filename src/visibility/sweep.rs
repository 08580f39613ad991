use super::chart::{Chart, Outlook};
use super::crossings::{Crossings, crossing};
use super::spans::Spans;

/// Follows the depth complexity W along every isoline, from where it starts down to the [horizon](Chart::horizons), if there is one, and
/// notes where nothing is crossed; W is `depth` where it was counted. Returns the number of alarms: isolines on which W fell below
/// zero, and those on which it is another than on their [partner](Chart::partner) where both end.
///
/// Nowrouzezahrai et al. 2014, section 3.2, with W known from the start instead of shifted to a minimum of zero.
// Within its caller it is a fifth slower.
#[inline(never)]
pub(super) fn sweep<C: Chart>(
    outlook: Outlook<C>,
    crossings: &mut Crossings<C::Piece>,
    depth: i32,
    horizons: &[f64],
    spans: &mut Spans,
    finals: &mut Vec<i32>,
) -> usize {
    spans.clear(horizons.len());
    finals.clear();
    finals.resize(horizons.len(), 0);
    let mut alarms = 0;
    for (line, &horizon) in horizons.iter().enumerate() {
        spans.begin_line();
        let mut is_below = false;
        let base = depth + crossings.base(line);
        let end = follow::<C>(crossings.sorted(line), base, horizon, |from, to, depth| {
            is_below |= spans.add::<C>(from, to) && depth < 0;
        });
        let mut differs = false;
        if horizon == C::END {
            finals[line] = end;
            let partner = outlook.chart.partner(line).filter(|&partner| horizons[partner] == C::END);
            differs = partner.is_some_and(|partner| finals[partner] != end);
        }
        alarms += usize::from(is_below || differs);
    }
    spans.end();
    alarms
}

/// Follows W along one isoline up to `end`, and calls `visible` with every part between two crossings where it is not positive, and
/// with W. Returns W at the end.
#[inline(always)]
pub(super) fn follow<C: Chart>(keys: &[i64], mut depth: i32, end: f64, mut visible: impl FnMut(f64, f64, i32)) -> i32 {
    let mut from = C::START;
    for &key in keys {
        let (position, jump) = crossing(key);
        // Where all isolines end crossings still count.
        if position >= end && end < C::END {
            break;
        }
        if depth <= 0 {
            visible(from, position, depth);
        }
        (depth, from) = (depth + jump, position);
    }
    if depth <= 0 {
        visible(from, end, depth);
    }
    depth
}
