//! Time of a frame of sphere proxies and of its stages: 200 spheres, a display of 1024 x 1024, receivers of 256 x 256, as
//! `silhouette animate` renders them; on a graphics processor with the feature `gpu`. The frame is first compared with one of
//! other receivers, that of a graphics processor with the processor's. Then times of fits and of what goes before a frame.

use criterion::{Criterion, criterion_group, criterion_main};
use glam::DAffine3;
use silhouette::Scene;
use silhouette::bake::Method;
use silhouette::proxy::{
    Actor, Coverage, DistantLight, Exponentiator, HarmonicBuffer, INDIRECT_LEN, IndirectTable, Interpolant, LogTable,
    Posed, Probes, Proxy, Renderer, Settings, Shading, ShadingLight, SphereSet, Surface, baked_surface, exponentiate,
    fit, shade, splat, splat_indirect, static_surface,
};
use silhouette::scene::shapes::TorusKnot;
use silhouette::scene::{Camera, Environment, GeometryBuilder};

struct Frames {
    renderer: Renderer,
    light: DistantLight,
    bodies: [Vec<Surface>; 2],
    proxies: [Vec<Proxy>; 2],
}

/// All bodies of the scene at a time, and their spheres.
fn pose(scene: &Scene, time: f64) -> (Vec<Surface>, Vec<Proxy>) {
    let actors = scene.characters.iter().map(|body| Actor::new(body, &()).expect("is made up"));
    let (mut bodies, mut proxies) = (Vec::new(), Vec::new());
    for Posed { surface, proxies: spheres } in actors.map(|actor| actor.pose(time).expect("has its own spheres")) {
        bodies.push(surface);
        proxies.extend(spheres);
    }
    (bodies, proxies)
}

fn walkers() -> (Scene, Camera, Environment) {
    let scene = Scene::builtin("walkers").expect("is built in");
    let (camera, environment) = (scene.camera.clone(), scene.environment.clone());
    (scene, camera.expect("has a camera"), environment.expect("has a sky"))
}

/// With what stands still baked, or not.
fn frames(settings: Settings, bake: Option<Method>) -> Frames {
    let (scene, camera, environment) = walkers();
    let light = DistantLight::new(&environment, settings.order);
    let (eye, order) = (camera.position(), settings.order);
    let set = match bake {
        None => static_surface(&scene.geometry, eye),
        Some(method) => baked_surface(&scene.geometry, eye, order, method, &()).expect("nothing stops it"),
    };
    let renderer = Renderer::new(settings, &camera, &set, &light, Some(&environment)).expect("settings are good");
    let ((mut bodies, proxies), (mut later_bodies, later_proxies)) = (pose(&scene, 0.0), pose(&scene, 0.2));
    if let Some(method) = bake {
        let mut probes = Probes::new(&scene.geometry, 0.25, order, method).expect("the spacing is good");
        for bodies in [&mut bodies, &mut later_bodies] {
            probes.shade(bodies, &()).expect("nothing stops it");
        }
    }
    Frames { renderer, light, bodies: [bodies, later_bodies], proxies: [proxies, later_proxies] }
}

fn bench(criterion: &mut Criterion) {
    let settings = Settings::default();
    let Frames { mut renderer, light, bodies, proxies } = frames(settings, None);

    // Right before fast: coarse receivers show what fine ones do.
    let mut fine = frames(Settings { receiver_scale: 1, ..settings }, None).renderer;
    renderer.render(&bodies[0], &proxies[0]).expect("proxies are good");
    fine.render(&bodies[0], &proxies[0]).expect("proxies are good");
    let squares = renderer.radiance().iter().flatten().zip(fine.radiance().iter().flatten());
    let error = (squares.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / (3 << 20) as f64).sqrt();
    assert!(error < 5e-3, "RMSE of coarse receivers: {error}");
    drop(fine);

    let mut group = criterion.benchmark_group("proxy");
    group.sample_size(10);
    let mut frame = 0;
    group.bench_function("frame", |bencher| {
        bencher.iter(|| {
            frame += 1;
            renderer.render(&bodies[frame % 2], &proxies[frame % 2]).expect("proxies are good")
        });
    });
    group.bench_function("still frame", |bencher| {
        bencher.iter(|| renderer.render(&bodies[frame % 2], &proxies[frame % 2]).expect("proxies are good"));
    });

    let receivers = renderer.receivers().clone();
    let places = receivers.stride() * receivers.height();
    let [shadows, indirect]: [Coverage; 2] = renderer.coverage();
    let rule = settings.self_shadowing;
    let spheres = &proxies[frame % 2];
    let table = LogTable::new(settings.internal_order);
    let mut log = HarmonicBuffer::zeros(settings.internal_order.len(), places);
    group.bench_function("splat", |bencher| {
        bencher.iter(|| splat(&receivers, spheres, &table, rule, shadows, &mut log));
    });
    let exponentiator = Exponentiator::new(settings.exponential, settings.internal_order);
    let mut visibility = HarmonicBuffer::zeros(settings.order.len(), places);
    group.bench_function("exponentiate", |bencher| {
        bencher.iter(|| exponentiate(&log, &exponentiator, &mut visibility));
    });
    let table = IndirectTable::new(settings.indirect.expect("is on by default"));
    let reflected = light.reflected();
    let mut irradiance = HarmonicBuffer::zeros(INDIRECT_LEN, places);
    group.bench_function("splat_indirect", |bencher| {
        bencher.iter(|| splat_indirect(&receivers, spheres, &reflected, &table, rule, indirect, &mut irradiance));
    });
    let light = ShadingLight::new(&light);
    let mut shading = Shading::default();
    group.bench_function("shade", |bencher| {
        bencher.iter(|| shade(&receivers, &visibility, Some(&irradiance), &light, Interpolant::Vectors, &mut shading));
    });
    group.finish();
}

/// Frames over a set whose visibility is baked, and what that takes besides.
fn bench_baked(criterion: &mut Criterion) {
    let (settings, method) = (Settings::default(), Method::Isolines { lines: 64 });
    let Frames { mut renderer, bodies, proxies, .. } = frames(settings, Some(method));
    let mut group = criterion.benchmark_group("proxy");
    group.sample_size(10);
    let mut frame = 0;
    group.bench_function("frame, static x dynamic", |bencher| {
        bencher.iter(|| {
            frame += 1;
            renderer.render(&bodies[frame % 2], &proxies[frame % 2]).expect("proxies are good")
        });
    });
    let (scene, ..) = walkers();
    let mut probes = Probes::new(&scene.geometry, 0.25, settings.order, method).expect("the spacing is good");
    let (mut bodies, _) = pose(&scene, 0.0);
    probes.shade(&mut bodies, &()).expect("nothing stops it");
    group.bench_function("probes, known", |bencher| {
        bencher.iter(|| probes.shade(&mut bodies, &()).expect("nothing stops it"));
    });
    group.bench_function("pose", |bencher| bencher.iter(|| pose(&scene, 0.2)));
    group.finish();
}

fn bench_fit(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("proxy/fit");
    group.sample_size(10);
    let mut builder = GeometryBuilder::default();
    let knot = TorusKnot { triangles: 20_000, ..TorusKnot::default() }.mesh().expect("is possible");
    builder.add(knot, DAffine3::IDENTITY).expect("is possible");
    let knot = builder.build();
    for count in [16, 64] {
        let (set, _) = fit(&knot, count, &()).expect("fits");
        assert!(SphereSet::uncovered(&knot, &set.spheres, 1e-3).is_none());
        group.bench_function(format!("{count} spheres, 20 000 triangles"), |bencher| {
            bencher.iter(|| fit(&knot, count, &()).expect("fits"));
        });
    }
    group.finish();
}

/// The frame on whatever graphics processor there is, which its name tells.
#[cfg(feature = "gpu")]
fn bench_gpu(criterion: &mut Criterion) {
    use silhouette::proxy::gpu;

    let settings = Settings::default();
    let Frames { renderer: mut cpu, light, bodies, proxies } = frames(settings, None);
    let (scene, camera, environment) = walkers();
    let set = static_surface(&scene.geometry, camera.position());
    let gpu = gpu::Gpu::open().expect("there is a device");
    let name = gpu.name().to_owned();
    let device = gpu::Renderer::new(gpu, settings, &camera, &set, &light, Some(&environment));
    let mut device = device.expect("the device is large enough");
    cpu.render(&bodies[0], &proxies[0]).expect("proxies are good");
    device.render(&bodies[0], &proxies[0]).expect("proxies are good");
    let squares = device.radiance().iter().flatten().zip(cpu.radiance().iter().flatten());
    let error = (squares.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / (3 << 20) as f64).sqrt();
    // Pixels on edges go to one triangle here and to another there.
    assert!(error < 2e-2, "RMSE on {name}: {error}");

    let mut group = criterion.benchmark_group("proxy");
    group.sample_size(10);
    let mut frame = 0;
    group.bench_function(format!("frame on {name}"), |bencher| {
        bencher.iter(|| {
            frame += 1;
            device.render(&bodies[frame % 2], &proxies[frame % 2]).expect("proxies are good")
        });
    });
    group.finish();
}

#[cfg(not(feature = "gpu"))]
criterion_group!(benches, bench, bench_baked, bench_fit);
#[cfg(feature = "gpu")]
criterion_group!(benches, bench, bench_baked, bench_fit, bench_gpu);
criterion_main!(benches);
