//! How far a proxy's influence is followed: the coverage oracle (Sloan et al. 2007, section 4.1).

use std::f64::consts::PI;

use glam::DVec3;

use super::lanes::Lanes;
use super::light::{DistantLight, normals};
use crate::sphere::{Order, TripleProduct, cap, clamped_cosine, zonal_cap};

/// The reach of proxies: `expansion` times their radius, where their influence has been led smoothly to zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    /// Reach over radius, eta in the paper: at least 1.
    pub expansion: f32,
}

/// From the sine at which influence ends to the one from which on it is whole: the paper's four entries of the table.
pub(super) const FADE: f32 = 1.25;

impl Coverage {
    /// Reach for shadows under `light`: outside of it one proxy changes the irradiance of no receiver, whatever its normal, by
    /// more than `error` of the greatest irradiance.
    ///
    /// The paper's oracle, specialised to the light at hand. Without light nothing changes: the reach is 1.
    pub fn for_shadows(light: &DistantLight, error: f64) -> Self {
        let order = light.order();
        let product = TripleProduct::new(order);
        let greatest = light.greatest_irradiance();
        if greatest <= 0.0 {
            return Self { expansion: 1.0 };
        }
        let cosines: Vec<(DVec3, Vec<f64>)> = normals().map(|n| (n, clamped_cosine(order, n))).collect();
        // What a thin cap hides is the light of its direction times the cosine: only directions that are bright enough can
        // matter, but spherical harmonics ring, so all are tried.
        let mut hidden = vec![0.0; order.len()];
        let largest_change = |alpha: f64| {
            let c = (1.0 - alpha * alpha).sqrt();
            let mut largest = 0.0f64;
            for (axis, _) in &cosines {
                let cap = cap(order, *axis, c);
                for colour in light.coefficients() {
                    product.product(&cap, colour, &mut hidden);
                    // Normals near the proxy's direction see most of it.
                    for (_, cosine) in cosines.iter().filter(|(n, _)| n.dot(*axis) > 0.8) {
                        let change: f64 = hidden.iter().zip(cosine).map(|(h, c)| h * c).sum();
                        largest = largest.max(change.abs());
                    }
                }
            }
            largest / greatest
        };
        Self::from_bisection(largest_change, error)
    }

    /// Reach for indirect light, as [`Self::for_shadows`]: white proxies that all show their brightest side.
    pub fn for_indirect(light: &DistantLight, error: f64) -> Self {
        let greatest = light.greatest_irradiance();
        if greatest <= 0.0 {
            return Self { expansion: 1.0 };
        }
        let order = Order::new(3).expect("three bands are an order");
        let cosine = clamped_cosine(order, DVec3::Z);
        // A proxy straight above the receiver: radiance at most greatest / pi over its cap.
        let largest_change = |alpha: f64| {
            let cap = zonal_cap(order, (1.0 - alpha * alpha).sqrt());
            cap.iter().enumerate().map(|(l, v)| v * cosine[l * l + l]).sum::<f64>() / PI
        };
        Self::from_bisection(largest_change, error)
    }

    /// The sine at which a change that grows with it reaches `error`, up to a factor of 1.001.
    fn from_bisection(mut largest_change: impl FnMut(f64) -> f64, error: f64) -> Self {
        let (mut low, mut high) = (1e-4f64, 1.0f64);
        while high > 1.001 * low {
            let middle = (low * high).sqrt();
            if largest_change(middle) > error { high = middle } else { low = middle }
        }
        Self { expansion: (1.0 / low) as f32 }
    }

    /// Distance up to which a proxy of `radius` is followed.
    #[inline(always)]
    pub fn reach(self, radius: f32) -> f32 {
        self.expansion * radius
    }

    /// Factor on the influence of proxies with these sines: 0 at the end of their reach, 1 from a quarter above it on.
    ///
    /// The influence falls like the square of the sine, so that the part taken away is nowhere more than 1.03 times the whole at
    /// the end of the reach.
    #[inline(always)]
    pub(super) fn fade(self, alpha: Lanes) -> Lanes {
        let end = 1.0 / self.expansion;
        ((alpha - end) * (1.0 / ((FADE - 1.0) * end))).smoothstep()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::evaluate;

    /// The peakiest light of four bands, from the direction z.
    fn delta() -> DistantLight {
        let order = Order::new(4).unwrap();
        let mut y = vec![0.0; order.len()];
        evaluate(order, DVec3::Z, &mut y);
        DistantLight::from_coefficients(order, [y.clone(), y.clone(), y])
    }

    #[test]
    fn peaky_light_needs_the_measured_reach() {
        // Independently measured for order 4: 28 for 1/256, 20 for 1/128, 14 for 1/64.
        for (error, expansion) in [(1.0 / 256.0, 28.0), (1.0 / 128.0, 20.0), (1.0 / 64.0, 14.0)] {
            let found = Coverage::for_shadows(&delta(), error).expansion;
            assert!((found / expansion - 1.0).abs() < 0.04, "{error}: {found}");
        }
    }

    #[test]
    fn even_light_needs_less() {
        let order = Order::new(4).unwrap();
        let mut constant = vec![0.0; order.len()];
        constant[0] = 1.0;
        let even = DistantLight::from_coefficients(order, [constant.clone(), constant.clone(), constant]);
        let [even, peaky] = [&even, &delta()].map(|light| Coverage::for_shadows(light, 1.0 / 256.0).expansion);
        assert!(even < 0.7 * peaky, "{even} {peaky}");
        let dark = DistantLight::from_coefficients(order, [(); 3].map(|()| vec![0.0; order.len()]));
        assert_eq!(Coverage::for_shadows(&dark, 0.01).expansion, 1.0);
    }

    #[test]
    fn fading_takes_little_away() {
        let coverage = Coverage { expansion: 20.0 };
        let mut before = 0.0;
        for i in 0..1000 {
            let alpha = 0.05 * (0.9 + 0.4 * i as f32 / 1000.0);
            let fade = coverage.fade(Lanes::splat(alpha)).0[0];
            assert!(fade >= before && (alpha > 0.05 || fade == 0.0) && (alpha < 0.0625 || fade == 1.0));
            before = fade;
            if alpha >= 0.05 {
                assert!((1.0 - fade) * (alpha / 0.05).powi(2) < 1.03);
            }
        }
    }
}
