//! Chains that come into one band of latitude side by side, for vector instructions; which of them lie above which.

use glam::{DVec3, Vec3};

use super::chains::Chain;

/// Bits of a word of a mask.
const WORD: usize = u64::BITS as usize;
/// Slots handled side by side.
const LANES: usize = 8;
/// Binary digits of the size of a jump.
const DIGITS: usize = 3;
/// The largest jump that fits.
pub(super) const MOST_JUMP: u32 = (1 << DIGITS) - 1;

/// A vertex within this distance of an edge's line, times the edge's length, may be on either side of it: normals and unit
/// vectors are known to a few 1e-16.
pub(super) const DOUBT: f64 = 2e-15;
/// The same in single precision: five roundings of 6e-8 each.
const NEAR: f32 = 4e-7;

/// Sixty-four slots, a bit of every mask each.
#[derive(Clone, Copy, Debug, Default)]
struct Word {
    taken: u64,
    /// Which pass above the vertex at hand. Those that are not taken never do.
    above: u64,
    /// Which come into the band above, too.
    continued: u64,
    /// Sign and binary digits of the jumps.
    negative: u64,
    sizes: [u64; DIGITS],
}

impl Word {
    fn set_jump(&mut self, bit: usize, jump: i32) {
        let put = |mask: &mut u64, value: bool| *mask = *mask & !(1 << bit) | u64::from(value) << bit;
        put(&mut self.negative, jump < 0);
        for (digit, mask) in self.sizes.iter_mut().enumerate() {
            put(mask, jump.unsigned_abs() >> digit & 1 != 0);
        }
    }

    /// Sum of the jumps of some slots.
    #[inline(always)]
    fn jumps(&self, slots: u64) -> i32 {
        let digits = self.sizes.iter().enumerate();
        digits.map(|(digit, &mask)| (count(slots & mask) - 2 * count(slots & mask & self.negative)) << digit).sum()
    }

    /// Sum of their sizes.
    #[inline(always)]
    fn sizes(&self, slots: u64) -> i32 {
        self.sizes.iter().enumerate().map(|(digit, &mask)| count(slots & mask) << digit).sum()
    }
}

fn count(mask: u64) -> i32 {
    mask.count_ones() as i32
}

/// The numbers of the bits that are set.
#[inline(always)]
pub(super) fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros() as usize;
        (mask != 0).then(|| {
            mask &= mask - 1;
            bit
        })
    })
}

/// Crossings of an edge that has ended with those in one word of slots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossed {
    /// Which it has crossed, and which of them were above it before.
    pub slots: u64,
    pub rises: u64,
    /// The edge that ended, and when.
    pub edge: u32,
    pub event: u32,
    pub word: u32,
}

/// The slots of one band. A slot is free again when its chain has left the band.
#[derive(Debug, Default)]
pub(super) struct Slots {
    words: Vec<Word>,
    /// Slots up to the last one taken, in whole lanes.
    used: usize,
    /// Normals by coordinate: not a number where there is nothing to be compared, so that every comparison fails.
    normals: [Vec<f32>; 3],
    chains: Vec<u32>,
    /// Word w of slot s at `s * words + w`: which chains lay above that in the slot at the last vertex of either.
    rows: Vec<u64>,
    /// Sizes of the jumps of the edges that have crossed that in the slot and then ended.
    crossed: Vec<i32>,
    /// All crossings, in the order in which they were found.
    log: Vec<Crossed>,
}

impl Slots {
    /// Frees all slots.
    pub fn reset(&mut self) {
        self.used = 0;
        self.words.fill(Word::default());
        self.normals[0].fill(f32::NAN);
        self.log.clear();
    }

    /// Whether keeping order would be better than comparing one by one.
    pub fn is_crowded(&self) -> bool {
        const MOST: usize = 4096;
        self.chains.len() > MOST
    }

    /// The chains in all slots taken.
    pub fn taken(&self) -> impl Iterator<Item = u32> {
        self.words.iter().enumerate().flat_map(move |(w, word)| bits(word.taken).map(move |bit| self.chains[WORD * w + bit]))
    }

    /// The chain in a slot of a word.
    pub fn chain(&self, word: u32, bit: usize) -> u32 {
        self.chains[WORD * word as usize + bit]
    }

    /// The crossings found after an event, the last first.
    #[inline(always)]
    pub fn crossed_since(&self, event: u32) -> impl Iterator<Item = &Crossed> {
        self.log.iter().rev().take_while(move |crossed| crossed.event > event)
    }

    /// Takes a free slot for a chain; its edge starts at the vertex at hand, or below what is marked as above.
    pub fn insert(&mut self, chain: u32, jump: i32, is_continued: bool) -> usize {
        let slot = match self.words.iter().position(|word| word.taken != u64::MAX) {
            Some(word) => WORD * word + self.words[word].taken.trailing_ones() as usize,
            None => self.grow(),
        };
        self.used = self.used.max((slot / LANES + 1) * LANES);
        let (w, bit) = (slot / WORD, slot % WORD);
        let word = &mut self.words[w];
        word.taken |= 1 << bit;
        word.set_jump(bit, jump);
        self.chains[slot] = chain;
        self.crossed[slot] = 0;
        // It is above those that are not above it.
        let width = self.words.len();
        for (other, row) in self.rows.chunks_exact_mut(width).enumerate().take(self.used) {
            let is_above = self.words[other / WORD].above >> (other % WORD) & 1;
            row[w] = row[w] & !(1 << bit) | (1 ^ is_above) << bit;
        }
        self.rest(slot, is_continued);
        slot
    }

    /// A chain's next edge starts in its slot at the vertex at hand.
    #[inline(always)]
    pub fn rest(&mut self, slot: usize, is_continued: bool) {
        let (w, bit) = (slot / WORD, slot % WORD);
        let word = &mut self.words[w];
        word.continued = word.continued & !(1 << bit) | u64::from(is_continued) << bit;
        let width = self.words.len();
        for (row, word) in self.rows[slot * width..][..width].iter_mut().zip(&self.words) {
            *row = word.above;
        }
    }

    /// Sets the line of the edge in a slot.
    #[inline(always)]
    pub fn show(&mut self, slot: usize, normal: Vec3) {
        for (axis, value) in self.normals.iter_mut().zip(normal.to_array()) {
            axis[slot] = value;
        }
    }

    /// Lets a slot out of comparisons.
    #[inline(always)]
    pub fn hide(&mut self, slot: usize) {
        self.normals[0][slot] = f32::NAN;
    }

    /// Frees a slot. What lay above it can be asked until another chain is inserted.
    pub fn remove(&mut self, slot: usize) {
        self.hide(slot);
        self.words[slot / WORD].taken &= !(1 << (slot % WORD));
        if slot + LANES >= self.used {
            let last = self.words.iter().rposition(|word| word.taken != 0);
            self.used = last.map_or(0, |w| {
                let end = WORD * (w + 1) - self.words[w].taken.leading_zeros() as usize;
                end.next_multiple_of(LANES)
            });
        }
    }

    #[cold]
    fn grow(&mut self) -> usize {
        let (old, new) = (self.words.len(), (2 * self.words.len()).max(1));
        let mut rows = vec![0; WORD * new * new];
        for slot in 0..WORD * old {
            rows[slot * new..][..old].copy_from_slice(&self.rows[slot * old..][..old]);
        }
        self.rows = rows;
        self.words.resize(new, Word::default());
        self.normals.iter_mut().for_each(|axis| axis.resize(WORD * new, f32::NAN));
        self.chains.resize(WORD * new, u32::MAX);
        self.crossed.resize(WORD * new, 0);
        WORD * old
    }

    /// Sum of the jumps of all that is marked as above.
    #[inline(always)]
    pub fn jumps_above(&self) -> i32 {
        self.words.iter().map(|word| word.jumps(word.above)).sum()
    }

    /// Marks nothing as above.
    pub fn clear_above(&mut self) {
        self.words.iter_mut().for_each(|word| word.above = 0);
    }

    /// Marks a slot as above.
    pub fn set_above(&mut self, slot: usize) {
        self.words[slot / WORD].above |= 1 << (slot % WORD);
    }

    /// Whether one slot lay above another at the last vertex of either.
    pub fn was_above(&self, slot: usize, other: usize) -> bool {
        self.rows[slot * self.words.len() + other / WORD] >> (other % WORD) & 1 != 0
    }

    /// Enters what the edge in a slot, ending at the vertex at hand, has crossed since the last vertices; in the first of
    /// its bands, or in one in which that above has been asked. Returns the sum of the sizes of jumps that have crossed the edge
    /// in all its life, as far as this band counts them.
    #[inline(always)]
    pub fn cross(&mut self, slot: usize, is_first: bool, size: i32, edge: u32, event: u32) -> i32 {
        let (w, mine, width) = (slot / WORD, 1 << (slot % WORD), self.words.len());
        let mut sum = std::mem::take(&mut self.crossed[slot]);
        for (other, word) in self.words.iter().enumerate() {
            let was_above = self.rows[slot * width + other];
            let crossed = (was_above ^ word.above) & word.taken;
            if crossed == 0 {
                continue;
            }
            let counted = if is_first { crossed } else { crossed & !word.continued };
            for bit in bits(crossed) {
                let other = WORD * other + bit;
                self.rows[other * width + w] ^= mine;
                self.crossed[other] += if counted >> bit & 1 != 0 { size } else { 0 };
            }
            if counted != 0 {
                sum += word.sizes(counted);
                let word = other as u32;
                self.log.push(Crossed { slots: counted, rises: counted & was_above, edge, event, word });
            }
        }
        sum
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

    fn look_portable(&mut self, position: Vec3) -> bool {
        let mut is_near = false;
        for (w, word) in self.words.iter_mut().enumerate() {
            word.above = 0;
            for slot in WORD * w..(WORD * (w + 1)).min(self.used) {
                let height = self.normals[0][slot] * position.x
                    + self.normals[1][slot] * position.y
                    + self.normals[2][slot] * position.z;
                is_near |= height.abs() < NEAR;
                word.above |= u64::from(height < 0.0) << (slot % WORD);
            }
        }
        is_near
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn look_avx2(&mut self, position: Vec3) -> bool {
        use std::arch::x86_64::*;
        let [x, y, z] = position.to_array().map(|value| _mm256_set1_ps(value));
        let (zero, limit, sign) = (_mm256_setzero_ps(), _mm256_set1_ps(NEAR), _mm256_set1_ps(-0.0));
        let mut near = zero;
        let [nx, ny, nz] = self.normals.each_ref().map(|axis| axis[..self.used].chunks(WORD));
        let mut words = self.words.iter_mut();
        for ((nx, ny), nz) in nx.zip(ny).zip(nz) {
            let mut above = 0;
            let blocks = nx.chunks_exact(LANES).zip(ny.chunks_exact(LANES)).zip(nz.chunks_exact(LANES));
            for (block, ((nx, ny), nz)) in blocks.enumerate() {
                // SAFETY: chunks hold eight numbers each.
                let [nx, ny, nz] = [nx, ny, nz].map(|lane| unsafe { _mm256_loadu_ps(lane.as_ptr()) });
                // In the order of the portable sum.
                let height = _mm256_add_ps(_mm256_mul_ps(nx, x), _mm256_mul_ps(ny, y));
                let height = _mm256_add_ps(height, _mm256_mul_ps(nz, z));
                near = _mm256_or_ps(near, _mm256_cmp_ps::<_CMP_LT_OQ>(_mm256_andnot_ps(sign, height), limit));
                let is_above = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(height, zero));
                above |= (is_above as u64) << (LANES * block);
            }
            if let Some(word) = words.next() {
                word.above = above;
            }
        }
        words.for_each(|word| word.above = 0);
        _mm256_movemask_ps(near) != 0
    }

    /// The same in double precision: whether some edge passes within rounding, which becomes doubtful.
    #[cold]
    pub fn look_closely(&mut self, position: DVec3, chains: &mut [Chain]) -> bool {
        let mut is_near = false;
        for (w, word) in self.words.iter_mut().enumerate() {
            word.above = 0;
            for bit in bits(word.taken) {
                let slot = WORD * w + bit;
                if self.normals[0][slot].is_nan() {
                    continue;
                }
                let chain = &mut chains[self.chains[slot] as usize];
                let height = chain.normal.dot(position);
                if height.abs() < DOUBT {
                    (is_near, chain.is_doubtful) = (true, true);
                }
                word.above |= u64::from(height < 0.0) << bit;
            }
        }
        is_near
    }
}
