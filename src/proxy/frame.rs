use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use super::coverage::Coverage;
use super::direct_product::{DirectProduct, direct_product};
use super::exponential::{Exponential, Exponentiator};
use super::exponentiate::exponentiate;
use super::harmonic_buffer::HarmonicBuffer;
use super::indirect::IndirectTable;
use super::light::{DistantLight, ReflectedLight};
use super::receiver_setup::{Rectangle, Viewport, draw};
use super::shade::{Shading, ShadingLight, radiance, shade};
use super::splat::splat;
use super::splat_indirect::{INDIRECT_LEN, splat_indirect};
use super::upsample::{Resampling, gather, scatter, upsample};
use super::zonal_log::LogTable;
use super::{Proxy, Receivers, Settings, Surface, check_proxies};
use crate::Result;
use crate::scene::{Camera, Environment};

/// Renders frames of proxies over a set that stands still, on the CPU.
pub struct Renderer {
    settings: Settings,
    fine: View,
    /// The receivers; none if they are those of the display.
    coarse: Option<View>,
    light: Light,
    log_table: LogTable,
    exponentiator: Exponentiator,
    direct: Option<DirectProduct>,
    indirect_table: Option<IndirectTable>,
    background: Option<Environment>,
    stages: Stages,
    /// Radiance without proxies, of the set alone and with the bodies.
    still_base: Vec<[f32; 3]>,
    base: Vec<[f32; 3]>,
    radiance: Vec<[f32; 3]>,
    /// What the last frame showed.
    shown: Option<(Vec<Surface>, Vec<Proxy>)>,
    light_changed: bool,
}

/// What the stages hand on.
#[derive(Default)]
struct Stages {
    log: HarmonicBuffer,
    visibility: HarmonicBuffer,
    indirect: HarmonicBuffer,
    shading: Shading,
}

/// The light with all that depends on it alone.
struct Light {
    shading: ShadingLight,
    reflected: ReflectedLight,
    shadows: Coverage,
    indirect: Coverage,
}

impl Light {
    fn new(light: &DistantLight, settings: &Settings) -> Self {
        Self {
            shading: ShadingLight::new(light),
            reflected: light.reflected(),
            shadows: Coverage::for_shadows(light, settings.error),
            indirect: Coverage::for_indirect(light, settings.error),
        }
    }
}

/// Receivers at one resolution.
struct View {
    viewport: Viewport,
    /// The set alone.
    still: Receivers,
    /// With the bodies in front.
    receivers: Receivers,
    /// Where bodies were drawn.
    drawn: Vec<Rectangle>,
}

impl View {
    fn new(viewport: Viewport, set: &Surface) -> Self {
        let mut still = viewport.nothing(set.transfer_len);
        draw(&viewport, set, &mut still);
        Self { viewport, receivers: still.clone(), still, drawn: Vec::new() }
    }

    /// Takes the bodies of the last frame away and draws those of this one. Returns where anything may have changed.
    fn place(&mut self, bodies: &[Surface]) -> Vec<Rectangle> {
        let mut changed = std::mem::take(&mut self.drawn);
        for rectangle in &changed {
            self.receivers.copy_rectangle(&self.still, rectangle);
        }
        for body in bodies {
            let rectangle = draw(&self.viewport, body, &mut self.receivers);
            if !rectangle.is_empty() {
                self.drawn.push(rectangle);
            }
        }
        changed.extend(self.drawn.iter().cloned());
        changed
    }
}

/// What a frame took and what it could leave out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FrameStatistics {
    /// Spheres.
    pub proxies: u64,
    /// Seconds in all.
    pub seconds: f64,
    /// Seconds of the receiver set-up.
    pub setup_seconds: f64,
    /// Seconds of the splat pass for shadows.
    pub splat_seconds: f64,
    /// Seconds of the exponentiation pass.
    pub exponentiate_seconds: f64,
    /// Seconds of the splat pass for indirect light.
    pub indirect_seconds: f64,
    /// Seconds of the shading pass.
    pub shade_seconds: f64,
    /// Seconds of upsampling, pixels shaded anew included.
    pub upsample_seconds: f64,
    /// Whether the frame was the last one, shown again.
    pub still: bool,
    /// Proxies that reach no receiver.
    pub proxies_out_of_reach: u64,
    /// Tiles of receivers.
    pub tiles: u64,
    /// Tiles that no proxy reaches.
    pub empty_tiles: u64,
    /// Pairs of proxies and groups of eight receivers, in both splat passes.
    pub pairs: u64,
    /// Groups of eight receivers for which no exponential was taken.
    pub unshadowed_groups: u64,
    /// Whether the indirect pass was left out because nothing reflects.
    pub indirect_skipped: bool,
    /// Pixels that proxies change.
    pub changed_pixels: u64,
    /// Pixels shaded anew for want of a matching receiver.
    pub reshaded_pixels: u64,
}

impl Renderer {
    /// Sees `set` through `camera` in `light`; where nothing is seen the pictures show `background`, or black.
    ///
    /// # Errors
    /// Settings out of their domain.
    pub fn new(
        settings: Settings,
        camera: &Camera,
        set: &Surface,
        light: &DistantLight,
        background: Option<&Environment>,
    ) -> Result<Self> {
        settings.check()?;
        let view = |scale| View::new(Viewport { camera: camera.clone(), scale }, set);
        let mut renderer = Self {
            settings,
            fine: view(1),
            coarse: (settings.receiver_scale > 1).then(|| view(settings.receiver_scale)),
            light: Light::new(light, &settings),
            log_table: LogTable::new(settings.internal_order),
            exponentiator: Exponentiator::new(settings.exponential, settings.internal_order),
            direct: (settings.exponential == Exponential::Direct).then(|| DirectProduct::new(settings.order)),
            indirect_table: settings.indirect.map(IndirectTable::new),
            background: background.cloned(),
            stages: Stages::default(),
            still_base: Vec::new(),
            base: Vec::new(),
            radiance: Vec::new(),
            shown: None,
            light_changed: true,
        };
        let receivers = &renderer.coarse.as_ref().unwrap_or(&renderer.fine).receivers;
        renderer.stages.resize(receivers, &settings);
        Ok(renderer)
    }

    /// Changes the light; the background stays. What does not depend on light is kept.
    pub fn set_light(&mut self, light: &DistantLight, background: Option<&Environment>) {
        self.light = Light::new(light, &self.settings);
        self.background = background.cloned();
        self.light_changed = true;
    }

    /// How frames are rendered.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Reach of the proxies for shadows and for indirect light.
    pub fn coverage(&self) -> [Coverage; 2] {
        [self.light.shadows, self.light.indirect]
    }

    /// Pixels across and down.
    pub fn size(&self) -> [usize; 2] {
        [self.fine.receivers.width(), self.fine.receivers.height()]
    }

    /// The display's receivers of the last frame.
    pub fn display(&self) -> &Receivers {
        &self.fine.receivers
    }

    /// The receivers of the last frame.
    pub fn receivers(&self) -> &Receivers {
        &self.coarse.as_ref().unwrap_or(&self.fine).receivers
    }

    /// Visibility of the environment at the receivers, from the last frame.
    pub fn visibility(&self) -> &HarmonicBuffer {
        &self.stages.visibility
    }

    /// Radiance of the last frame, row by row.
    pub fn radiance(&self) -> &[[f32; 3]] {
        &self.radiance
    }

    /// Radiance of the last frame without proxies.
    pub fn unshadowed(&self) -> &[[f32; 3]] {
        &self.base
    }

    /// Renders a frame: `bodies` are seen, `proxies` block and reflect. A frame with the bodies, proxies and light of the last
    /// one is that frame.
    ///
    /// # Errors
    /// Proxies that cannot be rendered: the first one is named.
    pub fn render(&mut self, bodies: &[Surface], proxies: &[Proxy]) -> Result<FrameStatistics> {
        check_proxies(proxies)?;
        let mut statistics = FrameStatistics { proxies: proxies.len() as u64, ..FrameStatistics::default() };
        let started = Instant::now();
        let same = self.shown.as_ref().is_some_and(|(shown, spheres)| shown == bodies && spheres == proxies);
        if same && !self.light_changed {
            statistics.still = true;
            statistics.seconds = started.elapsed().as_secs_f64();
            return Ok(statistics);
        }
        if !same {
            self.shown = Some((bodies.to_vec(), proxies.to_vec()));
        }

        let mut clock = Clock(Instant::now());
        let changed = self.fine.place(bodies);
        if let Some(coarse) = &mut self.coarse {
            coarse.place(bodies);
        }
        self.light_base(&changed);
        statistics.setup_seconds = clock.lap();

        let fine = &self.fine.receivers;
        let receivers = self.coarse.as_ref().map_or(fine, |coarse| &coarse.receivers);
        let passes = Passes {
            settings: &self.settings,
            light: &self.light,
            log_table: &self.log_table,
            exponentiator: &self.exponentiator,
            direct: self.direct.as_ref(),
            indirect_table: self.indirect_table.as_ref(),
        };
        let proxies = &*self.settings.overlap.counted(proxies);
        passes.run(receivers, proxies, &mut self.stages, &mut statistics);

        let mut clock = Clock(Instant::now());
        let resampling = Resampling { scale: self.settings.receiver_scale, pixel: self.fine.viewport.pixel() };
        let (base, shading) = (&self.base, &self.stages.shading);
        let upsampling = self.settings.upsampling;
        let counts = upsample(receivers, shading, fine, resampling, upsampling, base, &mut self.radiance);
        statistics.changed_pixels = counts.changed + counts.unmatched.len() as u64;
        statistics.reshaded_pixels = counts.unmatched.len() as u64;
        if !counts.unmatched.is_empty() {
            let gathered = gather(fine, &counts.unmatched);
            let mut stages = Stages::default();
            stages.resize(&gathered, &self.settings);
            passes.run(&gathered, proxies, &mut stages, &mut FrameStatistics::default());
            scatter(fine, &counts.unmatched, &gathered, &stages.shading, base, &mut self.radiance);
        }
        statistics.upsample_seconds = clock.lap();
        statistics.seconds = started.elapsed().as_secs_f64();
        Ok(statistics)
    }

    /// Brings the radiance without proxies up to date: everywhere if the light has changed, else where bodies were drawn.
    fn light_base(&mut self, changed: &[Rectangle]) {
        let (fine, still) = (&self.fine.receivers, &self.fine.still);
        let width = fine.width();
        let shading = &self.light.shading;
        let lit = |receivers: &Receivers, x: usize, y: usize| {
            let i = receivers.index(x, y);
            let albedo = receivers.albedo.each_ref().map(|plane| plane[i]);
            radiance(albedo, shading.unshadowed(receivers, i))
        };
        let body = |y: usize, x: usize| fine.depth[fine.index(x, y)] != still.depth[still.index(x, y)];
        if self.light_changed {
            let (camera, background) = (&self.fine.viewport.camera, &self.background);
            let pixel = |i: usize| {
                let (x, y) = (i % width, i / width);
                if still.is_seen(still.index(x, y)) {
                    return lit(still, x, y);
                }
                let seen = |light: &Environment| light.radiance(camera.pixel_direction(x as u32, y as u32)).to_array();
                background.as_ref().map_or([0.0; 3], seen)
            };
            (0..width * fine.height()).into_par_iter().map(pixel).collect_into_vec(&mut self.still_base);
            self.base.clone_from(&self.still_base);
            self.radiance.resize(self.base.len(), [0.0; 3]);
            self.light_changed = false;
        }
        let still_base = &self.still_base;
        self.base.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
            for rectangle in changed.iter().filter(|rectangle| rectangle.rows.contains(&y)) {
                for x in rectangle.columns.clone() {
                    row[x] = if body(y, x) { lit(fine, x, y) } else { still_base[y * width + x] };
                }
            }
        });
    }
}

impl Stages {
    fn resize(&mut self, receivers: &Receivers, settings: &Settings) {
        let places = receivers.stride() * receivers.height();
        self.log = HarmonicBuffer::zeros(settings.internal_order.len(), places);
        self.visibility = HarmonicBuffer::zeros(settings.order.len(), places);
        if settings.indirect.is_some() {
            self.indirect = HarmonicBuffer::zeros(INDIRECT_LEN, places);
        }
    }
}

/// The passes over receivers, all but set-up and upsampling.
struct Passes<'a> {
    settings: &'a Settings,
    light: &'a Light,
    log_table: &'a LogTable,
    exponentiator: &'a Exponentiator,
    direct: Option<&'a DirectProduct>,
    indirect_table: Option<&'a IndirectTable>,
}

impl Passes<'_> {
    fn run(&self, receivers: &Receivers, proxies: &[Proxy], stages: &mut Stages, statistics: &mut FrameStatistics) {
        let mut clock = Clock(Instant::now());
        let rule = self.settings.self_shadowing;
        let shadows = self.light.shadows;
        let counts = match self.direct {
            Some(direct) => direct_product(receivers, proxies, direct, rule, shadows, &mut stages.visibility),
            None => splat(receivers, proxies, self.log_table, rule, shadows, &mut stages.log),
        };
        statistics.splat_seconds = clock.lap();
        if self.direct.is_none() {
            statistics.unshadowed_groups = exponentiate(&stages.log, self.exponentiator, &mut stages.visibility);
        }
        statistics.exponentiate_seconds = clock.lap();
        let (tiles, empty_tiles, mut pairs) = (counts.tiles, counts.empty_tiles, counts.pairs);

        // Nothing reflects: no pass.
        let reflects = !self.light.reflected.is_dark() && proxies.iter().any(|proxy| proxy.albedo != glam::Vec3::ZERO);
        let table = self.indirect_table.filter(|_| reflects);
        statistics.indirect_skipped = self.indirect_table.is_some() && table.is_none();
        if let Some(table) = table {
            let (light, coverage) = (&self.light.reflected, self.light.indirect);
            pairs += splat_indirect(receivers, proxies, light, table, rule, coverage, &mut stages.indirect).pairs;
        }
        statistics.indirect_seconds = clock.lap();
        let indirect = table.map(|_| &stages.indirect);
        let light = &self.light.shading;
        shade(receivers, &stages.visibility, indirect, light, self.settings.interpolant, &mut stages.shading);
        statistics.shade_seconds = clock.lap();
        (statistics.tiles, statistics.empty_tiles, statistics.pairs) = (tiles, empty_tiles, pairs);
        statistics.proxies_out_of_reach = counts.out_of_reach;
    }
}

/// A watch that starts anew at every lap.
struct Clock(Instant);

impl Clock {
    fn lap(&mut self) -> f64 {
        let seconds = self.0.elapsed().as_secs_f64();
        self.0 = Instant::now();
        seconds
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::super::{Overlap, share_overlap};
    use super::*;
    use crate::sphere::{Order, cap, evaluate};

    /// A floor of two triangles, y up.
    fn floor() -> Surface {
        let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
        Surface {
            positions: vec![corner(-50.0, 50.0), corner(50.0, 50.0), corner(50.0, -50.0), corner(-50.0, -50.0)],
            normals: vec![Vec3::Y; 4],
            triangles: [[0, 1, 2], [0, 2, 3]].into(),
            albedo: vec![Vec3::new(0.8, 0.6, 0.4); 2],
            ..Surface::default()
        }
    }

    fn light() -> DistantLight {
        let order = Order::new(4).unwrap();
        let mut y = vec![0.0; order.len()];
        evaluate(order, DVec3::new(0.3, 0.8, 0.2).normalize(), &mut y);
        y[0] += 2.0;
        DistantLight::from_coefficients(order, [0.8, 1.0, 1.3].map(|x| y.iter().map(|y| x * y).collect()))
    }

    fn camera() -> Camera {
        Camera::new(DVec3::new(0.0, 4.0, 9.0), DVec3::new(0.0, 0.5, 0.0), DVec3::Y, 40.0, [96, 72]).unwrap()
    }

    fn proxy(center: Vec3, radius: f32, albedo: f32) -> Proxy {
        Proxy { center, radius, albedo: Vec3::splat(albedo), share: 1.0 }
    }

    fn renderer(settings: Settings) -> Renderer {
        Renderer::new(settings, &camera(), &floor(), &light(), None).unwrap()
    }

    const SPHERES: [Proxy; 3] = [
        Proxy { center: Vec3::new(0.0, 0.9, 0.0), radius: 0.6, albedo: Vec3::new(0.9, 0.2, 0.1), share: 1.0 },
        Proxy { center: Vec3::new(0.7, 0.5, 0.3), radius: 0.4, albedo: Vec3::new(0.1, 0.8, 0.1), share: 1.0 },
        Proxy { center: Vec3::new(-1.5, 0.2, 1.0), radius: 0.5, albedo: Vec3::ZERO, share: 1.0 },
    ];

    #[test]
    fn no_proxies_change_nothing_to_the_bit() {
        for receiver_scale in [1, 2, 4] {
            let mut renderer = renderer(Settings { receiver_scale, ..Settings::default() });
            let statistics = renderer.render(&[], &[]).unwrap();
            assert_eq!(renderer.radiance(), renderer.unshadowed());
            assert!(renderer.radiance().iter().filter(|l| l[0] > 0.0).count() > 3000);
            assert_eq!((statistics.changed_pixels, statistics.pairs, statistics.indirect_skipped), (0, 0, true));
            assert_eq!(statistics.empty_tiles, statistics.tiles);
            // Nor do proxies that nobody sees from where they are.
            let far = renderer.render(&[], &[proxy(Vec3::new(0.0, 900.0, 0.0), 1.0, 0.5)]).unwrap();
            assert_eq!(renderer.radiance(), renderer.unshadowed());
            assert_eq!(far.proxies_out_of_reach, 1);
        }
    }

    #[test]
    fn one_distant_proxy_hides_its_cap() {
        let settings = Settings { receiver_scale: 1, indirect: None, ..Settings::default() };
        let mut renderer = renderer(settings);
        let (centre, radius) = (DVec3::new(0.5, 6.0, -1.0), 1.0);
        renderer.render(&[], &[proxy(centre.as_vec3(), radius, 0.0)]).unwrap();
        let (light, order) = (light(), Order::new(4).unwrap());
        let product = crate::sphere::TripleProduct::new(order);
        let mut compared = 0;
        for y in 0..72 {
            for x in 0..96 {
                let display = renderer.display();
                let i = display.index(x, y);
                if !display.is_seen(i) {
                    continue;
                }
                let p = display.point(i).as_dvec3();
                let d = centre - p;
                let alpha = f64::from(radius) / d.length();
                if alpha < 1.3 / f64::from(renderer.coverage()[0].expansion) {
                    continue;
                }
                // The exact product of light and cap, under the clamped cosine.
                let hidden = cap(order, d.normalize(), (1.0 - alpha * alpha).sqrt());
                let mut product_light = vec![0.0; order.len()];
                let cosine = crate::sphere::clamped_cosine(order, DVec3::Y);
                for (colour, light) in light.coefficients().iter().enumerate() {
                    product.product(&hidden, light, &mut product_light);
                    let change: f64 = product_light.iter().zip(&cosine).map(|(l, c)| l * c).sum();
                    let albedo = [0.8, 0.6, 0.4][colour];
                    let pixel = y * 96 + x;
                    let found = renderer.unshadowed()[pixel][colour] - renderer.radiance()[pixel][colour];
                    // One logarithm, one exponential: errors of second order in the cap, a few thousandths of the light.
                    let expected = albedo / std::f64::consts::PI * change;
                    let allowed = 0.05 * expected.abs() + 1e-4;
                    assert!((f64::from(found) - expected).abs() < allowed, "{found} {expected} at {p}");
                }
                compared += 1;
            }
        }
        assert!(compared > 1000, "{compared}");
    }

    #[test]
    fn still_frames_are_shown_again_and_moved_ones_are_not() {
        let body = |x: f32| Surface {
            positions: vec![Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 0.0, 0.0), Vec3::new(x, 1.5, 0.0)],
            normals: vec![Vec3::Z; 3],
            triangles: [[0, 1, 2]].into(),
            albedo: vec![Vec3::ONE],
            ..Surface::default()
        };
        let mut moving = renderer(Settings::default());
        moving.render(&[body(-2.0)], &SPHERES).unwrap();
        let first = moving.radiance().to_vec();
        assert!(moving.render(&[body(-2.0)], &SPHERES).unwrap().still);
        assert!(!moving.render(&[body(0.5)], &SPHERES[..2]).unwrap().still);
        assert_ne!(moving.radiance(), first);
        // Back where it was: nothing of the other frame is left.
        moving.render(&[body(-2.0)], &SPHERES).unwrap();
        assert_eq!(moving.radiance(), first);
        // Without proxies a body is lit as its normal has it.
        let expected = light().irradiance(DVec3::Z).map(|e| (e / std::f64::consts::PI) as f32);
        let display = moving.display();
        let white = (0..96 * 72).filter(|i| display.albedo[2][display.index(i % 96, i / 96)] == 1.0);
        let lit = white.map(|i| moving.unshadowed()[i]).collect::<Vec<_>>();
        assert!(lit.len() > 50 && lit.iter().flatten().zip(expected.iter().cycle()).all(|(a, b)| (a - b).abs() < 1e-5));
        // A new light changes the picture, and nothing but the light is new.
        let turned = light().rotated(glam::DMat3::from_rotation_y(1.0));
        moving.set_light(&turned, None);
        assert!(!moving.render(&[body(-2.0)], &SPHERES).unwrap().still);
        let mut fresh = Renderer::new(Settings::default(), &camera(), &floor(), &turned, None).unwrap();
        fresh.render(&[body(-2.0)], &SPHERES).unwrap();
        assert_eq!(moving.radiance(), fresh.radiance());
    }

    #[test]
    fn frames_do_not_depend_on_the_number_of_threads() {
        let frame = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut renderer = renderer(Settings { receiver_scale: 2, ..Settings::default() });
                renderer.render(&[], &SPHERES).unwrap();
                renderer.radiance().to_vec()
            })
        };
        assert_eq!(frame(1), frame(3));
    }

    #[test]
    fn coarse_receivers_come_close_to_fine_ones() {
        let frame = |settings| {
            let mut renderer = renderer(settings);
            renderer.render(&[], &SPHERES).unwrap();
            renderer.radiance().to_vec()
        };
        let fine = frame(Settings { receiver_scale: 1, ..Settings::default() });
        for interpolant in [super::super::Interpolant::Vectors, super::super::Interpolant::Shades] {
            let coarse = frame(Settings { receiver_scale: 2, interpolant, ..Settings::default() });
            let errors = fine.iter().flatten().zip(coarse.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2));
            let error = (errors.sum::<f64>() / (3 * fine.len()) as f64).sqrt();
            // Three receivers across the smallest shadow.
            assert!(error < 0.015, "{interpolant}: {error}");
        }
    }

    #[test]
    fn spheres_in_one_place_hide_what_one_hides() {
        let frame = |overlap, count: usize| {
            let mut renderer = renderer(Settings { receiver_scale: 1, indirect: None, overlap, ..Settings::default() });
            let mut body = vec![SPHERES[0]; count];
            share_overlap(&mut body);
            renderer.render(&[], &body).unwrap();
            renderer.radiance().to_vec()
        };
        let one = frame(Overlap::Shared, 1);
        let differs = |other: Vec<[f32; 3]>| {
            one.iter().flatten().zip(other.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        assert!(differs(frame(Overlap::Shared, 8)) < 1e-5);
        assert!(differs(frame(Overlap::Multiplied, 8)) > 0.05);
        assert_eq!(differs(frame(Overlap::Multiplied, 1)), 0.0);
    }

    #[test]
    fn overlap_adds_no_light() {
        let settings = Settings { receiver_scale: 1, ..Settings::default() };
        let reflected = |count: usize| {
            let mut renderer = renderer(settings);
            renderer.render(&[], &vec![SPHERES[0]; count]).unwrap();
            let shading = &renderer.stages.shading;
            (0..shading.touched.len()).map(|i| shading.rows(i)[shading.len() - 1][0]).collect::<Vec<f32>>()
        };
        let (once, often) = (reflected(1), reflected(10));
        assert!(once.iter().any(|x| *x > 0.05));
        let most = once.iter().copied().fold(0.0, f32::max);
        for (one, ten) in once.iter().zip(&often) {
            // Never more than ten spheres side by side would give; in four bands small ones do not know that they overlap.
            assert!(*ten <= 10.0 * one * 1.0001 + 1e-6, "{one} {ten}");
            // Large ones do: what ten hide is what one hides.
            assert!(*one < 0.8 * most || *ten < 1.6 * one, "{one} {ten}");
        }
    }

    #[test]
    fn bad_input_is_refused() {
        let mut renderer = renderer(Settings::default());
        let message = renderer.render(&[], &[proxy(Vec3::ZERO, -1.0, 0.0)]).unwrap_err().to_string();
        assert!(message.contains("sphere 0") && message.contains("radius"), "{message}");
        let settings = Settings { receiver_scale: 3, ..Settings::default() };
        assert!(Renderer::new(settings, &camera(), &floor(), &light(), None).is_err());
    }
}
