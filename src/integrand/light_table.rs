use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::Environment;
use crate::visibility::{Interval, Isolines, cycle};

/// Summed-area tables of light times the linear harmonics along u-isolines: with them the vector irradiance of any
/// visible interval is the difference of two entries.
///
/// Nine numbers a cell (three colours, three axes), summed along each quadrant of each isoline's slab, in f64: a look-up
/// subtracts before anything is narrowed. Every patch of light is counted once and whole, so that the table's total is the
/// environment's vector irradiance to rounding for any number of isolines; inside a cell light is taken to be even.
#[derive(Clone, Debug)]
pub struct LightTable {
    lines: usize,
    cells: usize,
    /// Slabs that tell the error, for each axis.
    samples: [Vec<Sample>; 3],
    /// One table for each axis along which isolines may follow one another.
    axes: [Vec<[f64; 9]>; 3],
}

/// A slab that stands for so many.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sample {
    line: usize,
    weight: f64,
}

/// Slabs that tell the error: the brightest, and as many of the rest.
const BRIGHT: usize = 16;

/// Standard deviation of the share of a cell's light that lies before a place in it, from an even share, if all of the light
/// is at one place and both are anywhere: the root of a sixth.
const UNEVEN: f64 = 0.408;

/// Largest memory of a table for one axis, bytes.
const MEMORY: usize = 1 << 28;

/// Most rows of patches that an image is cut into, if it has not more itself: the time they take grows with the square.
const MOST_ROWS: usize = 3 << 12;

impl LightTable {
    /// Sums up the light of an environment, each of its pixels cut into patches a few times smaller than the distance of
    /// the isolines.
    pub fn new(isolines: &Isolines, environment: &Environment) -> Self {
        let lines = isolines.len();
        let most = MEMORY / (lines * 4 * size_of::<[f64; 9]>());
        let cells = (lines / 2).max(64).min(most.max(16));
        let mut axes = [(); 3].map(|()| vec![[0.0; 9]; lines * 4 * (cells + 1)]);
        let patches = (3 * lines).min(MOST_ROWS).div_ceil(environment.height());
        axes.par_iter_mut().enumerate().for_each(|(axis, sums)| {
            for (moment, radiance) in environment.patches(patches) {
                let added: [f64; 9] = std::array::from_fn(|i| f64::from(radiance[i / 3]) * moment[i % 3]);
                let (arc, fraction) = place(lines, cycle(moment, axis));
                let cell = ((fraction * cells as f64) as usize).min(cells - 1);
                let sum = &mut sums[arc * (cells + 1) + cell + 1];
                sum.iter_mut().zip(added).for_each(|(sum, added)| *sum += added);
            }
            for arc in sums.chunks_mut(cells + 1) {
                let mut total = [0.0; 9];
                for sum in arc {
                    for (total, sum) in total.iter_mut().zip(sum) {
                        *total += *sum;
                        *sum = *total;
                    }
                }
            }
        });
        let samples = axes.each_ref().map(|sums| {
            let light = |line: usize| {
                let totals = (0..4).map(|quadrant| &sums[(line * 4 + quadrant + 1) * (cells + 1) - 1]);
                totals.flatten().map(|total| total.abs()).sum::<f64>()
            };
            samples((0..lines).map(light).collect())
        });
        Self { lines, cells, samples, axes }
    }

    /// The light of line `line` in the quadrant and between the fractions of an interval, times `factor`, added to `out`.
    #[inline(always)]
    fn add(&self, axis: usize, line: usize, interval: Interval, factor: f64, out: &mut [f64; 9]) {
        for (end, factor) in [(interval.to, factor), (interval.from, -factor)] {
            if end == 0.0 {
                continue;
            }
            let ([lows, highs], part) = self.cell(axis, line, interval.quadrant, end);
            for (out, (low, high)) in out.iter_mut().zip(lows.iter().zip(highs)) {
                *out += factor * (low + (high - low) * part);
            }
        }
    }

    /// The squares of the light in the cells in which an interval begins and ends, times `factor`, added to `out`.
    fn add_squares(&self, axis: usize, line: usize, interval: Interval, factor: f64, out: &mut [f64; 9]) {
        for end in [interval.from, interval.to] {
            let ([lows, highs], _) = self.cell(axis, line, interval.quadrant, end);
            for (out, (low, high)) in out.iter_mut().zip(lows.iter().zip(highs)) {
                *out += factor * (high - low).powi(2);
            }
        }
    }

    /// The sums before and behind the cell in which a fraction of a quadrant lies, and how far along the cell.
    #[inline(always)]
    fn cell(&self, axis: usize, line: usize, quadrant: usize, fraction: f64) -> ([&[f64; 9]; 2], f64) {
        let arc = &self.axes[axis][(line * 4 + quadrant) * (self.cells + 1)..][..self.cells + 1];
        let at = fraction * self.cells as f64;
        let cell = (at as usize).min(self.cells - 1);
        ([&arc[cell], &arc[cell + 1]], at - cell as f64)
    }
}

/// Chooses slabs by the light of each: the brightest stand for themselves, others for the rest.
fn samples(light: Vec<f64>) -> Vec<Sample> {
    let mut bright: Vec<usize> = (0..light.len()).collect();
    bright.sort_by(|&a, &b| light[b].total_cmp(&light[a]).then(a.cmp(&b)));
    let mut rest = bright.split_off(BRIGHT.min(bright.len()));
    rest.sort_unstable();
    let taken = BRIGHT.min(rest.len());
    let weight = rest.len() as f64 / taken.max(1) as f64;
    let others = (0..taken).map(|i| Sample { line: rest[(2 * i + 1) * rest.len() / (2 * taken)], weight });
    let mut samples: Vec<Sample> = bright.into_iter().map(|line| Sample { line, weight: 1.0 }).chain(others).collect();
    samples.sort_unstable_by_key(|sample| sample.line);
    samples
}

/// The arc (isoline and quadrant) whose slab holds a direction, and how far along it the direction lies.
fn place(lines: usize, w: DVec3) -> (usize, f64) {
    let norm = w.x.abs() + w.y.abs() + w.z.abs();
    let line = (((w.x / norm + 1.0) * 0.5 * lines as f64) as usize).min(lines - 1);
    let fraction = w.y.abs() / (w.y.abs() + w.z.abs());
    let (quadrant, fraction) = match (w.y >= 0.0, w.z >= 0.0) {
        (true, true) => (0, fraction),
        (true, false) => (1, 1.0 - fraction),
        (false, false) => (2, fraction),
        (false, true) => (3, 1.0 - fraction),
    };
    (line * 4 + quadrant, fraction)
}

/// What one receiver's visible intervals add up to. Keep it and use it again: its memory is reused.
#[derive(Clone, Debug, Default)]
pub struct LightMoments {
    sum: [f64; 9],
    /// The intervals, those of a line side by side, and where each line's are.
    intervals: Vec<Interval>,
    of_line: Vec<Range<usize>>,
}

impl LightMoments {
    /// Forgets everything, and makes room for the lines of a table.
    pub fn clear(&mut self, table: &LightTable) {
        self.sum = [0.0; 9];
        self.intervals.clear();
        self.of_line.clear();
        self.of_line.resize(table.lines, 0..0);
    }

    /// Adds a visible interval of an isoline, which follow one another along the axis numbered `axis`. A line's come one after
    /// another.
    pub fn add(&mut self, table: &LightTable, axis: usize, interval: Interval) {
        table.add(axis, interval.line, interval, 1.0, &mut self.sum);
        let of_line = &mut self.of_line[interval.line];
        if of_line.start == of_line.end {
            *of_line = self.intervals.len()..self.intervals.len();
        }
        self.intervals.push(interval);
        of_line.end = self.intervals.len();
    }

    /// Vector irradiance of each colour, integral of L V w.
    pub fn vectors(&self) -> [DVec3; 3] {
        [0, 3, 6].map(|i| DVec3::from_slice(&self.sum[i..i + 3]))
    }

    /// The error to expect of each number of [`LightMoments::vectors`]: every other slab under the mean of what its neighbours'
    /// isolines see, and light that is uneven inside the cells where intervals end. From the slabs in which most of the light is
    /// and a sample of the others.
    pub fn errors(&self, table: &LightTable, axis: usize) -> [DVec3; 3] {
        let (mut sums, mut squares) = ([0.0; 9], [0.0; 9]);
        for &Sample { line, weight } in &table.samples[axis] {
            let mut difference = [0.0; 9];
            let inner = line > 0 && line + 1 < table.lines;
            let share = if inner { -0.5 } else { -1.0 };
            let neighbours = [line.wrapping_sub(1), line + 1].into_iter().filter(|&other| other < table.lines);
            for (from, factor) in neighbours.map(|other| (other, share)).chain([(line, 1.0)]) {
                for &interval in &self.intervals[self.of_line[from].clone()] {
                    table.add(axis, line, interval, factor, &mut difference);
                }
            }
            let sign = if line % 2 == 0 { weight } else { -weight };
            for ((sum, square), difference) in sums.iter_mut().zip(&mut squares).zip(difference) {
                *sum += sign * difference;
                *square += weight * difference * difference;
            }
            for &interval in &self.intervals[self.of_line[line].clone()] {
                table.add_squares(axis, line, interval, weight * UNEVEN * UNEVEN, &mut squares);
            }
        }
        // What the slabs have in common, and what they have not. Both halves of the isolines are looked at.
        let error = |(sum, square): (&f64, &f64)| 0.25 * sum * sum + 0.5 * square;
        [0, 3, 6].map(|i| DVec3::from_array([i, i + 1, i + 2].map(|i| error((&sums[i], &squares[i])).sqrt())))
    }
}
