//! The splat pass for shadows: log visibility accumulated at every receiver over the spheres in reach of it.

use std::ops::{AddAssign, Range};

use glam::Vec3;
use rayon::prelude::*;

use super::basis::basis;
use super::coverage::Coverage;
use super::harmonic_buffer::HarmonicBuffer;
use super::lanes::{LANES, Lanes, dispatch};
use super::self_shadow::{Seen, SelfShadowing, seen};
use super::zonal_log::LogTable;
use super::{Proxy, Receivers};

/// Rows of a tile of receivers.
pub(super) const TILE_ROWS: usize = 8;
/// Groups of eight receivers in a row of a tile.
const TILE_GROUPS: usize = 2;

/// What a splat pass did and what it could leave out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SplatCounts {
    /// Tiles of receivers.
    pub tiles: u64,
    /// Tiles that no proxy reaches, or that hold no receiver.
    pub empty_tiles: u64,
    /// Pairs of a proxy and a group of eight receivers for which harmonics were added.
    pub pairs: u64,
    /// Proxies that reach no tile.
    pub out_of_reach: u64,
}

impl AddAssign for SplatCounts {
    fn add_assign(&mut self, other: Self) {
        self.tiles += other.tiles;
        self.empty_tiles += other.empty_tiles;
        self.pairs += other.pairs;
        self.out_of_reach += other.out_of_reach;
    }
}

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
    let band = match table.order().bands() {
        1 => splat_band::<1, 1>,
        2 => splat_band::<2, 4>,
        3 => splat_band::<3, 9>,
        4 => splat_band::<4, 16>,
        5 => splat_band::<5, 25>,
        _ => splat_band::<6, 36>,
    };
    assert_eq!(out.len(), table.order().len());
    by_bands(receivers, proxies, out, |rows, out, reached| {
        band(receivers, proxies, table, rule, coverage, rows, out, reached)
    })
}

/// Runs a pass band by band: rows of tiles side by side, each with its part of `out`.
pub(super) fn by_bands(
    receivers: &Receivers,
    proxies: &[Proxy],
    out: &mut HarmonicBuffer,
    band: impl Fn(Range<usize>, &mut [Lanes], &mut [bool]) -> SplatCounts + Sync,
) -> SplatCounts {
    let row = receivers.groups() * out.len();
    assert_eq!(out.groups_mut().len(), row * receivers.height());
    if row == 0 {
        return SplatCounts::default();
    }
    let bands = out.groups_mut().par_chunks_mut(row * TILE_ROWS).enumerate().map(|(i, out)| {
        let rows = i * TILE_ROWS..(i * TILE_ROWS + TILE_ROWS).min(receivers.height());
        let mut reached = vec![false; proxies.len()];
        out.fill(Lanes::ZERO);
        (band(rows, out, &mut reached), reached)
    });
    let bands: Vec<_> = bands.collect();
    let mut total = SplatCounts::default();
    let mut reached = vec![false; proxies.len()];
    for (counts, band) in bands {
        total += counts;
        reached.iter_mut().zip(band).for_each(|(all, one)| *all |= one);
    }
    total.out_of_reach = reached.iter().filter(|reached| !**reached).count() as u64;
    total
}

/// The tiles of a band that hold receivers within reach of proxies.
#[derive(Default)]
pub(super) struct Tiles {
    pub(super) counts: SplatCounts,
    /// Groups (columns) of every tile, and where the proxies that reach it stand in `lists`.
    pub(super) tiles: Vec<(Range<usize>, Range<usize>)>,
    pub(super) lists: Vec<u32>,
}

/// Finds the tiles of a band of `rows`.
pub(super) fn tiles(
    receivers: &Receivers,
    proxies: &[Proxy],
    coverage: Coverage,
    rows: Range<usize>,
    reached: &mut [bool],
) -> Tiles {
    let mut found = Tiles::default();
    for first in (0..receivers.groups()).step_by(TILE_GROUPS) {
        let groups = first..(first + TILE_GROUPS).min(receivers.groups());
        found.counts.tiles += 1;
        let start = found.lists.len();
        if let Some((centre, radius)) = bounds(receivers, rows.clone(), groups.clone()) {
            for (i, proxy) in (0u32..).zip(proxies) {
                let reach = coverage.reach(proxy.radius) + radius;
                if proxy.center.distance_squared(centre) < reach * reach {
                    found.lists.push(i);
                    reached[i as usize] = true;
                }
            }
        }
        if found.lists.len() == start {
            found.counts.empty_tiles += 1;
        } else {
            found.tiles.push((groups, start..found.lists.len()));
        }
    }
    found
}

/// A ball around the receivers of a tile, if it has any.
fn bounds(receivers: &Receivers, rows: Range<usize>, groups: Range<usize>) -> Option<(Vec3, f32)> {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for y in rows {
        for i in receivers.index(groups.start * LANES, y)..receivers.index(groups.end * LANES, y) {
            if receivers.is_seen(i) {
                let p = receivers.point(i);
                (low, high) = (low.min(p), high.max(p));
            }
        }
    }
    (low.x <= high.x).then(|| (0.5 * (low + high), 0.5 * low.distance(high)))
}

/// A group of eight receivers.
pub(super) struct Group {
    pub(super) position: [Lanes; 3],
    pub(super) normal: [Lanes; 3],
}

impl Group {
    #[inline(always)]
    pub(super) fn load(receivers: &Receivers, first: usize) -> Self {
        let [px, py, pz] = &receivers.position;
        let [nx, ny, nz] = &receivers.normal;
        Self {
            position: [Lanes::load(px, first), Lanes::load(py, first), Lanes::load(pz, first)],
            normal: [Lanes::load(nx, first), Lanes::load(ny, first), Lanes::load(nz, first)],
        }
    }

    /// How the group sees a proxy: none if it is out of every receiver's reach, or of no weight.
    #[inline(always)]
    pub(super) fn see(&self, proxy: &Proxy, rule: SelfShadowing, coverage: Coverage) -> Option<Seen> {
        let [x, y, z] = self.position;
        let Vec3 { x: cx, y: cy, z: cz } = proxy.center;
        let offset = [Lanes::splat(cx) - x, Lanes::splat(cy) - y, Lanes::splat(cz) - z];
        let squared = offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2];
        let reach = coverage.reach(proxy.radius);
        if !squared.any_below(Lanes::splat(reach * reach)) {
            return None;
        }
        let distance = squared.sqrt();
        let inverse = Lanes::splat(1.0) / distance.max(Lanes::splat(f32::MIN_POSITIVE));
        let mut seen = seen(rule, offset, distance, inverse, proxy.radius, self.normal);
        seen.weight = seen.weight * coverage.fade((inverse * proxy.radius).min(Lanes::splat(1.0)));
        Lanes::ZERO.any_below(seen.weight).then_some(seen)
    }
}

dispatch! {
    /// One row of tiles.
    splat_band [BANDS, LEN] (
        receivers: &Receivers,
        proxies: &[Proxy],
        table: &LogTable,
        rule: SelfShadowing,
        coverage: Coverage,
        rows: Range<usize>,
        out: &mut [Lanes],
        reached: &mut [bool],
    ) -> SplatCounts {
        let Tiles { mut counts, tiles, lists } = tiles(receivers, proxies, coverage, rows.clone(), reached);
        for (groups, list) in tiles {
            let list = &lists[list];
            for y in rows.clone() {
                for column in groups.clone() {
                    let group = Group::load(receivers, receivers.index(column * LANES, y));
                    let mut sum = [Lanes::ZERO; LEN];
                    for &i in list {
                        let Some(seen) = group.see(&proxies[i as usize], rule, coverage) else { continue };
                        counts.pairs += 1;
                        let mut bands = [Lanes::ZERO; BANDS];
                        for lane in 0..LANES {
                            let row = table.row(seen.u.0[lane]);
                            bands.iter_mut().zip(row).for_each(|(band, value)| band.0[lane] = value);
                        }
                        let y: [Lanes; LEN] = basis::<BANDS, LEN>(seen.axis);
                        for (l, band) in bands.iter().enumerate() {
                            let band = *band * seen.weight;
                            (l * l..(l + 1) * (l + 1)).for_each(|k| sum[k] += y[k] * band);
                        }
                    }
                    let place = ((y - rows.start) * receivers.groups() + column) * LEN;
                    out[place..place + LEN].copy_from_slice(&sum);
                }
            }
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

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

    #[test]
    fn equals_the_sum_over_all_spheres() {
        let mut random = Random::new(4);
        let receivers = receivers(&mut random, 21, 19);
        let proxies: Vec<Proxy> = (0..12)
            .map(|body| {
                let center = Vec3::new(
                    random.between(0.0, 6.0) as f32,
                    random.between(1.0, 2.0) as f32,
                    random.between(0.0, 6.0) as f32,
                );
                Proxy { center, radius: random.between(0.1, 0.45) as f32, albedo: Vec3::ZERO, body }
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
                    let mut expected = vec![0.0; order.len()];
                    for proxy in proxies.iter().filter(|_| receivers.is_seen(i)) {
                        let offset: DVec3 = (proxy.center - receivers.point(i)).as_dvec3();
                        let alpha = f64::from(proxy.radius) / offset.length();
                        let t = ((alpha * 12.0 - 1.0) / 0.25).clamp(0.0, 1.0);
                        let fade = t * t * (3.0 - 2.0 * t);
                        let zonal = logarithm.of_cap((1.0 - alpha * alpha).sqrt());
                        let log = rotate_zonal(order, offset.normalize(), &zonal);
                        expected.iter_mut().zip(log).for_each(|(sum, log)| *sum += fade * log);
                    }
                    // The interpolation errors of some spheres, each below 1e-3: see the table's own test.
                    for (k, (found, expected)) in out.vector(i).iter().zip(expected).enumerate() {
                        assert!((f64::from(*found) - expected).abs() < 5e-3, "order {bands}, {k}: {found} {expected}");
                    }
                }
            }
        }
    }
}
