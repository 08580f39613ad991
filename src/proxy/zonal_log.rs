//! The logarithm of the visibility that one sphere leaves, as zonal harmonics.

use std::f64::consts::PI;

use crate::sphere::{Order, TripleProduct, index, zonal_cap};

/// Zonal coefficients of log(1 - cap) about the z axis for the cap of the half angle with cosine `cos_half_angle`, one a
/// band (Ren et al. 2006, section 4.1).
///
/// The logarithm of spherical harmonics is that of the product matrix: M_g = R^T D R and log g = R^T q'(max(D, 0.02 D_max)) R
/// (g - 1) with q'(x) = ln x / (x - 1). For a zonal g the block of the coefficients with m = 0 is closed.
pub fn log_visibility(order: Order, cos_half_angle: f64) -> Vec<f64> {
    Logarithm::new(order).of_cap(cos_half_angle)
}

/// Eigenvalues are kept above this share of the greatest (Ren et al. 2006, section 4.1): truncation makes some of them
/// negative, where there is no logarithm.
const LEAST_EIGENVALUE: f64 = 0.02;

/// The zonal block of the triple product.
pub(super) struct Logarithm {
    order: Order,
    /// `block[i][j][k]`, integral of Y_i0 Y_j0 Y_k0.
    block: Vec<Vec<Vec<f64>>>,
}

impl Logarithm {
    pub(super) fn new(order: Order) -> Self {
        let bands = order.bands();
        let mut block = vec![vec![vec![0.0; bands]; bands]; bands];
        let band = |i: u8| {
            let l = usize::from(i).isqrt();
            (index(l, 0) == usize::from(i)).then_some(l)
        };
        for entry in TripleProduct::new(order).entries() {
            if let (Some(i), Some(j), Some(k)) = (band(entry.i), band(entry.j), band(entry.k)) {
                block[i][j][k] = entry.value;
                block[j][i][k] = entry.value;
            }
        }
        Self { order, block }
    }

    pub(super) fn of_cap(&self, cos_half_angle: f64) -> Vec<f64> {
        let bands = self.order.bands();
        // g - 1.
        let less_one: Vec<f64> = zonal_cap(self.order, cos_half_angle).iter().map(|x| -x).collect();
        let mut g = less_one.clone();
        g[0] += (4.0 * PI).sqrt();
        let matrix =
            (0..bands).map(|j| (0..bands).map(|k| (0..bands).map(|i| self.block[i][j][k] * g[i]).sum()).collect());
        let (values, vectors) = symmetric_eigen(matrix.collect());
        let greatest = values.iter().copied().fold(f64::MIN, f64::max);
        let mut log = vec![0.0; bands];
        for (value, vector) in values.iter().zip(&vectors) {
            let x = value.max(LEAST_EIGENVALUE * greatest);
            // ln x / (x - 1), whose limit at 1 is 1.
            let quotient = if (x - 1.0).abs() < 1e-9 { 1.0 } else { x.ln() / (x - 1.0) };
            let projection: f64 = vector.iter().zip(&less_one).map(|(v, g)| v * g).sum();
            log.iter_mut().zip(vector).for_each(|(log, v)| *log += quotient * projection * v);
        }
        log
    }
}

/// Eigenvalues and unit eigenvectors of a small symmetric matrix by Jacobi rotations (Golub and Van Loan 2013, 8.5).
pub(super) fn symmetric_eigen(mut a: Vec<Vec<f64>>) -> (Vec<f64>, Vec<Vec<f64>>) {
    let n = a.len();
    let mut vectors: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    let scale: f64 = a.iter().flatten().map(|x| x * x).sum();
    // Convergence is quadratic: ten sweeps are past the last bit.
    for _ in 0..30 {
        let off: f64 = (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i][j] * a[i][j]).sum();
        if off <= 1e-34 * scale {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                if a[p][q] == 0.0 {
                    continue;
                }
                let tau = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
                let c = 1.0 / (1.0 + t * t).sqrt();
                let s = t * c;
                for row in &mut a {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                for k in 0..n {
                    (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                    (vectors[p][k], vectors[q][k]) =
                        (c * vectors[p][k] - s * vectors[q][k], s * vectors[p][k] + c * vectors[q][k]);
                }
            }
        }
    }
    ((0..n).map(|i| a[i][i]).collect(), vectors)
}

/// Log visibility of spheres of every size, ready for the splat pass.
///
/// The table runs over u = 1 - cos theta in [0, 1], where sin theta = alpha = radius / distance: the solid angle over 2 pi.
/// Towards u = 0 the logarithm becomes proportional to u, so that linear interpolation keeps its relative error.
#[derive(Clone, Debug)]
pub struct LogTable {
    order: Order,
    /// For every u the bands' coefficients times sqrt(4 pi / (2l + 1)), padded to eight.
    rows: Vec<[f32; 8]>,
}

impl LogTable {
    /// Intervals of the table.
    pub const INTERVALS: usize = 512;

    /// The table for `order`, at most six bands.
    pub fn new(order: Order) -> Self {
        let logarithm = Logarithm::new(order);
        let rows = (0..=Self::INTERVALS).map(|k| {
            let log = logarithm.of_cap(1.0 - k as f64 / Self::INTERVALS as f64);
            let mut row = [0.0; 8];
            for (l, (row, log)) in row.iter_mut().zip(&log).enumerate() {
                *row = ((4.0 * PI / (2 * l + 1) as f64).sqrt() * log) as f32;
            }
            row
        });
        Self { order, rows: rows.collect() }
    }

    /// Number of bands.
    pub fn order(&self) -> Order {
        self.order
    }

    /// The rows, u from 0 to 1 in [`Self::INTERVALS`] steps; band l is multiplied by sqrt(4 pi / (2l + 1)), so that
    /// rotation multiplies it by y(axis) alone.
    pub fn rows(&self) -> &[[f32; 8]] {
        &self.rows
    }

    /// Interpolated row at `u` in [0, 1].
    #[inline(always)]
    pub fn row(&self, u: f32) -> [f32; 8] {
        let x = u * Self::INTERVALS as f32;
        let k = (x as usize).min(Self::INTERVALS - 1);
        let t = x - k as f32;
        let (a, b) = (&self.rows[k], &self.rows[k + 1]);
        std::array::from_fn(|l| a[l] + t * (b[l] - a[l]))
    }
}

/// u = 1 - cos theta of a sphere of sine alpha, without cancellation.
#[cfg(test)]
pub(super) fn versine(alpha: f64) -> f64 {
    alpha * alpha / (1.0 + (1.0 - alpha * alpha).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_diagonalise() {
        let a = vec![vec![2.0, -1.0, 0.5], vec![-1.0, 3.0, 0.25], vec![0.5, 0.25, -1.0]];
        let (values, vectors) = symmetric_eigen(a.clone());
        for (value, v) in values.iter().zip(&vectors) {
            for i in 0..3 {
                let image: f64 = (0..3).map(|j| a[i][j] * v[j]).sum();
                assert!((image - value * v[i]).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn small_spheres_have_their_own_coefficients() {
        // ln(1 - x) becomes -x: the cap's own coefficients, times -1, to first order in its solid angle.
        for bands in 2..=6 {
            let order = Order::new(bands).unwrap();
            let u = 1e-6;
            for (log, cap) in log_visibility(order, 1.0 - u).iter().zip(zonal_cap(order, 1.0 - u)) {
                assert!((log / -cap - 1.0).abs() < 1e-4, "{log} {cap}");
            }
        }
    }

    #[test]
    fn table_interpolates() {
        for bands in [4, 6] {
            let order = Order::new(bands).unwrap();
            let table = LogTable::new(order);
            for step in 0..200 {
                let alpha = (f64::from(step) + 0.37) / 200.0;
                let u = versine(alpha);
                let exact = log_visibility(order, 1.0 - u);
                let row = table.row(u as f32);
                for (l, exact) in exact.iter().enumerate() {
                    let scaled = (4.0 * PI / (2 * l + 1) as f64).sqrt() * exact;
                    // An eighth of the second derivative times the interval squared; for small spheres the former is the
                    // DC of cap * cap, pi (number of coefficients), over u^2. Where eigenvalues reach their bound there are
                    // corners: a quarter of an interval times the change of slope, at most 40.
                    let second = PI * order.len() as f64;
                    let smooth = 0.125 * second / (LogTable::INTERVALS as f64).powi(2);
                    let allowed = if alpha < 0.5 { 2e-4 * scaled.abs() + 2.0 * smooth } else { 0.02 };
                    assert!((f64::from(row[l]) - scaled).abs() < allowed, "bands {bands} alpha {alpha} band {l}");
                }
            }
        }
    }
}
