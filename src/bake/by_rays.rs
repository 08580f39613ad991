use super::integrate::{Baker, Counts};
use super::layout::Layout;
use super::{Prepared, Receivers, Request};
use crate::Result;
use crate::integrand;
use crate::reference::{self, Columns, Light, PixelDistribution, Qmc, RayScene};
use crate::scene::Environment;
use crate::sphere::Order;

/// Integration by quasi-Monte Carlo rays.
pub(super) struct ByRays<'a> {
    rays: &'a RayScene,
    qmc: Qmc,
    environment: Option<&'a Environment>,
    /// Where an uneven environment is bright.
    bright: Option<PixelDistribution>,
    request: &'a Request,
    order: Order,
    layout: &'a Layout,
}

/// Estimates and standard errors of one receiver.
#[derive(Default)]
pub(super) struct Memory {
    values: Vec<f64>,
    errors: Vec<f64>,
}

impl<'a> ByRays<'a> {
    pub(super) fn new(
        prepared: &'a Prepared,
        environment: Option<&'a Environment>,
        request: &'a Request,
        layout: &'a Layout,
        samples: u32,
        seed: u32,
    ) -> Result<Self> {
        let bright = match environment {
            Some(environment) if environment.uniform().is_none() => Some(PixelDistribution::of(environment)?),
            _ => None,
        };
        Ok(Self {
            rays: prepared.rays(),
            qmc: Qmc { samples, seed },
            environment,
            bright,
            request,
            order: Order::new(request.order)?,
            layout,
        })
    }
}

impl Baker for ByRays<'_> {
    type Memory = Memory;

    fn tile(&self, receivers: &Receivers, tile: &[u32], rows: &mut [f64], memory: &mut Memory) -> Result<Counts> {
        let radiance = self.environment.map(|environment| move |w| environment.radiance(w).as_dvec3().to_array());
        let request = reference::Request {
            light: radiance.as_ref().map(|radiance| Light { radiance, distribution: self.bright.as_ref() }),
            ..reference::Request::of(self.request, self.order)
        };
        let columns = request.columns();
        let Memory { values, errors } = memory;
        values.resize(columns.len(), 0.0);
        errors.resize(columns.len(), 0.0);
        for (&index, row) in tile.iter().zip(rows.chunks_exact_mut(self.layout.width)) {
            let receiver = receivers.get(index as usize);
            self.qmc.integrate_one(self.rays, receivers.number(index as usize), &receiver, &request, values, errors)?;
            put(self.layout, &columns, values, errors, row);
        }
        Ok(Counts::default())
    }
}

impl reference::Request<'_> {
    /// What rays have to estimate for a bake, without its light.
    pub(super) fn of(request: &Request, order: Order) -> Self {
        // The bent normal follows from two bands of visibility.
        let two = Order::new(2).expect("two bands are on offer");
        let bands = [request.visibility_sh.then_some(order), request.bent_normal.then_some(two)];
        Self {
            ambient_occlusion: request.ambient_occlusion,
            visibility_sh: bands.into_iter().flatten().max(),
            transfer_sh: request.transfer_sh.then_some(order),
            irradiance: request.irradiance,
            vector_irradiance: request.vector_irradiance,
            light: None,
        }
    }
}

/// Puts a receiver's estimates and standard errors into its row.
pub(super) fn put(layout: &Layout, columns: &Columns, values: &[f64], errors: &[f64], row: &mut [f64]) {
    for (name, range) in [
        ("ambient_occlusion", &columns.ambient_occlusion),
        ("visibility_sh", &columns.visibility_sh),
        ("transfer_sh", &columns.transfer_sh),
        ("irradiance", &columns.irradiance),
        ("vector_irradiance", &columns.vector_irradiance),
    ] {
        for (suffix, source) in [("", values), ("_error", errors)] {
            if let Some(out) = layout.slice(&format!("{name}{suffix}"), row) {
                out.copy_from_slice(&source[range.start..range.start + out.len()]);
            }
        }
    }
    if let Some(out) = layout.slice("bent_normal", row) {
        out.copy_from_slice(&integrand::bent_normal(&values[columns.visibility_sh.clone()]).to_array());
    }
}
