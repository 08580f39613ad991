//! Closed forms of whole answers.

use std::f64::consts::PI;

use glam::DVec3;

use super::judge::{ORDER, order};
use crate::bake::Receivers;
use crate::sphere::closed_forms::{polygon_form_factor, polygon_harmonics};
use crate::sphere::hemisphere;

/// All receivers see everything.
pub(super) fn open(receivers: &Receivers) -> Vec<Vec<f64>> {
    rows(receivers, &[])
}

/// All receivers see nothing.
pub(super) fn enclosed(receivers: &Receivers) -> Vec<Vec<f64>> {
    vec![vec![0.0; ORDER * ORDER + usize::from(!receivers.normals.is_empty())]; receivers.len()]
}

/// The receivers see whatever convex planar polygons, of which no two overlap for any of them, leave over.
pub(super) fn rows(receivers: &Receivers, polygons: &[&[DVec3]]) -> Vec<Vec<f64>> {
    let row = |index| {
        let receiver = receivers.get(index);
        let mut row = receiver.normal.map_or_else(
            || {
                let mut all = vec![0.0; ORDER * ORDER];
                all[0] = (4.0 * PI).sqrt();
                all
            },
            |n| hemisphere(order(), n),
        );
        let mut occlusion = 1.0;
        for polygon in polygons {
            let corners: Vec<DVec3> = polygon.iter().map(|&corner| corner - receiver.position).collect();
            let hidden = polygon_harmonics(order(), &corners, receiver.normal);
            row.iter_mut().zip(hidden).for_each(|(value, hidden)| *value -= hidden);
            occlusion -= receiver.normal.map_or(0.0, |n| polygon_form_factor(&corners, n));
        }
        row.extend(receiver.normal.map(|_| occlusion));
        row
    };
    (0..receivers.len()).map(row).collect()
}
