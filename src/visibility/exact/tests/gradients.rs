//! Derivatives by the receiver's position against closed forms, differences and invariances.

use std::f64::consts::PI;

use glam::{DMat3, DQuat, DVec3};

use super::scenes::{Random, Triangle, contours, cuboid, depth, knot, quad, sphere};
use super::{exact, order};
use crate::sphere::{Order, rotate};
use crate::visibility::exact::{Scratch, solve};

/// Rounding of some tens of arcs at distances about 1.
const EXACT: f64 = 1e-12;

/// Gradients of the ambient occlusion (zero for receivers without a normal) and of SH of 11 bands.
#[derive(Clone, Debug)]
struct Gradient {
    cosine: DVec3,
    harmonics: Vec<DVec3>,
}

impl Gradient {
    fn distance(&self, other: &Gradient) -> f64 {
        let pairs = self.harmonics.iter().zip(&other.harmonics).chain([(&self.cosine, &other.cosine)]);
        let differences = pairs.map(|(a, b)| (*a - *b).length());
        differences.fold(0.0, |worst, d| if d > worst || d.is_nan() { d } else { worst })
    }

    fn combine(&self, other: &Gradient, f: impl Fn(DVec3, DVec3) -> DVec3) -> Gradient {
        let harmonics = self.harmonics.iter().zip(&other.harmonics).map(|(a, b)| f(*a, *b)).collect();
        Gradient { cosine: f(self.cosine, other.cosine), harmonics }
    }

    fn is_zero(&self) -> bool {
        self.cosine == DVec3::ZERO && self.harmonics.iter().all(|g| *g == DVec3::ZERO)
    }
}

fn gradient(triangles: &[Triangle], receiver: DVec3, normal: Option<DVec3>) -> Gradient {
    let contours = contours(triangles, receiver, normal);
    let mut scratch = Scratch::default();
    let region = solve(&contours, normal, 0, |w| depth(triangles, receiver, w), &mut scratch);
    assert!(!region.residuals().alarm(), "{:?}", region.residuals());
    let mut harmonics = vec![DVec3::NAN; order().len()];
    region.harmonics_gradient(&contours, order(), &mut harmonics);
    let cosine = normal.map_or(DVec3::ZERO, |n| region.cosine_gradient(&contours, n));
    Gradient { cosine, harmonics }
}

/// Central differences extrapolated to step 0 from three steps, and the error they own up to: four times the change by the
/// last extrapolation, and rounding.
fn differences(triangles: &[Triangle], receiver: DVec3, normal: Option<DVec3>, step: f64) -> (Gradient, f64) {
    /// Errors of the values that are subtracted from each other, with the extrapolation's weights.
    const ROUNDING: f64 = 2e-13;
    let central = |step: f64| {
        let axes = DVec3::AXES.map(|axis| {
            let [ahead, behind] = [step, -step].map(|h| exact(triangles, receiver + h * axis, normal));
            let cosine = |v: DVec3| normal.map_or(0.0, |n| n.dot(v)) / PI;
            let slope = (cosine(ahead.vector_area) - cosine(behind.vector_area)) / (2.0 * step);
            let pairs = ahead.harmonics.iter().zip(&behind.harmonics);
            (slope, pairs.map(|(a, b)| (a - b) / (2.0 * step)).collect::<Vec<_>>())
        });
        let [x, y, z] = &axes;
        let harmonics = (0..order().len()).map(|i| DVec3::new(x.1[i], y.1[i], z.1[i])).collect();
        Gradient { cosine: DVec3::new(x.0, y.0, z.0), harmonics }
    };
    let [coarse, middle, fine] = [step, 0.5 * step, 0.25 * step].map(central);
    let first = coarse.combine(&middle, |a, b| (4.0 * b - a) / 3.0);
    let second = middle.combine(&fine, |a, b| (4.0 * b - a) / 3.0);
    let best = first.combine(&second, |a, b| (16.0 * b - a) / 15.0);
    let error = 4.0 * best.distance(&first) + ROUNDING / step;
    (best, error)
}

/// Whether the planes of all faces pass at a distance, so that gradients are continuous within it.
fn is_generic(triangles: &[Triangle], receiver: DVec3, distance: f64) -> bool {
    triangles.iter().all(|[a, b, c]| (*b - *a).cross(*c - *a).normalize().dot(receiver - *a).abs() > distance)
}

/// Compares with differences at many receivers; half of these must be sharp.
fn agrees_with_differences(triangles: &[Triangle], receivers: &[(DVec3, Option<DVec3>)]) {
    const STEP: f64 = 2e-4;
    let mut sharpness = Vec::new();
    for &(p, normal) in receivers.iter().filter(|&&(p, _)| is_generic(triangles, p, 2.0 * STEP)) {
        let (expected, tolerance) = differences(triangles, p, normal, STEP);
        let distance = gradient(triangles, p, normal).distance(&expected);
        assert!(distance <= tolerance, "{distance:e} > {tolerance:e} at {p} {normal:?}");
        sharpness.push(tolerance);
    }
    sharpness.sort_by(f64::total_cmp);
    assert!(sharpness.len() >= 5 && sharpness[sharpness.len() / 2] < 1e-7, "{sharpness:?}");
}

/// Receivers in a box, every third without a normal.
fn receivers(seed: u64, count: usize, centre: DVec3, half: DVec3) -> Vec<(DVec3, Option<DVec3>)> {
    let mut random = Random(seed);
    let receiver = |i| (centre + half * random.vector(), (i % 3 > 0).then(|| random.direction()));
    (0..count).map(receiver).collect()
}

#[test]
fn ball_over_a_plane() {
    let ground = quad(
        DVec3::new(-4.0, -4.0, 0.0),
        DVec3::new(4.0, -4.0, 0.0),
        DVec3::new(4.0, 4.0, 0.0),
        DVec3::new(-4.0, 4.0, 0.0),
    );
    let mut scene = sphere(DVec3::new(0.1, 0.2, 1.3), 0.7, 1);
    scene.extend(ground);
    agrees_with_differences(&scene, &receivers(31, 12, DVec3::new(0.0, 0.0, 0.8), DVec3::new(2.0, 2.0, 0.7)));
    // Upright normals on the ground itself.
    let scene = &scene[..scene.len() - 2];
    let on_ground =
        receivers(32, 10, DVec3::ZERO, DVec3::new(2.0, 2.0, 0.0)).into_iter().map(|(p, _)| (p, Some(DVec3::Z)));
    agrees_with_differences(scene, &on_ground.collect::<Vec<_>>());
}

#[test]
fn boxes() {
    let mut scene = cuboid(DVec3::new(-1.0, -2.0, 0.0), DVec3::new(-0.3, 0.5, 1.1));
    scene.extend(cuboid(DVec3::new(0.6, -1.0, -0.2), DVec3::new(1.4, 0.3, 0.7)));
    scene.extend(cuboid(DVec3::new(-0.5, 1.0, 0.1), DVec3::new(0.8, 1.7, 2.0)));
    agrees_with_differences(&scene, &receivers(33, 15, DVec3::new(0.1, 0.2, 0.6), DVec3::new(0.4, 0.6, 0.9)));
}

#[test]
fn scattered_triangles() {
    let mut random = Random(34);
    for count in [1, 3, 10, 25] {
        let scene = random.soup(count, 1.0);
        agrees_with_differences(&scene, &receivers(35 + count as u64, 9, DVec3::ZERO, DVec3::splat(1.0)));
    }
}

/// Limbs of a walking machine: many bodies, some of them touching or running into each other.
#[test]
fn many_bodies() {
    let mut random = Random(36);
    let mut scene = Vec::new();
    for i in 0..12 {
        let turn = DMat3::from_quat(DQuat::from_axis_angle(random.direction(), 6.0 * random.number()));
        let centre = 1.5 * random.vector();
        let size = 0.1 + 0.5 * DVec3::new(random.number(), random.number(), random.number());
        scene.extend(cuboid(-size, size).iter().map(|t| t.map(|corner| centre + turn * corner)));
        if i % 4 == 0 {
            scene.extend(sphere(centre + size.x * turn.x_axis, 0.3, 1));
        }
    }
    scene.extend(knot(DVec3::new(0.0, 0.0, -1.0), 0.3, 24, 6));
    agrees_with_differences(&scene, &receivers(37, 14, DVec3::ZERO, DVec3::splat(2.5)));
}

/// Above the receiver a rectangle at height h from (-x1, -y1) to (x2, y2): four quarters, each Howell's B-3, whose
/// derivative by X = x/h is (atan(Y/p)/p^3 + Y/(p^2 (1 + X^2 + Y^2))) / (2 pi), p^2 = 1 + X^2.
#[test]
fn rectangle_overhead() {
    let slope = |x: f64, y: f64| {
        let p = (1.0 + x * x).sqrt();
        ((y / p).atan() / p.powi(3) + y / (p * p * (1.0 + x * x + y * y))) / (2.0 * PI)
    };
    for ([x1, y1], [x2, y2], h) in
        [([1.0, 1.0], [1.0, 1.0], 1.0), ([0.2, 0.5], [1.3, 0.7], 0.4), ([3.0, 0.1], [20.0, 5.0], 2.5)]
    {
        let rectangle =
            quad(DVec3::new(-x1, -y1, h), DVec3::new(x2, -y1, h), DVec3::new(x2, y2, h), DVec3::new(-x1, y2, h));
        // Occlusion's derivatives by the four sides; the rectangle's far side approaches as the receiver moves.
        let [x1, y1, x2, y2] = [x1, y1, x2, y2].map(|side| side / h);
        let by_x1 = slope(x1, y1) + slope(x1, y2);
        let by_x2 = slope(x2, y1) + slope(x2, y2);
        let by_y1 = slope(y1, x1) + slope(y1, x2);
        let by_y2 = slope(y2, x1) + slope(y2, x2);
        let by_height = x1 * by_x1 + x2 * by_x2 + y1 * by_y1 + y2 * by_y2;
        let expected = -DVec3::new(by_x1 - by_x2, by_y1 - by_y2, by_height) / h;
        let result = gradient(&rectangle, DVec3::ZERO, Some(DVec3::Z)).cosine;
        assert!((result - expected).length() < EXACT, "{result} {expected}");
    }
}

/// A wall up to height k at distance d, infinitely wide: (1 + d/sqrt(d^2 + k^2)) / 2, and nothing changes along it.
#[test]
fn wall() {
    let width = 1e9;
    for (k, d) in [(0.1, 1.0), (1.0, 1.0), (30.0, 2.0)] {
        let corner = |y: f64, z: f64| DVec3::new(d, y, z);
        let wall = quad(corner(-width, -1.0), corner(width, -1.0), corner(width, k), corner(-width, k));
        let result = gradient(&wall, DVec3::ZERO, Some(DVec3::Z));
        let expected = 0.5 * k / d.hypot(k).powi(3) * DVec3::new(-k, 0.0, d);
        // The ends, at the width's distance, move by its inverse.
        assert!((result.cosine - expected).length() < 10.0 / width, "{} {expected}", result.cosine);
        assert!(result.harmonics.iter().all(|g| g.y.abs() < 10.0 / width));
        assert!(result.harmonics.iter().any(|g| g.length() > 1e-3));
    }
}

/// Bars without end, in any direction and number: nothing changes along them.
#[test]
fn along_bars() {
    let mut random = Random(38);
    let length = 1e6;
    for normal in [None, Some(random.direction())] {
        let along = random.direction();
        let (u, v) = along.any_orthonormal_pair();
        let bar = |_| {
            let centre = 2.0 * (random.number() - 0.5) * u + 2.0 * (random.number() - 0.5) * v;
            let [a, b, c] = [(); 3].map(|()| centre + 0.6 * (random.number() * u + random.number() * v));
            let side = |p: DVec3, q: DVec3| {
                let end = length * along;
                quad(p - end, q - end, q + end, p + end)
            };
            [side(a, b), side(b, c), side(c, a)].concat()
        };
        let scene: Vec<Triangle> = (0..4).flat_map(bar).collect();
        let result = gradient(&scene, DVec3::ZERO, normal);
        assert!(result.harmonics.iter().chain([&result.cosine]).all(|g| g.dot(along).abs() < 10.0 / length));
        assert!(result.harmonics.iter().any(|g| g.length() > 0.01));
    }
}

/// The gradient of what a triangle hides is the law of Biot and Savart: the sum over its edges of
/// (a x b) (|a| + |b|) / (|a| |b| (|a| |b| + a.b)), seen counter-clockwise.
#[test]
fn solid_angle_of_a_triangle() {
    let mut random = Random(39);
    for _ in 0..50 {
        let mut triangle = random.soup(1, 1.5)[0];
        let [a, b, c] = triangle;
        if a.dot(b.cross(c)) < 0.0 {
            triangle.swap(1, 2);
        }
        let edges = (0..3).map(|k| {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            let (la, lb) = (a.length(), b.length());
            a.cross(b) * (la + lb) / (la * lb * (la * lb + a.dot(b)))
        });
        let expected = -edges.sum::<DVec3>();
        let result = gradient(&[triangle], DVec3::ZERO, None).harmonics[0] * (4.0 * PI).sqrt();
        assert!((result - expected).length() < EXACT * expected.length().max(1.0), "{result} {expected}");
    }
}

/// The cosine is a harmonic of band 1.
#[test]
fn cosine_follows_from_the_harmonics() {
    let mut random = Random(40);
    for _ in 0..10 {
        let scene = random.soup(12, 1.0);
        let n = random.direction();
        let Gradient { cosine, harmonics } = gradient(&scene, DVec3::ZERO, Some(n));
        let expected = (n.y * harmonics[1] + n.z * harmonics[2] + n.x * harmonics[3]) / (0.75 / PI).sqrt() / PI;
        assert!((cosine - expected).length() < EXACT * cosine.length().max(1.0), "{cosine} {expected}");
    }
}

#[test]
fn open_and_enclosed_receivers_have_none() {
    let room = cuboid(DVec3::splat(-1.0), DVec3::new(2.0, 1.0, 3.0));
    let below = quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::new(1.0, 0.0, -1.0), DVec3::new(1.0, 1.0, -2.0), DVec3::NEG_Z);
    for normal in [None, Some(DVec3::Z), Some(DVec3::new(0.36, 0.48, 0.8))] {
        assert!(gradient(&[], DVec3::ZERO, normal).is_zero());
        assert!(gradient(&room, DVec3::splat(0.3), normal).is_zero());
    }
    assert!(gradient(&below, DVec3::ZERO, Some(DVec3::Z)).is_zero());
    assert!(!gradient(&below, DVec3::ZERO, None).is_zero());
}

/// What a room without ceiling shows is what the ceiling would hide.
#[test]
fn visible_and_blocked_cancel() {
    let (low, high) = (DVec3::new(-1.0, -2.0, 0.0), DVec3::new(1.5, 1.0, 1.2));
    let is_lid = |t: &Triangle| t.iter().all(|corner| corner.z == high.z);
    let (lid, room): (Vec<_>, Vec<_>) = cuboid(low, high).into_iter().partition(is_lid);
    let mut random = Random(41);
    for i in 0..10 {
        let p = DVec3::new(random.number(), -random.number(), 1.1 * random.number());
        let n = (i % 3 > 0).then(|| random.direction());
        let (visible, blocked) = (gradient(&room, p, n), gradient(&lid, p, n));
        let sum = visible.combine(&blocked, |a, b| a + b);
        let zero = visible.combine(&visible, |a, b| a - b);
        let size = visible.distance(&zero);
        assert!(size > 0.1 || n.is_some_and(|n| n.z < 0.0));
        assert!(sum.distance(&zero) < EXACT * size.max(1.0), "{:e}", sum.distance(&zero));
    }
}

fn scene() -> Vec<Triangle> {
    let mut faces = knot(DVec3::new(0.0, 0.0, 1.5), 0.5, 40, 8);
    faces.extend(knot(DVec3::new(2.5, 1.0, 1.5), 0.5, 40, 8));
    faces.extend(sphere(DVec3::new(-2.0, 1.0, 1.0), 0.8, 2));
    faces
}

/// The horizon does not move, so those of two opposite hemispheres make that of the sphere.
#[test]
fn hemispheres_add_up() {
    let faces = scene();
    for (p, normal) in receivers(42, 9, DVec3::ZERO, DVec3::splat(2.0)) {
        let n = normal.unwrap_or(DVec3::Z);
        let [up, down, all] = [Some(n), Some(-n), None].map(|normal| gradient(&faces, p, normal));
        let sum = up.combine(&down, |a, b| a + b);
        let all = Gradient { cosine: sum.cosine, ..all };
        assert!(sum.distance(&all) < EXACT * 10.0, "{:e}", sum.distance(&all));
    }
}

/// Turned with the scene, and by the scale's inverse as that grows: to the bit for a power of two.
#[test]
fn rotation_and_scale() {
    let mut random = Random(43);
    let faces = scene();
    for (p, normal) in receivers(44, 9, DVec3::ZERO, DVec3::splat(2.0)) {
        let result = gradient(&faces, p, normal);

        let turn = DMat3::from_quat(DQuat::from_axis_angle(random.direction(), 6.0 * random.number()));
        let turned: Vec<Triangle> = faces.iter().map(|t| t.map(|corner| turn * corner)).collect();
        let other = gradient(&turned, turn * p, normal.map(|n| turn * n));
        let length = Order::MAX.len();
        let axes = DVec3::AXES.map(|axis| {
            let along: Vec<f64> = result.harmonics[..length].iter().map(|g| (turn * *g).dot(axis)).collect();
            let mut rotated = vec![0.0; length];
            rotate(Order::MAX, turn, &along, &mut rotated);
            rotated
        });
        let harmonics = (0..length).map(|i| DVec3::new(axes[0][i], axes[1][i], axes[2][i])).collect();
        let expected = Gradient { cosine: turn * result.cosine, harmonics };
        assert!(other.distance(&expected) < EXACT * 10.0, "{:e}", other.distance(&expected));

        let scale = 2f64.powi(40);
        let scaled: Vec<Triangle> = faces.iter().map(|t| t.map(|corner| scale * corner)).collect();
        let other = gradient(&scaled, scale * p, normal);
        assert_eq!(
            other.combine(&result, |a, b| scale * a - b).distance(&other.combine(&result, |_, _| DVec3::ZERO)),
            0.0
        );
    }
}
