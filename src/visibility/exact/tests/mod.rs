//! Closed forms, an independent twin, invariances and ties.

mod closed_forms;
mod degenerate;
mod gradients;
mod invariance;
pub(super) mod scenes;
mod sweeps;
mod twin;

use std::f64::consts::PI;

use glam::DVec3;

use super::{Residuals, Scratch, solve};
use crate::sphere::Order;
use scenes::{Triangle, contours, depth};

/// One band more than is on offer: what a product with a cosine takes.
fn order() -> Order {
    Order::MAX.raised()
}

/// What is compared: solid angle, cosine and SH of 11 bands.
#[derive(Clone, Debug, Default)]
struct Answer {
    solid_angle: f64,
    vector_area: DVec3,
    harmonics: Vec<f64>,
    residuals: Residuals,
}

impl Answer {
    fn distance(&self, other: &Answer) -> f64 {
        let harmonics = self.harmonics.iter().zip(&other.harmonics).map(|(a, b)| (a - b).abs());
        let scalar = (self.solid_angle - other.solid_angle).abs();
        let vector = (self.vector_area - other.vector_area).abs().max_element();
        assert!(!scalar.is_nan() && !vector.is_nan() && !self.harmonics.iter().any(|c| c.is_nan()));
        harmonics.fold(scalar.max(vector), f64::max)
    }
}

/// The exact answer for a receiver among triangles.
fn exact(triangles: &[Triangle], receiver: DVec3, normal: Option<DVec3>) -> Answer {
    let contours = contours(triangles, receiver, normal);
    let mut scratch = Scratch::default();
    let region = solve(&contours, normal, 0, |w| depth(triangles, receiver, w), &mut scratch);
    let mut harmonics = vec![0.0; order().len()];
    region.harmonics(order(), &mut harmonics);
    let residuals = *region.residuals();
    assert!(!residuals.alarm(), "{residuals:?}");
    Answer { solid_angle: region.solid_angle(), vector_area: region.vector_area(), harmonics, residuals }
}

/// The solid angle of the whole sphere.
const SPHERE: f64 = 4.0 * PI;
