use glam::DVec3;

use crate::sphere::Order;
use crate::visibility::{Receiver, Skips, View, Viewer};

/// Derivatives of the harmonics of V by the receiver's position.
#[derive(Clone, Debug, Default)]
pub(super) struct Gradients {
    /// By axis, then coefficient.
    pub(super) by_axis: [Vec<f64>; 3],
    /// Estimated absolute error of each of them.
    pub(super) error: f64,
    coefficients: Vec<DVec3>,
}

/// Relative rounding of a sum over the arcs of one boundary, with a digit to spare.
const ROUNDING: f64 = 1e-13;

impl Gradients {
    /// Takes those of the region that `view` has just solved; `missed` bounds the displacement of its boundary in radians.
    pub(super) fn take(&mut self, bands: Order, view: &View, missed: f64) {
        self.coefficients.resize(bands.len(), DVec3::ZERO);
        view.region().harmonics_gradient(view.contours(), bands, &mut self.coefficients);
        for (axis, row) in self.by_axis.iter_mut().enumerate() {
            row.clear();
            row.extend(self.coefficients.iter().map(|gradient| gradient[axis]));
        }
        // Every term is a harmonic over the distance of an edge, at most sqrt((2l + 1) / 4 pi) over the nearest distance.
        let steepest = (2.0 * bands.bands() as f64).sqrt() * 0.3;
        let (length, nearest) = view.region().moving_length(view.contours());
        self.error = steepest * (ROUNDING * length + missed * bands.bands() as f64 * nearest);
    }

    /// Central differences of the exact harmonics around a receiver at which the exact method itself fails, extrapolated from
    /// two steps. Where those fail, too, the gradient is zero and its error estimate the steepest slope a step can show.
    pub(super) fn take_differences(
        &mut self,
        bands: Order,
        viewer: Viewer,
        receiver: Receiver,
        step: f64,
        skips: Skips,
        view: &mut View,
    ) {
        let [coarse, fine] = [step, 0.5 * step].map(|step| {
            DVec3::AXES.map(|axis| {
                let ends = [step, -step].map(|by| {
                    harmonics_at(
                        bands,
                        viewer,
                        Receiver { position: receiver.position + by * axis, ..receiver },
                        skips,
                        view,
                    )
                });
                let [Some(ahead), Some(behind)] = ends else { return None };
                Some(ahead.iter().zip(&behind).map(|(a, b)| (a - b) / (2.0 * step)).collect::<Vec<f64>>())
            })
        });
        self.error = 0.0;
        for ((row, coarse), fine) in self.by_axis.iter_mut().zip(coarse).zip(fine) {
            row.clear();
            match (coarse, fine) {
                (Some(coarse), Some(fine)) => {
                    row.extend(coarse.iter().zip(&fine).map(|(coarse, fine)| fine + (fine - coarse) / 3.0));
                    let change = coarse.iter().zip(&fine).map(|(coarse, fine)| (fine - coarse).abs());
                    self.error = change.fold(self.error, f64::max);
                }
                _ => {
                    row.resize(bands.len(), 0.0);
                    // No coefficient exceeds the square root of 4 pi on either side.
                    self.error = self.error.max((4.0 * std::f64::consts::PI).sqrt() / step);
                }
            }
        }
    }
}

/// Harmonics of V by the exact method, in one of two frames; none if both raise an alarm.
fn harmonics_at(bands: Order, viewer: Viewer, receiver: Receiver, skips: Skips, view: &mut View) -> Option<Vec<f64>> {
    viewer.approach(std::iter::once(receiver), view);
    (0..2).find_map(|frame| {
        let region = viewer.solve(frame, receiver, skips, view);
        let mut harmonics = vec![0.0; bands.len()];
        region.harmonics(bands, &mut harmonics);
        (!region.residuals().alarm() && harmonics.iter().all(|h| h.is_finite())).then_some(harmonics)
    })
}
