//! Triangles, and their contours by brute force.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use glam::DVec3;

use crate::visibility::{Arc, ReceiverContours};

pub type Triangle = [DVec3; 3];

/// Corners in the order of the face's winding: the sign of a face is that of its normal seen from the receiver, zero
/// counting as positive; none for faces without area and for those the receiver lies on.
fn sign(triangle: &Triangle, receiver: DVec3) -> i32 {
    let [a, b, c] = triangle.map(|corner| corner - receiver);
    let n = (b - a).cross(c - a);
    let height = n.dot(-a);
    let surrounds = || [a.cross(b), b.cross(c), c.cross(a)].iter().all(|edge| edge.dot(n) >= 0.0);
    if n == DVec3::ZERO || height == 0.0 && surrounds() {
        0
    } else if height >= 0.0 {
        1
    } else {
        -1
    }
}

/// The contours of a receiver: every edge whose faces' signs do not cancel, with vertices shared by position.
pub fn contours(triangles: &[Triangle], receiver: DVec3, normal: Option<DVec3>) -> ReceiverContours {
    let mut result = ReceiverContours::default();
    let mut index = BTreeMap::new();
    let mut jumps: BTreeMap<(u32, u32), i32> = BTreeMap::new();
    for triangle in triangles {
        let corners = triangle.map(|corner| {
            // -0 = +0
            let key = (corner + 0.0).to_array().map(f64::to_bits);
            *index.entry(key).or_insert_with(|| {
                result.directions.push(corner - receiver);
                result.heights.push(normal.map_or(1.0, |n| n.dot(corner - receiver)));
                result.directions.len() as u32 - 1
            })
        });
        let sign = sign(triangle, receiver);
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if a < b {
                *jumps.entry((a, b)).or_default() += sign;
            } else {
                *jumps.entry((b, a)).or_default() -= sign;
            }
        }
    }
    let arcs = jumps.into_iter().filter(|&(_, jump)| jump != 0);
    let plane = |a: u32, b: u32| {
        let [a, b] = [a, b].map(|vertex| result.directions[vertex as usize]);
        a.cross(b - a)
    };
    result.arcs = arcs.map(|((a, b), jump)| Arc { a, b, jump, plane: plane(a, b) }).collect();
    result
}

/// W in a direction: the triangles whose three edges have it on the same side. Faces seen edge-on, or with
/// two corners in one direction, within rounding have no sides to speak of, and no area.
pub fn depth(triangles: &[Triangle], receiver: DVec3, w: DVec3) -> i32 {
    let hit = |triangle: &&Triangle| {
        let [a, b, c] = triangle.map(|corner| corner - receiver);
        let n = (b - a).cross(c - a);
        let volume = a.dot(n);
        let edges = [(a, b), (b, c), (c, a)];
        let is_end_on = |&(a, b): &(DVec3, DVec3)| a.cross(b - a).length() <= 1e-14 * a.length() * b.length();
        let has_no_area = volume.abs() <= 1e-14 * a.length() * n.length() || edges.iter().any(is_end_on);
        let is_inside = |&(a, b): &(DVec3, DVec3)| volume.signum() * a.cross(b).dot(w) > 0.0;
        sign(triangle, receiver) != 0 && !has_no_area && edges.iter().all(is_inside)
    };
    triangles.iter().filter(hit).count() as i32
}

/// Two triangles.
pub fn quad(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> [Triangle; 2] {
    [[a, b, c], [a, c, d]]
}

/// The twelve triangles of a box.
pub fn cuboid(low: DVec3, high: DVec3) -> Vec<Triangle> {
    let corner = |i: usize| {
        let pick = |bit: usize, axis: usize| if i >> bit & 1 == 1 { high[axis] } else { low[axis] };
        DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
    };
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    faces.iter().flat_map(|&[a, b, c, d]| quad(corner(a), corner(b), corner(c), corner(d))).collect()
}

/// A unit sphere's triangles: an octahedron split `levels` times.
pub fn sphere(centre: DVec3, radius: f64, levels: usize) -> Vec<Triangle> {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let top = [[x, y, z], [y, -x, z], [-x, -y, z], [-y, x, z]];
    let mut faces: Vec<Triangle> = top.into_iter().flat_map(|[a, b, c]| [[a, b, c], [b, a, -c]]).collect();
    for _ in 0..levels {
        faces = faces.iter().flat_map(split).map(|face| face.map(DVec3::normalize)).collect();
    }
    faces.into_iter().map(|face| face.map(|w| centre + radius * w)).collect()
}

/// Four triangles instead of one.
pub fn split(&[a, b, c]: &Triangle) -> [Triangle; 4] {
    let middle = |p: DVec3, q: DVec3| 0.5 * (p + q);
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
}

/// A (2, 3) torus knot of `around` x `across` quads.
pub fn knot(centre: DVec3, size: f64, around: usize, across: usize) -> Vec<Triangle> {
    let axis = |t: f64| {
        let r = 2.0 + (3.0 * t).cos();
        DVec3::new(r * (2.0 * t).cos(), r * (2.0 * t).sin(), -(3.0 * t).sin())
    };
    let ring = |i: usize, j: usize| {
        let (t, s) = (TAU * (i % around) as f64 / around as f64, TAU * (j % across) as f64 / across as f64);
        let along = (axis(t + 1e-4) - axis(t - 1e-4)).normalize();
        let side = along.cross(DVec3::Z).normalize();
        centre + size * (axis(t) + 0.45 * (s.cos() * side + s.sin() * side.cross(along)))
    };
    let cell = |i, j| quad(ring(i, j), ring(i + 1, j), ring(i + 1, j + 1), ring(i, j + 1));
    (0..around).flat_map(|i| (0..across).flat_map(move |j| cell(i, j))).collect()
}

/// A sequence of numbers in [0, 1) without obvious structure (SplitMix64).
pub struct Random(pub u64);

impl Random {
    pub fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.number(), self.number(), self.number()) * 2.0 - 1.0
    }

    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.vector();
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    /// Triangles of about `size` scattered in a cube of half-side 2.
    pub fn soup(&mut self, count: usize, size: f64) -> Vec<Triangle> {
        let mut triangle = || {
            let centre = 2.0 * self.vector();
            [(); 3].map(|()| centre + size * self.vector())
        };
        (0..count).map(|_| triangle()).collect()
    }
}
