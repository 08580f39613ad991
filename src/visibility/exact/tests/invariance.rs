//! What must not change the answer.

use glam::{DMat3, DQuat, DVec3};

use super::scenes::{Random, Triangle, knot, sphere, split};
use super::{Answer, exact};
use crate::sphere::{Order, rotate};

/// Hundreds of arcs, each rounded at 1e-16.
const ROUNDING: f64 = 1e-12;

fn scene() -> Vec<Triangle> {
    let mut faces = knot(DVec3::new(0.0, 0.0, 1.5), 0.5, 40, 8);
    faces.extend(knot(DVec3::new(2.5, 1.0, 1.5), 0.5, 40, 8));
    faces.extend(sphere(DVec3::new(-2.0, 1.0, 1.0), 0.8, 2));
    faces
}

fn receivers(count: usize) -> Vec<(DVec3, Option<DVec3>)> {
    let mut random = Random(11);
    (0..count).map(|i| (2.0 * random.vector(), (i % 3 > 0).then(|| random.direction()))).collect()
}

#[test]
fn rotation_of_the_scene() {
    let mut random = Random(12);
    let faces = scene();
    for (p, normal) in receivers(9) {
        let turn = DQuat::from_axis_angle(random.direction(), 6.0 * random.number());
        let matrix = DMat3::from_quat(turn);
        let turned: Vec<Triangle> = faces.iter().map(|t| t.map(|corner| matrix * corner)).collect();
        let (a, b) = (exact(&faces, p, normal), exact(&turned, matrix * p, normal.map(|n| matrix * n)));
        let mut harmonics = vec![0.0; Order::MAX.len()];
        rotate(Order::MAX, matrix, &a.harmonics[..Order::MAX.len()], &mut harmonics);
        let expected = Answer { harmonics, vector_area: matrix * a.vector_area, ..a };
        assert!(b.distance(&expected) < ROUNDING, "{:e}", b.distance(&expected));
    }
}

#[test]
fn splitting_faces() {
    let faces = scene();
    let finer: Vec<Triangle> = faces.iter().flat_map(split).collect();
    for (p, normal) in receivers(6) {
        let distance = exact(&faces, p, normal).distance(&exact(&finer, p, normal));
        assert!(distance < ROUNDING, "{distance:e}");
    }
}

#[test]
fn order_and_winding_of_faces() {
    let mut random = Random(13);
    let faces = scene();
    let mut shuffled: Vec<Triangle> =
        faces.iter().map(|&[a, b, c]| if random.number() < 0.5 { [a, b, c] } else { [c, b, a] }).collect();
    for i in (1..shuffled.len()).rev() {
        shuffled.swap(i, (random.number() * (i + 1) as f64) as usize);
    }
    for (p, normal) in receivers(6) {
        let distance = exact(&faces, p, normal).distance(&exact(&shuffled, p, normal));
        assert!(distance < ROUNDING, "{distance:e}");
    }
}

/// Two hemispheres make the full sphere.
#[test]
fn hemispheres_add_up() {
    let faces = scene();
    for (p, normal) in receivers(9) {
        let n = normal.unwrap_or(DVec3::Z);
        let (up, down, all) = (exact(&faces, p, Some(n)), exact(&faces, p, Some(-n)), exact(&faces, p, None));
        let harmonics = up.harmonics.iter().zip(&down.harmonics).map(|(a, b)| a + b).collect();
        let sum = Answer {
            solid_angle: up.solid_angle + down.solid_angle,
            vector_area: up.vector_area + down.vector_area,
            harmonics,
            ..up
        };
        assert!(sum.distance(&all) < ROUNDING, "{:e}", sum.distance(&all));
    }
}

/// Geometry behind what hides it, and the receiver's own height, change nothing.
#[test]
fn hidden_geometry() {
    let mut faces = scene();
    let screen = sphere(DVec3::ZERO, 8.0, 2);
    faces.extend(screen.iter().filter(|t| t.iter().any(|corner| corner.z > 0.0)));
    let mut more = faces.clone();
    more.extend(knot(DVec3::new(0.0, 0.0, 40.0), 2.0, 40, 8));
    for (p, normal) in receivers(6) {
        let distance = exact(&faces, p, normal).distance(&exact(&more, p, normal));
        assert!(distance < ROUNDING, "{distance:e}");
    }
}
