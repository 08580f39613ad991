//! The search against its brute-force twin.

#[path = "../benches/meshes/mod.rs"]
mod meshes;

use std::collections::BTreeMap;

use dual_bvh::{BuildOptions, Candidates, Contours, DualBvh, OUTSIDE, Tally, Tile, brute_force};
use glam::{DVec3, Vec3, dvec3};
use meshes::{Mesh, Uniform};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

type Found = Vec<([u32; 2], i32)>;

/// The contours of one receiver among the candidates of its tile.
fn contours(candidates: &Candidates, receiver: DVec3, excluded: &[u32]) -> Found {
    let mut out = Contours::default();
    candidates.contours(receiver, excluded, &mut out);
    let global = |vertex: u32| candidates.vertices()[vertex as usize];
    let mut found: Found = out
        .edges()
        .iter()
        .map(|contour| {
            let edge = candidates.edges()[contour.edge as usize];
            ([global(edge.a), global(edge.b)], contour.jump)
        })
        .collect();
    found.sort_unstable();
    found
}

fn search(tree: &DualBvh, tile: &Tile<'_>) -> Candidates {
    let mut candidates = Candidates::default();
    tree.search(tile, &mut candidates);
    candidates
}

fn brute(mesh: &Mesh, receiver: DVec3, excluded: &[u32]) -> Found {
    brute_force(&mesh.positions, &mesh.triangles, receiver, excluded)
}

/// A mesh of few vertices with any topology: faces share edges in any number and winding.
fn tangle(seed: u64, vertices: usize, faces: usize) -> Mesh {
    let mut uniform = Uniform(seed);
    let positions = (0..vertices).map(|_| uniform.in_cube()).collect();
    let triangles = (0..faces)
        .map(|_| {
            loop {
                let corners = [0; 3].map(|_| uniform.below(vertices) as u32);
                if corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0] {
                    return corners;
                }
            }
        })
        .collect();
    Mesh { positions, triangles }
}

/// Meshes of every kind.
fn mesh(kind: usize, seed: u64) -> Mesh {
    let mut uniform = Uniform(seed);
    match kind {
        0 => meshes::icosphere(2),
        1 => meshes::sphere_over_plane(2),
        2 => meshes::torus_knot(40, 6),
        3 => meshes::plane(1.0, 12),
        4 => meshes::foliage(200),
        5 => tangle(seed, 12, 150),
        6 => tangle(seed, 200, 600),
        7 => {
            // Wound at random.
            let mut mesh = meshes::icosphere(2);
            mesh.triangles.iter_mut().filter(|_| uniform.next() < 0.5).for_each(|triangle| triangle.swap(0, 1));
            mesh
        }
        8 => {
            // With holes, and with faces that occur twice.
            let mut mesh = meshes::sphere_over_plane(2);
            mesh.triangles.retain(|_| uniform.next() < 0.8);
            let again: Vec<_> = mesh.triangles.iter().copied().filter(|_| uniform.next() < 0.2).collect();
            mesh.triangles.extend(again);
            mesh
        }
        9 => {
            // Of a lattice: many faces without area and many in one plane.
            let mut mesh = tangle(seed, 60, 300);
            mesh.positions.iter_mut().for_each(|p| *p = (*p * 2.0).round());
            mesh
        }
        _ => {
            // Slivers.
            let mut mesh = meshes::icosphere(2);
            mesh.positions.iter_mut().for_each(|p| *p *= Vec3::new(1.0, 1e-3, 1e-7));
            mesh
        }
    }
}
const KINDS: usize = 11;

/// A receiver anywhere, on a vertex, on an edge, in a face, in a face's plane, or next to one.
fn receiver(mesh: &Mesh, uniform: &mut Uniform) -> DVec3 {
    let corners = mesh.triangles[uniform.below(mesh.triangles.len())];
    let [a, b, c] = corners.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
    let (low, high) = mesh.bounds();
    let size = f64::from((high - low).length());
    match uniform.below(7) {
        0 => a,
        1 => 0.5 * (a + b),
        2 => (a + b + c) / 3.0,
        3 => a + 7.0 * (b - a) - 5.0 * (c - a),
        4 => a + 1e-9 * size * uniform.in_cube().as_dvec3(),
        5 => a + 100.0 * size * uniform.in_cube().as_dvec3(),
        _ => 0.5 * (low + high).as_dvec3() + size * uniform.in_cube().as_dvec3(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, rng_seed: RngSeed::Fixed(7), ..ProptestConfig::default() })]

    /// Lone search, tile search and brute force find the same edges with the same jumps, whatever is left out, also far from the
    /// origin and at any scale.
    #[test]
    fn the_search_finds_what_brute_force_finds(
        kind in 0..KINDS,
        seed in 0..1_000_000u64,
        exponent in prop::sample::select(vec![0, 0, 40, -40, 100, -100]),
        shift in prop::sample::select(vec![0.0f32, 0.0, 1.0, 1e6]),
        radius in prop::sample::select(vec![0.0, 1e-12, 1e-3, 0.1, 2.0]),
    ) {
        let mut mesh = mesh(kind, seed);
        let scale = 2f32.powi(exponent);
        mesh.positions.iter_mut().for_each(|p| *p = scale * (*p + shift * Vec3::new(1.0, -0.7, 0.3)));
        let tree = mesh.tree();
        let mut uniform = Uniform(seed);
        let center = receiver(&mesh, &mut uniform);
        let excluded: Vec<u32> =
            (0..uniform.below(4)).map(|_| uniform.below(mesh.triangles.len()) as u32).collect();
        let receivers: Vec<DVec3> = (0..5)
            .map(|i| if i == 0 { center } else { center + radius * f64::from(scale) * uniform.in_ball().as_dvec3() })
            .collect();
        let tile = Tile::new(receivers.iter().map(|&p| (p, None))).with_faces(&excluded);
        let shared = search(&tree, &tile);
        let mut all = Candidates::default();
        tree.all_edges(&mut all);
        for &p in &receivers {
            for excluded in [&[][..], &excluded] {
                let expected = brute(&mesh, p, excluded);
                prop_assert_eq!(&contours(&shared, p, excluded), &expected);
                prop_assert_eq!(&contours(&all, p, excluded), &expected);
                let lone = search(&tree, &Tile::lone(p, None).with_faces(excluded));
                prop_assert_eq!(&contours(&lone, p, excluded), &expected);
            }
        }
    }

    /// Contours among divided edges are those whose ends' cells differ, in order, however many cells there are.
    #[test]
    fn edges_are_chosen_by_the_cells_of_their_ends(
        kind in 0..KINDS,
        seed in 0..1_000_000u64,
        cells in prop::sample::select(vec![1, 2, 100, 300, 40_000]),
    ) {
        let mesh = mesh(kind, seed);
        let mut options = BuildOptions::default();
        options.group_faces = 100;
        let tree = mesh.tree_with(&options);
        let mut uniform = Uniform(seed);
        let p = receiver(&mesh, &mut uniform);
        let excluded: Vec<u32> =
            (0..uniform.below(4)).map(|_| uniform.below(mesh.triangles.len()) as u32).collect();
        let candidates = search(&tree, &Tile::new([(p, None), (p + 0.1, None)].into_iter()).with_faces(&excluded));
        let cells: Vec<i32> = candidates
            .vertices()
            .iter()
            .map(|_| uniform.below(cells) as i32 | if uniform.below(3) == 0 { OUTSIDE } else { 0 })
            .collect();
        let (mut all, mut found) = (Contours::default(), Contours::default());
        for part in candidates.parts() {
            candidates.contours_in(part, p, &excluded, &mut all);
            let cells_of = |edge: u32| {
                let edge = candidates.edges()[edge as usize];
                [edge.a, edge.b].map(|end| cells[end as usize])
            };
            let is_inside = |edge: u32| cells_of(edge).iter().any(|cell| cell & OUTSIDE == 0);
            let is_apart = |edge: u32| {
                let [a, b] = cells_of(edge).map(|cell| cell & !OUTSIDE);
                a != b && is_inside(edge)
            };
            let apart: Vec<_> = all.edges().iter().filter(|contour| is_apart(contour.edge)).copied().collect();
            let expected = Tally {
                contours: all.edges().len(),
                inside: all.edges().iter().filter(|contour| is_inside(contour.edge)).count(),
                apart: apart.len(),
            };
            prop_assert_eq!(candidates.contours_apart(part, &cells, false, p, &excluded, &mut found), expected);
            prop_assert_eq!(found.edges(), &apart);
            prop_assert_eq!(candidates.contours_apart(part, &cells, true, p, &excluded, &mut found), expected);
            prop_assert_eq!(found.edges(), all.edges());
        }
    }

    /// With a horizon, only edges strictly below the horizon may be missing.
    #[test]
    fn what_the_horizon_hides_lies_below_it(kind in 0..KINDS, seed in 0..1_000_000u64, spread in 0.0..0.5f64) {
        let mesh = mesh(kind, seed);
        let tree = mesh.tree();
        let mut uniform = Uniform(seed);
        let center = receiver(&mesh, &mut uniform);
        let normal = uniform.in_ball().as_dvec3().normalize();
        let receivers: Vec<(DVec3, DVec3)> = (0..5)
            .map(|_| (center + spread * uniform.in_ball().as_dvec3(), normal + spread * uniform.in_ball().as_dvec3()))
            .collect();
        let shared = search(&tree, &Tile::new(receivers.iter().map(|&(p, n)| (p, Some(n)))));
        for &(p, n) in &receivers {
            let below = |&([a, b], _): &([u32; 2], i32)| {
                [a, b].iter().all(|&vertex| n.dot(mesh.positions[vertex as usize].as_dvec3() - p) < 0.0)
            };
            let expected = brute(&mesh, p, &[]);
            let found = contours(&shared, p, &[]);
            for missing in expected.iter().filter(|edge| found.binary_search(edge).is_err()) {
                prop_assert!(below(missing));
            }
            prop_assert!(found.iter().all(|edge| expected.binary_search(edge).is_ok()));
        }
    }

    /// The jumps of the contours that leave a vertex and of those that arrive agree, whatever the receiver and what is left out.
    #[test]
    fn every_vertex_is_balanced(kind in 0..KINDS, seed in 0..1_000_000u64) {
        let mesh = mesh(kind, seed);
        let mut uniform = Uniform(seed);
        let p = receiver(&mesh, &mut uniform);
        let excluded: Vec<u32> =
            (0..uniform.below(4)).map(|_| uniform.below(mesh.triangles.len()) as u32).collect();
        let candidates = search(&mesh.tree(), &Tile::lone(p, None).with_faces(&excluded));
        let mut balance = BTreeMap::new();
        for ([a, b], jump) in contours(&candidates, p, &excluded) {
            *balance.entry(a).or_insert(0) += jump;
            *balance.entry(b).or_insert(0) -= jump;
        }
        prop_assert!(balance.values().all(|&sum| sum == 0));
    }
}

#[test]
fn a_sphere_shows_one_loop_and_a_plane_its_border() {
    let mesh = meshes::icosphere(3);
    let found = brute(&mesh, dvec3(5.0, 1.0, 0.3), &[]);
    let ends = found.iter().flat_map(|(edge, _)| edge).fold(BTreeMap::new(), |mut ends, &vertex| {
        *ends.entry(vertex).or_insert(0) += 1;
        ends
    });
    assert!(found.iter().all(|(_, jump)| jump.abs() == 2));
    assert!(found.len() > 20 && ends.values().all(|&count| count % 2 == 0));

    let mesh = meshes::plane(1.0, 4);
    let candidates = search(&mesh.tree(), &Tile::lone(dvec3(0.1, 0.2, 3.0), None));
    assert_eq!(candidates.edges().len(), 16);
    assert_eq!(contours(&candidates, dvec3(0.1, 0.2, 3.0), &[]), brute(&mesh, dvec3(0.1, 0.2, 3.0), &[]));
}

/// Groups are searched alone, in any order, and again for a part of the tile.
#[test]
fn groups_together_have_the_contours_of_all() {
    let mesh = meshes::knots(30, 6);
    let mut options = BuildOptions::default();
    options.group_faces = 300;
    let tree = mesh.tree_with(&options);
    assert_eq!(tree.check(), Ok(()));
    assert!(tree.groups() > 20 && tree.group_boxes().len() > 2);
    let one = mesh.tree_with(&{
        options.group_faces = usize::MAX;
        options
    });
    assert_eq!((one.groups(), one.edge_count()), (1, tree.edge_count()));
    let receiver = dvec3(0.4, 1.3, 0.2);
    let excluded = [5, 700, 701, 5000];
    let tile = Tile::new([(receiver, None), (receiver + 0.2, None)].into_iter()).with_faces(&excluded);
    let expected = brute(&mesh, receiver, &excluded);
    assert_eq!(contours(&search(&tree, &tile), receiver, &excluded), expected);
    assert_eq!(contours(&search(&one, &tile), receiver, &excluded), expected);

    let mut candidates = Candidates::default();
    tree.begin(&tile, &mut candidates);
    (0..tree.groups() as u32).rev().for_each(|group| tree.search_group(group, &tile, &mut candidates));
    assert_eq!(contours(&candidates, receiver, &excluded), expected);
    let lone = Tile::lone(receiver, None).with_faces(&excluded[1..3]);
    for group in 0..tree.groups() as u32 {
        let found = |candidates: &Candidates| {
            let mut out = Contours::default();
            candidates.contours_in(candidates.part(group).unwrap(), receiver, &excluded[1..3], &mut out);
            let ends = |contour: &dual_bvh::Contour| {
                let edge = candidates.edges()[contour.edge as usize];
                assert!(candidates.part(group).unwrap().vertices.contains(&(edge.a as usize)));
                ([edge.a, edge.b].map(|end| candidates.vertices()[end as usize]), contour.jump)
            };
            let mut found: Found = out.edges().iter().map(ends).collect();
            found.sort_unstable();
            found
        };
        let shared = found(&candidates);
        let before = candidates.part(group).unwrap().edges.len();
        tree.search_group(group, &lone, &mut candidates);
        assert_eq!(found(&candidates), shared);
        let count = candidates.part(group).unwrap().edges.len();
        assert!(count <= before);
        let parts = candidates.parts().len();
        assert_eq!(tree.search_few(group, &lone, count - 1, &mut candidates), count);
        assert_eq!(candidates.parts().len(), parts);
        assert_eq!(tree.search_few(group, &lone, count, &mut candidates), count);
        assert_eq!(candidates.parts().len(), parts + 1);
    }
}

/// So many candidates of one body that their faces are numbered in several blocks, and faces left out here and there.
#[test]
fn many_candidates_of_one_body_are_those_of_the_twin() {
    let side = 120;
    let positions: Vec<Vec3> = (0..side * side)
        .map(|i| ((i % side) as f32, (i / side) as f32))
        .map(|(x, y)| Vec3::new(x, y, 3.0 * (0.7 * x).sin() * (0.9 * y).cos()))
        .collect();
    let cells = (0..(side - 1) * (side - 1)).map(|i| (i % (side - 1) + i / (side - 1) * side) as u32);
    let next = side as u32;
    let triangles = cells.flat_map(|i| [[i, i + 1, i + next], [i + 1, i + next + 1, i + next]]).collect();
    let mesh = Mesh { positions, triangles };
    let tree = DualBvh::build(mesh.positions.clone().into(), mesh.triangles.clone().into(), &BuildOptions::default());
    let tree = tree.unwrap();
    let receivers = [dvec3(3.0, 7.0, 9.0), dvec3(100.0, 80.0, 2.0), dvec3(60.3, 59.7, 1.0)];
    let many: Vec<u32> = (0..mesh.triangles.len() as u32).step_by(9).collect();
    for excluded in [&[][..], &[5, 6, 20_011], &many] {
        let tile = Tile::new(receivers.map(|p| (p, None)).into_iter());
        let mut everything = Candidates::default();
        tree.all_edges(&mut everything);
        let found = search(&tree, &tile.with_faces(excluded));
        assert!(found.edges().len() > 30_000, "{}", found.edges().len());
        for receiver in receivers {
            let expected = brute(&mesh, receiver, excluded);
            assert_eq!(contours(&found, receiver, excluded), expected);
            assert_eq!(contours(&everything, receiver, excluded), expected);
        }
    }
}
