//! Meshes for the tests and benchmarks.
#![allow(dead_code, reason = "each test and benchmark takes what it needs")]

use std::collections::HashMap;
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use dual_bvh::{BuildOptions, DualBvh};
use glam::{Vec3, vec3};

/// Positions and triangles.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Joins another mesh, moved by `offset`.
    pub fn add(&mut self, other: &Mesh, offset: Vec3) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions.iter().map(|&p| p + offset));
        self.triangles.extend(other.triangles.iter().map(|triangle| triangle.map(|vertex| first + vertex)));
    }

    pub fn tree(&self) -> DualBvh {
        self.tree_with(&BuildOptions::default())
    }

    pub fn tree_with(&self, options: &BuildOptions) -> DualBvh {
        let (positions, triangles) = (Arc::from(&*self.positions), Arc::from(&*self.triangles));
        DualBvh::build(positions, triangles, options).expect("the mesh is valid")
    }

    /// Corners of the bounding box.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)))
    }
}

/// Deterministic uniform numbers in [0, 1): splitmix64 (Steele, Lea and Flood, 2014).
#[derive(Clone, Debug)]
pub struct Uniform(pub u64);

impl Uniform {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    pub fn next(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }

    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    /// A point in the cube [-1, 1)^3.
    pub fn in_cube(&mut self) -> Vec3 {
        vec3(self.next(), self.next(), self.next()) * 2.0 - 1.0
    }

    /// A point in the unit ball.
    pub fn in_ball(&mut self) -> Vec3 {
        loop {
            let p = self.in_cube();
            if p.length_squared() < 1.0 {
                return p;
            }
        }
    }
}

/// A square of side 2 `half` in the plane z = 0, of 2 `cells`^2 triangles facing up.
pub fn plane(half: f32, cells: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let side = cells + 1;
    for y in 0..side {
        for x in 0..side {
            mesh.positions.push(vec3(x as f32, y as f32, 0.0) * (2.0 * half / cells as f32) - vec3(half, half, 0.0));
        }
    }
    for y in 0..cells {
        for x in 0..cells {
            let i = y * side + x;
            mesh.triangles.push([i, i + 1, i + side + 1]);
            mesh.triangles.push([i, i + side + 1, i + side]);
        }
    }
    mesh
}

/// The unit sphere: an icosahedron whose faces are quartered `levels` times.
pub fn icosphere(levels: u32) -> Mesh {
    let t = f32::midpoint(1.0, 5f32.sqrt());
    let corners = [
        [-1.0, t, 0.0],
        [1.0, t, 0.0],
        [-1.0, -t, 0.0],
        [1.0, -t, 0.0],
        [0.0, -1.0, t],
        [0.0, 1.0, t],
        [0.0, -1.0, -t],
        [0.0, 1.0, -t],
        [t, 0.0, -1.0],
        [t, 0.0, 1.0],
        [-t, 0.0, -1.0],
        [-t, 0.0, 1.0],
    ];
    let around = |pole: u32, ring: [u32; 5]| (0..5).map(move |i| [pole, ring[i], ring[(i + 1) % 5]]);
    let mut mesh = Mesh { positions: corners.map(|p| Vec3::from(p).normalize()).to_vec(), triangles: Vec::new() };
    mesh.triangles.extend(around(0, [11, 5, 1, 7, 10]));
    mesh.triangles.extend(around(3, [9, 4, 2, 6, 8]));
    mesh.triangles.extend([[1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8]]);
    mesh.triangles.extend([[4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1]]);
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let Mesh { positions, triangles } = &mut mesh;
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        let quarter = |&[a, b, c]: &[u32; 3]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        };
        *triangles = triangles.iter().flat_map(quarter).collect();
    }
    mesh
}

/// A tube of `sides` sides along `segments` segments of the (2, 3) torus knot, about 1 wide: 2 `segments` `sides` triangles.
pub fn torus_knot(segments: u32, sides: u32) -> Mesh {
    let curve = |t: f32| {
        let r = 0.25 + 0.1 * (3.0 * t).cos();
        vec3(r * (2.0 * t).cos(), r * (2.0 * t).sin(), 0.1 * (3.0 * t).sin())
    };
    let mut mesh = Mesh::default();
    for i in 0..segments {
        let t = TAU * i as f32 / segments as f32;
        let center = curve(t);
        let tangent = (curve(t + 1e-2) - curve(t - 1e-2)).normalize();
        let across = tangent.cross(Vec3::Z).normalize();
        let up = across.cross(tangent);
        for j in 0..sides {
            let (sin, cos) = (TAU * j as f32 / sides as f32).sin_cos();
            mesh.positions.push(center + 0.05 * (cos * across + sin * up));
        }
    }
    for i in 0..segments {
        for j in 0..sides {
            let (next, beside) = ((i + 1) % segments, (j + 1) % sides);
            let [a, b, c, d] = [i * sides + j, i * sides + beside, next * sides + beside, next * sides + j];
            mesh.triangles.push([a, c, b]);
            mesh.triangles.push([a, d, c]);
        }
    }
    mesh
}

/// 10 x 10 torus knots, each turned another way, over a plane of 10 x 10: 200 `segments` `sides` triangles and two.
pub fn knots(segments: u32, sides: u32) -> Mesh {
    let mut mesh = plane(5.0, 1);
    let knot = torus_knot(segments, sides);
    let mut uniform = Uniform(1);
    for i in 0..100 {
        let turn =
            glam::Quat::from_euler(glam::EulerRot::XYZ, PI * uniform.next(), PI * uniform.next(), TAU * uniform.next());
        let turned = Mesh { positions: knot.positions.iter().map(|&p| turn * p).collect(), ..knot.clone() };
        mesh.add(&turned, vec3((i % 10) as f32 - 4.5, (i / 10) as f32 - 4.5, 0.5));
    }
    mesh
}

/// An icosphere of radius 1 over a plane.
pub fn sphere_over_plane(levels: u32) -> Mesh {
    let mut mesh = plane(4.0, 1);
    mesh.add(&icosphere(levels), vec3(0.0, 0.0, 1.5));
    mesh
}

/// Small unconnected triangles in a ball over a plane.
pub fn foliage(count: usize) -> Mesh {
    let mut mesh = plane(4.0, 1);
    let mut uniform = Uniform(2);
    for i in 0..count as u32 {
        let center = 2.0 * uniform.in_ball() + 2.5 * Vec3::Z;
        mesh.positions.extend([0; 3].map(|_| center + 0.05 * uniform.in_ball()));
        mesh.triangles.push([4, 5, 6].map(|corner| 3 * i + corner));
    }
    mesh
}
