//! Ties: coincident and collinear edges, duplicate faces, T-junctions, vertices on the horizon.

use glam::DVec3;
use proptest::prelude::*;

use super::scenes::{Triangle, cuboid, quad, split};
use super::twin::{agree, quadrature};
use super::{SPHERE, exact};

/// Points of a tiny grid, so that everything coincides with something.
fn grid_point() -> impl Strategy<Value = DVec3> {
    (-2i32..3, -2i32..3, -2i32..3).prop_map(|(x, y, z)| DVec3::new(x as f64, y as f64, z as f64))
}

fn grid_triangles(count: usize) -> impl Strategy<Value = Vec<Triangle>> {
    prop::collection::vec((grid_point(), grid_point(), grid_point()).prop_map(|(a, b, c)| [a, b, c]), 1..count)
}

fn grid_normal() -> impl Strategy<Value = DVec3> {
    grid_point().prop_filter_map("a normal", DVec3::try_normalize)
}

/// Receivers on the grid, at the centres of its cells and in general position.
fn receiver() -> impl Strategy<Value = DVec3> {
    prop_oneof![
        grid_point(),
        grid_point().prop_map(|p| p + 0.5),
        grid_point().prop_map(|p| p + DVec3::new(0.5, 0.0, 0.25)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn grid_triangles_within_a_hemisphere(triangles in grid_triangles(6), p in receiver(), n in grid_normal()) {
        prop_assume!(!triangles.iter().flatten().any(|corner| *corner == p));
        agree(&triangles, p, Some(n), 1e-11);
    }

    #[test]
    fn grid_triangles_on_the_full_sphere(triangles in grid_triangles(6), p in receiver()) {
        prop_assume!(!triangles.iter().flatten().any(|corner| *corner == p));
        agree(&triangles, p, None, 1e-11);
    }
}

#[test]
fn found_by_proptest() {
    let v = |x: i32, y: i32, z: i32| DVec3::new(x as f64, y as f64, z as f64);
    let triangles = [[v(1, 2, 1), v(-1, -2, -2), v(-1, -1, 0)], [v(-2, -1, 0), v(1, 1, 2), v(1, 1, 0)]];
    let n = DVec3::new(-0.8164965809277261, -0.4082482904638631, 0.4082482904638631);
    agree(&triangles[..1], v(0, -1, 0), Some(n), 1e-11);
    agree(&triangles[1..], v(0, -1, 0), Some(n), 1e-11);
    agree(&triangles, v(0, -1, 0), Some(n), 1e-11);
}
