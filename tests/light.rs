//! Textured light: against closed forms, against rays, and against itself turned.

#[path = "common/convergence.rs"]
mod convergence;
#[path = "common/scenes.rs"]
mod scenes;

use std::f64::consts::PI;

use convergence::slope;
use glam::{DMat3, DQuat, DVec3, Vec3};
use scenes::{Random, assembled, rms, run, values};
use silhouette::bake::{Method, Receivers, Request, integrate};
use silhouette::scene::shapes::{Plane, TorusKnot};
use silhouette::scene::{Environment, Geometry, Mesh, Scene, Sky, UpAxis};
use silhouette::sphere::{BoundaryArc, vector_area};

/// Numbers of isolines at which errors are measured.
const LINES: [u32; 4] = [16, 32, 64, 128];

/// An environment from the radiance in the middle of each pixel.
fn environment(width: usize, height: usize, radiance: impl Fn(DVec3, usize, usize) -> Vec3) -> Environment {
    let frame = Environment::new(width, height, vec![Vec3::ZERO; width * height]).unwrap();
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let radiance: Vec<Vec3> = pixels.map(|(x, y)| radiance(frame.pixel_direction(x, y), x, y)).collect();
    Environment::new(width, height, radiance).unwrap()
}

fn gradient() -> Environment {
    environment(32, 16, |d, _, _| (DVec3::splat(2.0) + d).as_vec3())
}

fn checkerboard() -> Environment {
    environment(32, 16, |_, x, y| if (x + y) % 2 == 0 { Vec3::new(2.0, 1.0, 0.5) } else { Vec3::new(0.0, 0.1, 1.0) })
}

/// One pixel of 9e-4 sr that outshines all the rest.
fn sun() -> Environment {
    environment(
        128,
        64,
        |d, x, y| if (x, y) == (40, 17) { Vec3::splat(1e3) } else { Vec3::new(0.2, 0.3, d.y.max(0.0) as f32) },
    )
}

fn all_kinds() -> [(&'static str, Environment); 4] {
    let sky = Sky { height: 32, ..Sky::default() }.environment().unwrap();
    [("gradient", gradient()), ("checkerboard", checkerboard()), ("sun", sun()), ("sky", sky)]
}

/// Three colours of three axes, row by row.
fn vectors(row: &[f64]) -> [DVec3; 3] {
    [0, 3, 6].map(|i| DVec3::from_slice(&row[i..i + 3]))
}

/// The whole sphere's vector irradiance: the pixels' exact moments, summed.
fn whole(environment: &Environment) -> [DVec3; 3] {
    let mut sum = [DVec3::ZERO; 3];
    for (moment, radiance) in environment.patches(1) {
        for (sum, radiance) in sum.iter_mut().zip(radiance.to_array()) {
            *sum += moment * f64::from(radiance);
        }
    }
    sum
}

fn nothing() -> Geometry {
    assembled([], DQuat::IDENTITY)
}

#[test]
fn unoccluded_light_is_the_sum_over_pixels_for_any_number_of_isolines() {
    let mut random = Random(1);
    let geometry = nothing();
    for (name, environment) in all_kinds() {
        let scale = environment.mean().max_element() * 4.0 * PI;
        let environment = environment.oriented(UpAxis::Z, 33.0).unwrap();
        let probes = Receivers::probes(vec![DVec3::ZERO, random.direction()]);
        // Along an axis of the environment the horizon runs between pixels.
        let upright = environment.to_scene() * DMat3::IDENTITY;
        let horizons = Receivers::points([upright.y_axis, -upright.y_axis].map(|n| (DVec3::ZERO, n)));
        for lines in [4, 16, 256] {
            let arrays = run(&geometry, Some(&environment), &probes, 1, Method::Isolines { lines }).arrays;
            for row in values(&arrays, "vector_irradiance").chunks_exact(9) {
                for (found, exact) in vectors(row).into_iter().zip(whole(&environment)) {
                    assert!(found.distance(exact) < 1e-12 * scale, "{name}, {lines}: {found} instead of {exact}");
                }
            }
            let arrays = run(&geometry, Some(&environment), &horizons, 1, Method::Isolines { lines }).arrays;
            for (i, row) in values(&arrays, "vector_irradiance").chunks_exact(9).enumerate() {
                let n = horizons.normals[i];
                let mut exact = [DVec3::ZERO; 3];
                for (moment, radiance) in environment.patches(1).filter(|(moment, _)| moment.dot(n) > 0.0) {
                    (0..3).for_each(|c| exact[c] += moment * f64::from(radiance[c]));
                }
                for (c, (found, exact)) in vectors(row).into_iter().zip(exact).enumerate() {
                    assert!(found.distance(exact) < 1e-9 * scale, "{name}, {lines}: {found} instead of {exact}");
                    let irradiance = values(&arrays, "irradiance")[3 * i + c];
                    assert!((irradiance - n.dot(found)).abs() < 1e-12 * scale);
                }
            }
        }
    }
}

/// Part of a planar polygon in the half space n.w > 0.
fn clipped(corners: &[DVec3], n: DVec3) -> Vec<DVec3> {
    let mut kept = Vec::new();
    for (k, &a) in corners.iter().enumerate() {
        let b = corners[(k + 1) % corners.len()];
        let (ha, hb) = (n.dot(a), n.dot(b));
        if ha >= 0.0 {
            kept.push(a);
        }
        if (ha > 0.0 && hb < 0.0) || (ha < 0.0 && hb > 0.0) {
            kept.push(a.lerp(b, ha / (ha - hb)));
        }
    }
    kept
}

/// Integral of w over what a planar polygon covers, either winding (Lambert).
fn moment(corners: &[DVec3]) -> DVec3 {
    let arcs: Vec<BoundaryArc> = (0..corners.len())
        .map(|k| (corners[k].normalize(), corners[(k + 1) % corners.len()].normalize()))
        .filter(|(start, end)| start != end)
        .map(|(start, end)| BoundaryArc { start, end, normal: start.cross(end).normalize() })
        .collect();
    let area = vector_area(&arcs);
    let towards: DVec3 = corners.iter().map(|c| c.normalize()).sum();
    area * area.dot(towards).signum()
}

/// Eight octants of different light, which two rows of four pixels are: whatever polygon covers them has a closed form.
fn octants() -> Environment {
    Environment::new(
        4,
        2,
        (0..8).map(|k| Vec3::new(1.0 + k as f32, (7 * k % 5) as f32, (k % 2) as f32)).collect::<Vec<_>>(),
    )
    .unwrap()
}

/// Vector irradiance at the origin in the light of [`octants`], turned anyhow, above the horizon of `n` and past a polygon.
fn light_past(polygon: &[DVec3], n: DVec3, environment: &Environment) -> [DVec3; 3] {
    let axes = environment.to_scene();
    let mut sum = [DVec3::ZERO; 3];
    for octant in 0..8 {
        let signs = [1, 2, 4].map(|bit| if octant & bit == 0 { 1.0 } else { -1.0 });
        let corners: Vec<DVec3> = (0..3).map(|k| axes.col(k) * signs[k]).collect();
        let sides: Vec<DVec3> = corners.clone();
        let seen = clipped(&corners, n);
        let hidden = sides.iter().chain([&n]).fold(polygon.to_vec(), |polygon, side| clipped(&polygon, *side));
        let mut visible = DVec3::ZERO;
        if seen.len() > 2 {
            visible += moment(&seen);
        }
        if hidden.len() > 2 {
            visible -= moment(&hidden);
        }
        let radiance = environment.radiance(corners.iter().sum());
        (0..3).for_each(|c| sum[c] += visible * f64::from(radiance[c]));
    }
    sum
}

/// Error of vector irradiance in units of the mean radiance times pi: below this times N^-1.5 in the root mean square over
/// receivers, as for occlusion (`closed_forms.rs`), where light is even over patches larger than the isolines' distance.
const RMS_CONSTANT: f64 = 0.65;

#[test]
fn eight_octants_of_light_by_lambert() {
    let mut random = Random(2);
    let mut errors = [const { Vec::new() }; LINES.len()];
    for _ in 0..12 {
        let up = [UpAxis::X, UpAxis::Y, UpAxis::Z][random.between(0.0, 3.0) as usize];
        let light = octants().oriented(up, random.between(0.0, 360.0)).unwrap();
        let unit = light.mean().element_sum() / 3.0 * PI;
        let rotation = random.rotation();
        let corners = [(-0.8, -0.5), (0.8, -0.5), (0.8, 0.5), (-0.8, 0.5)].map(|(x, z)| DVec3::new(x, 0.0, z));
        let mesh = Mesh::new("polygon", corners.map(|p| p.as_vec3()).to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
        let geometry = assembled([mesh], rotation);
        let places: Vec<_> =
            (0..20).map(|_| (random.between(0.4, 2.0) * random.direction(), random.direction())).collect();
        let receivers = Receivers::points(places.iter().copied());
        let exact: Vec<[DVec3; 3]> = places
            .iter()
            .map(|&(p, n)| {
                let polygon: Vec<DVec3> = geometry.positions.iter().map(|q| q.as_dvec3() - p).collect();
                light_past(&polygon, n, &light)
            })
            .collect();
        let arrays = run(&geometry, Some(&light), &receivers, 1, Method::Exact).arrays;
        for (row, exact) in values(&arrays, "vector_irradiance").chunks_exact(9).zip(&exact) {
            for (found, exact) in vectors(row).into_iter().zip(exact) {
                assert!(found.distance(*exact) < 1e-9 * unit, "the exact method finds {found} instead of {exact}");
            }
        }
        for (errors, lines) in errors.iter_mut().zip(LINES) {
            let out = run(&geometry, Some(&light), &receivers, 1, Method::Isolines { lines });
            for (i, exact) in exact.iter().enumerate() {
                let found = vectors(&values(&out.arrays, "vector_irradiance")[9 * i..9 * i + 9]);
                for c in 0..3 {
                    errors.extend((found[c] - exact[c]).to_array().map(|e| e / unit));
                    let irradiance = values(&out.arrays, "irradiance")[3 * i + c];
                    assert!((irradiance - places[i].1.dot(found[c])).abs() < 1e-12 * unit);
                }
            }
        }
    }
    for (errors, lines) in errors.iter().zip(LINES) {
        let rms = rms(errors.iter().copied());
        assert!(rms < RMS_CONSTANT * f64::from(lines).powf(-1.5), "{lines} isolines: {rms:e}");
    }
    let slope = slope(LINES, errors.map(rms));
    assert!(slope >= 1.4, "falls as N^-{slope:.2}");
}

fn knot_over_ground(rotation: DQuat) -> Geometry {
    let ground = Plane { size: [6.0; 2], divisions: [2; 2] }.mesh().unwrap();
    let knot = TorusKnot { triangles: 600, ..TorusKnot::default() }.mesh().unwrap();
    assembled([knot, ground.transformed(glam::DAffine3::from_translation(-0.7 * DVec3::Y))], rotation)
}

fn places(random: &mut Random, count: usize) -> Vec<(DVec3, DVec3)> {
    (0..count).map(|_| (random.between(0.0, 1.8) * random.direction(), random.direction())).collect()
}

#[test]
fn any_light_as_the_judge_sees_it() {
    let mut random = Random(3);
    for (name, environment) in all_kinds() {
        let environment = environment.oriented(UpAxis::Y, random.between(0.0, 360.0)).unwrap();
        let geometry = knot_over_ground(random.rotation());
        let receivers = Receivers::points(places(&mut random, 80));
        let probes = Receivers::probes(receivers.positions.clone());
        for (what, receivers, arrays) in [
            ("points", &receivers, &["irradiance", "vector_irradiance"][..]),
            ("probes", &probes, &["vector_irradiance"]),
        ] {
            let judged =
                run(&geometry, Some(&environment), receivers, 1, Method::Qmc { samples: 1 << 11, seed: 3 }).arrays;
            for method in [Method::Isolines { lines: 256 }, Method::Exact] {
                let found = run(&geometry, Some(&environment), receivers, 1, method).arrays;
                for array in arrays {
                    let [own, errors] = [&found, &judged].map(|arrays| values(arrays, &format!("{array}_error")));
                    // A lone standard error from eight randomisations may be far too small: the typical one joins it.
                    let typical = rms(errors.iter().copied());
                    let differences: Vec<f64> =
                        values(&found, array).iter().zip(values(&judged, array)).map(|(a, b)| a - b).collect();
                    for ((difference, error), own) in differences.iter().zip(errors).zip(own) {
                        let allowed = 4.5 * error.hypot(typical) + own;
                        assert!(
                            difference.abs() < allowed,
                            "{name}, {what}, {method}: {array} {difference:e} {allowed:e}"
                        );
                    }
                    let spread = rms(differences);
                    let expected = typical.hypot(rms(own.iter().copied()));
                    assert!(spread < 1.5 * expected, "{name}, {what}, {method}: {array} {spread:e} for {expected:e}");
                }
            }
        }
    }
}

#[test]
fn turned_light_is_turned_geometry() {
    // Quarter turns and cyclic axes are exact, and so is turning everything together with the octahedron.
    let mut random = Random(4);
    let places = places(&mut random, 60);
    let light = sun();
    let exact_turns: [(UpAxis, f64); 4] = [(UpAxis::Y, 0.0), (UpAxis::Y, 90.0), (UpAxis::Z, 0.0), (UpAxis::X, 270.0)];
    let lines = 128;
    let [reference, rest @ ..] = exact_turns.map(|(up, degrees)| {
        let light = light.clone().oriented(up, degrees).unwrap();
        let turn = light.to_scene();
        let geometry = knot_over_ground(DQuat::from_mat3(&turn));
        let receivers = Receivers::points(places.iter().map(|&(p, n)| (turn * p, turn * n)));
        let arrays = run(&geometry, Some(&light), &receivers, 1, Method::Isolines { lines }).arrays;
        let vectors: Vec<DVec3> = values(&arrays, "vector_irradiance")
            .chunks_exact(3)
            .map(|v| turn.transpose() * DVec3::from_slice(v))
            .collect();
        vectors
    });
    let unit = light.mean().element_sum() / 3.0 * PI;
    for (turned, what) in rest.iter().zip(&exact_turns[1..]) {
        let worst = turned.iter().zip(&reference).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max) / unit;
        assert!(worst < 1e-12, "{what:?}: {worst:e}");
    }
}

#[test]
fn the_sun_is_where_the_documentation_says() {
    // Pixel (2, 1) of 8 x 4: s = 2.5/8, t = 1.5/4, so that phi = 3/8 pi and theta = pi/8.
    let one = environment(8, 4, |_, x, y| if (x, y) == (2, 1) { Vec3::new(0.0, 5.0, 0.0) } else { Vec3::ZERO });
    let ((sp, cp), (st, ct)) = ((0.375 * PI).sin_cos(), (0.125 * PI).sin_cos());
    let in_image = DVec3::new(ct * sp, st, ct * cp);
    for (up, degrees, expected) in [
        (UpAxis::Y, 0.0, in_image),
        (UpAxis::Z, 0.0, DVec3::new(in_image.z, in_image.x, in_image.y)),
        (UpAxis::X, 0.0, DVec3::new(in_image.y, in_image.z, in_image.x)),
        (UpAxis::Y, 30.0, DQuat::from_rotation_y(30f64.to_radians()) * in_image),
        (
            UpAxis::Z,
            -75.0,
            DQuat::from_rotation_z(-75f64.to_radians()) * DVec3::new(in_image.z, in_image.x, in_image.y),
        ),
    ] {
        let light = one.clone().oriented(up, degrees).unwrap();
        let probe = Receivers::probes(vec![DVec3::ZERO]);
        for method in [Method::Isolines { lines: 16 }, Method::Exact, Method::Qmc { samples: 1 << 14, seed: 1 }] {
            let arrays = run(&nothing(), Some(&light), &probe, 1, method).arrays;
            let [red, green, blue] = vectors(values(&arrays, "vector_irradiance"));
            assert!(red == DVec3::ZERO && blue == DVec3::ZERO);
            // A pixel's moment does not point exactly at its middle: in a row of latitudes, 1 % or so above it.
            assert!(green.normalize().dot(expected) > 0.999, "{up:?} {degrees}: {green} towards {expected}");
            assert!((green.length() / (5.0 * one.solid_angle(1)) - 1.0).abs() < 0.05);
        }
    }
}

/// From the upright edge inside a room the sky is seen behind the walls, in two regions of one size that both begin and end at the
/// poles of the image.
#[test]
fn regions_between_the_poles_of_the_image_are_told_apart() {
    let geometry = Scene::builtin("room").unwrap().geometry;
    let receivers = Receivers::vertices(&geometry).0.pick(1..8);
    let sun = DVec3::new(-0.1, 0.16, 0.98).normalize();
    let environment = environment(128, 64, |w, _, _| Vec3::splat(if w.dot(sun) > 0.9996 { 500.0 } else { 1.0 }));
    let request = Request { vector_irradiance: true, ..Request::default() };
    let light = |method| {
        let outcome = integrate(&geometry, Some(&environment), &receivers, &request, method, None, &()).unwrap();
        outcome.arrays.get("vector_irradiance").unwrap().data.clone()
    };
    let [exact, lines] = [Method::Exact, Method::Isolines { lines: 512 }].map(light);
    assert!(exact.iter().any(|value| value.abs() > 1.5), "the sun is seen");
    for (a, b) in exact.iter().zip(&lines) {
        assert!((a - b).abs() < 0.02, "{a} {b}");
    }
}
