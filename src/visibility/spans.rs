use super::chart::Chart;

/// The visible spans of all isolines of one receiver.
///
/// Positions on isolines, where spans begin and end, depend on the chart. On meridians they are tangents of the latitude. Octahedral
/// isolines are halves, followed from the spine: all those on the side of the frame's y before the others; from 0 to 1 runs the
/// fraction of the quadrant at the spine, from 1 to 2 one more than that of the quadrant beyond.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spans {
    /// Number of ends before each isoline, with an end mark.
    starts: Vec<u32>,
    /// Where spans begin and end, in turn and ascending along each isoline.
    ends: Vec<f64>,
}

impl Spans {
    /// The given spans of each isoline.
    pub fn new(lines: &[&[(f64, f64)]]) -> Self {
        let mut spans = Self { starts: vec![0], ends: Vec::new() };
        for line in lines {
            spans.ends.extend(line.iter().flat_map(|&(from, to)| [from, to]));
            spans.starts.push(spans.ends.len() as u32);
        }
        spans
    }

    /// Forgets all, and makes room for so many isolines.
    pub(super) fn clear(&mut self, lines: usize) {
        self.starts.clear();
        self.starts.reserve(lines + 1);
        self.ends.clear();
        self.ends.reserve(2 * lines);
    }

    /// What is added from now on belongs to the next isoline.
    #[inline(always)]
    pub(super) fn begin_line(&mut self) {
        self.starts.push(self.ends.len() as u32);
    }

    /// Adds a part beyond all others of its isoline, unless it is a tie; returns whether it is none. Parts without anything between
    /// them become one.
    #[inline(always)]
    pub(super) fn add<C: Chart>(&mut self, from: f64, to: f64) -> bool {
        let is_apart = C::are_apart(from, to);
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

    /// Where visible spans begin and end, for all isolines one after another.
    pub fn ends(&self) -> &[f64] {
        &self.ends
    }

    /// Which of the ends belong to an isoline.
    pub fn of(&self, line: usize) -> std::ops::Range<usize> {
        self.starts[line] as usize..self.starts[line + 1] as usize
    }
}
