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
    cells: usize,
    /// One table for each axis along which isolines may follow one another.
    axes: [Vec<[f64; 9]>; 3],
}

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
        Self { cells, axes }
    }

    /// The integral from the start of the quadrant to the fraction `to`, per unit of `sign`, added to `out`.
    fn add(&self, axis: usize, arc: usize, to: f64, sign: f64, out: &mut [f64; 9]) {
        let at = to * self.cells as f64;
        let cell = (at as usize).min(self.cells - 1);
        let part = at - cell as f64;
        let arc = &self.axes[axis][arc * (self.cells + 1)..][..self.cells + 1];
        for (out, (low, high)) in out.iter_mut().zip(arc[cell].iter().zip(&arc[cell + 1])) {
            *out += sign * (low + (high - low) * part);
        }
    }
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

/// What one receiver's visible intervals add up to.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightMoments([[f64; 9]; 2]);

impl LightMoments {
    /// Adds a visible interval of an isoline, which follow one another along the axis numbered `axis`.
    pub fn add(&mut self, table: &LightTable, axis: usize, interval: Interval) {
        let arc = interval.line * 4 + interval.quadrant;
        let mut part = [0.0; 9];
        table.add(axis, arc, interval.to, 1.0, &mut part);
        table.add(axis, arc, interval.from, -1.0, &mut part);
        self.0[interval.line % 2].iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
    }

    /// Vector irradiance of each colour, integral of L V w, over the isolines of even and of odd number.
    pub fn vectors(&self) -> [[DVec3; 3]; 2] {
        self.0.map(|sums| [0, 3, 6].map(|i| DVec3::from_slice(&sums[i..i + 3])))
    }
}
