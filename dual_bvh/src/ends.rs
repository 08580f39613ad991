//! Which edges have their two ends in different cells, 64 at once.

use std::ops::Range;

use crate::candidates::{CandidateEdge, room};
#[cfg(target_arch = "x86_64")]
use crate::divided::Divided;
use crate::pairs::LANES;

/// Where the two ends of every edge stand in a table of vertices: one table for 64 edges, which have no more than twice as many ends.
///
/// Whoever asks the cells of both ends of every edge one by one takes a dozen cycles an edge. Two tables of 128 bytes, for the lower and
/// the upper halves of their numbers, fit into registers, where one instruction looks up 64 ends.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ends {
    places: [Vec<u8>; 2],
    tables: Vec<Table>,
    /// Vertices of tables that earlier tables have, too, once for each of the ends.
    others: Vec<u32>,
}

/// The vertices of a table: new ones, numbered one after another, at its start, and others at its end, backwards.
#[derive(Clone, Debug)]
struct Table {
    new: Range<u32>,
    others: Range<u32>,
}

/// Cells of this number and beyond do not fit into the tables.
#[cfg(target_arch = "x86_64")]
pub(crate) const CELLS: i32 = 1 << 15;

/// Places of a table.
const PLACES: usize = 2 * LANES;

impl Ends {
    /// Forgets all edges.
    pub(crate) fn clear(&mut self) {
        self.tables.clear();
        self.others.clear();
    }

    /// Notes the ends of some edges, in which every vertex from `first` on comes after all smaller ones. Returns the numbers of their
    /// tables.
    #[inline(always)]
    pub(crate) fn push(&mut self, edges: &[CandidateEdge], first: usize) -> Range<usize> {
        let old = self.tables.len();
        let mut known = first as u32;
        for edges in edges.chunks(LANES) {
            let table = self.tables.len();
            let start = known;
            let other_start = self.others.len();
            self.others.resize(other_start + PLACES, 0);
            let others = &mut self.others[other_start..];
            let mut count = 0;
            self.places.iter_mut().for_each(|places| room(places, LANES * (table + 1)));
            let places = self.places.each_mut().map(|places| &mut places[LANES * table..][..LANES]);
            let [places_a, places_b] = places;
            for ((edge, place_a), place_b) in edges.iter().zip(places_a).zip(places_b) {
                for (vertex, place) in [(edge.a, place_a), (edge.b, place_b)] {
                    // Without a branch on what nobody can predict.
                    let is_new = vertex >= start;
                    others[count] = vertex;
                    *place = if is_new { vertex - start } else { (PLACES - 1 - count) as u32 } as u8;
                    count += usize::from(!is_new);
                    known = known.max(vertex + 1);
                }
            }
            self.others.truncate(other_start + count);
            self.tables.push(Table { new: start..known, others: other_start as u32..(other_start + count) as u32 });
        }
        old..self.tables.len()
    }

    /// Divides the edges of some tables by the cells of their vertices.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
    pub(crate) fn divide(&self, tables: Range<usize>, cells: &[i32], out: &mut Divided) {
        use std::arch::x86_64::*;

        #[repr(align(64))]
        struct Bytes([u8; PLACES]);

        out.room(tables.len());
        let [places_a, places_b] = [0, 1].map(|end| &self.places[end][LANES * tables.start..LANES * tables.end]);
        let places = places_a.as_chunks::<LANES>().0.iter().zip(places_b.as_chunks::<LANES>().0);
        let masks = out.apart.iter_mut().zip(&mut out.inside);
        let (mut low, mut high) = (Bytes([0; PLACES]), Bytes([0; PLACES]));
        let (number, outside) = (_mm512_set1_epi8(0x7f), _mm512_set1_epi8(-0x80));
        for ((table, (places_a, places_b)), (apart, inside)) in self.tables[tables].iter().zip(places).zip(masks) {
            let new = &cells[table.new.start as usize..table.new.end as usize];
            for (at, cells) in (0..).step_by(16).zip(new.chunks(16)) {
                let lanes = ((1u32 << cells.len()) - 1) as u16;
                // SAFETY: only the lanes of the chunk are loaded.
                let cells = unsafe { _mm512_maskz_loadu_epi32(lanes, cells.as_ptr()) };
                let [low, high] = [&mut low, &mut high].map(|bytes| bytes.0[at..at + 16].as_mut_ptr().cast());
                // The mark comes to the uppermost of sixteen bits.
                let upper = _mm512_srli_epi32::<8>(_mm512_or_si512(cells, _mm512_srli_epi32::<15>(cells)));
                // SAFETY: sixteen bytes are stored.
                unsafe {
                    _mm_storeu_si128(low, _mm512_cvtepi32_epi8(cells));
                    _mm_storeu_si128(high, _mm512_cvtepi32_epi8(upper));
                }
            }
            let others = &self.others[table.others.start as usize..table.others.end as usize];
            for (other, place) in others.iter().zip((0..PLACES).rev()) {
                let cell = cells[*other as usize];
                low.0[place] = cell as u8;
                high.0[place] = ((cell | cell >> 15) >> 8) as u8;
            }
            // SAFETY: the tables have 128 bytes, the places of 64 edges 64.
            let load = |bytes: &[u8], at: usize| unsafe { _mm512_loadu_epi8(bytes[at..at + 64].as_ptr().cast()) };
            let look = |bytes: &[u8; PLACES]| {
                let (first, second) = (load(bytes, 0), load(bytes, 64));
                [places_a, places_b].map(|places| _mm512_permutex2var_epi8(first, load(places, 0), second))
            };
            let ([low_a, low_b], [high_a, high_b]) = (look(&low.0), look(&high.0));
            let high_differs = _mm512_test_epi8_mask(_mm512_xor_si512(high_a, high_b), number);
            *inside = !_mm512_test_epi8_mask(_mm512_and_si512(high_a, high_b), outside);
            *apart = (_mm512_cmpneq_epi8_mask(low_a, low_b) | high_differs) & *inside;
        }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use crate::choice::{OUTSIDE, Tally};
    use crate::features::has_lookup;
    use crate::pairs::tests::numbers;

    #[test]
    fn edges_are_divided_as_one_by_one() {
        if !has_lookup() {
            return;
        }
        let mut random = numbers();
        for cell_count in [2, 100, 300, CELLS as usize] {
            let mut ends = Ends::default();
            let mut vertices = 3;
            for count in [0, 1, 63, 64, 65, 700, 129] {
                // Each vertex for the first time after all smaller ones, and some again, near or far.
                let first = vertices;
                let mut end = |vertices: &mut usize| {
                    if *vertices == first || random(3) == 0 {
                        *vertices += 1;
                        return *vertices as u32 - 1;
                    }
                    let back = [5, 80, 2000][random(3)].min(*vertices - first);
                    (*vertices - 1 - random(back)) as u32
                };
                let edges: Vec<CandidateEdge> =
                    (0..count).map(|_| CandidateEdge { a: end(&mut vertices), b: end(&mut vertices) }).collect();
                let tables = ends.push(&edges, first);
                let cells: Vec<i32> = (0..vertices)
                    .map(|_| random(cell_count) as i32 | if random(3) == 0 { OUTSIDE } else { 0 })
                    .collect();
                let mut divided = Divided::default();
                // SAFETY: the processor has the features.
                unsafe { ends.divide(tables, &cells, &mut divided) };
                let bits = |mask: &[u64], number: usize| Divided::bits(mask, number) & 1 != 0;
                for (number, edge) in edges.iter().enumerate() {
                    let mut tally = Tally::default();
                    let is_apart = tally.count([edge.a, edge.b].map(|end| cells[end as usize]));
                    assert_eq!(bits(&divided.inside, number), tally.inside == 1, "{number} of {count}");
                    assert_eq!(bits(&divided.apart, number), is_apart, "{number} of {count}");
                }
            }
        }
    }
}
