use crate::candidates::room;
use crate::pairs::LANES;

/// Which of a part's edges have their ends in different cells, at least one of them not [`OUTSIDE`](crate::OUTSIDE), and which have such an
/// end at all: a bit each, from the part's first edge on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Divided {
    // Buffers may be longer than what they hold.
    pub(crate) apart: Vec<u64>,
    pub(crate) inside: Vec<u64>,
}

impl Divided {
    /// Makes room for so many words.
    pub(crate) fn room(&mut self, words: usize) {
        // One more, so that 64 bits can be taken from anywhere.
        room(&mut self.apart, words + 1);
        room(&mut self.inside, words + 1);
    }

    /// 64 bits of a mask, from this one on.
    #[inline(always)]
    pub(crate) fn bits(mask: &[u64], from: usize) -> u64 {
        let (word, bit) = (from / LANES, from % LANES);
        mask[word] >> bit | mask[word + 1] << 1 << (LANES - 1 - bit)
    }
}
