//! The exact method on the built-in scenes: against isolines, which converge to it, and against itself in another frame.

#[path = "common/scenes.rs"]
mod scenes;

use dual_bvh::{BuildOptions, DualBvh};
use glam::DVec3;
use scenes::{rms, run, values};
use silhouette::bake::{Method, Receivers};
use silhouette::scene::{FaceTree, Geometry, Scene};
use silhouette::sphere::Order;
use silhouette::visibility::{Skips, View, Viewer};

/// A built-in scene, and some of its vertices, far from each other.
fn scene(name: &str, count: usize) -> (Geometry, Receivers) {
    let geometry = Scene::builtin(name).unwrap().geometry;
    let (vertices, _) = Receivers::vertices(&geometry);
    let picked = (0..count).map(|i| (2 * i + 1) * vertices.len() / (2 * count));
    let receivers = vertices.pick(picked);
    (geometry, receivers)
}

/// Errors of isolines fall like N^-1.5: at 16384 of them what is left in the mean square is 1e-6 of the occlusion, ten times
/// that at the worst receiver, and from a quarter of them on it falls to an eighth, up to chance.
#[track_caller]
fn isolines_converge(name: &str, count: usize) {
    let (geometry, receivers) = scene(name, count);
    let exact = run(&geometry, None, &receivers, 1, Method::Exact).arrays;
    let exact = values(&exact, "ambient_occlusion");
    let [coarse, fine] = [4096, 16384].map(|lines| {
        let found = run(&geometry, None, &receivers, 1, Method::Isolines { lines }).arrays;
        let pairs = values(&found, "ambient_occlusion").iter().zip(exact);
        pairs.map(|(found, exact)| (found - exact).abs()).collect::<Vec<f64>>()
    });
    for (i, error) in fine.iter().enumerate() {
        assert!(*error < 1e-5, "{name}: receiver {i} is off by {error:e}");
    }
    let [coarse, fine] = [coarse, fine].map(rms);
    assert!(fine < 1e-6, "{name}: {fine:e}");
    assert!(fine < coarse / 4.0, "{name}: from {coarse:e} to {fine:e}");
}

#[test]
fn isolines_converge_to_it_in_a_room() {
    isolines_converge("room", 24);
}

#[test]
fn isolines_converge_to_it_among_knots() {
    isolines_converge("knots_100k", 12);
}

/// All that is computed of the region in one frame agrees with that in others to the rounding of thousands of arcs.
#[track_caller]
fn frames_agree(name: &str, count: usize) {
    let (geometry, receivers) = scene(name, count);
    let (positions, triangles) = (geometry.positions.clone(), geometry.triangles.clone());
    let edges = DualBvh::build(positions.clone(), triangles.clone(), &BuildOptions::default()).unwrap();
    let faces = FaceTree::new(positions, triangles);
    let viewer = Viewer { edges: &edges, faces: &faces };
    let (mut view, order) = (View::default(), Order::new(6).unwrap());
    for i in 0..receivers.len() {
        let receiver = receivers.get(i);
        viewer.approach(std::iter::once(receiver), &mut view);
        let mut answer = |frame| {
            let region = viewer.solve(frame, receiver, Skips::default(), &mut view);
            assert!(!region.residuals().alarm(), "{name}: {:?}", region.residuals());
            let mut numbers = vec![0.0; order.len()];
            region.harmonics(order, &mut numbers);
            numbers.extend(region.vector_area().to_array());
            numbers.push(region.cosine(receiver.normal.unwrap_or(DVec3::Z)));
            numbers
        };
        let first = answer(0);
        for frame in [1, 2] {
            let distance = first.iter().zip(answer(frame)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(distance < 1e-9, "{name}: receiver {i} differs by {distance:e} in frame {frame}");
        }
    }
}

#[test]
fn frames_agree_on_all_scenes() {
    frames_agree("icosphere", 24);
    frames_agree("room", 24);
    frames_agree("knots_100k", 12);
    frames_agree("foliage", 2);
}
