//! Integrals over the visible directions of a receiver by randomised quasi-Monte Carlo.

use std::{
    f64::consts::{FRAC_1_PI, TAU},
    ops::Range,
};

use glam::DVec3;
use rayon::prelude::*;
use sobol_burley::parts::hash;

use super::{PixelDistribution, RayScene, Sobol};
use crate::{
    Error, Result,
    sphere::{Order, evaluate},
};

/// How many rays are cast, and which.
///
/// The samples of a receiver are split over R independent randomisations of the Sobol sequence: R = [`Qmc::RANDOMISATIONS`],
/// more beyond [`Sobol::LENGTH`] points each. The value is the mean over the randomisations and its standard error the
/// spread of their means over sqrt(R); with few randomisations that estimate itself is uncertain (Student's t with R - 1
/// degrees of freedom). Where the visible region has edges the error falls like the -3/4th power of the samples, without the split
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

/// A point whose surroundings are integrated.
#[derive(Clone, Copy, Debug)]
pub struct Receiver<'a> {
    /// Where.
    pub position: DVec3,
    /// Unit normal of the hemisphere that is integrated; `None` for the whole sphere.
    pub normal: Option<DVec3>,
    /// Indices of the triangles that do not occlude: those the receiver lies on.
    pub excluded: &'a [u32],
}

/// Radiance that arrives from infinitely far away.
#[derive(Clone, Copy)]
pub struct Light<'a> {
    /// Radiance per colour from the unit direction.
    pub radiance: &'a (dyn Fn(DVec3) -> [f64; 3] + Sync),
    /// Where the light is bright. Samples drawn from it join the others by the balance heuristic (Veach and Guibas 1995).
    pub distribution: Option<&'a PixelDistribution>,
}

/// What is integrated over the hemisphere n.w > 0 (the whole sphere for a receiver without a normal n), V being 1 where the ray
/// escapes. Everything is estimated from the same rays.
#[derive(Clone, Copy, Default)]
pub struct Request<'a> {
    /// 1/pi integral of V max(0, n.w): one value.
    pub ambient_occlusion: bool,
    /// Integral of V y: `len()` values.
    pub visibility_sh: Option<Order>,
    /// 1/pi integral of V max(0, n.w) y: `len()` values.
    pub transfer_sh: Option<Order>,
    /// Integral of L V max(0, n.w): three colours. Needs a light.
    pub irradiance: bool,
    /// Integral of L V w: three colours of three axes each. Needs a light.
    pub vector_irradiance: bool,
    /// L.
    pub light: Option<Light<'a>>,
}

/// Where the quantities of a [`Request`] stand in a row of results; empty for what is not asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    /// One value.
    pub ambient_occlusion: Range<usize>,
    /// Coefficients.
    pub visibility_sh: Range<usize>,
    /// Coefficients.
    pub transfer_sh: Range<usize>,
    /// Colours.
    pub irradiance: Range<usize>,
    /// Colours of axes.
    pub vector_irradiance: Range<usize>,
}

impl Columns {
    /// Length of a row.
    pub fn len(&self) -> usize {
        self.vector_irradiance.end
    }

    /// Whether nothing is asked for.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Results of many receivers, row after row; see [`Request::columns`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimates {
    /// Values.
    pub values: Vec<f64>,
    /// The standard error of each value.
    pub errors: Vec<f64>,
}

impl Request<'_> {
    /// The layout of a row of results.
    pub fn columns(&self) -> Columns {
        let mut end = 0;
        let mut next = |len: usize| {
            end += len;
            end - len..end
        };
        Columns {
            ambient_occlusion: next(self.ambient_occlusion.into()),
            visibility_sh: next(self.visibility_sh.map_or(0, Order::len)),
            transfer_sh: next(self.transfer_sh.map_or(0, Order::len)),
            irradiance: next(if self.irradiance { 3 } else { 0 }),
            vector_irradiance: next(if self.vector_irradiance { 9 } else { 0 }),
        }
    }

    /// # Errors
    /// [`Error::Input`] if a lit quantity is asked for without a light.
    fn check(&self) -> Result<()> {
        if (self.irradiance || self.vector_irradiance) && self.light.is_none() {
            return Err(Error::input("irradiance needs a light: give an environment, or do not ask for irradiance"));
        }
        Ok(())
    }

    /// # Errors
    /// [`Error::Input`] if receiver number `index` is not finite or lacks a normal that the request needs.
    fn check_receiver(&self, index: usize, receiver: &Receiver) -> Result<()> {
        if !(receiver.position.is_finite() && receiver.normal.is_none_or(DVec3::is_finite)) {
            return Err(Error::input(format!("receiver {index}: position and normal must be finite")));
        }
        if receiver.normal.is_none() && (self.ambient_occlusion || self.transfer_sh.is_some() || self.irradiance) {
            return Err(Error::input(format!(
                "receiver {index} has no normal: only visibility and vector irradiance are defined over the whole sphere"
            )));
        }
        Ok(())
    }
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
    /// The least number of independent randomisations a receiver's samples are split over.
    pub const RANDOMISATIONS: u32 = 8;

    /// Randomisations, and points in each: powers of two.
    fn split(&self) -> (u32, u32) {
        let samples = u64::from(self.samples).next_power_of_two().max(Self::RANDOMISATIONS.into());
        let points = (samples / u64::from(Self::RANDOMISATIONS)).min(Sobol::LENGTH.into());
        ((samples / points) as u32, points as u32)
    }

    /// Directions cast per receiver: `samples` rounded up.
    pub fn rounded_samples(&self) -> u64 {
        let (randomisations, points) = self.split();
        u64::from(randomisations) * u64::from(points)
    }

    /// Estimates of all `receivers`, on all threads; the same bits for any number of them.
    ///
    /// # Errors
    /// [`Error::Input`] if a receiver is not finite or lacks a normal that the request needs, or if a light is missing.
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
        let (randomisations, points) = self.split();
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
