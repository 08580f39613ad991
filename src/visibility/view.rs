use dual_bvh::{Candidates, Contours, DualBvh, Tile};
use glam::DVec3;

use super::crossings::Crossings;
use super::depth::{count_along, count_on_spine};
use super::exact::{self, Region};
use super::meridians::Outlook;
use super::sweep::{Interval, Sweep, base_line, sweep};
use super::trace::{Look, Tracer};
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
    /// Part of it: the intervals that were reported.
    Part(Sweep),
}

/// Working memory for one thread: reused, so that nothing is allocated from one receiver to the next.
#[derive(Default)]
pub struct View {
    excluded: Vec<u32>,
    /// The tile approached, without the faces it excludes.
    tile: Option<Tile<'static>>,
    /// Whether all groups have been searched for it, one after another.
    is_searched: bool,
    candidates: Candidates,
    contours: Contours,
    projected: ReceiverContours,
    crossings: Crossings,
    tracer: Tracer,
    exact: exact::Scratch,
}

impl View {
    /// Contours that the last receiver projected had above its horizon.
    pub fn contours(&self) -> &ReceiverContours {
        &self.projected
    }

    /// The visible spans of the last receiver that was looked at along meridians.
    pub fn spans(&self) -> &Spans {
        self.tracer.spans()
    }

    /// What became of that receiver's contours.
    pub fn counts(&self) -> Counts {
        self.tracer.counts()
    }

    #[cfg(test)]
    pub(super) fn tracer(&mut self) -> &mut Tracer {
        &mut self.tracer
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
        view.tracer.begin(self.edges, receivers.clone().count());
        let tile = Tile::new(receivers.map(|r| (r.position, r.normal)));
        view.tile = Some(tile);
        view.is_searched = false;
        self.edges.begin(&tile.with_faces(&view.excluded), &mut view.candidates);
    }

    /// Searches all edges that may be contours for any of the receivers approached.
    pub fn search(&self, view: &mut View) {
        if let (Some(tile), false) = (view.tile, view.is_searched) {
            // Also what has been searched already, so that the order is always the same.
            self.edges.search(&tile.with_faces(&view.excluded), &mut view.candidates);
            view.is_searched = true;
        }
    }

    /// Finds and projects all contours of a receiver among those approached, which may then [`follow`](Self::follow) or
    /// [`solve`](Self::solve).
    pub fn face(&self, Receiver { position, normal, excluded }: Receiver, view: &mut View) {
        self.search(view);
        view.candidates.contours(position, excluded, &mut view.contours);
        view.projected.project(&view.candidates, &view.contours, position, normal);
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
        let Receiver { position, normal, excluded } = receiver;
        let outlook = Outlook { meridians, frame, position, normal };
        if view.tile.is_none() {
            self.approach(std::iter::once(receiver), view);
        }
        let tile = view.tile.unwrap_or(Tile::lone(position, normal)).with_faces(&view.excluded);
        let look = Look {
            edges: self.edges,
            faces: self.faces,
            outlook,
            excluded,
            tile,
            is_searched: view.is_searched,
            skips,
        };
        view.tracer.trace(look, &mut view.candidates, &mut view.contours)
    }

    /// What the receiver just faced sees along the isolines: their visible intervals.
    pub fn follow(
        &self,
        isolines: &Isolines,
        frame: Frame,
        receiver: Receiver,
        view: &mut View,
        visible: impl FnMut(Interval),
    ) -> Sight {
        let Receiver { position, normal, excluded } = receiver;
        let line = base_line(isolines, frame, normal);
        let depth = count_on_spine(self.faces, isolines, frame, position, excluded, line);
        if view.projected.arcs.is_empty() {
            return if depth == 0 { Sight::Open } else { Sight::Enclosed };
        }
        view.crossings.collect(isolines, frame, &view.projected);
        Sight::Part(sweep(isolines, frame, &view.crossings, normal, (line, depth), visible))
    }

    /// What the receiver just faced sees, exactly: its visible region, solved in the chart numbered `frame`.
    pub fn solve<'v>(&self, frame: u32, receiver: Receiver, view: &'v mut View) -> &'v Region {
        let Receiver { position, normal, excluded } = receiver;
        let depth = |w| count_along(self.faces, position, excluded, w);
        exact::solve(&view.projected, normal, frame, depth, &mut view.exact)
    }
}

/// The intervals of a receiver that sees everything above its horizon.
pub fn open_intervals(isolines: &Isolines, frame: Frame, normal: Option<DVec3>, visible: impl FnMut(Interval)) {
    let mut nothing = Crossings::default();
    nothing.collect(isolines, frame, &ReceiverContours::default());
    sweep(isolines, frame, &nothing, normal, (base_line(isolines, frame, normal), 0), visible);
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use dual_bvh::BuildOptions;
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::visibility::{cycle, meridians};

    const CORNERS: [DVec3; 5] = [DVec3::Z, DVec3::Y, DVec3::NEG_Z, DVec3::NEG_Y, DVec3::Z];

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
        let isolines = Isolines::new(14).unwrap();
        let viewer = Viewer { edges: &edges, faces: &tree };
        let receiver = Receiver { position: p, normal, excluded: &[] };
        let mut view = View::default();
        viewer.approach(std::iter::once(receiver), &mut view);
        let triangles: Vec<_> = corners.iter().map(|t| t.map(|x| x.as_dvec3())).collect();
        spans_agree_with_rays(&triangles, &viewer, receiver, &mut view);
        let mut intervals = Vec::new();
        viewer.face(receiver, &mut view);
        let frame = Frame::facing(normal, 0);
        match viewer.follow(&isolines, frame, receiver, &mut view, |interval| intervals.push(interval)) {
            Sight::Open => open_intervals(&isolines, frame, normal, |interval| intervals.push(interval)),
            Sight::Enclosed => {}
            Sight::Part(sweep) => assert_eq!(sweep.depth_alarms, 0),
        }
        let axis = frame.axis();
        for line in 0..isolines.len() {
            let u = isolines.u(line);
            for quadrant in 0..4 {
                for step in 0..23 {
                    let f = (step as f64 + 0.387) / 23.0;
                    let ends = [CORNERS[quadrant], CORNERS[quadrant + 1]];
                    let chart = DVec3::X * u + (1.0 - u.abs()) * ends[0].lerp(ends[1], f);
                    let w = cycle(chart, (3 - axis) % 3).normalize();
                    let height = normal.map_or(1.0, |n| n.dot(w));
                    let (depth, closest) = count(&triangles, p, w);
                    if closest < 1e-9 || height.abs() < 1e-9 {
                        continue;
                    }
                    let seen =
                        intervals.iter().any(|i| (i.line, i.quadrant) == (line, quadrant) && i.from <= f && f <= i.to);
                    assert_eq!(seen, depth == 0 && height > 0.0, "line {line} quadrant {quadrant} f {f} depth {depth}");
                }
            }
        }
    }

    fn portable_crossings_are_the_same(meridians: &Meridians, frame: MeridianFrame, receiver: Receiver, view: &View) {
        let Receiver { position, normal, .. } = receiver;
        let outlook = Outlook { meridians, frame, position, normal };
        let (mut one, mut other) = (meridians::Crossings::default(), meridians::Crossings::default());
        let mut contours = Contours::default();
        for part in view.candidates.parts() {
            view.candidates.contours_in(part, position, receiver.excluded, &mut contours);
            one.choose(outlook, &view.candidates, part, &contours, false);
            one.cross(outlook, &view.candidates);
            other.choose_inline(outlook, &view.candidates, part, &contours, false);
            other.cross_inline(outlook, &view.candidates);
            assert!((0..meridians.len()).all(|line| one.sorted(line) == other.sorted(line)));
            assert_eq!(one.counts(), other.counts());
        }
    }

    /// Compares the spans with counted rays at points of every meridian.
    fn spans_agree_with_rays(triangles: &[[DVec3; 3]], viewer: &Viewer, receiver: Receiver, view: &mut View) {
        let meridians = Meridians::new(14).unwrap();
        viewer.search(view);
        for second in [false, true] {
            let frame = MeridianFrame::facing(receiver.normal, second);
            portable_crossings_are_the_same(&meridians, frame, receiver, view);
            let sight = viewer.trace(&meridians, frame, receiver, Skips::default(), view);
            if let Sight::Part(sweep) = sight {
                assert_eq!(sweep.depth_alarms, 0);
            }
            for line in 0..meridians.len() {
                let (sin, cos) = meridians.u(line).sin_cos();
                for step in 0..47 {
                    let tangent = (std::f64::consts::PI * ((step as f64 + 0.387) / 47.0 - 0.5)).tan();
                    let w = frame.axes() * DVec3::new(cos, sin, tangent).normalize();
                    let (depth, closest) = count(triangles, receiver.position, w);
                    let height = receiver.normal.map_or(1.0, |n| n.dot(w));
                    if closest < 1e-9 || height < 1e-9 {
                        continue;
                    }
                    let seen = match sight {
                        Sight::Open => true,
                        Sight::Enclosed => false,
                        Sight::Part(_) => {
                            let before =
                                view.spans().of(line).filter(|&end| view.spans().ends()[end] <= tangent).count();
                            before % 2 == 1
                        }
                    };
                    assert_eq!(seen, depth == 0, "meridian {line}, tangent {tangent}, depth {depth}, {frame:?}");
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
