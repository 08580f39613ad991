use std::sync::OnceLock;

use super::by_rays::put;
use super::integrate::{Baker, Counts};
use super::layout::Layout;
use super::{Prepared, Receivers, Request};
use crate::Result;
use crate::reference::{self, EmbreeMemory, EmbreeQmc, EmbreeQuality, EmbreeScene, EmbreeVariant};
use crate::scene::{Environment, Geometry};
use crate::sphere::Order;

/// Embree's trees of one scene: by build quality, without and with a filter.
#[derive(Default)]
pub(super) struct EmbreeScenes([[OnceLock<EmbreeScene>; 2]; 2]);

impl EmbreeScenes {
    /// The tree for these receivers.
    pub(super) fn get(
        &self,
        geometry: &Geometry,
        quality: EmbreeQuality,
        receivers: &Receivers,
    ) -> Result<&EmbreeScene> {
        let filters = (0..receivers.len()).any(|index| !receivers.get(index).excluded.is_empty());
        let slot = &self.0[usize::from(quality == EmbreeQuality::High)][usize::from(filters)];
        if slot.get().is_none() {
            // Whoever comes second finds the same built.
            let _ = slot.set(EmbreeScene::new(geometry, quality, filters)?);
        }
        let Some(scene) = slot.get() else { unreachable!("it has just been set") };
        Ok(scene)
    }
}

/// Integration by quasi-Monte Carlo rays on Embree.
pub(super) struct ByEmbree<'a> {
    qmc: EmbreeQmc<'a>,
    layout: &'a Layout,
}

/// Working memory of one thread.
#[derive(Default)]
pub(super) struct Memory {
    values: Vec<f64>,
    errors: Vec<f64>,
    qmc: EmbreeMemory,
}

impl<'a> ByEmbree<'a> {
    #[expect(clippy::too_many_arguments, reason = "all that a run depends on")]
    pub(super) fn new(
        prepared: &'a Prepared,
        environment: Option<&Environment>,
        request: &Request,
        layout: &'a Layout,
        receivers: &Receivers,
        samples: u32,
        seed: u32,
        variant: EmbreeVariant,
    ) -> Result<Self> {
        let EmbreeVariant { kernel, quality } = variant;
        let scene = prepared.embree().get(prepared.geometry(), quality, receivers)?;
        let order = Order::new(request.order)?;
        let request = reference::Request::of(request, order);
        let probes = receivers.normals.is_empty();
        Ok(Self { qmc: EmbreeQmc::new(scene, kernel, &request, environment, probes, samples, seed)?, layout })
    }
}

impl Baker for ByEmbree<'_> {
    type Memory = Memory;

    fn tile(&self, receivers: &Receivers, tile: &[u32], rows: &mut [f64], memory: &mut Memory) -> Result<Counts> {
        let Memory { values, errors, qmc } = memory;
        let columns = self.qmc.columns();
        values.resize(columns.len() * tile.len(), 0.0);
        errors.resize(columns.len() * tile.len(), 0.0);
        let numbered: Vec<_> =
            tile.iter().map(|&i| (receivers.number(i as usize), receivers.get(i as usize))).collect();
        self.qmc.integrate(&numbered, values, errors, qmc)?;
        let estimates = values.chunks_exact(columns.len()).zip(errors.chunks_exact(columns.len()));
        for ((values, errors), row) in estimates.zip(rows.chunks_exact_mut(self.layout.width)) {
            put(self.layout, columns, values, errors, row);
        }
        Ok(Counts::default())
    }
}
