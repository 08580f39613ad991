//! Active edges side by side, for vector instructions.

use glam::DVec3;

use super::edges::NIL;

/// Bits of a word of a mask.
const WORD: usize = u64::BITS as usize;
/// Slots handled side by side.
const LANES: usize = 4;

/// A vertex within this distance of an edge's line, times the edge's length, may be on either side of it: normals and unit
/// vectors are known to a few 1e-16.
pub(super) const DOUBT: f64 = 2e-15;

/// Edges in slots, one bit of every mask each. A slot is free again when its edge has ended.
#[derive(Debug, Default)]
pub(super) struct Slots {
    capacity: usize,
    /// Slots up to the last one taken, in whole lanes.
    used: usize,
    /// Normals by coordinate: not a number where the slot is free, so that every comparison fails.
    normals: [Vec<f64>; 3],
    jumps: Vec<f64>,
    /// The older edge has the smaller number.
    ages: Vec<i64>,
    next_age: i64,
    /// Word w of slot s at `w * capacity + s`: which edges lay above the slot's edge when it started.
    rows: Vec<u64>,
    taken: Vec<u64>,
    /// The edge in a slot.
    edges: Vec<u32>,
}

pub(super) fn has(mask: &[u64], slot: usize) -> bool {
    mask[slot / WORD] >> (slot % WORD) & 1 != 0
}

pub(super) fn set(mask: &mut [u64], slot: usize) {
    mask[slot / WORD] |= 1 << (slot % WORD);
}

impl Slots {
    /// Frees all slots.
    pub fn reset(&mut self) {
        self.used = 0;
        self.next_age = 0;
        self.taken.fill(0);
        for axis in &mut self.normals {
            axis.fill(f64::NAN);
        }
        self.jumps.fill(0.0);
    }

    /// Whether keeping order would be better than comparing one by one.
    pub fn is_crowded(&self) -> bool {
        const MOST: usize = 4096;
        self.capacity > MOST
    }

    /// The edges in all slots taken.
    pub fn taken_edges(&self) -> impl Iterator<Item = u32> {
        (0..self.used).filter(|&slot| has(&self.taken, slot)).map(|slot| self.edges[slot])
    }

    /// Words of a mask.
    pub fn words(&self) -> usize {
        self.capacity / WORD
    }

    pub fn taken(&self) -> &[u64] {
        &self.taken
    }

    pub fn jump(&self, slot: usize) -> i32 {
        self.jumps[slot] as i32
    }

    /// The edge in a slot.
    pub fn edge(&self, slot: usize) -> u32 {
        self.edges[slot]
    }

    /// Puts an edge into a free slot; `above` are the slots of the edges above its start.
    pub fn insert(&mut self, edge: u32, normal: DVec3, jump: i32, above: &[u64]) -> usize {
        if self.taken.iter().all(|&word| word == u64::MAX) {
            self.grow();
        }
        let word = self.taken.iter().position(|&word| word != u64::MAX).expect("there is a free slot");
        let slot = WORD * word + self.taken[word].trailing_ones() as usize;
        set(&mut self.taken, slot);
        self.used = self.used.max((slot / LANES + 1) * LANES);
        for (axis, value) in self.normals.iter_mut().zip(normal.to_array()) {
            axis[slot] = value;
        }
        self.jumps[slot] = f64::from(jump);
        self.ages[slot] = self.next_age;
        self.next_age += 1;
        self.edges[slot] = edge;
        for word in 0..self.words() {
            self.rows[word * self.capacity + slot] = above.get(word).copied().unwrap_or(0);
        }
        slot
    }

    /// Frees a slot. What it held can be read until the next edge is inserted.
    pub fn remove(&mut self, slot: usize) {
        self.taken[slot / WORD] &= !(1 << (slot % WORD));
        for axis in &mut self.normals {
            axis[slot] = f64::NAN;
        }
        if slot + LANES >= self.used {
            let last = self.taken.iter().rposition(|&word| word != 0);
            self.used = last.map_or(0, |word| {
                let end = WORD * (word + 1) - self.taken[word].leading_zeros() as usize;
                end.next_multiple_of(LANES)
            });
        }
    }

    fn grow(&mut self) {
        let (old, new) = (self.capacity, (2 * self.capacity).max(WORD));
        let mut rows = vec![0; new / WORD * new];
        for word in 0..old / WORD {
            rows[word * new..word * new + old].copy_from_slice(&self.rows[word * old..(word + 1) * old]);
        }
        self.rows = rows;
        self.normals.iter_mut().for_each(|axis| axis.resize(new, f64::NAN));
        self.jumps.resize(new, 0.0);
        self.ages.resize(new, 0);
        self.edges.resize(new, NIL);
        self.taken.resize(new / WORD, 0);
        self.capacity = new;
    }

    /// Writes to `above` which edges pass above a unit vector. Returns the sum of their jumps, and whether one of the active
    /// edges passes so near that this is in doubt.
    pub fn sides(&self, position: DVec3, above: &mut Vec<u64>) -> (i32, bool) {
        above.clear();
        above.resize(self.words(), 0);
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.sides_avx2(position, above) };
        }
        self.sides_portable(position, above)
    }

    fn sides_portable(&self, position: DVec3, above: &mut [u64]) -> (i32, bool) {
        let (mut sum, mut is_near) = (0.0, false);
        for slot in 0..self.used {
            let normal = DVec3::new(self.normals[0][slot], self.normals[1][slot], self.normals[2][slot]);
            let height = normal.dot(position);
            is_near |= height.abs() < DOUBT;
            if height < 0.0 {
                set(above, slot);
                sum += self.jumps[slot];
            }
        }
        (sum as i32, is_near)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn sides_avx2(&self, position: DVec3, above: &mut [u64]) -> (i32, bool) {
        use std::arch::x86_64::*;
        let [x, y, z] = position.to_array().map(|value| _mm256_set1_pd(value));
        let (zero, doubt, sign) = (_mm256_setzero_pd(), _mm256_set1_pd(DOUBT), _mm256_set1_pd(-0.0));
        let (mut sum, mut near) = (zero, zero);
        let [nx, ny, nz] = self.normals.each_ref().map(|axis| axis[..self.used].chunks_exact(LANES));
        let jumps = self.jumps[..self.used].chunks_exact(LANES);
        for (block, (((nx, ny), nz), jumps)) in nx.zip(ny).zip(nz).zip(jumps).enumerate() {
            // SAFETY: chunks hold four numbers each.
            let [nx, ny, nz, jumps] = [nx, ny, nz, jumps].map(|lane| unsafe { _mm256_loadu_pd(lane.as_ptr()) });
            // In the order of the portable sum.
            let height = _mm256_add_pd(_mm256_mul_pd(nx, x), _mm256_mul_pd(ny, y));
            let height = _mm256_add_pd(height, _mm256_mul_pd(nz, z));
            let is_above = _mm256_cmp_pd::<_CMP_LT_OQ>(height, zero);
            near = _mm256_or_pd(near, _mm256_cmp_pd::<_CMP_LT_OQ>(_mm256_andnot_pd(sign, height), doubt));
            sum = _mm256_add_pd(sum, _mm256_and_pd(is_above, jumps));
            above[block / 16] |= (_mm256_movemask_pd(is_above) as u64) << (LANES * (block % 16));
        }
        let mut sums = [0.0; LANES];
        // SAFETY: the array holds four numbers.
        unsafe { _mm256_storeu_pd(sums.as_mut_ptr(), sum) };
        (sums.iter().sum::<f64>() as i32, _mm256_movemask_pd(near) != 0)
    }

    /// The edges that pass within rounding of a unit vector.
    pub fn near(&self, position: DVec3) -> impl Iterator<Item = u32> {
        (0..self.used).filter_map(move |slot| {
            let normal = DVec3::new(self.normals[0][slot], self.normals[1][slot], self.normals[2][slot]);
            (normal.dot(position).abs() < DOUBT).then_some(self.edges[slot])
        })
    }

    /// Appends to `masks` which edges lay above the edge in `slot` when the younger of the two started.
    pub fn above_at_start(&self, slot: usize, masks: &mut Vec<u64>) {
        let first = masks.len();
        masks.resize(first + self.words(), 0);
        let above = &mut masks[first..];
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            unsafe { self.younger_above_avx2(slot, above) };
            return;
        }
        self.younger_above_portable(slot, above);
    }

    /// Of younger edges it is known which had this one above them: the others are above.
    fn younger_above_portable(&self, slot: usize, above: &mut [u64]) {
        let (row, bit) = (slot / WORD * self.capacity, slot % WORD);
        for (word, above) in above.iter_mut().enumerate() {
            let (mut younger, mut below) = (0, 0);
            for (bits, other) in (WORD * word..self.used.min(WORD * (word + 1))).enumerate() {
                younger |= u64::from(self.ages[other] > self.ages[slot]) << bits;
                below |= (self.rows[row + other] >> bit & 1) << bits;
            }
            *above = self.rows[word * self.capacity + slot] & !younger | !below & younger;
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn younger_above_avx2(&self, slot: usize, above: &mut [u64]) {
        use std::arch::x86_64::*;
        let (row, bit) = (slot / WORD * self.capacity, slot % WORD);
        let age = _mm256_set1_epi64x(self.ages[slot]);
        let to_sign = _mm_cvtsi64_si128((WORD - 1 - bit) as i64);
        for (word, above) in above.iter_mut().enumerate() {
            let slots = WORD * word..self.used.min(WORD * (word + 1));
            let (mut younger, mut below) = (0, 0);
            if !slots.is_empty() {
                let ages = self.ages[slots.clone()].chunks_exact(LANES);
                let rows = self.rows[row + slots.start..row + slots.end].chunks_exact(LANES);
                for (block, (ages, rows)) in ages.zip(rows).enumerate() {
                    // SAFETY: chunks hold four numbers each.
                    let (ages, rows) =
                        unsafe { (_mm256_loadu_si256(ages.as_ptr().cast()), _mm256_loadu_si256(rows.as_ptr().cast())) };
                    let is_younger = _mm256_castsi256_pd(_mm256_cmpgt_epi64(ages, age));
                    let is_below = _mm256_castsi256_pd(_mm256_sll_epi64(rows, to_sign));
                    younger |= (_mm256_movemask_pd(is_younger) as u64) << (LANES * block);
                    below |= (_mm256_movemask_pd(is_below) as u64) << (LANES * block);
                }
            }
            *above = self.rows[word * self.capacity + slot] & !younger | !below & younger;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::exact::tests::scenes::Random;

    /// Edges come and go, over several words.
    #[test]
    fn portable_and_dispatched_kernels_agree_to_the_bit() {
        let mut random = Random(21);
        let mut slots = Slots::default();
        slots.reset();
        let (mut held, mut above) = (Vec::new(), Vec::new());
        for step in 0..600 {
            let w = random.direction();
            let (sum, is_near) = slots.sides(w, &mut above);
            let mut portable = vec![0; slots.words()];
            assert_eq!(slots.sides_portable(w, &mut portable), (sum, is_near));
            assert_eq!(above, portable);
            assert!(!is_near && above.iter().zip(slots.taken()).all(|(above, taken)| above & !taken == 0));
            let jump = if random.number() < 0.5 { -2 } else { 1 };
            held.push(slots.insert(step, random.direction(), jump, &above));
            if random.number() < 0.7 * held.len() as f64 / 150.0 {
                let slot = held.swap_remove((random.number() * held.len() as f64) as usize);
                let mut masks = vec![0; 3];
                slots.above_at_start(slot, &mut masks);
                let mut portable = vec![0; slots.words()];
                slots.younger_above_portable(slot, &mut portable);
                assert_eq!(masks.split_off(3), portable);
                slots.remove(slot);
            }
        }
        assert!(held.len() > 100 && slots.words() > 1);
        let on_it = DVec3::new(slots.normals[1][held[0]], -slots.normals[0][held[0]], 0.0).normalize();
        assert!(slots.sides(on_it, &mut above).1);
        assert_eq!(slots.near(on_it).collect::<Vec<_>>(), [slots.edge(held[0])]);
    }
}
