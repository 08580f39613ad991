//! Chains that come into one band of latitude side by side, for vector instructions; which of them lie above which.

use glam::{DVec3, Vec3};

use super::chains::Chain;
use super::edges::{Edges, NIL};

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
/// The same in single precision, with unit normals: ten roundings of 6e-8 each.
pub(super) const NEAR: f32 = 6e-7;

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
fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros() as usize;
        (mask != 0).then(|| {
            mask &= mask - 1;
            bit
        })
    })
}

/// A crossing of the edge in a slot with one that has ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossed {
    /// The edge that has ended, and its normal, rounded.
    pub edge: u32,
    pub normal: Vec3,
    /// Change of W just above the one in the slot, in the direction of the sweep.
    pub change: i32,
    /// The crossing found before.
    next: u32,
}

/// The crossings of the edge in a slot with edges that have ended.
#[derive(Clone, Copy, Debug)]
struct Tally {
    /// Sum of the sizes of their jumps.
    size: i32,
    /// The last one.
    last: u32,
}

const NONE: Tally = Tally { size: 0, last: NIL };

/// What the edge that ended last has crossed, in one word of slots.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    word: usize,
    slots: u64,
    /// Which of them were above it before.
    rises: u64,
}

/// Sets one bit of each row to that of a mask.
#[inline(always)]
fn set_column(rows: &mut [u64], bit: usize, mask: u64) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { set_column_avx2(rows, bit, mask) };
    }
    set_column_inline(rows, bit, mask);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn set_column_avx2(rows: &mut [u64], bit: usize, mask: u64) {
    set_column_inline(rows, bit, mask);
}

#[inline(always)]
fn set_column_inline(rows: &mut [u64], bit: usize, mask: u64) {
    for (other, row) in rows.iter_mut().enumerate() {
        *row = *row & !(1 << bit) | (mask >> other & 1) << bit;
    }
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
    /// Word w of slot s at `w * capacity + s`: which chains lay above that in the slot at the last vertex of either.
    rows: Vec<u64>,
    tallies: Vec<Tally>,
    crossed: Vec<Crossed>,
    crossing: Vec<Crossing>,
}

impl Slots {
    /// Frees all slots.
    pub fn reset(&mut self) {
        self.used = 0;
        self.words.fill(Word::default());
        self.normals[0].fill(f32::NAN);
        self.crossed.clear();
    }

    /// Whether keeping order would be better than comparing one by one.
    pub fn is_crowded(&self) -> bool {
        const MOST: usize = 4096;
        self.capacity() > MOST
    }

    /// The chains in all slots taken.
    pub fn taken(&self) -> impl Iterator<Item = u32> {
        self.words.iter().enumerate().flat_map(move |(w, word)| bits(word.taken).map(move |bit| self.chains[WORD * w + bit]))
    }

    /// Words of the slots up to the last one taken.
    #[inline(always)]
    fn width(&self) -> usize {
        self.used.div_ceil(WORD)
    }

    /// Whether a chain keeps others from being compared faster: it is the last one, far behind a free slot.
    #[inline(always)]
    pub fn is_astray(&self, slot: usize) -> bool {
        slot + LANES >= self.used && self.free() + 2 * LANES < slot
    }

    /// The first free slot, if there is one.
    #[inline(always)]
    fn free(&self) -> usize {
        let word = self.words.iter().position(|word| word.taken != u64::MAX);
        word.map_or(self.capacity(), |word| WORD * word + self.words[word].taken.trailing_ones() as usize)
    }

    fn capacity(&self) -> usize {
        self.chains.len()
    }

    /// Calls back for the crossings of the edge in a slot with others that have ended.
    #[inline(always)]
    pub fn each_crossed(&self, slot: usize, mut found: impl FnMut(&Crossed)) {
        let mut last = self.tallies[slot].last;
        while let Some(crossed) = self.crossed.get(last as usize) {
            found(crossed);
            last = crossed.next;
        }
    }

    /// Calls back for what the edge that ended last has crossed: the chain, its normal, and whether it was above before.
    #[inline(always)]
    pub fn each_crossing(&self, mut found: impl FnMut(u32, Vec3, bool)) {
        for &Crossing { word, slots, rises } in &self.crossing {
            for bit in bits(slots) {
                let slot = WORD * word + bit;
                let [x, y, z] = self.normals.each_ref().map(|axis| axis[slot]);
                found(self.chains[slot], Vec3::new(x, y, z), rises >> bit & 1 != 0);
            }
        }
    }

    /// Takes a free slot for a chain; its edge starts at the vertex at hand, or below what is marked as above.
    pub fn insert(&mut self, chain: u32, jump: i32, is_continued: bool) -> usize {
        let slot = self.free();
        if slot == self.capacity() {
            self.grow();
        }
        let (w, bit) = (slot / WORD, slot % WORD);
        let old = self.width();
        self.used = self.used.max((slot / LANES + 1) * LANES);
        // These have not been looked at.
        self.words[old.min(w + 1)..=w].iter_mut().for_each(|word| word.above = 0);
        let word = &mut self.words[w];
        word.taken |= 1 << bit;
        word.set_jump(bit, jump);
        self.chains[slot] = chain;
        // It is above those that are not above it.
        let width = self.width();
        let rows = self.rows[w * self.chains.len()..][..WORD * width].chunks_exact_mut(WORD);
        rows.zip(&self.words).for_each(|(rows, word)| set_column(rows, bit, !word.above));
        self.rest(slot, is_continued);
        slot
    }

    /// A chain's next edge starts in its slot at the vertex at hand.
    #[inline(always)]
    pub fn rest(&mut self, slot: usize, is_continued: bool) {
        let (w, bit) = (slot / WORD, slot % WORD);
        let word = &mut self.words[w];
        word.continued = word.continued & !(1 << bit) | u64::from(is_continued) << bit;
        self.tallies[slot] = NONE;
        let capacity = self.capacity();
        for (w, word) in self.words[..self.width()].iter().enumerate() {
            self.rows[w * capacity + slot] = word.above;
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
    fn grow(&mut self) {
        let old = self.capacity();
        let words = (2 * self.words.len()).max(1);
        let new = WORD * words;
        let mut rows = vec![0; words * new];
        for w in 0..self.words.len() {
            rows[w * new..][..old].copy_from_slice(&self.rows[w * old..][..old]);
        }
        self.rows = rows;
        self.words.resize(words, Word::default());
        self.normals.iter_mut().for_each(|axis| axis.resize(new, f32::NAN));
        self.chains.resize(new, NIL);
        self.tallies.resize(new, NONE);
    }

    /// Sum of the jumps of all that is marked as above.
    #[inline(always)]
    pub fn jumps_above(&self) -> i32 {
        self.words[..self.width()].iter().map(|word| word.jumps(word.above)).sum()
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
        self.rows[other / WORD * self.capacity() + slot] >> (other % WORD) & 1 != 0
    }

    /// Enters what the edge in a slot, ending at the vertex at hand, has crossed since the last vertices; in the first of
    /// its bands, or in one in which that above has been asked. Returns the sum of the sizes of jumps that have crossed the edge
    /// in all its life, as far as this band counts them.
    #[inline(always)]
    pub fn cross(&mut self, slot: usize, is_first: bool, chain: &Chain) -> i32 {
        let (w, mine, capacity) = (slot / WORD, 1 << (slot % WORD), self.capacity());
        let (size, normal) = (chain.jump.abs(), chain.normal);
        let mut sum = self.tallies[slot].size;
        self.crossing.clear();
        for (other, word) in self.words[..self.used.div_ceil(WORD)].iter().enumerate() {
            let was_above = self.rows[other * capacity + slot];
            let crossed = (was_above ^ word.above) & word.taken;
            if crossed == 0 {
                continue;
            }
            let counted = if is_first { crossed } else { crossed & !word.continued };
            for bit in bits(crossed) {
                self.rows[w * capacity + WORD * other + bit] ^= mine;
            }
            for bit in bits(counted) {
                let other = WORD * other + bit;
                let tally = &mut self.tallies[other];
                tally.size += size;
                let next = std::mem::replace(&mut tally.last, self.crossed.len() as u32);
                let change = if was_above >> bit & 1 != 0 { chain.jump } else { -chain.jump };
                self.crossed.push(Crossed { edge: chain.edge, normal, change, next });
            }
            sum += word.sizes(counted);
            self.crossing.push(Crossing { word: other, slots: counted, rises: was_above });
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
        _mm256_movemask_ps(near) != 0
    }

    /// The same in double precision: whether some edge passes within rounding, which becomes doubtful.
    #[cold]
    pub fn look_closely(&mut self, position: DVec3, edges: &Edges, chains: &mut [Chain]) -> bool {
        let mut is_near = false;
        for (w, word) in self.words.iter_mut().enumerate() {
            word.above = 0;
            for bit in bits(word.taken) {
                let slot = WORD * w + bit;
                if self.normals[0][slot].is_nan() {
                    continue;
                }
                let chain = &mut chains[self.chains[slot] as usize];
                let height = edges.edges[chain.edge as usize].normal.dot(position);
                if height.abs() < DOUBT {
                    (is_near, chain.is_doubtful) = (true, true);
                }
                word.above |= u64::from(height < 0.0) << bit;
            }
        }
        is_near
    }
}
