use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};
use sobol_burley::parts::hash;

use super::EmbreeScene;
use super::caster::{Query, Rays};
use super::directions::{Density, Directions, LANES};
use crate::Result;
use crate::reference::{Columns, EmbreeKernel, Request, Sobol};
use crate::scene::Environment;
use crate::sphere::{Order, rotate};
use crate::visibility::Receiver;

/// Quasi-Monte Carlo on Embree: the fastest honest way that is known to us.
///
/// All receivers share one Owen-scrambled Sobol set of directions, sorted once along a Morton curve, with everything that
/// depends on the direction alone tabulated; each turns it by an angle of its own about its normal. Directions are drawn in
/// proportion to the cosine if nothing but cosine-weighted quantities is asked for, and otherwise evenly over the hemisphere.
/// Under an uneven light as many again are drawn in proportion to the light, from a second set that stands still.
///
/// The standard errors are the spread over the set's eight blocks, as if the blocks were independent. They share one scrambling and are better
/// than that: where the visible region has edges, by up to 8^(1/4) = 1.7.
pub struct EmbreeQmc<'a> {
    scene: &'a EmbreeScene,
    kernel: EmbreeKernel,
    columns: Columns,
    /// Visibility and cosine-weighted quantities.
    around: Option<Directions>,
    density: Density,
    visibility: Option<Order>,
    transfer: Option<Order>,
    light: Light,
    seed: u32,
    /// Points of each block.
    block: f64,
}

enum Light {
    None,
    /// The same radiance from everywhere.
    Even(DVec3),
    Uneven(Directions),
}

/// Working memory of one thread.
#[derive(Default)]
pub struct Memory {
    rays: Rays,
    /// Sums by receiver, integral and lane.
    sums: Vec<[f64; LANES]>,
    /// Of one receiver and a piece of the set, which is short enough for single precision.
    piece: Vec<[f32; LANES]>,
}

/// Packets that one receiver of a tile takes before it is the next one's turn: their tables stay in the cache, and
/// neighbours' rays in similar directions meet the same faces.
const PIECE: usize = 256;

impl<'a> EmbreeQmc<'a> {
    /// Prepares `samples` directions, rounded up to a power of two and to at least eight, for receivers of which all have normals or,
    /// for `probes`, none. `request.light` is not looked at; `environment` is the light.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) if a light is missing or its sum is not finite.
    pub fn new(
        scene: &'a EmbreeScene,
        kernel: EmbreeKernel,
        request: &Request,
        environment: Option<&Environment>,
        probes: bool,
        samples: u32,
        seed: u32,
    ) -> Result<Self> {
        let points = samples.clamp(LANES as u32, Sobol::LENGTH).next_power_of_two();
        let Request { ambient_occlusion, visibility_sh: visibility, transfer_sh: transfer, .. } = *request;
        let lit = request.irradiance || request.vector_irradiance;
        let even = environment.and_then(Environment::uniform).filter(|_| lit);
        // An even light's vector irradiance is its radiance times the first moment of V, which is in band 1.
        let moment = (even.is_some() && request.vector_irradiance).then(|| Order::new(2)).transpose()?;
        let visibility = visibility.max(moment);
        let density = match (probes, visibility) {
            (true, _) => Density::Sphere,
            (false, None) => Density::Cosine,
            (false, Some(_)) => Density::Hemisphere,
        };
        let needed = ambient_occlusion || visibility.is_some() || transfer.is_some() || even.is_some();
        let key = hash(seed);
        Ok(Self {
            scene,
            kernel,
            columns: request.columns(),
            around: needed.then(|| Directions::around_normal(points, Sobol::new(key), density, visibility, transfer)),
            density,
            visibility,
            transfer,
            light: match (lit, even, environment) {
                (false, ..) => Light::None,
                (true, Some(radiance), _) => Light::Even(radiance.as_dvec3()),
                (true, None, Some(light)) => {
                    Light::Uneven(Directions::towards_light(points, Sobol::new(key.wrapping_add(1)), light)?)
                }
                (true, None, None) => {
                    return Err(crate::Error::input("irradiance was asked for, but there is no light"));
                }
            },
            seed,
            block: f64::from(points) / LANES as f64,
        })
    }

    /// Where the quantities stand in a row.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// Estimates of some receivers, neighbours of each other, each with its number in its run: a row of values and one of
    /// standard errors for each.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) if a receiver is not finite, lacks a normal that the request needs, or leaves out faces of a scene that
    /// was built without a filter.
    ///
    /// # Panics
    /// If the rows are not `columns().len()` long.
    pub fn integrate(
        &self,
        receivers: &[(usize, Receiver)],
        values: &mut [f64],
        errors: &mut [f64],
        memory: &mut Memory,
    ) -> Result<()> {
        let len = self.columns.len();
        assert!(values.len() == len * receivers.len() && errors.len() == values.len());
        self.check(receivers)?;
        values.fill(0.0);
        errors.fill(0.0);
        if let Some(directions) = &self.around {
            let frames: Vec<DMat3> = receivers.iter().map(|&(number, receiver)| self.frame(number, receiver)).collect();
            self.sum(directions, receivers, &frames, memory);
            let rows = values.chunks_exact_mut(len).zip(errors.chunks_exact_mut(len));
            for (((values, errors), sums), frame) in
                rows.zip(memory.sums.chunks_exact(directions.integrals())).zip(frames)
            {
                self.put_visibility(sums, frame, values, errors);
            }
        }
        if let Light::Uneven(directions) = &self.light {
            self.sum(directions, receivers, &vec![DMat3::IDENTITY; receivers.len()], memory);
            let rows = values.chunks_exact_mut(len).zip(errors.chunks_exact_mut(len));
            for (((values, errors), sums), (_, receiver)) in
                rows.zip(memory.sums.chunks_exact(directions.integrals())).zip(receivers)
            {
                self.put_light(sums, receiver.normal, values, errors);
            }
        }
        Ok(())
    }

    fn check(&self, receivers: &[(usize, Receiver)]) -> Result<()> {
        for (number, receiver) in receivers {
            let Receiver { position, normal, excluded } = receiver;
            let refuse = |why: &str| Err(crate::Error::input(format!("receiver {number}: {why}")));
            if !(position.as_vec3().is_finite() && normal.is_none_or(DVec3::is_finite)) {
                return refuse("position and normal must be finite");
            }
            if normal.is_none() != (self.density == Density::Sphere) && self.around.is_some() {
                return refuse("either all receivers have normals or none has");
            }
            if normal.is_none()
                && !(self.columns.ambient_occlusion.is_empty()
                    && self.columns.transfer_sh.is_empty()
                    && self.columns.irradiance.is_empty())
            {
                return refuse("without a normal only visibility and vector irradiance are defined");
            }
            if !(excluded.is_empty() || self.scene.filters()) {
                return refuse("it leaves out faces, but the scene was built without a filter");
            }
        }
        Ok(())
    }

    /// Tangent, bitangent and normal; the first two are turned by an angle of the receiver's own.
    fn frame(&self, number: usize, receiver: Receiver) -> DMat3 {
        let Some(normal) = receiver.normal else { return DMat3::IDENTITY };
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let (sine, cosine) = (f64::from(hash(hash(self.seed) ^ number as u32)) / 2f64.powi(32) * TAU).sin_cos();
        DMat3::from_cols(cosine * tangent + sine * bitangent, cosine * bitangent - sine * tangent, normal)
    }

    /// Sums the contributions of what each receiver sees of `directions` turned by its frame into `memory.sums`.
    fn sum(&self, directions: &Directions, receivers: &[(usize, Receiver)], frames: &[DMat3], memory: &mut Memory) {
        let integrals = directions.integrals();
        let Memory { rays, sums, piece } = memory;
        sums.clear();
        sums.resize(integrals * receivers.len(), [0.0; LANES]);
        for (start, packets) in (0..).step_by(PIECE).zip(directions.packets().chunks(PIECE)) {
            for (((_, receiver), frame), sums) in receivers.iter().zip(frames).zip(sums.chunks_exact_mut(integrals)) {
                piece.clear();
                piece.resize(integrals, [0.0; LANES]);
                let query = Query {
                    origin: receiver.position.as_vec3().to_array(),
                    frame: frame.to_cols_array_2d().map(|column| column.map(|x| x as f32)),
                    horizon: receiver.normal.filter(|_| directions.stand_still()).map(|n| n.as_vec3().to_array()),
                    excluded: receiver.excluded,
                };
                self.scene.cast(self.kernel, &query, packets, rays, |number, escaped| {
                    for (sum, parts) in piece.iter_mut().zip(directions.contributions(start + number)) {
                        (0..LANES).for_each(|lane| sum[lane] += escaped[lane] * parts[lane]);
                    }
                });
                for (sum, piece) in sums.iter_mut().zip(&*piece) {
                    (0..LANES).for_each(|lane| sum[lane] += f64::from(piece[lane]));
                }
            }
        }
    }

    /// Mean over the blocks and its standard error.
    fn estimate(&self, sums: &[f64; LANES]) -> (f64, f64) {
        let count = LANES as f64;
        let mean = sums.iter().sum::<f64>() / count;
        let squares: f64 = sums.iter().map(|sum| (sum - mean).powi(2)).sum();
        (mean / self.block, (squares / (count * (count - 1.0))).sqrt() / self.block)
    }

    fn put_visibility(&self, sums: &[[f64; LANES]], frame: DMat3, values: &mut [f64], errors: &mut [f64]) {
        let [visible, transferred] = [self.visibility, self.transfer].map(|order| order.map_or(0, Order::len));
        let (occlusion, rest) = sums.split_at(1);
        let (value, error) = self.estimate(&occlusion[0]);
        let put = |range: &std::ops::Range<usize>, out: &mut [f64], from: &[f64]| {
            out[range.clone()].iter_mut().zip(from).for_each(|(out, from)| *out = *from);
        };
        let Columns { ambient_occlusion, visibility_sh, transfer_sh, irradiance, vector_irradiance } = &self.columns;
        put(ambient_occlusion, values, &[value]);
        put(ambient_occlusion, errors, &[error]);
        let harmonics = [(self.visibility, &rest[..visible]), (self.transfer, &rest[visible..][..transferred])];
        let [visibility, transfer] = harmonics.map(|(order, sums)| self.harmonics(order, sums, frame));
        put(visibility_sh, values, &visibility.0);
        put(visibility_sh, errors, &visibility.1);
        put(transfer_sh, values, &transfer.0);
        put(transfer_sh, errors, &transfer.1);
        if let Light::Even(radiance) = self.light {
            put(irradiance, values, &(PI * value * radiance).to_array());
            put(irradiance, errors, &(PI * error * radiance).to_array());
            if let ([_, y, z, x, ..], [_, error, ..]) = (&visibility.0[..], &visibility.1[..]) {
                // Y_1 = sqrt(3 / 4 pi) (y, z, x).
                let scale = (4.0 * PI / 3.0).sqrt();
                let moment = scale * DVec3::new(*x, *y, *z);
                let vectors = radiance.to_array().map(|l| (l * moment).to_array());
                put(vector_irradiance, values, vectors.as_flattened());
                let spread = radiance.to_array().map(|l| [l * scale * error; 3]);
                put(vector_irradiance, errors, spread.as_flattened());
            }
        }
    }

    /// Coefficients in the world and their errors, which are the same for all of a band: so they do not depend on the frame.
    fn harmonics(&self, order: Option<Order>, sums: &[[f64; LANES]], frame: DMat3) -> (Vec<f64>, Vec<f64>) {
        let Some(order) = order else { return Default::default() };
        let (local, spread): (Vec<f64>, Vec<f64>) = sums.iter().map(|sums| self.estimate(sums)).unzip();
        let mut world = vec![0.0; order.len()];
        rotate(order, frame, &local, &mut world);
        let mut errors = spread;
        for band in 0..order.bands() {
            let band = &mut errors[band * band..][..2 * band + 1];
            let mean = (band.iter().map(|e| e * e).sum::<f64>() / band.len() as f64).sqrt();
            band.fill(mean);
        }
        (world, errors)
    }

    fn put_light(&self, sums: &[[f64; LANES]], normal: Option<DVec3>, values: &mut [f64], errors: &mut [f64]) {
        let Columns { irradiance, vector_irradiance, .. } = &self.columns;
        for (colour, axes) in sums.chunks_exact(3).enumerate() {
            if !irradiance.is_empty()
                && let Some(normal) = normal
            {
                let clamped =
                    std::array::from_fn(|lane| normal.dot(DVec3::from([0, 1, 2].map(|axis| axes[axis][lane]))));
                (values[irradiance.start + colour], errors[irradiance.start + colour]) = self.estimate(&clamped);
            }
            if !vector_irradiance.is_empty() {
                for (axis, sums) in axes.iter().enumerate() {
                    let place = vector_irradiance.start + 3 * colour + axis;
                    (values[place], errors[place]) = self.estimate(sums);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::reference::fixtures::{cuboid, polygon, random, sphere, union};
    use crate::reference::{EmbreeQuality, EmbreeVariant, Light as RayLight, PixelDistribution, Qmc, RayScene};
    use crate::scene::{Geometry, Sky};
    use crate::sphere::closed_forms;

    fn scene() -> Geometry {
        union(&[
            sphere(Vec3::new(0.1, 0.2, 1.3), 0.8, 24),
            cuboid(Vec3::new(0.6, -0.9, 0.2), Vec3::new(1.1, -0.4, 2.0)),
            sphere(Vec3::new(-1.2, 0.3, 0.5), 0.4, 16),
        ])
    }

    /// Receivers in the plane below the scene, with a few normals.
    fn places(count: usize) -> Vec<(DVec3, DVec3)> {
        let mut random = random(7);
        (0..count)
            .map(|k| {
                let place = random() * DVec3::new(1.5, 1.5, 0.0);
                (place, [DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, -0.8, 0.6)][k % 3])
            })
            .collect()
    }

    fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
        let (count, sum) = values.into_iter().fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x * x));
        (sum / f64::max(count, 1.0)).sqrt()
    }

    #[test]
    fn every_variant_agrees_with_the_judge_on_everything() {
        let (geometry, sky) = (scene(), Sky::default().environment().unwrap());
        let order = Order::new(4).unwrap();
        let radiance = |w| sky.radiance(w).as_dvec3().to_array();
        let bright = PixelDistribution::of(&sky).unwrap();
        let request = Request {
            ambient_occlusion: true,
            visibility_sh: Some(order),
            transfer_sh: Some(order),
            irradiance: true,
            vector_irradiance: true,
            light: Some(RayLight { radiance: &radiance, distribution: Some(&bright) }),
        };
        let places = places(24);
        let receiver = |&(position, normal)| Receiver { position, normal: Some(normal), excluded: &[] };
        let receivers: Vec<Receiver> = places.iter().map(receiver).collect();
        let judge = Qmc { samples: 1 << 14, seed: 3 };
        let judged = judge.integrate(&RayScene::new(&geometry), &receivers, &request).unwrap();
        let numbered: Vec<_> = receivers.iter().copied().enumerate().collect();
        let mut rows = Vec::new();
        for EmbreeVariant { kernel, quality } in EmbreeVariant::ALL {
            let embree = EmbreeScene::new(&geometry, quality, false).unwrap();
            let qmc = EmbreeQmc::new(&embree, kernel, &request, Some(&sky), false, 1 << 14, 5).unwrap();
            let len = judged.values.len();
            let (mut values, mut errors) = (vec![0.0; len], vec![0.0; len]);
            qmc.integrate(&numbered, &mut values, &mut errors, &mut Memory::default()).unwrap();
            for (k, value) in values.iter().enumerate() {
                let (truth, allowed) = (judged.values[k], 5.0 * (judged.errors[k] + errors[k]) + 1e-5);
                assert!((value - truth).abs() < allowed, "{kernel:?} {k}: {value} but {truth} +- {allowed}");
            }
            rows.push(values);
        }
        for other in &rows[1..] {
            // Only rays that graze an edge may differ.
            assert!(rms(rows[0].iter().zip(other).map(|(a, b)| a - b)) < 2e-3);
        }
    }

    /// True and estimated error of the occlusion under a rectangle, over many receivers.
    fn errors_under_a_rectangle(samples: u32) -> (f64, f64) {
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 1.0));
        let geometry = polygon(corners.to_vec());
        let corners = corners.map(|c| c.as_dvec3());
        let embree = EmbreeScene::new(&geometry, EmbreeQuality::Medium, false).unwrap();
        let request = Request { ambient_occlusion: true, ..Request::default() };
        let places: Vec<DVec3> =
            (0..512).map(|k| DVec3::new(0.06 * f64::from(k % 16), 0.04 * f64::from(k / 16), 0.2)).collect();
        let receivers: Vec<_> = places
            .iter()
            .map(|&position| Receiver { position, normal: Some(DVec3::Z), excluded: &[] })
            .enumerate()
            .collect();
        let (mut values, mut errors) = (vec![0.0; 512], vec![0.0; 512]);
        let qmc = EmbreeQmc::new(&embree, EmbreeKernel::Packets, &request, None, false, samples, 1).unwrap();
        qmc.integrate(&receivers, &mut values, &mut errors, &mut Memory::default()).unwrap();
        let exact = places.iter().map(|p| 1.0 - closed_forms::polygon_form_factor(&corners.map(|c| c - *p), DVec3::Z));
        (rms(values.iter().zip(exact).map(|(value, exact)| value - exact)), rms(errors))
    }

    #[test]
    fn the_error_falls_as_the_power_three_quarters_and_its_estimate_is_cautious() {
        let (coarse, coarse_estimate) = errors_under_a_rectangle(1 << 8);
        let (fine, fine_estimate) = errors_under_a_rectangle(1 << 14);
        let slope = (coarse / fine).log2() / 6.0;
        assert!((0.65..0.9).contains(&slope), "{slope}: {coarse} {fine}");
        for (error, estimate) in [(coarse, coarse_estimate), (fine, fine_estimate)] {
            // Up to 8^(1/4) and the set's own luck.
            assert!((1.0..2.2).contains(&(estimate / error)), "{estimate} {error}");
        }
    }

    #[test]
    fn probes_see_the_whole_sphere_and_faces_are_left_out_by_number() {
        let geometry = scene();
        let all: Vec<u32> = (0..geometry.triangles.len() as u32).collect();
        let order = Order::new(2).unwrap();
        let request = Request { visibility_sh: Some(order), ..Request::default() };
        let probe = Receiver { position: DVec3::new(0.0, 0.0, 0.1), normal: None, excluded: &all };
        let estimate = |filters, excluded| {
            let embree = EmbreeScene::new(&geometry, EmbreeQuality::Medium, filters).unwrap();
            let qmc = EmbreeQmc::new(&embree, EmbreeKernel::Streams, &request, None, true, 1 << 10, 1).unwrap();
            let (mut values, mut errors) = ([0.0; 4], [0.0; 4]);
            let receiver = Receiver { excluded, ..probe };
            qmc.integrate(&[(0, receiver)], &mut values, &mut errors, &mut Memory::default()).map(|()| values)
        };
        let whole = (4.0 * PI).sqrt();
        assert!((estimate(true, &all).unwrap()[0] - whole).abs() < 1e-5);
        assert!(estimate(true, &all[..1]).unwrap()[0] < 0.9 * whole);
        assert!(estimate(false, &all).unwrap_err().to_string().contains("without a filter"));
    }

    #[test]
    fn an_even_light_follows_from_visibility() {
        let geometry = scene();
        let light = Environment::constant(Vec3::new(1.0, 2.0, 4.0)).unwrap();
        let request =
            Request { ambient_occlusion: true, irradiance: true, vector_irradiance: true, ..Request::default() };
        let embree = EmbreeScene::new(&geometry, EmbreeQuality::High, false).unwrap();
        let qmc = EmbreeQmc::new(&embree, EmbreeKernel::Packets, &request, Some(&light), false, 1 << 10, 1).unwrap();
        let normal = DVec3::new(0.6, 0.0, 0.8);
        let receiver = Receiver { position: DVec3::new(0.3, 0.1, 0.0), normal: Some(normal), excluded: &[] };
        let (mut values, mut errors) = ([0.0; 13], [0.0; 13]);
        qmc.integrate(&[(9, receiver)], &mut values, &mut errors, &mut Memory::default()).unwrap();
        for colour in 0..3 {
            let irradiance = values[1 + colour];
            assert!((irradiance - PI * values[0] * f64::from(1u8 << colour)).abs() < 1e-12);
            let clamped = normal.dot(DVec3::from_slice(&values[4 + 3 * colour..][..3]));
            // Two estimates from the same rays, of which the second has its own rounding.
            assert!((clamped - irradiance).abs() < 1e-5 * irradiance, "{clamped} {irradiance}");
        }
    }

    #[test]
    fn nothing_is_open_sky() {
        let nothing = crate::reference::fixtures::geometry(Vec::new(), Vec::new());
        let embree = EmbreeScene::new(&nothing, EmbreeQuality::Medium, false).unwrap();
        let request = Request { ambient_occlusion: true, ..Request::default() };
        let qmc = EmbreeQmc::new(&embree, EmbreeKernel::Packets, &request, None, false, 8, 1).unwrap();
        let receiver = Receiver { position: DVec3::ZERO, normal: Some(DVec3::X), excluded: &[] };
        let (mut values, mut errors) = ([0.0], [0.0]);
        qmc.integrate(&[(0, receiver)], &mut values, &mut errors, &mut Memory::default()).unwrap();
        assert_eq!((values, errors), ([1.0], [0.0]));
    }
}
