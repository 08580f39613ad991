//! Time of a frame of sphere proxies and of its stages: 200 spheres, a display of 1024 x 1024, receivers of 256 x 256, as
//! `silhouette animate` renders them. The frame is first compared with one of other threads and other receivers.

use criterion::{Criterion, criterion_group, criterion_main};
use silhouette::Scene;
use silhouette::proxy::{
    Actor, Coverage, DistantLight, Exponentiator, HarmonicBuffer, INDIRECT_LEN, IndirectTable, Interpolant, LogTable,
    Posed, Proxy, Renderer, Settings, Shading, ShadingLight, Surface, exponentiate, shade, splat, splat_indirect,
    static_surface,
};

struct Frames {
    renderer: Renderer,
    light: DistantLight,
    bodies: [Vec<Surface>; 2],
    proxies: [Vec<Proxy>; 2],
}

fn frames(settings: Settings) -> Frames {
    let scene = Scene::builtin("walkers").expect("is built in");
    let camera = scene.camera.expect("has a camera");
    let environment = scene.environment.expect("has a sky");
    let light = DistantLight::new(&environment, settings.order);
    let set = static_surface(&scene.geometry, camera.position());
    let renderer = Renderer::new(settings, &camera, &set, &light, Some(&environment)).expect("settings are good");
    let at = |time: f64| {
        let actors = scene.characters.iter().map(|body| Actor::new(body, &()).expect("is made up"));
        let posed = actors.map(|actor| actor.pose(time).expect("has its own spheres"));
        let (mut bodies, mut proxies) = (Vec::new(), Vec::new());
        for Posed { surface, proxies: spheres } in posed {
            bodies.push(surface);
            proxies.extend(spheres);
        }
        (bodies, proxies)
    };
    let ((bodies, proxies), (later_bodies, later_proxies)) = (at(0.0), at(0.2));
    Frames { renderer, light, bodies: [bodies, later_bodies], proxies: [proxies, later_proxies] }
}

fn bench(criterion: &mut Criterion) {
    let settings = Settings::default();
    let Frames { mut renderer, light, bodies, proxies } = frames(settings);

    // Right before fast: coarse receivers show what fine ones do.
    let mut fine = frames(Settings { receiver_scale: 1, ..settings }).renderer;
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

criterion_group!(benches, bench);
criterion_main!(benches);
