use glam::DVec3;

/// A contour edge projected onto the sphere around a receiver: the great-circle arc from vertex `a` to vertex `b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arc {
    /// Start, an index into [`ReceiverContours::directions`].
    pub a: u32,
    /// End, likewise.
    pub b: u32,
    /// Change of the depth complexity W on crossing the arc from its left (where `(a x b) . w > 0`) to its right.
    pub jump: i32,
}

/// The contours of one receiver.
#[derive(Clone, Debug, Default)]
pub struct ReceiverContours {
    /// Vertex minus receiver, not normalised.
    pub directions: Vec<DVec3>,
    /// `n . direction`; 1 for receivers without a normal (full sphere).
    pub heights: Vec<f64>,
    /// Arcs with a non-zero jump; every vertex is balanced: the jumps of incoming and outgoing arcs agree.
    pub arcs: Vec<Arc>,
}
