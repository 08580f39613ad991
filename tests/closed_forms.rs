//! Scenes with a known answer, under every method.

#[path = "common/convergence.rs"]
mod convergence;
#[path = "common/outline.rs"]
mod outline;
#[path = "common/scenes.rs"]
mod scenes;

use std::f64::consts::{FRAC_PI_3, PI, TAU};

use convergence::{LINES, slope};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use outline::Blocker;
use scenes::{Random, assembled, rms, run, values};
use silhouette::bake::{Method, Receivers};
use silhouette::scene::shapes::{Cuboid, Icosphere, Opening, Plane, Room};
use silhouette::scene::{Environment, Geometry, Mesh};
use silhouette::sphere::{self, Order, closed_forms};

const ORDER: usize = 8;

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

const ROTATIONS: usize = 8;
const RECEIVERS: usize = 25;

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

fn spheres_over_ground() -> Vec<Known> {
    ensemble(1, |random, rotation| {
        let height = 1.0 + random.between(0.01, 2.0);
        let sphere = Icosphere::default().mesh().unwrap().transformed(DAffine3::from_translation(height * DVec3::Y));
        let receivers = (0..RECEIVERS).map(|_| (on_ground(random, 4.0), DVec3::Y)).collect();
        Known::new(sphere, true, Some(ground()), rotation, receivers)
    })
}

/// A receiver outside of a ball about the origin, which looks anywhere.
fn anywhere(random: &mut Random, from: f64, to: f64) -> (DVec3, DVec3) {
    (random.between(from, to) * random.direction(), random.direction())
}

fn spheres_cut_by_the_horizon() -> Vec<Known> {
    ensemble(2, |random, rotation| {
        let receivers = (0..RECEIVERS).map(|_| anywhere(random, 1.1, 4.0)).collect();
        Known::new(Icosphere::default().mesh().unwrap(), true, None, rotation, receivers)
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
        let receivers = (0..RECEIVERS).map(|_| anywhere(random, 0.3, 3.0)).collect();
        Known::new(polygon(corners), false, None, rotation, receivers)
    })
}

fn boxes() -> Vec<Known> {
    ensemble(5, |random, rotation| {
        let size = [(); 3].map(|()| random.between(0.2, 1.0));
        let cuboid = Cuboid { size, divisions: 1 + (size[0] * 4.0) as u32 }.mesh().unwrap();
        let receivers = (0..RECEIVERS).map(|_| anywhere(random, 0.9, 3.0)).collect();
        Known::new(cuboid, true, None, rotation, receivers)
    })
}

#[test]
fn measure() {
    for (name, e) in [("spheres", spheres_over_ground()), ("cut", spheres_cut_by_the_horizon()), ("discs", discs()), ("rect", rectangles()), ("boxes", boxes())] {
        let mut table = Vec::new();
        for lines in LINES {
            let (mut ao, mut sh) = (vec![], vec![]);
            for k in &e {
                let out = run(&k.geometry, None, &k.receivers, ORDER, Method::Isolines { lines });
                assert_eq!(out.statistics.depth_alarms, 0);
                ao.extend(values(&out.arrays, "ambient_occlusion").iter().zip(&k.occlusion).map(|(a, b)| a - b));
                sh.extend(values(&out.arrays, "visibility_sh").iter().zip(&k.visibility).map(|(a, b)| a - b));
            }
            let max = |v: &[f64]| v.iter().fold(0f64, |m, x| m.max(x.abs()));
            let s = f64::from(lines).powf(1.5);
            println!("{name} {lines}: ao C {:.3} max {:.3}  sh C {:.3} max {:.3}", s * rms(ao.iter().copied()), s * max(&ao), s * rms(sh.iter().copied()), s * max(&sh));
            table.push((rms(ao.iter().copied()), rms(sh.iter().copied())));
        }
        println!("{name} slopes {:.3} {:.3}", slope(&table.iter().map(|t| t.0).collect::<Vec<_>>()), slope(&table.iter().map(|t| t.1).collect::<Vec<_>>()));
    }
}
