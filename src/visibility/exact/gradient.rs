//! How the visible region changes as the receiver moves.
//!
//! While the receiver p moves by dp, its normal and horizon kept, a boundary point w whose ray meets its contour's edge at
//! distance t moves by dw = -(I - w w^T) dp / t. With N the unit normal of the arc, which points into the region,
//!
//! ```text
//! d/dp integral_R f(w) dw = sum over the contours' arcs of N integral f(w) / t(w) ds      (Reynolds' transport theorem)
//! ```
//!
//! and nothing from the horizon's. The edge from a to b, relative to p, has 1/t = m.w with m.a = m.b = 1 and m in their
//! plane: m = d x (a x d) / |a x d|^2, d = b - a. So each integral is that of f times a linear function along an arc.
//! For the solid angle, f = 1, it is the law of Biot and Savart.
//!
//! Gradients jump where the receiver passes through the plane of a face, or where two edges at different distances lie
//! on one circle: there one of the one-sided derivatives is given.

use std::f64::consts::PI;

use glam::DVec3;

use super::edges::NIL;
use super::region::Region;
use crate::sphere::{BoundaryArc, Order, cosine_along, harmonics_along};
use crate::visibility::ReceiverContours;

impl Region {
    /// Gradient of [`harmonics`](Self::harmonics) by the receiver's position, `order.len()` vectors, per unit of length
    /// of the scene; the normal is kept. `contours` are those that the region was solved from.
    ///
    /// # Panics
    /// If `out` has another length.
    pub fn harmonics_gradient(&self, contours: &ReceiverContours, order: Order, out: &mut [DVec3]) {
        assert_eq!(out.len(), order.len());
        out.fill(DVec3::ZERO);
        let mut along = vec![0.0; order.len()];
        for (arc, m) in self.moving(contours) {
            harmonics_along(order, arc, m, &mut along);
            out.iter_mut().zip(&along).for_each(|(sum, &integral)| *sum += integral * arc.normal);
        }
    }

    /// Gradient of [`cosine`](Self::cosine), the ambient occlusion (accessibility), by the receiver's position, per unit of
    /// length of the scene; the normal, a unit vector, is kept. `contours` are those that the region was solved from.
    pub fn cosine_gradient(&self, contours: &ReceiverContours, normal: DVec3) -> DVec3 {
        let moving = self.moving(contours);
        moving.map(|(arc, m)| cosine_along(arc, normal, m) * arc.normal).sum::<DVec3>() / PI
    }

    /// Integral of one over the distance of the edge along the boundary's arcs on contours, and the largest 1 / distance: what
    /// bounds every gradient and its rounding.
    pub fn moving_length(&self, contours: &ReceiverContours) -> (f64, f64) {
        self.moving(contours).fold((0.0, 0.0), |(length, most), (arc, m)| {
            let steepest = m.length();
            (length + steepest * arc.angle(), f64::max(most, steepest))
        })
    }

    /// The boundary arcs that lie on contours, with m.
    fn moving<'a>(&'a self, contours: &'a ReceiverContours) -> impl Iterator<Item = (&'a BoundaryArc, DVec3)> {
        let arcs = self.boundary.iter().zip(&self.sources).filter(|&(_, &source)| source != NIL);
        arcs.map(|(arc, &source)| {
            let edge = contours.arcs[source as usize];
            let (a, b) = (contours.directions[edge.a as usize], contours.directions[edge.b as usize]);
            (arc, inverse_distance(a, b))
        })
    }
}

/// m, whose product with a unit vector in the plane of the edge from `a` to `b` is one over the edge's distance there.
fn inverse_distance(a: DVec3, b: DVec3) -> DVec3 {
    let d = b - a;
    // The same d twice: m.a = 1 whatever has been rounded in it.
    let plane = a.cross(d);
    d.cross(plane) / plane.length_squared()
}
