//! Time of building a tree and of finding contours, with and without sharing. What is timed is first compared with brute force.

mod meshes;

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use dual_bvh::{Candidates, Contours, DualBvh, Tile, brute_force};
use glam::{DVec3, dvec3};
use meshes::{Mesh, Uniform};

/// Receivers that share a search.
const SHARING: usize = 64;

/// Radius of a tile relative to the diagonal of the scene.
const RADIUS: f64 = 0.007;

/// Tiles of receivers just above the ground, in a disc about a random point of it.
fn tiles(mesh: &Mesh, count: usize) -> Vec<Vec<DVec3>> {
    let (low, high) = mesh.bounds();
    let (low, size) = (low.as_dvec3(), (high - low).as_dvec3());
    let mut uniform = Uniform(5);
    let mut number = || f64::from(uniform.next());
    (0..count)
        .map(|_| {
            let center = low + size * dvec3(number(), number(), 1e-4);
            (0..SHARING)
                .map(|_| {
                    let (sin, cos) = (std::f64::consts::TAU * number()).sin_cos();
                    center + RADIUS * size.length() * number().sqrt() * dvec3(cos, sin, 0.0)
                })
                .collect()
        })
        .collect()
}

fn shared(tile: &[DVec3]) -> Tile<'static> {
    Tile::new(tile.iter().map(|&p| (p, Some(DVec3::Z))))
}

/// Number of contours of the receiver, which must be those that brute force finds.
fn verify(mesh: &Mesh, candidates: &Candidates, receiver: DVec3) -> usize {
    let mut contours = Contours::default();
    candidates.contours(receiver, &[], &mut contours);
    let found = contours.edges().iter().map(|contour| {
        let edge = candidates.edges()[contour.edge as usize];
        ([edge.a, edge.b].map(|end| candidates.vertices()[end as usize]), contour.jump)
    });
    let mut found: Vec<_> = found.collect();
    found.sort_unstable();
    let above = |end: &u32| mesh.positions[*end as usize].as_dvec3().z >= receiver.z;
    let mut expected = brute_force(&mesh.positions, &mesh.triangles, receiver, &[]);
    let missing = expected.len() - found.len();
    expected.retain(|edge| found.binary_search(edge).is_ok() || edge.0.iter().any(above));
    assert_eq!(found, expected, "the search is wrong");
    assert!(missing <= 5, "only the ground lies below the receivers");
    found.len()
}

/// Least time of ten, in microseconds: what else the machine does shows least in it.
fn least(mut work: impl FnMut()) -> f64 {
    let time = |()| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64() * 1e6
    };
    std::iter::repeat_n((), 10).map(time).fold(f64::INFINITY, f64::min)
}

fn report(name: &str, mesh: &Mesh, tree: &DualBvh, tiles: &[Vec<DVec3>]) {
    let mut candidates = Candidates::default();
    let mut out = Contours::default();
    let (mut contours, mut nodes, mut edges, mut lone, mut sharing) = (0, 0, 0, 0, 0);
    let mut times = [0.0; 2];
    for tile in tiles {
        tree.search(&Tile::lone(tile[0], Some(DVec3::Z)), &mut candidates);
        contours += verify(mesh, &candidates, tile[0]);
        nodes += candidates.nodes_tested();
        edges += candidates.edges_tested();
        lone += candidates.edges().len();
        tree.search(&shared(tile), &mut candidates);
        verify(mesh, &candidates, tile[SHARING / 2]);
        sharing += candidates.edges().len();
        times[0] += least(|| {
            tree.search(&Tile::lone(tile[0], Some(DVec3::Z)), &mut candidates);
            candidates.contours(tile[0], &[], &mut out);
        });
        times[1] += least(|| {
            tree.search(&shared(tile), &mut candidates);
            tile.iter().for_each(|&p| candidates.contours(p, &[], &mut out));
        }) / SHARING as f64;
    }
    println!("{name}\n{}", tree.statistics());
    let each = |count: f64| count / contours as f64;
    println!(
        "a receiver has {:.0} contours; per contour {:.2} children, {:.2} edges tested, {:.3} candidates, {:.2} if {SHARING} share",
        contours as f64 / tiles.len() as f64,
        each(nodes as f64),
        each(edges as f64),
        each(lone as f64),
        each(sharing as f64)
    );
    let [lone, sharing] = times.map(|time| time / tiles.len() as f64);
    println!(
        "least time per receiver: {lone:.1} us alone, {sharing:.1} us if {SHARING} share: {:.1} times less\n",
        lone / sharing
    );
}

fn bench(criterion: &mut Criterion) {
    let scenes: [(&str, Mesh); 4] = [
        ("ico 5k", meshes::sphere_over_plane(4)),
        ("knots 100k", meshes::knots(50, 10)),
        ("knots 400k", meshes::knots(100, 20)),
        ("foliage 50k", meshes::foliage(50_000)),
    ];
    for (name, mesh) in &scenes {
        let tree = mesh.tree();
        let tiles = tiles(mesh, 8);
        report(name, mesh, &tree, &tiles);
        let mut candidates = Candidates::default();
        let mut contours = Contours::default();

        let mut group = criterion.benchmark_group(*name);
        group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
        group.throughput(Throughput::Elements(mesh.triangles.len() as u64));
        group.bench_function("build", |b| b.iter(|| black_box(mesh.tree())));

        // Per tile in turn, so that no receiver finds its own memory in the cache.
        group.throughput(Throughput::Elements(1));
        let mut turn = tiles.iter().cycle();
        group.bench_function(BenchmarkId::new("receiver", "lone"), |b| {
            b.iter(|| {
                let Some(tile) = turn.next() else { return };
                tree.search(&Tile::lone(tile[0], Some(DVec3::Z)), &mut candidates);
                candidates.contours(tile[0], &[], &mut contours);
            });
        });
        group.bench_function(BenchmarkId::new("receiver", "all edges"), |b| {
            tree.all_edges(&mut candidates);
            b.iter(|| {
                let Some(tile) = turn.next() else { return };
                candidates.contours(tile[0], &[], &mut contours);
            });
        });
        group.throughput(Throughput::Elements(SHARING as u64));
        group.bench_function(BenchmarkId::new("tile", SHARING), |b| {
            b.iter(|| {
                let Some(tile) = turn.next() else { return };
                tree.search(&shared(tile), &mut candidates);
                tile.iter().for_each(|&p| candidates.contours(p, &[], &mut contours));
            });
        });
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
