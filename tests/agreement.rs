//! Isolines against rays on scenes without a closed form, however dirty; and the same bits however they are computed.

#[path = "common/scenes.rs"]
mod scenes;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::SeqCst};

use glam::{DQuat, DVec3, Vec3};
use rayon::ThreadPoolBuilder;
use scenes::{Random, assembled, request, rms, run, values};
use silhouette::bake::{Arrays, Control, Method, Partial, Prepared, Provenance, Receivers, Request, Skips, integrate};
use silhouette::scene::shapes::{Building, Cuboid, Foliage, Icosphere, Opening, Plane, Room, TorusKnot};
use silhouette::scene::{Environment, Geometry, Mesh};

const ORDER: usize = 3;
const LINES: u32 = 256;
const ISOLINES: Method = Method::Isolines { lines: LINES };

/// Root-mean-square error of the isolines on scenes of many contours: twice that past one convex blocker, see
/// `closed_forms.rs`; against 16384 rays, whose own error is about 2e-3, it hardly matters.
fn isoline_error() -> f64 {
    2.0 * 0.65 * f64::from(LINES).powf(-1.5)
}

/// The isolines are within 4.5 standard errors, and their own error, of the judge at every receiver, without bias, and
/// their distance in the mean square is that of the judge's error.
#[track_caller]
fn agrees(name: &str, geometry: &Geometry, receivers: &Receivers) {
    let found = run(geometry, None, receivers, ORDER, ISOLINES);
    assert_eq!(found.statistics.depth_alarms, 0, "{name}");
    let judged = run(geometry, None, receivers, ORDER, Method::Qmc { samples: 1 << 12, seed: 1 }).arrays;
    for array in ["ambient_occlusion", "visibility_sh", "transfer_sh"] {
        let Some(judge) = judged.get(array) else { continue };
        let width = judge.data.len() / receivers.len();
        let errors = values(&judged, &format!("{array}_error"));
        // A lone standard error, estimated from eight randomisations, may be far too small: the typical one joins it.
        let typical = rms(errors.iter().copied());
        let differences: Vec<f64> =
            values(&found.arrays, array).iter().zip(&judge.data).map(|(found, judge)| found - judge).collect();
        for (i, (difference, error)) in differences.iter().zip(errors).enumerate() {
            let allowed = 4.5 * (error.hypot(typical) + isoline_error());
            assert!(difference.abs() < allowed, "{name}: {array} of receiver {}: {difference:e}", i / width);
        }
        let spread = rms(differences.iter().copied());
        assert!(
            spread < 1.25 * typical.hypot(isoline_error()),
            "{name}: {array} differs by {spread:e} for {typical:e}"
        );
        for component in 0..width {
            let mean = differences.iter().skip(component).step_by(width).sum::<f64>() / receivers.len() as f64;
            let allowed = 4.5 * typical.hypot(isoline_error()) / (receivers.len() as f64).sqrt();
            assert!(mean.abs() < allowed, "{name}: {array}, component {component}, has a bias of {mean:e}");
        }
    }
}

/// Points about the origin that look anywhere.
fn points(random: &mut Random, count: usize, reach: f64) -> Receivers {
    Receivers::points((0..count).map(|_| (random.between(0.0, reach) * random.direction(), random.direction())))
}

fn knot(triangles: usize) -> Mesh {
    TorusKnot { triangles, ..TorusKnot::default() }.mesh().unwrap()
}

fn icosphere(subdivisions: u32) -> Mesh {
    Icosphere { radius: 1.0, subdivisions }.mesh().unwrap()
}

fn ground(height: f64) -> Mesh {
    let plane = Plane { size: [6.0; 2], divisions: [4; 2] }.mesh().unwrap();
    plane.transformed(glam::DAffine3::from_translation(height * DVec3::Y))
}

fn foliage(triangles: usize) -> Mesh {
    Foliage { triangles, radius: 1.0, leaf: 0.3, seed: 2 }.mesh().unwrap()
}

#[test]
fn tidy_scenes() {
    let mut random = Random(1);
    let rooms = [Opening::Window, Opening::Ceiling]
        .map(|opening| Room { opening, subdivisions: 1, size: [3.0, 1.5, 2.5], ..Room::default() }.mesh().unwrap());
    let scenes = [
        ("knot over ground", vec![knot(600), ground(-0.7)]),
        ("icosphere over ground", vec![icosphere(2), ground(-1.1)]),
        ("foliage over ground", vec![foliage(300), ground(-1.4)]),
        ("box over ground", vec![Cuboid { divisions: 3, ..Cuboid::default() }.mesh().unwrap(), ground(-0.6)]),
        ("room with a window", vec![rooms[0].clone()]),
        ("room without a ceiling", vec![rooms[1].clone()]),
    ];
    for (name, meshes) in scenes {
        for rotation in [DQuat::IDENTITY, random.rotation()] {
            let geometry = assembled(meshes.clone(), rotation);
            agrees(name, &geometry, &points(&mut random, 100, 1.6));
            let (vertices, _) = Receivers::vertices(&geometry);
            agrees(name, &geometry, &some(&geometry, &vertices));
        }
    }
}

/// At most about a hundred of a geometry's vertices, with the faces that are theirs.
fn some(geometry: &Geometry, vertices: &Receivers) -> Receivers {
    let faces = geometry.vertex_faces();
    let step = vertices.len().div_ceil(100);
    let on_faces = (0..vertices.len()).step_by(step).filter_map(|i| {
        let face = *faces.of(i as u32).first()?;
        let [a, b, c] = geometry.corners(face);
        // Well inside the face, on the side it was wound for.
        Some((0.5 * a + 0.3 * b + 0.2 * c, (b - a).cross(c - a).normalize(), face))
    });
    Receivers::on_faces(on_faces)
}

/// A share of the faces, by chance.
fn chosen(random: &mut Random, mesh: &Mesh, share: f64) -> Vec<bool> {
    mesh.triangles.iter().map(|_| random.between(0.0, 1.0) < share).collect()
}

/// Some faces wound the other way.
fn flipped(random: &mut Random, mut mesh: Mesh) -> Mesh {
    let flip = chosen(random, &mesh, 0.4);
    mesh.triangles.iter_mut().zip(flip).filter(|(_, flip)| *flip).for_each(|(t, _)| t.swap(0, 2));
    mesh
}

/// Some faces twice, from a copy of their corners, wound either way and begun at any of them.
fn doubled(random: &mut Random, mut mesh: Mesh) -> Mesh {
    let double = chosen(random, &mesh, 0.4);
    let copies: Vec<[u32; 3]> = mesh.triangles.iter().zip(double).filter(|(_, d)| *d).map(|(t, _)| *t).collect();
    for (k, [a, b, c]) in copies.into_iter().enumerate() {
        let base = mesh.positions.len() as u32;
        mesh.positions.extend([a, b, c].map(|v| mesh.positions[v as usize]));
        mesh.triangles.push([[0, 1, 2], [2, 1, 0], [1, 2, 0]][k % 3].map(|v| base + v));
    }
    mesh
}

/// Some faces missing.
fn torn(random: &mut Random, mut mesh: Mesh) -> Mesh {
    let tear = chosen(random, &mesh, 0.3);
    let mut tear = tear.iter();
    mesh.triangles.retain(|_| !tear.next().unwrap());
    mesh
}

/// Every face with corners of its own, moved apart by far less than an edge, so that nothing welds.
fn unwelded(random: &mut Random, mesh: Mesh) -> Mesh {
    let positions: Vec<Vec3> = mesh
        .triangles
        .as_flattened()
        .iter()
        .map(|&v| mesh.positions[v as usize] + (1e-4 * random.direction()).as_vec3())
        .collect();
    let triangles = (0..mesh.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Mesh::new("unwelded", positions, triangles)
}

/// Some faces cut in two through the middle of an edge that the neighbour keeps whole.
fn with_t_junctions(random: &mut Random, mut mesh: Mesh) -> Mesh {
    let cut = chosen(random, &mesh, 0.4);
    for (t, cut) in cut.into_iter().enumerate() {
        if cut {
            let [a, b, c] = mesh.triangles[t];
            let m = mesh.positions.len() as u32;
            mesh.positions.push(mesh.positions[a as usize].midpoint(mesh.positions[b as usize]));
            mesh.triangles[t] = [a, m, c];
            mesh.triangles.push([m, b, c]);
        }
    }
    mesh
}

/// Fins on some edges, which then have three or four faces.
fn finned(random: &mut Random, mut mesh: Mesh) -> Mesh {
    let fin = chosen(random, &mesh, 0.3);
    for (t, fin) in fin.into_iter().enumerate() {
        if fin {
            let [a, b, _] = mesh.triangles[t];
            let tip = mesh.positions.len() as u32;
            let middle = mesh.positions[a as usize].midpoint(mesh.positions[b as usize]);
            mesh.positions.push(middle + (0.3 * random.direction()).as_vec3());
            mesh.triangles.push(if t % 2 == 0 { [a, b, tip] } else { [tip, b, a] });
        }
    }
    mesh
}

type Spoil = fn(&mut Random, Mesh) -> Mesh;

#[test]
fn dirty_scenes() {
    let mut random = Random(2);
    let spoils: [(&str, Spoil); 6] = [
        ("flipped", flipped),
        ("doubled", doubled),
        ("torn", torn),
        ("unwelded", unwelded),
        ("t-junctions", with_t_junctions),
        ("finned", finned),
    ];
    for (name, mesh) in [("knot", knot(400)), ("icosphere", icosphere(2))] {
        let all: Mesh = spoils.iter().fold(mesh.clone(), |mesh, (_, spoil)| spoil(&mut random, mesh));
        let one_by_one = spoils.map(|(how, spoil)| (how, spoil(&mut random, mesh.clone())));
        for (how, mesh) in one_by_one.into_iter().chain([("all of it", all)]) {
            let geometry = assembled([mesh, ground(-1.1)], random.rotation());
            agrees(&format!("{name}, {how}"), &geometry, &points(&mut random, 100, 1.6));
            let (vertices, _) = Receivers::vertices(&geometry);
            agrees(&format!("{name}, {how}, on its faces"), &geometry, &some(&geometry, &vertices));
        }
    }
}

/// Largest difference of two results. Bent normals, whose direction is all that is left of a vanishing vector, are left
/// out.
fn distance(a: &Arrays, b: &Arrays) -> f64 {
    let linear = a.iter().filter(|array| array.name != "bent_normal");
    let pairs = linear.flat_map(|array| array.data.iter().zip(values(b, &array.name)));
    pairs.fold(0.0, |most, (a, b)| f64::max(most, (a - b).abs()))
}

#[test]
fn winding_and_welding_change_nothing() {
    // Unlike rays, these can be told apart to rounding: the same faces, wound and joined in other ways.
    let mut random = Random(3);
    let mesh = knot(600);
    let rotation = random.rotation();
    let receivers = points(&mut random, 100, 1.6);
    let tidy = assembled([mesh.clone()], rotation);
    let expected = run(&tidy, None, &receivers, ORDER, ISOLINES).arrays;
    for spoil in [flipped, doubled] {
        let geometry = assembled([spoil(&mut random, mesh.clone())], rotation);
        assert_eq!(geometry.triangles.len(), mesh.triangles.len());
        let difference = distance(&run(&geometry, None, &receivers, ORDER, ISOLINES).arrays, &expected);
        assert!(difference < 1e-11, "{difference:e}");
    }
    let loose = Geometry {
        positions: tidy.triangles.as_flattened().iter().map(|&v| tidy.positions[v as usize]).collect(),
        triangles: (0..tidy.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect::<Arc<[_]>>(),
        ..tidy.clone()
    };
    let difference = distance(&run(&loose, None, &receivers, ORDER, ISOLINES).arrays, &expected);
    assert!(difference < 1e-11, "{difference:e}");
}

/// A scene in which tiles are shared: clusters of receivers, with light.
fn shared() -> (Geometry, Environment, Receivers) {
    let mut random = Random(4);
    let geometry = assembled([knot(600), ground(-0.7)], random.rotation());
    let mut receivers = Vec::new();
    for _ in 0..12 {
        let centre = 1.5 * random.direction();
        receivers.extend((0..25).map(|_| (centre + 0.03 * random.direction(), random.direction())));
    }
    let light = (0..32).map(|k| Vec3::new(1.0, k as f32, (k * k % 7) as f32)).collect::<Vec<_>>();
    (geometry, Environment::new(8, 4, light).unwrap(), Receivers::points(receivers))
}

const METHODS: [Method; 3] = [Method::Isolines { lines: 64 }, Method::Exact, Method::Qmc { samples: 64, seed: 5 }];

#[test]
fn threads_change_no_bit() {
    let (geometry, environment, receivers) = shared();
    for method in METHODS {
        let [one, two, three] = [1, 2, 3].map(|threads| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let out = pool.install(|| run(&geometry, Some(&environment), &receivers, ORDER, method));
            assert_eq!(out.statistics.threads, threads);
            out.arrays
        });
        assert!(one == two && two == three, "{method}");
    }
}

/// Stops after some receivers.
struct Impatient {
    done: AtomicU64,
    enough: u64,
}

impl Control for Impatient {
    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, SeqCst);
    }

    fn cancelled(&self) -> bool {
        self.done.load(SeqCst) >= self.enough
    }
}

#[test]
fn interruptions_change_no_bit() {
    let (geometry, environment, receivers) = shared();
    let request = request(&receivers, Some(&environment), ORDER);
    for method in METHODS {
        let whole = run(&geometry, Some(&environment), &receivers, ORDER, method).arrays;
        let mut kept = None;
        let mut rounds = 0;
        let resumed = loop {
            let control = Impatient { done: AtomicU64::new(0), enough: 40 };
            let out = integrate(&geometry, Some(&environment), &receivers, &request, method, kept, &control).unwrap();
            let done = out.done.iter().filter(|&&done| done).count();
            if done == receivers.len() {
                break out.arrays;
            }
            for (i, done) in out.done.iter().enumerate() {
                let row = &values(&out.arrays, "visibility_sh")[i * ORDER * ORDER..][..ORDER * ORDER];
                assert!(*done || row.iter().all(|&x| x == 0.0));
            }
            kept =
                Some(Partial { arrays: out.arrays, done: out.done, provenance: Provenance::new(method.to_string()) });
            rounds += 1;
        };
        assert!(rounds >= 2 && resumed == whole, "{method}: {rounds} rounds");
    }
}

/// Work that is left out because it changes nothing changes nothing.
#[test]
fn skips_change_no_bit() {
    let room = Room { subdivisions: 1, size: [3.0, 1.5, 2.5], ..Room::default() }.mesh().unwrap();
    let room = assembled([room], DQuat::IDENTITY);
    let (vertices, _) = Receivers::vertices(&room);
    let (geometry, environment, points) = shared();
    let far = Receivers::points((0..20).map(|i| (DVec3::new(50.0, f64::from(i), 0.0), DVec3::X)));
    let probes = Receivers::probes(points.positions[..40].to_vec());
    let building = Building { rooms: [3, 1], room: Room { subdivisions: 2, ..Room::default() }, ..Building::default() };
    let building = assembled([building.mesh().unwrap()], DQuat::IDENTITY);
    let (everywhere, _) = Receivers::vertices(&building);
    let inside = everywhere.pick((0..everywhere.len()).step_by(50));
    let all = Skips::default();
    let fewer: Vec<Skips> = Skips::each().into_iter().map(|(_, skips)| skips).chain([Skips::NONE]).collect();
    let only_light = Request { irradiance: true, ..Request::default() };
    for (geometry, receivers, only) in [
        (&room, &vertices, None),
        (&geometry, &points, None),
        (&geometry, &far, None),
        (&geometry, &far, Some(&only_light)),
        (&geometry, &probes, None),
        (&building, &inside, None),
        (&building, &inside, Some(&only_light)),
    ] {
        let request = only.cloned().unwrap_or_else(|| request(receivers, Some(&environment), ORDER));
        let with = |skips| {
            let method = Method::Isolines { lines: 32 };
            let mut prepared = Prepared::new(geometry, Some(&environment));
            prepared.set_skips(skips);
            prepared.integrate(receivers, &request, method, None, &()).unwrap()
        };
        let expected = with(all);
        for &skips in &fewer {
            let found = with(skips);
            assert!(found.arrays == expected.arrays, "{skips:?}");
            let count = |name: &str| (found.statistics.skipped[name], expected.statistics.skipped[name]);
            assert!(skips.shared_searches || count("shared_searches").0 == 0);
            assert!(skips.hidden_bodies || count("hidden_bodies").0 == 0);
            assert!(!std::ptr::eq(geometry, &building) || count("hidden_bodies").1 > 0);
            assert!(skips.below_horizon || count("contours_below_horizon").0 >= count("contours_below_horizon").1);
            assert!(skips.below_horizon || count("bodies_below_horizon").0 == 0);
            assert!(!std::ptr::eq(geometry, &building) || count("bodies_below_horizon").1 > 0);
        }
    }
}

#[test]
fn the_order_of_receivers_changes_no_bit() {
    let (geometry, environment, receivers) = shared();
    let mut random = Random(6);
    // Many vertices in line with each other for the receivers in the middle; and crowds of contours.
    let boxes = (0..27).map(|k| {
        let place = DVec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9)) - 1.0;
        let cube = Cuboid { size: [0.5; 3], divisions: 2 }.mesh().unwrap();
        cube.transformed(glam::DAffine3::from_translation(place))
    });
    let boxes = assembled(boxes, DQuat::IDENTITY);
    let knots = (0..4).map(|_| {
        let place = glam::DAffine3::from_rotation_translation(random.rotation(), random.direction());
        knot(2000).transformed(place)
    });
    let knots = assembled(knots.collect::<Vec<_>>(), DQuat::IDENTITY);
    let between = Receivers::points((0..125).map(|k| {
        let place = DVec3::new(f64::from(k % 5), f64::from(k / 5 % 5), f64::from(k / 25)) / 4.0 - 0.625;
        (place, if k % 2 == 0 { DVec3::Y } else { random.direction() })
    }));
    for (geometry, receivers, light, methods) in [
        (&geometry, &receivers, Some(&environment), &[ISOLINES, Method::Exact][..]),
        (&boxes, &between, None, &[Method::Exact]),
        (&knots, &between, None, &[Method::Exact]),
    ] {
        let mut order: Vec<usize> = (0..receivers.len()).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, random.between(0.0, (i + 1) as f64) as usize);
        }
        // Half of them alone have other tiles.
        for count in [order.len(), order.len() / 2] {
            let order = &order[..count];
            let permuted = Receivers::points(order.iter().map(|&i| (receivers.positions[i], receivers.normals[i])));
            for &method in methods {
                let [a, b] =
                    [receivers, &permuted].map(|receivers| run(geometry, light, receivers, ORDER, method).arrays);
                for (a, b) in a.iter().zip(b.iter()) {
                    let width = b.data.len() / order.len();
                    for (to, &from) in order.iter().enumerate() {
                        let (row, again) = (&a.data[from * width..][..width], &b.data[to * width..][..width]);
                        assert_eq!(row, again, "{} of {from}, {method}", a.name);
                    }
                }
            }
        }
    }
}
