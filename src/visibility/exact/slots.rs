//! The active edges of the sweep by masks, side by side for vector instructions.

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
    /// Edges that some vertex could not be told to be above or below of.
    doubtful: Vec<u64>,
    /// The edge in a slot.
    edges: Vec<Active>,
}

/// What is known of an active edge since it started.
#[derive(Clone, Copy, Debug)]
pub(super) struct Active {
    pub edge: u32,
    /// W just above its start, if that is above the horizon.
    pub above: i32,
    pub start: DVec3,
    pub starts_above_horizon: bool,
    /// The last of its crossings found, linked.
    pub crossings: u32,
    /// Sum of their changes of W, and of those that are negative.
    pub change: i32,
    pub fall: i32,
}

impl Active {
    pub fn new(edge: u32, above: i32, start: DVec3, starts_above_horizon: bool) -> Self {
        Self { edge, above, start, starts_above_horizon, crossings: NIL, change: 0, fall: 0 }
    }
}

/// Slots in ascending order.
pub(super) fn slots_of(mask: &[u64]) -> impl Iterator<Item = usize> {
    mask.iter().enumerate().flat_map(|(word, &bits)| {
        let mut left = bits;
        std::iter::from_fn(move || {
            let bit = (left != 0).then(|| left.trailing_zeros() as usize)?;
            left &= left - 1;
            Some(WORD * word + bit)
        })
    })
}

pub(super) fn has(mask: &[u64], slot: usize) -> bool {
    mask[slot / WORD] >> (slot % WORD) & 1 != 0
}

pub(super) fn set(mask: &mut [u64], slot: usize) {
    mask[slot / WORD] |= 1 << (slot % WORD);
}

impl Slots {
    /// More active edges than this are kept in order better than compared one by one.
    pub const MOST: usize = 4096;

    /// Frees all slots.
    pub fn reset(&mut self) {
        self.used = 0;
        self.next_age = 0;
        self.taken.fill(0);
        self.doubtful.fill(0);
        for axis in &mut self.normals {
            axis.fill(f64::NAN);
        }
        self.jumps.fill(0.0);
    }

    /// Words of a mask.
    pub fn words(&self) -> usize {
        self.capacity / WORD
    }

    pub fn taken(&self) -> &[u64] {
        &self.taken
    }

    pub fn get(&self, slot: usize) -> &Active {
        &self.edges[slot]
    }

    pub fn get_mut(&mut self, slot: usize) -> &mut Active {
        &mut self.edges[slot]
    }

    pub fn jump(&self, slot: usize) -> i32 {
        self.jumps[slot] as i32
    }

    pub fn is_doubtful(&self, slot: usize) -> bool {
        has(&self.doubtful, slot)
    }

    pub fn doubt(&mut self, slot: usize) {
        set(&mut self.doubtful, slot);
    }

    /// Puts an edge into a free slot; `above` are the slots of the edges above its start.
    pub fn insert(&mut self, active: Active, normal: DVec3, jump: i32, above: &[u64]) -> usize {
        if self.taken.iter().all(|&word| word == u64::MAX) {
            self.grow();
        }
        let word = self.taken.iter().position(|&word| word != u64::MAX).expect("there is a free slot");
        let slot = WORD * word + self.taken[word].trailing_ones() as usize;
        set(&mut self.taken, slot);
        self.doubtful[word] &= !(1 << (slot % WORD));
        self.used = self.used.max((slot / LANES + 1) * LANES);
        for (axis, value) in self.normals.iter_mut().zip(normal.to_array()) {
            axis[slot] = value;
        }
        self.jumps[slot] = f64::from(jump);
        self.ages[slot] = self.next_age;
        self.next_age += 1;
        self.edges[slot] = active;
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
        self.edges.resize(new, Active::new(NIL, 0, DVec3::ZERO, false));
        self.taken.resize(new / WORD, 0);
        self.doubtful.resize(new / WORD, 0);
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

    /// Marks the edges that pass within rounding of a unit vector.
    pub fn doubt_near(&mut self, position: DVec3) {
        for slot in 0..self.used {
            let normal = DVec3::new(self.normals[0][slot], self.normals[1][slot], self.normals[2][slot]);
            if normal.dot(position).abs() < DOUBT {
                self.doubt(slot);
            }
        }
    }

    /// Writes to `above` which edges lay above the edge in `slot` when the younger of the two started.
    pub fn above_at_start(&self, slot: usize, above: &mut Vec<u64>) {
        above.clear();
        above.resize(self.words(), 0);
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
        for word in 0..above.len() {
            let (mut younger, mut below) = (0, 0);
            for (bits, other) in (WORD * word..self.used.min(WORD * (word + 1))).enumerate() {
                younger |= u64::from(self.ages[other] > self.ages[slot]) << bits;
                below |= (self.rows[row + other] >> bit & 1) << bits;
            }
            above[word] = self.rows[word * self.capacity + slot] & !younger | !below & younger;
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
