use glam::{DVec3, Vec3};

/// A row of patches, and where in the tables of all axes their light belongs.
#[derive(Clone, Debug, Default)]
pub(super) struct Patches {
    pub(super) moments: [Vec<f64>; 3],
    pub(super) radiance: Vec<Vec3>,
    pub(super) places: [Vec<u32>; 3],
}

impl Patches {
    pub(super) fn take(&mut self, patches: impl Iterator<Item = (DVec3, Vec3)>) {
        self.moments.iter_mut().for_each(Vec::clear);
        self.radiance.clear();
        for (moment, radiance) in patches {
            self.moments.iter_mut().zip(moment.to_array()).for_each(|(lanes, value)| lanes.push(value));
            self.radiance.push(radiance);
        }
    }

    /// For tables of so many isolines, and cells in a quadrant.
    pub(super) fn place(&mut self, lines: usize, cells: usize) {
        let count = self.radiance.len();
        for (axis, places) in self.places.iter_mut().enumerate() {
            places.resize(count, 0);
            // The chart's axes in the order of `cycle`.
            let moments = [0, 1, 2].map(|k| &self.moments[(axis + k) % 3][..count]);
            place(moments, lines, cells, places);
        }
    }
}

/// Where the light from directions belongs, given in the chart's axes by component, of any length: behind the cell of the quadrant in the
/// slab of the isoline.
fn place(moments: [&[f64]; 3], lines: usize, cells: usize, places: &mut [u32]) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the feature.
        return unsafe { place_avx2(moments, lines, cells, places) };
    }
    place_inline(moments, lines, cells, places);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn place_avx2(moments: [&[f64]; 3], lines: usize, cells: usize, places: &mut [u32]) {
    place_inline(moments, lines, cells, places);
}

#[inline(always)]
fn place_inline([x, y, z]: [&[f64]; 3], lines: usize, cells: usize, places: &mut [u32]) {
    // Whole numbers stand in the low bits of the sum with 2^52. NaN becomes zero.
    let whole = |value: f64, count: usize| {
        let value = value.max(0.0).min((count - 1) as f64).floor();
        (value + (1u64 << 52) as f64).to_bits() as u32
    };
    for (((&x, &y), &z), place) in x.iter().zip(y).zip(z).zip(places) {
        let m = y.abs() + z.abs();
        let line = whole((x / (x.abs() + m) + 1.0) * 0.5 * lines as f64, lines);
        let (left, lower) = (u32::from(y < 0.0), u32::from(z < 0.0));
        let fraction = y.abs() / m;
        // Zeros count as positive. In every other quadrant |y| falls.
        let fraction = if left ^ lower == 0 { fraction } else { 1.0 - fraction };
        let (quadrant, cell) = (2 * left + (left ^ lower), whole(fraction * cells as f64, cells));
        *place = (quadrant * (cells as u32 + 1) + cell + 1) * lines as u32 + line;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::Isolines;

    #[test]
    fn patches_of_light_are_put_where_they_belong() {
        let (lines, cells) = (14, 9);
        let isolines = Isolines::new(lines).unwrap();
        let number = |i: usize| (i * 7919 % 1009) as f64 - 504.0;
        let mut moments = [0, 1, 2].map(|k| (0..500).map(|i| number(3 * i + k)).collect::<Vec<f64>>());
        for (i, w) in [[0.0, 0.0, 1.0], [-0.0, 1.0, -0.0], [1.0, 0.0, 0.0], [-1.0, -0.0, 0.0]].into_iter().enumerate() {
            (0..3).for_each(|k| moments[k][i] = w[k]);
        }
        let moments = moments.each_ref().map(Vec::as_slice);
        let (mut dispatched, mut portable) = (vec![0; 500], vec![0; 500]);
        place(moments, lines, cells, &mut dispatched);
        place_inline(moments, lines, cells, &mut portable);
        assert_eq!(dispatched, portable);
        for (i, &place) in dispatched.iter().enumerate() {
            let (line, cell) = (place as usize % lines, place as usize / lines - 1);
            let w = DVec3::new(moments[0][i], moments[1][i], moments[2][i]);
            let w = w / w.abs().element_sum();
            assert!((w.x - isolines.u(line)).abs() < 1.0 / lines as f64 + 1e-12, "{w} in slab {line}");
            if w.x.abs() < 1.0 {
                let (quadrant, f) = (cell / (cells + 1), (cell % (cells + 1)) as f64 / cells as f64);
                let corners = [DVec3::Z, DVec3::Y, DVec3::NEG_Z, DVec3::NEG_Y, DVec3::Z];
                let [from, to] = [f, f + 1.0 / cells as f64].map(|f| corners[quadrant].lerp(corners[quadrant + 1], f));
                let w = DVec3::new(0.0, w.y, w.z) / (1.0 - w.x.abs());
                assert!((w - from).dot(to - from) > -1e-12 && (w - to).dot(to - from) < 1e-12, "{w} in {from} to {to}");
            }
        }
    }
}
