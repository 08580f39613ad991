//! Nodes of eight children, in single precision around an origin of each child's own, and leaves of eight edges.

use std::ops::Range;

use glam::DVec3;

use crate::dual::Plane;

/// Children of a node and edges of a leaf.
pub(crate) const WIDTH: usize = 8;

/// One number per child or edge.
pub(crate) type Lanes = [f32; WIDTH];

/// Relative inflation of the stored bounds, 2^-20 = 16 u with u = 2^-24 the unit roundoff of single precision.
///
/// It pays for all rounding of a test with q, the receiver relative to a child's centre c (see `query.rs`):
///
/// - q is rounded twice: 2 u |q_i| a component, so at most 2 u |q|_1 in n . q, as |n_i| <= 1;
/// - n . q + d, three products and three sums: 4 u (|q|_1 + |d|);
/// - the bound with which it is compared, five sums and products of non-negative terms: 5 u relative;
/// - the plane itself, evaluated in double precision with another anchor: 2^-48 (|q|_1 + |c - a|_1), see [`PLANE_ROUNDING`].
///
/// Adding `SLACK` to the half widths of the normals pays for the terms in |q|_1, adding `SLACK` |d| to that of the offset for
/// those in |d|, and scaling both by 1 + `SLACK` for those of the bound.
pub(crate) const SLACK: f64 = 1.0 / (1 << 20) as f64;

/// Rounding of a plane value in double precision, relative to the distance of the anchor: 2^-48 is 32 units of roundoff, for the
/// value itself, for the offset and for the unit normal. Taken 2^12 times as large, so that 2^-12 of a half width still pays for it
/// in a leaf, where the rest of the half width is spent on the grid.
const PLANE_ROUNDING: f64 = 1.0 / (1u64 << 36) as f64;

/// Bounds of eight children. Lane j is child j.
///
/// The dual of a face with unit normal n and anchor a is the plane n . q + d, with q = p - c and d = n . (c - a): its value is
/// the distance of the receiver p. A child bounds n and d, each by centre and half width, over all faces of its edges, flipped so
/// that an edge whose planes all have the same sign is no contour.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Node {
    /// Centre c of the box of the edges, origin of the offsets.
    pub(crate) center: [Lanes; 3],
    /// Half extents of that box.
    pub(crate) half: [Lanes; 3],
    pub(crate) normal: [Lanes; 3],
    pub(crate) normal_half: [Lanes; 3],
    pub(crate) offset: Lanes,
    /// Infinite for edges that are contours for every receiver.
    pub(crate) offset_half: Lanes,
}

/// Bounds of one child.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) center: [f32; 3],
    pub(crate) half: [f32; 3],
    pub(crate) normal: [f32; 3],
    pub(crate) normal_half: [f32; 3],
    pub(crate) offset: f32,
    pub(crate) offset_half: f32,
}

impl Node {
    pub(crate) const EMPTY: Self = Self {
        center: [[0.0; WIDTH]; 3],
        half: [[0.0; WIDTH]; 3],
        normal: [[0.0; WIDTH]; 3],
        normal_half: [[0.0; WIDTH]; 3],
        offset: [0.0; WIDTH],
        offset_half: [0.0; WIDTH],
    };

    pub(crate) fn set(&mut self, lane: usize, bounds: &Bounds) {
        for axis in 0..3 {
            self.center[axis][lane] = bounds.center[axis];
            self.half[axis][lane] = bounds.half[axis];
            self.normal[axis][lane] = bounds.normal[axis];
            self.normal_half[axis][lane] = bounds.normal_half[axis];
        }
        self.offset[lane] = bounds.offset;
        self.offset_half[lane] = bounds.offset_half;
    }

    pub(crate) fn get(&self, lane: usize) -> Bounds {
        let of = |lanes: &[Lanes; 3]| [0, 1, 2].map(|axis| lanes[axis][lane]);
        Bounds {
            center: of(&self.center),
            half: of(&self.half),
            normal: of(&self.normal),
            normal_half: of(&self.normal_half),
            offset: self.offset[lane],
            offset_half: self.offset_half[lane],
        }
    }
}

impl Bounds {
    /// Bounds of the points and planes of a child's edges; without `planes` the edges are contours for every receiver.
    pub(crate) fn new(
        points: impl Iterator<Item = DVec3>,
        planes: Option<impl Iterator<Item = Plane> + Clone>,
    ) -> Self {
        let (low, high) = range(points);
        let (center, half) = centered(low, high);
        let half = half.map(|x| up(x * (1.0 + SLACK)));
        let Some(planes) = planes else {
            return Self {
                center,
                half,
                normal: [0.0; 3],
                normal_half: [0.0; 3],
                offset: 0.0,
                offset_half: f32::INFINITY,
            };
        };

        let (low, high) = range(planes.clone().map(|plane| plane.normal));
        let (normal, normal_half) = centered(low, high);
        let normal_half = normal_half.map(|x| up(x * (1.0 + SLACK) + SLACK));

        let origin = DVec3::from_array(center.map(f64::from));
        let (mut low, mut high, mut reach) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
        for Plane { normal, anchor } in planes {
            let arm = origin - anchor;
            let offset = normal.dot(arm);
            (low, high) = (low.min(offset), high.max(offset));
            reach = reach.max(arm.abs().element_sum());
        }
        let (offset, offset_half) = centered_offset(low, high, reach);
        Self { center, half, normal, normal_half, offset, offset_half }
    }

    /// Bounds of all that the given bounds enclose: exact but for rounding in box and normals; the offsets move with the origin,
    /// n . (c' - a) = n . (c - a) + n . (c' - c), by interval arithmetic.
    pub(crate) fn merge(parts: impl Iterator<Item = Bounds> + Clone) -> Self {
        let hull = |of: fn(&Bounds) -> ([f32; 3], [f32; 3])| {
            range(parts.clone().flat_map(|part| {
                let (middle, half) = of(&part);
                let [middle, half] = [middle, half].map(|v| DVec3::from_array(v.map(f64::from)));
                [middle - half, middle + half]
            }))
        };
        let (low, high) = hull(|part| (part.center, part.half));
        let (center, half) = centered(low, high);
        let half = half.map(|x| up(x * (1.0 + 4.0 * f64::EPSILON)));
        let (low, high) = hull(|part| (part.normal, part.normal_half));
        let (normal, normal_half) = centered(low, high);
        let normal_half = normal_half.map(|x| up(x * (1.0 + SLACK)));

        let origin = DVec3::from_array(center.map(f64::from));
        let (mut low, mut high, mut reach) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
        for part in parts {
            let of = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
            let arm = origin - of(part.center);
            let offset = f64::from(part.offset) + of(part.normal).dot(arm);
            let spread = f64::from(part.offset_half) + of(part.normal_half).dot(arm.abs());
            reach = reach.max(arm.abs().element_sum());
            (low, high) = (low.min(offset - spread), high.max(offset + spread));
        }
        let (offset, offset_half) = centered_offset(low, high, reach);
        Self { center, half, normal, normal_half, offset, offset_half }
    }
}

/// Middle, in single precision, and half widths about that of a box.
fn centered(low: DVec3, high: DVec3) -> ([f32; 3], [f64; 3]) {
    let middle = (0.5 * low + 0.5 * high).to_array().map(|x| x as f32);
    let origin = DVec3::from_array(middle.map(f64::from));
    (middle, (high - origin).max(origin - low).to_array())
}

/// Middle and half width of an interval of offsets of planes with anchors within `reach`.
fn centered_offset(low: f64, high: f64, reach: f64) -> (f32, f32) {
    let offset = (0.5 * low + 0.5 * high) as f32;
    if !offset.is_finite() {
        // Coordinates near the largest float, or no bounds at all.
        return (0.0, f32::INFINITY);
    }
    let middle = f64::from(offset);
    let spread = (high - middle).max(middle - low);
    (offset, up(spread * (1.0 + SLACK) + SLACK * middle.abs() + PLANE_ROUNDING * reach))
}

/// The planes of eight edges, two an edge, as 8-bit fractions of the half widths of the leaf's bounds: one cache line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(64))]
pub(crate) struct Leaf {
    /// For each of the two planes: fractions of the normal's three components and of the offset, in units of 1 / [`STEPS`].
    pub(crate) planes: [[[i8; WIDTH]; 4]; 2],
}

/// Steps of the fractions in a leaf on either side of zero.
pub(crate) const STEPS: f32 = 127.0;

/// Stands in the first plane's offset of an edge with more than two faces: look at the faces themselves.
pub(crate) const FAN: i8 = i8::MIN;

impl Leaf {
    pub(crate) const EMPTY: Self = Self { planes: [[[0; WIDTH]; 4]; 2] };

    /// Sets one plane of one edge; the plane lies within `bounds`, which were made by [`Bounds::new`].
    pub(crate) fn set(&mut self, which: usize, lane: usize, plane: &Plane, bounds: &Bounds) {
        self.planes[which].iter_mut().zip(fractions(plane, bounds)).for_each(|(lanes, x)| {
            lanes[lane] = (x * f64::from(STEPS)).round() as i8;
        });
    }
}

/// Where a plane lies within its bounds: -1 to 1 for the components of its normal and for its offset. Zero where there is no bound.
pub(crate) fn fractions(plane: &Plane, bounds: &Bounds) -> [f64; 4] {
    let [x, y, z] = plane.normal.to_array();
    let offset = plane.normal.dot(DVec3::from_array(bounds.center.map(f64::from)) - plane.anchor);
    let [nx, ny, nz] = bounds.normal;
    let [hx, hy, hz] = bounds.normal_half;
    let of = |value: f64, middle: f32, half: f32| {
        let fraction = (value - f64::from(middle)) / f64::from(half);
        if fraction.is_nan() { 0.0 } else { fraction }
    };
    [of(x, nx, hx), of(y, ny, hy), of(z, nz, hz), of(offset, bounds.offset, bounds.offset_half)]
}

/// Smallest single not below `x`.
pub(crate) fn up(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) < x { nearest.next_up() } else { nearest }
}

fn range(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

/// A tree without pointers: node i of level 0 has the leaves 8 i .. 8 i + 8, node i of level h the nodes 8 i .. 8 i + 8 of level
/// h - 1, and leaf i the edges 8 i .. 8 i + 8 of the tree. Only the last of each are incomplete.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    /// Number of edges.
    pub(crate) edges: usize,
    /// Empty if the edges are contours for every receiver.
    pub(crate) leaves: Vec<Leaf>,
    /// From the leaves' parents up to the root; empty without edges.
    pub(crate) levels: Vec<Vec<Node>>,
}

impl Tree {
    /// Edges below a child of a node of level `height`.
    pub(crate) fn capacity(height: usize) -> usize {
        WIDTH.pow(height as u32 + 1)
    }

    /// Numbers of nodes per level for a number of edges, from the leaves' parents up.
    pub(crate) fn shape(edges: usize) -> Vec<usize> {
        let mut shape = Vec::new();
        let mut children = edges.div_ceil(WIDTH);
        while children > 0 {
            children = children.div_ceil(WIDTH);
            shape.push(children);
            if children == 1 {
                break;
            }
        }
        shape
    }

    /// Edges of one child: `index` counts all children of the nodes of level `height`.
    pub(crate) fn edges_below(&self, height: usize, index: usize) -> Range<usize> {
        Self::range(self.edges, height, index)
    }

    /// The same in a tree of `edges` edges.
    pub(crate) fn range(edges: usize, height: usize, index: usize) -> Range<usize> {
        let capacity = Self::capacity(height);
        (index * capacity).min(edges)..((index + 1) * capacity).min(edges)
    }

    /// Bytes of all nodes.
    pub(crate) fn node_bytes(&self) -> usize {
        self.levels.iter().map(|level| size_of_val(&**level)).sum()
    }

    /// Bytes of all leaves.
    pub(crate) fn leaf_bytes(&self) -> usize {
        size_of_val(&*self.leaves)
    }
}
