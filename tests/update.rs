//! What of a bake still holds after something has moved: sound against a bake of the whole new scene.

#[path = "common/scenes.rs"]
mod scenes;

use glam::{DAffine3, DQuat, DVec3};
use scenes::Random;
use silhouette::Arrays;
use silhouette::bake::{Array, Changes, Method, Outcome, Partial, Provenance, Receivers, Request, integrate};
use silhouette::scene::{Geometry, GeometryBuilder, shapes};

/// A floor, a wall of one face each way across it, and small boxes on both sides; the last `moved` of them stand elsewhere if
/// `after`.
fn scene(seed: u64, moved: usize, after: bool) -> Geometry {
    let mut random = Random(seed);
    let mut builder = GeometryBuilder::default();
    let floor = shapes::Plane { size: [12.0; 2], divisions: [24; 2] };
    builder.add(floor.mesh().unwrap(), DAffine3::IDENTITY).unwrap();
    let wall = shapes::Cuboid { size: [0.2, 6.0, 30.0], divisions: 1 };
    builder.add(wall.mesh().unwrap(), DAffine3::from_translation(DVec3::new(0.0, 3.001, 0.0))).unwrap();
    let count = 12;
    for i in 0..count {
        let [x, z, turn, size] = [(); 4].map(|()| random.between(0.0, 1.0));
        let [dx, dz, lift] = [(); 3].map(|()| random.between(-0.5, 0.5));
        let side = if i % 2 == 0 || i + moved >= count { 1.0 } else { -1.0 };
        let mut place = DVec3::new(side * (1.0 + 4.0 * x), 0.7, 9.0 * z - 4.5);
        if after && i + moved >= count {
            place += DVec3::new(0.4 * dx, 0.2 * lift, 3.0 * dz);
        }
        let shape = shapes::Cuboid { size: [0.3 + 0.7 * size; 3], divisions: 2 };
        let rotation = DQuat::from_rotation_y(3.0 * turn);
        builder.add(shape.mesh().unwrap(), DAffine3::from_rotation_translation(rotation, place)).unwrap();
    }
    builder.build()
}

fn bake(geometry: &Geometry, receivers: &Receivers, method: Method, known: Option<Partial>) -> Outcome {
    let request = Request { ambient_occlusion: true, visibility_sh: true, ..Request::default() };
    integrate(geometry, None, receivers, &request, method, known, &()).unwrap()
}

/// A result as a file has it.
fn with_points(mut arrays: Arrays, receivers: &Receivers) -> Arrays {
    for (name, vectors) in [("positions", &receivers.positions), ("normals", &receivers.normals)] {
        let data = vectors.iter().flat_map(|v| v.to_array()).collect();
        arrays.push(Array::new(name, [vectors.len(), 3], data)).unwrap();
    }
    arrays
}

#[test]
fn what_is_kept_is_what_a_whole_bake_finds() {
    for (seed, method) in
        [(1, Method::Exact), (2, Method::Exact), (3, Method::Exact), (4, Method::Isolines { lines: 64 })]
    {
        let (before, after) = (scene(seed, 1, false), scene(seed, 1, true));
        let [old_receivers, receivers] = [&before, &after].map(|geometry| Receivers::vertices(geometry).0);
        let old = with_points(bake(&before, &old_receivers, method, None).arrays, &old_receivers);
        let changes = Changes::between(&before, &after);
        let part = changes.still_valid(&old, &receivers, &Provenance::default()).unwrap();
        let kept = part.finished();
        // Behind the wall, at least what is on the floor and lower than what moves.
        assert!(5 * kept > receivers.len() && kept < receivers.len(), "seed {seed}: {kept} of {}", receivers.len());
        let updated = bake(&after, &receivers, method, Some(part));
        assert_eq!(updated.statistics.receivers as usize, receivers.len() - kept);
        assert_eq!(updated.statistics.skipped["finished_before"] as usize, kept);
        let whole = bake(&after, &receivers, method, None);
        assert!(updated.arrays == whole.arrays, "seed {seed}");
    }
}

#[test]
fn nothing_moved_keeps_everything_and_all_moved_nothing() {
    let geometry = scene(3, 0, false);
    let (receivers, _) = Receivers::vertices(&geometry);
    let mut arrays = Arrays::new();
    arrays.push(Array::new("ambient_occlusion", [receivers.len()], vec![0.5; receivers.len()])).unwrap();
    let old = with_points(arrays, &receivers);
    let same = Changes::between(&geometry, &geometry);
    assert!(same.is_empty());
    let part = same.still_valid(&old, &receivers, &Provenance::default()).unwrap();
    assert_eq!(part.finished(), receivers.len());
    assert_eq!(part.arrays.get("ambient_occlusion"), old.get("ambient_occlusion"));
    let elsewhere = GeometryBuilder::default().build();
    let changes = Changes::between(&elsewhere, &geometry);
    assert_eq!(changes.still_valid(&old, &receivers, &Provenance::default()).unwrap().finished(), 0);
}

#[test]
fn what_is_no_bake_is_told() {
    let geometry = scene(3, 0, false);
    let (receivers, _) = Receivers::vertices(&geometry);
    let changes = Changes::between(&geometry, &geometry);
    let message =
        |arrays: &Arrays| changes.still_valid(arrays, &receivers, &Provenance::default()).unwrap_err().to_string();
    assert!(message(&Arrays::new()).contains("no array `positions`"));
    let mut arrays = Arrays::new();
    arrays.push(Array::new("ambient_occlusion", [2], vec![0.5; 2])).unwrap();
    assert!(message(&with_points(arrays, &receivers)).contains("ambient_occlusion: not one row for each"));
}
