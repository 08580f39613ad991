//! The order of things along a space-filling curve.

use glam::Vec3;

/// Cells an axis.
const CELLS: f32 = 1024.0;

/// A Morton curve through the bounds of a mesh (Morton, 1966), 1024 cells an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve {
    low: Vec3,
    scale: f32,
}

impl Curve {
    /// Through the bounds of some points.
    pub(crate) fn new(points: &[Vec3]) -> Self {
        let (low, high) = points
            .iter()
            .filter(|p| p.is_finite())
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
        // Halves: the difference of the largest floats is none.
        let size = (0.5 * high - 0.5 * low).max_element();
        Self { low, scale: if size > 0.0 { 0.5 * CELLS / size } else { 0.0 } }
    }

    /// Number of a point's cell along the curve.
    #[inline(always)]
    pub(crate) fn cell(&self, p: Vec3) -> u32 {
        let cell = (p - self.low) * self.scale;
        // Casts saturate, and take what is not a number for zero.
        let [x, y, z] = cell.to_array().map(|c| spread((c as u32).min(CELLS as u32 - 1)));
        x | y << 1 | z << 2
    }
}

/// Moves bit i of ten to bit 3 i.
#[inline(always)]
fn spread(bits: u32) -> u32 {
    let bits = (bits | bits << 16) & 0x0300_00ff;
    let bits = (bits | bits << 8) & 0x0300_f00f;
    let bits = (bits | bits << 4) & 0x030c_30c3;
    (bits | bits << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_of_the_three_axes_alternate() {
        let curve = Curve::new(&[Vec3::ZERO, Vec3::splat(1024.0), Vec3::NAN]);
        for cell in [[0u32, 0, 0], [1, 2, 3], [1023, 512, 341], [7, 1000, 600]] {
            let p = Vec3::from_array(cell.map(|c| c as f32 + 0.5));
            let expected: u32 = (0..30).map(|bit| (cell[bit % 3] >> (bit / 3) & 1) << bit).sum();
            assert_eq!(curve.cell(p), expected, "{cell:?}");
        }
        assert_eq!(curve.cell(Vec3::splat(2000.0)), (1 << 30) - 1);
        assert_eq!(curve.cell(Vec3::NAN), 0);
    }

    #[test]
    fn points_at_one_place_and_huge_ones_have_cells() {
        assert_eq!(Curve::new(&[Vec3::ONE]).cell(Vec3::ONE), 0);
        assert_eq!(Curve::new(&[]).cell(Vec3::ONE), 0);
        let huge = Curve::new(&[Vec3::MIN, Vec3::MAX]);
        assert_eq!(huge.cell(Vec3::MIN), 0);
    }
}
