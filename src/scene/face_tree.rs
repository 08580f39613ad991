use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::bvh2::node::Bvh2Node;

/// A bounding volume hierarchy over the faces of a mesh (obvhs' BVH2) for rays that must not miss a face.
///
/// It only proposes the faces whose boxes a ray touches or nearly touches; whoever asks decides by a test of its own.
pub struct FaceTree {
    tree: Option<Bvh2>,
    positions: Arc<[Vec3]>,
    triangles: Arc<[[u32; 3]]>,
}

/// Boxes are widened by this fraction of the coordinates at hand: many times the rounding of the slab test, so that a ray
/// that runs exactly along the side of a box (axis-aligned scenes) still meets it.
const SLACK: f64 = 1e-12;

impl FaceTree {
    /// Builds the tree; `triangles` index into `positions`.
    pub fn new(positions: Arc<[Vec3]>, triangles: Arc<[[u32; 3]]>) -> Self {
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|face| {
                let mut bounds = Aabb::empty();
                for &vertex in face {
                    bounds.extend(positions[vertex as usize].into());
                }
                bounds
            })
            .collect();
        let parameters = BvhBuildParams { pre_split: false, ..BvhBuildParams::medium_build() };
        let tree = (!boxes.is_empty()).then(|| build_bvh2(&boxes, parameters, &mut Default::default()));
        Self { tree, positions, triangles }
    }

    /// Corners of a face, as loaded.
    pub fn corners(&self, face: u32) -> [Vec3; 3] {
        self.triangles[face as usize].map(|vertex| self.positions[vertex as usize])
    }

    /// Vertex indices of a face.
    pub fn vertices(&self, face: u32) -> [u32; 3] {
        self.triangles[face as usize]
    }

    /// Number of faces.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there is no face.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Calls `visit` with every face that the ray from `origin` may meet, in no particular order, until it breaks.
    pub fn visit(&self, origin: DVec3, direction: DVec3, mut visit: impl FnMut(u32) -> ControlFlow<()>) {
        let Some(tree) = &self.tree else { return };
        let slab = Slab::new(origin, direction);
        if !slab.meets(&tree.nodes[0]) {
            return;
        }
        let mut stack = vec![0u32];
        while let Some(index) = stack.pop() {
            let node = &tree.nodes[index as usize];
            if node.is_leaf() {
                let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
                for &face in &tree.primitive_indices[range] {
                    if visit(face).is_break() {
                        return;
                    }
                }
                continue;
            }
            for child in [node.first_index, node.first_index + 1] {
                if slab.meets(&tree.nodes[child as usize]) {
                    stack.push(child);
                }
            }
        }
    }
}

/// A ray prepared for the slab test, in f64.
struct Slab {
    origin: DVec3,
    inverse: DVec3,
}

impl Slab {
    fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, inverse: direction.recip() }
    }

    fn meets(&self, node: &Bvh2Node) -> bool {
        let (low, high) = (node.aabb.min.as_dvec3(), node.aabb.max.as_dvec3());
        let slack = SLACK * (low.abs().max(high.abs()).max_element() + self.origin.abs().max_element());
        let (mut near, mut far) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let (low, high) = (low[axis] - slack - self.origin[axis], high[axis] + slack - self.origin[axis]);
            let inverse = self.inverse[axis];
            if inverse.is_infinite() {
                if low > 0.0 || high < 0.0 {
                    return false;
                }
                continue;
            }
            let (a, b) = (low * inverse, high * inverse);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        near <= far * (1.0 + SLACK)
    }
}
