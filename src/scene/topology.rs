/// Index of a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VertexId(pub u32);

/// Index of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TriangleId(pub u32);

/// Index of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EdgeId(pub u32);

/// Which edges join which triangles of an indexed mesh: any number of faces to an edge, any winding. Positions play no
/// part here.
#[derive(Clone, Debug)]
pub struct Topology {
    edges: Vec<[VertexId; 2]>,
    first_face: Vec<u32>,
    faces: Vec<EdgeFace>,
    triangle_body: Vec<u32>,
    bodies: usize,
}

/// A face of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EdgeFace {
    /// The triangle.
    pub triangle: TriangleId,
    /// Whether the triangle's winding runs along the edge from its first vertex to its second, or back.
    pub direction: Direction,
}

/// Which way a face's winding runs along an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Direction {
    /// From the edge's first vertex to its second.
    Forward,
    /// From the second to the first.
    Backward,
}

/// What kind of surface lies at an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeKind {
    /// One face: the surface ends here.
    Boundary,
    /// Two faces that run through the edge in opposite directions.
    Manifold,
    /// Two faces that run in the same direction: one of them is turned inside out.
    InconsistentlyWound,
    /// Three faces or more.
    NonManifold,
}

impl Topology {
    /// Finds the edges and bodies of triangles over `vertices` vertices. Linear time; edges come out ordered by their
    /// lower, then their higher vertex, faces of an edge by triangle.
    ///
    /// # Panics
    /// When an index is not below `vertices`; a [`Geometry`](super::Geometry) never holds such a one.
    pub fn new(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        // Counting sort of the half-edges by their lower vertex, then a short sort around every vertex.
        let half_edges = || {
            (0u32..).zip(triangles).flat_map(|(t, &[a, b, c])| {
                [(a, b), (b, c), (c, a)].map(|(from, to)| {
                    let direction = if from < to { Direction::Forward } else { Direction::Backward };
                    (from.min(to), (from.max(to), t, direction))
                })
            })
        };
        let mut first = vec![0u32; vertices + 1];
        for (low, _) in half_edges() {
            first[low as usize + 1] += 1;
        }
        for v in 0..vertices {
            first[v + 1] += first[v];
        }
        let mut sorted = vec![(0, 0, Direction::Forward); 3 * triangles.len()];
        let mut next = first.clone();
        for (low, half_edge) in half_edges() {
            sorted[next[low as usize] as usize] = half_edge;
            next[low as usize] += 1;
        }

        let mut edges = Vec::with_capacity(sorted.len() / 2);
        let mut first_face = Vec::with_capacity(sorted.len() / 2 + 1);
        let mut faces = Vec::with_capacity(sorted.len());
        for low in 0..vertices {
            let around = &mut sorted[first[low] as usize..first[low + 1] as usize];
            around.sort_unstable();
            for edge in around.chunk_by(|x, y| x.0 == y.0) {
                edges.push([VertexId(low as u32), VertexId(edge[0].0)]);
                first_face.push(faces.len() as u32);
                let face = |&(_, t, direction): &_| EdgeFace { triangle: TriangleId(t), direction };
                faces.extend(edge.iter().map(face));
            }
        }
        first_face.push(faces.len() as u32);

        let mut topology = Self { edges, first_face, faces, triangle_body: Vec::new(), bodies: 0 };
        topology.find_bodies(triangles.len());
        topology
    }

    /// All edges, each once, with its lower vertex first.
    pub fn edges(&self) -> impl ExactSizeIterator<Item = EdgeId> + use<> {
        (0..self.edges.len() as u32).map(EdgeId)
    }

    /// The two ends of an edge, the lower one first.
    pub fn ends(&self, edge: EdgeId) -> [VertexId; 2] {
        self.edges[edge.0 as usize]
    }

    /// The faces of an edge, at least one, ordered by triangle.
    pub fn faces(&self, edge: EdgeId) -> &[EdgeFace] {
        let e = edge.0 as usize;
        &self.faces[self.first_face[e] as usize..self.first_face[e + 1] as usize]
    }

    /// What kind of surface lies at an edge.
    pub fn kind(&self, edge: EdgeId) -> EdgeKind {
        match self.faces(edge) {
            [_] => EdgeKind::Boundary,
            [a, b] if a.direction != b.direction => EdgeKind::Manifold,
            [_, _] => EdgeKind::InconsistentlyWound,
            _ => EdgeKind::NonManifold,
        }
    }

    /// Number of edges of a kind.
    pub fn count(&self, kind: EdgeKind) -> usize {
        self.edges().filter(|&e| self.kind(e) == kind).count()
    }

    /// Number of bodies: sets of triangles connected through shared edges.
    pub fn bodies(&self) -> usize {
        self.bodies
    }

    /// The body of a triangle; bodies are numbered in order of their first triangle.
    pub fn body(&self, triangle: TriangleId) -> u32 {
        self.triangle_body[triangle.0 as usize]
    }

    /// Connected components by union of the faces of every edge (Galler and Fischer 1964, with path halving).
    fn find_bodies(&mut self, triangles: usize) {
        fn root(parent: &mut [u32], mut t: u32) -> u32 {
            while parent[t as usize] != t {
                parent[t as usize] = parent[parent[t as usize] as usize];
                t = parent[t as usize];
            }
            t
        }
        let mut parent: Vec<u32> = (0..triangles as u32).collect();
        for pair in self.edges().flat_map(|edge| self.faces(edge).windows(2)) {
            let (x, y) = (root(&mut parent, pair[0].triangle.0), root(&mut parent, pair[1].triangle.0));
            parent[x.max(y) as usize] = x.min(y);
        }
        // The root of a body is its first triangle.
        let mut body = vec![0; triangles];
        for t in 0..triangles as u32 {
            let first = root(&mut parent, t);
            if first == t {
                body[t as usize] = self.bodies as u32;
                self.bodies += 1;
            } else {
                body[t as usize] = body[first as usize];
            }
        }
        self.triangle_body = body;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fans_of_every_size_are_classified() {
        for k in 1..=6 {
            let triangles: Vec<[u32; 3]> =
                (0..k).map(|i| if i % 2 == 0 { [0, 1, 2 + i] } else { [1, 0, 2 + i] }).collect();
            let topology = Topology::new(8, &triangles);
            let spine = EdgeId(0);
            assert_eq!(topology.ends(spine), [VertexId(0), VertexId(1)]);
            let expected: Vec<_> = (0..k)
                .map(|t| EdgeFace {
                    triangle: TriangleId(t),
                    direction: if t % 2 == 0 { Direction::Forward } else { Direction::Backward },
                })
                .collect();
            assert_eq!(topology.faces(spine), expected);
            let kind = [EdgeKind::Boundary, EdgeKind::Manifold].get(k as usize - 1).copied();
            assert_eq!(topology.kind(spine), kind.unwrap_or(EdgeKind::NonManifold));
            assert_eq!(topology.edges().len(), 1 + 2 * k as usize);
            assert_eq!(topology.bodies(), 1);
        }
    }

    #[test]
    fn turned_face_is_inconsistent_on_its_three_edges() {
        let mut triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        assert_eq!(Topology::new(4, &triangles).count(EdgeKind::Manifold), 6);
        triangles[2].swap(0, 1);
        let topology = Topology::new(4, &triangles);
        assert_eq!(topology.count(EdgeKind::InconsistentlyWound), 3);
        assert_eq!(topology.count(EdgeKind::Manifold), 3);
    }

    #[test]
    fn bodies_join_at_edges_and_are_numbered_by_first_triangle() {
        // The last but one joins the two before it; the last one touches it at a vertex.
        let topology = Topology::new(12, &[[9, 10, 11], [0, 1, 2], [2, 3, 4], [4, 1, 5], [1, 2, 4], [5, 6, 7]]);
        assert_eq!(topology.bodies(), 3);
        assert_eq!([0, 1, 2, 3, 4, 5].map(|t| topology.body(TriangleId(t))), [0, 1, 1, 1, 1, 2]);
    }

    #[test]
    fn nothing_has_no_edges() {
        let topology = Topology::new(0, &[]);
        assert_eq!((topology.edges().len(), topology.bodies()), (0, 0));
    }
}
