//! What the set that stands still hides from bodies that move through it: probes of its visibility on a grid, interpolated.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Surface;
use crate::bake::{Control, Method, Prepared, Receivers, Request};
use crate::reference::first_hit;
use crate::scene::Geometry;
use crate::sphere::{Order, TripleProduct, clamped_cosine};
use crate::{Error, Result};

/// Probes around moving bodies: at the corners of cubes, integrated when a body first comes near.
///
/// A vertex takes the visibility of the eight corners around it, trilinearly, in two bands more than are asked for, times the
/// clamped cosine about its normal. Corners that the set hides from the part of the body in their cube, such as those behind a wall
/// or under the floor, are left out. What varies within a cube is smoothed: shadows of the set on bodies are as sharp as the
/// spacing, and their bands, allow.
pub struct Probes<'a> {
    prepared: Prepared<'a>,
    method: Method,
    spacing: f64,
    order: Order,
    /// Bands of the visibility.
    inner: Order,
    terms: Vec<Term>,
    /// Visibility all around, by the corner's place on the grid.
    known: HashMap<Corner, Vec<f32>>,
}

/// A corner of a cube, or the cube above, to the right and in front of it.
type Corner = [i64; 3];

/// A term of the product of visibility and cosine.
struct Term {
    visibility: u8,
    cosine: u8,
    out: u8,
    value: f32,
}

/// Where the grid's origin lies, in units of its spacing: not in a plane of the axes, in which scenes have floors.
const ORIGIN: DVec3 = DVec3::new(0.37, 0.41, 0.43);

impl<'a> Probes<'a> {
    /// Probes of a scene's geometry, `spacing` apart, for transfer vectors of `order`, at most eight bands.
    pub fn new(geometry: &'a Geometry, spacing: f64, order: Order, method: Method) -> Result<Self> {
        if !(spacing.is_finite() && spacing > 0.0) {
            return Err(Error::input(format!("probes must be a positive distance apart, not {spacing}")));
        }
        let inner = Order::new(order.bands() + 2)?;
        let mut terms = Vec::new();
        let cosine = clamped_cosine(inner, DVec3::Z);
        // The cosine has no odd bands above the first.
        let is_there = |j: u8| cosine[usize::from(j).isqrt() * (usize::from(j).isqrt() + 1)].abs() > 1e-12;
        for entry in TripleProduct::new(inner).entries().iter().filter(|entry| usize::from(entry.k) < order.len()) {
            let pairs = [(entry.i, entry.j), (entry.j, entry.i)];
            for (visibility, cosine) in pairs.into_iter().take(if entry.i == entry.j { 1 } else { 2 }) {
                if is_there(cosine) {
                    terms.push(Term { visibility, cosine, out: entry.k, value: entry.value as f32 });
                }
            }
        }
        let (prepared, known) = (Prepared::new(geometry, None), HashMap::new());
        Ok(Self { prepared, method, spacing, order, inner, terms, known })
    }

    /// Probes integrated so far.
    pub fn count(&self) -> usize {
        self.known.len()
    }

    /// Gives the vertices of bodies transfer vectors: what the set leaves them of the sky. Where there is no probe yet one is
    /// integrated.
    ///
    /// # Errors
    /// As [`Prepared::integrate`]; [`Error::Interrupted`] if `control` stops it.
    pub fn shade(&mut self, bodies: &mut [Surface], control: &dyn Control) -> Result<()> {
        // The middle of all vertices in every cube stands for the body there.
        let mut cubes: BTreeMap<Corner, (DVec3, f64)> = BTreeMap::new();
        for p in bodies.iter().flat_map(|body| &body.positions) {
            let (sum, count) = cubes.entry(self.place(*p).0).or_default();
            (*sum, *count) = (*sum + p.as_dvec3(), *count + 1.0);
        }
        let wanted: BTreeSet<Corner> = cubes.keys().flat_map(|cube| corners(*cube)).collect();
        self.integrate(wanted.into_iter().filter(|corner| !self.known.contains_key(corner)).collect(), control)?;
        let this = &*self;
        let seen: HashMap<Corner, [bool; 8]> = cubes
            .into_par_iter()
            .map(|(cube, (sum, count))| {
                (cube, corners(cube).map(|corner| this.sees(sum / count, this.position(corner))))
            })
            .collect();
        for body in bodies {
            let vertices = body.positions.par_iter().zip(&body.normals);
            body.transfer = vertices.flat_map_iter(|(p, n)| this.transfer(*p, *n, &seen)).collect();
            body.transfer_len = this.order.len();
        }
        Ok(())
    }

    fn integrate(&mut self, corners: Vec<Corner>, control: &dyn Control) -> Result<()> {
        if corners.is_empty() {
            return Ok(());
        }
        let receivers = Receivers::probes(corners.iter().map(|corner| self.position(*corner)).collect());
        let request = Request { order: self.inner.bands(), visibility_sh: true, ..Request::default() };
        let outcome = self.prepared.integrate(&receivers, &request, self.method, None, control)?;
        if !outcome.done.iter().all(|done| *done) {
            return Err(Error::Interrupted);
        }
        let visibility = outcome.arrays.get("visibility_sh").expect("was asked for");
        let rows = visibility.data.chunks_exact(self.inner.len()).map(|row| row.iter().map(|x| *x as f32).collect());
        self.known.extend(corners.into_iter().zip(rows));
        Ok(())
    }

    fn position(&self, corner: Corner) -> DVec3 {
        (DVec3::from_array(corner.map(|k| k as f64)) + ORIGIN) * self.spacing
    }

    /// The cube in which a point lies, and where in it, from 0 to 1.
    fn place(&self, p: Vec3) -> (Corner, DVec3) {
        let at = p.as_dvec3() / self.spacing - ORIGIN;
        (at.floor().to_array().map(|k| k as i64), at - at.floor())
    }

    /// Whether nothing stands between two points.
    fn sees(&self, from: DVec3, to: DVec3) -> bool {
        let distance = from.distance(to);
        distance == 0.0
            || first_hit(self.prepared.faces(), from, (to - from) / distance).is_none_or(|hit| hit.t > distance)
    }

    fn transfer(&self, p: Vec3, n: Vec3, seen: &HashMap<Corner, [bool; 8]>) -> Vec<f32> {
        let (cube, at) = self.place(p);
        let trilinear: [f64; 8] = std::array::from_fn(|k| {
            (0..3).map(|axis| if k >> axis & 1 == 1 { at[axis] } else { 1.0 - at[axis] }).product()
        });
        let mut weights: [f64; 8] = std::array::from_fn(|k| if seen[&cube][k] { trilinear[k] } else { 0.0 });
        let sum: f64 = weights.iter().sum();
        // A body that is walled in takes whatever there is.
        if sum > 1e-6 {
            weights.iter_mut().for_each(|w| *w /= sum)
        } else {
            weights = trilinear
        }
        let mut visibility = vec![0.0f32; self.inner.len()];
        for (corner, weight) in corners(cube).iter().zip(weights) {
            visibility.iter_mut().zip(&self.known[corner]).for_each(|(sum, v)| *sum += weight as f32 * v);
        }
        let cosine: Vec<f32> =
            clamped_cosine(self.inner, n.as_dvec3().normalize_or(DVec3::Z)).iter().map(|x| *x as f32).collect();
        let mut out = vec![0.0; self.order.len()];
        for &Term { visibility: i, cosine: j, out: k, value } in &self.terms {
            out[usize::from(k)] += value * visibility[usize::from(i)] * cosine[usize::from(j)];
        }
        out
    }
}

fn corners([x, y, z]: Corner) -> [Corner; 8] {
    std::array::from_fn(|k| [x + (k as i64 & 1), y + (k as i64 >> 1 & 1), z + (k as i64 >> 2 & 1)])
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DAffine3;

    use super::*;
    use crate::bake::integrate;
    use crate::scene::shapes::{Cuboid, Plane};
    use crate::scene::{GeometryBuilder, Mesh};

    fn geometry(meshes: Vec<(Mesh, DVec3)>) -> Geometry {
        let mut builder = GeometryBuilder::default();
        for (mesh, place) in meshes {
            builder.add(mesh, DAffine3::from_translation(place)).unwrap();
        }
        builder.build()
    }

    fn floor() -> (Mesh, DVec3) {
        (Plane { size: [40.0, 40.0], divisions: [8, 8] }.mesh().unwrap(), DVec3::ZERO)
    }

    fn body(points: &[(Vec3, Vec3)]) -> Surface {
        let (positions, normals) = points.iter().copied().unzip();
        Surface { positions, normals, ..Surface::default() }
    }

    fn exact(geometry: &Geometry, points: &[(Vec3, Vec3)]) -> Vec<f64> {
        let receivers = Receivers::points(points.iter().map(|(p, n)| (p.as_dvec3(), n.as_dvec3())));
        let request = Request { order: 4, transfer_sh: true, ..Request::default() };
        let outcome = integrate(geometry, None, &receivers, &request, Method::Exact, None, &()).unwrap();
        outcome.arrays.get("transfer_sh").unwrap().data.iter().map(|x| PI * x).collect()
    }

    #[test]
    fn a_floor_hides_the_same_at_every_height() {
        // Nor do probes below the floor count, although they are corners of the lowest cubes.
        let floor = geometry(vec![floor()]);
        let normals = [Vec3::Y, Vec3::X, Vec3::new(0.6, -0.8, 0.0)];
        let points: Vec<(Vec3, Vec3)> =
            (0..12).map(|k| (Vec3::new(0.3, 0.02 + 0.03 * k as f32, 0.1), normals[k % 3])).collect();
        let mut probes = Probes::new(&floor, 0.5, Order::new(4).unwrap(), Method::Exact).unwrap();
        let mut bodies = [body(&points)];
        probes.shade(&mut bodies, &()).unwrap();
        let exact = exact(&floor, &points);
        for (i, (found, exact)) in bodies[0].transfer.iter().zip(&exact).enumerate() {
            // The half space is not of six bands: its eighth band times the cosine's.
            assert!((f64::from(*found) - exact).abs() < 0.03, "{i}: {found} {exact}");
        }
        assert!(probes.count() > 8);
        let before = probes.count();
        probes.shade(&mut bodies, &()).unwrap();
        assert_eq!(probes.count(), before);
    }

    #[test]
    fn beside_a_wall_errors_shrink_with_the_spacing() {
        let wall = Cuboid { size: [0.4, 3.0, 4.0], ..Cuboid::default() }.mesh().unwrap();
        let room = geometry(vec![floor(), (wall, DVec3::new(0.0, 1.5, 0.0))]);
        let point = |k: usize| {
            let t = k as f32 / 40.0;
            (Vec3::new(0.3 + t, 0.3 + t, -1.5 + 3.0 * t), Vec3::new(-0.5, 0.5, 0.3 - t).normalize())
        };
        let points: Vec<(Vec3, Vec3)> = (0..40).map(point).collect();
        let exact = exact(&room, &points);
        let errors = [0.8, 0.4, 0.2].map(|spacing| {
            let mut probes = Probes::new(&room, spacing, Order::new(4).unwrap(), Method::Exact).unwrap();
            let mut bodies = [body(&points)];
            probes.shade(&mut bodies, &()).unwrap();
            let squares = bodies[0].transfer.iter().zip(&exact).map(|(a, b)| (f64::from(*a) - b).powi(2));
            (squares.sum::<f64>() / exact.len() as f64).sqrt()
        });
        assert!(errors[1] < errors[0] && errors[2] < 0.3 * errors[0] && errors[2] < 4e-3, "{errors:?}");
    }

    #[test]
    fn spacing_is_positive() {
        let floor = geometry(vec![floor()]);
        assert!(Probes::new(&floor, 0.0, Order::new(4).unwrap(), Method::Exact).is_err());
    }
}
