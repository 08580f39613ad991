//! Spherical harmonics of a region bounded by arcs of great circles, in closed form.
//!
//! For l >= 1 Green's theorem turns the integral of a zonal function about a lobe direction w_k into one along the boundary:
//!
//! ```text
//! integral_R P_l(w_k . w) dw = 1 / (l (l+1)) sum over arcs of (w_k . N) integral_0^tau P'_l(z(t)) dt
//! z(t) = A cos t + B sin t,  A = w_k . start,  B = w_k . (N x start),  z' = -A sin t + B cos t,  r^2 = A^2 + B^2
//! ```
//!
//! With B_l, D_l, E_l the integrals over t of P_l(z), P'_l(z), P''_l(z), Legendre's equation integrated once gives
//!
//! ```text
//! B_0 = tau, D_0 = E_0 = 0
//! D_l = D_{l-2} + (2l-1) B_{l-1}
//! E_l = E_{l-2} + (2l-1) D_{l-1}
//! B_l = (D_{l-1} - (1 - r^2) E_l - [z' P'_l(z)]_0^tau) / l^2
//! ```
//!
//! 2l+1 or more lobes determine band l: sum_m Y_lm(w_k) c_lm = (2l+1)/(4 pi) times the zonal integral, solved in the sense of
//! least squares by a matrix computed once. Band 0 is the solid angle over sqrt(4 pi). Absolute errors are a few 1e-16 an arc.

use std::f64::consts::PI;
use std::sync::LazyLock;

use glam::DVec3;

use super::{BoundaryArc, Order, evaluate};

/// Bands on offer: one more than [`Order::MAX`], for products with a cosine.
const BANDS: usize = 11;
/// Lobes handled side by side.
const LANES: usize = 4;
/// Lanes that hold the 2n - 1 or more lobes of any order.
const BLOCKS: usize = (2 * BANDS - 1).div_ceil(LANES);

/// Half turns from one lobe to the next and height of the first in steps, by order from 2: spirals on a hemisphere with
/// whole lanes of lobes and no more than band l = n - 1 needs. Found by a search; none amplifies rounding more than
/// threefold, where other spirals reach 30.
const SPIRALS: [(f64, f64); BANDS - 1] = [
    (0.72, 0.4),
    (0.787, 0.45),
    (0.72, 0.9),
    (0.4133, 0.05),
    (0.4667, 0.95),
    (0.4667, 0.9),
    (0.88, 0.95),
    (0.7733, 0.7),
    (0.7867, 0.8),
    (0.4133, 0.95),
];

type Lane = [f64; LANES];

/// The lobes of one order.
struct Lobes {
    blocks: usize,
    directions: [[Lane; BLOCKS]; 3],
    /// For each band from 1: row-major (2l+1) x (number of lobes), from the sums over arcs to coefficients.
    solve: Vec<Vec<f64>>,
}

static LOBES: LazyLock<Vec<Lobes>> = LazyLock::new(|| (1..=BANDS).map(Lobes::new).collect());

impl Lobes {
    /// Directions on one hemisphere: parity makes the other redundant.
    fn new(bands: usize) -> Self {
        let blocks = (2 * bands - 1).div_ceil(LANES);
        let count = LANES * blocks;
        let (turn, first) = if bands > 1 { SPIRALS[bands - 2] } else { (0.0, 0.5) };
        let lobes: Vec<DVec3> = (0..count)
            .map(|k| {
                let z = (k as f64 + first) / count as f64;
                let (s, c) = (PI * turn * k as f64).sin_cos();
                let r = (1.0 - z * z).sqrt();
                DVec3::new(r * c, r * s, z)
            })
            .collect();
        let mut directions = [[[0.0; LANES]; BLOCKS]; 3];
        for (k, w) in lobes.iter().enumerate() {
            for (axis, value) in w.to_array().into_iter().enumerate() {
                directions[axis][k / LANES][k % LANES] = value;
            }
        }
        let order = Order::new(bands.min(Order::MAX.bands())).expect("1 to 10 bands are an order");
        let order = if bands > order.bands() { order.raised() } else { order };
        let rows: Vec<Vec<f64>> = lobes
            .iter()
            .map(|&w| {
                let mut y = vec![0.0; order.len()];
                evaluate(order, w, &mut y);
                y
            })
            .collect();
        let solve = (1..bands)
            .map(|l| {
                let basis: Vec<&[f64]> = rows.iter().map(|y| &y[l * l..(l + 1) * (l + 1)]).collect();
                // c = pinv(4 pi / (2l+1) Y) I and I = 1 / (l (l+1)) times the sums over arcs.
                let scale = (2 * l + 1) as f64 / (4.0 * PI) / (l * (l + 1)) as f64;
                pseudo_inverse(&basis, scale)
            })
            .collect();
        Self { blocks, directions, solve }
    }
}

/// `scale` times the pseudo-inverse of a matrix of full column rank, row-major, by the normal equations and Gauss-Jordan
/// elimination: the condition number is below 10, so squaring it costs two digits at most.
fn pseudo_inverse(rows: &[&[f64]], scale: f64) -> Vec<f64> {
    let n = rows[0].len();
    let mut system: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            let gram = (0..n).map(|j| rows.iter().map(|row| row[i] * row[j]).sum());
            let right = rows.iter().map(|row| scale * row[i]);
            gram.chain(right).collect()
        })
        .collect();
    for column in 0..n {
        // The Gram matrix is positive definite: no pivoting.
        let pivot = system[column].clone();
        for (i, row) in system.iter_mut().enumerate() {
            let factor = if i == column { 1.0 - 1.0 / pivot[column] } else { row[column] / pivot[column] };
            row.iter_mut().zip(&pivot).for_each(|(value, p)| *value -= factor * p);
        }
    }
    system.into_iter().flat_map(|row| row.into_iter().skip(n)).collect()
}

/// SH coefficients of the indicator of the region bounded by `arcs` with the given `solid_angle`, `order.len()` of them.
///
/// `solid_angle` is in steradians: the boundary alone determines it only up to multiples of 4 pi.
///
/// # Panics
/// If `out` is not `order.len()` long.
pub fn region_harmonics(order: Order, arcs: &[BoundaryArc], solid_angle: f64, out: &mut [f64]) {
    assert_eq!(out.len(), order.len());
    out[0] = solid_angle / (4.0 * PI).sqrt();
    if order.bands() == 1 {
        return;
    }
    let lobes = &LOBES[order.bands() - 1];
    let mut sums = [[[0.0; LANES]; BLOCKS]; BANDS];
    accumulate(order.bands(), lobes, arcs, &mut sums);
    for l in 1..order.bands() {
        let sums = &sums[l].as_flattened()[..LANES * lobes.blocks];
        let rows = lobes.solve[l - 1].chunks_exact(sums.len());
        for (coefficient, row) in out[l * l..].iter_mut().zip(rows) {
            *coefficient = row.iter().zip(sums).map(|(a, b)| a * b).sum();
        }
    }
}

/// Adds (w_k . N) D_l of every arc, lobe k and band l to `sums[l][k]`.
fn accumulate(bands: usize, lobes: &Lobes, arcs: &[BoundaryArc], sums: &mut [[Lane; BLOCKS]; BANDS]) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { accumulate_avx2(bands, lobes, arcs, sums) };
    }
    accumulate_portable(bands, lobes, arcs, sums);
}

/// The portable loop compiled for four lanes of f64; without fused products, so the bits are the same.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn accumulate_avx2(bands: usize, lobes: &Lobes, arcs: &[BoundaryArc], sums: &mut [[Lane; BLOCKS]; BANDS]) {
    accumulate_portable(bands, lobes, arcs, sums);
}

#[inline(always)]
fn lanes(f: impl Fn(usize) -> f64) -> Lane {
    std::array::from_fn(f)
}

#[inline(always)]
fn accumulate_portable(bands: usize, lobes: &Lobes, arcs: &[BoundaryArc], sums: &mut [[Lane; BLOCKS]; BANDS]) {
    for arc in arcs {
        let tangent = arc.normal.cross(arc.start);
        let (sin, cos) = (tangent.dot(arc.end), arc.start.dot(arc.end));
        let tau = sin.atan2(cos);
        for block in 0..lobes.blocks {
            let [x, y, z] = &lobes.directions;
            let (x, y, z) = (&x[block], &y[block], &z[block]);
            let dot = |v: DVec3| lanes(|i| x[i] * v.x + y[i] * v.y + z[i] * v.z);
            let (a, b, n) = (dot(arc.start), dot(tangent), dot(arc.normal));
            let z1 = lanes(|i| a[i] * cos + b[i] * sin);
            let slope1 = lanes(|i| b[i] * cos - a[i] * sin);
            let off_circle = lanes(|i| 1.0 - a[i] * a[i] - b[i] * b[i]);

            // Index 0 is band l-1, index 1 band l-2; P and P' at both ends, then the integrals.
            let zero = [0.0; LANES];
            let (mut p0, mut p0_before) = ([1.0; LANES], zero);
            let (mut p1, mut p1_before) = ([1.0; LANES], zero);
            let (mut q0, mut q0_before) = (zero, zero);
            let (mut q1, mut q1_before) = (zero, zero);
            let mut integral = [tau; LANES];
            let (mut d, mut d_before) = (zero, zero);
            let (mut e, mut e_before) = (zero, zero);
            for (l, sums) in sums.iter_mut().enumerate().take(bands).skip(1) {
                let odd = (2 * l - 1) as f64;
                let (inverse, inverse_square) = (1.0 / l as f64, 1.0 / (l * l) as f64);
                let d_next = lanes(|i| d_before[i] + odd * integral[i]);
                let e_next = lanes(|i| e_before[i] + odd * d[i]);
                let q0_next = lanes(|i| q0_before[i] + odd * p0[i]);
                let q1_next = lanes(|i| q1_before[i] + odd * p1[i]);
                integral = lanes(|i| {
                    let ends = slope1[i] * q1_next[i] - b[i] * q0_next[i];
                    (d[i] - off_circle[i] * e_next[i] - ends) * inverse_square
                });
                let p0_next = lanes(|i| (odd * a[i] * p0[i] - (odd - l as f64) * p0_before[i]) * inverse);
                let p1_next = lanes(|i| (odd * z1[i] * p1[i] - (odd - l as f64) * p1_before[i]) * inverse);
                (d_before, d) = (d, d_next);
                (e_before, e) = (e, e_next);
                (q0_before, q0) = (q0, q0_next);
                (q1_before, q1) = (q1, q1_next);
                (p0_before, p0) = (p0, p0_next);
                (p1_before, p1) = (p1, p1_next);
                let sum = &mut sums[block];
                *sum = lanes(|i| sum[i] + n[i] * d[i]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row's norm is what it does to independent rounding errors of the sums; 1 for lobes spread perfectly.
    #[test]
    fn lobes_do_not_amplify_rounding() {
        for bands in 2..=BANDS {
            let lobes = Lobes::new(bands);
            let count = LANES * lobes.blocks;
            for l in 1..bands {
                let perfect = (2 * l + 1) as f64 / (l * (l + 1)) as f64 / (4.0 * PI * count as f64).sqrt();
                for row in lobes.solve[l - 1].chunks_exact(count) {
                    let norm = row.iter().map(|x| x * x).sum::<f64>().sqrt();
                    assert!(norm < 3.0 * perfect, "order {bands}, band {l}: {}", norm / perfect);
                }
            }
        }
    }

    #[test]
    fn portable_and_dispatched_kernels_agree_to_the_bit() {
        let arcs: Vec<BoundaryArc> = (0..50)
            .map(|i| {
                let angle = 0.1 + i as f64 * 0.05;
                let (s, c) = angle.sin_cos();
                let start = DVec3::new(0.36, 0.48, 0.8);
                let normal = start.cross(DVec3::new(s, -c, 0.3)).normalize();
                BoundaryArc { start, end: c * start + s * normal.cross(start), normal }
            })
            .collect();
        let lobes = &LOBES[BANDS - 1];
        let (mut a, mut b) = ([[[0.0; LANES]; BLOCKS]; BANDS], [[[0.0; LANES]; BLOCKS]; BANDS]);
        accumulate(BANDS, lobes, &arcs, &mut a);
        accumulate_portable(BANDS, lobes, &arcs, &mut b);
        assert!(a.iter().flatten().flatten().any(|sum| *sum != 0.0));
        assert_eq!(a, b);
    }
}
