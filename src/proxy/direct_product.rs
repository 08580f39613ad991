//! Visibility without logarithms: the product of what every sphere leaves, direction by direction. The quality mode.

use std::f32::consts::TAU;

use super::coverage::Coverage;
use super::exponential::ONE;
use super::harmonic_buffer::HarmonicBuffer;
use super::lanes::{LANES, Lanes};
use super::self_shadow::{Seen, SelfShadowing};
use super::tiles::{Group, Sight, Splat, SplatCounts, splat_tiles};
use super::{Proxy, Receivers};
use crate::sphere::{Order, evaluate, product_rule};

/// Latitudes and longitudes of the directions: their rule integrates products of harmonics exactly up to degree 21.
const RULE: [usize; 2] = [11, 24];
/// Their number.
pub(super) const DIRECTIONS: usize = RULE[0] * RULE[1];
/// Eights of directions.
const BLOCKS: usize = DIRECTIONS / LANES;
/// Half the width, as an angle, over which a cap's rim is spread: a little more than that of a direction's cell, so that no cap
/// falls between the directions.
pub(super) const RIM: f32 = 0.2;

/// The directions, and the harmonics to project onto.
#[derive(Clone, Debug)]
pub struct DirectProduct {
    order: Order,
    directions: Vec<[Lanes; 3]>,
    weights: Vec<Lanes>,
    /// Weight times harmonic: coefficient by coefficient.
    projection: Vec<Lanes>,
}

impl DirectProduct {
    /// Directions whose products are projected onto `order`.
    pub fn new(order: Order) -> Self {
        let rule: Vec<_> = product_rule(RULE[0], RULE[1]).collect();
        let lanes = |f: &dyn Fn(usize) -> f64| -> Vec<Lanes> {
            (0..BLOCKS).map(|block| Lanes::each(|lane| f(block * LANES + lane) as f32)).collect()
        };
        let [x, y, z] = [0, 1, 2].map(|axis| lanes(&|i| rule[i].0[axis]));
        let mut harmonics = vec![0.0; rule.len() * order.len()];
        for ((w, weight), row) in rule.iter().zip(harmonics.chunks_exact_mut(order.len())) {
            evaluate(order, *w, row);
            row.iter_mut().for_each(|y| *y *= weight);
        }
        Self {
            order,
            directions: (0..BLOCKS).map(|block| [x[block], y[block], z[block]]).collect(),
            weights: lanes(&|i| rule[i].1),
            projection: (0..order.len()).flat_map(|k| lanes(&|i| harmonics[i * order.len() + k])).collect(),
        }
    }

    /// The order of the visibility.
    pub fn order(&self) -> Order {
        self.order
    }

    /// The directions, each with its weight: those of the rule that is projected by.
    pub fn directions(&self) -> Vec<[f32; 4]> {
        let lanes = self.directions.iter().zip(&self.weights);
        lanes.flat_map(|([x, y, z], w)| (0..LANES).map(|i| [x.0[i], y.0[i], z.0[i], w.0[i]])).collect()
    }

    /// Weight times harmonic, direction after direction for the first coefficient, then for the next.
    pub fn projection(&self) -> &[f32] {
        bytemuck::cast_slice(&self.projection)
    }
}

/// Visibility of every receiver, in place of [`splat`](super::splat) and [`exponentiate`](super::exponentiate): in each of 264
/// directions the product of what the caps in reach leave. A cap hides a share of each direction's surroundings, which falls off
/// across its rim and adds up to its solid angle.
///
/// # Panics
/// If `out` is not of the product's order or has not a place for every receiver.
pub fn direct_product(
    receivers: &Receivers,
    proxies: &[Proxy],
    product: &DirectProduct,
    rule: SelfShadowing,
    coverage: Coverage,
    out: &mut HarmonicBuffer,
) -> SplatCounts {
    assert_eq!(out.len(), product.order.len());
    splat_tiles(product, Sight { receivers, proxies, rule, coverage }, out)
}

/// What is open of every direction, receiver by receiver, and whether anything was taken away.
pub(super) struct Open {
    open: [[Lanes; BLOCKS]; LANES],
    touched: [bool; LANES],
}

impl Splat for DirectProduct {
    type Sum = Open;

    #[inline(always)]
    fn nothing(&self, out: &mut [Lanes]) {
        out.fill(Lanes::ZERO);
        out[0] = Lanes::splat(ONE);
    }

    #[inline(always)]
    fn start(&self) -> Open {
        Open { open: [[Lanes::splat(1.0); BLOCKS]; LANES], touched: [false; LANES] }
    }

    #[inline(always)]
    fn add(&self, sum: &mut Open, _: &Group, _: &Proxy, seen: &Seen) {
        for lane in 0..LANES {
            let (u, weight) = (seen.u.0[lane], seen.weight.0[lane]);
            if weight > 0.0 && u > 0.0 {
                sum.touched[lane] = true;
                let axis = [seen.axis[0].0[lane], seen.axis[1].0[lane], seen.axis[2].0[lane]];
                block(self, axis, u, weight, &mut sum.open[lane]);
            }
        }
    }

    #[inline(always)]
    fn finish(&self, sum: &Open, out: &mut [Lanes]) {
        for lane in (0..LANES).filter(|lane| sum.touched[*lane]) {
            for (out, projection) in out.iter_mut().zip(self.projection.chunks_exact(BLOCKS)) {
                let mut integral = Lanes::ZERO;
                for (projection, open) in projection.iter().zip(&sum.open[lane]) {
                    integral += *projection * *open;
                }
                out.0[lane] = total(integral);
            }
        }
    }
}

#[inline(always)]
fn total(lanes: Lanes) -> f32 {
    let mut sum = 0.0;
    for x in lanes.0 {
        sum += x;
    }
    sum
}

/// Multiplies what a cap leaves of every direction, faded by `weight`, into `open`.
#[inline(always)]
fn block(product: &DirectProduct, [x, y, z]: [f32; 3], u: f32, weight: f32, open: &mut [Lanes; BLOCKS]) {
    let cosine = 1.0 - u;
    let sine = (u * (2.0 - u)).sqrt();
    let slope = 0.5 / (RIM * sine.max(RIM));
    let mut share = [Lanes::ZERO; BLOCKS];
    let mut sum = Lanes::ZERO;
    for ((share, direction), weight) in share.iter_mut().zip(&product.directions).zip(&product.weights) {
        let along = direction[0] * x + direction[1] * y + direction[2] * z;
        *share = ((along - cosine) * slope + Lanes::splat(0.5)).max(Lanes::ZERO).min(Lanes::splat(1.0));
        sum += *share * *weight;
    }
    let scale = weight * TAU * u / total(sum).max(f32::MIN_POSITIVE);
    for (open, share) in open.iter_mut().zip(share) {
        // Where the rim was spread too far inwards, a direction cannot be hidden more than wholly.
        *open = *open * (Lanes::splat(1.0) - (share * scale).min(Lanes::splat(1.0)));
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::scene::shapes::Random;
    use crate::sphere::cap;

    /// Relative L2 errors of 12 caps anywhere, half angles even in 5 to 35 degrees, against the projection of the true product.
    #[test]
    fn errors_are_those_measured_independently() {
        let order = Order::new(4).unwrap();
        let direct = DirectProduct::new(order);
        let rule: Vec<(DVec3, f64)> = product_rule(60, 120).collect();
        let mut y = vec![0.0; rule.len() * 16];
        rule.iter().zip(y.chunks_exact_mut(16)).for_each(|((w, _), y)| evaluate(order, *w, y));
        let mut random = Random::new(12);
        let mut errors = Vec::new();
        for _ in 0..60 {
            let mut open = [Lanes::splat(1.0); BLOCKS];
            let mut caps = Vec::new();
            for _ in 0..12 {
                let axis = random.in_ball().normalize();
                let c = random.between(5.0, 35.0).to_radians().cos();
                caps.push((axis, c));
                block(&direct, axis.as_vec3().to_array(), (1.0 - c) as f32, 1.0, &mut open);
            }
            let mut truth = [0.0; 16];
            for ((w, weight), y) in rule.iter().zip(y.chunks_exact(16)) {
                if caps.iter().all(|(axis, c)| w.dot(*axis) < *c) {
                    truth.iter_mut().zip(y).for_each(|(sum, y)| *sum += weight * y);
                }
            }
            let project = |k: usize| {
                let projection = &direct.projection[k * BLOCKS..(k + 1) * BLOCKS];
                f64::from(projection.iter().zip(&open).map(|(p, o)| total(*p * *o)).sum::<f32>())
            };
            let squared: f64 = (0..16).map(|k| (project(k) - truth[k]).powi(2)).sum();
            errors.push((squared / truth.iter().map(|x| x * x).sum::<f64>()).sqrt());
        }
        let mean = errors.iter().sum::<f64>() / 60.0;
        // With 256 directions and hard rims .049 were measured; the logarithms in four bands give .095.
        assert!(mean < 0.049, "{mean}");
    }

    #[test]
    fn one_sphere_leaves_all_but_its_cap() {
        let mut receivers = Receivers::nothing(8, 1, 0);
        receivers.depth[2] = 1.0;
        receivers.position.iter_mut().for_each(|plane| plane[2] = 0.0);
        let center = Vec3::new(0.3, 0.9, 1.2);
        let proxy = Proxy { center, radius: 0.8, albedo: Vec3::ZERO, share: 1.0 };
        let order = Order::new(4).unwrap();
        let mut out = HarmonicBuffer::zeros(16, 8);
        let coverage = Coverage { expansion: 20.0 };
        let rule = SelfShadowing::Clipped;
        direct_product(&receivers, &[proxy], &DirectProduct::new(order), rule, coverage, &mut out);
        let d = center.as_dvec3();
        let alpha = 0.8 / d.length();
        let cap = cap(order, d.normalize(), (1.0 - alpha * alpha).sqrt());
        let found = out.vector(2);
        for (k, cap) in cap.iter().enumerate() {
            let expected = if k == 0 { f64::from(ONE) - cap } else { -cap };
            // The rim's spread damps band l by about l (l + 1) RIM^2 / 12; the rule's error is as large.
            let allowed = 1e-4 + cap.abs() * (k.isqrt() * (k.isqrt() + 1)) as f64 * 0.04 / 5.0;
            assert!((f64::from(found[k]) - expected).abs() < allowed, "{k}: {} {expected}", found[k]);
        }
        assert_eq!(out.vector(3)[0], ONE);
    }
}
