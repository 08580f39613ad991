//! Functions that depend on the angle to an axis only: zonal harmonics, spherical caps, the clamped cosine.

use std::f64::consts::PI;

use glam::DVec3;

use super::harmonics::{Order, evaluate};

/// Turns zonal coefficients (`zonal[l]` = coefficient of Y_l0 about the z axis, one a band) to the unit vector `axis`:
/// g_lm = sqrt(4 pi / (2l + 1)) zonal_l Y_lm(axis) (Sloan, Kautz and Snyder 2002, section 3).
///
/// # Panics
/// If `zonal` does not hold `order.bands()` values.
pub fn rotate_zonal(order: Order, axis: DVec3, zonal: &[f64]) -> Vec<f64> {
    assert_eq!(zonal.len(), order.bands());
    let mut out = vec![0.0; order.len()];
    evaluate(order, axis, &mut out);
    for (l, g) in zonal.iter().enumerate() {
        let scale = (4.0 * PI / (2 * l + 1) as f64).sqrt() * g;
        out[l * l..(l + 1) * (l + 1)].iter_mut().for_each(|y| *y *= scale);
    }
    out
}

/// Zonal coefficients of the indicator of the cap w.z > c about the z axis, one a band:
/// sqrt(pi) (1 - c), then sqrt(pi / (2l + 1)) (P_{l-1}(c) - P_{l+1}(c)), since (2l + 1) P_l is the derivative of
/// P_{l+1} - P_{l-1}. `cos_half_angle` in [-1, 1]: 0 is the hemisphere, -1 the whole sphere.
pub fn zonal_cap(order: Order, cos_half_angle: f64) -> Vec<f64> {
    let c = cos_half_angle;
    let p = legendre(order.bands() + 1, c);
    (0..order.bands())
        .map(|l| match l {
            0 => PI.sqrt() * (1.0 - c),
            _ => (PI / (2 * l + 1) as f64).sqrt() * (p[l - 1] - p[l + 1]),
        })
        .collect()
}

/// Coefficients of the indicator of the cap w.axis > cos_half_angle about the unit vector `axis`; see [`zonal_cap`].
pub fn cap(order: Order, axis: DVec3, cos_half_angle: f64) -> Vec<f64> {
    rotate_zonal(order, axis, &zonal_cap(order, cos_half_angle))
}

/// Coefficients of the indicator of the hemisphere w.axis > 0, `axis` a unit vector.
pub fn hemisphere(order: Order, axis: DVec3) -> Vec<f64> {
    cap(order, axis, 0.0)
}

/// Coefficients of max(0, n.w), `n` a unit vector: the even bands and band 1 (Ramamoorthi and Hanrahan 2001, eq. 8).
///
/// Zonal: sqrt(pi)/2, sqrt(pi/3), and for even l
/// (-1)^(l/2 - 1) sqrt((2l + 1) pi) / ((l - 1)(l + 2)) * l! / (2^l (l/2)!^2).
pub fn clamped_cosine(order: Order, n: DVec3) -> Vec<f64> {
    // l! / (2^l (l/2)!^2) of the even l met so far.
    let mut central = 1.0;
    let zonal: Vec<f64> = (0..order.bands())
        .map(|l| match l {
            0 => PI.sqrt() / 2.0,
            1 => (PI / 3.0).sqrt(),
            _ if l % 2 == 1 => 0.0,
            _ => {
                let lf = l as f64;
                central *= (lf - 1.0) / lf;
                let sign = if l % 4 == 2 { 1.0 } else { -1.0 };
                sign * ((2.0 * lf + 1.0) * PI).sqrt() / ((lf - 1.0) * (lf + 2.0)) * central
            }
        })
        .collect();
    rotate_zonal(order, n, &zonal)
}

/// Legendre polynomials P_0 .. P_degree at `x`.
pub fn legendre(degree: usize, x: f64) -> Vec<f64> {
    let mut p = vec![1.0, x];
    for l in 2..=degree {
        let l = l as f64;
        let [.., before, last] = p[..] else { unreachable!("starts with two") };
        p.push(((2.0 * l - 1.0) * x * last - (l - 1.0) * before) / l);
    }
    p.truncate(degree + 1);
    p
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::quadrature::gauss_legendre;

    /// Coefficients of f(w.axis) by quadrature of its zonal expansion over [lo, 1], f a polynomial there.
    fn by_quadrature(order: Order, axis: DVec3, lo: f64, f: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut zonal = vec![0.0; order.bands()];
        let mut y = vec![0.0; order.len()];
        for (x, weight) in gauss_legendre(16) {
            let z = lo + (1.0 - lo) * 0.5 * (x + 1.0);
            evaluate(order, DVec3::new((1.0 - z * z).sqrt(), 0.0, z), &mut y);
            for (l, sum) in zonal.iter_mut().enumerate() {
                *sum += PI * (1.0 - lo) * weight * f(z) * y[l * l + l];
            }
        }
        rotate_zonal(order, axis, &zonal)
    }

    fn assert_close(a: &[f64], b: &[f64]) {
        assert_eq!(a.len(), b.len());
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            assert!((a - b).abs() < 1e-14, "coefficient {i}: {a} {b}");
        }
    }

    #[test]
    fn caps_and_cosine_equal_quadrature() {
        let axis = DVec3::new(2.0, -1.0, 0.5).normalize();
        for bands in 1..=10 {
            let order = Order::new(bands).unwrap();
            for c in [-1.0, -0.7, 0.0, 0.3, 0.999, 1.0] {
                assert_close(&cap(order, axis, c), &by_quadrature(order, axis, c, |_| 1.0));
            }
            assert_close(&clamped_cosine(order, axis), &by_quadrature(order, axis, 0.0, |z| z));
        }
    }

    #[test]
    fn the_turned_expansion_is_the_expansion_of_the_turned_function() {
        // f(w) = sum_l zonal_l Y_l0 about `axis`, evaluated at w, must equal the polynomial in w.axis.
        let order = Order::MAX;
        let axis = DVec3::new(-0.3, 0.9, 0.4).normalize();
        let zonal: Vec<f64> = (0..10).map(|l| f64::from(l).cos()).collect();
        let turned = rotate_zonal(order, axis, &zonal);
        let mut y = vec![0.0; order.len()];
        for w in crate::sphere::harmonics::tests::directions(50) {
            evaluate(order, w, &mut y);
            let value: f64 = turned.iter().zip(&y).map(|(g, y)| g * y).sum();
            let p = legendre(9, w.dot(axis));
            let expected: f64 = (0..10).map(|l| zonal[l] * ((2 * l + 1) as f64 / (4.0 * PI)).sqrt() * p[l]).sum();
            assert!((value - expected).abs() < 1e-13);
        }
    }
}
