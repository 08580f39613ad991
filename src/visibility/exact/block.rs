//! Sixty-four chains side by side, for vector instructions.

use glam::{DVec3, Vec3};

use super::chains::Chain;
use super::edges::{Edges, NIL};

/// Bits of a word of a mask: slots of a block.
pub(super) const WORD: usize = u64::BITS as usize;
/// Slots handled side by side.
pub(super) const LANES: usize = 8;
/// Binary digits of the size of a jump.
const DIGITS: usize = 3;
/// The largest jump that fits.
pub(super) const MOST_JUMP: u32 = (1 << DIGITS) - 1;
/// A vertex within this distance of an edge's line, times the edge's length, may be on either side of it: normals and unit
/// vectors are known to a few 1e-16.
pub(super) const DOUBT: f64 = 2e-15;
/// The same in single precision, with normals of length 1 to 4: five roundings of 6e-8 each.
pub(super) const NEAR: f32 = 1.2e-6;

/// Sixty-four slots, a bit of every mask each. A slot is free again when its chain has left the band.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    pub taken: u64,
    /// Which pass above the vertex at hand. Those that are not taken never do.
    pub above: u64,
    /// Which come into the band above, too.
    pub continued: u64,
    /// Sign and binary digits of the jumps.
    negative: u64,
    sizes: [u64; DIGITS],
    /// Normals by coordinate: not a number where there is nothing to be compared, so that every comparison fails.
    pub normals: [[f32; WORD]; 3],
    pub chains: [u32; WORD],
    /// Sum of the sizes of the jumps of those edges that have crossed the one in a slot and have ended.
    pub crossed: [i32; WORD],
}

/// All slots are free.
pub(super) const EMPTY: Block = Block {
    taken: 0,
    above: 0,
    continued: 0,
    negative: 0,
    sizes: [0; DIGITS],
    normals: [[f32::NAN; WORD]; 3],
    chains: [NIL; WORD],
    crossed: [0; WORD],
};

impl Block {
    #[inline(always)]
    pub fn set_jump(&mut self, bit: usize, jump: i32) {
        put(&mut self.negative, bit, jump < 0);
        for (digit, mask) in self.sizes.iter_mut().enumerate() {
            put(mask, bit, jump.unsigned_abs() >> digit & 1 != 0);
        }
    }

    /// Sum of the jumps of what is above.
    #[inline(always)]
    pub fn jumps_above(&self) -> i32 {
        let mut sum = 0;
        for (digit, mask) in self.sizes.iter().enumerate() {
            let above = self.above & mask;
            sum += (count(above) - 2 * count(above & self.negative)) << digit;
        }
        sum
    }

    /// Sum of the sizes of some jumps.
    #[inline(always)]
    pub fn sizes(&self, slots: u64) -> i32 {
        let mut sum = 0;
        for (digit, mask) in self.sizes.iter().enumerate() {
            sum += count(slots & mask) << digit;
        }
        sum
    }

    /// Slots up to the last one taken.
    #[inline(always)]
    pub fn used(&self) -> usize {
        WORD - self.taken.leading_zeros() as usize
    }

    #[inline(always)]
    pub fn normal(&self, bit: usize) -> Vec3 {
        let [x, y, z] = &self.normals;
        Vec3::new(x[bit % WORD], y[bit % WORD], z[bit % WORD])
    }

    /// Marks which chains pass above a unit vector. Returns whether one passes so near that single precision may be wrong.
    #[inline(always)]
    pub fn look(&mut self, position: Vec3) -> bool {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.look_avx2(position) };
        }
        self.look_portable(position)
    }

    pub fn look_portable(&mut self, position: Vec3) -> bool {
        let mut is_near = false;
        self.above = 0;
        for slot in 0..WORD {
            let normal = self.normal(slot);
            let height = normal.x * position.x + normal.y * position.y + normal.z * position.z;
            is_near |= height.abs() < NEAR;
            self.above |= u64::from(height < 0.0) << slot;
        }
        is_near
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn look_avx2(&mut self, position: Vec3) -> bool {
        use std::arch::x86_64::*;
        let (x, y, z) = (_mm256_set1_ps(position.x), _mm256_set1_ps(position.y), _mm256_set1_ps(position.z));
        let (zero, sign) = (_mm256_setzero_ps(), _mm256_set1_ps(-0.0));
        let mut nearest = _mm256_set1_ps(f32::INFINITY);
        let mut above = 0;
        let used = self.used();
        for lane in 0..WORD / LANES {
            if lane * LANES >= used {
                break;
            }
            let at = lane * LANES;
            let [nx, ny, nz] = &self.normals;
            // SAFETY: eight numbers from there on are within the arrays.
            let (nx, ny, nz) = unsafe {
                (
                    _mm256_loadu_ps(nx.as_ptr().add(at)),
                    _mm256_loadu_ps(ny.as_ptr().add(at)),
                    _mm256_loadu_ps(nz.as_ptr().add(at)),
                )
            };
            // In the order of the portable sum.
            let height = _mm256_add_ps(_mm256_mul_ps(nx, x), _mm256_mul_ps(ny, y));
            let height = _mm256_add_ps(height, _mm256_mul_ps(nz, z));
            // What is not a number leaves the minimum as it is.
            nearest = _mm256_min_ps(_mm256_andnot_ps(sign, height), nearest);
            let is_above = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(height, zero));
            above |= (is_above as u64) << (LANES * lane);
        }
        self.above = above;
        _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(nearest, _mm256_set1_ps(NEAR))) != 0
    }

    /// The same in double precision: whether one passes within rounding, which becomes doubtful.
    #[cold]
    pub fn look_closely(&mut self, position: DVec3, edges: &Edges, chains: &mut [Chain]) -> bool {
        let mut is_near = false;
        self.above = 0;
        for bit in bits(self.taken).filter(|&bit| !self.normals[0][bit].is_nan()) {
            let chain = &mut chains[self.chains[bit] as usize];
            let height = edges.edges[chain.edge as usize].normal.dot(position);
            if height.abs() < DOUBT {
                (is_near, chain.is_doubtful) = (true, true);
            }
            self.above |= u64::from(height < 0.0) << bit;
        }
        is_near
    }
}

#[inline(always)]
pub(super) fn put(mask: &mut u64, bit: usize, value: bool) {
    *mask = *mask & !(1 << bit) | u64::from(value) << bit;
}

#[inline(always)]
fn count(mask: u64) -> i32 {
    mask.count_ones() as i32
}

/// The numbers of the bits that are set.
#[inline(always)]
pub(super) fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        if mask == 0 {
            return None;
        }
        let bit = mask.trailing_zeros() as usize;
        mask &= mask - 1;
        Some(bit)
    })
}

/// Sets one bit of each row to that of a mask.
#[inline(always)]
pub(super) fn set_column(rows: &mut [u64; WORD], bit: usize, mask: u64) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { set_column_avx2(rows, bit, mask) };
    }
    set_column_inline(rows, bit, mask);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn set_column_avx2(rows: &mut [u64; WORD], bit: usize, mask: u64) {
    set_column_inline(rows, bit, mask);
}

#[inline(always)]
pub(super) fn set_column_inline(rows: &mut [u64; WORD], bit: usize, mask: u64) {
    for (other, row) in rows.iter_mut().enumerate() {
        *row = *row & !(1 << bit) | (mask >> other & 1) << bit;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::exact::tests::scenes::Random;

    #[test]
    fn portable_and_dispatched_columns_agree() {
        let mut random = Random(22);
        let mut word = || (random.number() * u64::MAX as f64) as u64;
        for bit in [0, 1, 31, 63] {
            let mut rows = [0; WORD];
            rows.iter_mut().for_each(|row| *row = word());
            let (mut portable, mask) = (rows, word());
            set_column(&mut rows, bit, mask);
            set_column_inline(&mut portable, bit, mask);
            assert_eq!(rows, portable);
            assert!((0..WORD).all(|slot| rows[slot] >> bit & 1 == mask >> slot & 1));
        }
    }
}
