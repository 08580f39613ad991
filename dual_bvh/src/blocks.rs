//! Candidates in blocks that lie side by side, for receivers that need a part of them only.

use std::ops::Range;

use glam::Vec3;

use crate::Candidates;
use crate::candidates::room;

/// Candidates in a block.
const BLOCK: usize = 32;
/// Runs of vertices and faces begin and end at multiples of this: as many are handled side by side.
const LANES: usize = 4;

/// Candidates that lie near each other, block after block, each in a ball: whether a receiver needs a block can be told from the
/// ball.
#[derive(Clone, Debug, Default)]
pub struct Blocks {
    // The buffers of the balls may be longer than what they hold.
    centers: [Vec<f32>; 3],
    radii: Vec<f32>,
    count: usize,
    /// First candidate, vertex and face of each block that no earlier one has, with an end mark.
    edges: Vec<u32>,
    vertices: Vec<u32>,
    faces: Vec<u32>,
    /// Which earlier blocks have the rest of its vertices and faces: the first of each block's, with an end mark.
    first_need: Vec<u32>,
    needs: Vec<u32>,
    /// Block of each vertex and of each face.
    vertex_block: Vec<u32>,
    face_block: Vec<u32>,
    /// The last block that has been found to need a block.
    needed_by: Vec<u32>,
}

/// The part of a tile's candidates that one receiver needs.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// One for each block: whether it is wanted, and whether its vertices and faces are needed.
    needed: Vec<bool>,
    pub(crate) edges: Vec<Range<usize>>,
    pub(crate) faces: Vec<Range<usize>>,
    vertices: Vec<Range<usize>>,
}

impl Blocks {
    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Centres, by component, and radii of the balls around the blocks.
    #[inline(always)]
    pub fn balls(&self) -> ([&[f32]; 3], &[f32]) {
        ([0, 1, 2].map(|axis| &self.centers[axis][..self.count]), &self.radii[..self.count])
    }

    /// Makes blocks of candidates.
    pub(crate) fn fill(&mut self, candidates: &Candidates) {
        for starts in [&mut self.edges, &mut self.vertices, &mut self.faces, &mut self.first_need] {
            starts.clear();
            starts.push(0);
        }
        self.needs.clear();
        let (vertices, faces) = (candidates.vertices().len(), candidates.faces().len());
        room(&mut self.vertex_block, vertices);
        room(&mut self.face_block, faces);
        self.count = candidates.edges().len().div_ceil(BLOCK);
        self.needed_by.clear();
        self.needed_by.resize(self.count, u32::MAX);
        for lanes in self.centers.iter_mut().chain([&mut self.radii]) {
            room(lanes, self.count);
        }
        let (mut vertices, mut faces, mut incidences) = (0, 0, 0);
        for (block, edges) in candidates.edges().chunks(BLOCK).enumerate() {
            let id = block as u32;
            // Numbers are given in the order of the candidates: the new ones follow those of the earlier blocks.
            let (first_vertex, first_face) = (vertices, faces);
            let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            for edge in edges {
                for vertex in [edge.a, edge.b] {
                    let p = candidates.corner(vertex);
                    (low, high) = (low.min(p), high.max(p));
                    if vertex < first_vertex {
                        self.need(self.vertex_block[vertex as usize], id);
                    } else {
                        self.vertex_block[vertex as usize] = id;
                        vertices = vertices.max(vertex + 1);
                    }
                }
            }
            let end = incidences + edges.iter().map(|edge| edge.len as usize).sum::<usize>();
            for incidence in &candidates.incidences()[incidences..end] {
                let face = incidence.face();
                if face < first_face {
                    self.need(self.face_block[face as usize], id);
                } else {
                    self.face_block[face as usize] = id;
                    faces = faces.max(face + 1);
                }
            }
            incidences = end;
            let center = low.midpoint(high);
            let corners = edges.iter().flat_map(|edge| [edge.a, edge.b]).map(|vertex| candidates.corner(vertex));
            let square = corners.map(|p| (p - center).length_squared()).fold(0.0, f32::max);
            // Rounding of the differences, the squares and the root: a few units in the last place.
            self.radii[block] = square.sqrt() * (1.0 + 8.0 * f32::EPSILON) + f32::MIN_POSITIVE;
            for (lanes, value) in self.centers.iter_mut().zip(center.to_array()) {
                lanes[block] = value;
            }
            self.edges.push((block * BLOCK + edges.len()) as u32);
            self.vertices.push(vertices);
            self.faces.push(faces);
            self.first_need.push(self.needs.len() as u32);
        }
    }

    #[inline(always)]
    fn need(&mut self, earlier: u32, block: u32) {
        let last = &mut self.needed_by[earlier as usize];
        if *last != block {
            *last = block;
            self.needs.push(earlier);
        }
    }

    /// Selects the candidates of the wanted blocks, one flag for each: not zero.
    ///
    /// Panics if the flags are not as many as the blocks.
    pub fn select(&self, wanted: &[i32], selection: &mut Selection) {
        assert_eq!(wanted.len(), self.count, "one flag for each block");
        let Selection { needed, edges, faces, vertices } = selection;
        edges.clear();
        faces.clear();
        vertices.clear();
        needed.clear();
        needed.resize(self.count, false);
        for block in (0..self.count).filter(|&block| wanted[block] != 0) {
            push(edges, self.edges[block] as usize..self.edges[block + 1] as usize);
            needed[block] = true;
            for &earlier in &self.needs[self.first_need[block] as usize..self.first_need[block + 1] as usize] {
                needed[earlier as usize] = true;
            }
        }
        let [vertex_count, face_count] = [&self.vertices, &self.faces].map(|starts| starts[self.count] as usize);
        for block in (0..self.count).filter(|&block| needed[block]) {
            let lanes = |starts: &[u32], count: usize| {
                let [start, end] = [starts[block], starts[block + 1]].map(|at| at as usize);
                start / LANES * LANES..end.next_multiple_of(LANES).min(count)
            };
            push(vertices, lanes(&self.vertices, vertex_count));
            push(faces, lanes(&self.faces, face_count));
        }
    }
}

impl Selection {
    /// All candidates.
    pub fn all(&mut self, candidates: &Candidates) {
        let runs = [&mut self.edges, &mut self.faces, &mut self.vertices];
        let counts = [candidates.edges().len(), candidates.faces().len(), candidates.vertices().len()];
        for (runs, count) in runs.into_iter().zip(counts) {
            runs.clear();
            runs.push(0..count);
        }
    }

    /// Number of candidates selected.
    pub fn len(&self) -> usize {
        self.edges.iter().map(Range::len).sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether a candidate is selected.
    pub fn contains(&self, edge: usize) -> bool {
        self.edges.iter().any(|run| run.contains(&edge))
    }

    /// The vertices that they use, and perhaps some more, in ascending runs of local numbers.
    pub fn vertices(&self) -> &[Range<usize>] {
        &self.vertices
    }
}

/// Adds a run that begins no earlier than the last one.
#[inline(always)]
fn push(runs: &mut Vec<Range<usize>>, run: Range<usize>) {
    match runs.last_mut() {
        Some(last) if last.end >= run.start => last.end = run.end,
        _ => runs.push(run),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;

    use super::*;
    use crate::{BuildOptions, Contours, DualBvh, Tile};

    /// A wavy sheet with a border, folds of three faces, and a part wound the other way.
    fn sheet() -> DualBvh {
        let side = 40;
        let positions: Arc<[Vec3]> = (0..side * side)
            .map(|i| ((i % side) as f32, (i / side) as f32))
            .map(|(x, y)| Vec3::new(x, y, 2.0 * (0.7 * x).sin() * (0.4 * y).cos()))
            .collect();
        let cells = (0..(side - 1) * (side - 1)).map(|i| i % (side - 1) + i / (side - 1) * side);
        let triangles = cells.flat_map(|i| [[i, i + 1, i + side], [i + 1, i + side + 1, i + side]]);
        let fins = (0..20).map(|i| [41 * i, 41 * i + 1, 1599 - i]);
        let triangles = triangles.chain(fins).map(|[a, b, c]| if a % 7 < 2 { [b, a, c] } else { [a, b, c] }).collect();
        DualBvh::build(positions, triangles, &BuildOptions::default()).unwrap()
    }

    #[test]
    fn selected_contours_are_those_of_the_wanted_blocks() {
        let tree = sheet();
        let (mut candidates, mut all, mut some) = (Candidates::default(), Contours::default(), Contours::default());
        let (mut selection, mut found) = (Selection::default(), 0);
        for i in 0..60u32 {
            let p = DVec3::new(0.6 * f64::from(i), 11.3, 0.1 * f64::from(i % 5));
            tree.search(&Tile::new([(p, None), (p + 0.3, None)].into_iter()).with_faces(&[3, 4]), &mut candidates);
            candidates.contours(p, &[3, 4], &mut all);
            let blocks = candidates.blocks();
            let wanted: Vec<i32> = (0..blocks.len()).map(|block| i32::from((block as u32 * 7 + i) % 5 < 2)).collect();
            blocks.select(&wanted, &mut selection);
            candidates.selected_contours(&selection, p, &[3, 4], &mut some);
            let expected: Vec<_> =
                all.edges().iter().copied().filter(|contour| wanted[contour.edge as usize / BLOCK] != 0).collect();
            assert_eq!(some.edges(), expected);
            let is_selected = |vertex: u32| selection.vertices().iter().any(|run| run.contains(&(vertex as usize)));
            let mut used = expected.iter().map(|contour| candidates.edges()[contour.edge as usize]);
            assert!(used.all(|edge| is_selected(edge.a) && is_selected(edge.b)));
            assert_eq!(
                selection.len(),
                candidates.edges().iter().enumerate().filter(|(edge, _)| wanted[edge / BLOCK] != 0).count()
            );
            found += expected.len();
            selection.all(&candidates);
            candidates.selected_contours(&selection, p, &[3, 4], &mut some);
            assert_eq!(some.edges(), all.edges());
        }
        assert!(found > 1000);
    }

    #[test]
    fn balls_hold_their_blocks() {
        let tree = sheet();
        let mut candidates = Candidates::default();
        tree.all_edges(&mut candidates);
        let blocks = candidates.blocks().clone();
        let ([x, y, z], radii) = blocks.balls();
        assert_eq!(blocks.len(), candidates.edges().len().div_ceil(BLOCK));
        for (edge, ends) in candidates.edges().iter().enumerate() {
            let block = edge / BLOCK;
            let center = DVec3::new(x[block].into(), y[block].into(), z[block].into());
            for vertex in [ends.a, ends.b] {
                assert!(candidates.position(vertex).distance(center) <= f64::from(radii[block]));
            }
        }
    }
}
