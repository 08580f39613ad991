use dual_bvh::DualBvh;
use glam::{DVec3, Vec3};

use super::chart::{Chart, Outlook};
use super::depth::{count_along, is_covered};
use super::exact::{self, Region};
use super::front::Front;
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
    groups: Vec<u32>,
    /// For each group whether it is one of them, and about how many contours it has.
    is_in: Vec<bool>,
    contours: Vec<f32>,
    /// Boxes to look at, by level and number.
    stack: Vec<(usize, u32)>,
    /// What leaving out groups may still cost before it must have saved something.
    credit: f64,
    has_credit: bool,
}

/// Isolines that predict. With half as many twice as many receivers of the building need a second round; they take a fifth of the time.
const LINES: usize = 64;

/// Regions that are solved at most before all groups are taken.
const ROUNDS: usize = 3;

/// Share of the contours that must be left out for it to be worth while.
const LEAST: f64 = 0.5;

/// What solving saves with every contour less. Units are tests of eight arcs against a box, a few nanoseconds.
const CONTOUR: f64 = 40.0;
/// What it costs to find a contour and to put it before the isolines that predict.
const CROSSED: f64 = 10.0;
/// What a ray costs.
const RAY: f64 = 300.0;
/// What a test costs beside its arcs.
const TEST: f64 = 4.0;
/// Share of a tile's work that may be risked.
const RISK: f64 = 1.0 / 400.0;

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
            groups: Vec::new(),
            is_in: Vec::new(),
            contours: Vec::new(),
            stack: Vec::new(),
            credit: 0.0,
            has_credit: false,
        }
    }
}

/// About how many contours of a group have to be solved with: they grow like the root of the number of its edges.
fn contours_of(edges: &DualBvh, group: u32, position: Vec3, normal: Vec3) -> f32 {
    let [low, high] = edges.group_boxes()[0][group as usize];
    let highest = Vec3::select(normal.cmpge(Vec3::ZERO), high, low);
    let is_above = normal.dot(highest - position) > 0.0;
    if is_above { (edges.group_edges(group).len() as f32).sqrt() } else { 0.0 }
}

impl VisibleSet {
    /// Begins with another tile.
    pub(super) fn begin(&mut self) {
        self.has_credit = false;
    }

    /// Number of groups in the set.
    pub(super) fn len(&self) -> usize {
        self.groups.len()
    }

    /// Whether what leaving out groups has cost in this tile, of so many receivers, is little beside what it has saved.
    pub(super) fn pays(&mut self, edges: &DualBvh, receivers: usize) -> bool {
        if !std::mem::replace(&mut self.has_credit, true) {
            let contours = (edges.groups() as f64 * edges.edge_count() as f64).sqrt();
            self.credit = RISK * receivers as f64 * CONTOUR * contours;
        }
        self.credit >= 0.0
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
        let (position, normal) = (eye.wanted.position.as_vec3(), eye.normal.as_vec3());
        self.contours.clear();
        self.contours.extend((0..edges.groups() as u32).map(|group| contours_of(edges, group, position, normal)));
        let all = self.contours.iter().map(|&contours| f64::from(contours)).sum::<f64>();
        self.predict(eye, found);
        self.credit -= CROSSED * self.taken();
        // Groups whose contours the region has been solved with, and the number of these.
        let (mut solved, mut arcs) = (0, 0);
        for _ in 0..ROUNDS {
            let taken = self.taken();
            if all - taken < LEAST * all {
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
                found.searches.contours(group, eye.wanted, found.candidates, found.contours);
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
        self.stack.clear();
        self.stack.push((boxes.len() - 1, 0));
        while let Some((level, index)) = self.stack.pop() {
            if level == 0 && self.is_in[index as usize] {
                continue;
            }
            let box_ = boxes[level][index as usize];
            self.credit -= TEST + (self.front.len() / 8) as f64;
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
        self.credit -= RAY;
        // With groups that were added just now the proof is made once more.
        is_covered(eye.faces, position, excluded, direction, |face| self.is_in[edges.group_of(face) as usize])
    }
}
