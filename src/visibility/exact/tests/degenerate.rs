//! Ties: coincident and collinear edges, duplicate faces, T-junctions, vertices on the horizon.

use std::cell::Cell;

use glam::DVec3;
use proptest::prelude::*;

use super::scenes::{Random, Triangle, contours, cuboid, quad, split};
use super::twin::agree;
use super::{Scratch, exact, solve};
use crate::visibility::{Arc, ReceiverContours};

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
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

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

/// Two directions that coincide, one the end of a triangle and one the start of another: rounding sees a crossing there,
/// of which only the antipode lies behind the sweep.
#[test]
fn touching_corners() {
    let v = |x: i32, y: i32, z: i32| DVec3::new(x as f64, y as f64, z as f64);
    let triangles = [[v(1, 2, 1), v(-1, -2, -2), v(-1, -1, 0)], [v(-2, -1, 0), v(1, 1, 2), v(1, 1, 0)]];
    let n = DVec3::new(-0.8164965809277261, -0.4082482904638631, 0.4082482904638631);
    agree(&triangles, v(0, -1, 0), Some(n), 1e-11);
}

#[test]
fn axis_aligned_boxes_sharing_planes() {
    let mut boxes = Vec::new();
    for (x, y, z) in [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 2, 0), (0, 0, 1), (2, 0, 0)] {
        let low = DVec3::new(x as f64, y as f64, z as f64);
        boxes.extend(cuboid(low, low + 1.0));
    }
    let above = DVec3::new(1.5, 1.5, 0.5);
    for receiver in [above, DVec3::new(1.5, 1.5, 1.0), DVec3::new(-1.0, 1.0, 0.0), DVec3::new(0.5, 0.5, 3.0)] {
        for normal in [None, Some(DVec3::Z), Some(DVec3::X), Some(-DVec3::Y), Some(DVec3::ONE.normalize())] {
            agree(&boxes, receiver, normal, 1e-11);
        }
    }
}

/// Copies of a face in the same place hide no more than one of them, split or not: collinear edges, T-junctions.
#[test]
fn coincident_faces_and_t_junctions() {
    let mut random = Random(7);
    for _ in 0..30 {
        let faces = random.soup(2, 2.0);
        let normal = Some(random.direction());
        let expected = exact(&faces, DVec3::ZERO, normal);
        let turned = faces.iter().map(|&[a, b, c]| [b, a, c]);
        let apart: Vec<Triangle> = faces.iter().flat_map(split).collect();
        let third = |&[a, b, c]: &Triangle| {
            let on_side = a + (b - a) / 3.0;
            [[a, on_side, c], [on_side, b, c]]
        };
        let t_junctions: Vec<Triangle> = faces.iter().flat_map(third).collect();
        for copies in [
            faces.iter().copied().chain(faces.iter().copied()).collect::<Vec<_>>(),
            faces.iter().copied().chain(turned).collect(),
            [apart.clone(), t_junctions.clone()].concat(),
            [faces.clone(), apart, t_junctions].concat(),
        ] {
            let distance = exact(&copies, DVec3::ZERO, normal).distance(&expected);
            assert!(distance < 1e-12, "{distance:e}");
        }
    }
}

/// Further copies at other distances make the edges coincide within rounding only.
#[test]
fn edges_that_coincide_within_rounding() {
    let mut random = Random(8);
    for _ in 0..30 {
        let faces = random.soup(2, 2.0);
        let normal = Some(random.direction());
        let expected = exact(&faces, DVec3::ZERO, normal);
        let mut copies = faces.clone();
        for _ in 0..6 {
            let scale = 0.3 + random.number();
            copies.extend(faces.iter().flat_map(split).map(|t| t.map(|corner| scale * corner)));
        }
        let distance = exact(&copies, DVec3::ZERO, normal).distance(&expected);
        assert!(distance < 1e-12, "{distance:e}");
    }
}

/// Edges along lines of sight: their ends coincide within rounding, and what direction they have is noise.
#[test]
fn edges_seen_end_on() {
    let mut random = Random(14);
    for _ in 0..100 {
        let directions = [(); 3].map(|()| random.direction());
        let mut corner = || directions[(3.0 * random.number()) as usize] * (0.5 + random.number());
        let corners: Vec<DVec3> = (0..9).map(|_| corner()).collect();
        let mut pick = || corners[(9.0 * random.number()) as usize];
        let faces: Vec<Triangle> = (0..6).map(|_| [pick(), pick(), pick()]).collect();
        let normal = Some(random.direction());
        agree(&faces, DVec3::ZERO, normal, 1e-11);
    }
}

/// Floor and walls in planes through the receiver: seen edge-on, they hide nothing.
#[test]
fn faces_seen_edge_on() {
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let floor = quad(corner(1.0, -1.0), corner(2.0, -1.0), corner(2.0, 1.0), corner(1.0, 1.0));
    for n in [DVec3::Z, -DVec3::Z, DVec3::X, DVec3::new(0.6, 0.0, 0.8)] {
        let distance = exact(&floor, DVec3::ZERO, Some(n)).distance(&exact(&[], DVec3::ZERO, Some(n)));
        assert!(distance < 1e-12, "{n}: {distance:e}");
    }
}

#[test]
fn scales_at_the_ends_of_single_precision() {
    let mut random = Random(9);
    let faces = random.soup(4, 1.5);
    let expected = exact(&faces, DVec3::ZERO, Some(DVec3::Y));
    for exponent in [-140, -40, 40, 126] {
        let scale = 2f64.powi(exponent);
        let scaled: Vec<Triangle> = faces.iter().map(|t| t.map(|corner| scale * corner)).collect();
        let distance = exact(&scaled, DVec3::ZERO, Some(DVec3::Y)).distance(&expected);
        assert!(distance < 1e-13, "2^{exponent}: {distance:e}");
    }
}

/// What is no contour at all is told, and neither panics nor hangs.
#[test]
fn bad_contours_raise_the_alarm() {
    let mut random = Random(10);
    let good = contours(&random.soup(5, 1.5), DVec3::ZERO, None);
    let alarm = |contours: &ReceiverContours| {
        let mut scratch = Scratch::default();
        solve(contours, None, 0, |_| 0, &mut scratch).residuals().alarm()
    };
    let mut cut = good.clone();
    cut.arcs.pop();
    assert!(alarm(&cut));
    for bad in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY] {
        let mut contours = good.clone();
        contours.directions[3] = bad;
        assert!(alarm(&contours), "{bad}");
    }
    let mut flipped = good.clone();
    flipped.arcs.iter_mut().for_each(|arc: &mut Arc| arc.jump = -arc.jump);
    assert!(alarm(&flipped), "W below zero");
    let (mut scratch, calls) = (Scratch::default(), Cell::new(0));
    let one_then_none = |_| i32::from(calls.replace(calls.get() + 1) == 0);
    assert!(solve(&good, None, 0, one_then_none, &mut scratch).residuals().depth_mismatch != 0, "counts disagree");
}
