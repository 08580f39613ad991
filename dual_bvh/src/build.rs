//! From triangles to the tree.

use std::cmp::Ordering;
use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::dual::{Dual, face_units};
use crate::edge::Edges;
use crate::groups::{Group, Grouping};
use crate::node::{Bounds, FAN, Leaf, Node, Tree, WIDTH};
use crate::{DualBvh, Error};

/// How a tree is built. Results do not depend on it, only the time of a search does.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BuildOptions {
    /// Length that a difference of unit normals counts for beside differences of positions, in units of the diagonal of the
    /// group's bounding box. Larger values group edges of similar planes, smaller ones edges that are near one another. Raise it
    /// for smooth surfaces, lower it if receivers see little of the mesh above their horizons.
    pub normal_weight: f32,
    /// Fewest faces of a group, see [`DualBvh::groups`]: bodies of fewer are put together with neighbours, up to eight, or more with 8/3
    /// as many faces. With the largest number there is one group.
    pub group_faces: usize,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { normal_weight: 0.25, group_faces: 96 }
    }
}

/// Most vertices and faces in one tree: their numbers carry a flag in the top bit, and three sides a face are counted.
const LIMIT: usize = 1 << 30;

/// Parts below this number of edges are not worth a task of their own.
const GRAIN: usize = 4096;

impl DualBvh {
    /// Builds the tree over the edges of `triangles`, which index `positions`.
    ///
    /// Edges may have any number of faces, wound in any way; faces may have no area. Equal positions are not merged: an edge is a
    /// pair of indices. Runs in parallel on the current rayon pool, with the same result for any number of threads.
    ///
    /// # Errors
    ///
    /// A corner out of range, a corner that is not finite, or a vertex at two corners of a face: the message names the first such
    /// face. Also more than 2^30 vertices or faces, or an option out of its domain.
    pub fn build(positions: Arc<[Vec3]>, triangles: Arc<[[u32; 3]]>, options: &BuildOptions) -> Result<DualBvh, Error> {
        validate(&positions, &triangles, options)?;
        let Grouping { of_vertices, boxes } = Grouping::new(&positions, &triangles, options.group_faces);
        let count = boxes.first().map_or(0, Vec::len);
        let mut edges = Edges::collect(positions.len(), &triangles);
        let sizes = {
            let units = face_units(&positions, &triangles);
            let dual = Dual::new(&positions, &triangles, &edges, &units);
            let (mut order, sizes) = partition(&edges, &of_vertices, count);
            drop(of_vertices);
            let mut parts = Vec::with_capacity(2 * count);
            let mut rest = &mut *order;
            for size in sizes.iter().flatten() {
                let (part, others) = std::mem::take(&mut rest).split_at_mut(*size);
                parts.push(part);
                rest = others;
            }
            parts.into_par_iter().enumerate().for_each(|(part, edges)| {
                arrange(edges, &dual, if part % 2 == 0 { options.normal_weight } else { 0.0 });
            });
            drop(dual);
            // Cheaper made again than kept while the edges are there twice.
            drop(units);
            edges.reorder(&order, &triangles);
            sizes
        };
        let units = face_units(&positions, &triangles);
        let dual = Dual::new(&positions, &triangles, &edges, &units);
        let firsts = sizes.iter().scan(0, |next, [balanced, unbalanced]| {
            let first = *next;
            *next += (balanced + unbalanced) as u32;
            Some(first)
        });
        let firsts: Vec<(u32, [usize; 2])> = firsts.zip(sizes.iter().copied()).collect();
        let grow = |&(first, [balanced, unbalanced]): &(u32, [usize; 2])| Group {
            first,
            balanced: tree(&dual, first, balanced, true),
            unbalanced: tree(&dual, first + balanced as u32, unbalanced, false),
        };
        let groups = firsts.par_iter().map(grow).collect();
        drop(dual);
        Ok(DualBvh { positions, triangles, edges, groups, boxes })
    }
}

/// The edges by group, and within one those with an even number of faces first; and how many there are of both.
fn partition(edges: &Edges, of_vertices: &[u32], groups: usize) -> (Vec<u32>, Vec<[usize; 2]>) {
    let part = |edge: u32| {
        let group = of_vertices[edges.records[edge as usize].vertices()[0] as usize] as usize;
        (group, edges.incidences(edge).len() % 2)
    };
    let numbers = 0..edges.records.len() as u32;
    let mut sizes = vec![[0; 2]; groups];
    for (group, parity) in numbers.clone().map(part) {
        sizes[group][parity] += 1;
    }
    let mut next: Vec<[usize; 2]> = sizes
        .iter()
        .scan(0, |next, [balanced, unbalanced]| {
            let first = *next;
            *next += balanced + unbalanced;
            Some([first, first + balanced])
        })
        .collect();
    let mut order = vec![0; edges.records.len()];
    for edge in numbers {
        let (group, parity) = part(edge);
        let place = &mut next[group][parity];
        order[*place] = edge;
        *place += 1;
    }
    (order, sizes)
}

fn validate(positions: &[Vec3], triangles: &[[u32; 3]], options: &BuildOptions) -> Result<(), Error> {
    for (what, count) in [("vertices", positions.len()), ("faces", triangles.len())] {
        if count > LIMIT {
            return Err(Error::Size { what, count, limit: LIMIT });
        }
    }
    let weight = options.normal_weight;
    if !(weight.is_finite() && weight >= 0.0) {
        let value = weight.to_string();
        return Err(Error::Option { name: "normal_weight", value, domain: "a finite number, not negative" });
    }
    for (face, &corners) in triangles.iter().enumerate() {
        for vertex in corners {
            match positions.get(vertex as usize) {
                None => return Err(Error::Index { face, vertex, vertices: positions.len() }),
                Some(p) if !p.is_finite() => return Err(Error::Position { face, vertex }),
                Some(_) => {}
            }
        }
        let [a, b, c] = corners;
        if let Some(vertex) = [(a, b), (b, c), (c, a)].into_iter().find_map(|(u, v)| (u == v).then_some(u)) {
            return Err(Error::Corner { face, vertex });
        }
    }
    Ok(())
}

/// An edge as a point in space, middle and weighted mean normal; or a point itself.
#[derive(Clone, Copy)]
struct Item {
    key: [f32; 6],
    number: u32,
}

/// Orders points as [`split`] does, which gives their numbers: neighbours in the order are neighbours in space.
pub(crate) fn arrange_points(points: impl Iterator<Item = Vec3>) -> Vec<u32> {
    let item = |(number, p): (u32, Vec3)| Item { key: [p.x, p.y, p.z, 0.0, 0.0, 0.0], number };
    let mut items: Vec<Item> = (0..).zip(points).map(item).collect();
    order(&mut items);
    items.iter().map(|item| item.number).collect()
}

fn order(items: &mut [Item]) {
    let height = Tree::shape(items.len()).len();
    if height > 0 {
        split(items, Tree::capacity(height - 1));
    }
}

/// Orders edges for a [`Tree`], so that neighbours in the order are neighbours in position and normal.
fn arrange(edges: &mut [u32], dual: &Dual<'_>, normal_weight: f32) {
    let (low, high) = edges
        .iter()
        .flat_map(|&edge| dual.vertices(edge))
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let size = (high - low).length();
    let scale = if size > 0.0 { size.recip() } else { 0.0 };
    let item = |&edge: &u32| {
        let [a, b] = dual.vertices(edge);
        let middle = scale * (0.5 * (a - low) + 0.5 * (b - low));
        let (sum, count) = dual.planes(edge).fold((DVec3::ZERO, 0.0), |(sum, n), plane| (sum + plane.normal, n + 1.0));
        let normal = sum * (f64::from(normal_weight) / count);
        let [x, y, z] = middle.to_array().map(|x| x as f32);
        let [u, v, w] = normal.to_array().map(|x| x as f32);
        Item { key: [x, y, z, u, v, w], number: edge }
    };
    let mut items: Vec<Item> = edges.par_iter().map(item).collect();
    order(&mut items);
    edges.iter_mut().zip(items).for_each(|(edge, item)| *edge = item.number);
}

/// Orders `items`, which lie below one node, whose children hold `capacity` edges each: halves along the longest axis, each a
/// whole number of children, down to the leaves.
fn split(items: &mut [Item], mut capacity: usize) {
    if items.len() <= WIDTH {
        items.sort_unstable_by_key(|item| item.number);
        return;
    }
    while capacity >= items.len() {
        capacity /= WIDTH;
    }
    let (mut low, mut high) = ([f32::INFINITY; 6], [f32::NEG_INFINITY; 6]);
    for item in &*items {
        for (axis, &x) in item.key.iter().enumerate() {
            low[axis] = low[axis].min(x);
            high[axis] = high[axis].max(x);
        }
    }
    let longest = |i: &usize, j: &usize| (high[*i] - low[*i]).total_cmp(&(high[*j] - low[*j])).then(j.cmp(i));
    let axis = (0..6).max_by(longest).unwrap_or_default();
    let along = |x: &Item, y: &Item| -> Ordering { x.key[axis].total_cmp(&y.key[axis]).then(x.number.cmp(&y.number)) };

    let left = items.len().div_ceil(capacity).div_ceil(2) * capacity;
    items.select_nth_unstable_by(left, along);
    let (left, right) = items.split_at_mut(left);
    if left.len() + right.len() < GRAIN {
        split(left, capacity);
        split(right, capacity);
    } else {
        rayon::join(|| split(left, capacity), || split(right, capacity));
    }
}

/// The tree over the `count` edges from `first` on, in their order.
fn tree(dual: &Dual<'_>, first: u32, count: usize, balanced: bool) -> Tree {
    let mut tree = Tree { edges: count, ..Tree::default() };
    let mut shape = Tree::shape(count).into_iter();
    let Some(parents) = shape.next() else { return tree };
    let mut level = vec![Node::EMPTY; parents];
    if balanced {
        tree.leaves = vec![Leaf::EMPTY; count.div_ceil(WIDTH)];
        level.par_iter_mut().zip(tree.leaves.par_chunks_mut(WIDTH)).enumerate().for_each(|(index, (node, leaves))| {
            for (lane, leaf) in leaves.iter_mut().enumerate() {
                let edges = numbers(first, Tree::range(count, 0, WIDTH * index + lane));
                let planes = edges.clone().flat_map(|edge| dual.planes(edge));
                let bounds = Bounds::new(edges.clone().flat_map(|edge| dual.vertices(edge)), Some(planes));
                node.set(lane, &bounds);
                for (lane, edge) in edges.enumerate() {
                    if dual.is_fan(edge) {
                        leaf.planes[0][3][lane] = FAN;
                    } else {
                        dual.planes(edge).enumerate().for_each(|(which, plane)| leaf.set(which, lane, &plane, &bounds));
                    }
                }
            }
        });
    } else {
        level.par_iter_mut().enumerate().for_each(|(index, node)| {
            for lane in 0..WIDTH {
                let edges = numbers(first, Tree::range(count, 0, WIDTH * index + lane));
                if !edges.is_empty() {
                    let points = edges.flat_map(|edge| dual.vertices(edge));
                    node.set(lane, &Bounds::new(points, None::<std::iter::Empty<_>>));
                }
            }
        });
    }
    tree.levels.push(level);

    for (below, nodes) in shape.enumerate() {
        let children = &tree.levels[below];
        let merged = |index: usize| {
            let mut node = Node::EMPTY;
            for (lane, child) in children.iter().skip(WIDTH * index).take(WIDTH).enumerate() {
                let first = WIDTH * (WIDTH * index + lane);
                let live = (first..first + WIDTH).take_while(|&i| !Tree::range(count, below, i).is_empty()).count();
                node.set(lane, &Bounds::merge((0..live).map(|lane| child.get(lane))));
            }
            node
        };
        let level = (0..nodes).into_par_iter().map(merged).collect();
        tree.levels.push(level);
    }
    tree
}

fn numbers(first: u32, range: Range<usize>) -> Range<u32> {
    first + range.start as u32..first + range.end as u32
}
