//! Time of everything that is built once per scene. What is built is first asked for an answer known otherwise.

mod scene;

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, SamplingMode, criterion_group, criterion_main};
use dual_bvh::{BuildOptions, Candidates, Contours, DualBvh, Tile, brute_force};
use glam::DVec3;
use scene::Case;
use silhouette::bake::Pixels;
use silhouette::integrand::{LightMoments, LightTable, LineHarmonics, LineMoments, ambient_occlusion};
use silhouette::reference::{RayScene, first_hit};
use silhouette::scene::{FaceTree, Scene, Sky};
use silhouette::sphere::Order;
use silhouette::visibility::{Frame, Isolines, Meridians, Spans, open_spans};

const LINES: usize = 256;

fn bench(criterion: &mut Criterion) {
    let Case { geometry, receivers, .. } = Case::new("knots_100k");
    let edges = || {
        let (positions, triangles) = (geometry.positions.clone(), geometry.triangles.clone());
        DualBvh::build(positions, triangles, &BuildOptions::default()).expect("the geometry is clean")
    };
    let faces = || FaceTree::new(geometry.positions.clone(), geometry.triangles.clone());
    let isolines = Isolines::new(LINES).expect("an even number");
    let order = Order::new(4).expect("four bands");
    let sky = Sky::default().environment().expect("the defaults are in their domain");

    let above = geometry.bounds().expect("not empty")[1].as_dvec3() * 1.5;
    let (mut candidates, mut contours) = (Candidates::default(), Contours::default());
    edges().search(&Tile::lone(above, None), &mut candidates);
    candidates.contours(above, &[], &mut contours);
    let expected = brute_force(&geometry.positions, &geometry.triangles, above, &[]).len();
    assert_eq!(contours.edges().len(), expected, "contours");

    // All of a hemisphere and all of the sky's light.
    let meridians = Meridians::new(2 * LINES).expect("a few");
    let harmonics = LineHarmonics::new(order, &meridians);
    let light = LightTable::new(&isolines, &sky);
    // Half of the sphere, up to the equator: its normal is the start.
    let mut moments = LineMoments::default();
    let half = vec![&[(-Meridians::POLE, 0.0)][..]; meridians.len()];
    harmonics.integrate(&Spans::new(&half), &mut moments);
    let sum: Vec<f64> = moments.sets[0].iter().zip(&moments.sets[1]).map(|(even, odd)| even + odd).collect();
    assert!((ambient_occlusion(&sum, DVec3::NEG_Z) - 1.0).abs() < 1e-12, "harmonics along lines");
    let mut moments = LightMoments::default();
    let (frame, mut open) = (Frame::facing(None, 0), Spans::default());
    open_spans(&isolines, frame, None, &mut open);
    light.integrate(frame, &open, &mut moments);
    let expected = sky.patches(1).map(|(moment, radiance)| moment * f64::from(radiance.x)).sum::<DVec3>();
    assert!(moments.vectors()[0].distance(expected) < 1e-9, "light along lines");

    // Primary rays through the tree hit what the judge's rays hit.
    let (tree, rays) = (faces(), RayScene::new(&geometry));
    for receiver in (0..receivers.len()).step_by(5000).map(|i| receivers.get(i)) {
        let Some(direction) = receiver.normal else { continue };
        let above = receiver.position + 1e-3 * direction;
        assert_eq!(first_hit(&tree, above, direction), rays.first_hit(above, direction, &[]), "faces");
    }
    let scene = Scene::builtin("knots_100k").expect("it is built in");
    let camera = scene.camera.expect("it has one").with_resolution([320, 240]).expect("a small picture");

    let mut group = criterion.benchmark_group("build");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    group.bench_function("scene knots_100k", |b| b.iter(|| black_box(Scene::builtin("knots_100k"))));
    group.bench_function("DualBvh knots_100k", |b| b.iter(|| black_box(edges())));
    group.bench_function("FaceTree knots_100k", |b| b.iter(|| black_box(faces())));
    group.bench_function("primary rays knots_100k, 320 x 240", |b| {
        b.iter(|| black_box(Pixels::new(&geometry, &tree, &camera)));
    });
    group.bench_function("LineHarmonics, order 4, 256 lines", |b| {
        b.iter(|| black_box(LineHarmonics::new(order, &meridians)));
    });
    group.bench_function("LightTable, 256 x 128 pixels, 256 lines", |b| {
        b.iter(|| black_box(LightTable::new(&isolines, &sky)));
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
