use std::cmp::Ordering;

use glam::DVec3;
use rayon::prelude::*;
use robust::{Coord, orient2d};

use super::cover::Ball;
use crate::scene::{EdgeKind, Geometry};

/// What lies inside a mesh, whatever state the mesh is in: along parallel lines, where they are inside.
///
/// The lines run along x over a square grid of [`LINES`] to the longest side of the bounds. Where the mesh is closed, wound
/// outwards and free of overlaps, a line is inside from where it enters to where it leaves. Any other mesh - open,
/// non-manifold, wound at random, of bodies that reach into each other - is looked at from the points of a grid. Inside
/// are those that cannot be reached from outside, going from one to the next as long as no face lies between them; and
/// those that most of six rays along the axes leave through the outsides of faces (after Nooruddin and Turk 2003). The former
/// need no winding and close holes smaller than a cell, the latter close larger ones; an open sheet encloses nothing.
pub(super) struct Solid {
    grid: Grid,
    /// Where the intervals of every line start, y first; and where the last one's end.
    first: Vec<u32>,
    /// Along x, ascending in every line.
    intervals: Vec<[f64; 2]>,
    /// Whether no filling was needed.
    is_clean: bool,
}

/// Lines along the longest side.
const LINES: f64 = 192.0;

/// A line meets a face here.
#[derive(Clone, Copy)]
struct Crossing {
    line: u32,
    at: f64,
    /// Whether the line leaves through the face's outside.
    leaves: bool,
}

impl Solid {
    pub(super) fn new(geometry: &Geometry) -> Self {
        let grid = Grid::around(geometry);
        let crossings = grid.crossings(geometry, 0);
        let topology = geometry.topology();
        let alternate = |line: &[Crossing]| {
            line.len().is_multiple_of(2) && line.iter().enumerate().all(|(i, crossing)| crossing.leaves == (i % 2 == 1))
        };
        let is_clean = topology.count(EdgeKind::Manifold) == topology.edges().len()
            && crossings.chunk_by(|a, b| a.line == b.line).all(alternate);
        let inside = if is_clean { Vec::new() } else { grid.inside(geometry, &crossings) };

        let mut first = Vec::with_capacity(grid.lines() + 1);
        let mut intervals = Vec::new();
        let mut rest = &crossings[..];
        for line in 0..grid.lines() {
            first.push(intervals.len() as u32);
            let (here, others) = rest.split_at(rest.partition_point(|crossing| crossing.line as usize == line));
            rest = others;
            if is_clean {
                intervals.extend(here.chunks_exact(2).map(|pair| [pair[0].at, pair[1].at]));
            } else {
                let cells = grid.counts[0];
                grid.stretches(&inside[line * cells..(line + 1) * cells], here, &mut intervals);
            }
        }
        first.push(intervals.len() as u32);
        Self { grid, first, intervals, is_clean }
    }

    /// Whether the mesh is closed, wound outwards and free of overlaps, as far as the lines can see.
    pub(super) fn is_clean(&self) -> bool {
        self.is_clean
    }

    /// Volume, by the midpoint rule over the lines.
    pub(super) fn volume(&self) -> f64 {
        self.grid.pitch.powi(2) * self.intervals.iter().map(|[from, to]| to - from).sum::<f64>()
    }

    /// Volume of the part of a ball that lies outside, by the midpoint rule over the lines that meet the ball.
    pub(super) fn outside_volume(&self, center: DVec3, radius: f64) -> f64 {
        let mut outside = 0.0;
        self.grid.for_lines_through(center, radius, |line, half| {
            let chord = [center.x - half, center.x + half];
            outside += 2.0 * half - line.map_or(0.0, |line| self.within(line, chord));
        });
        self.grid.pitch.powi(2) * outside
    }

    /// Volume of the part of a union of balls that lies outside.
    pub(super) fn union_outside_volume(&self, balls: &[Ball]) -> f64 {
        let mut chords = vec![Vec::new(); self.grid.lines()];
        let mut beyond = 0.0;
        for &Ball { center, radius } in balls {
            self.grid.for_lines_through(center, radius, |line, half| match line {
                Some(line) => chords[line].push([center.x - half, center.x + half]),
                // Only where balls reach out of the bounds by more than a line do they overlap uncounted.
                None => beyond += 2.0 * half,
            });
        }
        let outside = |(line, chords): (usize, &mut Vec<[f64; 2]>)| {
            chords.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
            let mut outside = 0.0;
            let mut end = f64::NEG_INFINITY;
            for &[from, to] in chords.iter() {
                let from = from.max(end);
                if to > from {
                    outside += to - from - self.within(line, [from, to]);
                    end = to;
                }
            }
            outside
        };
        let lines: f64 = chords.iter_mut().enumerate().map(outside).sum();
        self.grid.pitch.powi(2) * (lines + beyond)
    }

    /// Length of the part of `chord` that lies inside.
    fn within(&self, line: usize, [low, high]: [f64; 2]) -> f64 {
        let intervals = &self.intervals[self.first[line] as usize..self.first[line + 1] as usize];
        intervals.iter().map(|[from, to]| (to.min(high) - from.max(low)).max(0.0)).sum()
    }

    /// Points inside, about `spacing` apart. A stretch shorter than that gets one in its middle.
    pub(super) fn samples(&self, spacing: f64) -> Vec<DVec3> {
        let step = (spacing / self.grid.pitch).round().max(1.0) as usize;
        let spacing = self.grid.pitch * step as f64;
        let mut points = Vec::new();
        let [_, rows, columns] = self.grid.counts;
        for (y, z) in (0..columns).step_by(step).flat_map(|z| (0..rows).step_by(step).map(move |y| (y, z))) {
            let line = z * rows + y;
            let (y, z) = (self.grid.center(1, y), self.grid.center(2, z));
            for [from, to] in &self.intervals[self.first[line] as usize..self.first[line + 1] as usize] {
                let count = ((to - from) / spacing).ceil().max(1.0);
                let at = (0..count as usize).map(|i| from + (to - from) * (i as f64 + 0.5) / count);
                points.extend(at.map(|x| DVec3::new(x, y, z)));
            }
        }
        points
    }
}

/// Points in the space around a mesh. They start at odd fractions of a cell so that faces on round coordinates lie between.
struct Grid {
    start: DVec3,
    pitch: f64,
    counts: [usize; 3],
}

impl Grid {
    fn around(geometry: &Geometry) -> Self {
        let [low, high] = geometry.bounds().unwrap_or_default().map(|p| p.as_dvec3());
        let pitch = ((high - low).max_element() / LINES).max(f64::from(f32::MIN_POSITIVE));
        let start = low - pitch * DVec3::new(0.618_033_988, 0.754_877_666, 0.569_840_290);
        let counts = ((high - start) / pitch).to_array().map(|cells| cells as usize + 2);
        Self { start, pitch, counts }
    }

    fn lines(&self) -> usize {
        self.counts[1] * self.counts[2]
    }

    fn center(&self, axis: usize, index: usize) -> f64 {
        self.start[axis] + self.pitch * index as f64
    }

    /// Index of the last point at or before `x`.
    fn before(&self, axis: usize, x: f64) -> usize {
        (((x - self.start[axis]) / self.pitch).max(0.0) as usize).min(self.counts[axis] - 2)
    }

    /// Where the lines along `axis` meet faces, by line and place.
    fn crossings(&self, geometry: &Geometry, axis: usize) -> Vec<Crossing> {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let of_face = |t: u32| {
            let corners @ [a, b, c] = geometry.corners(t);
            let range = |axis: usize| {
                let (low, high) = (a.min(b).min(c)[axis], a.max(b).max(c)[axis]);
                let first = ((low - self.start[axis]) / self.pitch).ceil().max(0.0) as usize;
                first..(((high - self.start[axis]) / self.pitch).floor() + 1.0).max(0.0) as usize
            };
            let mut found = Vec::new();
            for (i, j) in range(u).flat_map(|i| range(v).map(move |j| (i, j))) {
                let at = Coord { x: self.center(u, i), y: self.center(v, j) };
                let flat = corners.map(|p| Coord { x: p[u], y: p[v] });
                let sides = [0, 1, 2].map(|k| side(flat[k], flat[(k + 1) % 3], at));
                if sides[0] != sides[1] || sides[1] != sides[2] {
                    continue;
                }
                let normal = (b - a).cross(c - a);
                let depth = if normal[axis] == 0.0 {
                    (a + b + c)[axis] / 3.0
                } else {
                    a[axis] - (normal[u] * (at.x - a[u]) + normal[v] * (at.y - a[v])) / normal[axis]
                };
                let depth = depth.clamp(a.min(b).min(c)[axis], a.max(b).max(c)[axis]);
                // Lines are counted along the lower of the two other axes first.
                let line = if axis == 1 { i * self.counts[v] + j } else { j * self.counts[u] + i };
                found.push(Crossing { line: line as u32, at: depth, leaves: sides[0] });
            }
            found
        };
        let mut crossings: Vec<Crossing> =
            (0..geometry.triangles.len() as u32).into_par_iter().flat_map_iter(of_face).collect();
        let order =
            |a: &Crossing, b: &Crossing| a.line.cmp(&b.line).then(a.at.total_cmp(&b.at)).then(a.leaves.cmp(&b.leaves));
        crossings.par_sort_unstable_by(order);
        crossings
    }

    /// Which points are inside, x first.
    fn inside(&self, geometry: &Geometry, along_x: &[Crossing]) -> Vec<bool> {
        let [nx, ny, nz] = self.counts;
        let strides = [1, nx, nx * ny];
        let mut blocked = vec![0u8; nx * ny * nz];
        let mut votes = vec![0u8; blocked.len()];
        for axis in 0..3 {
            let found;
            let crossings = if axis == 0 {
                along_x
            } else {
                found = self.crossings(geometry, axis);
                &found
            };
            for crossings in crossings.chunk_by(|a, b| a.line == b.line) {
                let line = crossings[0].line as usize;
                let base = match axis {
                    0 => line * nx,
                    1 => line / nx * strides[2] + line % nx,
                    _ => line,
                };
                let step = |crossing: &Crossing| if crossing.leaves { 1 } else { -1 };
                let mut ahead: i32 = crossings.iter().map(step).sum();
                let mut behind = 0;
                let mut rest = crossings;
                for i in 0..self.counts[axis] - 1 {
                    let point = base + i * strides[axis];
                    votes[point] += u8::from(ahead > 0) + u8::from(behind > 0);
                    let (here, others) = rest.split_at(rest.partition_point(|c| self.before(axis, c.at) <= i));
                    rest = others;
                    blocked[point] |= u8::from(!here.is_empty()) << axis;
                    let passed: i32 = here.iter().map(step).sum();
                    (ahead, behind) = (ahead - passed, behind - passed);
                }
            }
        }

        let mut reached = vec![false; blocked.len()];
        let mut pending = vec![0];
        reached[0] = true;
        while let Some(point) = pending.pop() {
            let place = [point % nx, point / nx % ny, point / strides[2]];
            for axis in 0..3 {
                let mut visit = |next: usize| {
                    if !std::mem::replace(&mut reached[next], true) {
                        pending.push(next);
                    }
                };
                if place[axis] + 1 < self.counts[axis] && blocked[point] >> axis & 1 == 0 {
                    visit(point + strides[axis]);
                }
                if place[axis] > 0 && blocked[point - strides[axis]] >> axis & 1 == 0 {
                    visit(point - strides[axis]);
                }
            }
        }
        reached.iter().zip(votes).map(|(reached, votes)| !reached || votes > 3).collect()
    }

    /// The stretches of a line that are inside: from the first face before a point inside to the last one after, halfway
    /// between two points where there is none.
    fn stretches(&self, inside: &[bool], crossings: &[Crossing], intervals: &mut Vec<[f64; 2]>) {
        let between = |i: usize| crossings.iter().filter(move |crossing| self.before(0, crossing.at) == i);
        let middle = |i: usize| self.center(0, i) + 0.5 * self.pitch;
        let mut from = None;
        for i in 0..inside.len() - 1 {
            match (inside[i], inside[i + 1]) {
                (false, true) => from = Some(between(i).next().map_or(middle(i), |crossing| crossing.at)),
                (true, false) => {
                    let to = between(i).next_back().map_or(middle(i), |crossing| crossing.at);
                    intervals.extend(from.take().map(|from| [from, to]));
                }
                _ => {}
            }
        }
    }

    /// Visits the lines that meet a ball with half the length of their chord; `None` for a line beyond the grid.
    fn for_lines_through(&self, center: DVec3, radius: f64, mut visit: impl FnMut(Option<usize>, f64)) {
        let range = |axis: usize, half: f64| {
            let first = ((center[axis] - half - self.start[axis]) / self.pitch).ceil() as i64;
            first..=((center[axis] + half - self.start[axis]) / self.pitch).floor() as i64
        };
        let [_, rows, columns] = self.counts.map(|count| count as i64);
        for z in range(2, radius) {
            let across = radius * radius - (self.start.z + self.pitch * z as f64 - center.z).powi(2);
            for y in range(1, across.max(0.0).sqrt()) {
                let half = (across - (self.start.y + self.pitch * y as f64 - center.y).powi(2)).max(0.0).sqrt();
                let is_within = (0..rows).contains(&y) && (0..columns).contains(&z);
                visit(is_within.then_some((z * rows + y) as usize), half);
            }
        }
    }
}

/// Whether `p` lies to the left of the line from `a` to `b`. Every point has one side of a line, whichever way the line
/// runs.
fn side(a: Coord<f64>, b: Coord<f64>, p: Coord<f64>) -> bool {
    let order = a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y));
    if order == Ordering::Greater { orient2d(b, a, p) < 0.0 } else { orient2d(a, b, p) >= 0.0 }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DAffine3;

    use super::*;
    use crate::proxy::outside_volume;
    use crate::scene::shapes::{Cuboid, Icosphere, Plane, Random, TorusKnot};
    use crate::scene::{GeometryBuilder, Mesh};

    fn solid(meshes: impl IntoIterator<Item = Mesh>) -> Solid {
        let mut builder = GeometryBuilder::default();
        meshes.into_iter().for_each(|mesh| builder.add(mesh, DAffine3::IDENTITY).unwrap());
        Solid::new(&builder.build())
    }

    fn cuboid(size: [f64; 3], at: DVec3) -> Mesh {
        Cuboid { size, ..Cuboid::default() }.mesh().unwrap().transformed(DAffine3::from_translation(at))
    }

    #[test]
    fn volumes_of_meshes_in_any_state() {
        // Along y and z a volume is as good as the pitch, of which there are 192 to the longest side.
        let is = |meshes: Vec<Mesh>, volume: f64, clean: bool| {
            let solid = solid(meshes);
            assert_eq!(solid.is_clean(), clean);
            assert!((solid.volume() - volume).abs() < 0.02 * volume + 1e-9, "{} for {volume}", solid.volume());
        };
        let cube = || cuboid([1.0; 3], DVec3::ZERO);
        is(vec![cube()], 1.0, true);
        is(vec![cuboid([2.0, 1.0, 0.5], DVec3::ONE)], 1.0, true);
        is(vec![cube(), cuboid([1.0; 3], DVec3::new(0.5, 0.0, 0.0))], 1.5, false);
        is(vec![cube(), cuboid([0.5; 3], DVec3::ZERO)], 1.0, false);
        let mut inverted = cube();
        inverted.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        is(vec![inverted], 1.0, false);
        let mut mixed = cube();
        mixed.triangles.iter_mut().step_by(2).for_each(|t| t.swap(0, 1));
        is(vec![mixed], 1.0, false);
        // One of six sides is missing, and two that are opposite.
        let mut open = cube();
        open.triangles.drain(..2);
        is(vec![open.clone()], 1.0, false);
        is(vec![Plane::default().mesh().unwrap()], 0.0, false);
    }

    #[test]
    fn outside_volume_agrees_with_the_closed_form() {
        let knot = TorusKnot { triangles: 2000, ..TorusKnot::default() }.mesh().unwrap();
        let mut builder = GeometryBuilder::default();
        builder.add(knot.clone(), DAffine3::IDENTITY).unwrap();
        let (geometry, solid) = (builder.build(), solid([knot]));
        let mut random = Random::new(9);
        for _ in 0..20 {
            let center = geometry.positions[(random.unit() * 900.0) as usize].as_dvec3() + 0.3 * random.in_ball();
            let radius = random.between(0.2, 1.5);
            let (found, exact) = (solid.outside_volume(center, radius), outside_volume(&geometry, center, radius));
            let ball = 4.0 / 3.0 * PI * radius.powi(3);
            assert!((found - exact).abs() < 0.01 * ball, "{center} {radius}: {found} for {exact}");
        }
    }

    #[test]
    fn unions_count_what_is_shared_once() {
        let solid = solid([Icosphere::default().mesh().unwrap()]);
        let ball = |x: f64| Ball { center: DVec3::new(x, 0.0, 0.0), radius: 1.0 };
        let alone = solid.union_outside_volume(&[ball(0.0)]);
        assert!((alone - solid.outside_volume(DVec3::ZERO, 1.0)).abs() < 1e-9);
        assert!((solid.union_outside_volume(&[ball(0.0), ball(0.0)]) - alone).abs() < 1e-9);
        // Two unit balls a unit apart overlap in 5 pi/12, of which the first lies inside.
        let both = solid.union_outside_volume(&[ball(0.0), ball(1.0)]);
        let expected = 4.0 / 3.0 * PI - 5.0 / 12.0 * PI;
        assert!((both - alone - expected).abs() < 0.01 * expected, "{both} {alone}");
    }

    #[test]
    fn samples_lie_inside_and_are_as_many_as_their_cells() {
        let solid = solid([cuboid([1.0; 3], DVec3::ZERO)]);
        let samples = solid.samples(0.1);
        assert!(samples.iter().all(|p| p.abs().max_element() < 0.5));
        assert!((800..1400).contains(&samples.len()), "{}", samples.len());
    }
}
