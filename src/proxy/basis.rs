//! Spherical harmonics of eight directions at once, in single precision.

use std::sync::LazyLock;

use super::lanes::Lanes;

/// Bands on offer to the renderer.
pub const MAX_BANDS: usize = 6;

/// Factors of the recurrence of [`sphere::evaluate`](crate::sphere::evaluate), rounded.
struct Factors {
    diagonal: [f32; MAX_BANDS],
    /// `steps[m][l]`, l > m: Q_l = a z Q_{l-1} - b Q_{l-2}.
    steps: [[[f32; 2]; MAX_BANDS]; MAX_BANDS],
}

static FACTORS: LazyLock<Factors> = LazyLock::new(|| {
    let mut diagonal = [0.0; MAX_BANDS];
    let mut steps = [[[0.0; 2]; MAX_BANDS]; MAX_BANDS];
    // (2m-1)!!^2 / (2m)!
    let mut ratio = 1.0;
    for m in 0..MAX_BANDS {
        let mf = m as f64;
        if m > 0 {
            ratio *= (2.0 * mf - 1.0) / (2.0 * mf);
        }
        let sides = if m == 0 { 1.0 } else { 2.0 };
        diagonal[m] = (sides * (2.0 * mf + 1.0) * ratio / (4.0 * std::f64::consts::PI)).sqrt() as f32;
        for (l, step) in steps[m].iter_mut().enumerate().skip(m + 1) {
            let (lf, k) = (l as f64, l as f64 - 1.0);
            let a = ((4.0 * lf * lf - 1.0) / (lf * lf - mf * mf)).sqrt();
            let b = a * ((k * k - mf * mf) / (4.0 * k * k - 1.0)).max(0.0).sqrt();
            *step = [a as f32, b as f32];
        }
    }
    Factors { diagonal, steps }
});

/// y(w) of eight unit directions: `LEN` = `BANDS` squared coefficients, in the order and with the signs of
/// [`sphere::evaluate`](crate::sphere::evaluate), to about 1e-6.
#[inline(always)]
pub fn basis<const BANDS: usize, const LEN: usize>([x, y, z]: [Lanes; 3]) -> [Lanes; LEN] {
    let Factors { diagonal, steps } = &*FACTORS;
    let mut out = [Lanes::ZERO; LEN];
    let (mut re, mut im) = (Lanes::splat(1.0), Lanes::ZERO);
    for m in 0..BANDS {
        let mut q = Lanes::splat(diagonal[m]);
        let mut before = Lanes::ZERO;
        for l in m..BANDS {
            if l > m {
                let [a, b] = steps[m][l];
                (before, q) = (q, z * q * a - before * b);
            }
            out[l * l + l + m] = q * re;
            if m > 0 {
                out[l * l + l - m] = q * im;
            }
        }
        (re, im) = (x * re - y * im, x * im + y * re);
    }
    out
}

/// The factors of the recurrence for code in another language: those of [`basis`], `(diagonal[m], steps[m][l])`.
#[cfg(feature = "gpu")]
pub(super) fn factors() -> (&'static [f32; MAX_BANDS], &'static [[[f32; 2]; MAX_BANDS]; MAX_BANDS]) {
    (&FACTORS.diagonal, &FACTORS.steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::{Order, evaluate, product_rule};
    use glam::DVec3;

    #[test]
    fn equals_double_precision() {
        let directions: Vec<DVec3> = product_rule(6, 8).map(|(w, _)| w).chain(DVec3::AXES).collect();
        let mut exact = vec![0.0; 36];
        for eight in directions.chunks(8) {
            let axis = |a: usize| Lanes::each(|i| eight[i.min(eight.len() - 1)][a] as f32);
            let y: [Lanes; 36] = basis::<6, 36>([axis(0), axis(1), axis(2)]);
            let low: [Lanes; 16] = basis::<4, 16>([axis(0), axis(1), axis(2)]);
            assert_eq!(y[..16], low);
            for (lane, w) in eight.iter().enumerate() {
                evaluate(Order::new(6).unwrap(), *w, &mut exact);
                for (k, exact) in exact.iter().enumerate() {
                    assert!((f64::from(y[k].0[lane]) - exact).abs() < 2e-6, "coefficient {k} of {w}");
                }
            }
        }
    }
}
