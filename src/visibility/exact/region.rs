//! The visible region as its boundary.

use std::f64::consts::PI;

use glam::DVec3;

use super::boundary::Piece;
use crate::sphere::{BoundaryArc, Order, region_harmonics, vector_area};

/// The directions in which nothing is hit (W = 0), within the hemisphere of the normal or on the full sphere.
#[derive(Clone, Debug, Default)]
pub struct Region {
    /// What the boundary is made of, when all of it has been found.
    pub(super) pieces: Vec<Piece>,
    pub(super) boundary: Vec<BoundaryArc>,
    /// The contour that each boundary arc lies on, an index into the contours' arcs; NIL for the horizon.
    pub(super) sources: Vec<u32>,
    pub(super) solid_angle: f64,
    pub(super) residuals: Residuals,
    /// A direction away from all contours, and whether the region holds it.
    pub(super) known: (DVec3, bool),
}

impl Region {
    /// The boundary: great-circle arcs in world coordinates with the visible side on the left, in no particular order.
    pub fn boundary(&self) -> &[BoundaryArc] {
        &self.boundary
    }

    /// A direction away from all contours, and whether the region holds it.
    pub(in crate::visibility) fn known(&self) -> (DVec3, bool) {
        self.known
    }

    /// Solid angle in steradians.
    pub fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    /// SH coefficients of the region's indicator, `order.len()` of them.
    ///
    /// # Panics
    /// If `out` has another length.
    pub fn harmonics(&self, order: Order, out: &mut [f64]) {
        region_harmonics(order, &self.boundary, self.solid_angle, out);
    }

    /// Integral of w over the region: its dot product with the normal is pi times the ambient occlusion (accessibility).
    pub fn vector_area(&self) -> DVec3 {
        vector_area(&self.boundary)
    }

    /// Ambient occlusion (accessibility), 1 = open: (1/pi) integral of max(0, n.w) over a region within the hemisphere of
    /// `normal`, a unit vector.
    pub fn cosine(&self, normal: DVec3) -> f64 {
        self.vector_area().dot(normal) / PI
    }

    /// What a certificate of this result starts from.
    pub fn residuals(&self) -> &Residuals {
        &self.residuals
    }
}

/// Identities that hold without error in exact arithmetic, and counts of what happened on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residuals {
    /// Length of the sum of (end - start) over the boundary: 0 for closed loops.
    pub closure: f64,
    /// Largest distance in radians between a boundary arc's end and the circle of the arc: the price of ordering edges
    /// that rounding cannot tell apart.
    pub gap: f64,
    /// Solid angle of {W < 0}: 0, or a sliver within rounding where edges coincide.
    pub negative: f64,
    /// Vertices above the horizon whose jumps do not cancel, and directions that are zero or not finite: bad input.
    pub unbalanced: u32,
    /// W in a second direction, counted less carried along by the sweep: 0 if counts and contours agree.
    pub depth_mismatch: i32,
    /// Exchanges of two edges in the sweep, visible or not.
    pub crossings: u32,
    /// Exchanges that topology asked for and rounding had not seen.
    pub forced: u32,
    /// Frames tried before this one because an edge met the pole.
    pub retries: u32,
    /// An edge still met the pole in the last frame.
    pub pole_met: bool,
}

impl Residuals {
    /// Whether an identity is off by more than rounding explains: the result must not be trusted.
    pub fn alarm(&self) -> bool {
        /// Rounding errors of 1e5 arcs, each a few 1e-16, with three digits to spare.
        const ROUNDING: f64 = 1e-8;
        let worst = self.closure.max(self.gap).max(self.negative.abs());
        self.unbalanced > 0 || self.depth_mismatch != 0 || self.pole_met || worst.is_nan() || worst > ROUNDING
    }
}
