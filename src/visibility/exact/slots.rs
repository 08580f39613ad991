//! Chains that come into one band of latitude, which of them lie above which, and which have crossed.

use glam::{DVec3, Vec3};

use super::block::{Block, EMPTY, LANES, WORD, bits, put, set_column};
use super::chains::Chain;
use super::edges::Edges;

/// Blocks of a band beyond which keeping order would be better than comparing one by one.
const MOST_BLOCKS: usize = 64;

/// A crossing of the edge in a slot with one that has ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossed {
    /// The edge that has ended, and its normal, rounded.
    pub edge: u32,
    pub normal: Vec3,
    /// Change of W just above the one in the slot, in the direction of the sweep.
    pub change: i32,
}

/// What the edge that ended last has crossed, in one block.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    block: usize,
    slots: u64,
    /// Which of them were above it before.
    rises: u64,
}

/// The slots of one band, in blocks.
#[derive(Debug, Default)]
pub(super) struct Slots {
    blocks: Vec<Block>,
    /// Blocks up to the last one with a slot taken.
    used: usize,
    /// Which chains of block b lay above that in slot s of block a, at the last vertex of either: `[a * blocks + b][s]`.
    rows: Vec<[u64; WORD]>,
    /// By slot.
    crossed: Vec<Vec<Crossed>>,
    crossing: Vec<Crossing>,
}

impl Slots {
    /// Frees all slots.
    pub fn reset(&mut self) {
        self.used = 0;
        self.blocks.fill(EMPTY);
    }

    /// Whether keeping order would be better.
    pub fn is_crowded(&self) -> bool {
        self.used > MOST_BLOCKS
    }

    /// The chains in all slots taken.
    pub fn taken(&self) -> impl Iterator<Item = u32> {
        self.blocks.iter().flat_map(|block| bits(block.taken).map(|bit| block.chains[bit]))
    }

    #[inline(always)]
    fn row(&self, slot: usize, block: usize) -> u64 {
        self.rows[slot / WORD * self.blocks.len() + block][slot % WORD]
    }

    /// Whether a chain keeps others from being compared faster: it is the last one of a block, far behind a free slot.
    #[inline(always)]
    pub fn is_astray(&self, slot: usize) -> bool {
        let (block, bit) = (slot / WORD, slot % WORD);
        block + 1 == self.used && self.blocks[block].taken >> bit == 1 && self.free() + 2 * LANES < slot
    }

    /// The first free slot; beyond all blocks if there is none.
    #[inline(always)]
    fn free(&self) -> usize {
        let block = self.blocks.iter().position(|block| block.taken != u64::MAX);
        block.map_or(WORD * self.blocks.len(), |b| WORD * b + self.blocks[b].taken.trailing_ones() as usize)
    }

    /// Takes a free slot for a chain; its edge starts at the vertex at hand, or below what is marked as above.
    #[inline(always)]
    pub fn insert(&mut self, id: u32, chain: &Chain, is_continued: bool) -> usize {
        let slot = self.free();
        let (a, bit) = (slot / WORD, slot % WORD);
        if a == self.blocks.len() {
            self.grow();
        }
        if a >= self.used {
            // It has not been looked at.
            self.blocks[a].above = 0;
            self.used = a + 1;
        }
        let block = &mut self.blocks[a];
        block.taken |= 1 << bit;
        block.set_jump(bit, chain.jump);
        block.chains[bit] = id;
        // It is above those that are not above it.
        for b in 0..self.used {
            set_column(&mut self.rows[b * self.blocks.len() + a], bit, !self.blocks[b].above);
        }
        self.follow(slot, chain, is_continued);
        slot
    }

    /// A chain's next edge starts in its slot at the vertex at hand.
    #[inline(always)]
    pub fn follow(&mut self, slot: usize, chain: &Chain, is_continued: bool) {
        let (a, bit) = (slot / WORD, slot % WORD);
        let count = self.blocks.len();
        for (rows, block) in self.rows[a * count..][..self.used].iter_mut().zip(&self.blocks) {
            rows[bit] = block.above;
        }
        let block = &mut self.blocks[a];
        put(&mut block.continued, bit, is_continued);
        block.crossed[bit] = 0;
        self.crossed[slot].clear();
        let [nx, ny, nz] = &mut block.normals;
        (nx[bit], ny[bit], nz[bit]) = chain.normal.into();
    }

    /// Lets a slot out of comparisons.
    #[inline(always)]
    pub fn hide(&mut self, slot: usize) {
        self.blocks[slot / WORD].normals[0][slot % WORD] = f32::NAN;
    }

    /// Frees a slot. What lay above it can be asked until another chain is inserted.
    #[inline(always)]
    pub fn remove(&mut self, slot: usize) {
        self.hide(slot);
        self.blocks[slot / WORD].taken &= !(1 << (slot % WORD));
        while self.used > 0 && self.blocks[self.used - 1].taken == 0 {
            self.used -= 1;
        }
    }

    #[cold]
    fn grow(&mut self) {
        let old = self.blocks.len();
        let new = (2 * old).max(1);
        let mut rows = vec![[0; WORD]; new * new];
        for block in 0..old {
            rows[block * new..][..old].copy_from_slice(&self.rows[block * old..][..old]);
        }
        self.rows = rows;
        self.blocks.resize(new, EMPTY);
        self.crossed.resize_with(WORD * new, Vec::new);
    }

    /// Sum of the jumps of all that is marked as above.
    #[inline(always)]
    pub fn jumps_above(&self) -> i32 {
        // Adapters of iterators would not be compiled for the processor at hand, which counts bits in one instruction.
        let mut sum = 0;
        for block in &self.blocks[..self.used] {
            sum += block.jumps_above();
        }
        sum
    }

    /// Marks nothing as above.
    pub fn clear_above(&mut self) {
        self.blocks.iter_mut().for_each(|block| block.above = 0);
    }

    /// Marks a slot as above.
    #[inline(always)]
    pub fn set_above(&mut self, slot: usize) {
        self.blocks[slot / WORD].above |= 1 << (slot % WORD);
    }

    /// Whether one slot lay above another at the last vertex of either.
    #[inline(always)]
    pub fn was_above(&self, slot: usize, other: usize) -> bool {
        self.row(slot, other / WORD) >> (other % WORD) & 1 != 0
    }

    /// Enters what the edge in a slot, ending at the vertex at hand, has crossed since the last vertices; in the first of
    /// its bands, or in one in which that above has been asked. Returns the sum of the sizes of jumps that have crossed the edge
    /// in all its life, as far as this band counts them.
    #[inline(always)]
    pub fn cross(&mut self, slot: usize, is_first: bool, chain: &Chain) -> i32 {
        let (a, mine, count) = (slot / WORD, 1 << (slot % WORD), self.blocks.len());
        let Chain { edge, normal, jump, .. } = *chain;
        let mut sum = self.blocks[a].crossed[slot % WORD];
        self.crossing.clear();
        for (b, block) in self.blocks[..self.used].iter_mut().enumerate() {
            let was_above = self.rows[a * count + b][slot % WORD];
            let crossed = (was_above ^ block.above) & block.taken;
            if crossed == 0 {
                continue;
            }
            let rows = &mut self.rows[b * count + a];
            let twice = if is_first { 0 } else { crossed & block.continued };
            bits(twice).for_each(|bit| rows[bit] ^= mine);
            let slots = crossed ^ twice;
            let lists = &mut self.crossed[WORD * b..][..WORD];
            for bit in bits(slots) {
                rows[bit] ^= mine;
                block.crossed[bit] += jump.abs();
                let sign = 2 * (was_above >> bit & 1) as i32 - 1;
                lists[bit].push(Crossed { edge, normal, change: sign * jump });
            }
            sum += block.sizes(slots);
            self.crossing.push(Crossing { block: b, slots, rises: was_above });
        }
        sum
    }

    /// Calls back for the crossings of the edge in a slot with others that have ended.
    #[inline(always)]
    pub fn each_crossed(&self, slot: usize, found: impl FnMut(&Crossed)) {
        self.crossed[slot].iter().for_each(found);
    }

    /// Calls back for what the edge that ended last has crossed: the chain, its normal, and whether it was above before.
    #[inline(always)]
    pub fn each_crossing(&self, mut found: impl FnMut(u32, Vec3, bool)) {
        for &Crossing { block, slots, rises } in &self.crossing {
            let block = &self.blocks[block];
            bits(slots).for_each(|bit| found(block.chains[bit], block.normal(bit), rises >> bit & 1 != 0));
        }
    }

    /// Marks which chains pass above a unit vector; whether for one this is in doubt, which then is doubtful. `rounded` is the
    /// vector in single precision, which is enough for most.
    #[inline(always)]
    pub fn look(&mut self, position: DVec3, rounded: Vec3, edges: &Edges, chains: &mut [Chain]) -> bool {
        let mut is_near = false;
        for block in &mut self.blocks[..self.used] {
            if block.look(rounded) {
                is_near |= block.look_closely(position, edges, chains);
            }
        }
        is_near
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::exact::tests::scenes::Random;

    fn chain(random: &mut Random) -> Chain {
        let jump = if random.number() < 0.5 { -2 } else { 1 };
        let (normal, above) = (random.direction().as_vec3(), 0);
        let flags = (true, false);
        Chain {
            edge: 0,
            normal,
            jump,
            above,
            starts_above_horizon: flags.0,
            is_doubtful: flags.1,
            first_band: 0,
            last_band: 0,
        }
    }

    /// Chains come, go on and go, over several blocks; what is kept of them is compared with what the normals say.
    #[test]
    fn masks_follow_the_normals() {
        let mut random = Random(21);
        let mut slots = Slots::default();
        slots.reset();
        let mut held: Vec<(usize, Chain)> = Vec::new();
        let mut sides: Vec<Vec<bool>> = Vec::new();
        for step in 0..1500 {
            let w = random.direction().as_vec3();
            for block in &mut slots.blocks[..slots.used] {
                let near = block.look(w);
                let above = block.above;
                assert_eq!((block.look_portable(w), block.above), (near, above));
            }
            let is_above = |slot: usize| slots.blocks[slot / WORD].above >> (slot % WORD) & 1 != 0;
            let height = |chain: &Chain| chain.normal.x * w.x + chain.normal.y * w.y + chain.normal.z * w.z;
            assert!(held.iter().all(|(slot, chain)| is_above(*slot) == (height(chain) < 0.0)));
            let jumps = held.iter().filter(|(_, chain)| height(chain) < 0.0).map(|(_, chain)| chain.jump);
            assert_eq!(slots.jumps_above(), jumps.sum::<i32>());

            // The bookkeeping that masks save: whether each lay above each at the last vertex of either.
            let above: Vec<bool> = held.iter().map(|(_, chain)| height(chain) < 0.0).collect();
            let one = (random.number() * held.len() as f64) as usize;
            if step % 3 > 0 && one < held.len() {
                let (slot, old) = held[one];
                slots.hide(slot);
                slots.blocks.iter_mut().for_each(|block| _ = block.look(w));
                let crossed = (0..held.len()).filter(|&other| other != one && sides[one][other] != above[other]);
                let sum: i32 = crossed.map(|other| held[other].1.jump.abs()).sum();
                let before = slots.blocks[slot / WORD].crossed[slot % WORD];
                assert_eq!(slots.cross(slot, true, &old) - before, sum);
                for other in (0..held.len()).filter(|&other| other != one) {
                    sides[one][other] = above[other];
                    sides[other][one] = !above[other];
                }
                if random.number() < held.len() as f64 / 300.0 {
                    slots.remove(slot);
                    held.remove(one);
                    sides.remove(one);
                    sides.iter_mut().for_each(|row| _ = row.remove(one));
                } else {
                    held[one].1 = Chain { jump: old.jump, ..chain(&mut random) };
                    slots.follow(slot, &held[one].1, false);
                }
            } else {
                let new = chain(&mut random);
                held.push((slots.insert(step, &new, false), new));
                sides.iter_mut().zip(&above).for_each(|(row, above)| row.push(!above));
                sides.push([above, vec![false]].concat());
            }
            for (a, row) in held.iter().zip(&sides) {
                assert!(held.iter().zip(row).all(|(b, &side)| a.0 == b.0 || slots.was_above(a.0, b.0) == side));
            }
        }
        assert!(held.len() > 2 * WORD, "{}", held.len());
    }
}
