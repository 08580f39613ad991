use std::ops::Range;

use glam::{DMat3, DVec3, Vec3};

use super::beams::Rays;
use super::crossings::{Arcs, Pieces};

/// A chart of the sphere with isolines that start well above the horizon and are followed down to it.
///
/// A position on an isoline is a number that rises along it. In any chart the isolines that pass between two directions are known
/// from the *places* of these alone, integers; crossings with a great circle are cheap; and what lies between two positions is a
/// sector of one plane through the receiver, or a few.
pub(super) trait Chart: Sized {
    /// A great circle where it crosses isolines.
    type Piece: Copy + Default;

    /// Position where all isolines start.
    const START: f64;
    /// Position where they end if no horizon ends them before.
    const END: f64;

    /// Number of isolines that are followed.
    fn lines(&self) -> usize;

    /// The place of a direction of the chart, of any length, below 2^30: equal for directions between which no isoline passes.
    ///
    /// This integer *is* a vertex's position between the isolines for everything that follows: all arcs that share the vertex
    /// use the same one, so that the jumps along every isoline add up whatever the rounding.
    fn place(&self, w: DVec3) -> i32;

    /// The isolines, by number, that an arc between these places may cross: all before the second that are not before the first; a
    /// number of lines more than there are stands for a line after a whole turn.
    fn reach(&self, a: i32, b: i32) -> Range<usize>;

    /// Cuts arcs into pieces.
    fn cut(&self, arcs: &Arcs, out: &mut Pieces<Self::Piece>);

    /// The isolines that a piece crosses, in at most two runs.
    fn runs(&self, piece: &Self::Piece) -> [Range<usize>; 2];

    /// Where a piece crosses the isolines of one of its runs, and the change of W there.
    fn cross(&self, piece: &Self::Piece, run: Range<usize>) -> (impl Iterator<Item = f64>, i32);

    /// W at the start of every isoline less W where it was counted, from the changes that [`Chart::cut`] noted.
    fn bases(outlook: Outlook<Self>, changes: &[i32], out: &mut Vec<i32>);

    /// Calls `covers` with the faces that cover the place where W is counted, and how often each does, found by a ray that looks
    /// at every face once: their sum is the depth complexity W there.
    ///
    /// Whether a face does is decided with the very predicates and signs that the contours use. So the counts belong to the same
    /// (symbolically perturbed) picture as the jumps, and stay consistent with them when the ray meets vertices or edges, or the
    /// receiver lies in a face's plane.
    fn count(outlook: Outlook<Self>, rays: Rays, excluded: &[u32], covers: impl FnMut(u32, i32));

    /// Positions where the isolines meet the horizon, or end.
    fn horizons(outlook: Outlook<Self>, out: &mut Vec<f64>);

    /// Whether two positions on one isoline are further apart than ties are: crossings within an angle of 1e-9 of each other may have
    /// been sorted by their rounding errors, and W between them may be wrong by one or the other surface. Nothing is seen there,
    /// nor is it an alarm if W is negative. A wrong base or a lost edge shows over whole spans.
    fn are_apart(from: f64, to: f64) -> bool;

    /// An isoline, not after this one, that ends in the same direction, if neither meets the horizon: W must be the same there.
    fn partner(&self, line: usize) -> Option<usize>;

    /// Calls `put` with the sectors of planes between two positions on an isoline.
    fn sectors(&self, line: usize, from: f64, to: f64, put: impl FnMut(Sector));
}

/// A part of a plane through the receiver, in the axes of the chart: the directions `out + t along` with t between two tangents. The
/// vectors are of unit length and perpendicular.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sector {
    pub(super) out: Vec3,
    pub(super) along: Vec3,
    pub(super) tangents: [f32; 2],
}

/// Where a receiver looks from, and how.
pub(super) struct Outlook<'a, C> {
    pub(super) chart: &'a C,
    /// The rotation from the chart's axes to the world's.
    pub(super) axes: DMat3,
    pub(super) position: DVec3,
    pub(super) normal: Option<DVec3>,
}

impl<C> Clone for Outlook<'_, C> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<C> Copy for Outlook<'_, C> {}

impl<C> Outlook<'_, C> {
    /// World to chart.
    #[inline(always)]
    pub(super) fn apply(&self, w: DVec3) -> DVec3 {
        DVec3::new(self.axes.x_axis.dot(w), self.axes.y_axis.dot(w), self.axes.z_axis.dot(w))
    }
}

/// Whether a triangle, given by its corners relative to the receiver, lies on one side of one of two planes through the receiver with these
/// normals, whatever the rounding: then it does not cover the direction that the planes have in common.
#[inline(always)]
pub(super) fn is_beside([a, b, c]: [DVec3; 3], normals: [DVec3; 2]) -> bool {
    const MARGIN: f64 = 1e-6;
    let margin = MARGIN * a.abs().max(b.abs()).max(c.abs()).element_sum();
    normals.into_iter().any(|normal| {
        let (a, b, c) = (normal.dot(a), normal.dot(b), normal.dot(c));
        (a.min(b).min(c) > margin) | (a.max(b).max(c) < -margin)
    })
}
