use glam::{DVec3, Vec3};

use super::chart::{Chart, Outlook, Sector};
use super::gaps::Gaps;
use crate::sphere::BoundaryArc;

/// The gaps of one receiver's isolines, or other arcs, against which boxes are tested in single precision: a sector of a plane each, or
/// a few.
#[derive(Clone, Debug, Default)]
pub(super) struct Front {
    sectors: Vec<Sector>,
    blocks: Vec<Block>,
}

/// A few sectors in the world's axes, by component: normals of the planes, and normals in the planes of the first and the last ray, both
/// away from the sector.
type Block = [[[f32; LANES]; 3]; 3];

/// A box seen from a receiver.
struct Look {
    centre: Vec3,
    /// Half its size.
    half: Vec3,
    margin: f32,
}

/// Boxes count as larger by this fraction of their distance and size. Rounding in single precision is below a tenth of it;
/// vertices are placed, and crossings kept, to 1e-8.
const MARGIN: f32 = 1e-5;

/// Sectors tested at once.
const LANES: usize = 8;

impl Front {
    /// Takes the gaps as they are now.
    pub(super) fn take<C: Chart>(&mut self, outlook: Outlook<C>, gaps: &Gaps) {
        self.sectors.clear();
        gaps.each(|line, from, to| outlook.chart.sectors(line, from, to, |sector| self.sectors.push(sector)));
        self.arrange([outlook.axes.x_axis, outlook.axes.y_axis, outlook.axes.z_axis].map(|axis| axis.as_vec3()));
    }

    /// Takes arcs of great circles, each shorter than half of one.
    pub(super) fn take_arcs(&mut self, arcs: &[BoundaryArc]) {
        self.sectors.clear();
        self.sectors.extend(arcs.iter().map(|arc| {
            let (sum, chord) = (arc.start + arc.end, arc.end - arc.start);
            // Of two ways to the middle of the arc the one along the longer vector.
            let out = if arc.start.dot(arc.end) > 0.0 { sum } else { chord.cross(arc.normal) }.normalize();
            // Half a turn, or by rounding more than that: no number, which any box meets.
            let tangent = (chord.length() / sum.dot(out).max(0.0)) as f32;
            Sector { out: out.as_vec3(), along: arc.normal.cross(out).as_vec3(), tangents: [-tangent, tangent] }
        }));
        self.arrange(Vec3::AXES);
    }

    /// Arranges the sectors, given in these axes.
    fn arrange(&mut self, axes: [Vec3; 3]) {
        // The last sector is repeated until all lanes are full.
        if let Some(&last) = self.sectors.last() {
            self.sectors.resize(self.sectors.len().next_multiple_of(LANES), last);
        }
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.turn_avx2(axes) };
        }
        self.turn(axes);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn turn_avx2(&mut self, axes: [Vec3; 3]) {
        self.turn(axes);
    }

    /// The sides of all sectors.
    #[inline(always)]
    fn turn(&mut self, [x, y, z]: [Vec3; 3]) {
        self.blocks.clear();
        for sectors in self.sectors.chunks_exact(LANES) {
            let (mut outs, mut alongs, mut tangents) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3], [[0.0; LANES]; 2]);
            for (j, sector) in sectors.iter().enumerate() {
                (outs[0][j], outs[1][j], outs[2][j]) = (sector.out.x, sector.out.y, sector.out.z);
                (alongs[0][j], alongs[1][j], alongs[2][j]) = (sector.along.x, sector.along.y, sector.along.z);
                [tangents[0][j], tangents[1][j]] = sector.tangents;
            }
            let mut block = [[[0.0; LANES]; 3]; 3];
            for j in 0..LANES {
                let out = x * outs[0][j] + y * outs[1][j] + z * outs[2][j];
                let along = x * alongs[0][j] + y * alongs[1][j] + z * alongs[2][j];
                let across = out.cross(along);
                let [before, behind] = [tangents[0][j], tangents[1][j]].map(|tangent| {
                    let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
                    out * (tangent * cosine) - along * cosine
                });
                for (side, normal) in block.iter_mut().zip([across, before, -behind]) {
                    (side[0][j], side[1][j], side[2][j]) = (normal.x, normal.y, normal.z);
                }
            }
            self.blocks.push(block);
        }
    }

    /// Number of sectors, rounded up to whole lanes.
    pub(super) fn len(&self) -> usize {
        self.sectors.len()
    }

    /// Whether a box, given by its lowest and highest corner, may be met by one of the gaps or arcs: conservatively.
    pub(super) fn meets(&self, position: DVec3, box_: [Vec3; 2]) -> bool {
        let look = Look::new(position, box_);
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.meets_avx2(&look) };
        }
        self.meets_inline(&look)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn meets_avx2(&self, look: &Look) -> bool {
        self.meets_inline(look)
    }

    /// A sector misses a box on one side of its plane, before its first ray, or behind its last one.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "lane by lane, over several arrays")]
    fn meets_inline(&self, Look { centre, half, margin }: &Look) -> bool {
        for [plane, first, last] in &self.blocks {
            let mut apart = [0.0f32; LANES];
            for j in 0..LANES {
                let middle = |[x, y, z]: &[[f32; LANES]; 3]| x[j] * centre.x + y[j] * centre.y + z[j] * centre.z;
                let reach =
                    |[x, y, z]: &[[f32; LANES]; 3]| x[j].abs() * half.x + y[j].abs() * half.y + z[j].abs() * half.z;
                let side = middle(plane).abs() - reach(plane);
                let before = middle(first) - reach(first);
                let behind = middle(last) - reach(last);
                apart[j] = if side > before { side } else { before };
                apart[j] = if apart[j] > behind { apart[j] } else { behind };
            }
            let mut met = false;
            for j in 0..LANES {
                // What is no number, of coordinates near the largest ones, may be anywhere.
                met |= (apart[j] <= *margin) | apart[j].is_nan();
            }
            if met {
                return true;
            }
        }
        false
    }
}

impl Look {
    fn new(position: DVec3, [low, high]: [Vec3; 2]) -> Self {
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let centre = (0.5 * low + 0.5 * high - position).as_vec3();
        let half = (0.5 * high - 0.5 * low).as_vec3();
        let size = centre.abs().element_sum() + half.element_sum();
        Self { centre, half, margin: MARGIN * size + f32::MIN_POSITIVE }
    }
}

/// Whether a box, given by its lowest and highest corner, lies below the horizon of a receiver, by more than rounding.
pub(super) fn is_sunken(position: DVec3, normal: DVec3, [low, high]: [Vec3; 2]) -> bool {
    /// Angle below the horizon.
    const BELOW: f64 = 1e-9;
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    let (middle, half) = (0.5 * (low + high) - position, 0.5 * (high - low));
    let highest = normal.dot(middle) + normal.abs().dot(half);
    let size = (middle.abs() + half).element_sum();
    let coordinates = (low.abs() + high.abs() + position.abs()).element_sum();
    highest < -BELOW * size - 4.0 * f64::EPSILON * coordinates
}

/// Distance of a box from a point, squared.
pub(super) fn distance_squared([low, high]: [Vec3; 2], p: Vec3) -> f32 {
    (low - p).max(p - high).max(Vec3::ZERO).length_squared()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use proptest::prelude::*;

    use super::*;
    use crate::visibility::crossings::Crossings;
    use crate::visibility::{Frame, Isolines, MeridianFrame, Meridians, Spans};

    /// Whether a ray meets a box.
    fn is_met(direction: DVec3, position: DVec3, [low, high]: [Vec3; 2]) -> bool {
        let (a, b) = ((low.as_dvec3() - position) / direction, (high.as_dvec3() - position) / direction);
        a.min(b).max_element().max(0.0) < a.max(b).min_element()
    }

    /// Whatever a ray in one of the gaps meets is met, where `ray` is given an isoline and how far to go from its start, in [0, 1], to
    /// its end.
    fn no_box_is_missed<C: Chart>(outlook: Outlook<C>, box_: [Vec3; 2], ray: impl Fn(usize, f64, f64) -> DVec3) {
        let (mut ends, mut gaps, mut front) = (Vec::new(), Gaps::default(), Front::default());
        C::horizons(outlook, &mut ends);
        gaps.reset::<C>(&ends);
        front.take(outlook, &gaps);
        let mut seen = false;
        for (line, &end) in ends.iter().enumerate().filter(|(_, end)| **end > C::START) {
            for step in 0..200 {
                let w = outlook.axes * ray(line, end, (f64::from(step) + 0.5) / 200.0);
                seen |= is_met(w, outlook.position, box_);
            }
        }
        let met = front.meets(outlook.position, box_);
        assert!(met || !seen);
        assert_eq!(met, front.meets_inline(&Look::new(outlook.position, box_)));
        let dispatched = front.blocks.clone();
        front.turn([outlook.axes.x_axis, outlook.axes.y_axis, outlook.axes.z_axis].map(|axis| axis.as_vec3()));
        assert_eq!(front.blocks, dispatched);
        // Nothing covers nothing; something that covers the start and crosses nothing covers all.
        let (mut spans, mut nothing) = (Spans::default(), Crossings::default());
        gaps.cover(outlook.chart, &mut nothing, 0, &ends);
        gaps.finish::<C>(&mut spans);
        assert_eq!(spans.ends().len(), 2 * ends.iter().filter(|end| **end > C::START).count());
        gaps.cover(outlook.chart, &mut nothing, 1, &ends);
        front.take(outlook, &gaps);
        assert!(!front.meets(outlook.position, box_));
    }

    proptest! {
        #[test]
        fn no_box_in_a_gap_is_missed(
            low in prop::array::uniform3(-3f32..3.0),
            size in prop::array::uniform3(0f32..2.0),
            position in prop::array::uniform3(-3f64..3.0),
            normal in prop::array::uniform3(-1f64..1.0),
        ) {
            let Some(normal) = DVec3::from(normal).try_normalize() else { return Ok(()) };
            let (position, normal, low) = (DVec3::from(position), Some(normal), Vec3::from(low));
            let box_ = [low, low + Vec3::from(size)];
            let meridians = Meridians::new(14).unwrap();
            let axes = MeridianFrame::facing(normal, false).axes();
            no_box_is_missed(Outlook { chart: &meridians, axes, position, normal }, box_, |line, end, part| {
                let (sin, cos) = meridians.u(line).sin_cos();
                let latitude = -FRAC_PI_2 + (end.atan() + FRAC_PI_2) * part;
                DVec3::new(latitude.cos() * cos, latitude.cos() * sin, latitude.sin())
            });
            let isolines = Isolines::new(14).unwrap();
            let axes = Frame::facing(normal, 0).axes();
            no_box_is_missed(Outlook { chart: &isolines, axes, position, normal }, box_, |line, end, part| {
                let (u, side) = (isolines.u(line % 14), if line < 14 { 1.0 } else { -1.0 });
                let s = end * part;
                let (y, z) = if s < 1.0 { (s, 1.0 - s) } else { (2.0 - s, 1.0 - s) };
                DVec3::X * u + (1.0 - u.abs()) * DVec3::new(0.0, side * y, z)
            });
        }
    }

    proptest! {
        /// Of any length below half a turn, down to rounding.
        #[test]
        fn no_box_on_an_arc_is_missed(
            start in prop::array::uniform3(-1f64..1.0),
            aside in prop::array::uniform3(-1f64..1.0),
            angle in prop_oneof![0.0..PI, PI - 1e-6..PI, PI - 1e-14..PI, PI - 1e-15..=PI, 0.0..1e-6f64],
            place in prop_oneof![0.0..1f64, Just(0.0), Just(1.0)],
            distance in 0.1..10f64,
            size in prop::array::uniform3(0f32..2.0),
        ) {
            let Some(start) = DVec3::from(start).try_normalize() else { return Ok(()) };
            let Some(normal) = start.cross(aside.into()).try_normalize() else { return Ok(()) };
            let at = |angle: f64| angle.cos() * start + angle.sin() * normal.cross(start);
            let mut front = Front::default();
            front.take_arcs(&[BoundaryArc { start, end: at(angle), normal }]);
            let (position, half) = (DVec3::new(0.3, -0.7, 0.2), 0.5 * Vec3::from(size));
            let centre = (position + distance * at(place * angle)).as_vec3();
            assert!(front.meets(position, [centre - half, centre + half]));
            // Nothing behind the receiver, and nothing off the plane, is on it.
            let behind = (position - distance * at(0.5 * angle)).as_vec3();
            assert!(!(1e-3..3.0).contains(&angle) || !front.meets(position, [behind, behind]));
            let off = (position + distance * (at(place * angle) + 1e-3 * normal)).as_vec3();
            assert!(angle > 3.0 || !front.meets(position, [off, off]));
        }
    }

    /// Asks for boxes on an isoline, between two of them, and on either side of the horizon.
    fn only_gaps_meet<C: Chart>(outlook: Outlook<C>, on: DVec3, between: DVec3) {
        let (mut ends, mut gaps, mut front) = (Vec::new(), Gaps::default(), Front::default());
        C::horizons(outlook, &mut ends);
        gaps.reset::<C>(&ends);
        front.take(outlook, &gaps);
        let at = |w: DVec3, half: f32| [w.as_vec3() - half, w.as_vec3() + half];
        let [on, between] = [on, between].map(|w| 3.0 * (outlook.axes * w.normalize()));
        let meets = |box_| front.meets(DVec3::ZERO, box_);
        assert!(meets(at(on, 0.1)) && !meets(at(between, 0.1)));
        assert!(!meets(at(DVec3::new(0.3, 0.2, -3.0), 0.5)));
        assert!(meets(at(DVec3::new(0.3, 0.2, 3.0), 0.5)));
    }

    #[test]
    fn what_lies_beside_the_isolines_or_below_the_horizon_is_not_met() {
        let (position, normal) = (DVec3::ZERO, Some(DVec3::Z));
        let meridians = Meridians::new(8).unwrap();
        let axes = MeridianFrame::facing(normal, false).axes();
        let [on, between] = [3.0, 3.5].map(|line| {
            let (sin, cos) = ((line + 0.5) * PI / 4.0).sin_cos();
            DVec3::new(cos, sin, -3.0)
        });
        only_gaps_meet(Outlook { chart: &meridians, axes, position, normal }, on, between);
        let isolines = Isolines::new(8).unwrap();
        let axes = Frame::facing(normal, 0).axes();
        let [on, between] = [0.125, 0.25].map(|u| DVec3::new(u, 0.3 * (1.0 - u), 0.7 * (1.0 - u)));
        only_gaps_meet(Outlook { chart: &isolines, axes, position, normal }, on, between);
    }
}
