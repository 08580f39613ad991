use glam::{DVec3, Vec3};

use crate::sphere::BoundaryArc;

/// The boundary of a region, which in single precision mostly tells whether the region holds a direction: if it does one, it does another
/// unless the boundary is crossed an odd number of times on the way.
#[derive(Clone, Debug, Default)]
pub(super) struct Outline {
    blocks: Vec<Block>,
    /// Number of arcs.
    len: usize,
    known: Vec3,
    is_held: bool,
}

/// Starts, ends and normals of a few arcs, by component.
type Block = [[[f32; LANES]; 3]; 3];

/// Arcs handled side by side.
const LANES: usize = 8;

/// Sines that are told from zero: rounding is a twentieth of it.
const MARGIN: f32 = 1e-5;

impl Outline {
    /// Takes arcs of great circles, each shorter than half of one, and a direction of which it is known whether the region holds it.
    pub(super) fn take(&mut self, arcs: &[BoundaryArc], (known, is_held): (DVec3, bool)) {
        (self.len, self.known, self.is_held) = (arcs.len(), known.as_vec3(), is_held);
        self.blocks.clear();
        self.blocks.extend(arcs.chunks(LANES).map(|arcs| {
            let mut block = [[[0.0; LANES]; 3]; 3];
            for (lane, arc) in arcs.iter().enumerate() {
                for (lanes, vector) in block.iter_mut().zip([arc.start, arc.end, arc.normal]) {
                    for (axis, value) in vector.as_vec3().to_array().into_iter().enumerate() {
                        lanes[axis][lane] = value;
                    }
                }
            }
            block
        }));
    }

    /// Whether the region holds a direction of unit length, if that is certain.
    pub(super) fn holds(&self, direction: DVec3) -> Option<bool> {
        let direction = direction.as_vec3();
        // The way is the shorter arc from one to the other; where that is no way, or two, it tells nothing.
        let across = self.known.cross(direction).try_normalize().filter(|_| self.known.dot(direction).abs() < 0.999)?;
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.crosses_avx2(direction, across) }.map(|is_crossed| is_crossed != self.is_held);
        }
        self.crosses(direction, across).map(|is_crossed| is_crossed != self.is_held)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn crosses_avx2(&self, direction: Vec3, across: Vec3) -> Option<bool> {
        self.crosses(direction, across)
    }

    /// Whether the boundary is crossed an odd number of times on the way to a direction; `across` is normal to that.
    ///
    /// An arc is crossed if its ends lie on different sides of the way, the ends of the way on different sides of its circle, and both
    /// on the same side of the sphere. It is certain that it is not where one of the first two is.
    #[inline(always)]
    fn crosses(&self, direction: Vec3, across: Vec3) -> Option<bool> {
        let (mut count, mut is_certain) = ([0u32; LANES], true);
        for (number, [starts, ends, normals]) in self.blocks.iter().enumerate() {
            let left = (self.len - number * LANES) as u32;
            for j in 0..LANES {
                let at = |[x, y, z]: &[[f32; LANES]; 3]| Vec3::new(x[j], y[j], z[j]);
                let (start, end) = (across.dot(at(starts)), across.dot(at(ends)));
                let (from, to) = (at(normals).dot(self.known), at(normals).dot(direction));
                let is_arc = (j as u32) < left;
                let misses = (start.min(end) > MARGIN) | (start.max(end) < -MARGIN);
                let misses = misses | (from.min(to) > MARGIN) | (from.max(to) < -MARGIN);
                let smallest = start.abs().min(end.abs()).min(from.abs().min(to.abs()));
                is_certain &= misses | (smallest > MARGIN) | !is_arc;
                count[j] ^= u32::from(!misses & (from * end > 0.0) & is_arc);
            }
        }
        is_certain.then(|| count.iter().fold(0, |odd, lane| odd ^ lane) != 0)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;

    /// A star around z, by the tangents of the angles of its corners from there.
    fn star(tangents: &[f64]) -> Vec<DVec3> {
        let corner = |(i, &tangent): (usize, &f64)| {
            let (sin, cos) = (TAU * (i as f64 + 0.3) / tangents.len() as f64).sin_cos();
            DVec3::new(tangent * cos, tangent * sin, 1.0).normalize()
        };
        tangents.iter().enumerate().map(corner).collect()
    }

    fn boundary(corners: &[DVec3]) -> Vec<BoundaryArc> {
        let next = corners.iter().cycle().skip(1);
        let arc = |(&start, &end): (&DVec3, &DVec3)| BoundaryArc { start, end, normal: start.cross(end).normalize() };
        corners.iter().zip(next).map(arc).collect()
    }

    /// Whether the triangle of z and one of the arcs has it; none near a side.
    fn is_in_star(arcs: &[BoundaryArc], w: DVec3) -> Option<bool> {
        let sides = |arc: &BoundaryArc| {
            [arc.normal, DVec3::Z.cross(arc.start).normalize(), arc.end.cross(DVec3::Z).normalize()].map(|n| n.dot(w))
        };
        let is_clear = arcs.iter().all(|arc| sides(arc)[0].abs() > 1e-4);
        is_clear.then(|| arcs.iter().any(|arc| sides(arc).into_iter().all(|side| side >= 0.0)))
    }

    proptest! {
        #[test]
        fn a_star_holds_what_its_triangles_hold(
            tangents in prop::collection::vec(0.05..3f64, 5..40),
            known in prop::array::uniform3(-1f64..1.0),
            directions in prop::collection::vec(prop::array::uniform3(-1f64..1.0), 1..50),
        ) {
            let arcs = boundary(&star(&tangents));
            let Some(known) = DVec3::from(known).try_normalize() else { return Ok(()) };
            let Some(is_held) = is_in_star(&arcs, known) else { return Ok(()) };
            let mut outline = Outline::default();
            outline.take(&arcs, (known, is_held));
            for w in directions.into_iter().filter_map(|w| DVec3::from(w).try_normalize()) {
                let (Some(found), Some(expected)) = (outline.holds(w), is_in_star(&arcs, w)) else { continue };
                assert_eq!(found, expected, "{w}");
            }
        }
    }

    /// Most directions are told; those on the way through a corner are not.
    #[test]
    fn doubt_is_rare_and_noticed() {
        let arcs = boundary(&star(&[0.3, 0.9, 0.4, 1.5, 0.7, 0.8, 2.0, 0.2, 0.6]));
        let mut outline = Outline::default();
        let known = DVec3::new(0.1, -0.05, 1.0).normalize();
        outline.take(&arcs, (known, true));
        let told = (0..1000).filter(|&i| {
            let (sin, cos) = (0.37 * f64::from(i)).sin_cos();
            outline.holds(DVec3::new(sin, cos, 2.0 - 0.004 * f64::from(i)).normalize()).is_some()
        });
        assert!(told.count() > 980);
        for arc in &arcs {
            assert_eq!(outline.holds((2.0 * arc.start - known).normalize()), None);
        }
        assert_eq!((outline.holds(known), outline.holds(-known)), (None, None));
        let below = DVec3::new(0.3, 0.2, -1.0).normalize();
        assert_eq!(outline.holds(below), Some(false));
        outline.take(&arcs, (known, false));
        assert_eq!(outline.holds(below), Some(true));
        outline.take(&[], (known, true));
        assert_eq!(outline.holds(below), Some(true));
    }

    #[test]
    fn portable_and_dispatched_tests_agree() {
        let arcs = boundary(&star(&[0.3, 0.9, 0.4, 1.5, 0.7, 0.8, 2.0, 0.2, 0.6]));
        let mut outline = Outline::default();
        outline.take(&arcs, (DVec3::Z, true));
        for i in 0..300 {
            let (sin, cos) = (0.37 * f64::from(i)).sin_cos();
            let w = DVec3::new(sin, cos, 0.01 * f64::from(i) - 1.0).normalize();
            let across = outline.known.cross(w.as_vec3()).normalize();
            assert_eq!(outline.holds(w), outline.crosses(w.as_vec3(), across).map(|is_crossed| !is_crossed));
        }
    }
}
