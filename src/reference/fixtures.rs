//! Small scenes for the tests of this folder.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::sobol::Sobol;
use crate::scene::Geometry;

pub fn geometry(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Geometry {
    Geometry {
        positions: Arc::from(positions),
        triangle_mesh: vec![0; triangles.len()],
        triangle_material: vec![0; triangles.len()],
        triangles: Arc::from(triangles),
        meshes: vec!["fixture".into()],
        materials: Vec::new(),
        cleaning: Default::default(),
    }
}

/// All triangles of all `parts`, vertices unshared between the parts.
pub fn union(parts: &[Geometry]) -> Geometry {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for part in parts {
        let base = positions.len() as u32;
        positions.extend_from_slice(&part.positions);
        triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + base)));
    }
    geometry(positions, triangles)
}

/// A planar convex polygon as a fan.
pub fn polygon(corners: impl IntoIterator<Item = Vec3>) -> Geometry {
    let positions: Vec<_> = corners.into_iter().collect();
    let triangles = (2..positions.len() as u32).map(|k| [0, k - 1, k]).collect();
    geometry(positions, triangles)
}

/// A closed box, faces outwards.
pub fn cuboid(low: Vec3, high: Vec3) -> Geometry {
    let corner =
        |k: usize| Vec3::from_array(std::array::from_fn(|axis| if k >> axis & 1 == 0 { low } else { high }[axis]));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    geometry((0..8).map(corner).collect(), triangles)
}

/// A closed sphere of `2 * rings * rings` quadrilaterals between two poles, faces outwards.
pub fn sphere(centre: Vec3, radius: f32, rings: u32) -> Geometry {
    let columns = 2 * rings;
    let mut positions = vec![centre + radius * Vec3::Z];
    for ring in 1..rings {
        for column in 0..columns {
            let (st, ct) = (std::f64::consts::PI * f64::from(ring) / f64::from(rings)).sin_cos();
            let (sp, cp) = (std::f64::consts::PI * f64::from(column) / f64::from(rings)).sin_cos();
            positions.push(centre + radius * DVec3::new(st * cp, st * sp, ct).as_vec3());
        }
    }
    positions.push(centre - radius * Vec3::Z);
    let south = positions.len() as u32 - 1;
    let at = |ring: u32, column: u32| 1 + (ring - 1) * columns + column % columns;
    let mut triangles = Vec::new();
    for column in 0..columns {
        triangles.push([0, at(1, column), at(1, column + 1)]);
        triangles.push([south, at(rings - 1, column + 1), at(rings - 1, column)]);
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, column), at(ring, column + 1)];
            let [c, d] = [at(ring + 1, column), at(ring + 1, column + 1)];
            triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    geometry(positions, triangles)
}

/// `count` unrelated triangles of about `size` in the cube [-1, 1]^3.
pub fn soup(count: u32, size: f32, seed: u32) -> Geometry {
    let mut random = random(seed);
    let positions = (0..count)
        .flat_map(|_| {
            let centre = random();
            [random(), random(), random()].map(|corner| centre.as_vec3() + size * corner.as_vec3())
        })
        .collect();
    geometry(positions, (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect())
}

/// Points in the cube [-1, 1]^3.
pub fn random(seed: u32) -> impl FnMut() -> DVec3 {
    let mut index = 0;
    let axes = [0, 1, 2].map(|axis| Sobol::new(seed.wrapping_mul(3).wrapping_add(axis)));
    move || {
        index += 1;
        DVec3::from_array(axes.map(|axis| 2.0 * axis.point(index % Sobol::LENGTH)[0] - 1.0))
    }
}
