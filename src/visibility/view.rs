use dual_bvh::{Candidates, Contours, DualBvh, Tile};
use glam::{DMat3, DVec3};

use super::beams::{Beams, Rays};
use super::chart::{Chart, Outlook};
use super::depth::count_along;
use super::exact::{self, Region};
use super::front::is_sunken;
use super::searches::{Searches, Wanted};
use super::trace::{Found, Look, Tracer};
use super::visible_set::{Eye, VisibleSet};
use super::{Counts, Frame, Isolines, MeridianFrame, Meridians, ReceiverContours, Skips, Spans};
use crate::scene::FaceTree;

/// A point from which the scene is seen.
#[derive(Clone, Copy, Debug)]
pub struct Receiver<'a> {
    /// Where it is.
    pub position: DVec3,
    /// Unit normal of the surface it lies on, whose horizon bounds its view; none for a probe, which sees all around.
    pub normal: Option<DVec3>,
    /// Faces it does not see: those of its own surface that meet in it.
    pub excluded: &'a [u32],
}

/// Finds what receivers see of a scene.
#[derive(Clone, Copy)]
pub struct Viewer<'a> {
    /// Finds contours.
    pub edges: &'a DualBvh,
    /// Finds the faces along a ray.
    pub faces: &'a FaceTree,
}

/// How much of its hemisphere (or sphere) a receiver sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// Everything: no contour above the horizon and nothing overhead.
    Open,
    /// Nothing: no contour above the horizon, but something overhead.
    Enclosed,
    /// Part of it: the [`View::spans`].
    Part(Sweep),
}

/// What was noticed along the isolines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sweep {
    /// Isolines that were followed.
    pub lines: usize,
    /// Isolines on which the depth complexity W fell below zero, or that end in one direction with different W: failed bookkeeping.
    pub depth_alarms: usize,
}

/// Working memory for one thread: reused, so that nothing is allocated from one receiver to the next.
#[derive(Default)]
pub struct View {
    excluded: Vec<u32>,
    /// The tile approached, without the faces it excludes.
    tile: Option<Tile<'static>>,
    /// Whether all groups have been searched for it, one after another.
    is_searched: bool,
    beams: Beams,
    candidates: Candidates,
    contours: Contours,
    projected: ReceiverContours,
    searches: Searches,
    along_meridians: Tracer<<Meridians as Chart>::Piece>,
    along_isolines: Tracer<<Isolines as Chart>::Piece>,
    spans: Spans,
    counts: Counts,
    visible_set: VisibleSet,
    exact: exact::Scratch,
}

impl View {
    /// Contours that the region last solved was found from, above the receiver's horizon.
    pub fn contours(&self) -> &ReceiverContours {
        &self.projected
    }

    /// The visible spans of the last receiver that was looked at along meridians or isolines.
    pub fn spans(&self) -> &Spans {
        &self.spans
    }

    /// What became of the last receiver's contours.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    #[cfg(test)]
    pub(super) fn grant(&mut self, credit: i64) {
        (self.along_meridians.credit, self.along_meridians.has_credit) = (credit, true);
        (self.along_isolines.credit, self.along_isolines.has_credit) = (credit, true);
        self.visible_set.insist();
    }

    /// The visible region that was last solved.
    pub fn region(&self) -> &Region {
        self.exact.region()
    }
}

impl Viewer<'_> {
    /// Comes near to the `receivers`, neighbours of each other, who share the search for contours: it is made when it is needed, and
    /// as far as it is.
    pub fn approach<'r>(&self, receivers: impl Iterator<Item = Receiver<'r>> + Clone, view: &mut View) {
        view.excluded.clear();
        view.excluded.extend(receivers.clone().flat_map(|r| r.excluded));
        view.searches.begin(self.edges, receivers.clone().count());
        view.along_meridians.begin();
        view.along_isolines.begin();
        view.visible_set.begin();
        view.beams.begin();
        let tile = Tile::new(receivers.map(|r| (r.position, r.normal)));
        view.tile = Some(tile);
        view.is_searched = false;
        self.edges.begin(&tile.with_faces(&view.excluded), &mut view.candidates);
    }

    /// Calls `visit` with every face that may touch a receiver among those approached, in no particular order.
    pub fn visit_around(&self, receiver: Receiver, view: &mut View, visit: impl FnMut(u32)) {
        let Receiver { position, normal, .. } = receiver;
        let tile = view.tile.unwrap_or(Tile::lone(position, normal));
        Rays { faces: self.faces, tile, beams: &mut view.beams }.visit(position, DVec3::ZERO, visit);
    }

    /// Searches all edges that may be contours for any of the receivers approached.
    fn search(&self, view: &mut View) {
        if let (Some(tile), false) = (view.tile, view.is_searched) {
            // Also what has been searched already, so that the order is always the same.
            self.edges.search(&tile.with_faces(&view.excluded), &mut view.candidates);
            view.is_searched = true;
        }
    }

    /// Projects all contours of a receiver among those approached; returns the number of groups below its horizon.
    fn project(&self, receiver: Receiver, skips: Skips, view: &mut View) -> usize {
        let Receiver { position, normal, excluded } = receiver;
        view.projected.clear();
        let Some(up) = normal.filter(|_| self.edges.groups() > 1) else {
            self.search(view);
            let View { candidates, contours, projected, .. } = view;
            candidates.contours(position, excluded, contours);
            projected.project(candidates, 0..candidates.vertices().len(), contours, position, normal);
            return 0;
        };
        let View { excluded, tile, is_searched, searches, candidates, contours, projected, .. } = view;
        let wanted = self.wanted(receiver, skips, *tile, excluded, *is_searched);
        let mut sunken = 0;
        for (group, &box_) in (0..).zip(self.edges.group_boxes().first().into_iter().flatten()) {
            if skips.below_horizon && is_sunken(position, up, box_) {
                sunken += 1;
                continue;
            }
            let part = searches.part(group, wanted, candidates);
            candidates.contours_in(&part, position, receiver.excluded, contours);
            projected.project(candidates, part.vertices, contours, position, normal);
        }
        sunken
    }

    /// What a receiver among those approached sees along the meridians: the [`View::spans`], if it sees a part.
    pub fn trace(
        &self,
        meridians: &Meridians,
        frame: MeridianFrame,
        receiver: Receiver,
        skips: Skips,
        view: &mut View,
    ) -> Sight {
        self.look(meridians, frame.axes(), receiver, skips, view, |view| &mut view.along_meridians)
    }

    /// What a receiver among those approached sees along the halves of octahedral isolines: the [`View::spans`], if it sees a part.
    pub fn follow(
        &self,
        isolines: &Isolines,
        frame: Frame,
        receiver: Receiver,
        skips: Skips,
        view: &mut View,
    ) -> Sight {
        self.look(isolines, frame.axes(), receiver, skips, view, |view| &mut view.along_isolines)
    }

    fn look<C: Chart>(
        &self,
        chart: &C,
        axes: DMat3,
        receiver: Receiver,
        skips: Skips,
        view: &mut View,
        tracer: impl Fn(&mut View) -> &mut Tracer<C::Piece>,
    ) -> Sight {
        let Receiver { position, normal, .. } = receiver;
        if view.tile.is_none() {
            self.approach(std::iter::once(receiver), view);
        }
        let mut taken = std::mem::take(tracer(view));
        let wanted = self.wanted(receiver, skips, view.tile, &view.excluded, view.is_searched);
        let look = Look { faces: self.faces, outlook: Outlook { chart, axes, position, normal }, wanted, skips };
        let View { beams, searches, candidates, contours, .. } = view;
        let sight = taken.trace(look, &mut Found { beams, searches, candidates, contours }, &mut view.spans);
        view.counts = taken.counts();
        *tracer(view) = taken;
        sight
    }

    fn wanted<'a>(
        &'a self,
        Receiver { position, normal, excluded }: Receiver<'a>,
        skips: Skips,
        tile: Option<Tile<'static>>,
        all_excluded: &'a [u32],
        is_searched: bool,
    ) -> Wanted<'a> {
        Wanted {
            edges: self.edges,
            position,
            horizon: if skips.below_horizon { normal } else { None },
            excluded,
            tile: tile.unwrap_or(Tile::lone(position, normal)).with_faces(all_excluded),
            is_searched,
        }
    }

    /// What a receiver among those approached sees, exactly: its visible region, solved in the chart numbered `frame`.
    ///
    /// Three ways lead there: by the contours of bodies that may be seen, by those of all, and, where rounding leaves a choice in both,
    /// by those of all in one order. What is certain is the same to the bit, so either of the first two may be tried first.
    pub fn solve<'v>(&self, frame: u32, receiver: Receiver, skips: Skips, view: &'v mut View) -> &'v Region {
        let Receiver { position, normal, excluded } = receiver;
        if view.tile.is_none() {
            self.approach(std::iter::once(receiver), view);
        }
        let depth = |w| count_along(self.faces, position, excluded, w, |_| true);
        match normal {
            Some(normal) if self.edges.groups() > 1 => {
                let is_lazy = skips.hidden_bodies && view.visible_set.pays(self.edges, view.searches.receivers());
                let is_solved = is_lazy && self.solve_visible(frame, receiver, normal, skips, view);
                let mut below = 0;
                if !is_solved {
                    below = self.project(receiver, skips, view);
                    let is_certain =
                        exact::solve_certainly(&view.projected, Some(normal), frame, depth, &mut view.exact);
                    if !is_certain && (is_lazy || !self.solve_visible(frame, receiver, normal, skips, view)) {
                        self.project(receiver, skips, view);
                        exact::solve_in_order(&view.projected, Some(normal), frame, depth, &mut view.exact);
                    }
                }
                let [hidden, sunken] = if is_solved { view.visible_set.left_out() } else { [0, below] };
                // Nothing is left out for the horizon's sake if that is not wanted.
                let (hidden, sunken) = if skips.below_horizon { (hidden, sunken) } else { (hidden + sunken, 0) };
                view.counts = Counts { above: view.projected.arcs.len(), hidden, sunken, ..Counts::default() };
            }
            _ => {
                self.project(receiver, skips, view);
                view.counts = Counts { above: view.projected.arcs.len(), ..Counts::default() };
                exact::solve(&view.projected, normal, frame, depth, &mut view.exact);
            }
        }
        view.exact.region()
    }

    /// By the contours of bodies that may be seen; returns whether the outcome is certain.
    fn solve_visible(&self, frame: u32, receiver: Receiver, normal: DVec3, skips: Skips, view: &mut View) -> bool {
        let View { excluded, tile, is_searched, visible_set, projected, exact, .. } = view;
        let wanted = self.wanted(receiver, skips, *tile, excluded, *is_searched);
        let eye = Eye { faces: self.faces, wanted, normal, frame };
        let View { beams, searches, candidates, contours, .. } = view;
        visible_set.solve(eye, &mut Found { beams, searches, candidates, contours }, projected, exact)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use dual_bvh::BuildOptions;
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::visibility::crossings::Crossings;
    use crate::visibility::open_spans;

    /// Number of triangles that a ray crosses, and how close (relative to the lengths involved) it passes to an edge.
    fn count(triangles: &[[DVec3; 3]], p: DVec3, w: DVec3) -> (usize, f64) {
        let (mut count, mut closest) = (0, f64::INFINITY);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|x| x - p);
            let sides = [(a, b), (b, c), (c, a)].map(|(a, b)| a.cross(b).dot(w) / (a.length() * b.length()));
            let facing = a.cross(b).dot(c);
            count += usize::from(sides.iter().all(|&s| s * facing > 0.0));
            closest = sides.iter().fold(closest, |closest, s| closest.min(s.abs()));
        }
        (count, closest)
    }

    /// Compares the intervals with counted rays at points of every isoline.
    fn agrees_with_rays(corners: &[[Vec3; 3]], p: DVec3, normal: Option<DVec3>) {
        let positions: Vec<Vec3> = corners.iter().flatten().copied().collect();
        let mut welded: Vec<Vec3> = Vec::new();
        let ids: Vec<u32> = positions
            .iter()
            .map(|x| {
                let id = welded.iter().position(|y| x == y).unwrap_or_else(|| {
                    welded.push(*x);
                    welded.len() - 1
                });
                id as u32
            })
            .collect();
        let faces: Vec<[u32; 3]> = ids.chunks(3).map(|f| [f[0], f[1], f[2]]).collect();
        let (welded, faces): (Arc<[Vec3]>, Arc<[[u32; 3]]>) = (welded.into(), faces.into());
        let edges = DualBvh::build(welded.clone(), faces.clone(), &BuildOptions::default()).unwrap();
        let tree = FaceTree::new(welded, faces);
        let viewer = Viewer { edges: &edges, faces: &tree };
        let receiver = Receiver { position: p, normal, excluded: &[] };
        let mut view = View::default();
        viewer.approach(std::iter::once(receiver), &mut view);
        let triangles: Vec<_> = corners.iter().map(|t| t.map(|x| x.as_dvec3())).collect();
        viewer.search(&mut view);
        spans_agree_with_rays(&triangles, &viewer, receiver, &mut view);
        halves_agree_with_rays(&triangles, &viewer, receiver, &mut view);
    }

    fn portable_crossings_are_the_same<C: Chart>(chart: &C, axes: DMat3, receiver: Receiver, view: &View) {
        let Receiver { position, normal, .. } = receiver;
        let outlook = Outlook { chart, axes, position, normal };
        let (mut widest, mut portable, mut narrower) =
            (Crossings::default(), Crossings::default(), Crossings::default());
        let mut contours = Contours::default();
        for part in view.candidates.parts() {
            widest.choose(outlook, &view.candidates, part, receiver.excluded, &mut contours, false);
            widest.cross(outlook, &view.candidates);
            portable.place_inline(outlook, &view.candidates, part);
            portable.add(position, &view.candidates, part, receiver.excluded, &mut contours, false);
            portable.cross_inline(outlook, &view.candidates);
            are_the_same(&mut widest, &mut portable, chart.lines());
            #[cfg(target_arch = "x86_64")]
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has the feature.
                unsafe {
                    narrower.place_avx2(outlook, &view.candidates, part);
                    narrower.add(position, &view.candidates, part, receiver.excluded, &mut contours, false);
                    narrower.cross_avx2(outlook, &view.candidates);
                }
                are_the_same(&mut widest, &mut narrower, chart.lines());
            }
        }
    }

    fn are_the_same<P: Copy>(one: &mut Crossings<P>, other: &mut Crossings<P>, lines: usize) {
        assert!((0..lines).all(|line| one.base(line) == other.base(line)));
        assert!((0..lines).all(|line| one.sorted(line) == other.sorted(line)));
        assert_eq!(one.counts(), other.counts());
    }

    /// Compares what is seen at a position of an isoline with counted rays.
    fn agrees_with_a_ray(
        triangles: &[[DVec3; 3]],
        receiver: Receiver,
        sight: Sight,
        spans: &Spans,
        (line, position): (usize, f64),
        w: DVec3,
    ) {
        let (depth, closest) = count(triangles, receiver.position, w);
        let height = receiver.normal.map_or(1.0, |n| n.dot(w));
        if closest < 1e-9 || height.abs() < 1e-9 {
            return;
        }
        let seen = match sight {
            Sight::Open => height > 0.0,
            Sight::Enclosed => false,
            Sight::Part(_) => spans.of(line).filter(|&end| spans.ends()[end] <= position).count() % 2 == 1,
        };
        assert_eq!(seen, depth == 0 && height > 0.0, "isoline {line}, {position}, depth {depth}, {w}");
    }

    /// At points of every meridian.
    fn spans_agree_with_rays(triangles: &[[DVec3; 3]], viewer: &Viewer, receiver: Receiver, view: &mut View) {
        let meridians = Meridians::new(14).unwrap();
        for second in [false, true] {
            let frame = MeridianFrame::facing(receiver.normal, second);
            portable_crossings_are_the_same(&meridians, frame.axes(), receiver, view);
            let sight = viewer.trace(&meridians, frame, receiver, Skips::default(), view);
            if let Sight::Part(sweep) = sight {
                assert_eq!(sweep.depth_alarms, 0);
            }
            for line in 0..meridians.len() {
                let (sin, cos) = meridians.u(line).sin_cos();
                for step in 0..47 {
                    let tangent = (std::f64::consts::PI * ((step as f64 + 0.387) / 47.0 - 0.5)).tan();
                    let w = frame.axes() * DVec3::new(cos, sin, tangent).normalize();
                    agrees_with_a_ray(triangles, receiver, sight, view.spans(), (line, tangent), w);
                }
            }
        }
    }

    /// At points of both halves of every octahedral isoline.
    fn halves_agree_with_rays(triangles: &[[DVec3; 3]], viewer: &Viewer, receiver: Receiver, view: &mut View) {
        let isolines = Isolines::new(14).unwrap();
        let mut open = Spans::default();
        for rank in 0..3 {
            let frame = Frame::facing(receiver.normal, rank);
            portable_crossings_are_the_same(&isolines, frame.axes(), receiver, view);
            let sight = viewer.follow(&isolines, frame, receiver, Skips::default(), view);
            if let Sight::Part(sweep) = sight {
                assert_eq!(sweep.depth_alarms, 0);
            }
            open_spans(&isolines, frame, receiver.normal, &mut open);
            for line in 0..2 * isolines.len() {
                let u = isolines.u(line % isolines.len());
                let side = if line < isolines.len() { 1.0 } else { -1.0 };
                for step in 0..46 {
                    let s = (step as f64 + 0.387) / 23.0;
                    let (y, z) = if s < 1.0 { (s, 1.0 - s) } else { (2.0 - s, 1.0 - s) };
                    let w = DVec3::X * u + (1.0 - u.abs()) * DVec3::new(0.0, side * y, z);
                    let w = frame.axes() * w.normalize();
                    agrees_with_a_ray(triangles, receiver, sight, view.spans(), (line, s), w);
                    let everything = Sight::Part(Sweep::default());
                    agrees_with_a_ray(&[], receiver, everything, &open, (line, s), w);
                }
            }
        }
    }

    fn vertex(grid: i32) -> impl Strategy<Value = Vec3> {
        (-grid..=grid, -grid..=grid, -grid..=grid).prop_map(move |(x, y, z)| Vec3::new(x as f32, y as f32, z as f32))
    }

    fn soup(grid: i32) -> impl Strategy<Value = Vec<[Vec3; 3]>> {
        let triangle = [vertex(grid), vertex(grid), vertex(grid)]
            .prop_filter("degenerate", |t| (t[1] - t[0]).cross(t[2] - t[0]) != Vec3::ZERO);
        prop::collection::vec(triangle, 1..12)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 300, max_global_rejects: 1 << 20, ..ProptestConfig::default() })]

        /// Everything coincides on a small grid: shared vertices and edges with any number of faces, vertices on isolines,
        /// on the chart's axes and at its poles.
        #[test]
        fn grids_agree_with_rays(triangles in soup(2), n in vertex(2), offset in 0..3) {
            let p = DVec3::new(0.31, 0.17, -0.23) * offset as f64;
            // A receiver on a face, to rounding, needs identities, which this soup does not have.
            prop_assume!(triangles.iter().all(|t| {
                let [a, b, c] = t.map(|x| x.as_dvec3());
                (b - a).cross(c - a).dot(p - a).abs() > 1e-9
            }));
            agrees_with_rays(&triangles, p, n.as_dvec3().try_normalize());
        }

        #[test]
        fn soups_agree_with_rays(triangles in soup(1000), n in vertex(1000)) {
            agrees_with_rays(&triangles, DVec3::ZERO, n.as_dvec3().try_normalize());
        }
    }

    #[test]
    fn a_receiver_inside_a_box_sees_nothing_and_a_hole_in_it_is_found() {
        let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0;
        let sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let walls: Vec<[Vec3; 3]> =
            sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|t| t.map(corner)).collect();
        let p = DVec3::new(0.2, 0.1, 0.3);
        for n in [DVec3::Z, DVec3::new(1.0, 2.0, 3.0).normalize()] {
            agrees_with_rays(&walls, p, Some(n));
            agrees_with_rays(&walls[1..], p, Some(n));
        }
        agrees_with_rays(&walls, p, None);
        agrees_with_rays(&walls[..11], p, None);
    }
}
