use std::ops::Range;

use dual_bvh::{Candidates, Contours, DualBvh};
use glam::Vec3;
use smallvec::SmallVec;

use super::beams::{Beams, Rays};
use super::chart::{Chart, Outlook};
use super::crossings::{Counts, Crossings};
use super::front::{Front, distance_squared, is_sunken};
use super::gaps::Gaps;
use super::searches::{Searches, Wanted};
use super::spans::Spans;
use super::sweep::sweep;
use super::{Sight, Skips, Sweep};
use crate::scene::FaceTree;

/// Working memory for tracing receivers along the isolines of one chart.
#[derive(Default)]
pub(super) struct Tracer<P> {
    crossings: Crossings<P>,
    gaps: Gaps,
    /// Where the isolines meet the horizon.
    horizons: Vec<f64>,
    /// W where they end.
    finals: Vec<i32>,
    front: Front,
    counts: Counts,
    /// The groups that were put before the isolines, in this order.
    entered: Vec<u32>,
    /// For each group the last receiver that it was put before, or hidden from.
    done: Vec<u32>,
    receiver: u32,
    /// Boxes to look at, by level and number, the next one last.
    stack: Vec<(usize, u32)>,
    /// What looking for hidden groups may still cost before it must have saved something.
    pub(super) credit: i64,
    pub(super) has_credit: bool,
}

/// Leaving out a group saves work that grows with its contours, which grow like the root of the number of its edges. In units of
/// a test of eight sectors against a box, a few nanoseconds.
const SAVED: f64 = 4.0;
/// What every isoline adds to the work of a receiver.
const LINE: f64 = 8.0;
/// Share of a tile's work that may be risked.
const RISK: f64 = 1.0 / 40.0;
/// What a test costs beside its sectors.
const TEST: usize = 4;
/// What it costs to put a group before an isoline after another one, instead of both at once.
const CUT: usize = 3;

/// What a receiver is looked at with.
pub(super) struct Look<'a, C> {
    pub(super) faces: &'a FaceTree,
    pub(super) outlook: Outlook<'a, C>,
    pub(super) wanted: Wanted<'a>,
    pub(super) skips: Skips,
}

impl<C> Clone for Look<'_, C> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<C> Copy for Look<'_, C> {}

impl<C> Look<'_, C> {
    /// Whether a box lies below the horizon, and is not to be looked at then.
    fn is_sunken(&self, box_: [Vec3; 2]) -> bool {
        let Outlook { position, normal, .. } = self.outlook;
        self.skips.below_horizon && normal.is_some_and(|normal| is_sunken(position, normal, box_))
    }
}

/// Where faces and contours come from and go to.
pub(super) struct Found<'a> {
    pub(super) beams: &'a mut Beams,
    pub(super) searches: &'a mut Searches,
    pub(super) candidates: &'a mut Candidates,
    pub(super) contours: &'a mut Contours,
}

/// The depth complexity where W is counted, by group.
fn depths<C: Chart>(look: Look<C>, found: &mut Found) -> SmallVec<[(u32, i32); 8]> {
    let mut depths = SmallVec::<[(u32, i32); 8]>::new();
    let rays = Rays { faces: look.faces, tile: look.wanted.tile, beams: found.beams };
    C::count(look.outlook, rays, look.wanted.excluded, |face, covers| {
        let group = look.wanted.edges.group_of(face);
        match depths.iter_mut().find(|(of, _)| *of == group) {
            Some((_, depth)) => *depth += covers,
            None => depths.push((group, covers)),
        }
    });
    depths
}

impl<P: Copy> Tracer<P> {
    /// Begins with another tile.
    pub(super) fn begin(&mut self) {
        self.has_credit = false;
    }

    pub(super) fn counts(&self) -> Counts {
        self.counts
    }

    /// What a receiver sees, and where; candidates are searched where they are needed.
    pub(super) fn trace<C: Chart<Piece = P>>(&mut self, look: Look<C>, found: &mut Found, spans: &mut Spans) -> Sight {
        let edges = look.wanted.edges;
        let outlook = look.outlook;
        let depths = depths(look, found);
        let depth: i32 = depths.iter().map(|(_, depth)| depth).sum();
        let lines = outlook.chart.lines();
        if !std::mem::replace(&mut self.has_credit, true) {
            let contours = (edges.groups() as f64 * edges.edge_count() as f64).sqrt();
            self.credit = (RISK * found.searches.receivers() as f64 * (SAVED * contours + LINE * lines as f64)) as i64;
        }
        // Without a horizon the isolines end in one direction, and must agree there on everything.
        let is_walk = look.skips.hidden_bodies && outlook.normal.is_some() && edges.groups() > 1 && self.credit >= 0;
        if is_walk && self.walk(&depths, look, found) {
            if self.counts.above == 0 && look.skips.enclosed_receivers {
                return Sight::Enclosed;
            }
            self.gaps.finish::<C>(spans);
            return Sight::Part(Sweep { lines, depth_alarms: 0 });
        }

        self.crossings.clear();
        let mut sunken = 0;
        for (group, &box_) in (0..edges.groups() as u32).zip(edges.group_boxes().first().into_iter().flatten()) {
            if look.is_sunken(box_) {
                sunken += 1;
            } else {
                self.choose(group, look, found);
            }
        }
        self.counts = Counts { sunken, ..self.crossings.counts() };
        let sight = match (self.counts.above, depth) {
            (0, 0) => Some((Sight::Open, look.skips.open_receivers)),
            (0, _) => Some((Sight::Enclosed, look.skips.enclosed_receivers)),
            _ => None,
        };
        if let Some((sight, true)) = sight {
            return sight;
        }
        self.crossings.cross(outlook, found.candidates);
        C::horizons(outlook, &mut self.horizons);
        let depth_alarms = sweep(outlook, &mut self.crossings, depth, &self.horizons, spans, &mut self.finals);
        sight.map_or(Sight::Part(Sweep { lines, depth_alarms }), |(sight, _)| sight)
    }

    /// The groups of which something may be seen along the isolines, whatever it costs to tell.
    pub(super) fn reach<C: Chart<Piece = P>>(&mut self, look: Look<C>, found: &mut Found) -> &[u32] {
        self.credit = i64::MAX / 2;
        let depths = depths(look, found);
        self.walk(&depths, look, found);
        &self.entered
    }

    /// Chooses the contours of a group, searching it if that has not been done.
    fn choose<C: Chart<Piece = P>>(&mut self, group: u32, look: Look<C>, found: &mut Found) {
        let Found { searches, candidates, contours, .. } = found;
        let part = searches.part(group, look.wanted, candidates);
        let Wanted { excluded, .. } = look.wanted;
        self.crossings.choose(look.outlook, candidates, &part, excluded, contours, !look.skips.between_isolines);
    }

    /// Puts the groups that meet gaps before the isolines, those that cover the place where W is counted first, then from near to far,
    /// and leaves out the others; when this has cost more than it has saved, all that are left at once. Returns whether what it has
    /// found stands: not if the bookkeeping failed, nor if the receiver may see everything, for nothing that lies between two
    /// isolines must have been missed then.
    fn walk<C: Chart<Piece = P>>(&mut self, depths: &[(u32, i32)], look: Look<C>, found: &mut Found) -> bool {
        let edges = look.wanted.edges;
        self.counts = Counts::default();
        self.entered.clear();
        C::horizons(look.outlook, &mut self.horizons);
        self.gaps.reset::<C>(&self.horizons);
        self.done.resize(edges.groups(), 0);
        self.receiver = self.receiver.checked_add(1).unwrap_or_else(|| {
            self.done.fill(0);
            1
        });
        let boxes = edges.group_boxes();
        let position = look.outlook.position;
        self.stack.clear();
        self.stack.push((boxes.len() - 1, 0));
        self.push_sorted(0, depths.iter().map(|&(group, _)| group), &boxes[0], position.as_vec3());
        let (mut is_taken, mut has_entered) = (false, false);
        while let Some((level, index)) = self.stack.pop() {
            if level == 0 && self.done[index as usize] == self.receiver {
                continue;
            }
            if self.credit < 0 {
                self.enter(0..edges.groups() as u32, depths, look, found);
                break;
            }
            if look.is_sunken(boxes[level][index as usize]) {
                self.counts.sunken += self.leave_out(level, index, edges, |_| {});
                continue;
            }
            // What covers the isolines' start meets them while nothing else has been put before them.
            let is_first = !has_entered && level == 0;
            if !is_taken && !is_first {
                self.front.take(look.outlook, &self.gaps);
                self.credit -= self.front.len() as i64 / 2;
                is_taken = true;
            }
            self.credit -= (TEST + self.front.len() / 8) as i64;
            if !is_first && !self.front.meets(position, boxes[level][index as usize]) {
                let mut saved = 0.0;
                let hidden = self.leave_out(level, index, edges, |group| {
                    saved += SAVED * (edges.group_edges(group).len() as f64).sqrt();
                });
                self.counts.hidden += hidden;
                self.credit += saved as i64;
            } else if level == 0 {
                self.enter(index..index + 1, depths, look, found);
                (is_taken, has_entered) = (false, true);
            } else {
                let boxes = &boxes[level - 1];
                let children = 8 * index..(8 * index + 8).min(boxes.len() as u32);
                self.push_sorted(level - 1, children, boxes, position.as_vec3());
            }
        }
        let is_open = self.counts.above == 0 && depths.is_empty();
        !self.gaps.has_failed() && !is_open
    }

    /// Puts those of some groups before the isolines for which that has not been done.
    fn enter<C: Chart<Piece = P>>(
        &mut self,
        groups: Range<u32>,
        depths: &[(u32, i32)],
        look: Look<C>,
        found: &mut Found,
    ) {
        self.crossings.clear();
        let mut depth = 0;
        for group in groups {
            if std::mem::replace(&mut self.done[group as usize], self.receiver) != self.receiver {
                self.entered.push(group);
                self.choose(group, look, found);
                depth += depths.iter().find(|(of, _)| *of == group).map_or(0, |&(_, depth)| depth);
            }
        }
        self.counts += self.crossings.counts();
        let chart = look.outlook.chart;
        if let Some(open) = self.gaps.open() {
            self.crossings.drop_covered(open, chart);
        }
        self.crossings.cross(look.outlook, found.candidates);
        let is_first = self.counts == self.crossings.counts();
        let cut = self.gaps.cover(chart, &mut self.crossings, depth, &self.horizons);
        if !is_first {
            self.credit -= (chart.lines() / 4 + CUT * cut) as i64;
        }
    }

    /// Leaves out the groups in a box that have been neither put before the isolines nor left out, and calls `each` with them; returns
    /// their number.
    fn leave_out(&mut self, level: usize, index: u32, edges: &DualBvh, mut each: impl FnMut(u32)) -> usize {
        let below = 8u32.pow(level as u32);
        let groups = index * below..((index + 1) * below).min(edges.groups() as u32);
        let mut count = 0;
        for group in groups {
            if std::mem::replace(&mut self.done[group as usize], self.receiver) != self.receiver {
                count += 1;
                each(group);
            }
        }
        count
    }

    /// Puts boxes of one level on the stack, the nearest last, and of those around the receiver the smallest.
    fn push_sorted(&mut self, level: usize, indices: impl Iterator<Item = u32>, boxes: &[[Vec3; 2]], p: Vec3) {
        let mut sorted: SmallVec<[(f32, f32, u32); 8]> = indices
            .map(|index| (boxes[index as usize], index))
            .map(|(box_, index)| (distance_squared(box_, p), box_[0].distance_squared(box_[1]), index))
            .collect();
        sorted.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1)).then(b.2.cmp(&a.2)));
        self.stack.extend(sorted.iter().map(|&(_, _, index)| (level, index)));
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::Arc;

    use dual_bvh::BuildOptions;
    use glam::{DVec3, IVec3};
    use proptest::prelude::*;

    use super::*;
    use crate::visibility::{Frame, Isolines, MeridianFrame, Meridians, Receiver, Spans, View, Viewer};

    /// A box between two corners of a grid.
    pub(in crate::visibility) type Block = [IVec3; 2];

    pub(in crate::visibility) fn blocks(grid: i32) -> impl Strategy<Value = Vec<Block>> {
        let corner = (-grid..grid, -grid..grid, -grid..grid).prop_map(|(x, y, z)| IVec3::new(x, y, z));
        let size = (1..=grid, 1..=grid, 1..=grid).prop_map(|(x, y, z)| IVec3::new(x, y, z));
        prop::collection::vec((corner, size).prop_map(|(low, size)| [low, low + size]), 1..40)
    }

    /// Twelve triangles a box, which has corners of its own, and some without their last two: open from above.
    pub(in crate::visibility) fn mesh(blocks: &[Block]) -> (Arc<[Vec3]>, Arc<[[u32; 3]]>) {
        const SIDES: [[u32; 4]; 6] =
            [[0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5], [0, 2, 3, 1], [4, 5, 7, 6]];
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (number, &[low, high]) in blocks.iter().enumerate() {
            let first = 8 * number as u32;
            positions.extend((0..8).map(|i| {
                let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
                Vec3::new(pick(0) as f32, pick(1) as f32, pick(2) as f32)
            }));
            let sides = if number % 5 == 4 { 5 } else { 6 };
            triangles.extend(
                SIDES[..sides].iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|t| t.map(|i| first + i)),
            );
        }
        (positions.into(), triangles.into())
    }

    fn is_on_side(p: DVec3, [low, high]: Block) -> bool {
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let is_inside = p.cmpge(low).all() && p.cmple(high).all();
        is_inside && (p.cmpeq(low).any() || p.cmpeq(high).any())
    }

    /// Places on a grid of halves that are on no side of a box.
    pub(in crate::visibility) fn off_sides(
        points: &[(i32, i32, i32)],
        blocks: &[Block],
    ) -> impl Iterator<Item = DVec3> {
        let places = points.iter().map(|&(x, y, z)| 0.5 * DVec3::new(x.into(), y.into(), z.into()));
        places.filter(|&p| blocks.iter().all(|&block| !is_on_side(p, block)))
    }

    /// Triangles that share no corners.
    pub(in crate::visibility) fn loose(corners: &[(i32, i32, i32)]) -> (Arc<[Vec3]>, Arc<[[u32; 3]]>) {
        let corner = |&(x, y, z): &(i32, i32, i32)| Vec3::new(x as f32, y as f32, z as f32);
        let positions: Vec<Vec3> = corners.chunks_exact(3).flatten().map(corner).collect();
        let triangles = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        (positions.into(), triangles)
    }

    /// Along whole numbers; none along zero.
    pub(in crate::visibility) fn direction((x, y, z): (i32, i32, i32)) -> Option<DVec3> {
        DVec3::new(x.into(), y.into(), z.into()).try_normalize()
    }

    /// Receivers among and beside loose triangles.
    pub(in crate::visibility) fn in_a_row(normal: (i32, i32, i32)) -> [Receiver<'static>; 3] {
        let normal = direction(normal);
        [0.123, 0.456, 7.89].map(|x| Receiver { position: DVec3::new(x, 0.217, -0.391), normal, excluded: &[] })
    }

    /// Spans of all isolines of both charts, none for a receiver that sees everything, the numbers of alarms, and of hidden groups.
    fn seen(
        viewer: &Viewer,
        receiver: Receiver,
        skips: Skips,
        view: &mut View,
    ) -> ([(Option<Spans>, usize); 2], [usize; 2]) {
        let (meridians, isolines) = (Meridians::new(22).unwrap(), Isolines::new(22).unwrap());
        let mut hidden = [0; 2];
        let seen = [0, 1].map(|chart| {
            let sight = if chart == 0 {
                viewer.trace(&meridians, MeridianFrame::facing(receiver.normal, false), receiver, skips, view)
            } else {
                viewer.follow(&isolines, Frame::facing(receiver.normal, 0), receiver, skips, view)
            };
            hidden[chart] = view.counts().hidden;
            match sight {
                Sight::Open => (None, 0),
                Sight::Enclosed => (Some(Spans::new(&[&[] as &[(f64, f64)]; 44][..22 * (chart + 1)])), 0),
                Sight::Part(sweep) => (Some(view.spans().clone()), sweep.depth_alarms),
            }
        });
        (seen, hidden)
    }

    fn skipping_changes_nothing(
        (positions, triangles): (Arc<[Vec3]>, Arc<[[u32; 3]]>),
        receivers: &[Receiver],
        group_faces: usize,
    ) -> [usize; 2] {
        let mut options = BuildOptions::default();
        options.group_faces = group_faces;
        let edges = DualBvh::build(positions.clone(), triangles.clone(), &options).unwrap();
        let faces = FaceTree::new(positions, triangles);
        let viewer = Viewer { edges: &edges, faces: &faces };
        let (mut lazy, mut full) = (View::default(), View::default());
        viewer.approach(receivers.iter().copied(), &mut lazy);
        viewer.approach(receivers.iter().copied(), &mut full);
        let all = Skips { hidden_bodies: false, ..Skips::default() };
        let mut hidden = [0; 2];
        for &receiver in receivers {
            // Whatever tests cost, here they are made.
            lazy.grant(i64::MAX / 2);
            let (expected, none) = seen(&viewer, receiver, all, &mut full);
            assert_eq!(none, [0; 2]);
            let (found, left_out) = seen(&viewer, receiver, Skips::default(), &mut lazy);
            assert_eq!(found, expected, "{receiver:?}");
            hidden.iter_mut().zip(left_out).for_each(|(hidden, left_out)| *hidden += left_out);
        }
        hidden
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 400, max_global_rejects: 1 << 20, ..ProptestConfig::default() })]

        /// Boxes that touch, stand in one another or coincide, seen from within the planes of their sides.
        #[test]
        fn hidden_boxes_change_nothing(
            blocks in blocks(4),
            points in prop::collection::vec((-8..8i32, -8..8i32, -8..8i32), 1..5),
            normal in (-2..3i32, -2..3i32, -2..3i32),
            group_faces in prop::sample::select(vec![1usize, 30, 100]),
        ) {
            let normal = direction(normal);
            let receivers: Vec<Receiver> = off_sides(&points, &blocks)
                .map(|position| Receiver { position, normal, excluded: &[] })
                .collect();
            skipping_changes_nothing(mesh(&blocks), &receivers, group_faces);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

        /// Loose triangles, in groups that lie in one another.
        #[test]
        fn hidden_triangles_change_nothing(
            corners in prop::collection::vec((-9..10i32, -9..10i32, -9..10i32), 3..240),
            normal in (-2..3i32, -2..3i32, -2..3i32),
        ) {
            skipping_changes_nothing(loose(&corners), &in_a_row(normal), 4);
        }
    }

    /// Shells in one another, with things between them: ten in all.
    pub(in crate::visibility) fn shells() -> Vec<Block> {
        let shells = (1..6).map(|i| [IVec3::splat(-4 * i), IVec3::splat(4 * i)]);
        let things = (1..6).map(|i| IVec3::new(4 * i - 3, 1, -1)).map(|low| [low, low + IVec3::new(1, 2, 2)]);
        shells.chain(things).collect()
    }

    #[test]
    fn what_is_outside_of_a_shell_is_hidden() {
        let blocks = shells();
        let at = |p: DVec3| Receiver { position: p, normal: Some(DVec3::new(0.6, 0.0, 0.8)), excluded: &[] };
        let inside = skipping_changes_nothing(mesh(&blocks), &[at(DVec3::new(-1.3, 0.2, 0.4))], 1);
        assert_eq!(inside, [9; 2], "of ten: the innermost covers all");
        let outside = skipping_changes_nothing(mesh(&blocks), &[at(DVec3::new(-1.3, 40.0, 0.4))], 1);
        assert!(outside.iter().all(|&hidden| hidden < 9));
    }
}
