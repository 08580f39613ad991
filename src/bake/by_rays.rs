use super::integrate::{Baker, Counts};
use super::layout::Layout;
use super::{Receivers, Request};
use crate::Result;
use crate::integrand;
use crate::reference::{self, Light, PixelDistribution, Qmc, RayScene};
use crate::scene::{Environment, Geometry};
use crate::sphere::Order;

/// Integration by quasi-Monte Carlo rays.
pub(super) struct ByRays<'a> {
    rays: RayScene,
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
        geometry: &Geometry,
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
            rays: RayScene::new(geometry),
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
        // The bent normal follows from two bands of visibility.
        let bands =
            [self.request.visibility_sh.then_some(self.order), self.request.bent_normal.then_some(Order::new(2)?)];
        let request = reference::Request {
            ambient_occlusion: self.request.ambient_occlusion,
            visibility_sh: bands.into_iter().flatten().max(),
            transfer_sh: self.request.transfer_sh.then_some(self.order),
            irradiance: self.request.irradiance,
            vector_irradiance: self.request.vector_irradiance,
            light: radiance.as_ref().map(|radiance| Light { radiance, distribution: self.bright.as_ref() }),
        };
        let columns = request.columns();
        let parts = [
            ("ambient_occlusion", &columns.ambient_occlusion),
            ("visibility_sh", &columns.visibility_sh),
            ("transfer_sh", &columns.transfer_sh),
            ("irradiance", &columns.irradiance),
            ("vector_irradiance", &columns.vector_irradiance),
        ];
        let Memory { values, errors } = memory;
        values.resize(columns.len(), 0.0);
        errors.resize(columns.len(), 0.0);
        for (&index, row) in tile.iter().zip(rows.chunks_exact_mut(self.layout.width)) {
            let receiver = receivers.get(index as usize);
            self.qmc.integrate_one(&self.rays, index as usize, &receiver, &request, values, errors)?;
            for (name, range) in &parts {
                for (suffix, source) in [("", &*values), ("_error", &*errors)] {
                    if let Some(out) = self.layout.slice(&format!("{name}{suffix}"), row) {
                        out.copy_from_slice(&source[range.start..range.start + out.len()]);
                    }
                }
            }
            if let Some(out) = self.layout.slice("bent_normal", row) {
                out.copy_from_slice(&integrand::bent_normal(&values[columns.visibility_sh.clone()]).to_array());
            }
        }
        Ok(Counts::default())
    }
}
