//! Product of a function on the sphere with a cosine, in spherical harmonics.
//!
//! Multiplication by w_x, w_y or w_z couples degree l with l - 1 and l + 1 only, so bands 0 .. n-1 of f(w) (n.w) follow
//! exactly from bands 0 .. n of f by a sparse symmetric matrix.

use std::sync::LazyLock;

use glam::DVec3;

use super::harmonics::{Order, index};

/// One non-zero of the matrices of w_x, w_y, w_z. No pair (row, column) is non-zero for two axes.
struct Entry {
    row: u8,
    column: u8,
    axis: u8,
    value: f64,
}

/// All entries for [`Order::MAX`] rows, sorted by row.
static ENTRIES: LazyLock<Vec<Entry>> = LazyLock::new(entries);

/// Coefficients of f(w) (n.w), `order.len()` of them into `out`, from the coefficients `f` of one band more
/// (`order.raised().len()`). `n` need not be a unit vector: the product is linear in it.
///
/// # Panics
/// If a slice has another length.
pub fn cosine_product(order: Order, n: DVec3, f: &[f64], out: &mut [f64]) {
    assert_eq!(f.len(), order.raised().len());
    assert_eq!(out.len(), order.len());
    out.fill(0.0);
    let n = n.to_array();
    let rows = out.len();
    for entry in ENTRIES.iter().take_while(|entry| usize::from(entry.row) < rows) {
        out[usize::from(entry.row)] += n[usize::from(entry.axis)] * entry.value * f[usize::from(entry.column)];
    }
}

/// From the recurrences of the fully normalised associated Legendre functions (Varshalovich, Moskalev and Khersonskii
/// 1988, section 5.8, without the Condon-Shortley sign):
///
/// ```text
/// cos(theta) P_l^m = A(l+1, m) P_{l+1}^m + A(l, m) P_{l-1}^m            A(l, m) = sqrt((l-m)(l+m) / ((2l-1)(2l+1)))
/// sin(theta) P_l^m = B(l+1, m+1) P_{l+1}^{m+1} - B(l, -m) P_{l-1}^{m+1}  B(l, m) = sqrt((l+m)(l+m-1) / ((2l-1)(2l+1)))
/// ```
fn entries() -> Vec<Entry> {
    let ratio = |a: isize, b: isize, l: isize| (a as f64 * b as f64 / ((2 * l - 1) * (2 * l + 1)) as f64).sqrt();
    let bands = Order::MAX.bands() as isize;
    let mut entries = Vec::new();
    let mut couple = |(l, m): (isize, isize), (k, j): (isize, isize), axis: u8, value: f64| {
        let (row, column) = (index(l as usize, m) as u8, index(k as usize, j) as u8);
        for (row, column) in [(row, column), (column, row)] {
            entries.push(Entry { row, column, axis, value });
        }
    };
    // Rows of the last band take from the band above it.
    for l in 0..=bands {
        for m in -l..=l {
            couple((l, m), (l + 1, m), 2, ratio(l + 1 - m, l + 1 + m, l + 1));
        }
        for m in 0..=l {
            // sin(theta) couples |m| = m of degree l with |m| = m + 1 of degrees l + 1 and l - 1; cos(phi) and sin(phi)
            // split evenly over the sum and the difference of the two longitudinal frequencies, and the harmonics with
            // m = 0 lack the factor sqrt(2).
            let half = if m == 0 { 0.5f64.sqrt() } else { 0.5 };
            let up = half * ratio(l + m + 2, l + m + 1, l + 1);
            let down = if m < l - 1 { -half * ratio(l - m, l - m - 1, l) } else { 0.0 };
            for (k, value) in [(l + 1, up), (l - 1, down)] {
                if value == 0.0 {
                    continue;
                }
                couple((l, m), (k, m + 1), 0, value);
                couple((l, m), (k, -m - 1), 1, value);
                if m > 0 {
                    couple((l, -m), (k, -m - 1), 0, value);
                    couple((l, -m), (k, m + 1), 1, -value);
                }
            }
        }
    }
    entries.sort_by_key(|entry| (entry.row, entry.column));
    entries
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::{harmonics::evaluate, quadrature::product_rule};

    #[test]
    fn equals_quadrature() {
        let n = DVec3::new(0.3, -0.8, 0.5);
        for bands in 1..=10 {
            let order = Order::new(bands).unwrap();
            let raised = order.raised();
            // A function of exactly one band more than the product keeps, so that truncation plays no part.
            let f: Vec<f64> = (0..raised.len()).map(|i| ((i * i + 3) as f64).sin()).collect();
            let (mut y, mut expected, mut out) =
                (vec![0.0; raised.len()], vec![0.0; order.len()], vec![0.0; order.len()]);
            for (w, weight) in product_rule(bands + 1, 2 * bands + 2) {
                evaluate(raised, w, &mut y);
                let value: f64 = f.iter().zip(&y).map(|(f, y)| f * y).sum();
                for (sum, y) in expected.iter_mut().zip(&y) {
                    *sum += weight * value * w.dot(n) * y;
                }
            }
            cosine_product(order, n, &f, &mut out);
            for (i, (a, b)) in out.iter().zip(&expected).enumerate() {
                assert!((a - b).abs() < 2e-14, "order {bands} coefficient {i}: {a} {b}");
            }
        }
    }
}
