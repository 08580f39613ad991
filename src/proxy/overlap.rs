//! Spheres of one body overlap; the sum of their logarithms does not know it.

use std::borrow::Cow;
use std::f64::consts::TAU;
use std::fmt;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Proxy;

/// What the logarithms of overlapping spheres of one body add up to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum Overlap {
    /// Each sphere counts by its [`Proxy::share`]: any number of spheres in one place hides what one hides.
    #[default]
    Shared,
    /// Each counts whole, as in the paper. In few bands the more spheres a body has, the darker are its shadows.
    Multiplied,
}

impl fmt::Display for Overlap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Shared => "shared",
            Self::Multiplied => "multiplied",
        })
    }
}

impl Overlap {
    /// The proxies as they count.
    pub(super) fn counted(self, proxies: &[Proxy]) -> Cow<'_, [Proxy]> {
        match self {
            Self::Shared => Cow::Borrowed(proxies),
            Self::Multiplied => proxies.iter().map(|proxy| Proxy { share: 1.0, ..*proxy }).collect(),
        }
    }
}

/// Lines through every sphere: shares are right to 0.01 in the mean then, and to 0.03 at worst.
const LINES: usize = 128;

/// Gives every sphere of a body its share of what it hides with others of the body: the mean, over the lines through it, of one over
/// the number of spheres that have a part in common with it on that line, itself included.
///
/// In few bands the logarithm of a small cap is low and wide, and the exponential of a sum nearly one plus the sum: spheres that
/// overlap hide their common solid angle as often as there are spheres. Shares make the sum that of the union, from whatever side
/// the body is seen; the 2007 paper does the same to reflected light, receiver by receiver (equation 12).
pub fn share_overlap(body: &mut [Proxy]) {
    let balls: Vec<(Vec3, f32)> = body.iter().map(|proxy| (proxy.center, proxy.radius)).collect();
    let lines = lines();
    body.par_iter_mut().for_each(|proxy| {
        let meets = |(center, radius): &&(Vec3, f32)| center.distance(proxy.center) < radius + proxy.radius;
        let near = balls.iter().filter(meets);
        let near: Vec<(DVec3, f64)> =
            near.map(|(center, radius)| ((*center - proxy.center).as_dvec3(), f64::from(*radius))).collect();
        let radius = f64::from(proxy.radius);
        let shares = lines.iter().map(|(direction, offset)| {
            let from = radius * *offset;
            let half = (radius * radius - from.length_squared()).max(0.0).sqrt();
            let holds = |(center, radius): &&(DVec3, f64)| {
                let relative = *center - from;
                let along = relative.dot(*direction);
                let squared = radius * radius - (relative.length_squared() - along * along);
                squared > 0.0 && along.abs() < half + squared.sqrt()
            };
            1.0 / near.iter().filter(holds).count().max(1) as f64
        });
        proxy.share = (shares.sum::<f64>() / LINES as f64) as f32;
    });
}

/// Lines through the unit ball, evenly: directions, and offsets from the centre across them.
fn lines() -> Vec<(DVec3, DVec3)> {
    // Powers of the root of x^4 = x + 1 spread points over a cube (Roberts 2018), the fourth dimension is cut evenly.
    const ROOT: f64 = 1.220_744_084_605_759_6;
    let line = |k: usize| {
        let at = k as f64 + 0.5;
        let z = 1.0 - 2.0 * at / LINES as f64;
        let [turn, u, v] = [1, 2, 3].map(|power| (at / ROOT.powi(power)).fract());
        let (sin, cos) = (TAU * turn).sin_cos();
        let direction = DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
        let (a, b) = direction.any_orthonormal_pair();
        let (sin, cos) = (TAU * v).sin_cos();
        (direction, u.sqrt() * (cos * a + sin * b))
    };
    (0..LINES).map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shares(spheres: &[(f32, f32)]) -> Vec<f32> {
        let proxy = |&(x, radius): &(f32, f32)| Proxy {
            center: Vec3::new(0.3 + x, 0.5, -0.7),
            radius,
            albedo: Vec3::ZERO,
            share: 0.5,
        };
        let mut body: Vec<Proxy> = spheres.iter().map(proxy).collect();
        share_overlap(&mut body);
        body.iter().map(|proxy| proxy.share).collect()
    }

    #[test]
    fn two_spheres_share_their_lens() {
        assert_eq!(shares(&[(0.0, 1.0), (2.1, 1.0), (-4.0, 1.9)]), [1.0; 3]);
        assert_eq!(shares(&[(0.0, 1.0); 5]), [0.2; 5]);
        // Of the lines through a ball those through a convex body in it are the share of the surfaces (Cauchy 1841); that of the
        // lens of two unit balls, two caps of height 1 - d / 2, is 4 pi (1 - d / 2).
        for d in [0.4, 1.0, 1.6] {
            let expected = 1.0 - 0.5 * (1.0 - 0.5 * d);
            for share in shares(&[(0.0, 1.0), (d, 1.0)]) {
                // See `LINES`.
                assert!((share - expected).abs() < 0.04, "{d}: {share} {expected}");
            }
        }
        // All lines through the inner of two share it; of those through the outer, the ratio of the surfaces.
        let [inner, outer] = shares(&[(0.1, 0.5), (0.0, 1.0)])[..] else { unreachable!() };
        assert!(inner == 0.5 && (outer - (1.0 - 0.5 * 0.25)).abs() < 0.04, "{inner} {outer}");
    }

    #[test]
    fn shares_of_many_in_one_place_add_up_to_one() {
        for count in [10, 40] {
            let chain: Vec<(f32, f32)> = (0..count).map(|k| (k as f32 / count as f32, 4.0)).collect();
            let sum: f32 = shares(&chain).iter().sum();
            assert!((1.0..1.3).contains(&sum), "{count}: {sum}");
        }
    }
}
