//! Splat passes: what they share is the walk over tiles of receivers and the proxies in reach of them.

use std::ops::{AddAssign, Range};

use glam::Vec3;
use rayon::prelude::*;

use super::coverage::Coverage;
use super::harmonic_buffer::HarmonicBuffer;
use super::lanes::{LANES, Lanes};
use super::self_shadow::{Seen, SelfShadowing, seen};
use super::{Proxy, Receivers};

/// Rows of a tile of receivers.
const TILE_ROWS: usize = 8;
/// Groups of eight receivers in a row of a tile.
pub(super) const TILE_GROUPS: usize = 2;

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

/// What a pass adds up at a group of eight receivers over the proxies that they see. All is to be inlined: the walk is compiled
/// for AVX2, too.
pub(super) trait Splat: Sync {
    /// What is added up.
    type Sum;

    /// What receivers get that see no proxy: zeros, unless the pass says otherwise.
    #[inline(always)]
    fn nothing(&self, out: &mut [Lanes]) {
        out.fill(Lanes::ZERO);
    }

    /// The sum over no proxies.
    fn start(&self) -> Self::Sum;

    /// Adds a proxy as the group sees it.
    fn add(&self, sum: &mut Self::Sum, group: &Group, proxy: &Proxy, seen: &Seen);

    /// Writes what the group gets; `out` holds what it would get without proxies.
    fn finish(&self, sum: &Self::Sum, out: &mut [Lanes]);
}

/// Which proxies are seen, and how.
#[derive(Clone, Copy)]
pub(super) struct Sight<'a> {
    pub(super) receivers: &'a Receivers,
    pub(super) proxies: &'a [Proxy],
    pub(super) rule: SelfShadowing,
    pub(super) coverage: Coverage,
}

/// Runs a pass over all receivers: rows of tiles side by side, each with its part of `out`.
pub(super) fn splat_tiles<S: Splat>(pass: &S, sight: Sight, out: &mut HarmonicBuffer) -> SplatCounts {
    let Sight { receivers, proxies, .. } = sight;
    let len = out.len();
    let row = receivers.groups() * len;
    assert_eq!(out.groups_mut().len(), row * receivers.height());
    if row == 0 {
        return SplatCounts::default();
    }
    let bands = out.groups_mut().par_chunks_mut(row * TILE_ROWS).enumerate().map(|(i, out)| {
        let rows = i * TILE_ROWS..(i * TILE_ROWS + TILE_ROWS).min(receivers.height());
        let mut band = Band { pass, sight, rows, len, out, reached: vec![false; proxies.len()] };
        (band.splat(), band.reached)
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

/// One row of tiles.
struct Band<'a, S> {
    pass: &'a S,
    sight: Sight<'a>,
    rows: Range<usize>,
    /// Lanes of a group in `out`.
    len: usize,
    out: &'a mut [Lanes],
    /// Which proxies reach a tile.
    reached: Vec<bool>,
}

impl<S: Splat> Band<'_, S> {
    /// Compiled for AVX2 where the processor has it.
    fn splat(&mut self) -> SplatCounts {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.splat_avx2() };
        }
        self.splat_inline()
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn splat_avx2(&mut self) -> SplatCounts {
        self.splat_inline()
    }

    #[inline(always)]
    fn splat_inline(&mut self) -> SplatCounts {
        let Self { pass, sight, ref rows, len, ref mut out, ref mut reached } = *self;
        let Sight { receivers, proxies, rule, coverage } = sight;
        let mut counts = SplatCounts::default();
        out.chunks_exact_mut(len).for_each(|out| pass.nothing(out));
        let mut list: Vec<&Proxy> = Vec::new();
        for first in (0..receivers.groups()).step_by(TILE_GROUPS) {
            let groups = first..(first + TILE_GROUPS).min(receivers.groups());
            counts.tiles += 1;
            list.clear();
            if let Some((centre, radius)) = bounds(receivers, rows.clone(), groups.clone()) {
                for (proxy, reached) in proxies.iter().zip(reached.iter_mut()) {
                    let reach = coverage.reach(proxy.radius) + radius;
                    if proxy.center.distance_squared(centre) < reach * reach {
                        list.push(proxy);
                        *reached = true;
                    }
                }
            }
            if list.is_empty() {
                counts.empty_tiles += 1;
                continue;
            }
            for y in rows.clone() {
                for column in groups.clone() {
                    let group = Group::load(receivers, receivers.index(column * LANES, y));
                    let mut sum = pass.start();
                    for proxy in &list {
                        let Some(seen) = group.see(proxy, rule, coverage) else { continue };
                        counts.pairs += 1;
                        pass.add(&mut sum, &group, proxy, &seen);
                    }
                    let place = ((y - rows.start) * receivers.groups() + column) * len;
                    pass.finish(&sum, &mut out[place..place + len]);
                }
            }
        }
        counts
    }
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
