//! The dual edges: which faces share which edge. Topology only.

use std::ops::{Deref, Range};

/// Top bit of a word whose other bits hold an index.
const FLAG: u32 = 1 << 31;

/// The use of an edge by one of its faces: the face, and whether it runs along the edge or against it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Incidence(u32);

impl Incidence {
    pub(crate) const fn new(face: u32, against: bool) -> Self {
        debug_assert!(face < FLAG);
        Self(face | if against { FLAG } else { 0 })
    }

    /// The face.
    #[inline(always)]
    pub const fn face(self) -> u32 {
        self.0 & !FLAG
    }

    /// +1 if the face runs from `a` to `b` in its winding, -1 if from `b` to `a`.
    #[inline(always)]
    pub const fn orientation(self) -> i8 {
        if self.0 & FLAG == 0 { 1 } else { -1 }
    }

    /// The same use of the edge by a face of another number.
    #[inline(always)]
    pub(crate) const fn with_face(self, face: u32) -> Self {
        Self(face | self.0 & FLAG)
    }
}

/// An edge in 16 bytes. One or two faces stand in the record; more stand in a side table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Record {
    a: u32,
    /// Flagged if the faces stand in the side table, where `faces` is then their start and number.
    b: u32,
    /// A lone face is repeated.
    faces: [u32; 2],
}

impl Record {
    /// Vertices, the smaller first.
    #[inline(always)]
    pub(crate) fn vertices(self) -> [u32; 2] {
        [self.a, self.b & !FLAG]
    }

    /// Where the faces stand in the side table, if there are more than two.
    #[inline(always)]
    pub(crate) fn fan(self) -> Option<Range<usize>> {
        let [first, count] = self.faces.map(|word| word as usize);
        (self.b & FLAG != 0).then_some(first..first + count)
    }

    /// The two faces if there are exactly two and they run in opposite directions, the one from `a` to `b` first.
    #[inline(always)]
    pub(crate) fn regular(self) -> Option<[u32; 2]> {
        let [f, g] = self.faces;
        (self.b & FLAG == 0 && f & FLAG == 0 && g & FLAG != 0).then_some([f, g & !FLAG])
    }

    /// The face if there is only one.
    #[inline(always)]
    pub(crate) fn lone(self) -> Option<Incidence> {
        let [f, g] = self.faces;
        (self.b & FLAG == 0 && f == g).then_some(Incidence(f))
    }
}

#[cfg(test)]
impl Record {
    /// Loses the last face of a fan.
    pub(crate) fn shorten(&mut self) {
        self.faces[1] -= 1;
    }
}

/// All edges, and the edges of every face.
#[derive(Clone, Debug, Default)]
pub(crate) struct Edges {
    pub(crate) records: Vec<Record>,
    /// Faces of the edges with more than two.
    pub(crate) fans: Vec<Incidence>,
    /// Edges of every face, in the order of its corners: the edges from corner 0 to 1, 1 to 2, 2 to 0.
    pub(crate) of_faces: Vec<[u32; 3]>,
}

impl Edges {
    /// Collects the edges in lexicographic order of their vertices, each with its faces in ascending order but for pairs,
    /// which lead with the face that runs along the edge.
    ///
    /// The corners of every triangle must differ and lie below `vertices`, itself at most 2^31; so must the number of
    /// triangles. `of_faces` is left empty until the edges have their final order.
    pub(crate) fn collect(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        // Counting sort by the smaller vertex, then a small sort by the other.
        let mut start = vec![0u32; vertices + 1];
        for (u, v) in triangles.iter().flat_map(sides) {
            start[u.min(v) as usize + 1] += 1;
        }
        for i in 0..vertices {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut uses = vec![(0u32, Incidence::default()); 3 * triangles.len()];
        for (face, triangle) in triangles.iter().enumerate() {
            for (u, v) in sides(triangle) {
                let slot = &mut next[u.min(v) as usize];
                uses[*slot as usize] = (u.max(v), Incidence::new(face as u32, u > v));
                *slot += 1;
            }
        }
        drop(next);
        let mut edges = Self { records: Vec::with_capacity(3 * triangles.len() / 2), ..Self::default() };
        for a in 0..vertices {
            let around = &mut uses[start[a] as usize..start[a + 1] as usize];
            around.sort_unstable_by_key(|&(b, use_)| (b, use_.face()));
            for shared in around.chunk_by(|x, y| x.0 == y.0) {
                edges.push(a as u32, shared);
            }
        }
        edges.records.shrink_to_fit();
        edges
    }

    fn push(&mut self, a: u32, shared: &[(u32, Incidence)]) {
        let b = shared[0].0;
        let uses = shared.iter().map(|&(_, use_)| use_);
        self.records.push(if shared.len() > 2 {
            let first = self.fans.len() as u32;
            self.fans.extend(uses);
            Record { a, b: b | FLAG, faces: [first, shared.len() as u32] }
        } else {
            let mut uses = uses.map(|use_| use_.0);
            let first = uses.next().unwrap_or_default();
            let second = uses.next().unwrap_or(first);
            Record { a, b, faces: if first & FLAG != 0 { [second, first] } else { [first, second] } }
        });
    }

    /// The faces of an edge.
    #[inline(always)]
    pub(crate) fn incidences(&self, edge: u32) -> Incidences<'_> {
        let record = self.records[edge as usize];
        match record.fan() {
            Some(fan) => Incidences { few: [Incidence(0); 2], count: 0, fan: &self.fans[fan] },
            None => {
                let [f, g] = record.faces;
                Incidences { few: [Incidence(f), Incidence(g)], count: if f == g { 1 } else { 2 }, fan: &[] }
            }
        }
    }

    /// Puts the edges in the order `old`, which lists their present numbers, and finds the edges of every face.
    pub(crate) fn reorder(&mut self, old: &[u32], triangles: &[[u32; 3]]) {
        self.records = old.iter().map(|&edge| self.records[edge as usize]).collect();
        self.of_faces = vec![[0; 3]; triangles.len()];
        for edge in 0..self.records.len() as u32 {
            let record = self.records[edge as usize];
            let [a, _] = record.vertices();
            let uses: &[Incidence] = match record.fan() {
                Some(fan) => &self.fans[fan],
                None => &record.faces.map(Incidence),
            };
            for &use_ in uses {
                let face = use_.face() as usize;
                let [u, v, _] = triangles[face];
                // The side starts at `a` or, run against, ends there.
                let corner = if a == u {
                    0
                } else if a == v {
                    1
                } else {
                    2
                };
                let side = if use_.orientation() > 0 { corner } else { (corner + 2) % 3 };
                self.of_faces[face][side] = edge;
            }
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.records) + size_of_val(&*self.fans) + size_of_val(&*self.of_faces)
    }
}

/// The faces of one edge, see [`Edges::incidences`].
#[derive(Clone, Copy)]
pub(crate) struct Incidences<'a> {
    few: [Incidence; 2],
    count: usize,
    fan: &'a [Incidence],
}

impl Deref for Incidences<'_> {
    type Target = [Incidence];

    #[inline(always)]
    fn deref(&self) -> &[Incidence] {
        if self.count == 0 { self.fan } else { &self.few[..self.count] }
    }
}

/// The directed sides of a triangle.
pub(crate) fn sides(&[a, b, c]: &[u32; 3]) -> impl Iterator<Item = (u32, u32)> {
    [(a, b), (b, c), (c, a)].into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;

    type Uses = Vec<(u32, i8)>;

    fn uses(edges: &Edges) -> Vec<([u32; 2], Uses)> {
        (0..edges.records.len() as u32)
            .map(|edge| {
                let faces = edges.incidences(edge).iter().map(|i| (i.face(), i.orientation())).collect();
                (edges.records[edge as usize].vertices(), faces)
            })
            .collect()
    }

    #[test]
    fn a_consistent_pair_leads_with_the_face_along_the_edge() {
        let edges = Edges::collect(4, &[[1, 0, 2], [0, 1, 3]]);
        assert_eq!(edges.records.len(), 5);
        assert_eq!(uses(&edges)[0], ([0, 1], vec![(1, 1), (0, -1)]));
        assert_eq!(edges.records[0].regular(), Some([1, 0]));
        assert_eq!(uses(&edges)[1], ([0, 2], vec![(0, 1)]));
        assert_eq!(edges.records[1].regular(), None);
    }

    #[test]
    fn a_fan_of_three_and_an_inconsistent_pair_keep_all_faces() {
        let triangles = [[0, 1, 2], [0, 1, 3], [1, 0, 4], [2, 0, 5], [2, 0, 3]];
        let edges = Edges::collect(6, &triangles);
        let of = |pair| uses(&edges).into_iter().find(|(v, _)| *v == pair).map(|(_, f)| f);
        assert_eq!(of([0, 1]), Some(vec![(0, 1), (1, 1), (2, -1)]));
        assert_eq!(of([0, 2]), Some(vec![(0, -1), (3, -1), (4, -1)]));
        assert_eq!(of([0, 3]), Some(vec![(4, 1), (1, -1)]));
        let twisted = Edges::collect(4, &[[0, 1, 2], [0, 1, 3]]);
        assert_eq!(uses(&twisted)[0], ([0, 1], vec![(0, 1), (1, 1)]));
        assert!([&edges, &twisted].iter().all(|edges| edges.records[0].regular().is_none()));
    }

    #[test]
    fn faces_know_their_edges_in_the_order_of_their_sides() {
        let triangles = [[2, 0, 1], [1, 0, 3], [0, 1, 4]];
        let mut edges = Edges::collect(5, &triangles);
        let backwards: Vec<u32> = (0..edges.records.len() as u32).rev().collect();
        edges.reorder(&backwards, &triangles);
        for (triangle, sides_of) in triangles.iter().zip(&edges.of_faces) {
            for ((u, v), &edge) in sides(triangle).zip(sides_of) {
                assert_eq!(edges.records[edge as usize].vertices(), [u.min(v), u.max(v)]);
            }
        }
    }
}
