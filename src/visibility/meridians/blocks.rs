use dual_bvh::Blocks;
use glam::DVec3;

use super::vertices::place;
use super::{IN_HORIZON, Outlook};

/// Tells which blocks of candidates may hold contours that cross isolines above the horizon: not zero for those.
pub(super) fn near_isolines(wanted: &mut Vec<i32>, blocks: &Blocks, outlook: Outlook) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the feature.
        return unsafe { near_isolines_avx2(wanted, blocks, outlook) };
    }
    near_isolines_inline(wanted, blocks, outlook);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn near_isolines_avx2(wanted: &mut Vec<i32>, blocks: &Blocks, outlook: Outlook) {
    near_isolines_inline(wanted, blocks, outlook);
}

/// More than the places of vertices are off by, as an angle.
const SLACK: f64 = 2e-8;

#[inline(always)]
pub(super) fn near_isolines_inline(wanted: &mut Vec<i32>, blocks: &Blocks, outlook: Outlook) {
    let Outlook { meridians, frame, position, normal } = outlook;
    let lines = meridians.len();
    let ([x, y, z], radii) = blocks.balls();
    let count = radii.len();
    wanted.resize(count, 0);
    let (x, y, z, wanted) = (&x[..count], &y[..count], &z[..count], &mut wanted[..count]);
    // A full sphere has no horizon.
    let (normal, horizon) = normal.map_or((DVec3::ZERO, f64::NEG_INFINITY), |normal| (normal, 0.0));
    for i in 0..count {
        let direction = DVec3::new(f64::from(x[i]), f64::from(y[i]), f64::from(z[i])) - position;
        let radius = f64::from(radii[i]);
        let size = direction.x.abs() + direction.y.abs() + direction.z.abs();
        let is_above = normal.dot(direction) + radius + 2.0 * IN_HORIZON * size > horizon;
        // From where it is seen in longitude to where: a quarter turn to either side at most, if the axis does not meet it.
        let w = frame.apply(direction);
        let distance = (w.x * w.x + w.y * w.y).sqrt();
        let sine = radius / distance + SLACK;
        let cosine = (1.0 - sine * sine).max(0.0).sqrt();
        let early = DVec3::new(w.x * cosine + w.y * sine, w.y * cosine - w.x * sine, 0.0);
        let late = DVec3::new(w.x * cosine - w.y * sine, w.y * cosine + w.x * sine, 0.0);
        // What is no number is near.
        let is_near = (place(early, lines) != place(late, lines)) | !(sine < 1.0);
        wanted[i] = i32::from(is_above & is_near);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use dual_bvh::{BuildOptions, Candidates, DualBvh, Selection, Tile};
    use glam::Vec3;

    use super::*;
    use crate::visibility::meridians::vertices::{BELOW, fill};
    use crate::visibility::{MeridianFrame, Meridians};

    /// Small triangles in a cloud: blocks of all sizes, near and far, across the horizon and around the axis.
    #[test]
    fn what_is_left_out_crosses_no_isoline_above_the_horizon() {
        let wave = |i: usize, k: f32| (i as f32 * k).sin();
        let positions: Arc<[Vec3]> = (0..6000)
            .map(|i| Vec3::new(wave(i / 3, 1.3), wave(i / 3, 0.71), wave(i / 3, 2.9)) + 0.02 * wave(i, 7.7))
            .collect();
        let triangles: Arc<[[u32; 3]]> = (0..2000).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let tree = DualBvh::build(positions, triangles, &BuildOptions::default()).unwrap();
        let mut candidates = Candidates::default();
        let (mut wanted, mut portable, mut places) = (Vec::new(), Vec::new(), Vec::new());
        let mut left_out = 0;
        for i in 0..48 {
            let position = DVec3::new(wave(i, 0.9).into(), wave(i, 2.3).into(), wave(i, 0.37).into());
            let normal = (i % 3 != 0).then(|| DVec3::new(wave(i, 3.1).into(), wave(i, 1.7).into(), 0.6).normalize());
            tree.search(&Tile::new([(position, normal), (position + 1e-3, normal)].into_iter()), &mut candidates);
            let meridians = Meridians::new([8, 64, 512][i % 3]).unwrap();
            let frame = MeridianFrame::facing(normal, i % 2 == 0);
            let outlook = Outlook { meridians: &meridians, frame, position, normal };
            near_isolines(&mut wanted, candidates.blocks(), outlook);
            near_isolines_inline(&mut portable, candidates.blocks(), outlook);
            assert_eq!(wanted, portable);
            places.resize(candidates.vertices().len(), 0);
            fill(&mut places, &candidates, 0..candidates.vertices().len(), outlook);
            let unwanted: Vec<i32> = wanted.iter().map(|&wanted| 1 - wanted).collect();
            let mut rest = Selection::default();
            candidates.blocks().select(&unwanted, &mut rest);
            for edge in candidates.edges().iter().enumerate().filter(|(edge, _)| rest.contains(*edge)).map(|(_, e)| e) {
                let [a, b] = [edge.a, edge.b].map(|vertex| places[vertex as usize]);
                assert!(a & b & BELOW != 0 || (a ^ b) & !BELOW == 0, "{a:x} {b:x}");
                left_out += 1;
            }
        }
        assert!(left_out > 20_000, "{left_out}");
    }
}
