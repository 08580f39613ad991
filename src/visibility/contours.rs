use std::ops::Range;

use dual_bvh::{Candidates, Contours};
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

/// The sides of a face, by its corners: each from the vertex of the smaller global id to that of the larger, as edges run among the
/// candidates, and 1 if the face runs so, too, or else -1.
pub(super) fn sides(vertices: [u32; 3]) -> [(usize, usize, i32); 3] {
    [(0, 1), (1, 2), (2, 0)].map(|(i, j)| if vertices[i] < vertices[j] { (i, j, 1) } else { (j, i, -1) })
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
    /// Heights of the candidates' vertices at hand, and their places among the directions.
    all_heights: Vec<f64>,
    places: Vec<u32>,
}

/// A vertex that has no place among the directions yet.
const UNSEEN: u32 = u32::MAX;

impl ReceiverContours {
    /// Forgets all contours.
    pub(super) fn clear(&mut self) {
        self.directions.clear();
        self.heights.clear();
        self.arcs.clear();
    }

    /// Adds the projections of the contours found among the candidates of a tile, all of which have their ends among these vertices;
    /// arcs that lie below the horizon are left out, and vertices that no other arc has.
    pub(super) fn project(
        &mut self,
        candidates: &Candidates,
        vertices: Range<usize>,
        contours: &Contours,
        position: DVec3,
        normal: Option<DVec3>,
    ) {
        self.places.clear();
        self.places.resize(vertices.len(), UNSEEN);
        self.all_heights.clear();
        self.all_heights.resize(vertices.len(), 1.0);
        if let Some(normal) = normal {
            let coordinates = candidates.coordinates().map(|lanes| &lanes[vertices.clone()]);
            measure(coordinates, position, normal, &mut self.all_heights);
        }
        let first = vertices.start as u32;
        for contour in contours.edges() {
            let edge = &candidates.edges()[contour.edge as usize];
            let heights = [edge.a, edge.b].map(|vertex| self.all_heights[(vertex - first) as usize]);
            if (heights[0] < 0.0) & (heights[1] < 0.0) {
                continue;
            }
            let [xa, xb] = [edge.a, edge.b].map(|vertex| candidates.position(vertex));
            let a = self.enter(edge.a - first, xa - position, heights[0]);
            let b = self.enter(edge.b - first, xb - position, heights[1]);
            self.arcs.push(Arc { a, b, jump: contour.jump, plane: arc_plane(xa - position, xa, xb) });
        }
    }

    /// The place of a vertex among the directions, which it gets at its first use.
    #[inline(always)]
    fn enter(&mut self, vertex: u32, direction: DVec3, height: f64) -> u32 {
        let place = &mut self.places[vertex as usize];
        if *place == UNSEEN {
            *place = self.directions.len() as u32;
            self.directions.push(direction);
            self.heights.push(height);
        }
        *place
    }
}

/// Heights of positions, given by component, above the horizon of a receiver.
fn measure(coordinates: [&[f32]; 3], position: DVec3, normal: DVec3, heights: &mut [f64]) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the feature.
        return unsafe { measure_avx2(coordinates, position, normal, heights) };
    }
    measure_inline(coordinates, position, normal, heights);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn measure_avx2(coordinates: [&[f32]; 3], position: DVec3, normal: DVec3, heights: &mut [f64]) {
    measure_inline(coordinates, position, normal, heights);
}

#[inline(always)]
fn measure_inline(coordinates: [&[f32]; 3], position: DVec3, normal: DVec3, heights: &mut [f64]) {
    let [x, y, z] = coordinates;
    for (((height, &x), &y), &z) in heights.iter_mut().zip(x).zip(y).zip(z) {
        *height = normal.dot(DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - position);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn portable_and_dispatched_heights_agree_to_the_bit() {
        let number = |i: usize| ((i * 7919 % 1009) as f32 - 504.0) / 37.0;
        let coordinates = [0, 1, 2].map(|axis| (0..103).map(|i| number(3 * i + axis)).collect::<Vec<f32>>());
        let coordinates = coordinates.each_ref().map(Vec::as_slice);
        let (position, normal) = (DVec3::new(0.1, -2.3, 4.5), DVec3::new(3.0, -1.0, 2.0).normalize());
        let (mut dispatched, mut portable) = (vec![0.0; 103], vec![0.0; 103]);
        measure(coordinates, position, normal, &mut dispatched);
        measure_inline(coordinates, position, normal, &mut portable);
        assert_eq!(dispatched, portable);
        let [x, y, z] = coordinates.map(|axis| f64::from(axis[102]));
        assert_eq!(dispatched[102], normal.dot(DVec3::new(x, y, z) - position));
    }
}
