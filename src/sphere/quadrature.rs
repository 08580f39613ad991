//! Quadrature on an interval and on the sphere.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Nodes and weights of the `n`-point Gauss-Legendre rule on [-1, 1], exact for polynomials of degree 2n - 1.
///
/// Newton iteration on P_n from Tricomi's first guess (Davis and Rabinowitz 1984, section 2.7); nodes ascend, errors are a
/// few units in the last place for the n up to a few hundred that are used here.
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let mut rule: Vec<_> = (0..n)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            // Quadratic convergence from an O(n^-2) guess: five steps are past the last bit; ten cost nothing.
            for _ in 0..10 {
                let (mut p, mut before) = (1.0, 0.0);
                for k in 1..=n {
                    let k = k as f64;
                    (p, before) = (((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k, p);
                }
                slope = n as f64 * (x * p - before) / (x * x - 1.0);
                x -= p / slope;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect();
    rule.reverse();
    rule
}

/// Directions and weights on the sphere: Gauss-Legendre in z times the trapezoid rule in longitude; exact for polynomials
/// of degree below both `2 * latitudes` and `longitudes`.
pub fn product_rule(latitudes: usize, longitudes: usize) -> impl Iterator<Item = (DVec3, f64)> {
    let step = TAU / longitudes as f64;
    gauss_legendre(latitudes).into_iter().flat_map(move |(z, weight)| {
        (0..longitudes).map(move |k| {
            let r = (1.0 - z * z).sqrt();
            let (s, c) = (step * k as f64).sin_cos();
            (DVec3::new(r * c, r * s, z), weight * step)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_legendre_is_exact_to_its_degree_and_no_further() {
        for n in [1, 2, 5, 20, 64] {
            let rule = gauss_legendre(n);
            let moment = |degree: usize| rule.iter().map(|&(x, w)| w * x.powi(degree as i32)).sum::<f64>();
            for degree in 0..2 * n {
                let expected = if degree % 2 == 0 { 2.0 / (degree + 1) as f64 } else { 0.0 };
                assert!((moment(degree) - expected).abs() < 1e-14, "n {n} degree {degree}");
            }
            // The error in x^2n is 2^(2n+1) n!^4 / ((2n+1) (2n)!^2), about pi 4^-n: visible for small n.
            if n <= 5 {
                assert!((2.0 / (2 * n + 1) as f64 - moment(2 * n)) > 4f64.powi(-(n as i32)), "n {n}");
            }
        }
    }

    #[test]
    fn product_rule_integrates_the_sphere() {
        let sum = |f: fn(DVec3) -> f64| product_rule(3, 6).map(|(w, weight)| weight * f(w)).sum::<f64>();
        assert!((sum(|_| 1.0) - 4.0 * PI).abs() < 1e-14);
        assert!((sum(|w| w.x * w.x) - 4.0 * PI / 3.0).abs() < 1e-14);
        assert!((sum(|w| w.x * w.x * w.y * w.y) - 4.0 * PI / 15.0).abs() < 1e-14);
        assert!(sum(|w| w.x * w.y * w.z).abs() < 1e-15);
    }
}
