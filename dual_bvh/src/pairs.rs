//! Which edges have their two faces on different sides, 64 at once.

use std::ops::Range;

use crate::candidates::room;
#[cfg(target_arch = "x86_64")]
use crate::choice::Choice;
#[cfg(target_arch = "x86_64")]
use crate::contours::Contour;

/// Where the two faces of every edge stand in a table of bits, one a face: for either face the number of the byte, and the bit in it.
///
/// Signs that are looked up one by one take a few cycles an edge, however it is done: gathers are no faster than loads. A table of 256
/// bytes fits into registers, where one instruction looks up 64 of them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pairs {
    bytes: [Vec<u8>; 2],
    bits: [Vec<u8>; 2],
}

/// Faces that have a place in the table.
pub(crate) const FACES: usize = 8 * 256;

/// Edges looked at together.
pub(crate) const LANES: usize = 64;

impl Pairs {
    /// Makes room for so many edges.
    pub(crate) fn room(&mut self, edges: usize) {
        // Whole lanes are loaded.
        self.bytes.iter_mut().chain(&mut self.bits).for_each(|lanes| room(lanes, edges + LANES));
    }

    /// Notes the faces of edges from `first` on, for which there must be room, all below [`FACES`].
    #[inline(always)]
    pub(crate) fn set(&mut self, first: usize, faces: impl Iterator<Item = [u32; 2]>) {
        let [[bytes, other_bytes], [bits, other_bits]] =
            [&mut self.bytes, &mut self.bits].map(|pair| pair.each_mut().map(|lanes| lanes[first..].iter_mut()));
        let places = bytes.zip(other_bytes).zip(bits.zip(other_bits));
        for (((byte, other_byte), (bit, other_bit)), [face, other]) in places.zip(faces) {
            (*byte, *bit) = ((face >> 3) as u8, 1 << (face & 7));
            (*other_byte, *other_bit) = ((other >> 3) as u8, 1 << (other & 7));
        }
    }

    /// Writes to the start of `out` those of some edges whose faces have different signs, 1 or -1, and that are chosen, and returns their
    /// number. The edges must have been set; `out` has room for all, and for eight more.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
    pub(crate) fn contours(
        &self,
        edges: Range<usize>,
        signs: &[i8],
        choice: &mut impl Choice,
        out: &mut [Contour],
    ) -> usize {
        use std::arch::x86_64::*;

        let table = table(signs);
        let [[first, second], [first_bits, second_bits]] =
            [&self.bytes, &self.bits].map(|pair| [0, 1].map(|side| &pair[side][edges.start..edges.end + LANES]));
        // SAFETY: there are 64 bytes to load.
        let load = |lanes: &[u8], at: usize| unsafe { _mm512_loadu_epi8(lanes[at..at + LANES].as_ptr().cast()) };
        let negative = |bytes: &[u8], bits: &[u8], at: usize| {
            let place = load(bytes, at);
            // The lower seven bits choose among 128 bytes, the highest one between these.
            let lower = _mm512_permutex2var_epi8(table[0], place, table[1]);
            let upper = _mm512_permutex2var_epi8(table[2], place, table[3]);
            let byte = _mm512_mask_blend_epi8(_mm512_movepi8_mask(place), lower, upper);
            _mm512_test_epi8_mask(byte, load(bits, at))
        };
        // A contour in eight bytes: its number, and its jump above.
        let eight = _mm512_set1_epi64(8);
        let jumps = [2i32, -2].map(|jump| _mm512_set1_epi64(i64::from(jump) << 32));
        let mut numbers =
            _mm512_add_epi64(_mm512_set1_epi64(edges.start as i64), _mm512_set_epi64(7, 6, 5, 4, 3, 2, 1, 0));
        let mut count = 0;
        for at in (0..edges.len()).step_by(LANES) {
            let mut is_negative = negative(first, first_bits, at);
            let mut contours = is_negative ^ negative(second, second_bits, at);
            if edges.len() - at < LANES {
                contours &= (1 << (edges.len() - at)) - 1;
            }
            contours = choice.of(edges.start + at, contours);
            for _ in 0..LANES / 8 {
                let jumps = _mm512_mask_blend_epi64(is_negative as u8, jumps[0], jumps[1]);
                // All lanes are written, those of contours first.
                let eight_edges = _mm512_maskz_compress_epi64(contours as u8, _mm512_or_epi64(numbers, jumps));
                let room = &mut out[count..count + 8];
                // SAFETY: there is room for eight contours of eight bytes.
                unsafe { _mm512_storeu_epi64(room.as_mut_ptr().cast(), eight_edges) };
                count += (contours as u8).count_ones() as usize;
                (is_negative, contours) = (is_negative >> 8, contours >> 8);
                numbers = _mm512_add_epi64(numbers, eight);
            }
        }
        count
    }
}

/// One bit a face, set where its sign is negative.
#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn table(signs: &[i8]) -> [std::arch::x86_64::__m512i; 4] {
    use std::arch::x86_64::*;

    let mut words = [0u64; FACES / 64];
    let (whole, rest) = signs.as_chunks::<64>();
    for (word, signs) in words.iter_mut().zip(whole) {
        // SAFETY: there are 64 bytes to load.
        *word = _mm512_movepi8_mask(unsafe { _mm512_loadu_epi8(signs.as_ptr()) });
    }
    if let Some(word) = words.get_mut(whole.len()) {
        *word = rest.iter().enumerate().fold(0, |word, (i, &sign)| word | u64::from(sign < 0) << i);
    }
    // SAFETY: each part holds 64 bytes.
    [0, 8, 16, 24].map(|first| unsafe { _mm512_loadu_epi64(words[first..first + 8].as_ptr().cast()) })
}

#[cfg(all(test, target_arch = "x86_64"))]
pub(crate) mod tests {
    use super::*;
    use crate::choice::All;
    use crate::features::has_lookup;

    /// Random numbers, each below the one given: a linear congruential generator.
    pub(crate) fn numbers() -> impl FnMut(usize) -> usize {
        let mut state = 1u64;
        move |below| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as usize % below
        }
    }

    #[test]
    fn every_difference_is_found_in_order() {
        if !has_lookup() {
            return;
        }
        let mut random = numbers();
        let mut pairs = Pairs::default();
        for faces in [1, 2, 63, 64, 65, 700, 1024, 1025, 2047, FACES] {
            for (start, count) in [(0, 0), (3, 1), (0, 63), (7, 64), (1, 65), (5, 1000)] {
                pairs.room(start + count);
                let signs: Vec<i8> = (0..faces).map(|_| [1, -1][random(2)]).collect();
                let ends: Vec<[u32; 2]> = (0..count).map(|_| [0; 2].map(|_| random(faces) as u32)).collect();
                pairs.set(start, ends.iter().copied());
                let mut found = vec![Contour::default(); count + 8];
                // SAFETY: the processor has the features.
                let number = unsafe { pairs.contours(start..start + count, &signs, &mut All, &mut found) };
                let jumps = ends.iter().map(|faces| faces.map(|face| i32::from(signs[face as usize])));
                let expected = (start as u32..).zip(jumps).map(|(edge, [f, g])| Contour { edge, jump: f - g });
                let expected: Vec<_> = expected.filter(|contour| contour.jump != 0).collect();
                assert_eq!(found[..number], expected, "{faces} {count}");
            }
        }
    }
}
