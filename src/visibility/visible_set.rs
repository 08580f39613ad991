use dual_bvh::DualBvh;
use glam::{DVec3, Vec3};

use super::chart::{Chart, Outlook};
use super::depth::{count_along, is_covered};
use super::exact::{self, Region};
use super::front::{Front, is_sunken};
use super::outline::Outline;
use super::searches::Wanted;
use super::trace::{Found, Look, Tracer};
use super::{MeridianFrame, Meridians, ReceiverContours, Skips};
use crate::scene::FaceTree;

/// The groups of bodies from whose contours alone the region that a receiver sees follows, without a doubt.
///
/// A few isolines predict which they are, and the region visible among them alone proves that nothing is seen of the others: a box that
/// neither holds a part of the region nor meets its boundary lies behind the set, whose W is positive there; and W of what is in the
/// box is not negative. So W of all is zero where that of the set is.
pub(super) struct VisibleSet {
    meridians: Meridians,
    tracer: Tracer<<Meridians as Chart>::Piece>,
    front: Front,
    outline: Outline,
    groups: Vec<u32>,
    /// For each group whether it is one of them, and about how many contours it has.
    is_in: Vec<bool>,
    contours: Vec<f32>,
    /// Boxes to look at, by level and number.
    stack: Vec<(usize, u32)>,
    /// What leaving out groups may still cost before it must have saved something.
    credit: f64,
    has_credit: bool,
    /// Share of the contours that must be left out for it to be worth while.
    least: f64,
}

/// Isolines that predict. With half as many twice as many receivers of the building need a second round; they take a fifth of the time.
const LINES: usize = 64;

/// Regions that are solved at most before all groups are taken.
const ROUNDS: usize = 3;

/// With fewer contours than half left out, what two rounds cost is more than what they save.
const LEAST: f64 = 0.5;

/// What solving saves with every contour less. Units are tests of eight arcs against a box, or against the way to its middle, a few
/// nanoseconds.
const CONTOUR: f64 = 40.0;
/// What it costs to find a contour and to put it before the isolines that predict.
const CROSSED: f64 = 10.0;
/// What a ray costs.
const RAY: f64 = 300.0;
/// What a test costs beside its arcs.
const TEST: f64 = 4.0;
/// Share of a tile's work that may be risked.
const RISK: f64 = 1.0 / 600.0;

/// Who sees what, in which chart.
#[derive(Clone, Copy)]
pub(super) struct Eye<'a> {
    pub(super) faces: &'a FaceTree,
    pub(super) wanted: Wanted<'a>,
    pub(super) normal: DVec3,
    pub(super) frame: u32,
}

impl Default for VisibleSet {
    fn default() -> Self {
        Self {
            meridians: Meridians::new(LINES).expect("the number of isolines is a constant"),
            tracer: Tracer::default(),
            front: Front::default(),
            outline: Outline::default(),
            groups: Vec::new(),
            is_in: Vec::new(),
            contours: Vec::new(),
            stack: Vec::new(),
            credit: 0.0,
            has_credit: false,
            least: LEAST,
        }
    }
}

/// About how many contours of a group have to be solved with: they grow like the root of the number of its edges.
fn contours_of(Eye { wanted: Wanted { edges, position, .. }, normal, .. }: Eye, group: u32) -> f32 {
    match is_sunken(position, normal, edges.group_boxes()[0][group as usize]) {
        true => 0.0,
        false => (edges.group_edges(group).len() as f32).sqrt(),
    }
}

impl VisibleSet {
    /// Begins with another tile.
    pub(super) fn begin(&mut self) {
        self.has_credit = false;
    }

    /// Number of groups that are not in the set: of those that reach above the horizon, and of the others.
    pub(super) fn left_out(&self) -> [usize; 2] {
        let left_out = self.contours.iter().zip(&self.is_in).filter(|&(_, is_in)| !is_in);
        let sunken = left_out.clone().filter(|&(contours, _)| *contours == 0.0).count();
        [left_out.count() - sunken, sunken]
    }

    /// Whether what leaving out groups has cost in this tile, of so many receivers, is little beside what it has saved.
    pub(super) fn pays(&mut self, edges: &DualBvh, receivers: usize) -> bool {
        if !std::mem::replace(&mut self.has_credit, true) {
            let contours = (edges.groups() as f64 * edges.edge_count() as f64).sqrt();
            self.credit = RISK * receivers as f64 * CONTOUR * contours;
        }
        self.credit >= 0.0
    }

    /// From now on whatever it costs is paid, and so few isolines predict that much is left to the proof.
    #[cfg(test)]
    pub(super) fn insist(&mut self) {
        self.meridians = Meridians::new(4).expect("four are enough");
        (self.credit, self.has_credit, self.least) = (f64::INFINITY, true, 0.0);
    }

    /// Solves for the visible region with the contours of a set of groups alone, to be found in `projected` then; returns whether that
    /// is certain to have given what those of all would.
    pub(super) fn solve(
        &mut self,
        eye: Eye,
        found: &mut Found,
        projected: &mut ReceiverContours,
        scratch: &mut exact::Scratch,
    ) -> bool {
        let edges = eye.wanted.edges;
        self.contours.clear();
        self.contours.extend((0..edges.groups() as u32).map(|group| contours_of(eye, group)));
        let all = self.contours.iter().map(|&contours| f64::from(contours)).sum::<f64>();
        self.predict(eye, found);
        self.credit -= CROSSED * self.taken();
        // Groups whose contours the region has been solved with, and the number of these.
        let (mut solved, mut arcs) = (0, 0);
        for _ in 0..ROUNDS {
            let taken = self.taken();
            if all - taken < self.least * all {
                break;
            }
            self.project(eye, found, projected);
            if solved > 0 && projected.arcs.len() == arcs && !self.surrounds(eye, solved) {
                self.credit += CONTOUR * (all - taken);
                return true;
            }
            self.credit -= CONTOUR * taken;
            if !self.solve_certainly(eye, projected, scratch) {
                break;
            }
            (solved, arcs) = (self.groups.len(), projected.arcs.len());
            self.add_what_may_be_seen(eye, scratch.region());
            if self.groups.len() == solved {
                self.credit += CONTOUR * all;
                return true;
            }
            for &group in &self.groups[solved..] {
                found.searches.part(group, eye.wanted, found.candidates);
            }
        }
        false
    }

    /// About how many contours the set has.
    fn taken(&self) -> f64 {
        self.groups.iter().map(|&group| f64::from(self.contours[group as usize])).sum()
    }

    /// Takes the groups of which something is seen along a few isolines.
    fn predict(&mut self, eye: Eye, found: &mut Found) {
        let Self { meridians, tracer, groups, is_in, .. } = self;
        let Eye { faces, wanted, normal, .. } = eye;
        let axes = MeridianFrame::facing(Some(normal), false).axes();
        let outlook = Outlook { chart: &*meridians, axes, position: wanted.position, normal: Some(normal) };
        let reached = tracer.reach(Look { faces, outlook, wanted, skips: Skips::default() }, found);
        groups.clear();
        groups.extend_from_slice(reached);
        is_in.clear();
        is_in.resize(wanted.edges.groups(), false);
        groups.iter().for_each(|&group| is_in[group as usize] = true);
    }

    /// Projects the contours of the set.
    fn project(&self, eye: Eye, found: &mut Found, projected: &mut ReceiverContours) {
        let Wanted { position, excluded, .. } = eye.wanted;
        projected.clear();
        for &group in &self.groups {
            let Some(part) = found.candidates.part(group) else { unreachable!("the group has been searched") };
            found.candidates.contours_in(part, position, excluded, found.contours);
            let vertices = part.vertices.clone();
            projected.project(found.candidates, vertices, found.contours, position, Some(eye.normal));
        }
    }

    /// Whether groups added last, which have no contours above the horizon, cover all of the sky.
    fn surrounds(&self, eye: Eye, first: usize) -> bool {
        let Wanted { edges, position, excluded, .. } = eye.wanted;
        let is_added = |face| self.groups[first..].contains(&edges.group_of(face));
        count_along(eye.faces, position, excluded, exact::pole(eye.normal, eye.frame), is_added) != 0
    }

    /// Solves for the region visible among the set; returns whether it is certain.
    fn solve_certainly(&self, eye: Eye, projected: &ReceiverContours, scratch: &mut exact::Scratch) -> bool {
        let Wanted { edges, position, excluded, .. } = eye.wanted;
        let is_in = |face| self.is_in[edges.group_of(face) as usize];
        let depth = |w| count_along(eye.faces, position, excluded, w, is_in);
        exact::solve_certainly(projected, Some(eye.normal), eye.frame, depth, scratch)
    }

    /// Adds the groups of which something may be seen in the region that the set leaves.
    fn add_what_may_be_seen(&mut self, eye: Eye, region: &Region) {
        if region.boundary().is_empty() {
            // The horizon would bound it.
            return;
        }
        let boxes = eye.wanted.edges.group_boxes();
        self.front.take_arcs(region.boundary());
        self.outline.take(region.boundary(), region.known());
        self.stack.clear();
        self.stack.push((boxes.len() - 1, 0));
        while let Some((level, index)) = self.stack.pop() {
            if level == 0 && self.is_in[index as usize] {
                continue;
            }
            let box_ = boxes[level][index as usize];
            self.credit -= TEST + (self.front.len() / 4) as f64;
            let may_be_seen = self.front.meets(eye.wanted.position, box_) || !self.hides(eye, box_);
            if may_be_seen && level == 0 {
                self.is_in[index as usize] = true;
                self.groups.push(index);
            } else if may_be_seen {
                let children = 8 * index..(8 * index + 8).min(boxes[level - 1].len() as u32);
                self.stack.extend(children.map(|child| (level - 1, child)));
            }
        }
    }

    /// Whether the middle of a box, which the region holds or not, is outside of the region.
    fn hides(&mut self, eye: Eye, [low, high]: [Vec3; 2]) -> bool {
        let Wanted { edges, position, excluded, .. } = eye.wanted;
        let middle = 0.5 * low.as_dvec3() + 0.5 * high.as_dvec3() - position;
        // What is around the receiver is where it looks.
        let direction = middle.try_normalize().unwrap_or(eye.normal);
        if eye.normal.dot(direction) <= 0.0 {
            return true;
        }
        if let Some(is_held) = self.outline.holds(direction) {
            return !is_held;
        }
        self.credit -= RAY;
        // With groups that were added just now the proof is made once more.
        is_covered(eye.faces, position, excluded, direction, |face| self.is_in[edges.group_of(face) as usize])
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use dual_bvh::BuildOptions;
    use glam::{DQuat, IVec3};
    use proptest::prelude::*;

    use super::*;
    use crate::sphere::BoundaryArc;
    use crate::visibility::trace::tests::{blocks, direction, in_a_row, loose, mesh, off_sides, shells};
    use crate::visibility::{Receiver, View, Viewer};

    /// What is compared: all that results are made of.
    #[derive(Debug, PartialEq)]
    struct Seen {
        boundary: Vec<BoundaryArc>,
        numbers: Vec<f64>,
        has_alarm: bool,
    }

    fn seen(viewer: &Viewer, receiver: Receiver, skips: Skips, view: &mut View) -> Seen {
        viewer.solve(0, receiver, skips, view);
        let region = view.region();
        let (boundary, has_alarm) = (region.boundary().to_vec(), region.residuals().alarm());
        let residuals = region.residuals();
        let mut numbers = vec![region.solid_angle(), residuals.closure, residuals.gap, residuals.negative];
        numbers.extend(region.vector_area().to_array());
        if let (Some(normal), false) = (receiver.normal, has_alarm) {
            numbers.extend(region.cosine_gradient(view.contours(), normal).to_array());
        }
        // What is not a number is not equal.
        numbers.iter_mut().filter(|number| number.is_nan()).for_each(|number| *number = f64::INFINITY);
        Seen { boundary, numbers, has_alarm }
    }

    /// Returns how many groups were left out.
    fn leaving_out_changes_nothing(
        (positions, triangles): (Arc<[Vec3]>, Arc<[[u32; 3]]>),
        receivers: &[Receiver],
        group_faces: usize,
    ) -> usize {
        let mut options = BuildOptions::default();
        options.group_faces = group_faces;
        let edges = DualBvh::build(positions.clone(), triangles.clone(), &options).unwrap();
        let faces = FaceTree::new(positions, triangles);
        let viewer = Viewer { edges: &edges, faces: &faces };
        let (mut lazy, mut full) = (View::default(), View::default());
        viewer.approach(receivers.iter().copied(), &mut lazy);
        viewer.approach(receivers.iter().copied(), &mut full);
        let all = Skips { hidden_bodies: false, ..Skips::default() };
        let mut hidden = 0;
        for &receiver in receivers {
            lazy.grant(i64::MAX / 2);
            full.grant(i64::MAX / 2);
            let expected = seen(&viewer, receiver, all, &mut full);
            assert_eq!(full.counts().hidden, 0);
            let found = seen(&viewer, receiver, Skips::default(), &mut lazy);
            assert_eq!(found, expected, "{receiver:?}, {} hidden", lazy.counts().hidden);
            hidden += lazy.counts().hidden;
        }
        hidden
    }

    /// Any rotation that has nothing to do with the axes.
    fn turn() -> DQuat {
        DQuat::from_xyzw(0.13, 0.57, 0.31, 0.74).normalize()
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 300, max_global_rejects: 1 << 20, ..ProptestConfig::default() })]

        /// Boxes that touch, stand in one another or coincide, seen from within the planes of their sides; and the same turned, so that
        /// rounding parts what was one plane.
        #[test]
        fn hidden_boxes_change_nothing(
            blocks in blocks(4),
            points in prop::collection::vec((-8..8i32, -8..8i32, -8..8i32), 1..5),
            normal in (-2..3i32, -2..3i32, -2..3i32),
            group_faces in prop::sample::select(vec![1usize, 30, 100]),
            is_turned: bool,
        ) {
            let normal = direction(normal);
            let turn = if is_turned { turn() } else { DQuat::IDENTITY };
            let receivers: Vec<Receiver> = off_sides(&points, &blocks)
                .map(|p| Receiver { position: turn * p, normal: normal.map(|n| turn * n), excluded: &[] })
                .collect();
            let (positions, triangles) = mesh(&blocks);
            let positions = positions.iter().map(|p| (turn * p.as_dvec3()).as_vec3()).collect();
            leaving_out_changes_nothing((positions, triangles), &receivers, group_faces);
        }

        /// Loose triangles, in groups that lie in one another.
        #[test]
        fn hidden_triangles_change_nothing(
            corners in prop::collection::vec((-9..10i32, -9..10i32, -9..10i32), 3..240),
            normal in (-2..3i32, -2..3i32, -2..3i32),
        ) {
            leaving_out_changes_nothing(loose(&corners), &in_a_row(normal), 4);
        }
    }

    #[test]
    fn what_is_outside_of_a_shell_is_hidden() {
        let normal = Some(DVec3::new(0.6, 0.0, 0.8));
        let receiver = Receiver { position: DVec3::new(-1.3, 0.2, 0.4), normal, excluded: &[] };
        let inside = leaving_out_changes_nothing(mesh(&shells()), &[receiver], 1);
        assert_eq!(inside, 9, "of ten: the innermost covers all");
    }

    /// A window that no isoline of those that predict looks through, and behind it a thing that the region shows to be in the way. What
    /// stands behind the walls is left out.
    #[test]
    fn what_is_seen_between_isolines_is_added() {
        let block = |low: [i32; 3], high: [i32; 3]| [IVec3::from(low), IVec3::from(high)];
        let mut blocks = vec![
            block([-2000, -2100, 400], [2000, 10, 401]),
            block([-1900, 20, 403], [1950, 2200, 404]),
            block([-1800, -50, 406], [150, 60, 407]),
            block([160, -70, 409], [1850, 80, 410]),
            block([303, 28, 800], [304, 29, 801]),
        ];
        blocks.extend((0..20).map(|i| block([20 * i - 1000, 500 + i, 900], [20 * i - 991, 513 + i, 910])));
        let receiver = Receiver { position: DVec3::new(0.3, 0.4, 0.2), normal: Some(DVec3::Z), excluded: &[] };
        assert_eq!(leaving_out_changes_nothing(mesh(&blocks), &[receiver], 1), 20);
    }

    /// The same window in a box, and a larger box around it, of which no contour is seen.
    #[test]
    fn what_surrounds_everything_is_added() {
        let corners = |x: [i32; 2], y: [i32; 2], z: i32| {
            [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| IVec3::new(x[i], y[j], z).as_vec3())
        };
        let (outer, all) = mesh(&[[IVec3::splat(-10_000), IVec3::splat(10_000)]]);
        let mut positions = outer.to_vec();
        positions.extend(corners([-2000, 2000], [-2000, 2000], 400));
        positions.extend(corners([145, 153], [10, 20], 400));
        positions.extend(corners([-2000, 2000], [-2000, 2000], -400));
        let mut triangles = all.to_vec();
        for i in 0..4 {
            let next = (i + 1) % 4;
            let [a, b] = [8 + i, 8 + next];
            triangles.extend([[a, b, a + 4], [b, b + 4, a + 4], [a, b, a + 8], [b, b + 8, a + 8]]);
        }
        triangles.extend([[16, 17, 18], [16, 18, 19]]);
        let receiver = Receiver { position: DVec3::new(0.3, 0.4, 0.2), normal: Some(DVec3::Z), excluded: &[] };
        leaving_out_changes_nothing((positions.into(), triangles.into()), &[receiver], 1);
    }
}
