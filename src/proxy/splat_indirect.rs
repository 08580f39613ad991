//! The splat pass for indirect light: irradiance that the proxies in reach reflect, and their solid angle.

use std::f32::consts::TAU;

use super::coverage::Coverage;
use super::harmonic_buffer::HarmonicBuffer;
use super::indirect::{IndirectTable, irradiance_per_solid_angle};
use super::lanes::Lanes;
use super::light::ReflectedLight;
use super::self_shadow::{Seen, SelfShadowing};
use super::tiles::{Group, Sight, Splat, SplatCounts, splat_tiles};
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
    splat_tiles(&Indirect { light, table }, Sight { receivers, proxies, rule, coverage }, out)
}

struct Indirect<'a> {
    light: &'a ReflectedLight,
    table: &'a IndirectTable,
}

impl Splat for Indirect<'_> {
    type Sum = [Lanes; INDIRECT_LEN];

    #[inline(always)]
    fn start(&self) -> Self::Sum {
        [Lanes::ZERO; INDIRECT_LEN]
    }

    #[inline(always)]
    fn add(&self, sum: &mut Self::Sum, group: &Group, proxy: &Proxy, seen: &Seen) {
        let solid_angle = seen.u * seen.weight * TAU;
        let irradiance = irradiance_per_solid_angle(self.table, self.light, seen.axis, seen.u, group.normal);
        for colour in 0..3 {
            sum[colour] += irradiance[colour] * solid_angle * proxy.albedo[colour];
        }
        sum[3] += solid_angle;
    }

    #[inline(always)]
    fn finish(&self, sum: &Self::Sum, out: &mut [Lanes]) {
        out.copy_from_slice(sum);
    }
}
