use dual_bvh::{BuildOptions, DualBvh};
use glam::DVec3;

use super::integrate::{Baker, Counts};
use super::layout::Layout;
use super::{Receivers, Request};
use crate::Result;
use crate::integrand::{self, LightMoments, LightTable, LineHarmonics, LineMoments};
use crate::scene::{Environment, FaceTree, Geometry};
use crate::sphere::{self, Order};
use crate::visibility::{Frame, Isolines, Sight, View, Viewer};

/// Integration along octahedral u-isolines.
pub(super) struct AlongIsolines<'a> {
    edges: DualBvh,
    faces: FaceTree,
    isolines: Isolines,
    order: Order,
    harmonics: Option<LineHarmonics>,
    light: Option<Light>,
    layout: &'a Layout,
}

/// The environment as integrated.
enum Light {
    /// The same radiance everywhere: what follows from visibility alone.
    Even([f64; 3]),
    /// Anything else.
    Textured(LightTable),
}

/// Working memory of one thread.
#[derive(Default)]
pub(super) struct Memory {
    view: View,
    moments: Option<LineMoments>,
    visibility: Vec<f64>,
}

impl<'a> AlongIsolines<'a> {
    pub(super) fn new(
        geometry: &Geometry,
        environment: Option<&Environment>,
        request: &Request,
        layout: &'a Layout,
        lines: usize,
    ) -> Result<Self> {
        let isolines = Isolines::new(lines)?;
        let order = Order::new(request.order)?;
        let light = environment.map(|environment| match environment.uniform() {
            Some(radiance) => Light::Even(radiance.as_dvec3().to_array()),
            None => Light::Textured(LightTable::new(&isolines, environment)),
        });
        // The cosine is a harmonic of band 1, so that occlusion, the bent normal and light from everywhere follow from two
        // bands of visibility, and the transfer vector from one more than it has itself.
        let wanted = [
            (request.ambient_occlusion || request.bent_normal || matches!(light, Some(Light::Even(_))))
                .then_some(Order::new(2)?),
            request.visibility_sh.then_some(order),
            request.transfer_sh.then_some(order.raised()),
        ];
        let bands = wanted.into_iter().flatten().max();
        Ok(Self {
            edges: DualBvh::build(geometry.positions.clone(), geometry.triangles.clone(), &BuildOptions::default())?,
            faces: FaceTree::new(geometry.positions.clone(), geometry.triangles.clone()),
            order,
            harmonics: bands.map(|bands| LineHarmonics::new(bands, &isolines)),
            light,
            isolines,
            layout,
        })
    }

    /// Everything asked for at one receiver of the tile that `memory.view` approached.
    fn receiver(&self, receivers: &Receivers, index: usize, row: &mut [f64], memory: &mut Memory) -> Counts {
        let receiver = receivers.get(index);
        let axis = Frame::facing(receiver.normal).axis();
        let Memory { view, moments, visibility } = memory;
        let mut harmonics = self.harmonics.as_ref().map(|table| {
            let moments = moments.get_or_insert_with(|| LineMoments::new(table));
            (table, moments)
        });
        let mut light = match &self.light {
            Some(Light::Textured(table)) => Some((table, LightMoments::default())),
            _ => None,
        };
        let viewer = Viewer { edges: &self.edges, faces: &self.faces, isolines: &self.isolines };

        let sight = viewer.see(receiver, view, |interval| {
            if let Some((table, moments)) = &mut harmonics {
                moments.add(table, interval);
            }
            if let Some((table, moments)) = &mut light {
                moments.add(table, axis, interval);
            }
        });

        if let Some((table, moments)) = harmonics {
            visibility.clear();
            visibility.resize(table.order().len(), 0.0);
            match sight {
                Sight::Open => open_sky(table.order(), receiver.normal, visibility),
                Sight::Enclosed => {}
                Sight::Part(_) => moments.finish(table, axis, visibility),
            }
            self.fill_from_visibility(visibility, receiver.normal, row);
        }
        if let Some((table, mut moments)) = light {
            if sight == Sight::Open {
                viewer.see_all(receiver.normal, |interval| moments.add(table, axis, interval));
            }
            self.fill_from_light(moments.vectors(), receiver.normal, row);
        }
        Counts {
            contours: view.contours().arcs.len() as u64,
            depth_alarms: u64::from(matches!(sight, Sight::Part(sweep) if sweep.depth_alarms > 0)),
            open: u64::from(sight == Sight::Open),
            enclosed: u64::from(sight == Sight::Enclosed),
            shared_searches: 0,
        }
    }

    /// Fills in what follows from the harmonics of the visibility, clamped to the hemisphere.
    fn fill_from_visibility(&self, visibility: &[f64], normal: Option<DVec3>, row: &mut [f64]) {
        if let Some(out) = self.layout.slice("visibility_sh", row) {
            out.copy_from_slice(&visibility[..out.len()]);
        }
        if let Some(out) = self.layout.slice("bent_normal", row) {
            out.copy_from_slice(&integrand::bent_normal(visibility).to_array());
        }
        if let Some(Light::Even(radiance)) = &self.light {
            self.fill_from_light(
                integrand::even_vector_irradiance(integrand::visible_moment(visibility), *radiance),
                normal,
                row,
            );
        }
        let Some(normal) = normal else { return };
        if let Some(out) = self.layout.slice("ambient_occlusion", row) {
            out[0] = integrand::ambient_occlusion(visibility, normal);
        }
        if let Some(out) = self.layout.slice("transfer_sh", row) {
            integrand::transfer(self.order, visibility, normal, out);
        }
    }

    /// Fills in what follows from the vector irradiance of each colour.
    fn fill_from_light(&self, vectors: [DVec3; 3], normal: Option<DVec3>, row: &mut [f64]) {
        if let Some(out) = self.layout.slice("vector_irradiance", row) {
            out.copy_from_slice(vectors.map(|vector| vector.to_array()).as_flattened());
        }
        if let (Some(out), Some(normal)) = (self.layout.slice("irradiance", row), normal) {
            out.copy_from_slice(&vectors.map(|vector| vector.dot(normal)));
        }
    }
}

impl Baker for AlongIsolines<'_> {
    type Memory = Memory;

    fn tile(&self, receivers: &Receivers, tile: &[u32], rows: &mut [f64], memory: &mut Memory) -> Result<Counts> {
        let viewer = Viewer { edges: &self.edges, faces: &self.faces, isolines: &self.isolines };
        viewer.approach(tile.iter().map(|&index| receivers.get(index as usize)), &mut memory.view);
        let mut counts = Counts { shared_searches: tile.len() as u64 - 1, ..Counts::default() };
        for (&index, row) in tile.iter().zip(rows.chunks_exact_mut(self.layout.width)) {
            counts += self.receiver(receivers, index as usize, row, memory);
        }
        Ok(counts)
    }
}

/// Harmonics of a receiver that sees all of its hemisphere, or of a probe that sees the whole sphere.
fn open_sky(order: Order, normal: Option<DVec3>, out: &mut [f64]) {
    match normal {
        Some(normal) => out.copy_from_slice(&sphere::hemisphere(order, normal)),
        None => out[0] = (4.0 * std::f64::consts::PI).sqrt(),
    }
}
