//! Rays against triangles: is it occluded, what is hit first, how many surfaces are crossed.

use glam::DVec3;
use obvhs::bvh2::Bvh2;
use smallvec::SmallVec;

use super::crossing::Triangle;
use super::hit::{Hit, Nearest};
use crate::scene::{Geometry, grow_tree};

/// A scene ready for ray casting.
///
/// The tree's shape comes from obvhs (BVH2 without spatial splits, so that a triangle is met once); its boxes are the
/// triangles' own f32 coordinates. Traversal and triangle test are f64: there is no offset of the
/// origin and no tolerance, and a ray through an edge or a vertex counts the surface once. Directions are unit vectors.
pub struct RayScene {
    /// Inner nodes, the root first; empty without triangles.
    nodes: Vec<Node>,
    /// In the order of the leaves.
    triangles: Vec<Triangle>,
}

fn corners(geometry: &Geometry, vertices: &[u32; 3]) -> [[f32; 3]; 3] {
    vertices.map(|vertex| geometry.positions[vertex as usize].to_array())
}

/// Two children side by side.
#[derive(Clone, Copy)]
struct Node {
    /// `bounds[0]` lowest, `bounds[1]` highest coordinates, by axis and child.
    bounds: [[[f32; 2]; 3]; 2],
    /// Leaf: first triangle. Otherwise: index of the child's node.
    first: [u32; 2],
    /// Leaf: number of triangles. Otherwise 0.
    count: [u32; 2],
}

/// Most faces in a leaf: their test costs more than a box's.
const LEAF_FACES: u32 = 4;

/// A box that no ray meets.
const NOWHERE: [[f32; 3]; 2] = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];

/// Nodes that a traversal keeps for later, on the heap only in unusually deep trees.
type Stack = SmallVec<[(u32, f64); 64]>;

impl RayScene {
    /// Builds the tree of all triangles of `geometry`.
    pub fn new(geometry: &Geometry) -> Self {
        let faces: Vec<Triangle> = (0u32..)
            .zip(geometry.triangles.iter())
            .map(|(face, vertices)| Triangle { corners: corners(geometry, vertices), face })
            .collect();
        if faces.is_empty() {
            return Self { nodes: Vec::new(), triangles: Vec::new() };
        }
        let bounds: Vec<_> = faces.iter().map(|face| face.bounds()).collect();
        Self::adopt(&grow_tree(bounds, LEAF_FACES).0, &faces)
    }

    /// Lays the tree out in depth-first order, children in pairs.
    fn adopt(tree: &Bvh2, faces: &[Triangle]) -> Self {
        let mut nodes = Vec::with_capacity(tree.nodes.len() / 2 + 1);
        let mut triangles = Vec::with_capacity(faces.len());
        // A root that is a leaf becomes the first child of a node without a second.
        let blank = Node { bounds: [[[0.0; 2]; 3]; 2], first: [0; 2], count: [0; 2] };
        let root = tree.nodes[0];
        let pairs = if root.is_leaf() { [Some(0), None] } else { [Some(root.first_index), Some(root.first_index + 1)] };
        let mut todo = vec![(pairs, None)];
        while let Some((pair, parent)) = todo.pop() {
            let index = nodes.len() as u32;
            if let Some((node, side)) = parent {
                let node: &mut Node = &mut nodes[node as usize];
                node.first[side] = index;
            }
            let mut node = blank;
            for (side, child) in pair.into_iter().enumerate() {
                let Some(child) = child else {
                    node.set_bounds(side, NOWHERE);
                    continue;
                };
                let child = tree.nodes[child as usize];
                if child.is_leaf() {
                    node.first[side] = triangles.len() as u32;
                    node.count[side] = child.prim_count;
                    let range = child.first_index as usize..(child.first_index + child.prim_count) as usize;
                    triangles.extend(tree.primitive_indices[range].iter().map(|&face| faces[face as usize]));
                } else {
                    let first = child.first_index;
                    todo.push(([Some(first), Some(first + 1)], Some((index, side))));
                }
            }
            nodes.push(node);
        }
        // Children follow their parents: bounds from the leaves up.
        for index in (0..nodes.len()).rev() {
            for side in 0..2 {
                let Node { first, count, .. } = nodes[index];
                let (first, count) = (first[side] as usize, count[side] as usize);
                if count > 0 {
                    let bounds = triangles[first..first + count].iter().map(Triangle::bounds).fold(NOWHERE, join);
                    nodes[index].set_bounds(side, bounds);
                } else if first > 0 {
                    let child = nodes[first];
                    nodes[index].set_bounds(side, join(child.bounds_of(0), child.bounds_of(1)));
                }
            }
        }
        Self { nodes, triangles }
    }

    /// Whether the ray from `origin` along the unit vector `direction` meets any triangle that is not `excluded`.
    pub fn occluded(&self, origin: DVec3, direction: DVec3, excluded: &[u32]) -> bool {
        let mut occluded = false;
        self.traverse(origin, direction, |triangle, _| {
            occluded = triangle.cross(origin, direction).is_some() && !excluded.contains(&triangle.face);
            if occluded { f64::NEG_INFINITY } else { f64::INFINITY }
        });
        occluded
    }

    /// The nearest triangle along the ray from `origin` along the unit vector `direction` that is not `excluded`; of
    /// triangles at the same distance the one with the lowest index.
    pub fn first_hit(&self, origin: DVec3, direction: DVec3, excluded: &[u32]) -> Option<Hit> {
        let mut nearest = Nearest::default();
        self.traverse(origin, direction, |triangle, _| {
            if !excluded.contains(&triangle.face) {
                nearest.offer(triangle, origin, direction);
            }
            nearest.limit()
        });
        nearest.hit()
    }

    /// W: how many triangles that are not `excluded` the ray from `origin` along the unit vector `direction` crosses, each once.
    pub fn count(&self, origin: DVec3, direction: DVec3, excluded: &[u32]) -> u32 {
        let mut count = 0;
        self.traverse(origin, direction, |triangle, limit| {
            if triangle.cross(origin, direction).is_some() && !excluded.contains(&triangle.face) {
                count += 1;
            }
            limit
        });
        count
    }

    /// Hands every triangle whose box the ray meets to `meet`, near boxes first, with the distance beyond which boxes are left
    /// out; `meet` returns the new one, negative to stop.
    #[inline]
    fn traverse(&self, origin: DVec3, direction: DVec3, mut meet: impl FnMut(&Triangle, f64) -> f64) {
        if self.nodes.is_empty() {
            return;
        }
        let mut stack = Stack::new();
        let ray = Slabs::new(origin, direction);
        let mut limit = f64::INFINITY;
        let mut index = 0;
        loop {
            let node = &self.nodes[index as usize];
            let (near, far) = ray.meet(&node.bounds);
            let mut next = None;
            for side in if near[0] <= near[1] { [0, 1] } else { [1, 0] } {
                // Three roundings at either end.
                let missed = far[side] < 0.0 || near[side] > far[side] * (1.0 + 4.0 * f64::EPSILON);
                if missed || near[side] > limit {
                    continue;
                }
                let (first, count) = (node.first[side], node.count[side]);
                if count > 0 {
                    for triangle in &self.triangles[first as usize..(first + count) as usize] {
                        limit = meet(triangle, limit);
                        if limit < 0.0 {
                            return;
                        }
                    }
                } else if next.is_none() {
                    next = Some(first);
                } else {
                    stack.push((first, near[side]));
                }
            }
            index = loop {
                if let Some(next) = next {
                    break next;
                }
                let Some((node, near)) = stack.pop() else { return };
                if near <= limit {
                    break node;
                }
            };
        }
    }
}

impl Node {
    fn set_bounds(&mut self, side: usize, bounds: [[f32; 3]; 2]) {
        for (pair, bound) in self.bounds.iter_mut().zip(bounds) {
            pair.iter_mut().zip(bound).for_each(|(pair, x)| pair[side] = x);
        }
    }

    fn bounds_of(&self, side: usize) -> [[f32; 3]; 2] {
        self.bounds.map(|pair| pair.map(|x| x[side]))
    }
}

fn join([a, b]: [[f32; 3]; 2], [c, d]: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    [std::array::from_fn(|k| a[k].min(c[k])), std::array::from_fn(|k| b[k].max(d[k]))]
}

/// A ray as the slab test wants it (Kay and Kajiya 1986).
struct Slabs {
    origin: [f64; 3],
    inverse: [f64; 3],
    /// Which bound comes first along the ray.
    near: [usize; 3],
}

impl Slabs {
    fn new(origin: DVec3, direction: DVec3) -> Self {
        let inverse = direction.to_array().map(f64::recip);
        Self { origin: origin.to_array(), inverse, near: inverse.map(|x| usize::from(x.is_sign_negative())) }
    }

    /// Distances at which the ray's line enters and leaves two boxes. NaN comes of a direction's coordinate of zero and an
    /// origin on the bound, which then does not limit the ray: `max` and `min` pass NaN over.
    #[inline(always)]
    fn meet(&self, bounds: &[[[f32; 2]; 3]; 2]) -> ([f64; 2], [f64; 2]) {
        let (mut near, mut far) = ([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]);
        for axis in 0..3 {
            let (o, inverse) = (self.origin[axis], self.inverse[axis]);
            let (enter, leave) = (bounds[self.near[axis]][axis], bounds[1 - self.near[axis]][axis]);
            for side in 0..2 {
                near[side] = near[side].max((f64::from(enter[side]) - o) * inverse);
                far[side] = far[side].min((f64::from(leave[side]) - o) * inverse);
            }
        }
        (near, far)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::reference::first_hit;
    use crate::reference::fixtures::{cuboid, geometry, polygon, random, soup, sphere, union};

    /// All triangles one after another.
    fn brute_force(geometry: &Geometry, origin: DVec3, direction: DVec3, excluded: &[u32]) -> (u32, Option<Hit>) {
        let mut hits: Vec<Hit> = (0u32..)
            .zip(geometry.triangles.iter())
            .filter(|(face, _)| !excluded.contains(face))
            .filter_map(|(face, vertices)| {
                let triangle = Triangle { corners: corners(geometry, vertices), face };
                let crossing = triangle.cross(origin, direction)?;
                Some(Hit { face, t: crossing.t, barycentric: crossing.barycentric })
            })
            .collect();
        hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.face.cmp(&b.face)));
        (hits.len() as u32, hits.first().copied())
    }

    fn assert_twins(geometry: &Geometry, rays: impl IntoIterator<Item = (DVec3, DVec3)>) {
        let (scene, faces) = (RayScene::new(geometry), geometry.face_tree());
        for (origin, direction) in rays {
            let none: &[u32] = &[];
            let (_, first) = brute_force(geometry, origin, direction, none);
            assert_eq!(first_hit(&faces, origin, direction), first, "{origin} {direction}");
            let nearest = first.map(|hit| vec![hit.face]).unwrap_or_default();
            for excluded in [none, &nearest] {
                let (count, hit) = brute_force(geometry, origin, direction, excluded);
                assert_eq!(scene.count(origin, direction, excluded), count, "{origin} {direction}");
                assert_eq!(scene.first_hit(origin, direction, excluded), hit, "{origin} {direction}");
                assert_eq!(scene.occluded(origin, direction, excluded), count > 0, "{origin} {direction}");
            }
        }
    }

    #[test]
    fn equals_brute_force_on_soup() {
        for (count, size) in [(1, 1.0), (2, 1.0), (9, 0.5), (400, 0.2), (400, 2.0)] {
            let mut random = random(7 + count);
            let rays: Vec<_> = (0..400).map(|_| (random(), random().normalize())).collect();
            assert_twins(&soup(count, size, count), rays);
        }
    }

    #[test]
    fn equals_brute_force_on_axis_aligned_geometry() {
        // A lattice of boxes that share face planes, edges and corners; rays from and towards lattice points, along the axes,
        // in the faces' planes, and with zero direction components.
        let boxes: Vec<_> = (0..27)
            .map(|k| {
                let low = Vec3::new((k % 3) as f32, (k / 3 % 3) as f32, (k / 9) as f32);
                cuboid(low, low + if k % 2 == 0 { 1.0 } else { 0.5 })
            })
            .collect();
        let scene = union(&boxes);
        let mut rays = Vec::new();
        for k in 0..343 {
            let origin = 0.5 * DVec3::new(f64::from(k % 7), f64::from(k / 7 % 7), f64::from(k / 49)) - 0.25;
            for shift in [0.0, 0.25] {
                rays.extend(DVec3::AXES.into_iter().flat_map(|axis| [(origin + shift, axis), (origin + shift, -axis)]));
                rays.push((origin + shift, DVec3::new(1.0, -1.0, 0.0).normalize()));
            }
        }
        assert_twins(&scene, rays);
    }

    #[test]
    fn nested_boxes_are_counted_exactly() {
        let shells: Vec<_> = (1..=100).map(|k| cuboid(Vec3::splat(-k as f32), Vec3::splat(k as f32))).collect();
        let scene = RayScene::new(&union(&shells));
        for k in 0..100 {
            // On an axis, on the boxes' diagonals, and off them: through faces, through the diagonals' edges, through corners.
            for direction in [(1, 0, 0), (0, -1, 0), (1, 1, 0), (1, 1, 1), (-1, 1, -1), (3, 2, 1)] {
                let direction = DVec3::new(f64::from(direction.0), f64::from(direction.1), f64::from(direction.2));
                let origin = (f64::from(k) + 0.5) * direction / direction.abs().max_element();
                assert_eq!(scene.count(origin, direction.normalize(), &[]), 100 - k as u32, "{direction} {k}");
            }
        }
    }

    /// Rays through all vertices and all edges of a closed convex mesh: no crack, nothing counted twice.
    fn assert_watertight(mesh: &Geometry, inside: DVec3, outside: &[DVec3]) {
        let scene = RayScene::new(mesh);
        let vertex = |v: u32| mesh.positions[v as usize].as_dvec3();
        let on_edges = mesh.triangles.iter().flat_map(|&[a, b, c]| {
            [(a, b), (b, c), (c, a)]
                .into_iter()
                .flat_map(move |(a, b)| [0.25, 0.5, 0.9].map(|t| vertex(a).lerp(vertex(b), t)))
        });
        let targets: Vec<_> = (0..mesh.positions.len() as u32).map(vertex).chain(on_edges).collect();
        for target in targets {
            assert_eq!(scene.count(inside, (target - inside).normalize(), &[]), 1, "{target}");
            for &origin in outside {
                let direction = (target - origin).normalize();
                let count = scene.count(origin, direction, &[]);
                assert!(count == 0 || count == 2, "{origin} {target}: {count}");
                assert_eq!(scene.occluded(origin, direction, &[]), count > 0);
            }
        }
    }

    #[test]
    fn closed_meshes_have_no_cracks() {
        let outside = [DVec3::new(3.0, 0.0, 0.0), DVec3::new(1.5, -2.0, 0.7), DVec3::new(0.0, 0.0, 50.0)];
        assert_watertight(&cuboid(Vec3::splat(-0.5), Vec3::splat(0.5)), DVec3::ZERO, &outside);
        // Rays along the axes meet its vertices, and its edges lie in the planes of the axes.
        let poles = DVec3::AXES.into_iter().flat_map(|axis| [axis.as_vec3(), -axis.as_vec3()]).collect();
        let octants = (0..8u32).map(|k| {
            let [x, y, z] = [k & 1, 2 + (k >> 1 & 1), 4 + (k >> 2)];
            if k.count_ones() % 2 == 0 { [x, y, z] } else { [x, z, y] }
        });
        assert_watertight(&geometry(poles, octants.collect()), DVec3::ZERO, &outside);
        assert_watertight(&sphere(Vec3::ZERO, 1.0, 16), DVec3::ZERO, &outside);
        assert_watertight(&sphere(Vec3::new(0.3, 0.1, -0.2), 0.7, 23), DVec3::new(0.25, 0.15, -0.1), &outside);
    }

    #[test]
    fn scale_is_irrelevant() {
        let mesh = soup(200, 0.3, 1);
        let mut random = random(2);
        let rays: Vec<_> = (0..200).map(|_| (random(), random().normalize())).collect();
        let scene = RayScene::new(&mesh);
        for power in [-100, 100] {
            let scale = 2f32.powi(power);
            let scaled = geometry(mesh.positions.iter().map(|p| *p * scale).collect(), mesh.triangles.to_vec());
            let scaled = RayScene::new(&scaled);
            for &(origin, direction) in &rays {
                let far = origin * f64::from(scale);
                assert_eq!(scaled.count(far, direction, &[]), scene.count(origin, direction, &[]));
                let hits = [scaled.first_hit(far, direction, &[]), scene.first_hit(origin, direction, &[])];
                assert_eq!(hits[0].map(|hit| hit.t), hits[1].map(|hit| hit.t * f64::from(scale)));
            }
        }
    }

    #[test]
    fn nothing_occludes_an_empty_scene() {
        let scene = RayScene::new(&geometry(Vec::new(), Vec::new()));
        assert!(!scene.occluded(DVec3::ZERO, DVec3::Z, &[]));
        assert_eq!(scene.count(DVec3::ZERO, DVec3::Z, &[]), 0);
        assert_eq!(scene.first_hit(DVec3::ZERO, DVec3::Z, &[]), None);
    }

    #[test]
    fn fans_work() {
        // Fans of many triangles grow trees almost as deep as they are many.
        let rim = (0..720).map(|k| {
            let (s, c) = (std::f64::consts::TAU * f64::from(k) / 720.0).sin_cos();
            DVec3::new(c, s, 0.5).as_vec3()
        });
        let fan = polygon(rim);
        let mut random = random(3);
        assert_twins(&fan, (0..400).map(|_| (random(), random().normalize())));
    }
}
