//! Scenes with a known answer.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::scenes::{Random, Triangle, cuboid, quad, sphere};
use super::{Answer, SPHERE, exact, order};
use crate::sphere::hemisphere;

/// Rounding of some tens of arcs.
const EXACT: f64 = 1e-12;

#[test]
fn open_hemisphere() {
    let mut random = Random(3);
    for _ in 0..20 {
        let n = random.direction();
        let answer = exact(&[], DVec3::ZERO, Some(n));
        assert!((answer.solid_angle - TAU).abs() < 1e-14);
        assert!((answer.vector_area - PI * n).length() < 1e-14);
        let expected = Answer { harmonics: hemisphere(order(), n), ..answer.clone() };
        assert!(answer.distance(&expected) < 1e-13, "{}", answer.distance(&expected));
    }
}

#[test]
fn open_sphere() {
    let answer = exact(&[], DVec3::ZERO, None);
    assert_eq!(answer.solid_angle, SPHERE);
    assert!(answer.harmonics[1..].iter().all(|&c| c == 0.0));
}

#[test]
fn octants_are_eighths() {
    // Edges through the axes, vertices and edges on the horizon.
    let triangle = [DVec3::X, DVec3::Y, DVec3::Z];
    let answer = exact(&[triangle], DVec3::ZERO, None);
    assert!((answer.solid_angle - (SPHERE - FRAC_PI_2)).abs() < EXACT);
    for n in [DVec3::X, DVec3::Y, DVec3::Z] {
        let answer = exact(&[triangle], DVec3::ZERO, Some(n));
        assert!((answer.solid_angle - (TAU - FRAC_PI_2)).abs() < EXACT, "{n}");
        assert!((answer.vector_area.dot(n) - 0.75 * PI).abs() < EXACT, "{n}");
        let answer = exact(&[triangle], DVec3::ZERO, Some(-n));
        assert!((answer.solid_angle - TAU).abs() < EXACT, "{n}");
    }
}

/// Visible part of the cosine-weighted hemisphere of +z under the square |x|, |y| < h at height 1, from its centre:
/// 1 - (4/pi) h/sqrt(1+h^2) atan(h/sqrt(1+h^2)) (Lambert).
#[test]
fn square_overhead() {
    for h in [0.01, 0.5, 1.0, 20.0] {
        let square =
            quad(DVec3::new(-h, -h, 1.0), DVec3::new(h, -h, 1.0), DVec3::new(h, h, 1.0), DVec3::new(-h, h, 1.0));
        let answer = exact(&square, DVec3::ZERO, Some(DVec3::Z));
        let s = h / (1.0 + h * h).sqrt();
        assert!((answer.vector_area.z / PI - (1.0 - 4.0 / PI * s * s.atan())).abs() < EXACT);
        // Solid angle of a square pyramid: 4 asin(h^2 / (1 + h^2)).
        assert!((TAU - answer.solid_angle - 4.0 * (h * h / (1.0 + h * h)).asin()).abs() < EXACT);
    }
}

/// A wall of height k at distance 1, infinitely wide: occlusion (1 - 1/sqrt(1 + k^2)) / 2.
#[test]
fn wall() {
    let width = 1e9;
    for k in [0.1, 1.0, 30.0] {
        let wall = quad(
            DVec3::new(1.0, -width, 0.0),
            DVec3::new(1.0, width, 0.0),
            DVec3::new(1.0, width, k),
            DVec3::new(1.0, -width, k),
        );
        let answer = exact(&wall, DVec3::ZERO, Some(DVec3::Z));
        let occlusion = 1.0 - answer.vector_area.z / PI;
        // The finite width costs k / (pi width).
        assert!((occlusion - 0.5 * (1.0 - 1.0 / (1.0 + k * k).sqrt())).abs() < 1e-7 * k.max(1.0));
    }
}

#[test]
fn disjoint_blockers_add_up_and_nested_ones_hide() {
    let mut random = Random(4);
    let far = |t: &Triangle| t.map(|corner| 3.0 * corner);
    for _ in 0..10 {
        let n = random.direction();
        // Small triangles about the corners of an octahedron, turned at random, do not meet.
        let (x, y) = n.any_orthonormal_pair();
        let mut blocker = |centre: DVec3| [(); 3].map(|()| centre + 0.4 * random.vector());
        let (a, b, c) = (blocker(x), blocker(y - x), blocker(n - y));
        let alone = |t: &[Triangle]| SPHERE - exact(t, DVec3::ZERO, None).solid_angle;
        let sum = alone(&[a]) + alone(&[b]) + alone(&[c]);
        assert!((alone(&[a, b, c]) - sum).abs() < EXACT);
        assert!((alone(&[a, b, c, far(&a), far(&b)]) - sum).abs() < EXACT, "the same directions, further away");
        let middle = (c[0] + c[1] + c[2]) / 3.0;
        let within = c.map(|corner| 2.0 * (0.3 * corner + 0.7 * middle));
        assert!((alone(&[within, a, c, b]) - sum).abs() < EXACT, "nested");
    }
}

#[test]
fn enclosed_receivers_see_nothing() {
    let room = cuboid(DVec3::splat(-1.0), DVec3::new(2.0, 1.0, 3.0));
    let ball = sphere(DVec3::new(0.1, 0.0, -0.2), 5.0, 3);
    let mut random = Random(5);
    for scene in [&room, &ball, &[room.clone(), ball.clone()].concat()] {
        for _ in 0..5 {
            let p = 0.9 * random.vector();
            for normal in [None, Some(random.direction()), Some(DVec3::Z)] {
                let answer = exact(scene, p, normal);
                assert_eq!(answer.solid_angle, 0.0);
                assert!(answer.harmonics.iter().all(|&c| c == 0.0));
            }
        }
    }
}

/// A room with its ceiling open is seen through the rectangle the ceiling would fill.
#[test]
fn open_room_equals_its_opening() {
    let (low, high) = (DVec3::new(-1.0, -2.0, 0.0), DVec3::new(1.5, 1.0, 1.2));
    let room: Vec<Triangle> =
        cuboid(low, high).into_iter().filter(|t| !t.iter().all(|corner| corner.z == high.z)).collect();
    let corner = |x: f64, y: f64| DVec3::new(x, y, high.z);
    let lid = quad(corner(low.x, low.y), corner(high.x, low.y), corner(high.x, high.y), corner(low.x, high.y));
    let mut random = Random(6);
    for _ in 0..10 {
        let p = DVec3::new(random.number(), -random.number(), 1.1 * random.number());
        let n = random.direction();
        let (through, open) = (exact(&room, p, Some(n)), exact(&[], p, Some(n)));
        let blocked = exact(&lid, p, Some(n));
        assert!((through.solid_angle - (open.solid_angle - blocked.solid_angle)).abs() < EXACT);
        assert!((through.vector_area - (open.vector_area - blocked.vector_area)).length() < EXACT);
        for i in 0..order().len() {
            assert!((through.harmonics[i] - (open.harmonics[i] - blocked.harmonics[i])).abs() < EXACT);
        }
    }
}
