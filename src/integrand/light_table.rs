use dual_bvh::prefetch;
use glam::DVec3;
use rayon::prelude::*;

use super::light_patches::Patches;
use crate::scene::Environment;
use crate::visibility::{Frame, Isolines, Spans};

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
    /// One table for each axis along which isolines may follow one another: by quadrant, then by cell, then by isoline. Where spans
    /// end changes little from one isoline to the next, so that they find their neighbours' memory near. Behind them, by quadrant,
    /// the light of whole quadrants, summed up over the isolines before each one.
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
        let size = 4 * lines * (cells + 1);
        let mut axes = [(); 3].map(|()| vec![[0.0; 9]; size + 4 * (lines + 1)]);
        let split = (3 * lines).min(MOST_ROWS).div_ceil(environment.height());
        let longitudes = environment.patch_longitudes(split);
        let mut block = vec![Patches::default(); BLOCK];
        let rows = environment.height() * split;
        for first in (0..rows).step_by(BLOCK) {
            let block = &mut block[..BLOCK.min(rows - first)];
            block.par_iter_mut().enumerate().for_each(|(i, patches)| {
                patches.take(environment.patch_row(split, first + i, longitudes.clone()));
                patches.place(lines, cells);
            });
            axes.par_iter_mut().enumerate().for_each(|(axis, sums)| {
                for Patches { moments: [x, y, z], radiance, places } in &*block {
                    for (i, &place) in places[axis].iter().enumerate() {
                        let moment = [x[i], y[i], z[i]];
                        let added = std::array::from_fn(|k| f64::from(radiance[i][k / 3]) * moment[k % 3]);
                        accumulate(&mut sums[place as usize], &added);
                    }
                }
            });
        }
        axes.par_iter_mut().for_each(|sums| {
            let (sums, wholes) = sums.split_at_mut(size);
            for (sums, wholes) in sums.chunks_mut(lines * (cells + 1)).zip(wholes.chunks_mut(lines + 1)) {
                for cell in 1..=cells {
                    let (before, here) = sums[(cell - 1) * lines..].split_at_mut(lines);
                    here.iter_mut().zip(before).for_each(|(sum, before)| accumulate(sum, before));
                }
                for line in 0..lines {
                    wholes[line + 1] = wholes[line];
                    accumulate(&mut wholes[line + 1], &sums[lines * cells + line]);
                }
            }
        });
        let samples = axes.each_ref().map(|sums| {
            let light = |line: usize| {
                let totals = (0..4).map(|quadrant| &sums[(quadrant * (cells + 1) + cells) * lines + line]);
                totals.flatten().map(|total| total.abs()).sum::<f64>()
            };
            samples((0..lines).map(light).collect())
        });
        Self { lines, cells, samples, axes }
    }

    /// Adds up the light of visible spans of isolines in this frame.
    pub fn integrate(&self, frame: Frame, spans: &Spans, moments: &mut LightMoments) {
        let (axis, rows) = (frame.axis(), &mut moments.rows);
        rows.clear();
        rows.reserve(2 * spans.ends().len());
        for half in 0..2 {
            let quadrants = quadrants(frame, half);
            // Whole quadrants of neighbouring isolines are added at once.
            let mut runs = [None; 2];
            for line in 0..=self.lines {
                let whole = if line == self.lines {
                    [false; 2]
                } else {
                    cut(half, self.ends(spans, half, line), |leg, end, sign| {
                        self.look_up(axis, line, quadrants[leg], end, sign, rows);
                    })
                };
                for ((run, whole), quadrant) in runs.iter_mut().zip(whole).zip(quadrants) {
                    match *run {
                        None if whole => *run = Some(line),
                        Some(first) if !whole => {
                            let before = |line| (self.size() + quadrant * (self.lines + 1) + line) as u32;
                            rows.push(Row { row: before(line), weight: 1.0 });
                            rows.push(Row { row: before(first), weight: -1.0 });
                            *run = None;
                        }
                        _ => {}
                    }
                }
            }
        }
        moments.sum = self.add(axis, rows);
    }

    /// The error to expect of each number of [`LightMoments::vectors`] for the same spans: every other slab under the mean of what its
    /// neighbours' isolines see, and light that is uneven inside the cells where intervals end. From the slabs in which most of
    /// the light is and a sample of the others.
    pub fn errors(&self, frame: Frame, spans: &Spans, moments: &mut LightMoments) -> [DVec3; 3] {
        let LightMoments { rows, bounds, .. } = moments;
        rows.clear();
        bounds.clear();
        let axis = frame.axis();
        let samples = &*self.samples[axis];
        for &Sample { line, .. } in samples {
            let inner = line > 0 && line + 1 < self.lines;
            let share = if inner { -0.5 } else { -1.0 };
            let neighbours = [line.wrapping_sub(1), line + 1].into_iter().filter(|&other| other < self.lines);
            for (from, factor) in neighbours.map(|other| (other, share)).chain([(line, 1.0)]) {
                for half in 0..2 {
                    let quadrants = quadrants(frame, half);
                    let whole = cut(half, self.ends(spans, half, from), |leg, end, sign| {
                        self.look_up(axis, line, quadrants[leg], end, sign * factor, rows);
                    });
                    for (quadrant, _) in quadrants.into_iter().zip(whole).filter(|(_, whole)| *whole) {
                        let (row, _) = self.cell(line, quadrant, 1.0);
                        rows.push(Row { row: (row + self.lines) as u32, weight: factor });
                    }
                }
            }
            bounds.push(rows.len());
        }
        let (mut sums, mut squares) = ([0.0; 9], [0.0; 9]);
        let mut first = 0;
        for (&Sample { line, weight }, &last) in samples.iter().zip(&*bounds) {
            let difference = self.add(axis, &rows[std::mem::replace(&mut first, last)..last]);
            let sign = if line % 2 == 0 { weight } else { -weight };
            for ((sum, square), difference) in sums.iter_mut().zip(&mut squares).zip(difference) {
                *sum += sign * difference;
                *square += weight * difference * difference;
            }
            for half in 0..2 {
                let quadrants = quadrants(frame, half);
                cut(half, self.ends(spans, half, line), |leg, end, _| {
                    let (row, _) = self.cell(line, quadrants[leg], end);
                    let [low, high] = [row, row + self.lines].map(|row| &self.axes[axis][row]);
                    for (square, (low, high)) in squares.iter_mut().zip(low.iter().zip(high)) {
                        *square += weight * UNEVEN * UNEVEN * (high - low).powi(2);
                    }
                });
            }
        }
        // What the slabs have in common, and what they have not. Both halves of the isolines are looked at.
        let error = |(sum, square): (&f64, &f64)| 0.25 * sum * sum + 0.5 * square;
        [0, 3, 6].map(|i| DVec3::from_array([i, i + 1, i + 2].map(|i| error((&sums[i], &squares[i])).sqrt())))
    }

    /// Number of sums along isolines.
    fn size(&self) -> usize {
        4 * self.lines * (self.cells + 1)
    }

    /// Ends of the spans of one half of an isoline.
    #[inline(always)]
    fn ends<'s>(&self, spans: &'s Spans, half: usize, line: usize) -> &'s [f64] {
        &spans.ends()[spans.of(half * self.lines + line)]
    }

    /// Adds the weighted rows that give the light of a quadrant up to a fraction, in the slab of an isoline, times `factor`, and asks for
    /// their memory: it is far away, and comes while others are looked up.
    #[inline(always)]
    fn look_up(&self, axis: usize, line: usize, quadrant: usize, fraction: f64, factor: f64, rows: &mut Vec<Row>) {
        let (row, part) = self.cell(line, quadrant, fraction);
        let weighted = [(row, 1.0 - part), (row + self.lines, part)];
        rows.extend(weighted.map(|(row, weight)| {
            prefetch(&self.axes[axis][row]);
            Row { row: row as u32, weight: factor * weight }
        }));
    }

    /// The row of the sums before the cell in which a fraction of a quadrant lies, and how far along the cell. The next cell's
    /// row is so many further as there are lines.
    #[inline(always)]
    fn cell(&self, line: usize, quadrant: usize, fraction: f64) -> (usize, f64) {
        let at = fraction * self.cells as f64;
        let cell = (at as usize).min(self.cells - 1);
        ((quadrant * (self.cells + 1) + cell) * self.lines + line, at - cell as f64)
    }

    /// The weighted sum of rows.
    fn add(&self, axis: usize, rows: &[Row]) -> [f64; 9] {
        let table = &*self.axes[axis];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { add_avx2(table, rows) };
        }
        add_inline(table, rows)
    }
}

/// A row of a table, to be added so often.
#[derive(Clone, Copy, Debug)]
struct Row {
    row: u32,
    weight: f64,
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn add_avx2(table: &[[f64; 9]], rows: &[Row]) -> [f64; 9] {
    add_inline(table, rows)
}

#[inline(always)]
fn add_inline(table: &[[f64; 9]], rows: &[Row]) -> [f64; 9] {
    let mut sum = [0.0; 9];
    for &Row { row, weight } in rows {
        let row = &table[row as usize];
        for i in 0..9 {
            sum[i] += weight * row[i];
        }
    }
    sum
}

/// The quadrants of one half of an isoline, at the spine and beyond.
fn quadrants(frame: Frame, half: usize) -> [usize; 2] {
    [[0, 1], [3, 2]][half].map(|quadrant| frame.quadrant(quadrant))
}

/// Light of spans of half an isoline from sums that begin where its quadrants do: calls `sum` with the numbers of quadrants, fractions of
/// them, and whether the sum up to there is to be added or subtracted (1 or -1). Returns which whole quadrants are to be added.
#[inline(always)]
fn cut(half: usize, ends: &[f64], mut sum: impl FnMut(usize, f64, f64)) -> [bool; 2] {
    let mut whole = [false; 2];
    for span in ends.chunks_exact(2) {
        let (from, to) = (span[0], span[1]);
        let [near, far] = match half {
            0 => [(from < 1.0) & (to >= 1.0), to == 2.0],
            _ => [from == 0.0, (from <= 1.0) & (to > 1.0)],
        };
        whole = [whole[0] | near, whole[1] | far];
        for (end, sign) in [(to, 1.0), (from, -1.0)] {
            let leg = usize::from(end >= 1.0);
            let fraction = end - leg as f64;
            // Sums are known where quadrants begin and end.
            if fraction == 0.0 || end == 2.0 {
                continue;
            }
            match half {
                0 => sum(leg, fraction, sign),
                // It runs against the quadrants.
                _ => sum(leg, 1.0 - fraction, -sign),
            }
        }
    }
    whole
}

fn accumulate(sum: &mut [f64; 9], added: &[f64; 9]) {
    sum.iter_mut().zip(added).for_each(|(sum, added)| *sum += added);
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

/// Rows of patches that are placed before their light is added.
const BLOCK: usize = 64;

/// What one receiver's visible spans add up to. Keep it and use it again: its memory is reused.
#[derive(Clone, Debug, Default)]
pub struct LightMoments {
    sum: [f64; 9],
    rows: Vec<Row>,
    /// Where the rows of each sample end.
    bounds: Vec<usize>,
}

impl LightMoments {
    /// Vector irradiance of each colour, integral of L V w.
    pub fn vectors(&self) -> [DVec3; 3] {
        [0, 3, 6].map(|i| DVec3::from_slice(&self.sum[i..i + 3]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Sky;

    /// Spans from the whole to a point, with and without gaps, that begin and end at the spine, the fold, the far corner and anywhere,
    /// against the sums of their cells.
    #[test]
    fn spans_add_up_to_their_cells() {
        let isolines = Isolines::new(8).unwrap();
        let table = LightTable::new(&isolines, &Sky { height: 32, ..Sky::default() }.environment().unwrap());
        let places = [0.0, 0.25, 0.3, 1.0, 1.25, 1.7, 2.0];
        let pairs = (0..places.len()).flat_map(|i| (i + 1..places.len()).map(move |j| (places[i], places[j])));
        let mut cases: Vec<Vec<(f64, f64)>> = pairs.map(|pair| vec![pair]).collect();
        cases.extend([
            vec![],
            vec![(0.0, 0.25), (1.0, 2.0)],
            vec![(0.0, 1.0), (1.25, 1.7)],
            vec![(0.3, 1.25), (1.7, 2.0)],
        ]);
        let mut moments = LightMoments::default();
        for shift in 0..cases.len() {
            let lines: Vec<&[(f64, f64)]> = (0..16).map(|i| &*cases[(shift + i * i) % cases.len()]).collect();
            for rank in 0..3 {
                let frame = Frame::facing(Some(DVec3::new(0.3, -0.5, 0.8)), rank);
                table.integrate(frame, &Spans::new(&lines), &mut moments);
                let mut expected = [0.0; 9];
                for (line, spans) in lines.iter().enumerate() {
                    let (half, line) = (line / 8, line % 8);
                    for (leg, quadrant) in quadrants(frame, half).into_iter().enumerate() {
                        for cell in 0..table.cells {
                            let [low, high] = [cell, cell + 1].map(|cell| {
                                let s = cell as f64 / table.cells as f64;
                                leg as f64 + if half == 0 { s } else { 1.0 - s }
                            });
                            let (low, high) = (low.min(high), low.max(high));
                            let seen: f64 =
                                spans.iter().map(|(from, to)| (to.min(high) - from.max(low)).max(0.0)).sum();
                            let (row, _) = table.cell(line, quadrant, cell as f64 / table.cells as f64);
                            let [low, high] = [row, row + table.lines].map(|row| table.axes[frame.axis()][row]);
                            for (expected, (low, high)) in expected.iter_mut().zip(low.iter().zip(high)) {
                                *expected += (high - low) * seen * table.cells as f64;
                            }
                        }
                    }
                }
                let scale: f64 = table.axes[0].last().unwrap().iter().map(|x| x.abs()).sum();
                for (found, expected) in moments.sum.iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-12 * scale, "{found} instead of {expected}");
                }
                let rows = &moments.rows;
                assert_eq!(moments.sum, add_inline(&table.axes[frame.axis()], rows));
            }
        }
    }
}
