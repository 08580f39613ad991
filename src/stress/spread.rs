use glam::DVec3;

use super::pieces::direction;
use crate::bake::Receivers;
use crate::scene::Geometry;
use crate::scene::shapes::Random;

/// `count` receivers all over a geometry, in turn: on vertices, edges and faces (all by identity), exactly on the middle of
/// an edge, in the plane of a face beside it, lifted off a face by 1e-12 to 1e-1 of its size, inside the bounds, and up to
/// 1e6 sizes away. Half of the latter look along an axis.
pub fn at_random(geometry: &Geometry, count: usize, seed: u64) -> Receivers {
    let mut random = Random::new(seed);
    let Some([low, high]) = geometry.bounds().map(|bounds| bounds.map(|bound| bound.as_dvec3())) else {
        return super::pieces::floating(&mut random, count, 2.0);
    };
    let vertex_faces = geometry.vertex_faces();
    let vertex_normals = geometry.angle_weighted_normals();
    let size = low.distance(high);
    let one = |i: usize, random: &mut Random| {
        let face = (random.unit() * geometry.triangles.len() as f64) as u32;
        let side = (3.0 * random.unit()) as usize;
        let corners = geometry.triangles[face as usize];
        let [a, b, c] = [0, 1, 2].map(|k| geometry.positions[corners[(side + k) % 3] as usize].as_dvec3());
        let normal = (b - a).cross(c - a).try_normalize().unwrap_or(DVec3::Y);
        let ends = [corners[side], corners[(side + 1) % 3]];
        let around_edge = || {
            let faces = vertex_faces.of(ends[0]);
            faces.iter().copied().filter(|t| vertex_faces.of(ends[1]).contains(t)).collect()
        };
        let (s, t) = (random.unit(), random.unit());
        let inside = a + (b - a) * s.min(t) + (c - a) * (s - t).abs();
        let sign = if random.unit() < 0.5 { 1.0 } else { -1.0 };
        match i % 8 {
            0 => {
                let outwards = vertex_normals[ends[0] as usize].unwrap_or(normal);
                (a, outwards, vertex_faces.of(ends[0]).to_vec())
            }
            1 => (a.lerp(b, s), normal, around_edge()),
            2 => (inside, sign * normal, vec![face]),
            3 => (a.midpoint(b), direction(random), around_edge()),
            4 => (a + 2.0 * (b - a) + (c - a), sign * normal, Vec::new()),
            5 => {
                let height = (b - a).length() * 10f64.powf(random.between(-12.0, -1.0));
                (inside + sign * height * normal, sign * normal, Vec::new())
            }
            6 => {
                let p = [0, 1, 2].map(|axis| random.between(low[axis], high[axis]));
                (DVec3::from(p), direction(random), Vec::new())
            }
            _ => {
                let away = size * 10f64.powf(random.between(0.0, 6.0));
                (low.midpoint(high) + away * direction(random), direction(random), Vec::new())
            }
        }
    };
    Receivers::leaving_out((0..count).map(|i| one(i, &mut random)))
}
