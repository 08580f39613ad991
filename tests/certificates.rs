//! The estimates of error beside every result: do they bound the true error, and follow it?

#[path = "common/scenes.rs"]
mod scenes;

use glam::{DAffine3, DVec3, Vec3};
use scenes::{Random, run, values};
use silhouette::bake::{Arrays, Method, Receivers};
use silhouette::scene::shapes::{Cuboid, Foliage, Icosphere, Plane, TorusKnot};
use silhouette::scene::{Environment, Geometry, GeometryBuilder};

/// Shapes of many kinds anywhere around the origin, some over a plane.
fn scene(random: &mut Random) -> Geometry {
    let mut builder = GeometryBuilder::default();
    for i in 0..7 {
        let mesh = match i % 4 {
            0 => Icosphere { subdivisions: 2, ..Icosphere::default() }.mesh(),
            1 => Cuboid::default().mesh(),
            2 => TorusKnot { triangles: 900, ..TorusKnot::default() }.mesh(),
            _ => Foliage { triangles: 40, leaf: 0.4, ..Foliage::default() }.mesh(),
        };
        let place = random.direction() * random.between(1.5, 4.0);
        let scale = DVec3::splat(random.between(0.2, 0.8));
        let transform = DAffine3::from_scale_rotation_translation(scale, random.rotation(), place);
        builder.add(mesh.unwrap(), transform).unwrap();
    }
    if random.between(0.0, 1.0) < 0.5 {
        let transform = DAffine3::from_translation(DVec3::new(0.0, -1.2, 0.0));
        builder.add(Plane::default().mesh().unwrap(), transform).unwrap();
    }
    builder.build()
}

/// A sun, a gradient and a horizon.
fn environment() -> Environment {
    let pixels: Vec<Vec3> = (0..48 * 24)
        .map(|i| match (i % 48, i / 48) {
            (30, 6) => Vec3::new(60.0, 50.0, 40.0),
            (_, y) if y >= 12 => Vec3::splat(0.2),
            (x, y) => Vec3::new(1.0, 0.5 + x as f32 / 48.0, 2.0 - y as f32 / 12.0),
        })
        .collect();
    Environment::new(48, 24, pixels).unwrap()
}

const ARRAYS: [&str; 5] = ["ambient_occlusion", "visibility_sh", "transfer_sh", "irradiance", "vector_irradiance"];

/// For every array: (largest error, estimate) of each receiver.
fn pairs(found: &Arrays, truth: &Arrays, receivers: usize) -> Vec<(&'static str, Vec<(f64, f64)>)> {
    ARRAYS
        .map(|name| {
            let (found, truth) = ((values(found, name), values(found, &format!("{name}_error"))), values(truth, name));
            let width = truth.len() / receivers;
            let rows = found.0.chunks(width).zip(truth.chunks(width)).zip(found.1.chunks(width));
            let worst = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0f64, f64::max);
            let pairs = rows.map(|((found, truth), errors)| {
                let error = worst(&mut found.iter().zip(truth).map(|(a, b)| (a - b).abs()));
                (error, worst(&mut errors.iter().copied()))
            });
            (name, pairs.collect())
        })
        .into()
}

/// Pearson's correlation of the logarithms.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let logs: Vec<(f64, f64)> =
        pairs.iter().filter(|(a, b)| *a > 0.0 && *b > 0.0).map(|(a, b)| (a.ln(), b.ln())).collect();
    let count = logs.len() as f64;
    let (x, y) = logs.iter().fold((0.0, 0.0), |(x, y), (a, b)| (x + a / count, y + b / count));
    let sums = logs
        .iter()
        .fold([0.0; 3], |[xx, xy, yy], (a, b)| [xx + (a - x).powi(2), xy + (a - x) * (b - y), yy + (b - y).powi(2)]);
    sums[1] / (sums[0] * sums[2]).sqrt()
}

#[test]
fn isolines_know_their_error() {
    let light = environment();
    let mut random = Random(7);
    let mut all: Vec<(&str, Vec<(f64, f64)>)> = ARRAYS.map(|name| (name, Vec::new())).into();
    for _ in 0..6 {
        let geometry = scene(&mut random);
        let receivers = Receivers::points(
            (0..60).map(|_| (random.direction() * random.between(0.0, 1.0), random.direction())).collect::<Vec<_>>(),
        );
        let truth = run(&geometry, Some(&light), &receivers, 4, Method::Exact).arrays;
        for lines in [16, 64, 256] {
            let found = run(&geometry, Some(&light), &receivers, 4, Method::Isolines { lines }).arrays;
            for (all, (_, new)) in all.iter_mut().zip(pairs(&found, &truth, receivers.len())) {
                all.1.extend(new);
            }
        }
    }
    for (name, pairs) in &all {
        let bounded = pairs.iter().filter(|(error, estimate)| error <= estimate).count();
        assert!(bounded * 100 >= pairs.len() * 99, "{name}: {bounded} of {}", pairs.len());
        let correlation = correlation(pairs);
        assert!(correlation > 0.55, "{name}: {correlation}");
        // A bound that is never near is no bound: half of the errors are above a hundredth of it.
        let near = pairs.iter().filter(|(error, estimate)| 100.0 * error > *estimate).count();
        assert!(near * 2 >= pairs.len(), "{name}: {near} of {}", pairs.len());
    }
}

/// The same scene turned: another pole, another sweep, other roundings. What does not turn with it tells the error.
#[test]
fn the_exact_method_knows_its_error() {
    let mut random = Random(11);
    let (mut bounded, mut count, mut worst) = (0, 0, 0.0f64);
    for _ in 0..4 {
        let geometry = scene(&mut random);
        let points: Vec<_> =
            (0..100).map(|_| (random.direction() * random.between(0.0, 1.0), random.direction())).collect();
        // Quarter turns and mirrors keep every coordinate's bits.
        let turn = |v: DVec3| DVec3::new(v.z, v.x, -v.y);
        let positions = geometry.positions.iter().map(|p| turn(p.as_dvec3()).as_vec3()).collect();
        let turned = Geometry { positions, ..geometry.clone() };
        let found = run(&geometry, None, &Receivers::points(points.clone()), 4, Method::Exact);
        let other_points = points.iter().map(|&(p, n)| (turn(p), turn(n)));
        let other = run(&turned, None, &Receivers::points(other_points), 4, Method::Exact);
        for outcome in [&found, &other] {
            assert_eq!(outcome.statistics.depth_alarms, 0);
        }
        let [a, b] = [&found.arrays, &other.arrays].map(|arrays| values(arrays, "ambient_occlusion"));
        let [ea, eb] = [&found.arrays, &other.arrays].map(|arrays| values(arrays, "ambient_occlusion_error"));
        for i in 0..points.len() {
            let error = (a[i] - b[i]).abs();
            worst = worst.max(error);
            bounded += usize::from(error <= ea[i] + eb[i]);
            count += 1;
            assert!(ea[i] < 1e-10, "an estimate of {:e} is no use", ea[i]);
        }
    }
    assert!(worst < 1e-11, "{worst:e}");
    assert!(bounded * 100 >= count * 99, "{bounded} of {count}");
}
