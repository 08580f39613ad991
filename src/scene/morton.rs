use glam::DVec3;

/// Cells along an axis, as a power of two.
pub(crate) const MORTON_BITS: u32 = 20;

/// Place of a cell along the curve of Morton (1966): the bits of its coordinates interleaved. Coordinates from 0 to two to the
/// power of [`MORTON_BITS`] are meant; what lies beyond is taken to the border.
pub(crate) fn morton(cell: DVec3) -> u64 {
    let spread = |x: f64| {
        let mut x = (x as u64).min((1 << MORTON_BITS) - 1);
        x = (x | x << 32) & 0x001f_0000_0000_ffff;
        x = (x | x << 16) & 0x001f_0000_ff00_00ff;
        x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
        x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
        (x | x << 2) & 0x1249_2492_4924_9249
    };
    spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_interleaved() {
        assert_eq!(morton(DVec3::new(1.0, 2.0, 4.0)), 0b100_010_001);
        assert_eq!(morton(DVec3::splat(f64::from(1u32 << MORTON_BITS))), (1 << (3 * MORTON_BITS)) - 1);
        let x = 0b1011_0110_0101_1100_1010u64;
        let slow = (0..MORTON_BITS).fold(0, |code, bit| code | ((x >> bit) & 1) << (3 * bit));
        assert_eq!(morton(DVec3::new(x as f64, 0.0, 0.0)), slow);
    }
}
