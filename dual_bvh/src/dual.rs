//! The dual of an edge: the planes of its faces, flipped so that planes of one sign mean no contour.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::edge::{Edges, Incidence};
use crate::face::face_normal;

/// A flipped face plane: unit normal (zero for a face without area) and anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    pub(crate) normal: DVec3,
    pub(crate) anchor: DVec3,
}

/// The planes of all edges with an even number of faces.
///
/// The jump of an edge is the sum of o s over its faces, with o = +-1 the orientation and s = +-1 the sign of the receiver. With
/// flips f = +-1 such that the sum of o f is zero, flipped planes of equal sign (s = f everywhere, or s = -f) leave no jump. Such
/// flips exist for even numbers of faces: as many faces with o f = +1 as with -1.
pub(crate) struct Dual<'a> {
    positions: &'a [Vec3],
    triangles: &'a [[u32; 3]],
    edges: &'a Edges,
    units: &'a [DVec3],
    /// Whether a face of `edges.fans` is flipped.
    flipped: Vec<bool>,
}

impl<'a> Dual<'a> {
    /// `units` as by [`face_units`].
    pub(crate) fn new(positions: &'a [Vec3], triangles: &'a [[u32; 3]], edges: &'a Edges, units: &'a [DVec3]) -> Self {
        let mut flipped = vec![false; edges.fans.len()];
        for record in &edges.records {
            if let Some(fan) = record.fan() {
                flips(&edges.fans[fan.clone()], units, &mut flipped[fan]);
            }
        }
        Self { positions, triangles, edges, units, flipped }
    }

    /// The planes of an edge. Those of an edge with an odd number of faces mean nothing.
    pub(crate) fn planes(&self, edge: u32) -> impl Iterator<Item = Plane> + Clone {
        let record = self.edges.records[edge as usize];
        let fan = record.fan();
        let uses = self.edges.incidences(edge);
        (0..uses.len()).map(move |i| {
            let flip = match &fan {
                Some(fan) => self.flipped[fan.start + i],
                None => i == 1 && uses[0].orientation() == uses[1].orientation(),
            };
            let face = uses[i].face() as usize;
            let normal = self.units[face];
            let anchor = self.positions[self.triangles[face][0] as usize].as_dvec3();
            Plane { normal: if flip { -normal } else { normal }, anchor }
        })
    }

    /// Whether the edge has more than two faces.
    pub(crate) fn is_fan(&self, edge: u32) -> bool {
        self.edges.records[edge as usize].fan().is_some()
    }

    pub(crate) fn vertices(&self, edge: u32) -> [DVec3; 2] {
        self.edges.records[edge as usize].vertices().map(|vertex| self.positions[vertex as usize].as_dvec3())
    }
}

/// Unit normals of all faces, zero for those without area.
pub(crate) fn face_units(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let unit = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|vertex| positions[vertex as usize]);
        face_normal(a, b, c).normalize_or_zero()
    };
    triangles.par_iter().map(unit).collect()
}

/// Chooses the flips of a fan that bring its planes closest together.
///
/// With m = o n, the normals as if all faces ran along the edge, and g = o f = +-1, the flipped normals are f n = g m. Half of
/// the g are +1: for a direction w, the sum of g m . w is largest if those are the faces with the largest m . w. Every m is tried
/// as w.
fn flips(fan: &[Incidence], units: &[DVec3], flipped: &mut [bool]) {
    let along: Vec<DVec3> =
        fan.iter().map(|use_| f64::from(use_.orientation()) * units[use_.face() as usize]).collect();
    let mut best = f64::NEG_INFINITY;
    for &direction in &along {
        let mut order: Vec<usize> = (0..along.len()).collect();
        order.sort_by(|&i, &j| along[j].dot(direction).total_cmp(&along[i].dot(direction)).then(i.cmp(&j)));
        let (plus, minus) = order.split_at(fan.len() / 2);
        let sum: DVec3 = plus.iter().map(|&i| along[i]).sum::<DVec3>() - minus.iter().map(|&i| along[i]).sum::<DVec3>();
        if sum.length_squared() > best {
            best = sum.length_squared();
            plus.iter().for_each(|&i| flipped[i] = fan[i].orientation() < 0);
            minus.iter().for_each(|&i| flipped[i] = fan[i].orientation() > 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `count` half planes around the x axis, wound at random.
    fn fan(count: usize, seed: u64) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let mut positions = vec![Vec3::ZERO, Vec3::X];
        let triangles = (0..count)
            .map(|i| {
                let hash = (seed + i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                let (sin, cos) = (hash as f32 / u64::MAX as f32 * std::f32::consts::TAU).sin_cos();
                positions.push(Vec3::new(0.3, cos, sin));
                if hash & 1 == 0 { [0, 1, i as u32 + 2] } else { [1, 0, i as u32 + 2] }
            })
            .collect();
        (positions, triangles)
    }

    #[test]
    fn planes_of_one_sign_leave_no_jump() {
        for count in [2, 4, 6, 8] {
            for seed in 0..50 {
                let (positions, triangles) = fan(count, 1000 * seed);
                let edges = Edges::collect(positions.len(), &triangles);
                let units = face_units(&positions, &triangles);
                let dual = Dual::new(&positions, &triangles, &edges, &units);
                let uses = edges.incidences(0);
                assert_eq!(uses.len(), count);
                let balance: i32 = dual
                    .planes(0)
                    .zip(uses.iter())
                    .map(|(plane, use_)| {
                        let same = plane.normal == dual.units[use_.face() as usize];
                        i32::from(use_.orientation()) * if same { 1 } else { -1 }
                    })
                    .sum();
                assert_eq!(balance, 0, "{count} faces, seed {seed}");
            }
        }
    }

    #[test]
    fn two_sheets_that_touch_are_flipped_like_closed_surfaces() {
        // Two wedges around the x axis, each wound consistently: no flip brings the planes closer together than none.
        let positions = [
            Vec3::ZERO,
            Vec3::X,
            Vec3::new(0.0, 1.0, 0.1),
            Vec3::new(0.0, 1.0, -0.1),
            -Vec3::Y,
            Vec3::new(0.0, -1.0, 0.2),
        ];
        let triangles = [[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 0, 5]];
        let edges = Edges::collect(6, &triangles);
        let units = face_units(&positions, &triangles);
        let dual = Dual::new(&positions, &triangles, &edges, &units);
        let spread = |sign: f64| dual.planes(0).all(|plane| plane.normal.z * sign > 0.0);
        assert!(spread(1.0) || spread(-1.0));
    }
}
