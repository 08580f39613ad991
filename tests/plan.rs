//! The planner: the error asked for is reached, by every family.

use silhouette::bake::{Array, Family, Goal, Method, Outcome, Prepared, Receivers, Request};
use silhouette::integrate;
use silhouette::scene::Scene;

fn rmse(a: &Array, b: &Array) -> f64 {
    let squares: f64 = a.data.iter().zip(&b.data).map(|(a, b)| (a - b).powi(2)).sum();
    (squares / a.data.len() as f64).sqrt()
}

/// Receivers all over a sphere and the floor below it.
fn receivers() -> (Scene, Receivers) {
    let scene = Scene::builtin("icosphere").unwrap();
    let (vertices, _) = Receivers::vertices(&scene.geometry);
    let floor = (0..900).step_by(2).map(|k| {
        let (x, z) = (f64::from(k % 30) * 0.2 - 2.9, f64::from(k / 30) * 0.2 - 2.9);
        (glam::DVec3::new(x, 1e-3, z), glam::DVec3::Y)
    });
    let above = vertices.positions.iter().zip(&vertices.normals).step_by(5).map(|(&p, &n)| (p + 1e-3 * n, n));
    let all: Vec<_> = above.chain(floor).collect();
    (scene, Receivers::points(all))
}

fn run(scene: &Scene, receivers: &Receivers, request: &Request, method: Method) -> Outcome {
    integrate(&scene.geometry, scene.environment.as_ref(), receivers, request, method, None, &()).unwrap()
}

#[test]
fn the_error_asked_for_is_reached_by_every_family() {
    let (scene, receivers) = receivers();
    let request = Request { ambient_occlusion: true, visibility_sh: true, ..Request::default() };
    let truth = run(&scene, &receivers, &request, Method::Exact).arrays;
    let mut families = vec![None, Some(Family::Isolines), Some(Family::Qmc)];
    if cfg!(feature = "embree") {
        families.push(Some(Family::Embree));
    }
    for family in families {
        let prepared = Prepared::new(&scene.geometry, None);
        for error in [3e-2, 3e-3] {
            let plan = prepared.plan(&receivers, &request, Goal { error, family }, &()).unwrap();
            assert!(plan.report.expected_error <= error, "{plan}");
            assert_eq!(plan.report.candidates[0].expected_error, plan.report.expected_error);
            let arrays = run(&scene, &receivers, &request, plan.method).arrays;
            let worst = ["ambient_occlusion", "visibility_sh"]
                .map(|name| rmse(arrays.get(name).unwrap(), truth.get(name).unwrap()))
                .into_iter()
                .fold(0.0, f64::max);
            // The pilot is a sample of the receivers.
            assert!(worst < 1.5 * error, "{family:?} {error:e}: {worst:e} by {plan}");
            let estimate = plan.report.estimate(&arrays);
            assert!((0.3..4.0).contains(&(estimate / worst)) || plan.method == Method::Exact, "{estimate} {worst}");
        }
    }
}

/// Far from the numbers of isolines that are measured first, others are tried where there are receivers enough to pay for it. The law
/// alone would ask for 2800: their error is 1.14e-6.
#[test]
fn numbers_of_isolines_are_tried_before_they_are_believed() {
    let scene = Scene::builtin("icosphere").unwrap();
    let floor = (0..60_000).map(|k| {
        let (x, z) = (f64::from(k % 300) * 0.02 - 2.99, f64::from(k / 300) * 0.03 - 2.98);
        (glam::DVec3::new(x, 1e-3, z), glam::DVec3::Y)
    });
    let receivers = Receivers::points(floor.collect::<Vec<_>>());
    let request = Request { ambient_occlusion: true, ..Request::default() };
    let goal = Goal { error: 1e-6, family: Some(Family::Isolines) };
    let plan = Prepared::new(&scene.geometry, None).plan(&receivers, &request, goal, &()).unwrap();
    let some = receivers.pick((0..receivers.len()).step_by(37));
    let [found, truth] = [plan.method, Method::Exact].map(|method| run(&scene, &some, &request, method).arrays);
    let error = rmse(found.get("ambient_occlusion").unwrap(), truth.get("ambient_occlusion").unwrap());
    assert!((0.6..1.0).contains(&(error / goal.error)), "{error:e} by {plan}");
    let estimate = plan.report.estimate(&found);
    assert!((0.5..2.0).contains(&(estimate / error)), "{estimate:e} instead of {error:e}");
}

#[test]
fn small_errors_and_gradients_are_left_to_the_exact_method() {
    let (scene, receivers) = receivers();
    let request = Request { ambient_occlusion: true, ..Request::default() };
    let prepared = Prepared::new(&scene.geometry, None);
    let plan =
        |request: Request, error| prepared.plan(&receivers, &request, Goal { error, family: None }, &()).unwrap();
    assert_eq!(plan(request, 1e-8).method, Method::Exact);
    assert_eq!(plan(Request { gradients: true, ..request }, 1e-2).method, Method::Exact);
    // What nothing reaches is not promised.
    let beyond = plan(request, 1e-30);
    assert!(beyond.method == Method::Exact && beyond.report.expected_error > 1e-30, "{beyond}");
}

#[test]
fn few_receivers_and_nonsense() {
    let (scene, receivers) = receivers();
    let request = Request { irradiance: true, ..Request::default() };
    let prepared = Prepared::new(&scene.geometry, scene.environment.as_ref());
    let goal = Goal { error: 1e-2, family: None };
    for count in [1, 3] {
        prepared.plan(&receivers.pick(0..count), &request, goal, &()).unwrap();
    }
    for error in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = prepared.plan(&receivers, &request, Goal { error, ..goal }, &());
        assert!(refused.unwrap_err().to_string().contains("cannot be reached"));
    }
}
