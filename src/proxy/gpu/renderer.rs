use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;
use wgpu::{Buffer, BufferDescriptor, BufferUsages, CommandEncoder};

use super::Gpu;
use super::kernel::{Stage, Timer, groups_of_8x8, groups_of_64};
use super::passes::{Buffers, COUNTS, Light, Passes, Shaders, Sizes, View};
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
/// Displays and receivers that are too large for the device's buffers are worked through in bands of rows.
///
/// Of the statistics it fills in the times - of passes as the device tells them, on software devices by waiting for each -
/// tiles, which are of 8 x 8 receivers here, and their pairs with proxies, the pixels shaded anew, and what was skipped.
pub struct Renderer {
    gpu: Gpu,
    settings: Settings,
    viewport: Viewport,
    passes: Passes,
    setup: Setup,
    bands: Vec<Band>,
    /// Those of the band at hand.
    fine: Buffers,
    /// None if the receivers are those of the display.
    coarse: Option<Buffers>,
    light: Light,
    reflects: bool,
    coverage: [Coverage; 2],
    pixels: Buffer,
    counts: Buffer,
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

/// Some rows of the display, with the receivers that their pixels take from.
struct Band {
    fine: Rows,
    /// None if they are those of the display.
    coarse: Option<Rows>,
    background: Buffer,
}

/// Rows of receivers at one resolution.
struct Rows {
    view: View,
    target: Target,
}

/// Splits the display into as few bands as fit, of as many rows each.
fn bands(gpu: &Gpu, sizes: Sizes, scale: usize, [width, height]: [usize; 2]) -> Result<Vec<Range<usize>>> {
    let rows_of = |bytes: u64, width: usize, kept: usize| -> Result<usize> {
        let row = bytes * width as u64;
        gpu.check_size("a row of receivers", row * (kept as u64 + 1))?;
        Ok((gpu.most() / row) as usize - kept)
    };
    let most = match scale {
        1 => rows_of(sizes.receiver(), width, 0)?,
        // Pixels at the ends of a band take from receivers beyond.
        _ => rows_of(sizes.pixel(), width, 0)?.min(scale * rows_of(sizes.receiver(), width.div_ceil(scale), 2)?),
    };
    let rows = height.div_ceil(height.div_ceil(most));
    Ok((0..height).step_by(rows).map(|first| first..(first + rows).min(height)).collect())
}

/// The rows of receivers from which pixels in `rows` take.
fn taken_from(rows: &Range<usize>, scale: usize, height: usize) -> Range<usize> {
    let low = |pixel: usize| (2 * pixel + 1).saturating_sub(scale) / (2 * scale);
    low(rows.start)..(low(rows.end - 1) + 2).min(height)
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
        let scale = settings.receiver_scale;
        let display = Viewport { camera: camera.clone(), scale: 1 };
        let receivers = Viewport { camera: camera.clone(), scale };
        let rows = |viewport: &Viewport, rows: Range<usize>, fine: &Range<usize>| {
            let size = [viewport.size()[0] as u32, rows.len() as u32];
            let view = View {
                size,
                count: size[0] * size[1],
                fine_size: [fine_size[0], fine.len() as u32],
                scale: viewport.scale as u32,
                pixel: viewport.pixel(),
                first_row: rows.start as u32,
                fine_first_row: fine.start as u32,
                ..View::default()
            };
            Rows { view, target: Target::new(&gpu, viewport, rows.start as u32..rows.end as u32, set) }
        };
        let band = |fine: Range<usize>| Band {
            fine: rows(&display, fine.clone(), &fine),
            coarse: (scale > 1).then(|| rows(&receivers, taken_from(&fine, scale, receivers.size()[1]), &fine)),
            background: gpu.zeros("background", 16 * (fine.len() * display.size()[0]) as u64),
        };
        let bands: Vec<Band> = bands(&gpu, sizes, scale, display.size())?.into_iter().map(band).collect();
        let largest = |views: &mut dyn Iterator<Item = View>| views.max_by_key(|view| view.count).unwrap_or_default();
        let fine_view = largest(&mut bands.iter().map(|band| band.fine.view));
        let fine = passes.buffers(&gpu, &fine_view, scale == 1)?;
        let coarse_view = largest(&mut bands.iter().filter_map(|band| band.coarse.as_ref()).map(|rows| rows.view));
        let coarse = (scale > 1).then(|| passes.buffers(&gpu, &coarse_view, true)).transpose()?;
        let count = fine_size.iter().map(|side| *side as usize).product::<usize>();
        let staging = BufferDescriptor {
            label: Some("staging"),
            size: 16 * count as u64,
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        };
        if staging.size > gpu.device.limits().max_buffer_size {
            return Err(Error::input(format!("{}: {count} pixels are too many", gpu.name())));
        }
        let reflected = light.reflected();
        let mut renderer = Self {
            settings,
            viewport: display,
            setup,
            bands,
            fine,
            coarse,
            light: Light::new(&gpu, &ShadingLight::new(light), &reflected),
            reflects: !reflected.is_dark(),
            coverage: [Coverage { expansion: 1.0 }; 2],
            pixels: gpu.zeros("radiance", 16 * u64::from(fine_view.count)),
            counts: gpu.zeros("counts", 4 * COUNTS as u64),
            unmatched: gpu.zeros("unmatched", 4 * (u64::from(fine_view.count) + 1)),
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
            for Band { fine: Rows { view, .. }, background, .. } in &self.bands {
                let width = view.size[0];
                let colour = |i: u32| {
                    let direction = self.viewport.camera.pixel_direction(i % width, i / width + view.first_row);
                    environment.radiance(direction).extend(0.0).to_array()
                };
                let colours: Vec<[f32; 4]> = (0..view.count).into_par_iter().map(colour).collect();
                self.gpu.queue.write_buffer(background, 0, bytemuck::cast_slice(&colours));
            }
        }
        self.light_changed = true;
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Pixels across and down.
    pub fn size(&self) -> [usize; 2] {
        self.viewport.size()
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
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&self.counts, 0, None);
        self.gpu.queue.submit([encoder.finish()]);
        let mut done = 0;
        for i in 0..self.bands.len() {
            let Band { fine, coarse, .. } = &mut self.bands[i];
            let [width, height] = coarse.as_ref().unwrap_or(fine).view.size;
            statistics.tiles += u64::from(width.div_ceil(8)) * u64::from(height.div_ceil(8));
            for (rows, buffers) in [(Some(fine), Some(&self.fine)), (coarse.as_mut(), self.coarse.as_ref())] {
                let (Some(Rows { view, .. }), Some(buffers)) = (rows, buffers) else { continue };
                view.proxies = proxies.len() as u32;
                view.reflects = reflects.into();
                [view.shadow_expansion, view.indirect_expansion] = self.coverage.map(|c| c.expansion);
                self.gpu.queue.write_buffer(&buffers.view, 0, bytemuck::bytes_of(view));
            }
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            self.record(i, &mut encoder);
            self.gpu.queue.submit([encoder.finish()]);
            let unmatched = self.gpu.read::<u32>(&self.unmatched, 1)?[0] as usize;
            statistics.reshaded_pixels += unmatched as u64;
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            if unmatched > 0 {
                // In whatever order they were found; sorted, they are neighbours.
                let mut places = self.gpu.read::<u32>(&self.unmatched, unmatched + 1)?;
                places.remove(0);
                places.sort_unstable();
                self.reshade(i, &mut encoder, places)?;
            }
            let bytes = 16 * u64::from(self.bands[i].fine.view.count);
            encoder.copy_buffer_to_buffer(&self.pixels, 0, &self.staging, done, bytes);
            done += bytes;
            self.gpu.queue.submit([encoder.finish()]);
        }
        let radiance = &mut self.radiance;
        self.gpu.read_staged(&self.staging, |colours: &[[f32; 4]]| {
            radiance.par_iter_mut().zip(colours).for_each(|(out, [r, g, b, _])| *out = [*r, *g, *b]);
        })?;
        let counts: Vec<u32> = self.gpu.read(&self.counts, COUNTS)?;
        statistics.empty_tiles = counts[0].into();
        statistics.pairs = u64::from(counts[1]) + u64::from(counts[3]);
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

    /// The passes over a band up to the upsampling.
    fn record(&mut self, band: usize, encoder: &mut CommandEncoder) {
        let Self { gpu, passes, setup, bands, fine, coarse, light, timer, counts, .. } = self;
        let band = &bands[band];
        setup.record(gpu, encoder, timer, &band.fine.target, fine);
        if let (Some(rows), Some(buffers)) = (&band.coarse, &*coarse) {
            setup.record(gpu, encoder, timer, &rows.target, buffers);
        }
        let Buffers { view, receivers, transfer, .. } = &*fine;
        let lit = [view, receivers, transfer, &light.coefficients, &band.background, &self.pixels];
        passes.base.run(gpu, encoder, timer, Stage::Setup, &lit, groups_of_64(band.fine.view.count));

        let source = coarse.as_ref().unwrap_or(fine);
        let rows = band.coarse.as_ref().unwrap_or(&band.fine);
        passes.record(gpu, encoder, timer, source, &rows.view, &self.proxies, light, counts);
        encoder.clear_buffer(&self.unmatched, 0, Some(4));
        let up = [&source.view, &source.receivers, &source.shading, receivers, transfer, &self.pixels, &self.unmatched];
        passes.upsample.run(
            gpu,
            encoder,
            timer,
            Stage::Upsample,
            &up,
            groups_of_8x8(rows.view.size.map(|side| side + 1)),
        );
    }

    /// Shades pixels of the display from scratch.
    fn reshade(&mut self, band: usize, encoder: &mut CommandEncoder, mut places: Vec<u32>) -> Result<()> {
        let Self { gpu, passes, bands, fine, light, timer, .. } = self;
        // Tiles of 8 x 8 hold 64 pixels in order.
        let size = [8, (places.len() as u32).div_ceil(8)];
        places.resize(8 * size[1] as usize, NO_PIXEL);
        let view = View { size, count: size[0] * size[1], scale: 1, ..bands[band].fine.view };
        let buffers = passes.buffers(gpu, &view, true)?;
        let list = gpu.buffer("unmatched", &places);
        let groups = groups_of_64(view.count);
        let all = fine;
        // Counted are the tiles of the first time.
        let counts = gpu.zeros("counts", 4 * COUNTS as u64);
        let gathered = [&buffers.view, &list, &all.receivers, &all.transfer, &buffers.receivers, &buffers.transfer];
        passes.gather.run(gpu, encoder, timer, Stage::Upsample, &gathered, groups);
        passes.record(gpu, encoder, timer, &buffers, &view, &self.proxies, light, &counts);
        let scattered = [&buffers.view, &list, &buffers.receivers, &buffers.transfer, &buffers.shading, &self.pixels];
        passes.scatter.run(gpu, encoder, timer, Stage::Upsample, &scattered, groups);
        Ok(())
    }
}
