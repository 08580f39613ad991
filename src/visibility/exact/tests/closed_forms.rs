//! Scenes with a known answer.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::scenes::{Random, Triangle, cuboid, quad, sphere};
use super::{Answer, SPHERE, exact};
use crate::sphere::{BoundaryArc, Order, hemisphere};

#[test]
fn open_hemisphere() {
    let mut random = Random(3);
    for _ in 0..20 {
        let n = random.direction();
        let answer = exact(&[], DVec3::ZERO, Some(n));
        assert!((answer.solid_angle - TAU).abs() < 1e-14);
        assert!((answer.vector_area - PI * n).length() < 1e-14);
        let expected = Answer { harmonics: hemisphere(Order::MAX, n), ..answer.clone() };
        assert!(answer.distance(&expected) < 1e-13, "{}", answer.distance(&expected));
    }
}

#[test]
fn open_sphere() {
    let answer = exact(&[], DVec3::ZERO, None);
    assert_eq!(answer.solid_angle, SPHERE);
    assert!(answer.harmonics[1..].iter().all(|&c| c == 0.0));
}
