use glam::{DVec3, Vec3};

use super::gaps::Gaps;
use super::{MeridianFrame, Outlook};

/// The gaps of one receiver's isolines, against which boxes are tested in single precision: a sector of a plane each.
#[derive(Clone, Debug, Default)]
pub(in crate::visibility) struct Front {
    /// Cosine and sine of the isolines' longitudes.
    cos: Vec<f32>,
    sin: Vec<f32>,
    /// The same of the latitudes where the gaps begin and end.
    begin: [Vec<f32>; 2],
    end: [Vec<f32>; 2],
}

/// A box seen from a receiver, in the axes of its chart.
struct Look {
    centre: Vec3,
    /// Half edges.
    edges: [Vec3; 3],
    margin: f32,
}

/// Boxes count as larger by this fraction of their distance and size. Rounding in single precision is below a tenth of it;
/// vertices are placed, and crossings kept, to 1e-8.
const MARGIN: f32 = 1e-5;

/// Sectors tested at once.
const LANES: usize = 8;

impl Front {
    /// Takes the gaps as they are now.
    pub(in crate::visibility) fn take(&mut self, outlook: Outlook, gaps: &Gaps) {
        let ([begin_cos, begin_sin], [end_cos, end_sin]) = (&mut self.begin, &mut self.end);
        let count = gaps.count();
        let lanes = count.next_multiple_of(LANES);
        for values in [&mut self.cos, &mut self.sin, &mut *begin_cos, &mut *begin_sin, &mut *end_cos, &mut *end_sin] {
            values.resize(lanes, 0.0);
        }
        for (at, (line, begin, end)) in gaps.iter().enumerate() {
            self.cos[at] = outlook.meridians.cos[line] as f32;
            self.sin[at] = outlook.meridians.sin[line] as f32;
            begin_sin[at] = begin as f32;
            end_sin[at] = end as f32;
        }
        for values in [&mut self.cos, &mut self.sin, &mut *begin_sin, &mut *end_sin] {
            // The last sector is repeated until all lanes are full.
            if let Some(last) = count.checked_sub(1) {
                let last = values[last];
                values[count..].fill(last);
            }
        }
        for (cos, sin) in begin_cos.iter_mut().zip(begin_sin).chain(end_cos.iter_mut().zip(end_sin)) {
            *cos = 1.0 / (1.0 + *sin * *sin).sqrt();
            *sin *= *cos;
        }
    }

    /// Number of sectors, rounded up to whole lanes.
    pub(in crate::visibility) fn len(&self) -> usize {
        self.cos.len()
    }

    /// Whether a box, given by its lowest and highest corner, may be met by one of the gaps: conservatively.
    pub(in crate::visibility) fn meets(&self, outlook: Outlook, box_: [Vec3; 2]) -> bool {
        let look = Look::new(outlook.frame, outlook.position, box_);
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
    /// A sector misses a box on one side of its plane, before its first ray, or behind its last one.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "lane by lane, over several arrays")]
    fn meets_inline(&self, Look { centre, edges: [e, f, g], margin }: &Look) -> bool {
        let ([begin_cos, begin_sin], [end_cos, end_sin]) = (&self.begin, &self.end);
        let (cos, sin) = (self.cos.chunks_exact(LANES), self.sin.chunks_exact(LANES));
        let begin = begin_cos.chunks_exact(LANES).zip(begin_sin.chunks_exact(LANES));
        let end = end_cos.chunks_exact(LANES).zip(end_sin.chunks_exact(LANES));
        for ((cos, sin), ((begin_cos, begin_sin), (end_cos, end_sin))) in cos.zip(sin).zip(begin.zip(end)) {
            let mut apart = [0.0f32; LANES];
            for j in 0..LANES {
                let across = |v: &Vec3| cos[j] * v.y - sin[j] * v.x;
                let out = |v: &Vec3| cos[j] * v.x + sin[j] * v.y;
                let before = |v: &Vec3| begin_sin[j] * out(v) - begin_cos[j] * v.z;
                let behind = |v: &Vec3| end_cos[j] * v.z - end_sin[j] * out(v);
                let side = across(centre).abs() - (across(e).abs() + across(f).abs() + across(g).abs());
                let first = before(centre) - (before(e).abs() + before(f).abs() + before(g).abs());
                let last = behind(centre) - (behind(e).abs() + behind(f).abs() + behind(g).abs());
                apart[j] = if side > first { side } else { first };
                apart[j] = if apart[j] > last { apart[j] } else { last };
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
    fn new(frame: MeridianFrame, position: DVec3, [low, high]: [Vec3; 2]) -> Self {
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let centre = frame.apply(0.5 * low + 0.5 * high - position).as_vec3();
        let half = 0.5 * high - 0.5 * low;
        let edges = [0, 1, 2].map(|axis| (half[axis] * frame.axes().row(axis)).as_vec3());
        let size = centre.abs().element_sum() + edges.iter().map(|edge| edge.abs().element_sum()).sum::<f32>();
        Self { centre, edges, margin: MARGIN * size + f32::MIN_POSITIVE }
    }
}

/// Distance of a box from a point, squared.
pub(in crate::visibility) fn distance_squared([low, high]: [Vec3; 2], p: Vec3) -> f32 {
    (low - p).max(p - high).max(Vec3::ZERO).length_squared()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::*;
    use crate::visibility::meridians::{Crossings, horizons};
    use crate::visibility::{Meridians, Spans};

    /// Whether a ray meets a box.
    fn is_met(direction: DVec3, position: DVec3, [low, high]: [Vec3; 2]) -> bool {
        let (a, b) = ((low.as_dvec3() - position) / direction, (high.as_dvec3() - position) / direction);
        a.min(b).max_element().max(0.0) < a.max(b).min_element()
    }

    proptest! {
        /// Whatever a ray in one of the gaps meets is met.
        #[test]
        fn no_box_in_a_gap_is_missed(
            low in prop::array::uniform3(-3f32..3.0),
            size in prop::array::uniform3(0f32..2.0),
            position in prop::array::uniform3(-3f64..3.0),
            normal in prop::array::uniform3(-1f64..1.0),
        ) {
            let Some(normal) = DVec3::from(normal).try_normalize() else { return Ok(()) };
            let meridians = Meridians::new(14).unwrap();
            let frame = MeridianFrame::facing(Some(normal), false);
            let position = DVec3::from(position);
            let outlook = Outlook { meridians: &meridians, frame, position, normal: Some(normal) };
            let low = Vec3::from(low);
            let box_ = [low, low + Vec3::from(size)];
            let (mut ends, mut gaps, mut front) = (Vec::new(), Gaps::default(), Front::default());
            horizons(outlook, &mut ends);
            gaps.reset(&ends);
            front.take(outlook, &gaps);
            prop_assert_eq!(front.len(), 16);
            let mut seen = false;
            for (line, end) in ends.iter().enumerate() {
                let (sin, cos) = meridians.u(line).sin_cos();
                let end = end.atan();
                for step in 0..200 {
                    let latitude = -0.5 * PI + (end + 0.5 * PI) * (f64::from(step) + 0.5) / 200.0;
                    let w = DVec3::new(latitude.cos() * cos, latitude.cos() * sin, latitude.sin());
                    seen |= is_met(frame.axes() * w, position, box_);
                }
            }
            let met = front.meets(outlook, box_);
            prop_assert!(met || !seen);
            prop_assert_eq!(met, front.meets_inline(&Look::new(frame, position, box_)));
            // Nothing covers nothing; something that covers the start and crosses nothing covers all.
            let mut spans = Spans::default();
            gaps.cover(&mut Crossings::default(), 0, &ends);
            gaps.finish(&mut spans);
            prop_assert_eq!(spans.ends().len(), 28);
            gaps.cover(&mut Crossings::default(), 1, &ends);
            front.take(outlook, &gaps);
            prop_assert!(!front.meets(outlook, box_));
        }
    }

    #[test]
    fn what_lies_beside_the_isolines_or_below_the_horizon_is_not_met() {
        let meridians = Meridians::new(8).unwrap();
        let normal = Some(DVec3::Z);
        let frame = MeridianFrame::facing(normal, false);
        let outlook = Outlook { meridians: &meridians, frame, position: DVec3::ZERO, normal };
        let (mut ends, mut gaps, mut front) = (Vec::new(), Gaps::default(), Front::default());
        horizons(outlook, &mut ends);
        gaps.reset(&ends);
        front.take(outlook, &gaps);
        let at = |w: DVec3, half: f32| [w.as_vec3() - half, w.as_vec3() + half];
        let along = |u: f64| frame.axes() * DVec3::new(u.cos(), u.sin(), -3.0).normalize();
        let [on, between] = [meridians.u(3), 0.5 * (meridians.u(3) + meridians.u(4))].map(along);
        assert!(front.meets(outlook, at(3.0 * on, 0.1)) && !front.meets(outlook, at(3.0 * between, 0.1)));
        assert!(!front.meets(outlook, at(DVec3::new(0.3, 0.2, -3.0), 0.5)));
        assert!(front.meets(outlook, at(DVec3::new(0.3, 0.2, 3.0), 0.5)));
    }
}
