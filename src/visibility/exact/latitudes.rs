//! Bands of latitude, of about equal numbers of vertices.

use glam::DVec3;

const MOST_BANDS: usize = 128;
/// Parts of z from pole to pole, of which bands are made: the first and the last of half the size.
const PARTS: usize = 257;

/// Which band a point of the sphere is in; from the pole downwards.
#[derive(Debug)]
pub(super) struct Latitudes {
    count: usize,
    /// Band of each part.
    band_of: [u8; PARTS.next_power_of_two()],
}

impl Default for Latitudes {
    fn default() -> Self {
        Self { count: 1, band_of: [0; PARTS.next_power_of_two()] }
    }
}

impl Latitudes {
    /// Divides the sphere into so many bands.
    pub fn divide(&mut self, count: usize, vertices: impl ExactSizeIterator<Item = DVec3>) {
        self.count = count.clamp(1, MOST_BANDS);
        self.band_of.fill(0);
        if self.count == 1 {
            return;
        }
        let (mut before, total) = (0, vertices.len());
        let mut sizes = [0; PARTS.next_power_of_two()];
        vertices.for_each(|vertex| sizes[part(vertex.z)] += 1);
        for (band, size) in self.band_of.iter_mut().zip(sizes) {
            *band = (before * self.count / total).min(self.count - 1) as u8;
            before += size;
        }
    }

    pub fn count(&self) -> usize {
        self.count
    }

    /// The band of a unit vector with this z.
    #[inline(always)]
    pub fn band(&self, z: f64) -> u8 {
        self.band_of[part(z)]
    }

    /// First and last band that an arc between two points comes into; `cosine` is that of its length.
    #[inline(always)]
    pub fn range(&self, start: DVec3, end: DVec3, cosine: f64) -> (u8, u8) {
        if self.count == 1 {
            return (0, 0);
        }
        // An arc is no further from its chord than half the square of half its length, and z of the chord is between those of
        // its ends; for rounding add a little.
        let bulge = 0.5 * (1.0 - cosine) + 1e-14;
        let (low, high) = if start.z < end.z { (start.z, end.z) } else { (end.z, start.z) };
        (self.band(high + bulge), self.band(low - bulge))
    }
}

#[inline(always)]
fn part(z: f64) -> usize {
    /// The numbers from here on are the integers, in the last bits.
    const INTEGERS: f64 = (1u64 << 52) as f64;
    let part = ((1.0 - z) * (0.5 * (PARTS - 1) as f64)).clamp(0.0, (PARTS - 1) as f64);
    (part + INTEGERS).to_bits() as usize % PARTS.next_power_of_two()
}
