//! How many bands a material's lobe needs.

use std::f64::consts::PI;
use std::fmt;

use super::Order;
use crate::{Error, Result};

/// A normalised cosine power about an axis, (s + 1) / 2 pi max(0, cos)^s: the diffuse lobe for s = 1, a Phong lobe for larger s.
///
/// Light that is reflected through such a lobe is its convolution with it: what is beyond the lobe's bands is lost in any case
/// (Ramamoorthi and Hanrahan 2001, 2002).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    exponent: f64,
}

impl Lobe {
    /// Lambert's cosine.
    pub const DIFFUSE: Self = Self { exponent: 1.0 };

    /// Fewest bands on offer: a single one knows no direction.
    const LEAST: usize = 2;

    /// A lobe of the exponent s.
    ///
    /// # Errors
    /// An exponent that is negative or not finite.
    pub fn new(exponent: f64) -> Result<Self> {
        match exponent.is_finite() && exponent >= 0.0 {
            true => Ok(Self { exponent }),
            false => Err(Error::input(format!("a lobe's exponent must be finite and not negative, not {exponent}"))),
        }
    }

    /// Zonal coefficients, of Y_l0 about the lobe's axis, one a band: (s + 1) sqrt((2l + 1) / 4 pi) I_l.
    ///
    /// I_l, the integral of z^s P_l(z) over [0, 1], is 1 / (s + 1), 1 / (s + 2), then I_l = I_(l-2) (s - l + 2) / (s + l + 1) (from
    /// Gradshteyn and Ryzhik, 7.126.1).
    pub fn zonal(self, order: Order) -> Vec<f64> {
        let s = self.exponent;
        let mut integrals = vec![1.0 / (s + 1.0), 1.0 / (s + 2.0)];
        for l in 2..order.bands() {
            integrals.push(integrals[l - 2] * (s - l as f64 + 2.0) / (s + l as f64 + 1.0));
        }
        let scaled = |(l, integral): (usize, &f64)| (s + 1.0) * ((2 * l + 1) as f64 / (4.0 * PI)).sqrt() * integral;
        integrals.iter().take(order.bands()).enumerate().map(scaled).collect()
    }

    /// What the lobe loses beyond the bands of `order`: L2 norm over the sphere, relative to the lobe's own.
    pub fn error(self, order: Order) -> f64 {
        let s = self.exponent;
        let norm = (s + 1.0).powi(2) / (2.0 * PI * (2.0 * s + 1.0));
        let kept: f64 = self.zonal(order).iter().map(|g| g * g).sum();
        (1.0 - kept / norm).max(0.0).sqrt()
    }

    /// The fewest bands, at least two, beyond which the lobe loses no more than `error`, see [`Lobe::error`].
    ///
    /// # Errors
    /// If those on offer are too few.
    pub fn order(self, error: f64) -> Result<Order> {
        let bands = (Self::LEAST..=Order::MAX.bands()).map(Order::new);
        let orders = bands.collect::<Result<Vec<_>>>()?;
        orders.into_iter().find(|&order| self.error(order) <= error).ok_or_else(|| {
            Error::input(format!(
                "the lobe {self} loses {:.3} of itself beyond {} bands, which are the most on offer; allow that much",
                // Rounded up, so that what is said is enough.
                (1e3 * self.error(Order::MAX)).ceil() / 1e3,
                Order::MAX.bands()
            ))
        })
    }
}

impl fmt::Display for Lobe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::DIFFUSE => f.write_str("diffuse"),
            Self { exponent } => write!(f, "cos^{exponent}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::sphere::{clamped_cosine, gauss_legendre, legendre, rotate_zonal};

    /// Integral of f(z) over the sphere's part with z in [low, high], for polynomials up to degree 100.
    fn integral(low: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
        let half = 0.5 * (high - low);
        let nodes = gauss_legendre(60);
        2.0 * PI * nodes.iter().map(|&(x, weight)| half * weight * f(low + half * (x + 1.0))).sum::<f64>()
    }

    fn value(s: f64, z: f64) -> f64 {
        (s + 1.0) / (2.0 * PI) * z.powf(s)
    }

    fn zonal_harmonic(l: usize, z: f64) -> f64 {
        ((2 * l + 1) as f64 / (4.0 * PI)).sqrt() * legendre(l, z)[l]
    }

    #[test]
    fn coefficients_equal_quadrature() {
        for s in [0.0, 0.5, 1.0, 2.0, 2.5, 7.0, 20.0, 31.5] {
            let zonal = Lobe::new(s).unwrap().zonal(Order::MAX);
            for (l, coefficient) in zonal.into_iter().enumerate() {
                // With z = u^2, halves in the exponent are polynomials, too.
                let expected = integral(0.0, 1.0, |u| 2.0 * u * value(s, u * u) * zonal_harmonic(l, u * u));
                assert!((coefficient - expected).abs() < 1e-13 * (s + 1.0), "{s}, band {l}: {coefficient} {expected}");
            }
        }
    }

    #[test]
    fn the_diffuse_lobe_is_the_clamped_cosine() {
        let axis = DVec3::new(0.3, -0.4, 0.9).normalize();
        let lobe = rotate_zonal(Order::MAX, axis, &Lobe::DIFFUSE.zonal(Order::MAX));
        for (ours, cosine) in lobe.iter().zip(clamped_cosine(Order::MAX, axis)) {
            assert!((PI * ours - cosine).abs() < 1e-14, "{ours} {cosine}");
        }
    }

    #[test]
    fn the_error_is_the_norm_of_what_is_left_out() {
        for s in [0.0, 1.0, 3.0, 12.0, 40.0] {
            let lobe = Lobe::new(s).unwrap();
            let norm = integral(0.0, 1.0, |z| value(s, z).powi(2));
            for order in (1..=10).map(|bands| Order::new(bands).unwrap()) {
                let zonal = lobe.zonal(order);
                let series = |z: f64| zonal.iter().enumerate().map(|(l, g)| g * zonal_harmonic(l, z)).sum::<f64>();
                let above = integral(0.0, 1.0, |z| (value(s, z) - series(z)).powi(2));
                let below = integral(-1.0, 0.0, |z| series(z).powi(2));
                let expected = ((above + below) / norm).sqrt();
                assert!((lobe.error(order) - expected).abs() < 1e-12, "{s} {order:?} {expected}");
            }
        }
        // Ramamoorthi and Hanrahan 2001, section 4.1: three bands of the diffuse lobe hold 99.22 % of its energy.
        let kept = 1.0 - Lobe::DIFFUSE.error(Order::new(3).unwrap()).powi(2);
        assert!((kept - 0.9922).abs() < 5e-5, "{kept}");
    }

    #[test]
    fn the_fewest_bands_that_are_enough() {
        for (s, error) in [(1.0, 0.1), (1.0, 0.05), (1.0, 0.02), (0.0, 0.5), (5.0, 0.1), (30.0, 0.3)] {
            let lobe = Lobe::new(s).unwrap();
            let bands = lobe.order(error).unwrap().bands();
            assert!(lobe.error(Order::new(bands).unwrap()) <= error);
            assert!(bands == 2 || lobe.error(Order::new(bands - 1).unwrap()) > error, "{s} {error}: {bands}");
        }
        assert_eq!(Lobe::DIFFUSE.order(0.1).unwrap().bands(), 3);
        assert_eq!(Lobe::DIFFUSE.order(0.99).unwrap().bands(), 2);
        // Sharper lobes never need fewer.
        let bands: Vec<_> = (1..20).map(|s| Lobe::new(s.into()).unwrap().order(0.2).unwrap().bands()).collect();
        assert!(bands.is_sorted() && bands[0] < bands[18], "{bands:?}");

        let sharp = Lobe::new(500.0).unwrap();
        let message = sharp.order(0.1).unwrap_err().to_string();
        assert!(message.contains("cos^500") && message.contains("10 bands"), "{message}");
        let stated: f64 = message.split(' ').find_map(|word| word.parse().ok().filter(|x| *x < 1.0)).unwrap();
        assert!(sharp.order(stated).is_ok(), "{message}");
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(Lobe::new(bad).is_err());
        }
    }
}
