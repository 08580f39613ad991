//! The variational sphere set of a mesh: Wang, Zhou, Snyder, Liu, Bao, Peng and Guo 2006, *Variational sphere set
//! approximation for solid objects*.

use std::collections::HashSet;

use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;

use super::cover::{Ball, cover};
use super::solid::Solid;
use super::{MAX_SPHERES, Sphere, SphereSet, Tightness};
use crate::bake::Control;
use crate::scene::Geometry;
use crate::{Error, Result};

/// Fits `count` spheres to a mesh so that together they hold all of it and as little as possible of what is outside.
///
/// What is minimised is the sum over the spheres of the volume outside the mesh. Points of the surface and of the inside are
/// given to the sphere that they make the least larger, and every sphere is moved to where it holds its points with the
/// least volume outside, again and again (Lloyd's alternation). Then, sphere by sphere, only points that no other sphere
/// holds count; and the sphere whose points the others hold best is taken away and put where it helps most, as long as
/// the sum falls. At last the spheres grow until no part of any triangle is left out, see [`SphereSet::uncovered`].
///
/// The mesh may be in any state; what counts as its inside is then found by filling, see [`Tightness`]. The result does not
/// depend on the number of threads.
///
/// # Errors
/// No spheres or more than [`MAX_SPHERES`], a geometry without triangles, [`Error::Interrupted`] on `control`'s word.
pub fn fit(geometry: &Geometry, count: usize, control: &dyn Control) -> Result<(SphereSet, Tightness)> {
    if !(1..=MAX_SPHERES).contains(&count) {
        return Err(Error::input(format!("{count} spheres are asked for; a set has 1 to {MAX_SPHERES}")));
    }
    if geometry.triangles.is_empty() {
        return Err(Error::input("there is nothing to fit spheres to: no triangles"));
    }
    let solid = Solid::new(geometry);
    let mut fitting = Fitting::new(geometry, &solid, count);
    fitting.alternate(control)?;
    fitting.refine(control)?;
    fitting.teleport(control)?;
    fitting.refine(control)?;

    let mut balls = fitting.balls;
    for ball in &mut balls {
        // Rounded first, so that what is covered is covered by the spheres as they are kept.
        let rounded = ball.center.as_vec3().as_dvec3();
        ball.radius += rounded.distance(ball.center);
        ball.center = rounded;
    }
    cover(geometry, &mut balls, fitting.spacing / 16.0);
    let sphere = |ball: &Ball| {
        let radius = ball.radius as f32;
        let radius = if f64::from(radius) < ball.radius { radius.next_up() } else { radius };
        Sphere { center: ball.center.as_vec3(), radius, joint: None }
    };
    let set = SphereSet { spheres: balls.iter().map(sphere).collect(), joints: Vec::new() };
    let tightness = Tightness::of_solid(geometry, &solid, &set.spheres);
    Ok((set, tightness))
}

/// Points on the surface per sphere, and the least and the most of them.
const POINTS_PER_SPHERE: usize = 64;
const POINTS: [usize; 2] = [4000, 40_000];
/// Rounds of Lloyd's alternation. Gains are below a percent by then.
const ALTERNATIONS: u64 = 10;
/// Rounds of refinement.
const REFINEMENTS: u64 = 3;
/// Teleports that fail in a row before there are no more.
const FAILURES: usize = 12;
/// Spheres that a point considers, the nearest ones.
const CONSIDERED: usize = 8;
/// How much of a sphere's whole volume counts beside its volume outside. It decides between spheres that lie inside.
const WHOLE: f64 = 0.02;

/// The state of a fit.
struct Fitting<'a> {
    solid: &'a Solid,
    /// On the surface and inside.
    points: Vec<DVec3>,
    /// Distance between neighbouring points on the surface.
    spacing: f64,
    balls: Vec<Ball>,
    /// What is minimised, ball by ball.
    costs: Vec<f64>,
    /// How many balls hold every point.
    holders: Vec<u16>,
}

impl<'a> Fitting<'a> {
    fn new(geometry: &Geometry, solid: &'a Solid, count: usize) -> Self {
        let corners = (0..geometry.triangles.len() as u32).map(|t| geometry.corners(t));
        let area: f64 = corners.map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum();
        let wanted = (POINTS_PER_SPHERE * count).clamp(POINTS[0], POINTS[1]) as f64;
        let spacing = (area / wanted).sqrt().max(f64::from(f32::MIN_POSITIVE));
        let mut points = surface_samples(geometry, spacing);
        points.extend(solid.samples(spacing.max((solid.volume() / wanted).cbrt())));
        let balls = seeds(&points, count).into_iter().map(|center| Ball { center, radius: 0.0 }).collect();
        let holders = vec![0; points.len()];
        Self { solid, points, spacing, balls, costs: vec![0.0; count], holders }
    }

    fn cost(&self, ball: &Ball) -> f64 {
        self.solid.outside_volume(ball.center, ball.radius) + WHOLE * ball.radius.powi(3)
    }

    /// The ball around `center` that holds `points`; never without an extent.
    fn around(&self, center: DVec3, points: &[DVec3]) -> Ball {
        let farthest = points.iter().map(|p| p.distance_squared(center)).fold(0.0, f64::max);
        Ball { center, radius: farthest.sqrt().max(self.spacing / 4.0) * (1.0 + 4.0 * f64::EPSILON) }
    }

    /// The ball that holds `points` at the least cost near `start`: a search along the axes of a frame that turns from
    /// step to step, because the cost has ridges where another point becomes the farthest.
    fn least(&self, points: &[DVec3], start: DVec3) -> (Ball, f64) {
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.9, 0.7, 1.3)));
        let mut best = self.around(start, points);
        let mut cost = self.cost(&best);
        let enclosing = self.around(enclosing_center(points, start), points);
        let enclosing_cost = self.cost(&enclosing);
        if enclosing_cost < cost {
            (best, cost) = (enclosing, enclosing_cost);
        }
        let mut step = 0.25 * best.radius;
        let finest = step / 64.0;
        let mut frame = DMat3::IDENTITY;
        while step > finest {
            let mut improved = false;
            for direction in [frame.x_axis, frame.y_axis, frame.z_axis].into_iter().flat_map(|axis| [axis, -axis]) {
                let ball = self.around(best.center + step * direction, points);
                // Without any outside it would already cost more.
                if WHOLE * ball.radius.powi(3) >= cost {
                    continue;
                }
                let tried = self.cost(&ball);
                if tried < cost {
                    (best, cost, improved) = (ball, tried, true);
                }
            }
            frame = turn * frame;
            if !improved {
                step *= 0.5;
            }
        }
        (best, cost)
    }

    /// Lloyd's alternation from the seeds on.
    fn alternate(&mut self, control: &dyn Control) -> Result<()> {
        control.begin("clustering", ALTERNATIONS);
        for _ in 0..ALTERNATIONS {
            if control.cancelled() {
                return Err(Error::Interrupted);
            }
            let clusters = self.clusters();
            let this = &*self;
            let moved: Vec<(Ball, f64)> = (this.balls.par_iter().zip(&clusters))
                .map(|(ball, cluster)| this.least(cluster, ball.center))
                .collect();
            (self.balls, self.costs) = moved.into_iter().unzip();
            control.advance(1);
        }
        let balls = &self.balls;
        let count = |p: &DVec3| balls.iter().filter(|ball| ball.holds(*p)).count() as u16;
        self.holders = self.points.par_iter().map(count).collect();
        Ok(())
    }

    /// Gives every point to the ball that costs least when it just reaches the point.
    fn clusters(&self) -> Vec<Vec<DVec3>> {
        /// Radii at which a ball's cost is known; linear between.
        const KNOWN: usize = 16;
        let balls = &self.balls;
        let considered: Vec<Vec<(f64, u32)>> = (self.points.par_iter())
            .map(|p| {
                let mut distances: Vec<_> = (0u32..).zip(balls).map(|(i, b)| (b.center.distance(*p), i)).collect();
                if distances.len() > CONSIDERED {
                    distances.select_nth_unstable_by(CONSIDERED, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    distances.truncate(CONSIDERED);
                }
                distances
            })
            .collect();
        let mut reach = vec![self.spacing; balls.len()];
        for &(distance, i) in considered.iter().flatten() {
            reach[i as usize] = reach[i as usize].max(distance);
        }
        let costs: Vec<[f64; KNOWN + 1]> = (balls.par_iter().zip(&reach))
            .map(|(ball, reach)| {
                let radius = |k: usize| reach * k as f64 / KNOWN as f64;
                std::array::from_fn(|k| self.cost(&Ball { center: ball.center, radius: radius(k) }))
            })
            .collect();
        let cost = |&(distance, i): &(f64, u32)| {
            let (place, costs) = (distance / reach[i as usize] * KNOWN as f64, &costs[i as usize]);
            let k = (place as usize).min(KNOWN - 1);
            costs[k] + (place - k as f64) * (costs[k + 1] - costs[k])
        };
        let mut clusters = vec![Vec::new(); balls.len()];
        for (p, considered) in self.points.iter().zip(&considered) {
            let least = considered.iter().map(|choice| (cost(choice), choice.1)).min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, i)) = least {
                clusters[i as usize].push(*p);
            }
        }
        clusters
    }

    fn total(&self) -> f64 {
        self.costs.iter().sum()
    }

    /// The points that only one ball holds.
    fn only_in(&self, i: usize) -> Vec<DVec3> {
        let ball = self.balls[i];
        let points = self.points.iter().zip(&self.holders);
        points.filter(|&(p, &holders)| holders == 1 && ball.holds(*p)).map(|(p, _)| *p).collect()
    }

    fn put(&mut self, i: usize, (ball, cost): (Ball, f64)) {
        let before = std::mem::replace(&mut self.balls[i], ball);
        self.costs[i] = cost;
        for (p, holders) in self.points.iter().zip(&mut self.holders) {
            *holders = *holders + u16::from(ball.holds(*p)) - u16::from(before.holds(*p));
        }
    }

    /// Moves one ball to where it holds, at the least cost, the points that no other ball holds.
    fn refit(&mut self, i: usize) {
        let points = self.only_in(i);
        if points.is_empty() {
            return;
        }
        let moved = self.least(&points, self.balls[i].center);
        if moved.1 < self.costs[i] {
            self.put(i, moved);
        }
    }

    fn refine(&mut self, control: &dyn Control) -> Result<()> {
        control.begin("refining", REFINEMENTS * self.balls.len() as u64);
        for _ in 0..REFINEMENTS {
            let before = self.total();
            for i in 0..self.balls.len() {
                if control.cancelled() {
                    return Err(Error::Interrupted);
                }
                self.refit(i);
                control.advance(1);
            }
            if self.total() > 0.995 * before {
                break;
            }
        }
        Ok(())
    }

    /// Takes the ball whose points the others hold best and puts it where the most is outside, as long as that helps.
    fn teleport(&mut self, control: &dyn Control) -> Result<()> {
        let count = self.balls.len();
        if count < 2 {
            return Ok(());
        }
        let most = 2 * count.min(256) as u64;
        control.begin("teleporting", most);
        // Balls that were tried in vain since the last success.
        let mut tried = HashSet::new();
        for _ in 0..most {
            if control.cancelled() {
                return Err(Error::Interrupted);
            }
            let this = &*self;
            let share = |i: usize| {
                let held = this.points.iter().zip(&this.holders).filter(|(p, _)| this.balls[i].holds(**p));
                let (all, only) = held.fold((0u32, 0u32), |(all, only), (_, h)| (all + 1, only + u32::from(*h == 1)));
                f64::from(only) / f64::from(all.max(1))
            };
            let shares: Vec<f64> = (0..count).into_par_iter().map(share).collect();
            let free = (0..count).filter(|i| !tried.contains(i));
            let Some(taken) = free.min_by(|&i, &j| shares[i].total_cmp(&shares[j])) else { break };
            let worst = (0..count).filter(|&i| i != taken).max_by(|&i, &j| self.costs[i].total_cmp(&self.costs[j]));
            let Some(worst) = worst else { break };
            if self.moved(taken, worst) {
                tried.clear();
            } else {
                tried.insert(taken);
                if tried.len() > FAILURES {
                    break;
                }
            }
            control.advance(1);
        }
        Ok(())
    }

    /// Splits ball `worst` in two, one of which is ball `taken`; undone if it does not help.
    fn moved(&mut self, taken: usize, worst: usize) -> bool {
        let before = (self.balls.clone(), self.costs.clone(), self.holders.clone());
        let total = self.total();

        // Whoever has to grow least takes in what nobody holds any more.
        let orphans = self.only_in(taken);
        self.put(taken, (Ball { center: DVec3::INFINITY, radius: 0.0 }, 0.0));
        let mut adopted = vec![Vec::new(); self.balls.len()];
        for &p in &orphans {
            let growth = |i: usize| self.balls[i].center.distance(p).powi(3) - self.balls[i].radius.powi(3);
            let others = (0..self.balls.len()).filter(|&i| i != taken);
            if let Some(i) = others.min_by(|&i, &j| growth(i).total_cmp(&growth(j))) {
                adopted[i].push(p);
            }
        }
        let mut changed = Vec::new();
        for (i, adopted) in adopted.into_iter().enumerate().filter(|(_, adopted)| !adopted.is_empty()) {
            let points = [self.only_in(i), adopted].concat();
            let grown = self.least(&points, self.balls[i].center);
            self.put(i, grown);
            changed.push(i);
        }
        let halves = halves(&self.only_in(worst));
        for (i, half) in [worst, taken].into_iter().zip(&halves) {
            // Where there is nothing to share, the ball taken is left without anything to hold.
            let start = if half.is_empty() { self.balls[worst].center } else { mean(half) };
            let ball = self.least(half, start);
            self.put(i, ball);
            changed.push(i);
        }
        for i in changed {
            self.refit(i);
        }
        let helped = self.total() < total * (1.0 - 1e-4);
        if !helped {
            (self.balls, self.costs, self.holders) = before;
        }
        helped
    }
}

fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len() as f64
}

/// Where points are farthest apart they are divided, each going to the nearer of two means.
fn halves(points: &[DVec3]) -> [Vec<DVec3>; 2] {
    if points.is_empty() {
        return [Vec::new(), Vec::new()];
    }
    let farthest = |from: DVec3| {
        points
            .iter()
            .copied()
            .max_by(|a, b| a.distance_squared(from).total_cmp(&b.distance_squared(from)))
            .unwrap_or(from)
    };
    let first = farthest(mean(points));
    let mut means = [first, farthest(first)];
    let mut halves = [Vec::new(), Vec::new()];
    for _ in 0..4 {
        let is_second = |p: &&DVec3| p.distance_squared(means[1]) < p.distance_squared(means[0]);
        let (second, first) = points.iter().partition::<Vec<DVec3>, _>(is_second);
        halves = [first, second];
        if halves.iter().all(|half| !half.is_empty()) {
            means = [mean(&halves[0]), mean(&halves[1])];
        }
    }
    halves
}

/// Centre of a ball nearly as small as any that holds the points (Bădoiu and Clarkson 2003): again and again a step, ever
/// shorter, towards the farthest point.
fn enclosing_center(points: &[DVec3], start: DVec3) -> DVec3 {
    let mut center = if points.is_empty() { start } else { mean(points) };
    for i in 1..=24 {
        let farthest = points.iter().max_by(|a, b| a.distance_squared(center).total_cmp(&b.distance_squared(center)));
        center += (farthest.copied().unwrap_or(center) - center) / f64::from(i + 1);
    }
    center
}

/// Points far from each other: each the farthest from all before.
fn seeds(points: &[DVec3], count: usize) -> Vec<DVec3> {
    let mut distances = vec![f64::INFINITY; points.len()];
    let mut next = mean(points);
    let mut seeds = Vec::with_capacity(count);
    for _ in 0..count {
        seeds.push(next);
        for (distance, p) in distances.iter_mut().zip(points) {
            *distance = distance.min(p.distance_squared(next));
        }
        let farthest = (0..points.len()).max_by(|&i, &j| distances[i].total_cmp(&distances[j]));
        next = farthest.map_or(next, |i| points[i]);
    }
    seeds
}

/// Points all over the surface, about `spacing` apart: of a grid on every triangle, one to a cell of space.
fn surface_samples(geometry: &Geometry, spacing: f64) -> Vec<DVec3> {
    let mut taken = HashSet::new();
    let mut samples = Vec::new();
    for [a, b, c] in (0..geometry.triangles.len() as u32).map(|t| geometry.corners(t)) {
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let steps = (longest / spacing).ceil().max(1.0) as u32;
        for (i, j) in (0..=steps).flat_map(|i| (0..=steps - i).map(move |j| (i, j))) {
            let [u, v] = [i, j].map(|k| f64::from(k) / f64::from(steps));
            let p = a + u * (b - a) + v * (c - a);
            let cell = (p / (0.8 * spacing)).floor();
            if taken.insert(cell.to_array().map(|x| x as i64)) {
                samples.push(p);
            }
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

    use glam::{DAffine3, Vec3};

    use super::*;
    use crate::proxy::{enclosed_volume, outside_volume};
    use crate::scene::shapes::{Cuboid, Icosphere, Random, TorusKnot};
    use crate::scene::{GeometryBuilder, Mesh};

    fn geometry(meshes: impl IntoIterator<Item = (Mesh, DAffine3)>) -> Geometry {
        let mut builder = GeometryBuilder::default();
        meshes.into_iter().for_each(|(mesh, place)| builder.add(mesh, place).unwrap());
        builder.build()
    }

    fn alone(mesh: Result<Mesh>) -> Geometry {
        geometry([(mesh.unwrap(), DAffine3::IDENTITY)])
    }

    fn knot() -> Geometry {
        alone(TorusKnot { triangles: 1000, ..TorusKnot::default() }.mesh())
    }

    /// How far a point lies outside of all spheres.
    fn left_out(p: DVec3, set: &SphereSet) -> f64 {
        let distances = set.spheres.iter().map(|s| p.distance(s.center.as_dvec3()) - f64::from(s.radius));
        distances.fold(f64::INFINITY, f64::min)
    }

    /// Random points of random triangles all lie in some sphere.
    fn assert_bounds(geometry: &Geometry, set: &SphereSet) {
        let mut random = Random::new(11);
        for _ in 0..20_000 {
            let [a, b, c] = geometry.corners((random.unit() * geometry.triangles.len() as f64) as u32);
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let p = a + u * (b - a) + v * (c - a);
            assert!(left_out(p, set) <= 1e-12, "{p} is left out by {}", left_out(p, set));
        }
        assert_eq!(SphereSet::uncovered(geometry, &set.spheres, 1e-4), None);
    }

    #[test]
    fn one_sphere_is_the_sphere_around_a_ball() {
        let ball = alone(Icosphere { subdivisions: 3, ..Icosphere::default() }.mesh());
        let (set, tightness) = fit(&ball, 1, &()).unwrap();
        let sphere = set.spheres[0];
        assert!(sphere.center.length() < 5e-3 && (0.0..5e-3).contains(&(sphere.radius - 1.0)), "{sphere:?}");
        assert_bounds(&ball, &set);
        // All that is outside lies between the ball and its facets and in the radius beyond 1.
        let between = 4.0 / 3.0 * PI * f64::from(sphere.radius).powi(3) - enclosed_volume(&ball);
        assert!(tightness.is_exact && (tightness.total_outside() - between).abs() < 1e-9);
    }

    #[test]
    fn eight_spheres_come_within_a_tenth_of_one_in_every_corner_of_a_box() {
        let cube = alone(Cuboid { size: [2.0; 3], ..Cuboid::default() }.mesh());
        let (set, tightness) = fit(&cube, 8, &()).unwrap();
        assert_bounds(&cube, &set);
        let corner = outside_volume(&cube, DVec3::splat(0.5), 0.75f64.sqrt());
        assert!(tightness.total_outside() < 1.1 * 8.0 * corner, "{} for {}", tightness.total_outside(), 8.0 * corner);
        // The inside is held, too: of points at random none is far outside of all spheres.
        let mut random = Random::new(5);
        let mut inside = || DVec3::from_array([(); 3].map(|()| random.between(-1.0, 1.0)));
        assert!((0..5000).all(|_| left_out(inside(), &set) < 0.05));
    }

    #[test]
    fn more_spheres_follow_more_closely() {
        let knot = knot();
        let outside: Vec<f64> = [4, 16, 64]
            .into_iter()
            .map(|count| {
                let (set, tightness) = fit(&knot, count, &()).unwrap();
                assert_eq!(set.spheres.len(), count);
                assert_bounds(&knot, &set);
                tightness.total_outside() / tightness.volume
            })
            .collect();
        assert!(outside[1] < 0.7 * outside[0] && outside[2] < 0.3 * outside[1], "{outside:?}");
    }

    #[test]
    fn meshes_in_any_state_are_bounded() {
        let shifted = |x: f64| DAffine3::from_translation(DVec3::new(x, 0.2, 0.1));
        let cube = || Cuboid::default().mesh().unwrap();
        let mut turned = cube();
        turned.triangles.iter_mut().step_by(2).for_each(|t| t.swap(0, 1));
        let triangle = Mesh::new("triangle", vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        for mesh in [
            geometry([(cube(), DAffine3::IDENTITY), (cube(), shifted(0.5))]),
            geometry([(turned, DAffine3::IDENTITY)]),
            geometry([(triangle, DAffine3::IDENTITY)]),
            geometry([(cube(), DAffine3::from_scale(DVec3::splat(1e-12)))]),
            geometry([(cube(), DAffine3::from_translation(DVec3::splat(1e6)))]),
        ] {
            let (set, tightness) = fit(&mesh, 7, &()).unwrap();
            let diagonal = mesh.bounds().map_or(0.0, |[low, high]| f64::from(low.distance(high)));
            assert_eq!(SphereSet::uncovered(&mesh, &set.spheres, 1e-4 * diagonal), None);
            assert!(set.spheres.iter().all(|s| s.radius > 0.0 && s.radius.is_finite() && s.center.is_finite()));
            assert!(tightness.outside.iter().all(|v| *v >= 0.0 && v.is_finite()));
        }
    }

    #[test]
    fn threads_do_not_matter() {
        let knot = knot();
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| fit(&knot, 12, &()).unwrap().0)
        };
        assert_eq!(on(1), on(3));
    }

    #[test]
    fn what_makes_no_sense_is_refused_and_control_is_heeded() {
        struct StopAfter(AtomicU32);
        impl Control for StopAfter {
            fn advance(&self, _: u64) {
                self.0.fetch_sub(1, Relaxed);
            }
            fn cancelled(&self) -> bool {
                self.0.load(Relaxed) == 0
            }
        }
        let knot = knot();
        for steps in [0, 5, 12, 30] {
            let stopped = fit(&knot, 12, &StopAfter(AtomicU32::new(steps)));
            assert!(matches!(stopped, Err(Error::Interrupted)), "{steps}");
        }
        let message = |count| fit(&knot, count, &()).unwrap_err().to_string();
        assert_eq!(message(0), "0 spheres are asked for; a set has 1 to 4096");
        assert_eq!(message(5000), "5000 spheres are asked for; a set has 1 to 4096");
        let nothing = fit(&GeometryBuilder::default().build(), 1, &()).unwrap_err().to_string();
        assert!(nothing.contains("no triangles"), "{nothing}");
    }
}
