//! Every stage against its twin on the CPU. Without a device these fail: `tests/all` installs one in software.

use glam::{DAffine3, DVec3, Vec3};

use super::kernel::{Stage, Timer, groups_of_8x8};
use super::passes::{Buffers, COUNTS, Light, Passes, Shaders, Sizes, View};
use super::setup::{Setup, Target};
use super::{Gpu, Renderer};
use crate::proxy::{
    Coverage, DirectProduct, DistantLight, Exponential, Exponentiator, HarmonicBuffer, INDIRECT_LEN, IndirectOperator,
    IndirectTable, Interpolant, LogTable, Proxy, Receivers, Resampling, SelfShadowing, Settings, Shading, ShadingLight,
    Surface, Upsampling, Viewport, direct_product, draw, exponentiate, shade, splat, splat_indirect, upsample,
};
use crate::scene::shapes::{Plane, Random, TorusKnot};
use crate::scene::{Camera, Geometry, GeometryBuilder, Mesh};
use crate::sphere::Order;

fn gpu() -> Gpu {
    Gpu::open().expect("these tests need a device; one in software is in Debian's mesa-vulkan-drivers")
}

fn surface(mesh: Mesh, place: DVec3, transfer_len: usize) -> Surface {
    let mut builder = GeometryBuilder::default();
    builder.add(mesh, DAffine3::from_translation(place)).unwrap();
    let geometry: Geometry = builder.build();
    let normals = geometry.angle_weighted_normals();
    let mut random = Random::new(8);
    Surface {
        positions: geometry.positions.to_vec(),
        normals: normals.iter().map(|n| n.unwrap_or(DVec3::Z).as_vec3()).collect(),
        triangles: geometry.triangles.clone(),
        albedo: (0..geometry.triangles.len()).map(|i| Vec3::new(0.2, 0.5, 0.1 * (i % 7) as f32)).collect(),
        transfer: (0..geometry.positions.len() * transfer_len).map(|_| random.between(-0.2, 0.9) as f32).collect(),
        transfer_len,
    }
}

fn floor(transfer_len: usize) -> Surface {
    let plane = Plane { size: [12.0, 12.0], divisions: [6, 6] };
    surface(plane.mesh().unwrap(), DVec3::ZERO, transfer_len)
}

fn knot() -> Surface {
    surface(TorusKnot { triangles: 1500, ..TorusKnot::default() }.mesh().unwrap(), DVec3::new(0.3, 1.4, -0.2), 0)
}

fn camera(resolution: [u32; 2]) -> Camera {
    Camera::new(DVec3::new(2.0, 3.5, 6.0), DVec3::new(0.0, 0.8, 0.0), DVec3::Y, 45.0, resolution).unwrap()
}

/// Spheres on and above the floor, some that reach through it, some that lie in each other.
fn proxies(count: usize) -> Vec<Proxy> {
    let mut random = Random::new(21);
    let mut proxy = |i: usize| Proxy {
        center: (DVec3::new(0.0, 0.9, 0.0) + DVec3::new(3.0, 1.0, 3.0) * random.in_ball()).as_vec3(),
        radius: random.between(0.05, 0.4) as f32,
        albedo: Vec3::new(0.9, 0.3 + 0.1 * (i % 5) as f32, 0.2),
        share: 0.4 + 0.2 * (i % 4) as f32,
    };
    (0..count).map(&mut proxy).collect()
}

fn light(order: Order) -> DistantLight {
    let colour = |c: usize| {
        let coefficient = |k: usize| match k {
            0 => 3.0,
            _ => ((7 * k + 5 * c) % 11) as f64 / 11.0 - 0.4,
        };
        (0..order.len()).map(coefficient).collect()
    };
    DistantLight::from_coefficients(order, [0, 1, 2].map(colour))
}

fn settings(order: usize, internal_order: usize) -> Settings {
    let order = Order::new(order).unwrap();
    Settings { order, internal_order: Order::new(internal_order).unwrap(), error: 1.0 / 64.0, ..Settings::default() }
}

/// All stages between set-up and shading on both, from the same receivers.
struct Both {
    receivers: Receivers,
    log: HarmonicBuffer,
    visibility: HarmonicBuffer,
    indirect: HarmonicBuffer,
    shading: Shading,
    view: View,
    gpu: Gpu,
    passes: Passes,
    buffers: Buffers,
    counts: wgpu::Buffer,
    proxies: Vec<Proxy>,
}

/// Pixels as passes want them, without padding.
fn upload(gpu: &Gpu, receivers: &Receivers, buffers: &Buffers) {
    let places = (0..receivers.height()).flat_map(|y| (0..receivers.width()).map(move |x| (x, y)));
    let places: Vec<usize> = places.map(|(x, y)| receivers.index(x, y)).collect();
    let plain: Vec<[f32; 12]> = places
        .iter()
        .map(|&i| {
            let ([px, py, pz], [nx, ny, nz]) = (receivers.point(i).to_array(), receivers.normal_at(i).to_array());
            let [r, g, b] = receivers.albedo.each_ref().map(|plane| plane[i]);
            [px, py, pz, receivers.depth[i].min(3e38), nx, ny, nz, 0.0, r, g, b, 0.0]
        })
        .collect();
    gpu.queue.write_buffer(&buffers.receivers, 0, bytemuck::cast_slice(&plain));
    let transfer: Vec<f32> = receivers.transfer.iter().flat_map(|plane| places.iter().map(|&i| plane[i])).collect();
    gpu.queue.write_buffer(&buffers.transfer, 0, bytemuck::cast_slice(&transfer));
}

fn both(settings: &Settings, proxies: &[Proxy], transfer_len: usize) -> Both {
    let viewport = Viewport { camera: camera([160, 120]), scale: 2 };
    let mut receivers = viewport.nothing(transfer_len);
    draw(&viewport, &floor(transfer_len), &mut receivers);
    draw(&viewport, &knot(), &mut receivers);
    let light = light(settings.order);
    let shadows = Coverage::for_shadows(&light, settings.error);
    let reach = Coverage::for_indirect(&light, settings.error);
    let rule = settings.self_shadowing;

    let places = receivers.stride() * receivers.height();
    let mut log = HarmonicBuffer::zeros(settings.internal_order.len(), places);
    let mut visibility = HarmonicBuffer::zeros(settings.order.len(), places);
    let mut indirect = HarmonicBuffer::zeros(INDIRECT_LEN, places);
    let mut shading = Shading::default();
    if settings.exponential == Exponential::Direct {
        let product = DirectProduct::new(settings.order);
        direct_product(&receivers, proxies, &product, rule, shadows, &mut visibility);
    } else {
        splat(&receivers, proxies, &LogTable::new(settings.internal_order), rule, shadows, &mut log);
        exponentiate(&log, &Exponentiator::new(settings.exponential, settings.internal_order), &mut visibility);
    }
    let table = settings.indirect.map(IndirectTable::new);
    if let Some(table) = &table {
        splat_indirect(&receivers, proxies, &light.reflected(), table, rule, reach, &mut indirect);
    }
    let shading_light = ShadingLight::new(&light);
    let added = table.as_ref().map(|_| &indirect);
    shade(&receivers, &visibility, added, &shading_light, settings.interpolant, &mut shading);

    let gpu = gpu();
    let passes = Passes::new(&gpu, settings, Sizes::new(settings, transfer_len)).unwrap();
    let size = [receivers.width() as u32, receivers.height() as u32];
    let view = View {
        size,
        count: size[0] * size[1],
        proxies: proxies.len() as u32,
        fine_size: [160, 120],
        scale: 2,
        pixel: viewport.pixel(),
        shadow_expansion: shadows.expansion,
        indirect_expansion: reach.expansion,
        reflects: settings.indirect.is_some().into(),
        ..View::default()
    };
    let buffers = passes.buffers(&gpu, &view, true).unwrap();
    upload(&gpu, &receivers, &buffers);
    let device_light = Light::new(&gpu, &shading_light, &light.reflected());
    let spheres = gpu.buffer("proxies", proxies);
    let counts = gpu.zeros("counts", 4 * COUNTS as u64);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    passes.record(&gpu, &mut encoder, &mut Timer::new(&gpu), &buffers, &view, &spheres, &device_light, &counts);
    gpu.queue.submit([encoder.finish()]);
    Both {
        receivers,
        log,
        visibility,
        indirect,
        shading,
        view,
        gpu,
        passes,
        buffers,
        counts,
        proxies: proxies.to_vec(),
    }
}

/// At how many receivers `device(place, k)` and `cpu(place, k)` differ by more than 1e-4, or 1e-4 of the value.
fn mismatches(
    both: &Both,
    len: usize,
    device: impl Fn(usize, usize) -> f32,
    cpu: impl Fn(usize, usize) -> f32,
) -> usize {
    let mut bad = 0;
    for (x, y) in (0..both.receivers.height()).flat_map(|y| (0..both.receivers.width()).map(move |x| (x, y))) {
        let (i, place) = (both.receivers.index(x, y), y * both.receivers.width() + x);
        let differs = |k: usize| {
            let (a, b) = (device(place, k), cpu(i, k));
            a.is_nan() || (a - b).abs() > 1e-4 * b.abs().max(1.0)
        };
        bad += usize::from((0..len).any(differs));
    }
    bad
}

/// Checks all stages; `allowed` receivers may fall on the other side of a jump.
fn check(settings: &Settings, proxies: &[Proxy], transfer_len: usize, allowed: usize) {
    let both = both(settings, proxies, transfer_len);
    let count = both.view.count as usize;
    let lanes = |buffer: &HarmonicBuffer, i: usize, k: usize| buffer.group(i / 8)[k].0[i % 8];
    let has_log = settings.exponential != Exponential::Direct;
    let log = has_log.then_some(("splat", &both.buffers.log, &both.log));
    for (name, device, cpu) in log.into_iter().chain([("visibility", &both.buffers.visibility, &both.visibility)]) {
        let read: Vec<f32> = both.gpu.read(device, cpu.len() * count).unwrap();
        let bad = mismatches(&both, cpu.len(), |place, k| read[k * count + place], |i, k| lanes(cpu, i, k));
        assert!(bad <= allowed, "{name}: {bad} receivers of {count}, {settings:?}");
    }
    if settings.indirect.is_some() {
        let read: Vec<[f32; 4]> = both.gpu.read(&both.buffers.indirect, count).unwrap();
        let bad = mismatches(&both, INDIRECT_LEN, |place, k| read[place][k], |i, k| lanes(&both.indirect, i, k));
        assert!(bad <= allowed, "splat_indirect: {bad} receivers of {count}, {settings:?}");
    }
    let rows = both.shading.len();
    let read: Vec<[f32; 4]> = both.gpu.read(&both.buffers.shading, rows * count).unwrap();
    let device = |place: usize, k: usize| read[place * rows + k / 3][k % 3];
    let bad = mismatches(&both, 3 * rows, device, |i, k| both.shading.rows(i)[k / 3][k % 3]);
    assert!(bad <= allowed, "shade: {bad} receivers of {count}, {settings:?}");

    // Upsampling, from the device's own shading.
    let viewport = Viewport { camera: camera([160, 120]), scale: 1 };
    let mut fine = viewport.nothing(transfer_len);
    draw(&viewport, &floor(transfer_len), &mut fine);
    draw(&viewport, &knot(), &mut fine);
    let base = vec![[0.5f32; 3]; 160 * 120];
    let mut expected = base.clone();
    let resampling = Resampling { scale: 2, pixel: viewport.pixel() };
    let counts = upsample(&both.receivers, &both.shading, &fine, resampling, settings.upsampling, &base, &mut expected);
    let Both { gpu, passes, buffers, view, .. } = &both;
    let fine_view = View { size: [160, 120], count: 160 * 120, ..*view };
    let fine_buffers = passes.buffers(gpu, &fine_view, false).unwrap();
    upload(gpu, &fine, &fine_buffers);
    let radiance = gpu.buffer("radiance", &vec![[0.5f32; 4]; base.len()]);
    let unmatched = gpu.zeros("unmatched", 4 * (base.len() as u64 + 1));
    let bound = [
        &buffers.view,
        &buffers.receivers,
        &buffers.shading,
        &fine_buffers.receivers,
        &fine_buffers.transfer,
        &radiance,
        &unmatched,
    ];
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    passes.upsample.run(
        gpu,
        &mut encoder,
        &mut Timer::new(gpu),
        Stage::Upsample,
        &bound,
        groups_of_8x8(view.size.map(|side| side + 1)),
    );
    gpu.queue.submit([encoder.finish()]);
    let found: Vec<[f32; 4]> = gpu.read(&radiance, base.len()).unwrap();
    let bad = |(a, b): (&[f32; 4], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-4 * b[c].abs().max(1.0));
    let bad = found.iter().zip(&expected).filter(|pair| bad(*pair)).count();
    assert!(bad <= 4 * allowed, "upsample: {bad} pixels, {settings:?}");
    let list: Vec<u32> = gpu.read(&unmatched, base.len() + 1).unwrap();
    let mut places = list[1..=list[0] as usize].to_vec();
    places.sort_unstable();
    let expected: Vec<u32> = counts
        .unmatched
        .iter()
        .map(|&i| (i as usize / fine.stride() * 160 + i as usize % fine.stride()) as u32)
        .collect();
    // On the CPU groups of eight receivers count as touched together: it looks at a few pixels more, without changing them.
    let strays = places.iter().filter(|place| !expected.contains(place)).count();
    assert!(strays <= 4 * allowed, "{strays} pixels are unmatched on the device alone");
    assert!(
        places.len() + 4 * allowed + expected.len() / 20 >= expected.len(),
        "{} of {}",
        places.len(),
        expected.len()
    );
}

#[test]
fn stages_agree_by_default() {
    check(&settings(4, 4), &proxies(60), 0, 0);
}

#[test]
fn stages_agree_with_six_bands_inside_and_the_exact_operator() {
    let settings = Settings {
        exponential: Exponential::Hyb,
        indirect: Some(IndirectOperator::Exact),
        upsampling: Upsampling::Bilinear,
        ..settings(4, 6)
    };
    check(&settings, &proxies(60), 0, 0);
}

#[test]
fn stages_agree_by_the_faithful_rules() {
    // This rule jumps: where the centre of a sphere passes through the tangent plane, and at its surface.
    let settings = Settings {
        exponential: Exponential::Hyb,
        self_shadowing: SelfShadowing::Replaced,
        indirect: Some(IndirectOperator::PointSampled),
        interpolant: Interpolant::Shades,
        ..settings(4, 4)
    };
    check(&settings, &proxies(60), 0, 5);
}

#[test]
fn stages_agree_in_few_bands_and_many() {
    let few = Settings { exponential: Exponential::Ol, self_shadowing: SelfShadowing::Whole, ..settings(2, 2) };
    check(&few, &proxies(20), 0, 0);
    check(&Settings { indirect: None, ..settings(6, 6) }, &proxies(20), 0, 0);
}

#[test]
fn stages_agree_in_the_quality_modes() {
    check(&Settings { exponential: Exponential::Matrix, ..settings(4, 4) }, &proxies(60), 0, 0);
    check(&Settings { exponential: Exponential::Matrix, ..settings(3, 5) }, &proxies(20), 0, 0);
    check(&Settings { exponential: Exponential::Direct, ..settings(4, 4) }, &proxies(60), 0, 0);
    check(&Settings { exponential: Exponential::Direct, ..settings(6, 6) }, &proxies(20), 16, 0);
}

#[test]
fn stages_agree_with_transfer_vectors() {
    check(&settings(4, 4), &proxies(30), 16, 0);
}

#[test]
fn more_proxies_than_a_tile_lists_at_once() {
    check(&settings(3, 3), &proxies(1500), 0, 0);
}

#[test]
fn set_up_sees_the_same_points() {
    let gpu = gpu();
    let settings = settings(4, 4);
    for (scale, transfer_len) in [(1, 0), (4, 16)] {
        let viewport = Viewport { camera: camera([203, 150]), scale };
        let mut expected = viewport.nothing(transfer_len);
        let (set, body) = (floor(transfer_len), knot());
        let lit = surface(
            TorusKnot { triangles: 600, ..TorusKnot::default() }.mesh().unwrap(),
            DVec3::new(-1.5, 1.0, 0.5),
            transfer_len,
        );
        draw(&viewport, &set, &mut expected);
        draw(&viewport, &body, &mut expected);
        draw(&viewport, &lit, &mut expected);

        let sizes = Sizes::new(&settings, transfer_len);
        let exponentiator = Exponentiator::new(settings.exponential, settings.internal_order);
        let passes = Passes::new(&gpu, &settings, sizes).unwrap();
        let mut setup = Setup::new(&gpu, &Shaders::new(&settings, sizes, &exponentiator), &set).unwrap();
        setup.place(&gpu, &[body, lit]).unwrap();
        let size = [expected.width() as u32, expected.height() as u32];
        let count = size[0] * size[1];
        let buffers = passes.buffers(&gpu, &View { size, count, ..View::default() }, false).unwrap();
        let target = Target::new(&gpu, &viewport, 0..size[1], &set);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        setup.record(&gpu, &mut encoder, &mut Timer::new(&gpu), &target, &buffers);
        gpu.queue.submit([encoder.finish()]);
        let found: Vec<[f32; 12]> = gpu.read(&buffers.receivers, count as usize).unwrap();
        let transfer: Vec<f32> = gpu.read(&buffers.transfer, count as usize * transfer_len).unwrap();
        let mut other = 0;
        for (x, y) in (0..expected.height()).flat_map(|y| (0..expected.width()).map(move |x| (x, y))) {
            let (i, place) = (expected.index(x, y), y * expected.width() + x);
            let [px, py, pz, depth, nx, ny, nz, _, r, g, b, _] = found[place];
            let same_albedo = Vec3::new(r, g, b) == Vec3::from(expected.albedo.each_ref().map(|plane| plane[i]));
            if !expected.is_seen(i) || depth > 1e37 || (depth / expected.depth[i] - 1.0).abs() > 1e-3 || !same_albedo {
                other += usize::from(expected.is_seen(i) || depth < 1e37);
                continue;
            }
            let (position, normal) = (Vec3::new(px, py, pz), Vec3::new(nx, ny, nz));
            assert!((depth - expected.depth[i]).abs() < 1e-4, "depth at {x} {y}: {depth} for {}", expected.depth[i]);
            assert!(position.distance(expected.point(i)) < 1e-4, "position at {x} {y}");
            assert!(normal.distance(expected.normal_at(i)) < 1e-4, "normal at {x} {y}: {normal}");
            for (k, plane) in expected.transfer.iter().enumerate() {
                let value = transfer[k * count as usize + place];
                assert!((value - plane[i]).abs() < 1e-4, "transfer {k} at {x} {y}: {value} for {}", plane[i]);
            }
        }
        // Devices draw corners on a grid of 1/256 pixel: only pixels on an edge go to another triangle.
        assert!(other * 200 < count as usize, "{other} of {count}");
    }
}

#[test]
fn frames_agree_stand_still_and_repeat() {
    let (set, bodies, spheres) = (floor(0), [knot()], proxies(60));
    let settings = settings(4, 4);
    let light = light(settings.order);
    let camera = camera([320, 200]);
    let mut cpu = crate::proxy::Renderer::new(settings, &camera, &set, &light, None).unwrap();
    let mut device = Renderer::new(gpu(), settings, &camera, &set, &light, None).unwrap();
    assert_eq!(cpu.size(), device.size());
    cpu.render(&bodies, &spheres).unwrap();
    let statistics = device.render(&bodies, &spheres).unwrap();
    assert!(!statistics.still && !statistics.indirect_skipped);
    if device.gpu().has_timestamps() || device.gpu().is_software() {
        assert!(statistics.splat_seconds > 0.0 && statistics.setup_seconds > 0.0 && statistics.shade_seconds > 0.0);
    }
    let differs = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-4 * b[c].max(1.0));
    let count = cpu.radiance().len();
    let bad = device.radiance().iter().zip(cpu.radiance()).filter(|pair| differs(*pair)).count();
    // Pixels on edges, and those that take from receivers on edges.
    assert!(bad * 50 < count, "{bad} pixels of {count}");
    assert!(device.radiance() != cpu.unshadowed());

    let first = device.radiance().to_vec();
    assert!(device.render(&bodies, &spheres).unwrap().still);
    assert!(device.radiance() == first);
    let nothing = device.render(&bodies, &[]).unwrap();
    assert!(!nothing.still && nothing.indirect_skipped);
    let bad = device.radiance().iter().zip(cpu.unshadowed()).filter(|pair| differs(*pair)).count();
    assert!(bad * 200 < count, "{bad} pixels of {count} without proxies");
    device.render(&bodies, &spheres).unwrap();
    assert!(device.radiance() == first);
}

#[test]
fn bands_of_rows_add_up_to_the_picture() {
    let (set, bodies, spheres) = (floor(0), [knot()], proxies(60));
    let camera = camera([160, 122]);
    // Shading takes most of a receiver's bytes, then the receiver itself: three rows of the first or twelve of the second.
    for (scale, most) in [(1, 3 * 160 * 160), (2, 12 * 48 * 160), (4, 12 * 48 * 160)] {
        let settings = Settings { receiver_scale: scale, ..settings(4, 4) };
        let light = light(settings.order);
        let [whole, banded] = [u64::MAX, most].map(|most| {
            let gpu = gpu();
            let most = gpu.most().min(most);
            let mut renderer = Renderer::new(gpu.with_most(most), settings, &camera, &set, &light, None).unwrap();
            let statistics = renderer.render(&bodies, &spheres).unwrap();
            (renderer.radiance().to_vec(), statistics)
        });
        let differs = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-4 * b[c].max(1.0));
        let bad = banded.0.iter().zip(&whole.0).filter(|pair| differs(*pair)).count();
        // Corners in other places on the device's grid: pixels on edges, and those that take from receivers there.
        assert!(bad * 100 < whole.0.len(), "scale {scale}: {bad} pixels");
        assert!(banded.1.tiles > whole.1.tiles);
        // Tiles of 8 x 8 receivers of the whole picture, of which some see the sky; most pairs are of both.
        assert_eq!(whole.1.tiles, (160usize.div_ceil(8 * scale) * 122usize.div_ceil(8 * scale)) as u64);
        assert!(whole.1.empty_tiles < whole.1.tiles && whole.1.pairs > whole.1.tiles - whole.1.empty_tiles);
    }
    let most = 48 * 159;
    let settings = settings(4, 4);
    let refused = Renderer::new(gpu().with_most(most), settings, &camera, &set, &light(settings.order), None);
    let message = refused.err().expect("no row fits").to_string();
    assert!(message.contains("a row of receivers take"), "{message}");
}

#[test]
fn counts_of_tiles_are_those_of_the_processor() {
    let both = both(&settings(4, 4), &proxies(6), 0);
    let counts: Vec<u32> = both.gpu.read(&both.counts, COUNTS).unwrap();
    let View { size, shadow_expansion, .. } = both.view;
    let (mut empty, mut pairs) = (0, 0);
    for (x0, y0) in (0..size[1]).step_by(8).flat_map(|y| (0..size[0]).step_by(8).map(move |x| (x, y))) {
        let inside = (y0..(y0 + 8).min(size[1])).flat_map(|y| (x0..(x0 + 8).min(size[0])).map(move |x| (x, y)));
        let places = inside.map(|(x, y)| both.receivers.index(x as usize, y as usize));
        let points: Vec<Vec3> =
            places.filter(|i| both.receivers.is_seen(*i)).map(|i| both.receivers.point(i)).collect();
        let low = points.iter().fold(Vec3::INFINITY, |low, p| low.min(*p));
        let high = points.iter().fold(Vec3::NEG_INFINITY, |high, p| high.max(*p));
        let (centre, radius) = (0.5 * (low + high), 0.5001 * low.distance(high));
        let reaches = |proxy: &&Proxy| proxy.center.distance(centre) < shadow_expansion * proxy.radius + radius;
        let reached = if points.is_empty() { 0 } else { both.proxies.iter().filter(reaches).count() };
        empty += u32::from(reached == 0);
        pairs += reached as u32;
    }
    assert!(empty > 0 && pairs > 0);
    assert_eq!((counts[0], counts[1]), (empty, pairs));
}

#[test]
fn what_a_device_cannot_do_is_said() {
    let bad = Proxy { radius: 0.0, ..proxies(1)[0] };
    let settings = settings(4, 4);
    let light = light(settings.order);
    let mut renderer = Renderer::new(gpu(), settings, &camera([64, 64]), &floor(0), &light, None).unwrap();
    assert!(renderer.render(&[], &[bad]).unwrap_err().to_string().contains("sphere 0: its radius"));
    let message = gpu().check_size("pixels", 1 << 50).unwrap_err().to_string();
    assert!(message.contains("pixels take 1073741824 MiB") && message.contains("ask for fewer or larger"), "{message}");
}
