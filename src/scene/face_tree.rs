use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{DVec3, Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::{Bvh2, reinsertion::ReinsertionOptimizer};
use obvhs::ploc::PlocBuilder;
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::face_groups::FaceGroups;

/// A bounding volume hierarchy over the faces of a mesh (obvhs' BVH2) for rays that must not miss a face.
///
/// It only proposes the faces whose boxes a ray touches or nearly touches; whoever asks decides by a test of its own.
pub struct FaceTree {
    /// The tree over groups of faces and the scale of its boxes; none without faces.
    tree: Option<(Bvh2, f64)>,
    groups: FaceGroups,
    positions: Arc<[Vec3]>,
    triangles: Arc<[[u32; 3]]>,
}

/// Boxes are widened by this fraction of the coordinates at hand: many times the rounding of the slab test, so that a ray
/// that runs exactly along the side of a box (axis-aligned scenes) still meets it.
const SLACK: f64 = 1e-12;

impl FaceTree {
    /// Builds the tree; `triangles` index into `positions`.
    pub fn new(positions: Arc<[Vec3]>, triangles: Arc<[[u32; 3]]>) -> Self {
        let groups = FaceGroups::new(&positions, &triangles);
        let bounds = |group: &[u32]| {
            let faces = groups.faces[group[0] as usize..group[1] as usize].iter();
            let corners = faces.flat_map(|&face| triangles[face as usize]).map(|vertex| positions[vertex as usize]);
            let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            let (low, high) = corners.fold(empty, |(low, high), p| (low.min(p), high.max(p)));
            [low.to_array(), high.to_array()]
        };
        let bounds: Vec<_> = groups.starts.par_windows(2).map(bounds).collect();
        let tree = (!bounds.is_empty()).then(|| grow_tree(bounds, 1));
        Self { tree, groups, positions, triangles }
    }

    /// Corners of a face, as loaded.
    pub fn corners(&self, face: u32) -> [Vec3; 3] {
        self.triangles[face as usize].map(|vertex| self.positions[vertex as usize])
    }

    /// Vertex indices of a face.
    pub fn vertices(&self, face: u32) -> [u32; 3] {
        self.triangles[face as usize]
    }

    /// Calls `visit` with every face that the ray from `origin` may meet, in no particular order, until it breaks.
    pub fn visit(&self, origin: DVec3, direction: DVec3, visit: impl FnMut(u32) -> ControlFlow<()>) {
        self.visit_beam([origin; 2], direction, visit);
    }

    /// Calls `visit` with every face that a ray in this direction from anywhere in a box, given by its lowest and highest corner, may
    /// meet, or that may touch the box if there is no direction (zero), in no particular order, until it breaks.
    pub fn visit_beam(&self, origins: [DVec3; 2], direction: DVec3, mut visit: impl FnMut(u32) -> ControlFlow<()>) {
        let Some((tree, scale)) = &self.tree else { return };
        let slab = Slab::new(origins.map(|origin| origin * *scale), direction);
        let mut stack = SmallVec::<[u32; 64]>::new();
        if slab.meets(&tree.nodes[0]) {
            stack.push(0);
        }
        while let Some(index) = stack.pop() {
            let node = &tree.nodes[index as usize];
            if node.is_leaf() {
                for group in self.groups_of(tree, node) {
                    for &face in group {
                        if visit(face).is_break() {
                            return;
                        }
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

    /// Calls `visit` with faces that the ray from `origin` along the unit vector `direction` may meet, near boxes first. `visit`
    /// returns the distance beyond which it wants no more: infinity for all, the nearest hit's for that one.
    pub fn visit_ordered(&self, origin: DVec3, direction: DVec3, mut visit: impl FnMut(u32) -> f64) {
        let Some((tree, scale)) = &self.tree else { return };
        let slab = Slab::new([origin * *scale; 2], direction);
        let enter = |index: u32| slab.enter(&tree.nodes[index as usize]).map(|near| (index, near));
        let mut limit = f64::INFINITY;
        let mut stack = SmallVec::<[(u32, f64); 64]>::from_iter(enter(0));
        while let Some((index, near)) = stack.pop() {
            if near > limit {
                continue;
            }
            let node = &tree.nodes[index as usize];
            if node.is_leaf() {
                for &face in self.groups_of(tree, node).flatten() {
                    limit = visit(face) * scale;
                }
                continue;
            }
            let first = node.first_index;
            match (enter(first), enter(first + 1)) {
                (Some(a), Some(b)) => stack.extend(if a.1 <= b.1 { [b, a] } else { [a, b] }),
                (a, b) => stack.extend(a.or(b)),
            }
        }
    }

    /// Calls `visit` with every face whose box holds `point`, or nearly does, in no particular order.
    pub fn visit_around(&self, point: DVec3, mut visit: impl FnMut(u32)) {
        self.visit_beam([point; 2], DVec3::ZERO, |face| {
            visit(face);
            ControlFlow::Continue(())
        });
    }

    /// The groups of faces in a leaf.
    fn groups_of(&self, tree: &Bvh2, leaf: &Bvh2Node) -> impl Iterator<Item = &[u32]> {
        let range = leaf.first_index as usize..(leaf.first_index + leaf.prim_count) as usize;
        tree.primitive_indices[range].iter().map(|&group| {
            let [start, end] = [0, 1].map(|next| self.groups.starts[group as usize + next] as usize);
            &self.groups.faces[start..end]
        })
    }
}

/// A tree over boxes, lowest and highest corner each, of which there must be one at least, with at most `leaf` in a leaf; and
/// the power of two by which the tree's own boxes are scaled: obvhs weighs areas in f32, which must stay in range.
///
/// These are the steps of obvhs' `build_bvh2` at its medium quality, without its check of the depth in debug builds, which
/// fans of many triangles fail: there the reinsertion of nodes deepens the tree beyond what the first step noted.
pub(crate) fn grow_tree(bounds: Vec<[[f32; 3]; 2]>, leaf: u32) -> (Bvh2, f64) {
    let largest = bounds.as_flattened().as_flattened().iter().fold(f32::MIN_POSITIVE, |m, x| m.max(x.abs()));
    let scale = (-f64::from(largest).log2().ceil()).exp2();
    let scaled = |bounds: [[f32; 3]; 2]| Bounds(bounds.map(|bound| bound.map(|x| (f64::from(x) * scale) as f32)));
    let boxes: Vec<Bounds> = bounds.into_iter().map(scaled).collect();
    let parameters = BvhBuildParams::medium_build();
    let indices = (0..boxes.len() as u32).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        parameters.ploc_search_distance,
        &boxes,
        indices,
        parameters.sort_precision,
        parameters.search_depth_threshold,
    );
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut tree, parameters.reinsertion_batch_ratio, None);
    collapse(&mut tree, leaf, parameters.collapse_traversal_cost);
    // The next step sizes its stacks by this.
    tree.max_depth = tree.max_depth.max(tree.depth(0) + 1);
    let second = parameters.reinsertion_batch_ratio * parameters.post_collapse_reinsertion_batch_ratio_multiplier;
    optimizer.run(&mut tree, second, None);
    // Only the optimizer looks at these.
    tree.parents = Vec::new();
    (tree, scale)
}

/// A box as obvhs wants it.
struct Bounds([[f32; 3]; 2]);

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        let [low, high] = self.0.map(Vec3A::from);
        Aabb::new(low, high)
    }
}

/// Rays of one direction prepared for the slab test, in f64, with boxes that are widened by [`SLACK`] of the largest coordinates.
struct Slab {
    /// The highest origin, less by how much the low sides of boxes are moved, and the lowest and the high ones.
    low: DVec3,
    high: DVec3,
    inverse: DVec3,
    /// How far the rays go: not at all without a direction.
    limit: f64,
}

impl Slab {
    fn new([low, high]: [DVec3; 2], direction: DVec3) -> Self {
        // The coordinates of the tree's boxes are at most 1. Beside the rounding of coordinates this covers what scaling these boxes
        // takes from denormal ones.
        let largest = 1.0 + low.abs().max(high.abs()).max_element();
        let slack = DVec3::splat(SLACK * largest + f64::from(f32::MIN_POSITIVE));
        // Along a side the quotients must be numbers.
        let along = |x: f64| if x.abs() < 1e-300 { 1e-300f64.copysign(x) } else { x };
        let limit = if direction == DVec3::ZERO { 0.0 } else { f64::INFINITY };
        let direction = DVec3::from_array(direction.to_array().map(along));
        Self { low: high + slack, high: low - slack, inverse: direction.recip(), limit }
    }

    #[inline(always)]
    fn meets(&self, node: &Bvh2Node) -> bool {
        self.enter(node).is_some()
    }

    /// Where a ray enters a box that it meets, or earlier.
    #[inline(always)]
    fn enter(&self, node: &Bvh2Node) -> Option<f64> {
        let a = (node.min.as_dvec3() - self.low) * self.inverse;
        let b = (node.max.as_dvec3() - self.high) * self.inverse;
        let (near, far) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(self.limit));
        (near <= far * (1.0 + SLACK)).then_some(near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of steps along the diagonal.
    #[test]
    fn around_a_point_are_the_faces_that_touch_it_and_few_others() {
        let step = |i: u32| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|corner| corner + 3.0 * i as f32);
        let positions: Vec<Vec3> = (0..500).flat_map(step).collect();
        let tree = FaceTree::new(positions.into(), (0..500).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect());
        for i in 0..500u32 {
            let point = DVec3::splat(3.0 * f64::from(i));
            let mut around = Vec::new();
            tree.visit_around(point, |face| around.push(face));
            assert!(around.contains(&i) && around.len() <= 2 * FaceGroups::MOST, "{i}: {around:?}");
            let mut along = Vec::new();
            tree.visit(point, DVec3::ONE, |face| {
                along.push(face);
                ControlFlow::Continue(())
            });
            assert!((i..500).all(|face| along.contains(&face)));
        }
    }
}
