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

/// Whether a triangle around an axis meets it ahead of the receiver or behind, given by its corners relative to the receiver, each as its
/// coordinates along the axis and across it, and by what its sign says of that.
///
/// Where its plane holds the receiver to rounding the sign is chance, but then the triangle is ahead or behind as a whole, unless the receiver
/// is inside: the sign says on which side of it.
pub(super) fn meets_ahead(corners: [[f64; 3]; 3], by_sign: bool) -> bool {
    let extent = |across: usize| corners.iter().map(|corner| corner[across].abs()).fold(0.0, f64::max);
    let across = if extent(1) < extent(2) { 2 } else { 1 };
    // Two of the sides pass the plane through the axis from which the corners are further.
    let [a, b, c] = corners;
    let sides = [(a, b), (b, c), (c, a)].into_iter().filter(|(a, b)| (a[across] < 0.0) != (b[across] < 0.0));
    let mut passages = sides.map(|(a, b)| a[0] * b[across].abs() + b[0] * a[across].abs());
    match (passages.next(), passages.next()) {
        (Some(one), Some(other)) if one > 0.0 && other > 0.0 => true,
        (Some(one), Some(other)) if one < 0.0 && other < 0.0 => false,
        _ => by_sign,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use dual_bvh::Tile;
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::scene::FaceTree;
    use crate::visibility::beams::Beams;
    use crate::visibility::{Isolines, Meridians};

    fn vector(reach: f32) -> impl Strategy<Value = Vec3> {
        prop_oneof![
            [-4..=4, -4..=4, -4..=4].prop_map(move |x| Vec3::from(x.map(|x| x as f32)) * (reach / 4.0)),
            [-reach..reach, -reach..reach, -reach..reach].prop_map(Vec3::from),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

        /// Receivers in a face's plane to rounding, and charts with an axis that points to the face, along which its sliver is seen.
        #[test]
        fn faces_seen_edge_on_cover_no_other_direction(
            [a, b, c] in [vector(4.0), vector(4.0), vector(4.0)],
            beyond in prop_oneof![Just(0.5), Just(1.0), 0.1..2.0_f64],
            aside in prop_oneof![Just(0.0), Just(0.5), -2.0..2.0_f64],
            [to_a, to_b, to_c] in [0.1..1.0_f64, 0.1..1.0, 0.1..1.0],
            is_negative: bool,
            turn in prop_oneof![Just(0.0), 0.0..6.3],
        ) {
            let corners: Arc<[Vec3]> = [a, b, c].into();
            let faces = FaceTree::new(corners, [[0, 1, 2]].into());
            let [a, b, c] = [a, b, c].map(|x| x.as_dvec3());
            let normal = (b - a).cross(c - a);
            prop_assume!(normal.length() > 0.1);
            let position = a - beyond * (b - a) + aside * (c - a);
            let inside = (to_a * a + to_b * b + to_c * c) / (to_a + to_b + to_c);
            let axis = (inside - position).normalize() * if is_negative { -1.0_f64 } else { 1.0 };
            let (u, v) = axis.any_orthonormal_pair();
            let (u, v) = (u * f64::cos(turn) + v * f64::sin(turn), v * f64::cos(turn) - u * f64::sin(turn));
            let tile = Tile::lone(position, None);
            let beams = &mut Beams::default();

            let isolines = Isolines::new(14).unwrap();
            let outlook = Outlook { chart: &isolines, axes: DMat3::from_cols(axis, u, v), position, normal: None };
            // The base line's point on the spine, between the axes x and z.
            let start = outlook.axes * DVec3::new(0.35, 0.0, 0.65);
            prop_assume!(start.dot(normal).abs() > 1e-3 * normal.length());
            let mut depth = 0;
            Isolines::count(outlook, Rays { faces: &faces, tile, beams }, &[], |_, covers| depth += covers);
            prop_assert_eq!(depth, 0);

            let meridians = Meridians::new(14).unwrap();
            let outlook = Outlook { chart: &meridians, axes: DMat3::from_cols(u, v, axis), position, normal: None };
            let mut depth = 0;
            Meridians::count(outlook, Rays { faces: &faces, tile, beams }, &[], |_, covers| depth += covers);
            if is_negative {
                prop_assert!(depth.abs() <= 1, "the start lies on the sliver");
            } else {
                prop_assert_eq!(depth, 0);
            }
        }
    }
}
