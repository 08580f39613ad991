//! Integrals over the visible directions of a receiver by randomised quasi-Monte Carlo.

use std::f64::consts::{FRAC_1_PI, TAU};

use glam::DVec3;
use rayon::prelude::*;
use sobol_burley::parts::hash;

use super::{Columns, Estimates, RayScene, Request, Sobol};
use crate::{
    Result,
    sphere::{Order, evaluate},
    visibility::Receiver,
};

/// How many rays are cast, and which.
///
/// The samples of a receiver are split over R = [`Qmc::RANDOMISATIONS`] independent randomisations of the Sobol sequence. The value is the mean over the randomisations and its standard error the
/// spread of their means over sqrt(R); with few randomisations that estimate itself is uncertain (Student's t with R - 1
/// degrees of freedom, and zero where all randomisations
/// happen to agree, as they do about occluders too small to be met by any). Where the visible region has edges the error falls like the -3/4th power of the samples, without the split
/// it would be smaller by a factor of about R^(1/4).
///
/// Directions are drawn uniformly over the hemisphere (over the sphere without a normal), or in proportion to the cosine if
/// nothing but cosine-weighted quantities is asked for. The uniform density serves both kinds: its occlusion is about 15 %
/// less accurate than that of cosine samples, whose unweighted harmonics in turn have no finite variance at the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qmc {
    /// Directions per receiver, rounded up to a power of two and to at least [`Qmc::RANDOMISATIONS`]. With a light that has a
    /// distribution, as many again are drawn from it.
    pub samples: u32,
    /// Different seeds give independent estimates. The receivers of one run are independent of each other, too.
    pub seed: u32,
}

/// The density that directions are drawn from.
#[derive(Clone, Copy)]
enum Density {
    Sphere,
    Hemisphere,
    Cosine,
}

/// A receiver's frame, density and outputs.
struct Integrand<'a> {
    receiver: Receiver<'a>,
    /// Tangent, bitangent, normal.
    frame: [DVec3; 3],
    density: Density,
    request: &'a Request<'a>,
    columns: Columns,
}

impl Qmc {
    /// Independent randomisations that a receiver's samples are split over.
    pub const RANDOMISATIONS: u32 = 8;

    /// Points in each randomisation: a power of two.
    fn points(&self) -> u32 {
        (self.rounded_samples() / u64::from(Self::RANDOMISATIONS)) as u32
    }

    /// Directions cast per receiver: `samples` rounded up.
    pub fn rounded_samples(&self) -> u64 {
        u64::from(self.samples).next_power_of_two().max(Self::RANDOMISATIONS.into())
    }

    /// Estimates of all `receivers`, on all threads; the same bits for any number of them.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) if a receiver is not finite or lacks a normal that the request needs, or if a light is missing.
    pub fn integrate(&self, rays: &RayScene, receivers: &[Receiver], request: &Request) -> Result<Estimates> {
        request.check()?;
        let len = request.columns().len();
        let mut estimates =
            Estimates { values: vec![0.0; receivers.len() * len], errors: vec![0.0; receivers.len() * len] };
        if len == 0 {
            return Ok(estimates);
        }
        let rows = estimates.values.par_chunks_mut(len).zip(estimates.errors.par_chunks_mut(len));
        rows.zip(receivers).enumerate().try_for_each(|(index, ((values, errors), receiver))| {
            self.integrate_one(rays, index, receiver, request, values, errors)
        })?;
        Ok(estimates)
    }

    /// Estimates of one receiver, number `index` of its run, into one row of values and one of standard errors.
    ///
    /// # Errors
    /// As [`Qmc::integrate`].
    ///
    /// # Panics
    /// If a row is not `request.columns().len()` long.
    pub fn integrate_one(
        &self,
        rays: &RayScene,
        index: usize,
        receiver: &Receiver,
        request: &Request,
        values: &mut [f64],
        errors: &mut [f64],
    ) -> Result<()> {
        request.check()?;
        request.check_receiver(index, receiver)?;
        let integrand = Integrand::new(*receiver, request);
        let len = integrand.columns.len();
        assert!(values.len() == len && errors.len() == len);
        let (randomisations, points) = (Self::RANDOMISATIONS, self.points());
        let key = hash(hash(self.seed) ^ index as u32);
        let mut means = vec![0.0; randomisations as usize * len];
        for (randomisation, row) in (0..randomisations).zip(means.chunks_exact_mut(len)) {
            let seed = key.wrapping_add(2 * randomisation);
            integrand.sum(rays, Sobol::new(seed), Sobol::new(seed.wrapping_add(1)), points, row);
            row.iter_mut().for_each(|sum| *sum /= f64::from(points));
        }
        let count = f64::from(randomisations);
        for k in 0..len {
            let column = means[k..].iter().step_by(len);
            let mean = column.clone().sum::<f64>() / count;
            let squares: f64 = column.map(|x| (x - mean) * (x - mean)).sum();
            values[k] = mean;
            errors[k] = (squares / (count * (count - 1.0))).sqrt();
        }
        Ok(())
    }
}

impl<'a> Integrand<'a> {
    fn new(receiver: Receiver<'a>, request: &'a Request<'a>) -> Self {
        let normal = receiver.normal.unwrap_or(DVec3::Z);
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let cosine_only = request.visibility_sh.is_none() && !request.vector_irradiance;
        let density = match receiver.normal {
            None => Density::Sphere,
            Some(_) if cosine_only => Density::Cosine,
            Some(_) => Density::Hemisphere,
        };
        Self { receiver, frame: [tangent, bitangent, normal], density, request, columns: request.columns() }
    }

    /// The direction of a point of the unit square, its cosine with the normal and its density per solid angle.
    fn direction(&self, [x, y]: [f64; 2]) -> (DVec3, f64, f64) {
        let (z, r) = match self.density {
            Density::Sphere => (2.0 * x - 1.0, (4.0 * x * (1.0 - x)).sqrt()),
            Density::Hemisphere => (x, ((1.0 - x) * (1.0 + x)).sqrt()),
            Density::Cosine => (x.sqrt(), (1.0 - x).sqrt()),
        };
        let (sine, cosine) = (TAU * y).sin_cos();
        let [tangent, bitangent, normal] = self.frame;
        (r * cosine * tangent + r * sine * bitangent + z * normal, z, self.density_at(z))
    }

    fn density_at(&self, cosine: f64) -> f64 {
        match self.density {
            Density::Sphere => 0.25 * FRAC_1_PI,
            Density::Hemisphere => 0.5 * FRAC_1_PI,
            Density::Cosine => FRAC_1_PI * cosine,
        }
    }

    /// Adds integrand over density of `points` samples to `row`.
    fn sum(&self, rays: &RayScene, sobol: Sobol, light_sobol: Sobol, points: u32, row: &mut [f64]) {
        let Receiver { position, normal, excluded } = self.receiver;
        let distribution = self.request.light.and_then(|light| light.distribution);
        let lit = self.request.irradiance || self.request.vector_irradiance;
        let order = self.request.visibility_sh.max(self.request.transfer_sh);
        let mut y = vec![0.0; order.map_or(0, Order::len)];
        for k in 0..points {
            let (w, cosine, density) = self.direction(sobol.point(k));
            if rays.occluded(position, w, excluded) {
                continue;
            }
            if let Some(order) = order {
                evaluate(order, w, &mut y);
            }
            self.add_visibility(cosine, 1.0 / density, &y, row);
            if lit {
                let joint = density + distribution.map_or(0.0, |distribution| distribution.density(w));
                self.add_light(w, cosine, 1.0 / joint, row);
            }
        }
        let Some(distribution) = distribution.filter(|_| lit) else { return };
        for k in 0..points {
            let (w, density) = distribution.sample(light_sobol.point(k));
            let cosine = normal.map_or(1.0, |n| n.dot(w));
            if cosine > 0.0 && !rays.occluded(position, w, excluded) {
                self.add_light(w, cosine, 1.0 / (density + self.density_at(cosine)), row);
            }
        }
    }

    fn add_visibility(&self, cosine: f64, weight: f64, y: &[f64], row: &mut [f64]) {
        let clamped = FRAC_1_PI * cosine * weight;
        row[self.columns.ambient_occlusion.clone()].iter_mut().for_each(|sum| *sum += clamped);
        row[self.columns.visibility_sh.clone()].iter_mut().zip(y).for_each(|(sum, y)| *sum += weight * y);
        row[self.columns.transfer_sh.clone()].iter_mut().zip(y).for_each(|(sum, y)| *sum += clamped * y);
    }

    fn add_light(&self, w: DVec3, cosine: f64, weight: f64, row: &mut [f64]) {
        let Some(light) = self.request.light else { return };
        let radiance = (light.radiance)(w).map(|l| weight * l);
        row[self.columns.irradiance.clone()].iter_mut().zip(radiance).for_each(|(sum, l)| *sum += l * cosine);
        let axes = w.to_array();
        for (sums, l) in row[self.columns.vector_irradiance.clone()].chunks_exact_mut(3).zip(radiance) {
            sums.iter_mut().zip(axes).for_each(|(sum, axis)| *sum += l * axis);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::{DMat3, Vec3};

    use super::*;
    use crate::{
        reference::{
            Light, PixelDistribution,
            fixtures::{cuboid, geometry, polygon, sphere, union},
        },
        scene::Geometry,
        sphere::{cap, clamped_cosine, closed_forms, hemisphere},
    };

    fn order(bands: usize) -> Option<Order> {
        Some(Order::new(bands).unwrap())
    }

    /// A disc of 720 corners above the origin, parallel to its plane.
    fn disc(radius: f32, centre: Vec3) -> (Geometry, Vec<DVec3>) {
        let corners: Vec<_> = (0..720)
            .map(|k| {
                let (s, c) = (TAU * f64::from(k) / 720.0).sin_cos();
                centre + radius * DVec3::new(c, s, 0.0).as_vec3()
            })
            .collect();
        let exact = corners.iter().map(|c| c.as_dvec3()).collect();
        (polygon(corners), exact)
    }

    fn rectangle(corner: Vec3, a: f32, b: f32) -> (Geometry, Vec<DVec3>) {
        let corners = [(0.0, 0.0), (a, 0.0), (a, b), (0.0, b)].map(|(x, y)| corner + Vec3::new(x, y, 0.0));
        (polygon(corners), corners.map(|c| c.as_dvec3()).to_vec())
    }

    fn run(qmc: Qmc, scene: &Geometry, normal: Option<DVec3>, request: &Request) -> (Vec<f64>, Vec<f64>) {
        let receiver = Receiver { position: DVec3::ZERO, normal, excluded: &[] };
        let Estimates { values, errors } = qmc.integrate(&RayScene::new(scene), &[receiver], request).unwrap();
        (values, errors)
    }

    /// Asserts that `values` are within four standard errors of `exact`; `floor` is the exact values' own error.
    fn assert_within(values: &[f64], errors: &[f64], exact: &[f64], floor: f64) {
        assert_eq!(values.len(), exact.len());
        for (k, ((value, error), exact)) in values.iter().zip(errors).zip(exact).enumerate() {
            assert!((value - exact).abs() <= 4.0 * error + floor, "{k}: {value} +- {error}, exactly {exact}");
        }
    }

    #[test]
    fn open_sky_is_exact() {
        let n = DVec3::new(0.6, 0.0, -0.8);
        let empty = geometry(Vec::new(), Vec::new());
        let request = Request { ambient_occlusion: true, transfer_sh: order(4), ..Default::default() };
        let (values, errors) = run(Qmc { samples: 1 << 14, seed: 1 }, &empty, Some(n), &request);
        assert_eq!((values[0], errors[0]), (1.0, 0.0));
        let expected: Vec<f64> = clamped_cosine(Order::new(4).unwrap(), n).iter().map(|f| f / PI).collect();
        assert_within(&values[1..], &errors[1..], &expected, 1e-12);
        // A smooth integrand: the -3/2nd power of the 2048 points.
        assert!(errors.iter().all(|&error| error < 5.0 * 2048f64.powf(-1.5)), "{errors:?}");
        let request = Request { visibility_sh: order(4), ..Default::default() };
        let (values, errors) = run(Qmc { samples: 1 << 14, seed: 2 }, &empty, Some(n), &request);
        assert_within(&values, &errors, &hemisphere(Order::new(4).unwrap(), n), 1e-12);
        let (values, errors) = run(Qmc { samples: 1 << 14, seed: 3 }, &empty, None, &request);
        assert_within(&values, &errors, &cap(Order::new(4).unwrap(), n, -1.0), 1e-12);
    }

    #[test]
    fn form_factors_and_solid_angles_of_polygons() {
        let scenes = [
            disc(0.5, Vec3::new(0.0, 0.0, 0.4)),
            disc(0.6, Vec3::new(0.9, 0.2, 0.3)),
            rectangle(Vec3::new(0.0, 0.0, 0.5), 0.7, 1.3),
            rectangle(Vec3::new(-0.2, -0.4, 0.05), 0.7, 0.6),
        ];
        let band = (0.25 / PI).sqrt();
        for (scene, corners) in &scenes {
            for visibility_sh in [None, order(1)] {
                let request = Request { ambient_occlusion: true, visibility_sh, ..Default::default() };
                let (values, errors) = run(Qmc { samples: 1 << 13, seed: 5 }, scene, Some(DVec3::Z), &request);
                let exact = [
                    1.0 - closed_forms::polygon_form_factor(corners, DVec3::Z),
                    band * (2.0 * PI - closed_forms::polygon_solid_angle(corners)),
                ];
                assert_within(&values, &errors, &exact[..values.len()], 1e-12);
                assert!(errors[0] > 1e-5 && errors.iter().all(|&error| error < 3e-3), "{errors:?}");
            }
        }
    }

    #[test]
    fn harmonics_of_a_blocked_cap() {
        // A sphere with its poles on the axis: the cap less the facets' sagitta, (pi / rings)^2 / 2 of the radius.
        let scene = sphere(Vec3::new(0.0, 0.0, 2.0), 1.0, 64);
        let order = Order::new(6).unwrap();
        let request = Request { visibility_sh: Some(order), ..Default::default() };
        for normal in [None, Some(DVec3::Z)] {
            let whole = cap(order, DVec3::Z, if normal.is_some() { 0.0 } else { -1.0 });
            let blocked = cap(order, DVec3::Z, 0.75f64.sqrt());
            let exact: Vec<f64> = whole.iter().zip(&blocked).map(|(a, b)| a - b).collect();
            let (values, errors) = run(Qmc { samples: 1 << 14, seed: 9 }, &scene, normal, &request);
            assert_within(&values, &errors, &exact, 2e-3);
        }
    }

    /// Values, errors and the exact accessibility of 256 receivers below a rectangle.
    fn many(samples: u32) -> Vec<[f64; 3]> {
        let (scene, corners) = rectangle(Vec3::new(0.0, 0.0, 1.0), 1.0, 1.0);
        let rays = RayScene::new(&scene);
        let positions: Vec<_> =
            (0..256).map(|k| DVec3::new(0.13 * f64::from(k % 16), 0.11 * f64::from(k / 16), 0.2)).collect();
        let receivers: Vec<_> =
            positions.iter().map(|&position| Receiver { position, normal: Some(DVec3::Z), excluded: &[] }).collect();
        let request = Request { ambient_occlusion: true, ..Default::default() };
        let estimates = Qmc { samples, seed: 11 }.integrate(&rays, &receivers, &request).unwrap();
        (0..256)
            .map(|k| {
                let relative: Vec<_> = corners.iter().map(|&corner| corner - positions[k]).collect();
                let exact = 1.0 - closed_forms::polygon_form_factor(&relative, DVec3::Z);
                [estimates.values[k], estimates.errors[k], exact]
            })
            .collect()
    }

    fn rms(values: impl Iterator<Item = f64>) -> f64 {
        let (sum, count) = values.fold((0.0, 0), |(sum, count), x| (sum + x * x, count + 1));
        (sum / f64::from(count)).sqrt()
    }

    #[test]
    fn standard_errors_are_calibrated() {
        for samples in [64, 1024] {
            let results = many(samples);
            // Student's t with 7 degrees of freedom: P(|t| > 3) = 2.0 %, so 5 +- 2.2 of 256; P(|t| < 1) = 64.9 %, 166 +- 7.6.
            let beyond = |z: f64| results.iter().filter(|[v, e, exact]| (v - exact).abs() > z * e).count();
            assert!(beyond(3.0) <= 14, "{}", beyond(3.0));
            assert!((60..=120).contains(&beyond(1.0)), "{}", beyond(1.0));
            let ratio = rms(results.iter().map(|r| r[1])) / rms(results.iter().map(|r| r[0] - r[2]));
            // Both have a relative deviation below 10 % for 256 independent receivers.
            assert!((0.75..1.33).contains(&ratio), "{ratio}");
        }
    }

    #[test]
    fn the_error_falls_with_the_samples() {
        let error = |samples| rms(many(samples).iter().map(|r| r[0] - r[2]));
        let slope = (error(1 << 12) / error(1 << 6)).log2() / 6.0;
        assert!(slope < -0.7, "{slope}");
    }

    #[test]
    fn excluded_faces_do_not_occlude() {
        let scene = union(&[
            rectangle(Vec3::new(-0.5, -0.5, 0.3), 1.0, 1.0).0,
            rectangle(Vec3::new(-0.5, -0.5, 0.6), 1.0, 1.0).0,
        ]);
        let rays = RayScene::new(&scene);
        let request = Request { ambient_occlusion: true, ..Default::default() };
        let value = |excluded: &[u32]| {
            let receiver = Receiver { position: DVec3::ZERO, normal: Some(DVec3::Z), excluded };
            Qmc { samples: 4096, seed: 0 }.integrate(&rays, &[receiver], &request).unwrap().values[0]
        };
        let far = RayScene::new(&rectangle(Vec3::new(-0.5, -0.5, 0.6), 1.0, 1.0).0);
        let receiver = Receiver { position: DVec3::ZERO, normal: Some(DVec3::Z), excluded: &[] };
        let only_far = Qmc { samples: 4096, seed: 0 }.integrate(&far, &[receiver], &request).unwrap().values[0];
        assert_eq!(value(&[0, 1, 2, 3]), 1.0);
        assert_eq!(value(&[0, 1]), only_far);
        assert!(value(&[2, 3]) < only_far && value(&[2, 3]) == value(&[]));
    }

    #[test]
    fn a_receiver_on_a_box_leaves_out_its_own_face_only() {
        // The centre of the top face: open; the centre of the bottom face seen from inside: closed but for its own face.
        let scene = cuboid(Vec3::splat(-1.0), Vec3::splat(1.0));
        let rays = RayScene::new(&scene);
        let own = |z: f32| -> Vec<u32> {
            (0u32..)
                .zip(scene.triangles.iter())
                .filter(|(_, t)| t.iter().all(|&v| scene.positions[v as usize].z == z))
                .map(|(face, _)| face)
                .collect()
        };
        let request = Request { ambient_occlusion: true, ..Default::default() };
        for (z, expected) in [(1.0, 1.0), (-1.0, 0.0)] {
            let excluded = own(z);
            assert_eq!(excluded.len(), 2);
            let receiver =
                Receiver { position: DVec3::new(0.1, 0.2, z.into()), normal: Some(DVec3::Z), excluded: &excluded };
            let estimates = Qmc { samples: 1024, seed: 0 }.integrate(&rays, &[receiver], &request).unwrap();
            assert_eq!(estimates.values, [expected]);
        }
    }

    /// A sky of 16 x 8 pixels, one of them a thousand times brighter, with its exact irradiance on an open plane facing +z.
    fn sky() -> (impl Fn(DVec3) -> [f64; 3] + Sync, PixelDistribution, [f64; 3]) {
        let radiance = |pixel: usize| {
            let base = [1.0, 0.5 + 0.03 * (pixel % 16) as f64, 0.2 + 0.1 * (pixel / 16) as f64];
            if pixel == 37 { base.map(|l| 1000.0 * l) } else { base }
        };
        let polar = |row: usize| PI * row as f64 / 8.0;
        let mut irradiance = [0.0; 3];
        let mut weights = vec![0.0; 128];
        for (pixel, weight) in weights.iter_mut().enumerate() {
            let (a, b) = (polar(pixel / 16), polar(pixel / 16 + 1));
            let l = radiance(pixel);
            *weight = l.iter().sum::<f64>() * TAU / 16.0 * (a.cos() - b.cos());
            if pixel < 64 {
                let moment = TAU / 16.0 * 0.5 * (b.sin() * b.sin() - a.sin() * a.sin());
                (0..3).for_each(|c| irradiance[c] += l[c] * moment);
            }
        }
        let lookup = move |w: DVec3| {
            let turn = w.y.atan2(w.x) / TAU;
            let column = ((if turn < 0.0 { turn + 1.0 } else { turn }) * 16.0) as usize;
            let row = (w.z.clamp(-1.0, 1.0).acos() / PI * 8.0) as usize;
            radiance(row.min(7) * 16 + column.min(15))
        };
        let distribution = PixelDistribution::new(16, 8, &weights, DMat3::IDENTITY).unwrap();
        (lookup, distribution, irradiance)
    }

    #[test]
    fn irradiance_of_a_sky_with_a_sun() {
        let (radiance, distribution, exact) = sky();
        let empty = geometry(Vec::new(), Vec::new());
        let mut widths = Vec::new();
        for distribution in [None, Some(&distribution)] {
            let light = Some(Light { radiance: &radiance, distribution });
            let request = Request { irradiance: true, vector_irradiance: true, light, ..Default::default() };
            let (values, errors) = run(Qmc { samples: 4096, seed: 4 }, &empty, Some(DVec3::Z), &request);
            assert_within(&values[..3], &errors[..3], &exact, 1e-9);
            // The vector's component along the normal is the irradiance.
            let along = |row: &[f64]| [row[5], row[8], row[11]];
            assert_within(&along(&values), &along(&errors), &exact, 1e-9);
            widths.push(errors[0]);
        }
        assert!(widths[1] < 0.2 * widths[0], "importance sampling must pay: {widths:?}");
    }

    #[test]
    fn light_that_is_sampled_is_occluded_alike() {
        let (radiance, distribution, _) = sky();
        // It hides a part of the sun.
        let (scene, _) = rectangle(Vec3::new(-0.3, -0.5, 0.4), 0.8, 1.1);
        let request = |distribution| Request {
            irradiance: true,
            vector_irradiance: true,
            light: Some(Light { radiance: &radiance, distribution }),
            ..Default::default()
        };
        let (values, errors) =
            run(Qmc { samples: 8192, seed: 4 }, &scene, Some(DVec3::Z), &request(Some(&distribution)));
        let (brute, brute_errors) = run(Qmc { samples: 1 << 17, seed: 5 }, &scene, Some(DVec3::Z), &request(None));
        for k in 0..12 {
            let error = errors[k].hypot(brute_errors[k]);
            assert!((values[k] - brute[k]).abs() < 4.0 * error, "{k}: {} {} +- {error}", values[k], brute[k]);
        }
        // A white light turns irradiance into occlusion times pi.
        let white = |_: DVec3| [1.0, 2.0, 3.0];
        let request = Request {
            ambient_occlusion: true,
            irradiance: true,
            light: Some(Light { radiance: &white, distribution: None }),
            ..Default::default()
        };
        let (values, _) = run(Qmc { samples: 1024, seed: 5 }, &scene, Some(DVec3::Z), &request);
        for k in 0..3 {
            assert!((values[1 + k] / (PI * values[0] * (k + 1) as f64) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn results_do_not_depend_on_threads_but_on_seed_and_receiver() {
        let (scene, _) = rectangle(Vec3::new(0.1, -0.5, 0.4), 0.8, 1.5);
        let rays = RayScene::new(&scene);
        let receivers = [Receiver { position: DVec3::ZERO, normal: Some(DVec3::Z), excluded: &[] }; 40];
        let request = Request { ambient_occlusion: true, visibility_sh: order(4), ..Default::default() };
        let run = |threads, seed| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Qmc { samples: 256, seed }.integrate(&rays, &receivers, &request).unwrap())
        };
        let once = run(1, 0);
        assert_eq!(once, run(3, 0));
        assert_ne!(once, run(1, 1));
        assert_ne!(once.values[..17], once.values[17..34]);
    }

    #[test]
    fn samples_are_rounded_up_and_split() {
        let points = |samples| Qmc { samples, seed: 0 }.points();
        assert_eq!([0, 1000, 1 << 20].map(points), [1, 128, 1 << 17]);
        assert_eq!(Qmc { samples: u32::MAX, seed: 0 }.rounded_samples(), 1 << 32);
    }

    #[test]
    fn what_is_not_defined_is_refused() {
        let rays = RayScene::new(&geometry(Vec::new(), Vec::new()));
        let message = |receiver: Receiver, request: Request| {
            let good = Receiver { position: DVec3::ZERO, normal: Some(DVec3::Z), excluded: &[] };
            let result = Qmc { samples: 8, seed: 0 }.integrate(&rays, &[good, receiver], &request);
            result.unwrap_err().to_string()
        };
        let probe = Receiver { position: DVec3::ZERO, normal: None, excluded: &[] };
        let occlusion = Request { ambient_occlusion: true, ..Default::default() };
        assert!(message(probe, occlusion).contains("receiver 1 has no normal"));
        let lost = Receiver { position: DVec3::splat(f64::NAN), normal: Some(DVec3::Z), excluded: &[] };
        assert!(message(lost, occlusion).contains("receiver 1: position"));
        assert!(message(probe, Request { vector_irradiance: true, ..Default::default() }).contains("light"));
    }
}
