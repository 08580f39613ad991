//! Rotation of spherical-harmonic expansions.

use std::sync::LazyLock;

use glam::DMat3;

use super::harmonics::Order;

/// Coefficients of the rotated function f(R^T w) into `out`, from the coefficients of f; both `order.len()` long.
///
/// Each band has its own orthogonal matrix M with y(R w) = M y(w), built from the band below by the recurrence of Ivanic
/// and Ruedenberg (1996, table 2, with the correction of 1998). No angles, so no singular rotations; improper orthogonal
/// matrices (mirrors) work too. The error grows with the degree, to about 1e-14 of the band's norm at order 10.
///
/// # Panics
/// If a slice has another length.
pub fn rotate(order: Order, rotation: DMat3, coefficients: &[f64], out: &mut [f64]) {
    assert_eq!(coefficients.len(), order.len());
    assert_eq!(out.len(), order.len());
    // Band 1 is (y, z, x).
    const AXES: [usize; 3] = [1, 2, 0];
    let first: [f64; 9] = std::array::from_fn(|i| rotation.col(AXES[i % 3])[AXES[i / 3]]);
    let mut buffers = [[0.0; MOST]; 2];
    for l in 0..order.bands() {
        let side = 2 * l + 1;
        let [below, band] = &mut buffers;
        match l {
            0 => band[0] = 1.0,
            1 => band[..9].copy_from_slice(&first),
            _ => next_band(l as isize, &FACTORS[l], &first, below, &mut band[..side * side]),
        }
        let (input, output) = (&coefficients[l * l..][..side], &mut out[l * l..][..side]);
        for (row, out) in band.chunks_exact(side).zip(output) {
            *out = row.iter().zip(input).map(|(m, f)| m * f).sum();
        }
        buffers.swap(0, 1);
    }
}

/// Bands up to one more than [`Order::MAX`], for products with a cosine.
const BANDS: usize = 11;
/// Elements of the largest band's matrix.
const MOST: usize = (2 * BANDS - 1) * (2 * BANDS - 1);

/// The factors u, v and w of all elements of a band's matrix, band by band; letters as in the article.
static FACTORS: LazyLock<Vec<Vec<[f64; 3]>>> = LazyLock::new(|| (0..BANDS as isize).map(factors).collect());

fn factors(l: isize) -> Vec<[f64; 3]> {
    let factor = |m: isize, n: isize| {
        let k = m.abs();
        let denominator = if n.abs() == l { 2 * l * (2 * l - 1) } else { (l + n) * (l - n) } as f64;
        let u = (((l + m) * (l - m)) as f64 / denominator).sqrt();
        let twice = if m == 0 { 2.0 } else { 1.0 };
        let sign = if m == 0 { -1.0 } else { 1.0 };
        let v = sign * 0.5 * (twice * ((l + k - 1) * (l + k)) as f64 / denominator).sqrt();
        let w = if m == 0 { 0.0 } else { -0.5 * (((l - k - 1) * (l - k)) as f64 / denominator).sqrt() };
        [u, v, w]
    };
    (-l..=l).flat_map(|m| (-l..=l).map(move |n| factor(m, n))).collect()
}

/// The matrix of band `l` from those of band 1 and band l - 1, row-major. Letters as in the article.
fn next_band(l: isize, factors: &[[f64; 3]], first: &[f64; 9], below: &[f64], band: &mut [f64]) {
    let r = |i: isize, j: isize| first[(3 * (i + 1) + j + 1) as usize];
    let prev = |i: isize, j: isize| below[((2 * l - 1) * (i + l - 1) + j + l - 1) as usize];
    let p = |i: isize, a: isize, b: isize| {
        if b == l {
            r(i, 1) * prev(a, l - 1) - r(i, -1) * prev(a, 1 - l)
        } else if b == -l {
            r(i, 1) * prev(a, 1 - l) + r(i, -1) * prev(a, l - 1)
        } else {
            r(i, 0) * prev(a, b)
        }
    };
    let places = (-l..=l).flat_map(|m| (-l..=l).map(move |n| (m, n)));
    for ((element, &[u, v, w]), (m, n)) in band.iter_mut().zip(factors).zip(places) {
        // A factor of zero goes with an element outside the band below.
        *element = 0.0;
        if u != 0.0 {
            *element += u * p(0, m, n);
        }
        if v != 0.0 {
            *element += v * match m {
                0 => p(1, 1, n) + p(-1, -1, n),
                1 => std::f64::consts::SQRT_2 * p(1, 0, n),
                -1 => std::f64::consts::SQRT_2 * p(-1, 0, n),
                2.. => p(1, m - 1, n) - p(-1, 1 - m, n),
                _ => p(1, m + 1, n) + p(-1, -m - 1, n),
            };
        }
        if w != 0.0 {
            *element += w * if m > 0 { p(1, m + 1, n) + p(-1, -m - 1, n) } else { p(1, m - 1, n) - p(-1, 1 - m, n) };
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::sphere::{
        harmonics::{evaluate, tests::directions},
        zonal::cap,
    };

    fn rotations() -> Vec<DMat3> {
        let mut rotations: Vec<_> = directions(20)
            .into_iter()
            .enumerate()
            .map(|(i, axis)| DMat3::from_quat(DQuat::from_axis_angle(axis, 0.4 * i as f64)))
            .collect();
        rotations.push(DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0)));
        rotations.push(DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)));
        rotations.push(DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X));
        rotations
    }

    #[test]
    fn values_follow_the_rotation() {
        let order = Order::MAX;
        let f: Vec<f64> = (0..order.len()).map(|i| ((i * i + 1) as f64).sin()).collect();
        let (mut turned, mut y) = (vec![0.0; order.len()], vec![0.0; order.len()]);
        let mut value = |f: &[f64], w: DVec3| {
            evaluate(order, w, &mut y);
            f.iter().zip(&y).map(|(f, y)| f * y).sum::<f64>()
        };
        for rotation in rotations() {
            rotate(order, rotation, &f, &mut turned);
            for w in directions(30) {
                assert!((value(&turned, rotation * w) - value(&f, w)).abs() < 1e-12, "{rotation} {w}");
            }
        }
    }

    #[test]
    fn energy_of_every_band_is_kept() {
        let order = Order::MAX;
        let f: Vec<f64> = (0..order.len()).map(|i| ((i * i + 1) as f64).cos()).collect();
        let mut turned = vec![0.0; order.len()];
        for rotation in rotations() {
            rotate(order, rotation, &f, &mut turned);
            for l in 0..order.bands() {
                let energy = |f: &[f64]| f[l * l..(l + 1) * (l + 1)].iter().map(|x| x * x).sum::<f64>();
                assert!((energy(&turned) / energy(&f) - 1.0).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn caps_turn_with_their_axis() {
        let mut turned = vec![0.0; Order::MAX.len()];
        for rotation in rotations() {
            for axis in directions(10) {
                rotate(Order::MAX, rotation, &cap(Order::MAX, axis, 0.3), &mut turned);
                let expected = cap(Order::MAX, rotation * axis, 0.3);
                assert!(turned.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-13));
            }
        }
    }

    #[test]
    fn a_thousand_turns_return() {
        let f: Vec<f64> = (0..100).map(|i| ((i * i + 1) as f64).sin()).collect();
        let step =
            DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -2.0) / 3.0, std::f64::consts::TAU / 1000.0));
        let (mut turned, mut next) = (f.clone(), vec![0.0; 100]);
        for _ in 0..1000 {
            rotate(Order::MAX, step, &turned, &mut next);
            std::mem::swap(&mut turned, &mut next);
        }
        // A thousand times the error of one rotation.
        assert!(turned.iter().zip(&f).all(|(a, b)| (a - b).abs() < 1e-11));
    }
}
