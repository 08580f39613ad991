//! Real orthonormal spherical harmonics, index `l*l + l + m`, without the Condon-Shortley sign.
//!
//! ```text
//! Y_lm(w) = sqrt(2) K_l|m| P_l|m|(z) sin(|m| phi)   m < 0
//!           K_l0 P_l(z)                             m = 0
//!           sqrt(2) K_lm P_lm(z) cos(m phi)         m > 0       Y_1 = sqrt(3/4pi) (y, z, x)
//! ```
//!
//! "Order n" means n bands l = 0 .. n-1, that is n^2 coefficients.

use std::sync::LazyLock;

use glam::DVec3;

use crate::{Error, Result};

/// Number of bands of a spherical-harmonic expansion, 1 to 10.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Order(u8);

impl Order {
    /// The largest order on offer.
    pub const MAX: Order = Order(10);

    /// An order of `bands` bands.
    ///
    /// # Errors
    /// [`Error::Input`] unless `1 <= bands <= 10`.
    pub fn new(bands: usize) -> Result<Self> {
        match bands {
            1..=10 => Ok(Self(bands as u8)),
            _ => Err(Error::input(format!(
                "a spherical-harmonic order is a number of bands from 1 to {}, not {bands}",
                Self::MAX.0
            ))),
        }
    }

    /// Number of bands, n.
    pub fn bands(self) -> usize {
        self.0.into()
    }

    /// Number of coefficients, n^2.
    #[expect(clippy::len_without_is_empty, reason = "an order always has a band 0")]
    pub fn len(self) -> usize {
        self.bands() * self.bands()
    }

    /// One band more, up to eleven: what [`cosine_product`](super::cosine_product) needs of its other factor.
    pub fn raised(self) -> Self {
        Self((self.0 + 1).min(TABLED as u8))
    }
}

/// Bands in the table of the recurrence: one more than [`Order::MAX`].
const TABLED: usize = 11;

/// Index of the coefficient of degree l and order m.
pub fn index(l: usize, m: isize) -> usize {
    (l * l + l).wrapping_add_signed(m)
}

/// Factors of the recurrence in l for one pair (l, m), l > m.
#[derive(Clone, Copy, Default)]
struct Step {
    /// sqrt((4 l^2 - 1) / (l^2 - m^2))
    a: f64,
    /// a sqrt(((l-1)^2 - m^2) / (4 (l-1)^2 - 1)); 0 for l = m + 1
    b: f64,
}

struct Recurrence {
    /// Q_m^m = K_mm (2m-1)!!, times sqrt(2) for m > 0.
    diagonal: [f64; TABLED],
    /// `steps[m][l]`
    steps: [[Step; TABLED]; TABLED],
}

static RECURRENCE: LazyLock<Recurrence> = LazyLock::new(|| {
    let mut table = Recurrence { diagonal: [0.0; TABLED], steps: [[Step::default(); TABLED]; TABLED] };
    // (2m-1)!!^2 / (2m)! = product of (2k-1)/(2k).
    let mut ratio = 1.0;
    for m in 0..TABLED {
        let mf = m as f64;
        if m > 0 {
            ratio *= (2.0 * mf - 1.0) / (2.0 * mf);
        }
        let sides = if m == 0 { 1.0 } else { 2.0 };
        table.diagonal[m] = (sides * (2.0 * mf + 1.0) * ratio / (4.0 * std::f64::consts::PI)).sqrt();
        for l in m + 1..TABLED {
            let lf = l as f64;
            let a = ((4.0 * lf * lf - 1.0) / (lf * lf - mf * mf)).sqrt();
            let k = lf - 1.0;
            table.steps[m][l] = Step { a, b: a * ((k * k - mf * mf) / (4.0 * k * k - 1.0)).max(0.0).sqrt() };
        }
    }
    table
});

/// y(w): all harmonics of `order` in the unit direction `w`, written to `out` (`order.len()` values).
///
/// Fully normalised recurrence in Cartesian coordinates, without poles: Q_l^m(z) = P_lm / sin^m(theta) upwards in l
/// (Holmes and Featherstone 2002, eq. 11) times the real and imaginary parts of (x + i y)^m. The absolute error is a few
/// 1e-15 up to order 10. For `|w| != 1` the values are those of the recurrence, not of `w / |w|`.
///
/// # Panics
/// If `out` is not `order.len()` long.
pub fn evaluate(order: Order, w: DVec3, out: &mut [f64]) {
    assert_eq!(out.len(), order.len());
    recurrence(order, [w.x], [w.y], [w.z], |i, [value]| out[i] = value);
}

/// y(w) for many directions: row k of `out` (`directions.len() * order.len()` values) holds y of `directions[k]`.
///
/// Eight directions at a time in structure-of-arrays form, which compilers vectorise; bit-identical to [`evaluate`].
///
/// # Panics
/// If `out` has another length.
pub fn evaluate_many(order: Order, directions: &[DVec3], out: &mut [f64]) {
    const LANES: usize = 8;
    let len = order.len();
    assert_eq!(out.len(), directions.len() * len);
    for (chunk, rows) in directions.chunks(LANES).zip(out.chunks_mut(LANES * len)) {
        let lane = |axis: usize| std::array::from_fn::<f64, LANES, _>(|k| chunk[k.min(chunk.len() - 1)][axis]);
        recurrence(order, lane(0), lane(1), lane(2), |i, values: [f64; LANES]| {
            for (row, value) in rows.chunks_exact_mut(len).zip(values) {
                row[i] = value;
            }
        });
    }
}

/// Calls `write(index, Y)` once for every coefficient, for N directions at a time.
#[inline(always)]
fn recurrence<const N: usize>(
    order: Order,
    x: [f64; N],
    y: [f64; N],
    z: [f64; N],
    mut write: impl FnMut(usize, [f64; N]),
) {
    let Recurrence { diagonal, steps } = &*RECURRENCE;
    let bands = order.bands();
    // (x + i y)^m
    let (mut re, mut im) = ([1.0; N], [0.0; N]);
    for m in 0..bands {
        let mut q = [diagonal[m]; N];
        let mut q_before = [0.0; N];
        for (l, Step { a, b }) in steps[m][..bands].iter().enumerate().skip(m) {
            if l > m {
                let q_next = std::array::from_fn(|k| a * z[k] * q[k] - b * q_before[k]);
                (q_before, q) = (q, q_next);
            }
            write(l * l + l + m, std::array::from_fn(|k| q[k] * re[k]));
            if m > 0 {
                write(l * l + l - m, std::array::from_fn(|k| q[k] * im[k]));
            }
        }
        (re, im) = (
            std::array::from_fn(|k| x[k] * re[k] - y[k] * im[k]),
            std::array::from_fn(|k| x[k] * im[k] + y[k] * re[k]),
        );
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::sphere::quadrature::product_rule;

    /// The textbook definition: unnormalised associated Legendre functions, angles, factorials.
    fn by_definition(l: usize, m: isize, w: DVec3) -> f64 {
        let k = m.unsigned_abs();
        let sine = (w.x * w.x + w.y * w.y).sqrt();
        let mut p = (1..=k).map(|i| (2 * i - 1) as f64 * sine).product::<f64>();
        let mut before = 0.0;
        for j in k + 1..=l {
            let next = ((2 * j - 1) as f64 * w.z * p - (j + k - 1) as f64 * before) / (j - k) as f64;
            (before, p) = (p, next);
        }
        let ratio = (l - k + 1..=l + k).map(|i| i as f64).product::<f64>();
        let norm = ((2 * l + 1) as f64 / (4.0 * std::f64::consts::PI * ratio)).sqrt();
        let phi = w.y.atan2(w.x);
        match m {
            0 => norm * p,
            1.. => std::f64::consts::SQRT_2 * norm * p * (m as f64 * phi).cos(),
            _ => std::f64::consts::SQRT_2 * norm * p * (k as f64 * phi).sin(),
        }
    }

    /// Points of a golden-section spiral on the sphere, with the six axis directions.
    pub(crate) fn directions(count: usize) -> Vec<DVec3> {
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let spiral = (0..count).map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let (s, c) = (golden * i as f64).sin_cos();
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * c, r * s, z)
        });
        spiral.chain(DVec3::AXES).chain(DVec3::AXES.map(|a| -a)).collect()
    }

    #[test]
    fn equal_the_definition() {
        let order = Order::MAX.raised();
        let mut y = vec![0.0; order.len()];
        for w in directions(200) {
            evaluate(order, w, &mut y);
            for l in 0..order.bands() {
                for m in -(l as isize)..=l as isize {
                    let expected = by_definition(l, m, w);
                    assert!((y[index(l, m)] - expected).abs() < 2e-14, "l {l} m {m} w {w}");
                }
            }
        }
    }

    #[test]
    fn first_band_is_y_z_x() {
        let mut y = [0.0; 4];
        evaluate(Order::new(2).unwrap(), DVec3::new(0.36, 0.48, 0.8), &mut y);
        let k = (0.75 / std::f64::consts::PI).sqrt();
        for (value, expected) in y[1..].iter().zip([0.48 * k, 0.8 * k, 0.36 * k]) {
            assert!((value - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn are_orthonormal() {
        let order = Order::MAX;
        let n = order.len();
        let mut gram = vec![0.0; n * n];
        let mut y = vec![0.0; n];
        for (w, weight) in product_rule(10, 20) {
            evaluate(order, w, &mut y);
            for i in 0..n {
                for j in 0..n {
                    gram[i * n + j] += weight * y[i] * y[j];
                }
            }
        }
        for i in 0..n {
            for j in 0..n {
                assert!((gram[i * n + j] - f64::from(u8::from(i == j))).abs() < 1e-13, "{i} {j}");
            }
        }
    }

    #[test]
    fn many_equal_one_by_one_to_the_bit() {
        let w = directions(13);
        for bands in 1..=10 {
            let order = Order::new(bands).unwrap();
            let mut rows = vec![f64::NAN; w.len() * order.len()];
            evaluate_many(order, &w, &mut rows);
            let mut y = vec![0.0; order.len()];
            for (w, row) in w.iter().zip(rows.chunks(order.len())) {
                evaluate(order, *w, &mut y);
                assert_eq!(y, row);
            }
        }
    }

    #[test]
    fn orders_outside_one_to_ten_are_refused() {
        for bands in [0, 11, usize::MAX] {
            let message = Order::new(bands).unwrap_err().to_string();
            assert!(message.contains("from 1 to 10") && message.contains(&bands.to_string()));
        }
    }
}
