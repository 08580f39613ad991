use glam::DVec3;

/// A contour edge projected onto the sphere around a receiver: the great-circle arc from vertex `a` to vertex `b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Start, an index into [`ReceiverContours::directions`].
    pub a: u32,
    /// End, likewise.
    pub b: u32,
    /// Change of the depth complexity W on crossing the arc from its left (where `plane . w > 0`) to its right.
    pub jump: i32,
    /// Normal a x b of the arc's plane, not normalised.
    pub plane: DVec3,
}

/// Normal a x b of the plane through the receiver and the edge from `xa` to `xb`, with `a = xa - receiver`.
///
/// The difference of the two vertices is taken before anything else: it is exact for the f32 vertices of one edge, where
/// `b - a` after subtracting the receiver is not. Callers name the vertices in the order of their global ids, so that all
/// faces and receivers' stages that share an edge compute the same bits.
pub(super) fn arc_plane(a: DVec3, xa: DVec3, xb: DVec3) -> DVec3 {
    a.cross(xb - xa)
}

/// The contours of one receiver.
#[derive(Clone, Debug, Default)]
pub struct ReceiverContours {
    /// Vertex minus receiver, not normalised.
    pub directions: Vec<DVec3>,
    /// `n . direction`; 1 for receivers without a normal (full sphere).
    pub heights: Vec<f64>,
    /// Arcs with a non-zero jump. Above the horizon every vertex is balanced: jumps of incoming and outgoing arcs agree.
    pub arcs: Vec<Arc>,
    local: Vec<u32>,
}

impl ReceiverContours {
    /// Projects the contours found among the candidates of a tile; arcs that lie below the horizon are left out.
    pub fn project(
        &mut self,
        candidates: &dual_bvh::Candidates,
        contours: &dual_bvh::Contours,
        position: DVec3,
        normal: Option<DVec3>,
    ) {
        const UNSEEN: u32 = u32::MAX;
        self.directions.clear();
        self.heights.clear();
        self.arcs.clear();
        self.local.clear();
        self.local.resize(candidates.vertices().len(), UNSEEN);
        for contour in contours.edges() {
            let edge = &candidates.edges()[contour.edge as usize];
            let [a, b] = [edge.a, edge.b].map(|vertex| {
                let local = &mut self.local[vertex as usize];
                if *local == UNSEEN {
                    *local = self.directions.len() as u32;
                    let direction = candidates.position(vertex) - position;
                    self.directions.push(direction);
                    self.heights.push(normal.map_or(1.0, |n| n.dot(direction)));
                }
                *local
            });
            if self.heights[a as usize] < 0.0 && self.heights[b as usize] < 0.0 {
                continue;
            }
            let plane =
                arc_plane(self.directions[a as usize], candidates.position(edge.a), candidates.position(edge.b));
            self.arcs.push(Arc { a, b, jump: contour.jump, plane });
        }
    }
}
