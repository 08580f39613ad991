//! Scenes with a known answer, under every method.

#[path = "common/convergence.rs"]
mod convergence;
#[path = "common/outline.rs"]
mod outline;
#[path = "common/scenes.rs"]
mod scenes;

use std::f64::consts::{PI, TAU};

use convergence::slope;
use glam::{DAffine3, DQuat, DVec3, Vec3};
use outline::Blocker;
use scenes::{Random, assembled, rms, run, values};
use silhouette::bake::{Method, Receivers};
use silhouette::scene::shapes::{Cuboid, Icosphere, Opening, Plane, Room, TorusKnot};
use silhouette::scene::{Environment, Geometry, Mesh};
use silhouette::sphere::{self, Order, closed_forms};

/// Numbers of isolines at which errors are measured.
const LINES: [u32; 4] = [16, 64, 256, 1024];

/// Bands of the ensembles; caps and planes are compared to [`MOST`].
const ORDER: usize = 4;
const MOST: usize = 10;

/// A blocker, what receivers see past it, and what they should see.
struct Known {
    geometry: Geometry,
    receivers: Receivers,
    occlusion: Vec<f64>,
    visibility: Vec<f64>,
}

impl Known {
    /// A convex blocker over a ground that no receiver sees, all turned by `rotation`; receivers are given as before.
    fn new(mesh: Mesh, is_closed: bool, ground: Option<Mesh>, rotation: DQuat, receivers: Vec<(DVec3, DVec3)>) -> Self {
        let order = Order::new(ORDER).unwrap();
        let blocker = Blocker { geometry: assembled([mesh.clone()], rotation), is_closed };
        let turned: Vec<_> = receivers.into_iter().map(|(p, n)| (rotation * p, rotation * n)).collect();
        let visible = |&(p, n): &(DVec3, DVec3)| {
            let hidden = blocker.harmonics(order, p, n);
            sphere::hemisphere(order, n).into_iter().zip(hidden).map(|(all, hidden)| all - hidden).collect::<Vec<_>>()
        };
        Self {
            geometry: assembled([mesh].into_iter().chain(ground), rotation),
            occlusion: turned.iter().map(|&(p, n)| 1.0 - blocker.form_factor(p, n)).collect(),
            visibility: turned.iter().flat_map(visible).collect(),
            receivers: Receivers::points(turned),
        }
    }
}

fn polygon(corners: impl IntoIterator<Item = DVec3>) -> Mesh {
    let positions: Vec<Vec3> = corners.into_iter().map(|p| p.as_vec3()).collect();
    let triangles = (2..positions.len() as u32).map(|k| [0, k - 1, k]).collect();
    Mesh::new("polygon", positions, triangles)
}

/// A regular polygon parallel to the ground.
fn disc(radius: f64, height: f64, sides: u32) -> Mesh {
    polygon((0..sides).map(|k| {
        let (sin, cos) = (TAU * f64::from(k) / f64::from(sides)).sin_cos();
        DVec3::new(radius * cos, height, radius * sin)
    }))
}

fn ground() -> Mesh {
    Plane { size: [30.0; 2], ..Plane::default() }.mesh().unwrap()
}

/// Just over the ground, up to `reach` from the axis.
fn on_ground(random: &mut Random, reach: f64) -> DVec3 {
    let (r, (sin, cos)) = (random.between(0.0, reach), random.between(0.0, TAU).sin_cos());
    DVec3::new(r * cos, 1e-3, r * sin)
}

const ROTATIONS: usize = 10;
const RECEIVERS: usize = 30;

/// More where edges are straight: those that happen to lie along the isolines, few of them, make most of the error.
const MANY_RECEIVERS: usize = 120;

/// Scenes of one kind in several orientations, so that an error found is not that of one lucky position.
fn ensemble(seed: u64, mut known: impl FnMut(&mut Random, DQuat) -> Known) -> Vec<Known> {
    let mut random = Random(seed);
    (0..ROTATIONS)
        .map(|_| {
            let rotation = random.rotation();
            known(&mut random, rotation)
        })
        .collect()
}

fn sphere() -> Mesh {
    Icosphere { radius: 1.0, subdivisions: 3 }.mesh().unwrap()
}

fn spheres_over_ground() -> Vec<Known> {
    ensemble(1, |random, rotation| {
        let height = 1.0 + random.between(0.01, 2.0);
        let mesh = sphere().transformed(DAffine3::from_translation(height * DVec3::Y));
        let receivers = (0..RECEIVERS).map(|_| (on_ground(random, 4.0), DVec3::Y)).collect();
        Known::new(mesh, true, Some(ground()), rotation, receivers)
    })
}

/// A receiver outside of a ball about the origin, which looks anywhere.
fn anywhere(random: &mut Random, from: f64, to: f64) -> (DVec3, DVec3) {
    (random.between(from, to) * random.direction(), random.direction())
}

fn spheres_cut_by_the_horizon() -> Vec<Known> {
    ensemble(2, |random, rotation| {
        let receivers = (0..RECEIVERS).map(|_| anywhere(random, 1.1, 4.0)).collect();
        Known::new(sphere(), true, None, rotation, receivers)
    })
}

fn discs() -> Vec<Known> {
    ensemble(3, |random, rotation| {
        let (radius, height) = (random.between(0.3, 2.0), random.between(0.1, 2.0));
        let receivers = (0..RECEIVERS).map(|_| (on_ground(random, 3.0), DVec3::Y)).collect();
        Known::new(disc(radius, height, 96), false, Some(ground()), rotation, receivers)
    })
}

fn rectangles() -> Vec<Known> {
    ensemble(4, |random, rotation| {
        let (a, b) = (random.between(0.3, 2.0), random.between(0.3, 2.0));
        let corners = [(-a, -b), (a, -b), (a, b), (-a, b)].map(|(x, z)| DVec3::new(x, 0.0, z));
        let receivers = (0..MANY_RECEIVERS).map(|_| anywhere(random, 0.3, 3.0)).collect();
        Known::new(polygon(corners), false, None, rotation, receivers)
    })
}

fn boxes() -> Vec<Known> {
    ensemble(5, |random, rotation| {
        let size = [(); 3].map(|()| random.between(0.2, 1.0));
        let cuboid = Cuboid { size, divisions: 1 + (size[0] * 4.0) as u32 }.mesh().unwrap();
        let receivers = (0..MANY_RECEIVERS).map(|_| anywhere(random, 0.9, 3.0)).collect();
        Known::new(cuboid, true, None, rotation, receivers)
    })
}

/// Stated error of the isolines: root mean square over receivers of the ambient occlusion (and of every coefficient of the
/// visibility up to order 8) past one convex blocker is below this number times N^-1.5.
///
/// Why 1.5: a smooth outline touches the isoline at u0, and its length there goes like 2 sqrt(2 rho (u - u0)). The
/// midpoint rule of step h = 2/N is off by at most 0.208 = |zeta(-1/2)| times 2 sqrt(2 rho) h^1.5, times at most
/// 3/(sqrt2 pi) for the measure along the line and the cosine: 1.1 N^-1.5 for a radius of curvature rho = 1/4 of the map,
/// and a third of that in the mean over places between two lines. A straight edge along the isolines is off by order h, but
/// only for a share of order h of all orientations, which is order h^1.5 in the mean square, too. Measured: 0.12 to 0.51
/// (coefficients 0.18 to 0.59), the rectangles' lone edges being the worst.
const RMS_CONSTANT: f64 = 0.65;

/// Allowed to the exact method for each number: rounding only.
const EXACT: f64 = 1e-12;

/// Bound for single receivers: what is hidden of an isoline grows and then shrinks with u, so that the midpoint rule is off
/// by a step times the most that an isoline can hold, at most 1 of the hemisphere's cosine per unit of u. Measured: 0.6/N.
fn worst_allowed(lines: u32) -> f64 {
    2.0 / f64::from(lines)
}

fn differences<'a>(found: &'a [f64], exact: &'a [f64]) -> impl Iterator<Item = f64> + Clone + 'a {
    assert_eq!(found.len(), exact.len());
    found.iter().zip(exact).map(|(a, b)| a - b)
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most, x| most.max(x.abs()))
}

/// Root-mean-square errors of occlusion and harmonics, by the number of isolines.
fn isoline_errors(scenes: &[Known], lines: u32, name: &str) -> [f64; 2] {
    let mut errors = [Vec::new(), Vec::new()];
    for known in scenes {
        let out = run(&known.geometry, None, &known.receivers, ORDER, Method::Isolines { lines });
        assert_eq!(out.statistics.depth_alarms, 0, "{name}");
        errors[0].extend(differences(values(&out.arrays, "ambient_occlusion"), &known.occlusion));
        errors[1].extend(differences(values(&out.arrays, "visibility_sh"), &known.visibility));
    }
    let worst = largest(errors[0].iter().copied());
    assert!(worst < worst_allowed(lines), "{name}, {lines} isolines: worst {worst:e}");
    errors.map(rms)
}

/// The isolines' error is what is stated, and falls as stated; the judge's is what it states itself.
#[track_caller]
fn holds(name: &str, scenes: &[Known]) {
    let errors = LINES.map(|lines| isoline_errors(scenes, lines, name));
    for (quantity, array) in ["ambient_occlusion", "visibility_sh"].into_iter().enumerate() {
        let errors = errors.map(|errors| errors[quantity]);
        for (lines, error) in LINES.into_iter().zip(errors) {
            let constant = error * f64::from(lines).powf(1.5);
            assert!(constant < RMS_CONSTANT, "{name}: {array} at {lines} isolines: {error:e}, {constant:.3} N^-1.5");
        }
        let slope = slope(LINES, errors);
        assert!(slope >= 1.4, "{name}: {array} falls as N^-{slope:.2}: {errors:?}");
    }

    for known in scenes {
        let arrays = run(&known.geometry, None, &known.receivers, ORDER, Method::Exact).arrays;
        for (array, exact) in [("ambient_occlusion", &known.occlusion), ("visibility_sh", &known.visibility)] {
            let error = largest(differences(values(&arrays, array), exact));
            assert!(error < EXACT, "{name}: {array} of the exact method is off by {error:e}");
        }
    }

    let (mut found, mut stated, mut worst) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()], 0.0f64);
    for known in scenes {
        let arrays = run(&known.geometry, None, &known.receivers, ORDER, Method::Qmc { samples: 256, seed: 3 }).arrays;
        let exact = [&known.occlusion, &known.visibility];
        for (k, array) in ["ambient_occlusion", "visibility_sh"].into_iter().enumerate() {
            let errors = values(&arrays, &format!("{array}_error"));
            found[k].extend(differences(values(&arrays, array), exact[k]));
            stated[k].extend_from_slice(errors);
            // A lone standard error, estimated from eight randomisations, may be far too small: the typical one joins it.
            let typical = rms(errors.iter().copied());
            let scores = differences(values(&arrays, array), exact[k]).zip(errors).map(|(d, e)| d / e.hypot(typical));
            worst = worst.max(largest(scores));
        }
    }
    assert!(worst < 4.5, "{name}: qmc is off by {worst} standard errors");
    for (found, stated) in found.into_iter().zip(stated) {
        let ratio = rms(found) / rms(stated);
        assert!((0.8..1.25).contains(&ratio), "{name}: qmc's error is {ratio} times what it states");
    }
}

/// Convex blockers of several kinds past which receivers look anywhere, to the last band on offer.
#[test]
fn the_exact_method_is_exact_to_order_10() {
    let order = Order::MAX;
    let mut random = Random(14);
    let rectangle = [(-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (-1.0, 0.5)].map(|(x, z)| DVec3::new(x, 0.0, z));
    let round = Icosphere { radius: 0.7, subdivisions: 2 }.mesh().unwrap();
    let kinds = [
        (polygon(rectangle), false),
        (disc(0.8, 0.0, 96), false),
        (Cuboid::default().mesh().unwrap(), true),
        (round, true),
    ];
    for (mesh, is_closed) in kinds {
        for _ in 0..3 {
            let geometry = assembled([mesh.clone()], random.rotation());
            let places: Vec<_> = (0..20).map(|_| anywhere(&mut random, 1.0, 3.0)).collect();
            let arrays = run(&geometry, None, &Receivers::points(places.clone()), order.bands(), Method::Exact).arrays;
            let blocker = Blocker { geometry, is_closed };
            for (i, &(p, n)) in places.iter().enumerate() {
                let occlusion = values(&arrays, "ambient_occlusion")[i] - (1.0 - blocker.form_factor(p, n));
                assert!(occlusion.abs() < 1e-12, "{:?} {p} {n}: occlusion is off by {occlusion:e}", mesh.name);
                let hidden = blocker.harmonics(order, p, n);
                let visible: Vec<f64> =
                    sphere::hemisphere(order, n).iter().zip(&hidden).map(|(all, hidden)| all - hidden).collect();
                let found = &values(&arrays, "visibility_sh")[i * order.len()..(i + 1) * order.len()];
                let error = largest(differences(found, &visible));
                assert!(error < 1e-12, "{:?} {p} {n}: harmonics are off by {error:e}", mesh.name);
            }
        }
    }
}

#[test]
fn spheres_above_a_plane() {
    holds("spheres over ground", &spheres_over_ground());
}

#[test]
fn spheres_through_the_horizon() {
    holds("spheres cut by the horizon", &spheres_cut_by_the_horizon());
}

#[test]
fn discs_by_lambert() {
    holds("discs", &discs());
}

#[test]
fn rectangles_by_lambert() {
    holds("rectangles", &rectangles());
}

#[test]
fn boxes_by_lambert() {
    holds("boxes", &boxes());
}

/// Ambient occlusion at receivers by 1024 isolines.
fn occlusion(geometry: &Geometry, receivers: Vec<(DVec3, DVec3)>) -> Vec<f64> {
    let receivers = Receivers::points(receivers);
    run(geometry, None, &receivers, 1, Method::Isolines { lines: 1024 })
        .arrays
        .remove("ambient_occlusion")
        .unwrap()
        .data
}

/// Allowed at 1024 isolines for a whole list of receivers, and for each.
const FINE: f64 = RMS_CONSTANT / (1024.0 * 32.0);

#[test]
fn spheres_by_snyder_at_many_heights_and_offsets() {
    let mut random = Random(6);
    let mesh = Icosphere { radius: 1.0, subdivisions: 5 }.mesh().unwrap();
    // The polyhedron lies between the sphere and the ball that touches its faces from inside.
    let inner = mesh.triangles.iter().map(|t| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize].as_dvec3());
        (b - a).cross(c - a).normalize().dot(a)
    });
    let inner = inner.fold(1.0, f64::min);
    assert!(inner > 0.999);
    let rotation = random.rotation();
    for height in [1.001, 1.1, 1.5, 2.0, 4.0, 16.0] {
        let sphere = mesh.clone().transformed(DAffine3::from_translation(height * DVec3::Y));
        let geometry = assembled([sphere, ground()], rotation);
        let mut places: Vec<_> = (0..30).map(|_| (on_ground(&mut random, 4.0), DVec3::Y)).collect();
        places.push((DVec3::new(0.0, 1e-4, 0.0), DVec3::Y));
        let found = occlusion(&geometry, places.iter().map(|&(p, n)| (rotation * p, rotation * n)).collect());
        let mut excess = Vec::new();
        for ((p, n), found) in places.into_iter().zip(found) {
            let [low, high] =
                [inner, 1.0].map(|radius| closed_forms::sphere_form_factor(height * DVec3::Y - p, radius, n));
            assert!(high - low < 2e-3);
            excess.push((1.0 - found - high).max(low - (1.0 - found)).max(0.0));
        }
        assert!(
            largest(excess.iter().copied()) < worst_allowed(1024) && rms(excess.iter().copied()) < FINE,
            "{excess:?}"
        );
    }
}

#[test]
fn discs_by_howell() {
    let mut random = Random(7);
    for (radius, height) in [(1.0, 0.01), (1.0, 0.3), (0.5, 1.0), (5.0, 1.0), (1.0, 20.0)] {
        let rotation = random.rotation();
        const SIDES: u32 = 720;
        let geometry = assembled([disc(radius, height, SIDES)], rotation);
        let places: Vec<_> = (0..30).map(|_| on_ground(&mut random, 2.0 * radius)).collect();
        let found = occlusion(&geometry, places.iter().map(|&p| (rotation * p, rotation * DVec3::Y)).collect());
        let mut excess = Vec::new();
        for (p, found) in places.into_iter().zip(found) {
            let inner = radius * (PI / f64::from(SIDES)).cos();
            let [low, high] = [inner, radius]
                .map(|radius| closed_forms::disc_form_factor(radius, height - p.y, DVec3::new(p.x, 0.0, p.z).length()));
            excess.push((1.0 - found - high).max(low - (1.0 - found)).max(0.0));
        }
        assert!(
            largest(excess.iter().copied()) < worst_allowed(1024) && rms(excess.iter().copied()) < FINE,
            "{excess:?}"
        );
    }
}

#[test]
fn rectangles_by_howell() {
    let mut random = Random(8);
    let mut errors = Vec::new();
    for _ in 0..40 {
        let [a, b, height] = [(); 3].map(|()| random.between(0.2, 3.0));
        let corners = [(0.0, 0.0), (a, 0.0), (a, b), (0.0, b)].map(|(x, z)| DVec3::new(x, height, z));
        let rotation = random.rotation();
        let found = occlusion(&assembled([polygon(corners)], rotation), vec![(DVec3::ZERO, rotation * DVec3::Y)]);
        errors.push(1.0 - found[0] - closed_forms::rectangle_form_factor(a, b, height));
    }
    assert!(largest(errors.iter().copied()) < worst_allowed(1024) && rms(errors.iter().copied()) < FINE, "{errors:?}");
}

#[test]
fn walls_become_infinite() {
    let mut random = Random(9);
    let mut errors = [const { Vec::new() }; LINES.len()];
    for k in [0.01f64, 0.1, 0.5, 1.0, 3.0, 10.0, 1e4] {
        // (1 - 1/sqrt(1 + k^2))/2, k = height over distance: missed by the ends of a wall of length 600, and by the last
        // bit of its corners in single precision, 1.5e-5 of the distance.
        let limit = 0.5 * (1.0 - (1.0 + k * k).sqrt().recip());
        assert!((limit - closed_forms::wall_form_factor(k, 1.0)).abs() < 1e-15);
        for _ in 0..30 {
            let rotation = random.rotation();
            let wall = [(-300.0, 0.0), (300.0, 0.0), (300.0, k), (-300.0, k)].map(|(x, y)| DVec3::new(x, y, 1.0));
            let blocker = Blocker { geometry: assembled([polygon(wall)], rotation), is_closed: false };
            let n = rotation * DVec3::Y;
            let exact = blocker.form_factor(DVec3::ZERO, n);
            assert!(k > 10.0 || (exact - limit).abs() < 3e-5, "{k}: {exact} instead of {limit}");
            for (errors, lines) in errors.iter_mut().zip(LINES) {
                let receivers = Receivers::points([(DVec3::ZERO, n)]);
                let arrays = run(&blocker.geometry, None, &receivers, 1, Method::Isolines { lines }).arrays;
                errors.push(1.0 - values(&arrays, "ambient_occlusion")[0] - exact);
            }
        }
    }
    for (errors, lines) in errors.iter().zip(LINES) {
        let [rms, worst] = [rms(errors.iter().copied()), largest(errors.iter().copied())];
        assert!(rms < RMS_CONSTANT * f64::from(lines).powf(-1.5) && worst < worst_allowed(lines), "{rms:e} {worst:e}");
    }
    let slope = slope(LINES, errors.map(rms));
    assert!(slope >= 1.4, "falls as N^-{slope:.2}");
}

#[test]
fn open_planes_are_exact() {
    // A plane turned anyhow is not plane to the last bit of single precision; a coordinate plane is.
    let mut random = Random(10);
    let mesh = Plane { size: [4.0; 2], divisions: [6; 2] }.mesh().unwrap();
    let turns = [DQuat::IDENTITY, DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5), DQuat::from_xyzw(-0.5, -0.5, -0.5, 0.5)];
    let order = Order::new(MOST).unwrap();
    for (rotation, is_plane) in turns.map(|turn| (turn, true)).into_iter().chain([(random.rotation(), false)]) {
        let plane = assembled([mesh.clone()], rotation);
        let (on_it, undirected) = Receivers::vertices(&plane);
        assert!(undirected.is_empty());
        let above = Receivers::points(on_it.positions.iter().zip(&on_it.normals).map(|(p, n)| (p + n * 0.25, *n)));
        // In the plane itself, as points sampled on a floor are, and not known to lie on it.
        let in_it = Receivers::points((0..40).map(|_| {
            let p = DVec3::new(random.between(-2.0, 2.0), 0.0, random.between(-2.0, 2.0));
            (rotation * p, rotation * DVec3::Y)
        }));
        for receivers in [above].into_iter().chain(is_plane.then_some([on_it, in_it]).into_iter().flatten()) {
            open(&plane, &receivers, order);
        }
    }
}

/// Every method sees the whole hemisphere.
fn open(plane: &Geometry, receivers: &Receivers, order: Order) {
    for method in [Method::Isolines { lines: 16 }, Method::Isolines { lines: 1024 }, Method::Exact] {
        let arrays = run(plane, None, receivers, MOST, method).arrays;
        for (i, &n) in receivers.normals.iter().enumerate() {
            let excess = values(&arrays, "ambient_occlusion")[i] - 1.0;
            assert!(excess.abs() < 1e-14, "{method:?}, receiver {i} at {}: {excess:e}", receivers.positions[i]);
            let row = i * order.len()..(i + 1) * order.len();
            let visibility = &values(&arrays, "visibility_sh")[row.clone()];
            assert!(largest(differences(visibility, &sphere::hemisphere(order, n))) < 1e-13);
            let cosine: Vec<f64> = sphere::clamped_cosine(order, n).iter().map(|x| x / PI).collect();
            assert!(largest(differences(&values(&arrays, "transfer_sh")[row], &cosine)) < 1e-13);
        }
    }
    let arrays = run(plane, None, receivers, 1, Method::Qmc { samples: 256, seed: 0 }).arrays;
    // All of its rays escape, so that what is left is the rule's error for a smooth integrand, -3/2nd power of 32 points.
    assert!(largest(values(&arrays, "ambient_occlusion").iter().map(|x| x - 1.0)) < 32f64.powf(-1.5));
}

#[test]
fn spherical_caps_by_zonal_harmonics() {
    let mut random = Random(11);
    let order = Order::new(MOST).unwrap();
    let mut errors = Vec::new();
    for half_angle in [0.02f64, 0.1, 0.3, 0.7, 1.2] {
        for _ in 0..5 {
            let rotation = random.rotation();
            let axis = rotation * DVec3::Y;
            // Same solid angle as the cap to the fourth power of the sides' angle: (pi/720)^4 of it at most.
            const SIDES: u32 = 720;
            let widened = (TAU / f64::from(SIDES) / (TAU / f64::from(SIDES)).sin()).sqrt();
            let geometry = assembled([disc(half_angle.tan() * widened, 1.0, SIDES)], rotation);
            // Probes see the whole sphere; a horizon that the cap is clear of changes nothing.
            let tilt =
                DQuat::from_axis_angle(axis.any_orthonormal_vector(), (1.5 - half_angle) * random.between(0.0, 1.0));
            let n = tilt * axis;
            let hidden = sphere::cap(order, axis, half_angle.cos());
            for (receivers, all) in [
                (Receivers::probes(vec![DVec3::ZERO]), sphere::cap(order, n, -1.0)),
                (Receivers::points([(DVec3::ZERO, n)]), sphere::hemisphere(order, n)),
            ] {
                let arrays = run(&geometry, None, &receivers, MOST, Method::Isolines { lines: 256 }).arrays;
                let exact: Vec<f64> = all.iter().zip(&hidden).map(|(a, h)| a - h).collect();
                errors.extend(differences(values(&arrays, "visibility_sh"), &exact));
            }
        }
    }
    assert!(rms(errors.iter().copied()) < 8.0 * FINE && largest(errors.iter().copied()) < worst_allowed(256));
}

#[test]
fn closed_rooms_are_exactly_dark() {
    let mut random = Random(12);
    let size = DVec3::new(12.0, 5.0, 10.0);
    let room = Room { opening: Opening::Closed, subdivisions: 1, ..Room::default() };
    let geometry = assembled([room.mesh().unwrap()], DQuat::IDENTITY);
    // At an edge of the room the averaged normal looks past the corner's own faces, which are left out.
    let (at_vertices, _) = Receivers::vertices(&geometry);
    let walls = |p: DVec3| {
        [(p.x.abs(), 6.0), ((p.y - 2.5).abs(), 2.5), (p.z.abs(), 5.0)].iter().filter(|(at, wall)| at == wall).count()
    };
    let inside = |random: &mut Random| {
        let p = DVec3::new(random.between(-0.49, 0.49), random.between(0.01, 0.99), random.between(-0.49, 0.49)) * size;
        (p, random.direction())
    };
    let points = Receivers::points((0..200).map(|_| inside(&mut random)));
    let probes = Receivers::probes(points.positions.clone());
    let environment = Environment::new(2, 1, vec![Vec3::ONE, Vec3::X]).unwrap();
    let mut seen_from_walls = 0;
    for receivers in [at_vertices, points, probes] {
        for method in
            [Method::Isolines { lines: 4 }, Method::Isolines { lines: 64 }, Method::Qmc { samples: 32, seed: 1 }]
        {
            let out = run(&geometry, Some(&environment), &receivers, 3, method);
            assert_eq!(out.statistics.depth_alarms, 0);
            for array in out.arrays.iter().filter(|array| !array.name.ends_with("_error")) {
                for (i, row) in array.data.chunks_exact(array.data.len() / receivers.len()).enumerate() {
                    if walls(receivers.positions[i]) <= 1 {
                        assert!(row.iter().all(|&x| x == 0.0), "{} at {i}: {row:?}", array.name);
                        seen_from_walls += walls(receivers.positions[i]);
                    }
                }
            }
        }
    }
    assert!(seen_from_walls > 1000);
}

/// A closed box around the origin with a square hole in its wall y = 1, seen from the origin under the angle `size`.
fn box_with_hole(size: f64, sideways: [f64; 2]) -> (Mesh, [DVec3; 4]) {
    let half = 0.5 * size;
    let corner = |x: f64, z: f64| DVec3::new(x, 1.0, z);
    let [x, z] = sideways;
    let hole = [
        corner(x - half, z - half),
        corner(x - half, z + half),
        corner(x + half, z + half),
        corner(x + half, z - half),
    ];
    let rim = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    let mut mesh = Cuboid { size: [2.0; 3], divisions: 1 }.mesh().unwrap();
    let top = |t: &[u32; 3]| t.iter().all(|&v| mesh.positions[v as usize].y == 1.0);
    let walls: Vec<[u32; 3]> = mesh.triangles.iter().filter(|t| !top(t)).copied().collect();
    assert_eq!(walls.len(), 10);
    mesh.triangles = walls;
    for k in 0..4 {
        mesh.append(&polygon([rim[k], rim[(k + 1) % 4], hole[(k + 1) % 4], hole[k]]));
    }
    (mesh, hole)
}

#[test]
fn small_holes_in_closed_rooms_are_found() {
    // Isolines are at most 2.12 times 2/N rad apart: the planes of u and u + du include dphi = sqrt2 du / ((1-u)^2 + 2u^2),
    // largest at u = 1/3. So N of at least 4.24 / size leave out no hole; with fewer it may be missed, but a line that
    // meets it adds no more than 2/N times its diagonal times 3/sqrt2, the most of the measure along a line, over pi.
    let mut random = Random(13);
    for (size, sure) in [(0.02, 256), (0.005, 1024)] {
        for lines in [64, sure, 4096] {
            let ratios: Vec<f64> = (0..if lines == 64 { 400 } else { 40 })
                .map(|_| {
                    let rotation = random.rotation();
                    let sideways = [random.between(-0.3, 0.3), random.between(-0.3, 0.3)];
                    let (mesh, hole) = box_with_hole(size, sideways);
                    let middle: DVec3 = hole.iter().sum::<DVec3>().normalize();
                    let n = (middle + 0.7 * random.direction()).normalize();
                    let exact = closed_forms::polygon_form_factor(&hole, n);
                    let receivers = Receivers::points([(DVec3::ZERO, rotation * n)]);
                    let out = run(&assembled([mesh], rotation), None, &receivers, 1, Method::Isolines { lines });
                    assert_eq!(out.statistics.depth_alarms, 0);
                    let found = values(&out.arrays, "ambient_occlusion")[0];
                    let step = 2.0 / f64::from(lines);
                    let bound = step * 2f64.sqrt() * size * 3.0 / (2f64.sqrt() * PI);
                    assert!(
                        found >= 0.0 && (found - exact).abs() <= bound,
                        "{size} {lines}: {found} instead of {exact}"
                    );
                    found / exact
                })
                .collect();
            let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
            let spread = rms(ratios.iter().map(|x| x - 1.0));
            let missed = ratios.iter().filter(|&&x| x == 0.0).count();
            assert!((mean - 1.0).abs() < 4.5 * spread / (ratios.len() as f64).sqrt(), "{size} {lines}: mean {mean}");
            assert_eq!(missed > 0, lines == 64, "{size} {lines}: {missed} missed");
        }
    }
}

#[test]
fn complements_add_to_the_whole() {
    // A closed box with a hole, and the lid of the hole alone: what one hides the other shows. Both together are what
    // the isolines make of the open hemisphere, whatever the hole.
    let mut random = Random(14);
    let order = Order::new(MOST).unwrap();
    for lines in [16, 256] {
        let rotation = random.rotation();
        let places: Vec<(DVec3, DVec3)> = (0..40)
            .map(|_| {
                let p = DVec3::new(random.between(-0.3, 0.3), 0.0, random.between(-0.3, 0.3));
                (rotation * p, rotation * (DVec3::Y + 0.8 * random.direction()).normalize())
            })
            .collect();
        let receivers = Receivers::points(places.iter().copied());
        let wholes = [0.02, 0.5, 1.3].map(|size| {
            let (mesh, lid) = box_with_hole(size, [0.1, -0.2]);
            let [seen, rest] = [vec![mesh], vec![polygon(lid)]].map(|meshes| {
                run(&assembled(meshes, rotation), None, &receivers, MOST, Method::Isolines { lines }).arrays
            });
            ["visibility_sh", "ambient_occlusion"].map(|name| -> Vec<f64> {
                values(&seen, name).iter().zip(values(&rest, name)).map(|(a, b)| a + b).collect()
            })
        });
        for [visibility, occlusion] in &wholes {
            assert!(largest(differences(visibility, &wholes[0][0])) < 1e-12);
            assert!(largest(differences(occlusion, &wholes[0][1])) < 1e-12);
        }
        let hemispheres: Vec<f64> = places.iter().flat_map(|&(_, n)| sphere::hemisphere(order, n)).collect();
        let allowed = RMS_CONSTANT * f64::from(lines).powf(-1.5);
        let errors = differences(&wholes[0][0], &hemispheres);
        assert!(largest(errors.clone()) < worst_allowed(lines) && rms(errors) < allowed);
        assert!(rms(wholes[0][1].iter().map(|x| x - 1.0)) < allowed);
    }
}

#[test]
fn quantities_agree_with_each_other() {
    let mut random = Random(15);
    let rotation = random.rotation();
    let knot = TorusKnot { triangles: 800, ..Default::default() }.mesh().unwrap();
    let geometry = assembled([knot], rotation);
    let (at_vertices, _) = Receivers::vertices(&geometry);
    let points = Receivers::points((0..100).map(|_| anywhere(&mut random, 0.0, 3.0)));
    let white = Environment::constant(Vec3::ONE).unwrap();
    let order = Order::new(4).unwrap();
    for receivers in [at_vertices, points] {
        let out = run(&geometry, Some(&white), &receivers, 5, Method::Isolines { lines: 64 }).arrays;
        let at_four = run(&geometry, Some(&white), &receivers, 4, Method::Isolines { lines: 64 }).arrays;
        for (i, &n) in receivers.normals.iter().enumerate() {
            let occlusion = values(&out, "ambient_occlusion")[i];
            let vectors = &values(&out, "vector_irradiance")[9 * i..9 * i + 9];
            for colour in 0..3 {
                let irradiance = values(&out, "irradiance")[3 * i + colour];
                assert!((irradiance - PI * occlusion).abs() < 1e-12);
                assert!((irradiance - n.dot(DVec3::from_slice(&vectors[3 * colour..]))).abs() < 1e-14);
            }
            let visibility = &values(&out, "visibility_sh")[25 * i..25 * i + 25];
            // Band 1 of the visibility is the vector irradiance in a white sky.
            let band = [visibility[3], visibility[1], visibility[2]].map(|x| x * (4.0 * PI / 3.0).sqrt());
            assert!(largest(differences(&vectors[..3], &band)) < 1e-12);
            let mut transfer = vec![0.0; order.len()];
            sphere::cosine_product(order, n, visibility, &mut transfer);
            transfer.iter_mut().for_each(|x| *x /= PI);
            assert!(largest(differences(&values(&at_four, "transfer_sh")[16 * i..16 * i + 16], &transfer)) < 1e-12);
            assert!((transfer[0] * (4.0 * PI).sqrt() - occlusion).abs() < 1e-12);
            let bent = DVec3::from_slice(&values(&out, "bent_normal")[3 * i..]);
            assert!(bent.distance(DVec3::from(band).normalize_or_zero()) < 1e-12);
        }
    }
}
