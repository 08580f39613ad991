use glam::DVec3;

use super::Request;
use super::gradients::Gradients;
use super::layout::Layout;
use crate::Result;
use crate::integrand;
use crate::scene::Environment;
use crate::sphere::Order;

/// What a receiver sees, before it is turned into the arrays asked for.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    /// Harmonics of V, clamped to the hemisphere, of [`Assembly::bands`].
    pub(super) visibility: Vec<f64>,
    /// Estimated absolute error of each of them.
    pub(super) visibility_error: f64,
    /// Integral of L V w per colour, under textured light.
    pub(super) light: [DVec3; 3],
    /// Estimated absolute error of each of its components.
    pub(super) light_error: [DVec3; 3],
}

/// How what is asked for follows from what is seen.
pub(super) struct Assembly<'a> {
    order: Order,
    /// Bands of visibility from which everything asked for follows; none, if only textured light is.
    pub(super) bands: Option<Order>,
    /// Radiance of an environment that is the same everywhere: its light follows from visibility.
    even: Option<[f64; 3]>,
    /// Any other environment.
    pub(super) textured: Option<&'a Environment>,
    layout: &'a Layout,
}

/// Largest errors of what are linear combinations of harmonics of visibility, per error of a harmonic.
const FACTORS: [(&str, &str, f64); 3] = [
    ("ambient_occlusion_error", "ambient_occlusion_gradient_error", 0.65),
    ("visibility_sh_error", "visibility_sh_gradient_error", 1.0),
    ("transfer_sh_error", "transfer_sh_gradient_error", 0.32),
];

impl<'a> Assembly<'a> {
    pub(super) fn new(environment: Option<&'a Environment>, request: &Request, layout: &'a Layout) -> Result<Self> {
        let order = Order::new(request.order)?;
        let even = environment.and_then(Environment::uniform).map(|radiance| radiance.as_dvec3().to_array());
        // The cosine is a harmonic of band 1, so that occlusion, the bent normal and light from everywhere follow from two
        // bands of visibility, and the transfer vector from one more than it has itself.
        let wanted = [
            (request.ambient_occlusion || request.bent_normal || even.is_some()).then_some(Order::new(2)?),
            request.visibility_sh.then_some(order),
            request.transfer_sh.then_some(order.raised()),
        ];
        let textured = environment.filter(|_| even.is_none());
        Ok(Self { order, bands: wanted.into_iter().flatten().max(), even, textured, layout })
    }

    /// Fills the gradients of a receiver's row: what is linear in visibility is so in its derivatives.
    pub(super) fn fill_gradients(&self, gradients: &Gradients, normal: Option<DVec3>, row: &mut [f64]) {
        let mut transfer = vec![0.0; self.order.len()];
        for (axis, derivative) in gradients.by_axis.iter().enumerate() {
            let mut put = |name: &str, values: &[f64]| {
                if let Some(out) = self.layout.slice(name, row) {
                    out.iter_mut().skip(axis).step_by(3).zip(values).for_each(|(out, value)| *out = *value);
                }
            };
            put("visibility_sh_gradient", derivative);
            let Some(normal) = normal else { continue };
            if self.layout.has("ambient_occlusion_gradient") {
                put("ambient_occlusion_gradient", &[integrand::ambient_occlusion(derivative, normal)]);
            }
            if self.layout.has("transfer_sh_gradient") {
                integrand::transfer(self.order, derivative, normal, &mut transfer);
                put("transfer_sh_gradient", &transfer);
            }
        }
        for (_, name, factor) in FACTORS {
            if let Some(out) = self.layout.slice(name, row) {
                out.fill(gradients.error * factor);
            }
        }
    }

    /// Fills a receiver's row.
    pub(super) fn fill(&self, seen: &Seen, normal: Option<DVec3>, row: &mut [f64]) {
        let Seen { visibility, visibility_error, light, light_error } = seen;
        if let Some(out) = self.layout.slice("visibility_sh", row) {
            out.copy_from_slice(&visibility[..out.len()]);
        }
        if let Some(out) = self.layout.slice("bent_normal", row) {
            out.copy_from_slice(&integrand::bent_normal(visibility).to_array());
        }
        if let (Some(out), Some(normal)) = (self.layout.slice("ambient_occlusion", row), normal) {
            out[0] = integrand::ambient_occlusion(visibility, normal);
        }
        if let (Some(out), Some(normal)) = (self.layout.slice("transfer_sh", row), normal) {
            integrand::transfer(self.order, visibility, normal, out);
        }
        let (vectors, vector_errors) = match self.even {
            Some(radiance) => {
                let moment = integrand::visible_moment(visibility);
                let brightest = radiance.into_iter().fold(0.0, f64::max);
                // Band 1 holds the moment times sqrt(3 / 4 pi).
                let error = DVec3::splat(brightest * visibility_error * 2.05);
                (integrand::even_vector_irradiance(moment, radiance), [error; 3])
            }
            None => (*light, *light_error),
        };
        if let Some(out) = self.layout.slice("vector_irradiance", row) {
            out.copy_from_slice(vectors.map(|vector| vector.to_array()).as_flattened());
        }
        if let Some(out) = self.layout.slice("vector_irradiance_error", row) {
            out.copy_from_slice(vector_errors.map(|error| error.to_array()).as_flattened());
        }
        if let (Some(out), Some(normal)) = (self.layout.slice("irradiance", row), normal) {
            out.copy_from_slice(&vectors.map(|vector| vector.dot(normal)));
        }
        if let (Some(out), Some(normal)) = (self.layout.slice("irradiance_error", row), normal) {
            out.copy_from_slice(&vector_errors.map(|error| error.dot(normal.abs())));
        }
        for (name, _, factor) in FACTORS {
            if let Some(out) = self.layout.slice(name, row) {
                out.fill(visibility_error * factor);
            }
        }
    }
}
