//! Gradients as `integrate` gives them, against differences of its own exact results.

#[path = "common/scenes.rs"]
mod scenes;

use glam::{DAffine3, DQuat, DVec3};
use scenes::{Random, assembled, request, values};
use silhouette::bake::{Arrays, Method, Receivers, Request, integrate};
use silhouette::scene::Geometry;
use silhouette::scene::shapes::{Cuboid, Plane, TorusKnot};

const ORDER: usize = 4;
const QUANTITIES: [&str; 3] = ["ambient_occlusion", "visibility_sh", "transfer_sh"];

fn scene(rotation: DQuat) -> Geometry {
    let knot = TorusKnot { triangles: 400, ..TorusKnot::default() }.mesh().unwrap();
    let ground = Plane { size: [6.0; 2], divisions: [4; 2] }.mesh().unwrap();
    assembled([knot, ground.transformed(DAffine3::from_translation(-0.7 * DVec3::Y))], rotation)
}

fn exact(geometry: &Geometry, receivers: &Receivers, gradients: bool) -> Arrays {
    let request = Request { gradients, ..request(receivers, None, ORDER) };
    integrate(geometry, None, receivers, &request, Method::Exact, None, &()).unwrap().arrays
}

/// Central differences of an array along the three axes, extrapolated from two steps, and how far the steps differ.
fn differences(geometry: &Geometry, places: &[(DVec3, DVec3)], name: &str, step: f64) -> Vec<[(f64, f64); 3]> {
    let by_axis = DVec3::AXES.map(|axis| {
        let [coarse, fine] = [step, 0.5 * step].map(|step| {
            let [ahead, behind] = [step, -step].map(|by| {
                let moved = Receivers::points(places.iter().map(|&(p, n)| (p + by * axis, n)));
                exact(geometry, &moved, false)
            });
            let pairs = values(&ahead, name).iter().zip(values(&behind, name));
            pairs.map(|(a, b)| (a - b) / (2.0 * step)).collect::<Vec<f64>>()
        });
        coarse.iter().zip(&fine).map(|(c, f)| (f + (f - c) / 3.0, (f - c).abs())).collect::<Vec<_>>()
    });
    let [x, y, z] = by_axis;
    x.into_iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect()
}

/// At points of which almost none sees a face edge-on within a step: there the derivative jumps.
#[test]
fn gradients_are_the_limits_of_differences() {
    let mut random = Random(1);
    let geometry = scene(random.rotation());
    let places: Vec<_> = (0..60).map(|_| (random.between(0.0, 1.6) * random.direction(), random.direction())).collect();
    let receivers = Receivers::points(places.iter().copied());
    let found = exact(&geometry, &receivers, true);
    for name in QUANTITIES {
        let gradients = values(&found, &format!("{name}_gradient"));
        let errors = values(&found, &format!("{name}_gradient_error"));
        let expected = differences(&geometry, &places, name, 1e-5);
        assert_eq!(gradients.len(), 3 * expected.len());
        let (mut steady, mut largest) = (0, 0.0f64);
        for (i, (&[gx, gy, gz], expected)) in gradients.as_chunks::<3>().0.iter().zip(&expected).enumerate() {
            for (axis, (found, (slope, change))) in [gx, gy, gz].into_iter().zip(expected).enumerate() {
                // Values of about 1 are known to 1e-14, of which a step of 1e-5 makes 1e-9.
                let rounding = 1e-8;
                assert!(errors[3 * i + axis] < rounding, "{name} {i}: {:e}", errors[3 * i + axis]);
                if *change < 1e-4 {
                    assert!((found - slope).abs() < 4.0 * change + rounding, "{name} {i}.{axis}: {found} {slope}");
                    steady += 1;
                }
                largest = largest.max(found.abs());
            }
        }
        assert!(steady * 10 > 9 * gradients.len(), "{name}: {steady} of {}", gradients.len());
        assert!(largest > 0.3, "{name} hardly changes: {largest}");
    }
}

/// On an edge that is not its own a receiver is solved by rays; its gradient comes from exact results beside it.
#[test]
fn where_rays_step_in_gradients_come_from_differences() {
    let cuboid = Cuboid { size: [2.0, 0.5, 2.0], ..Cuboid::default() }.mesh().unwrap();
    let far = TorusKnot { triangles: 400, ..TorusKnot::default() }.mesh().unwrap();
    let far = far.transformed(DAffine3::from_translation(4.0 * DVec3::Y));
    let geometry = assembled([cuboid, far], DQuat::IDENTITY);
    // The middle of an upper edge, which looks up: of the box it sees nothing, wherever it moves but down.
    let receivers = Receivers::points([(DVec3::new(0.1, 0.25, 1.0), DVec3::Y)]);
    let request = Request { gradients: true, ..request(&receivers, None, ORDER) };
    let outcome = integrate(&geometry, None, &receivers, &request, Method::Exact, None, &()).unwrap();
    assert_eq!(outcome.statistics.fallbacks["rays"], 1);
    let beside = exact(&geometry, &Receivers::points([(DVec3::new(0.1, 0.25 + 1e-9, 1.0), DVec3::Y)]), true);
    for name in QUANTITIES {
        let name = format!("{name}_gradient");
        let pairs =
            values(&outcome.arrays, &name).as_chunks::<3>().0.iter().zip(values(&beside, &name).as_chunks::<3>().0);
        let errors = values(&outcome.arrays, &format!("{name}_error")).as_chunks::<3>().0;
        for ((found, expected), error) in pairs.zip(errors) {
            // Downwards it enters the box: of the three slopes two are smooth.
            for axis in [0, 2] {
                let distance = (found[axis] - expected[axis]).abs();
                assert!(distance <= error[axis] + 1e-8, "{name}: {found:?} {expected:?} {error:?}");
            }
        }
    }
}

#[test]
fn other_methods_refuse() {
    let geometry = scene(DQuat::IDENTITY);
    let receivers = Receivers::points([(DVec3::ZERO, DVec3::Y)]);
    let wanted = Request { gradients: true, ..request(&receivers, None, ORDER) };
    for method in [Method::Isolines { lines: 16 }, Method::Qmc { samples: 16, seed: 0 }] {
        let error = integrate(&geometry, None, &receivers, &wanted, method, None, &()).unwrap_err();
        assert!(error.to_string().contains("exact"), "{error}");
    }
    let nothing = Request { gradients: true, bent_normal: true, ..Request::default() };
    let error = integrate(&geometry, None, &receivers, &nothing, Method::Exact, None, &()).unwrap_err();
    assert!(error.to_string().contains("gradients of what"), "{error}");
}
