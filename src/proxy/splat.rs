//! The splat pass for shadows: log visibility accumulated at every receiver over the spheres in reach of it.

use super::basis::basis;
use super::coverage::Coverage;
use super::harmonic_buffer::HarmonicBuffer;
use super::lanes::{LANES, Lanes};
use super::self_shadow::{Seen, SelfShadowing};
use super::tiles::{Group, Sight, Splat, SplatCounts, splat_tiles};
use super::zonal_log::LogTable;
use super::{Proxy, Receivers};

/// Accumulates log visibility: `out` holds, for every receiver, the sum over the proxies within [`Coverage::reach`] of their
/// table row turned into their direction, faded at the end of the reach.
///
/// # Panics
/// If `out` is not of the table's order or has not a place for every receiver.
pub fn splat(
    receivers: &Receivers,
    proxies: &[Proxy],
    table: &LogTable,
    rule: SelfShadowing,
    coverage: Coverage,
    out: &mut HarmonicBuffer,
) -> SplatCounts {
    assert_eq!(out.len(), table.order().len());
    let sight = Sight { receivers, proxies, rule, coverage };
    match table.order().bands() {
        1 => splat_tiles(&LogSplat::<1, 1>(table), sight, out),
        2 => splat_tiles(&LogSplat::<2, 4>(table), sight, out),
        3 => splat_tiles(&LogSplat::<3, 9>(table), sight, out),
        4 => splat_tiles(&LogSplat::<4, 16>(table), sight, out),
        5 => splat_tiles(&LogSplat::<5, 25>(table), sight, out),
        _ => splat_tiles(&LogSplat::<6, 36>(table), sight, out),
    }
}

/// `LEN` = `BANDS` squared coefficients.
struct LogSplat<'a, const BANDS: usize, const LEN: usize>(&'a LogTable);

impl<const BANDS: usize, const LEN: usize> Splat for LogSplat<'_, BANDS, LEN> {
    type Sum = [Lanes; LEN];

    #[inline(always)]
    fn start(&self) -> [Lanes; LEN] {
        [Lanes::ZERO; LEN]
    }

    #[inline(always)]
    fn add(&self, sum: &mut [Lanes; LEN], _: &Group, proxy: &Proxy, seen: &Seen) {
        let mut bands = [Lanes::ZERO; BANDS];
        for lane in 0..LANES {
            let row = self.0.row(seen.u.0[lane]);
            bands.iter_mut().zip(row).for_each(|(band, value)| band.0[lane] = value);
        }
        let y: [Lanes; LEN] = basis::<BANDS, LEN>(seen.axis);
        let weight = seen.weight * proxy.share;
        for (l, band) in bands.iter().enumerate() {
            let band = *band * weight;
            (l * l..(l + 1) * (l + 1)).for_each(|k| sum[k] += y[k] * band);
        }
    }

    #[inline(always)]
    fn finish(&self, sum: &[Lanes; LEN], out: &mut [Lanes]) {
        out.copy_from_slice(sum);
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::super::zonal_log::Logarithm;
    use super::*;
    use crate::scene::shapes::Random;
    use crate::sphere::{Order, rotate_zonal};

    /// Receivers strewn over a floor, some of which see nothing.
    fn receivers(random: &mut Random, width: usize, height: usize) -> Receivers {
        let mut receivers = Receivers::nothing(width, height, 0);
        for y in 0..height {
            for x in 0..width {
                if (x + y) % 7 == 0 {
                    continue;
                }
                let i = receivers.index(x, y);
                receivers.depth[i] = 1.0;
                let place = [0.3 * x as f64 + 0.1 * random.unit(), 0.1 * random.unit(), 0.3 * y as f64];
                for axis in 0..3 {
                    receivers.position[axis][i] = place[axis] as f32;
                    receivers.normal[axis][i] = [0.0, 1.0, 0.0][axis];
                }
            }
        }
        receivers
    }

    /// How far the table's interpolation may be off, for spheres of sines below 1/2: see its own test.
    fn interpolation(order: Order, log: f64) -> f64 {
        2e-4 * log.abs() + 0.25 * std::f64::consts::PI * order.len() as f64 / (LogTable::INTERVALS as f64).powi(2)
    }

    #[test]
    fn equals_the_sum_over_all_spheres() {
        let mut random = Random::new(4);
        let receivers = receivers(&mut random, 21, 19);
        let proxies: Vec<Proxy> = (0..12)
            .map(|_| {
                let center = Vec3::new(
                    random.between(0.0, 6.0) as f32,
                    random.between(1.0, 2.0) as f32,
                    random.between(0.0, 6.0) as f32,
                );
                Proxy {
                    center,
                    radius: random.between(0.1, 0.45) as f32,
                    albedo: Vec3::ZERO,
                    share: random.between(0.3, 1.0) as f32,
                }
            })
            .collect();
        let coverage = Coverage { expansion: 12.0 };
        for bands in 2..=6 {
            let order = Order::new(bands).unwrap();
            let logarithm = Logarithm::new(order);
            let mut out = HarmonicBuffer::zeros(order.len(), receivers.stride() * receivers.height());
            let counts = splat(&receivers, &proxies, &LogTable::new(order), SelfShadowing::Whole, coverage, &mut out);
            assert!(counts.tiles == 6 && counts.pairs > 100, "{counts:?}");
            for y in 0..receivers.height() {
                for x in (0..receivers.width()).step_by(5) {
                    let i = receivers.index(x, y);
                    let (mut expected, mut allowed) = (vec![0.0; order.len()], vec![1e-5; order.len()]);
                    for proxy in proxies.iter().filter(|_| receivers.is_seen(i)) {
                        let offset: DVec3 = (proxy.center - receivers.point(i)).as_dvec3();
                        let alpha = f64::from(proxy.radius) / offset.length();
                        let t = ((alpha * 12.0 - 1.0) / 0.25).clamp(0.0, 1.0);
                        let fade = t * t * (3.0 - 2.0 * t);
                        let zonal = logarithm.of_cap((1.0 - alpha * alpha).sqrt());
                        let log = rotate_zonal(order, offset.normalize(), &zonal);
                        for (k, log) in log.into_iter().enumerate() {
                            expected[k] += fade * f64::from(proxy.share) * log;
                            allowed[k] += interpolation(order, log);
                        }
                    }
                    for (k, (found, expected)) in out.vector(i).iter().zip(expected).enumerate() {
                        let error = (f64::from(*found) - expected).abs();
                        assert!(error < allowed[k], "order {bands}, {k}: {found} {expected} +- {}", allowed[k]);
                    }
                }
            }
        }
    }
}
