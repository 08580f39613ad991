use glam::DVec3;

/// Neighbouring receivers that share one search: a ball and a box that hold them, and bounds on their normals.
///
/// A lone receiver is a tile of radius zero. Positions and normals must be finite; normals need not be of unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile<'a> {
    /// Centre of the ball.
    pub center: DVec3,
    /// Radius of the ball.
    pub radius: f64,
    /// Half the size of a box around the ball's centre, along the axes: receivers on a wall have next to none across it. Edges need
    /// only be found for receivers in both.
    pub half: DVec3,
    /// Componentwise bounds of the normals. Edges that lie strictly below the horizon of every receiver in the ball with a
    /// normal within the bounds need not be found. Without bounds all edges are.
    pub horizon: Option<(DVec3, DVec3)>,
    excluded: &'a [u32],
}

impl Tile<'_> {
    /// The tile of one receiver at `p`, which sees the hemisphere around `normal`, or the whole sphere without one.
    pub fn lone(p: DVec3, normal: Option<DVec3>) -> Self {
        Self { center: p, radius: 0.0, half: DVec3::ZERO, horizon: normal.map(|n| (n, n)), excluded: &[] }
    }

    /// The tile of several receivers, each a position and a normal (or none: whole sphere, and then no horizon bounds the
    /// tile). The tile of no receivers is that of one at the origin.
    pub fn new(receivers: impl Iterator<Item = (DVec3, Option<DVec3>)> + Clone) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut horizon = Some((DVec3::INFINITY, DVec3::NEG_INFINITY));
        for (p, normal) in receivers.clone() {
            (low, high) = (low.min(p), high.max(p));
            horizon = horizon.zip(normal).map(|((lo, hi), n)| (lo.min(n), hi.max(n)));
        }
        if low.x > high.x {
            return Self::lone(DVec3::ZERO, None);
        }
        let center = 0.5 * low + 0.5 * high;
        let radius = receivers.map(|(p, _)| p.distance(center)).fold(0.0, f64::max);
        // Distances are rounded a few times.
        const SLACK: f64 = 1.0 + 8.0 * f64::EPSILON;
        let half = (high - center).max(center - low) * SLACK;
        Self { center, radius: radius * SLACK, half, horizon, excluded: &[] }
    }

    /// The same tile with the faces that one receiver or another leaves out, for instance those it lies on: their edges will
    /// be among the candidates wherever they lie. Faces may be repeated, in any order.
    pub fn with_faces(self, excluded: &[u32]) -> Tile<'_> {
        Tile { excluded, ..self }
    }

    /// See [`Tile::with_faces`].
    pub fn excluded(&self) -> &[u32] {
        self.excluded
    }
}
