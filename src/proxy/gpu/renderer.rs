use std::time::Instant;

use rayon::prelude::*;
use wgpu::{Buffer, BufferDescriptor, BufferUsages, CommandEncoder};

use super::Gpu;
use super::kernel::{Stage, Timer, groups_of_8x8, groups_of_64};
use super::passes::{Buffers, Light, Passes, Shaders, Sizes, View};
use super::setup::{Setup, Target};
use crate::proxy::{
    Coverage, DistantLight, Exponentiator, FrameStatistics, Proxy, Settings, ShadingLight, Surface, Viewport,
    check_proxies,
};
use crate::scene::{Camera, Environment};
use crate::{Error, Result};

/// Renders frames of proxies over a set that stands still, on a graphics processor: twin of the
/// [`Renderer`](crate::proxy::Renderer) on the CPU.
///
/// Of the statistics it fills in the times - of passes as the device tells them, on software devices by waiting for each -
/// the pixels shaded anew, and what was skipped; tiles and pairs are not counted.
pub struct Renderer {
    gpu: Gpu,
    settings: Settings,
    viewport: Viewport,
    passes: Passes,
    setup: Setup,
    fine: Receivers,
    /// None if they are those of the display.
    coarse: Option<Receivers>,
    light: Light,
    reflects: bool,
    coverage: [Coverage; 2],
    background: Buffer,
    pixels: Buffer,
    unmatched: Buffer,
    proxies: Buffer,
    staging: Buffer,
    timer: Timer,
    radiance: Vec<[f32; 3]>,
    /// What the last frame showed.
    shown: Option<(Vec<Surface>, Vec<Proxy>)>,
    light_changed: bool,
}

/// Fills up the last row of pixels that are shaded anew, as in receivers.wgsl.
const NO_PIXEL: u32 = u32::MAX;

/// Receivers at one resolution.
struct Receivers {
    view: View,
    target: Target,
    buffers: Buffers,
}

impl Renderer {
    /// Sees `set` through `camera` in `light`; where nothing is seen the pictures show `background`, or black.
    ///
    /// # Errors
    /// Settings out of their domain, or a device that lacks what they need.
    pub fn new(
        gpu: Gpu,
        settings: Settings,
        camera: &Camera,
        set: &Surface,
        light: &DistantLight,
        background: Option<&Environment>,
    ) -> Result<Self> {
        settings.check()?;
        let sizes = Sizes::new(&settings, set.transfer_len);
        let exponentiator = Exponentiator::new(settings.exponential, settings.internal_order);
        let passes = Passes::new(&gpu, &settings, sizes)?;
        let setup = Setup::new(&gpu, &Shaders::new(&settings, sizes, &exponentiator), set)?;
        let fine_size = camera.resolution();
        let most = gpu.device.limits().max_texture_dimension_2d;
        if let Some(side) = fine_size.iter().find(|side| **side > most) {
            return Err(Error::input(format!("{}: {side} pixels a side are more than {most}", gpu.name())));
        }
        let receivers = |scale: usize| {
            let viewport = Viewport { camera: camera.clone(), scale };
            let size = viewport.size().map(|side| side as u32);
            let view = View {
                size,
                count: size[0] * size[1],
                fine_size,
                scale: scale as u32,
                pixel: viewport.pixel(),
                ..View::default()
            };
            let target = Target::new(&gpu, &viewport, set);
            Ok::<_, Error>(Receivers {
                view,
                target,
                buffers: passes.buffers(&gpu, &view, scale == settings.receiver_scale)?,
            })
        };
        let fine = receivers(1)?;
        let coarse = (settings.receiver_scale > 1).then(|| receivers(settings.receiver_scale)).transpose()?;
        let count = fine.view.count as usize;
        let bytes = 16 * count as u64;
        gpu.check_size("pixels", bytes)?;
        let staging = BufferDescriptor {
            label: Some("staging"),
            size: bytes,
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        };
        let reflected = light.reflected();
        let mut renderer = Self {
            settings,
            viewport: Viewport { camera: camera.clone(), scale: 1 },
            setup,
            fine,
            coarse,
            light: Light::new(&gpu, &ShadingLight::new(light), &reflected),
            reflects: !reflected.is_dark(),
            coverage: [Coverage { expansion: 1.0 }; 2],
            background: gpu.zeros("background", bytes),
            pixels: gpu.zeros("radiance", bytes),
            unmatched: gpu.zeros("unmatched", 4 * (count as u64 + 1)),
            proxies: gpu.zeros("proxies", 32),
            staging: gpu.device.create_buffer(&staging),
            timer: Timer::new(&gpu),
            radiance: vec![[0.0; 3]; count],
            shown: None,
            light_changed: true,
            passes,
            gpu,
        };
        renderer.set_light(light, background);
        Ok(renderer)
    }

    /// Changes the light and the background. What does not depend on them is kept.
    pub fn set_light(&mut self, light: &DistantLight, background: Option<&Environment>) {
        let reflected = light.reflected();
        self.light = Light::new(&self.gpu, &ShadingLight::new(light), &reflected);
        self.reflects = !reflected.is_dark();
        let error = self.settings.error;
        self.coverage = [Coverage::for_shadows(light, error), Coverage::for_indirect(light, error)];
        if let Some(environment) = background {
            let [width, height] = self.fine.view.size;
            let colour = |i: u32| {
                let direction = self.viewport.camera.pixel_direction(i % width, i / width);
                environment.radiance(direction).extend(0.0).to_array()
            };
            let colours: Vec<[f32; 4]> = (0..width * height).into_par_iter().map(colour).collect();
            self.gpu.queue.write_buffer(&self.background, 0, bytemuck::cast_slice(&colours));
        }
        self.light_changed = true;
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Pixels across and down.
    pub fn size(&self) -> [usize; 2] {
        self.fine.view.size.map(|side| side as usize)
    }

    /// Radiance of the last frame, row by row.
    pub fn radiance(&self) -> &[[f32; 3]] {
        &self.radiance
    }

    /// Renders a frame: `bodies` are seen, `proxies` block and reflect. A frame with the bodies, proxies and light of the last
    /// one is that frame.
    ///
    /// # Errors
    /// Proxies that cannot be rendered, the first one is named; a device that is too small or has gone.
    pub fn render(&mut self, bodies: &[Surface], proxies: &[Proxy]) -> Result<FrameStatistics> {
        check_proxies(proxies)?;
        let started = Instant::now();
        let mut statistics = FrameStatistics { proxies: proxies.len() as u64, ..FrameStatistics::default() };
        let same = self.shown.as_ref().is_some_and(|(shown, spheres)| shown == bodies && spheres == proxies);
        if same && !self.light_changed {
            statistics.still = true;
            statistics.seconds = started.elapsed().as_secs_f64();
            return Ok(statistics);
        }
        self.setup.place(&self.gpu, bodies)?;
        self.gpu.fill(&mut self.proxies, "proxies", &self.settings.overlap.counted(proxies));
        let reflects = self.settings.indirect.is_some()
            && self.reflects
            && proxies.iter().any(|proxy| proxy.albedo != glam::Vec3::ZERO);
        statistics.indirect_skipped = self.settings.indirect.is_some() && !reflects;
        for receivers in [Some(&mut self.fine), self.coarse.as_mut()].into_iter().flatten() {
            receivers.view.proxies = proxies.len() as u32;
            receivers.view.reflects = reflects.into();
            [receivers.view.shadow_expansion, receivers.view.indirect_expansion] = self.coverage.map(|c| c.expansion);
            self.gpu.queue.write_buffer(&receivers.buffers.view, 0, bytemuck::bytes_of(&receivers.view));
        }

        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.record(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        let unmatched = self.gpu.read::<u32>(&self.unmatched, 1)?[0] as usize;
        statistics.reshaded_pixels = unmatched as u64;
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        if unmatched > 0 {
            // In whatever order they were found; sorted, they are neighbours.
            let mut places = self.gpu.read::<u32>(&self.unmatched, unmatched + 1)?;
            places.remove(0);
            places.sort_unstable();
            self.reshade(&mut encoder, places)?;
        }
        encoder.copy_buffer_to_buffer(&self.pixels, 0, &self.staging, 0, self.staging.size());
        self.gpu.queue.submit([encoder.finish()]);
        let radiance = &mut self.radiance;
        self.gpu.read_staged(&self.staging, |colours: &[[f32; 4]]| {
            radiance.par_iter_mut().zip(colours).for_each(|(out, [r, g, b, _])| *out = [*r, *g, *b]);
        })?;
        for (stage, seconds) in self.timer.seconds(&self.gpu)? {
            let sum = match stage {
                Stage::Setup => &mut statistics.setup_seconds,
                Stage::Splat => &mut statistics.splat_seconds,
                Stage::Exponentiate => &mut statistics.exponentiate_seconds,
                Stage::Indirect => &mut statistics.indirect_seconds,
                Stage::Shade => &mut statistics.shade_seconds,
                Stage::Upsample => &mut statistics.upsample_seconds,
            };
            *sum += seconds;
        }
        if !same {
            self.shown = Some((bodies.to_vec(), proxies.to_vec()));
        }
        self.light_changed = false;
        statistics.seconds = started.elapsed().as_secs_f64();
        Ok(statistics)
    }

    /// The passes up to the upsampling.
    fn record(&mut self, encoder: &mut CommandEncoder) {
        let Self { gpu, passes, setup, fine, coarse, light, timer, .. } = self;
        setup.record(gpu, encoder, timer, &fine.target, &fine.buffers);
        if let Some(coarse) = coarse {
            setup.record(gpu, encoder, timer, &coarse.target, &coarse.buffers);
        }
        let Buffers { view, receivers, transfer, .. } = &fine.buffers;
        let lit = [view, receivers, transfer, &light.coefficients, &self.background, &self.pixels];
        passes.base.run(gpu, encoder, timer, Stage::Setup, &lit, groups_of_64(fine.view.count));

        let source = coarse.as_ref().unwrap_or(fine);
        passes.record(gpu, encoder, timer, &source.buffers, &source.view, &self.proxies, light);
        encoder.clear_buffer(&self.unmatched, 0, Some(4));
        let source = &source.buffers;
        let up = [&source.view, &source.receivers, &source.shading, receivers, transfer, &self.pixels, &self.unmatched];
        passes.upsample.run(gpu, encoder, timer, Stage::Upsample, &up, groups_of_8x8(fine.view.size));
    }

    /// Shades pixels of the display from scratch.
    fn reshade(&mut self, encoder: &mut CommandEncoder, mut places: Vec<u32>) -> Result<()> {
        let Self { gpu, passes, fine, light, timer, .. } = self;
        // Tiles of 8 x 8 hold 64 pixels in order.
        let size = [8, (places.len() as u32).div_ceil(8)];
        places.resize(8 * size[1] as usize, NO_PIXEL);
        let view = View { size, count: size[0] * size[1], scale: 1, ..fine.view };
        let buffers = passes.buffers(gpu, &view, true)?;
        let list = gpu.buffer("unmatched", &places);
        let groups = groups_of_64(view.count);
        let all = &fine.buffers;
        let gathered = [&buffers.view, &list, &all.receivers, &all.transfer, &buffers.receivers, &buffers.transfer];
        passes.gather.run(gpu, encoder, timer, Stage::Upsample, &gathered, groups);
        passes.record(gpu, encoder, timer, &buffers, &view, &self.proxies, light);
        let scattered = [&buffers.view, &list, &buffers.receivers, &buffers.transfer, &buffers.shading, &self.pixels];
        passes.scatter.run(gpu, encoder, timer, Stage::Upsample, &scattered, groups);
        Ok(())
    }
}
