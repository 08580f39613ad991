//! Owen-scrambled Sobol points in the unit square.

use sobol_burley::parts::{hash, owen_scramble_rev};

/// One randomisation of the first two Sobol dimensions: a (0, 2)-sequence, so that every power-of-two prefix has one point
/// in each elementary interval of its size.
///
/// Scrambling is by hash (Burley 2020, with the hash of the crate `sobol_burley`). Points with different seeds are
/// independent; each point alone is uniform over the square. Coordinates carry 32 bits and are the middles of their cells,
/// never 0 nor 1.
#[derive(Clone, Copy, Debug)]
pub struct Sobol {
    scrambles: [u32; 2],
}

impl Sobol {
    /// Points in a sequence: beyond them use further seeds.
    pub const LENGTH: u32 = 1 << 31;

    /// The randomisation number `seed`.
    pub fn new(seed: u32) -> Self {
        // Hashes of hashes, so that neither neighbouring seeds nor the two dimensions are related.
        let key = hash(seed);
        Self { scrambles: [hash(key ^ 0x5bd1_e995), hash(key.wrapping_mul(0x9c8f_2d3b) ^ 0x27d4_eb2f)] }
    }

    /// Point number `index`, below [`Sobol::LENGTH`].
    pub fn point(&self, index: u32) -> [f64; 2] {
        let digits = [index, pascal(index)];
        [0, 1].map(|dimension| {
            let bits = owen_scramble_rev(digits[dimension], self.scrambles[dimension]);
            (f64::from(bits.reverse_bits()) + 0.5) / 4_294_967_296.0
        })
    }
}

/// The second dimension's coordinate of point `index`, its binary digits in reverse like the index itself, which is the first
/// dimension's. Its generator matrix is Pascal's triangle modulo 2, where entry (n, m) is 1 if the bits of m are among those
/// of n (Lucas 1878): sums over supersets, one bit of the numbers n and m at a time.
fn pascal(index: u32) -> u32 {
    const CLEAR: [u32; 5] = [0x5555_5555, 0x3333_3333, 0x0f0f_0f0f, 0x00ff_00ff, 0x0000_ffff];
    (0..5).fold(index, |x, bit| x ^ ((x >> (1 << bit)) & CLEAR[bit]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_have_one_point_in_every_elementary_interval() {
        for seed in 0..20 {
            let sobol = Sobol::new(seed);
            for bits in [1, 4, 10] {
                for split in 0..=bits {
                    let (columns, rows) = (1u32 << split, 1u32 << (bits - split));
                    let mut hit = vec![false; 1 << bits];
                    for k in 0..1 << bits {
                        let [x, y] = sobol.point(k);
                        let cell = (x * f64::from(columns)) as u32 * rows + (y * f64::from(rows)) as u32;
                        assert!(!std::mem::replace(&mut hit[cell as usize], true), "seed {seed} bits {bits}");
                    }
                }
            }
        }
    }

    #[test]
    fn points_are_those_of_joe_and_kuo() {
        use sobol_burley::parts::sobol_rev;
        for index in 0..1 << 16 {
            let reversed = u32::reverse_bits(index);
            assert_eq!([index, pascal(index)], [0, 1].map(|dimension| sobol_rev(reversed, dimension)));
        }
    }

    #[test]
    fn a_single_point_is_uniform_over_the_seeds() {
        // Bits of point 5 over 4096 seeds: each set half of the time, pairs of bits a quarter, to 5 standard deviations.
        let count = 4096;
        let points: Vec<[u32; 2]> =
            (0..count).map(|seed| Sobol::new(seed).point(5).map(|x| (x * 4_294_967_296.0) as u32)).collect();
        let share = |f: &dyn Fn(&[u32; 2]) -> bool| points.iter().filter(|p| f(p)).count() as f64 / f64::from(count);
        for bit in 0..32 {
            for dimension in 0..2 {
                let half = share(&|p| p[dimension] >> bit & 1 == 1);
                assert!((half - 0.5).abs() < 5.0 * 0.5 / 64.0, "bit {bit} of dimension {dimension}: {half}");
            }
            for other in 0..32 {
                let both = share(&|p| p[0] >> bit & p[1] >> other & 1 == 1);
                assert!((both - 0.25).abs() < 5.0 * 0.433 / 64.0, "bits {bit} and {other}: {both}");
            }
        }
    }

    #[test]
    fn coordinates_are_middles_of_cells() {
        for k in 0..1 << 16 {
            for x in Sobol::new(3).point(k) {
                assert_eq!((x * 4_294_967_296.0).fract(), 0.5);
            }
        }
    }
}
