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

use super::arcs::angles;
use super::{BoundaryArc, Order, evaluate};

/// Bands on offer: one more than [`Order::MAX`], for products with a cosine.
const BANDS: usize = 11;
/// Lobes of the highest order.
const MOST_LOBES: usize = count(BANDS);

/// Number of lobes of an order: at least 2n - 1, in fours, which are handled side by side.
const fn count(bands: usize) -> usize {
    (2 * bands - 1).next_multiple_of(4)
}

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

/// The lobes of one order.
struct Lobes {
    count: usize,
    directions: [[f64; MOST_LOBES]; 3],
    /// For each band from 1: row-major (2l+1) x (number of lobes), from the sums over arcs to coefficients.
    solve: Vec<Vec<f64>>,
}

static LOBES: LazyLock<Vec<Lobes>> = LazyLock::new(|| (1..=BANDS).map(Lobes::new).collect());

impl Lobes {
    /// Directions on one hemisphere: parity makes the other redundant.
    fn new(bands: usize) -> Self {
        let count = count(bands);
        let (turn, first) = if bands > 1 { SPIRALS[bands - 2] } else { (0.0, 0.5) };
        let lobes: Vec<DVec3> = (0..count)
            .map(|k| {
                let z = (k as f64 + first) / count as f64;
                let (s, c) = (PI * turn * k as f64).sin_cos();
                let r = (1.0 - z * z).sqrt();
                DVec3::new(r * c, r * s, z)
            })
            .collect();
        let mut directions = [[0.0; MOST_LOBES]; 3];
        for (k, w) in lobes.iter().enumerate() {
            for (axis, value) in w.to_array().into_iter().enumerate() {
                directions[axis][k] = value;
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
        Self { count, directions, solve }
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
    let mut sums = [[0.0; MOST_LOBES]; BANDS];
    accumulate(order.bands(), lobes, arcs, &angles(arcs), &mut sums);
    for l in 1..order.bands() {
        let sums = &sums[l][..lobes.count];
        let rows = lobes.solve[l - 1].chunks_exact(sums.len());
        for (coefficient, row) in out[l * l..].iter_mut().zip(rows) {
            *coefficient = row.iter().zip(sums).map(|(a, b)| a * b).sum();
        }
    }
}

/// Adds (w_k . N) D_l of every arc, given with its angle, lobe k and band l to `sums[l][k]`.
fn accumulate(
    bands: usize,
    lobes: &Lobes,
    arcs: &[BoundaryArc],
    angles: &[f64],
    sums: &mut [[f64; MOST_LOBES]; BANDS],
) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { accumulate_avx2(bands, lobes, arcs, angles, sums) };
    }
    accumulate_portable(bands, lobes, arcs, angles, sums);
}

/// The portable loop compiled for four lanes of f64; without fused products, so the bits are the same.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn accumulate_avx2(
    bands: usize,
    lobes: &Lobes,
    arcs: &[BoundaryArc],
    angles: &[f64],
    sums: &mut [[f64; MOST_LOBES]; BANDS],
) {
    accumulate_portable(bands, lobes, arcs, angles, sums);
}

#[inline(always)]
fn accumulate_portable(
    bands: usize,
    lobes: &Lobes,
    arcs: &[BoundaryArc],
    angles: &[f64],
    sums: &mut [[f64; MOST_LOBES]; BANDS],
) {
    // Numbers that are known beforehand: without them it takes a tenth longer.
    match bands {
        2 => accumulate_bands::<2, { count(2) }>(lobes, arcs, angles, sums),
        3 => accumulate_bands::<3, { count(3) }>(lobes, arcs, angles, sums),
        4 => accumulate_bands::<4, { count(4) }>(lobes, arcs, angles, sums),
        5 => accumulate_bands::<5, { count(5) }>(lobes, arcs, angles, sums),
        6 => accumulate_bands::<6, { count(6) }>(lobes, arcs, angles, sums),
        7 => accumulate_bands::<7, { count(7) }>(lobes, arcs, angles, sums),
        8 => accumulate_bands::<8, { count(8) }>(lobes, arcs, angles, sums),
        9 => accumulate_bands::<9, { count(9) }>(lobes, arcs, angles, sums),
        10 => accumulate_bands::<10, { count(10) }>(lobes, arcs, angles, sums),
        _ => accumulate_bands::<BANDS, MOST_LOBES>(lobes, arcs, angles, sums),
    }
}

/// The recurrences of some lobes: entry 0 is band l - 1, entry 1 band l - 2; P and P' at both ends of the arc, then the integrals.
struct Recurrences<const COUNT: usize> {
    p_start: [[f64; COUNT]; 2],
    p_end: [[f64; COUNT]; 2],
    q_start: [[f64; COUNT]; 2],
    q_end: [[f64; COUNT]; 2],
    /// B, the integral of P.
    integral: [f64; COUNT],
    d: [[f64; COUNT]; 2],
    e: [[f64; COUNT]; 2],
}

/// One lobe after another in the innermost loop, all independent: compilers evaluate several at once.
#[inline(always)]
fn accumulate_bands<const N: usize, const COUNT: usize>(
    lobes: &Lobes,
    arcs: &[BoundaryArc],
    angles: &[f64],
    sums: &mut [[f64; MOST_LOBES]; BANDS],
) {
    let zero = [0.0; COUNT];
    let [x, y, z] = &lobes.directions;
    for (arc, &tau) in arcs.iter().zip(angles) {
        let tangent = arc.normal.cross(arc.start);
        let (sin, cos) = (tangent.dot(arc.end), arc.start.dot(arc.end));
        let (mut a, mut b, mut n) = (zero, zero, zero);
        let (mut z_end, mut slope_end, mut off_circle) = (zero, zero, zero);
        for i in 0..COUNT {
            a[i] = x[i] * arc.start.x + y[i] * arc.start.y + z[i] * arc.start.z;
            b[i] = x[i] * tangent.x + y[i] * tangent.y + z[i] * tangent.z;
            n[i] = x[i] * arc.normal.x + y[i] * arc.normal.y + z[i] * arc.normal.z;
            z_end[i] = a[i] * cos + b[i] * sin;
            slope_end[i] = b[i] * cos - a[i] * sin;
            off_circle[i] = 1.0 - a[i] * a[i] - b[i] * b[i];
        }
        let (none, one) = ([zero; 2], [[1.0; COUNT], zero]);
        let mut at = Recurrences {
            p_start: one,
            p_end: one,
            q_start: none,
            q_end: none,
            integral: [tau; COUNT],
            d: none,
            e: none,
        };
        for (l, sums) in sums.iter_mut().enumerate().take(N).skip(1) {
            let [odd, before, inverse, inverse_square] = FACTORS[l];
            for i in 0..COUNT {
                let d = at.d[1][i] + odd * at.integral[i];
                let e = at.e[1][i] + odd * at.d[0][i];
                let q_start = at.q_start[1][i] + odd * at.p_start[0][i];
                let q_end = at.q_end[1][i] + odd * at.p_end[0][i];
                let ends = slope_end[i] * q_end - b[i] * q_start;
                let p_start = (odd * a[i] * at.p_start[0][i] - before * at.p_start[1][i]) * inverse;
                let p_end = (odd * z_end[i] * at.p_end[0][i] - before * at.p_end[1][i]) * inverse;
                at.integral[i] = (at.d[0][i] - off_circle[i] * e - ends) * inverse_square;
                (at.d[1][i], at.d[0][i]) = (at.d[0][i], d);
                (at.e[1][i], at.e[0][i]) = (at.e[0][i], e);
                (at.q_start[1][i], at.q_start[0][i]) = (at.q_start[0][i], q_start);
                (at.q_end[1][i], at.q_end[0][i]) = (at.q_end[0][i], q_end);
                (at.p_start[1][i], at.p_start[0][i]) = (at.p_start[0][i], p_start);
                (at.p_end[1][i], at.p_end[0][i]) = (at.p_end[0][i], p_end);
                sums[i] += n[i] * d;
            }
        }
    }
}

/// For each band l: 2l - 1, l - 1, 1 / l and 1 / l^2.
const FACTORS: [[f64; 4]; BANDS] = {
    let mut factors = [[0.0; 4]; BANDS];
    let mut l = 1;
    while l < BANDS {
        factors[l] = [(2 * l - 1) as f64, (l - 1) as f64, 1.0 / l as f64, 1.0 / (l * l) as f64];
        l += 1;
    }
    factors
};

#[cfg(test)]
mod tests {
    use super::*;

    /// A row's norm is what it does to independent rounding errors of the sums; 1 for lobes spread perfectly.
    #[test]
    fn lobes_do_not_amplify_rounding() {
        for bands in 2..=BANDS {
            let lobes = Lobes::new(bands);
            let count = lobes.count;
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
        let (mut a, mut b) = ([[0.0; MOST_LOBES]; BANDS], [[0.0; MOST_LOBES]; BANDS]);
        let angles = angles(&arcs);
        accumulate(BANDS, lobes, &arcs, &angles, &mut a);
        accumulate_portable(BANDS, lobes, &arcs, &angles, &mut b);
        assert!(a.iter().flatten().any(|sum| *sum != 0.0));
        assert_eq!(a, b);
    }
}
