//! The splat pass for indirect light: irradiance that the proxies in reach reflect, and their solid angle.

use std::f32::consts::TAU;
use std::ops::Range;

use super::coverage::Coverage;
use super::harmonic_buffer::HarmonicBuffer;
use super::indirect::{IndirectTable, irradiance_per_solid_angle};
use super::lanes::{LANES, Lanes, dispatch};
use super::light::ReflectedLight;
use super::self_shadow::SelfShadowing;
use super::splat::{Group, SplatCounts, Tiles, by_bands, tiles};
use super::{Proxy, Receivers};

/// Numbers per receiver that the pass gives: irradiance in three colours, then the summed solid angle, both faded.
pub const INDIRECT_LEN: usize = 4;

/// Accumulates, for every receiver, the irradiance from all proxies within reach as if none hid another, and the sum of their
/// solid angles, by which overlap is later taken back (Sloan et al. 2007, equation 12).
///
/// # Panics
/// If `out` has not [`INDIRECT_LEN`] numbers for every receiver.
pub fn splat_indirect(
    receivers: &Receivers,
    proxies: &[Proxy],
    light: &ReflectedLight,
    table: &IndirectTable,
    rule: SelfShadowing,
    coverage: Coverage,
    out: &mut HarmonicBuffer,
) -> SplatCounts {
    assert_eq!(out.len(), INDIRECT_LEN);
    by_bands(receivers, proxies, out, |rows, out, reached| {
        indirect_band(receivers, proxies, light, table, rule, coverage, rows, out, reached)
    })
}

dispatch! {
    /// One row of tiles.
    indirect_band [] (
        receivers: &Receivers,
        proxies: &[Proxy],
        light: &ReflectedLight,
        table: &IndirectTable,
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
                    let mut sum = [Lanes::ZERO; INDIRECT_LEN];
                    for &i in list {
                        let proxy = &proxies[i as usize];
                        let Some(seen) = group.see(proxy, rule, coverage) else { continue };
                        counts.pairs += 1;
                        let solid_angle = seen.u * seen.weight * TAU;
                        let irradiance = irradiance_per_solid_angle(table, light, seen.axis, seen.u, group.normal);
                        for colour in 0..3 {
                            sum[colour] += irradiance[colour] * solid_angle * proxy.albedo[colour];
                        }
                        sum[3] += solid_angle;
                    }
                    let place = ((y - rows.start) * receivers.groups() + column) * INDIRECT_LEN;
                    out[place..place + INDIRECT_LEN].copy_from_slice(&sum);
                }
            }
        }
        counts
    }
}
