//! What a tree can be built from, and that nothing but the input decides how.

#[path = "../benches/meshes/mod.rs"]
mod meshes;

use dual_bvh::{BuildOptions, Candidates, Contours, DualBvh, Error, Tile};
use glam::{DVec3, Vec3, vec3};
use meshes::Mesh;

fn error(positions: &[Vec3], triangles: &[[u32; 3]]) -> Error {
    DualBvh::build(positions.into(), triangles.into(), &BuildOptions::default()).expect_err("the mesh is bad")
}

#[test]
fn bad_faces_are_named() {
    let square = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
    let good = [0, 1, 2];
    assert_eq!(error(&square, &[good, [0, 4, 2]]), Error::Index { face: 1, vertex: 4, vertices: 4 });
    assert_eq!(error(&square, &[good, good, [3, 2, 3]]), Error::Corner { face: 2, vertex: 3 });
    assert_eq!(error(&square, &[good, [1, 1, 2]]), Error::Corner { face: 1, vertex: 1 });
    assert_eq!(error(&[], &[[0, 1, 2]]), Error::Index { face: 0, vertex: 0, vertices: 0 });
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut positions = square;
        positions[3].y = bad;
        assert_eq!(error(&positions, &[good, [0, 2, 3]]), Error::Position { face: 1, vertex: 3 });
        // Nobody's vertex does no harm.
        assert!(DualBvh::build(positions.into(), [good].into(), &BuildOptions::default()).is_ok());
    }
    let message = error(&square, &[good, [0, 4, 2]]).to_string();
    assert_eq!(message, "face 1 refers to vertex 4, but there are only 4 vertices; fix its indices");
}

#[test]
fn bad_options_are_named() {
    for weight in [f32::NAN, f32::INFINITY, -1.0] {
        let mut options = BuildOptions::default();
        options.normal_weight = weight;
        let error = DualBvh::build([].into(), [].into(), &options).expect_err("the option is bad");
        assert!(matches!(error, Error::Option { name: "normal_weight", .. }));
    }
}

#[test]
fn no_faces_have_no_contours() {
    for positions in [vec![], vec![Vec3::ONE]] {
        let tree = DualBvh::build(positions.into(), [].into(), &BuildOptions::default()).expect("nothing is wrong");
        assert_eq!((tree.edge_count(), tree.check()), (0, Ok(())));
        let (mut candidates, mut contours) = (Candidates::default(), Contours::default());
        tree.search(&Tile::new(std::iter::empty()).with_faces(&[0, 7]), &mut candidates);
        candidates.contours(DVec3::ZERO, &[3], &mut contours);
        assert!(candidates.edges().is_empty() && contours.edges().is_empty());
    }
}

#[test]
fn trees_of_all_sizes_are_sound() {
    // The numbers of edges pass those at which leaves, nodes and levels are full.
    for cells in (1..12).chain([20, 21, 22, 40]) {
        let tree = meshes::plane(1.0, cells).tree();
        assert_eq!(tree.check(), Ok(()), "{cells} x {cells}");
        assert_eq!(tree.edge_count(), (3 * cells * cells + 2 * cells) as usize);
    }
    for mesh in [meshes::sphere_over_plane(4), meshes::knots(10, 5), meshes::foliage(3000)] {
        assert_eq!(mesh.tree().check(), Ok(()));
    }
}

#[test]
fn extreme_coordinates_are_sound() {
    let mut mesh = meshes::icosphere(2);
    for scale in [f32::MAX, 1e30, 1e-30, 1e-38, f32::from_bits(1)] {
        let scaled: Vec<Vec3> = mesh.positions.iter().map(|&p| p * scale).collect();
        let tree = Mesh { positions: scaled, ..mesh.clone() }.tree();
        assert_eq!(tree.check(), Ok(()), "{scale}");
        let (mut candidates, mut contours) = (Candidates::default(), Contours::default());
        let receiver = f64::from(scale) * DVec3::new(0.3, 1.2, 2.0);
        tree.search(&Tile::lone(receiver, None), &mut candidates);
        candidates.contours(receiver, &[], &mut contours);
        let expected = dual_bvh::brute_force(tree.positions(), tree.triangles(), receiver, &[]);
        assert_eq!(contours.edges().len(), expected.len(), "{scale}");
    }
    mesh.positions.iter_mut().for_each(|p| *p = vec3(1.0, 2.0, 3.0));
    assert_eq!(mesh.tree().check(), Ok(()));
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let mesh = meshes::knots(20, 5);
    let candidates = [1, 2, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        let tree = pool.install(|| mesh.tree());
        let mut candidates = Candidates::default();
        tree.search(&Tile::lone(DVec3::new(0.1, 0.2, 3.0), None), &mut candidates);
        (0..tree.edge_count() as u32).map(|edge| tree.edge_vertices(edge)).for_each(|edge| assert!(edge[0] < edge[1]));
        let edges: Vec<[u32; 2]> = (0..tree.edge_count() as u32).map(|edge| tree.edge_vertices(edge)).collect();
        (edges, candidates.edges().to_vec(), candidates.vertices().to_vec(), candidates.faces().to_vec())
    });
    assert!(candidates[0] == candidates[1] && candidates[0] == candidates[2]);
}

#[test]
fn one_memory_serves_many_trees() {
    // Larger, smaller, and larger again: what earlier searches left must not show.
    let trees = [meshes::knots(10, 5), meshes::icosphere(1), meshes::foliage(2000), meshes::sphere_over_plane(3)]
        .map(|mesh| mesh.tree());
    let mut reused = (Candidates::default(), Contours::default());
    for (i, tree) in trees.iter().chain(&trees).enumerate() {
        let receiver = DVec3::new(0.3 * i as f64, 0.7, 1.1);
        let mut fresh = (Candidates::default(), Contours::default());
        let excluded = [3, 7, 3];
        for (candidates, contours) in [&mut reused, &mut fresh] {
            let excluded: &[u32] = if i % 2 == 0 { &excluded } else { &[] };
            tree.search(&Tile::lone(receiver, None).with_faces(excluded), candidates);
            candidates.contours(receiver, excluded, contours);
        }
        assert_eq!(reused.0.edges(), fresh.0.edges());
        assert_eq!(reused.0.incidences(), fresh.0.incidences());
        assert_eq!(reused.0.vertices(), fresh.0.vertices());
        assert_eq!(reused.0.coordinates(), fresh.0.coordinates());
        assert_eq!(reused.0.faces(), fresh.0.faces());
        assert_eq!(reused.1.signs(), fresh.1.signs());
        assert_eq!(reused.1.edges(), fresh.1.edges());
    }
}

#[test]
fn candidates_describe_their_edges() {
    let mesh = meshes::sphere_over_plane(3);
    let tree = mesh.tree();
    let mut candidates = Candidates::default();
    tree.search(&Tile::new([(DVec3::ZERO, None), (DVec3::new(0.3, 0.0, 0.1), None)].into_iter()), &mut candidates);
    assert!(!candidates.edges().is_empty());
    for (local, &vertex) in candidates.vertices().iter().enumerate() {
        assert_eq!(candidates.position(local as u32), mesh.positions[vertex as usize].as_dvec3());
    }
    for (local, &face) in candidates.faces().iter().enumerate() {
        let [a, b, c] = mesh.triangles[face as usize].map(|vertex| mesh.positions[vertex as usize]);
        assert_eq!(candidates.normal(local as u32), dual_bvh::face_normal(a, b, c));
        assert_eq!(candidates.anchor(local as u32), a.as_dvec3());
        assert_eq!(candidates.local_face(face), Some(local as u32));
    }
    for (number, edge) in candidates.edges().iter().enumerate() {
        let [a, b] = [edge.a, edge.b].map(|end| candidates.vertices()[end as usize]);
        assert!(a < b);
        for use_ in candidates.faces_of(number as u32) {
            let corners = mesh.triangles[candidates.faces()[use_.face() as usize] as usize];
            let along = (0..3).any(|i| corners[i] == a && corners[(i + 1) % 3] == b);
            let against = (0..3).any(|i| corners[i] == b && corners[(i + 1) % 3] == a);
            assert_eq!((along, against), (use_.orientation() == 1, use_.orientation() == -1));
        }
    }
}
