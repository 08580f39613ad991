//! Upsampling: from the shading of the coarse receivers to the pixels of the display (Sloan et al. 2007, section 4.2).

use std::f32::consts::FRAC_1_PI;
use std::fmt;
use std::ops::{AddAssign, Range};

use rayon::prelude::*;

use super::Receivers;
use super::lanes::{LANES, Lanes, dispatch};
use super::shade::{Shading, cosine_lanes, radiance, transfer_vector};
use super::tiles::{Group, TILE_GROUPS};

/// How pixels take from the four receivers around them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum Upsampling {
    /// By their place in the image alone: shadows bleed over silhouettes.
    Bilinear,
    /// Also by how well their surface agrees with the pixel's; pixels for which none does are shaded anew.
    #[default]
    Bilateral,
}

impl fmt::Display for Upsampling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bilinear => "bilinear",
            Self::Bilateral => "bilateral",
        })
    }
}

/// The geometry of the two images, coarse and fine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resampling {
    /// Pixels of the display per receiver, across and down.
    pub scale: usize,
    /// Side of a pixel of the display at depth 1.
    pub pixel: f32,
}

/// The distance from the pixel's tangent plane that halves a receiver's weight, over the receiver's footprint.
///
/// The paper compares depths. Those of a slanted plane differ from receiver to receiver; distances from the plane do not.
pub(super) const PLANE_DISTANCE: f32 = 0.05;
/// Pixels whose weights, of which the bilinear ones sum to 1, sum to less are shaded anew.
pub(super) const LEAST_WEIGHT: f32 = 0.05;

/// What the pass did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UpsampleCounts {
    /// Pixels that proxies change.
    pub changed: u64,
    /// Pixels, by their place in the planes of the fine receivers, for which no receiver is good enough.
    pub unmatched: Vec<u32>,
}

impl AddAssign for UpsampleCounts {
    fn add_assign(&mut self, other: Self) {
        self.changed += other.changed;
        self.unmatched.extend(other.unmatched);
    }
}

/// Writes the radiance of every pixel: `base`, the radiance without proxies, where they do nothing, else less what they hide
/// and more what they reflect. `base` and `out` are row by row without padding.
///
/// # Panics
/// If the buffers' sizes do not fit together.
pub fn upsample(
    coarse: &Receivers,
    shading: &Shading,
    fine: &Receivers,
    resampling: Resampling,
    upsampling: Upsampling,
    base: &[[f32; 3]],
    out: &mut [[f32; 3]],
) -> UpsampleCounts {
    let width = fine.width();
    assert!(base.len() == out.len() && out.len() == width * fine.height());
    assert_eq!(coarse.width(), width.div_ceil(resampling.scale));
    if width == 0 {
        return UpsampleCounts::default();
    }
    let rows = match (shading.len(), resampling.scale) {
        (2, 1) => add_rows::<2>,
        (5, 1) => add_rows::<5>,
        (10, 1) => add_rows::<10>,
        (17, 1) => add_rows::<17>,
        (26, 1) => add_rows::<26>,
        (_, 1) => add_rows::<37>,
        (2, _) => upsample_rows::<1, 1>,
        (5, _) => upsample_rows::<2, 4>,
        (10, _) => upsample_rows::<3, 9>,
        (17, _) => upsample_rows::<4, 16>,
        (26, _) => upsample_rows::<5, 25>,
        (_, _) => upsample_rows::<6, 36>,
    };
    let runs = runs(fine, coarse, resampling.scale);
    let chunks = out.par_chunks_mut(ROWS * width).zip(base.par_chunks(ROWS * width)).enumerate();
    let counts: Vec<UpsampleCounts> = chunks
        .map(|(i, (out, base))| {
            out.copy_from_slice(base);
            rows(coarse, shading, fine, resampling, upsampling, &runs, i * ROWS, out)
        })
        .collect();
    let mut total = UpsampleCounts::default();
    counts.into_iter().for_each(|counts| total += counts);
    total
}

/// Rows of pixels that one task handles.
const ROWS: usize = 8;
/// Pixels of a row handled together: as many as share their four receivers, at most.
const ACROSS: usize = 4;
/// Rows handled together.
const DOWN: usize = LANES / ACROSS;

/// The receivers on both sides of a pixel along one axis, and the weight of the second.
fn neighbours(pixel: usize, scale: usize, count: usize) -> ([usize; 2], f32) {
    let place = (pixel as f32 + 0.5) / scale as f32 - 0.5;
    let low = place.floor();
    let clamped = |at: f32| (at.max(0.0) as usize).min(count - 1);
    ([clamped(low), clamped(low + 1.0)], place - low)
}

/// Neighbours in a row that take from the same two columns of receivers.
struct Run {
    /// The first of the [`ACROSS`] pixels that are loaded.
    first: usize,
    /// Which of these belong to the run.
    live: Range<usize>,
    /// Columns of receivers.
    columns: [usize; 2],
    /// Weight of the second column, pixel by pixel.
    weights: [f32; ACROSS],
}

/// The runs of a row.
fn runs(fine: &Receivers, coarse: &Receivers, scale: usize) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for x in 0..fine.width() {
        let (columns, weight) = neighbours(x, scale, coarse.width());
        match runs.last_mut().filter(|run| run.columns == columns && run.live.len() < ACROSS) {
            Some(run) => run.live.end += 1,
            None => {
                // Nothing is loaded from behind the row.
                let first = x.min(fine.stride() - ACROSS);
                runs.push(Run { first, live: x - first..x - first + 1, columns, weights: [0.0; ACROSS] });
            }
        }
        if let Some(run) = runs.last_mut() {
            run.weights[x - run.first] = weight;
        }
    }
    runs
}

dispatch! {
    /// Some rows from `first` on, already filled with the radiance without proxies, where every pixel is its own receiver.
    add_rows [LEN] (
        _coarse: &Receivers,
        shading: &Shading,
        fine: &Receivers,
        _resampling: Resampling,
        _upsampling: Upsampling,
        _runs: &[Run],
        first: usize,
        out: &mut [[f32; 3]],
    ) -> UpsampleCounts {
        let mut counts = UpsampleCounts::default();
        for (row, out) in out.chunks_exact_mut(fine.width()).enumerate() {
            for (x, out) in out.iter_mut().enumerate() {
                let pixel = fine.index(x, first + row);
                if shading.touched[pixel] && fine.is_seen(pixel) {
                    counts.changed += 1;
                    add::<LEN>(fine, pixel, shading.rows(pixel).try_into().expect("rows are of one length"), out);
                }
            }
        }
        counts
    }
}

dispatch! {
    /// Some rows from `first` on, already filled with the radiance without proxies. Rows hold `LEN` = `BANDS` squared numbers
    /// of hidden light, 1 where they are shades.
    ///
    /// Eight pixels at a time that take from the same four receivers: the transfer vectors of all meet one receiver's rows after
    /// the other, and only colours are weighted.
    upsample_rows [BANDS, LEN] (
        coarse: &Receivers,
        shading: &Shading,
        fine: &Receivers,
        resampling: Resampling,
        upsampling: Upsampling,
        runs: &[Run],
        first: usize,
        out: &mut [[f32; 3]],
    ) -> UpsampleCounts {
        let scale = resampling.scale;
        let width = fine.width();
        let compare = upsampling == Upsampling::Bilateral;
        let least = Lanes::splat(if compare { LEAST_WEIGHT } else { f32::MIN_POSITIVE });
        let mut counts = UpsampleCounts::default();
        let end = first + out.len() / width;
        let mut y = first;
        while y < end {
            let (lines, below) = neighbours(y, scale, coarse.height());
            let (next, below_next) = neighbours(y + 1, scale, coarse.height());
            let rows = if y + 1 < end && next == lines { DOWN } else { 1 };
            let at = |lane: usize| if lane < ACROSS { below } else { below_next };
            let [above, under] = lines.map(|line| line * coarse.stride());
            let down = Lanes::each(at);
            for run in runs {
                let [left, right] = run.columns;
                let samples = [above + left, above + right, under + left, under + right];
                let touched = &shading.touched;
                if !(touched[samples[0]] | touched[samples[1]] | touched[samples[2]] | touched[samples[3]]) {
                    continue;
                }
                let place = [fine.index(run.first, y), fine.index(run.first, y + rows - 1)];
                let depth = pixels(&fine.depth, place);
                let mut live = [false; LANES];
                for (lane, live) in live.iter_mut().enumerate() {
                    *live = lane / ACROSS < rows && run.live.contains(&(lane % ACROSS)) && depth.0[lane] < Receivers::NOTHING;
                }
                if live == [false; LANES] {
                    continue;
                }
                let point = Group {
                    position: each_axis(&fine.position, place),
                    normal: each_axis(&fine.normal, place),
                };
                let across = Lanes::each(|lane| run.weights[lane % ACROSS]);
                let one = Lanes::splat(1.0);
                let mut weights =
                    [(one - across) * (one - down), across * (one - down), (one - across) * down, across * down];
                // Where nothing is seen any finite depth will do.
                let footprint = depth.min(Lanes::splat(f32::MAX)) * (resampling.pixel * scale as f32);
                for (weight, sample) in weights.iter_mut().zip(samples) {
                    *weight = *weight * agreement(coarse, sample, &point, footprint, compare);
                }
                let sum = weights[0] + weights[1] + weights[2] + weights[3];
                for lane in 0..LANES {
                    if live[lane] && sum.0[lane] < least.0[lane] {
                        live[lane] = false;
                        counts.unmatched.push((place[lane / ACROSS] + lane % ACROSS) as u32);
                    }
                }
                let inverse = one / sum.max(least);
                let transfer = transfers::<BANDS, LEN>(fine, place, point.normal);
                let mut change = [Lanes::ZERO; 3];
                for (weight, sample) in weights.iter().zip(samples) {
                    // Receivers of nothing have no weight.
                    if *weight == Lanes::ZERO {
                        continue;
                    }
                    let weight = *weight * inverse;
                    let (hidden, added) = shading.rows(sample).split_at(LEN);
                    for (colour, change) in change.iter_mut().enumerate() {
                        let mut irradiance = Lanes::splat(added[0][colour]);
                        for (transfer, hidden) in transfer.iter().zip(hidden) {
                            irradiance = irradiance - *transfer * hidden[colour];
                        }
                        *change += weight * irradiance;
                    }
                }
                let albedo = each_axis(&fine.albedo, place);
                for colour in 0..3 {
                    change[colour] = change[colour] * albedo[colour] * FRAC_1_PI;
                }
                for lane in 0..LANES {
                    if live[lane] {
                        counts.changed += 1;
                        let out = &mut out[(y - first + lane / ACROSS) * width + run.first + lane % ACROSS];
                        for colour in 0..3 {
                            // The exponential overshoots, and so may the hidden light: no surface is darker than black.
                            out[colour] = (out[colour] + change[colour].0[lane]).max(0.0);
                        }
                    }
                }
            }
            y += rows;
        }
        counts
    }
}

/// Eight pixels of a plane: four from each of two places on.
#[inline(always)]
fn pixels(plane: &[f32], [upper, lower]: [usize; 2]) -> Lanes {
    let mut lanes = Lanes::ZERO;
    lanes.0[..ACROSS].copy_from_slice(&plane[upper..upper + ACROSS]);
    lanes.0[ACROSS..].copy_from_slice(&plane[lower..lower + ACROSS]);
    lanes
}

#[inline(always)]
fn each_axis([x, y, z]: &[Vec<f32>; 3], place: [usize; 2]) -> [Lanes; 3] {
    [pixels(x, place), pixels(y, place), pixels(z, place)]
}

/// What eight pixels' hidden light is multiplied by: their transfer vectors, or 1 where only shades are kept.
#[inline(always)]
fn transfers<const BANDS: usize, const LEN: usize>(
    fine: &Receivers,
    place: [usize; 2],
    normal: [Lanes; 3],
) -> [Lanes; LEN] {
    if LEN == 1 {
        return [Lanes::splat(1.0); LEN];
    }
    if fine.transfer.is_empty() {
        return cosine_lanes::<BANDS, LEN>(normal);
    }
    let mut transfer = [Lanes::ZERO; LEN];
    for (transfer, plane) in transfer.iter_mut().zip(&fine.transfer) {
        *transfer = pixels(plane, place);
    }
    transfer
}

/// w^N w^z of equation 11 for eight pixels and one receiver: 0 if that sees nothing.
#[inline(always)]
fn agreement(coarse: &Receivers, sample: usize, pixels: &Group, footprint: Lanes, compare: bool) -> Lanes {
    if !coarse.is_seen(sample) {
        return Lanes::ZERO;
    }
    if !compare {
        return Lanes::splat(1.0);
    }
    let Group { position: p, normal: n } = pixels;
    let (mut cosine, mut distance) = (Lanes::ZERO, Lanes::ZERO);
    for axis in 0..3 {
        cosine += n[axis] * coarse.normal[axis][sample];
        distance += n[axis] * (Lanes::splat(coarse.position[axis][sample]) - p[axis]);
    }
    // The cosine's power 32.
    let c2 = cosine.max(Lanes::ZERO) * cosine.max(Lanes::ZERO);
    let c4 = c2 * c2;
    let c8 = c4 * c4;
    let c16 = c8 * c8;
    let half = footprint * PLANE_DISTANCE;
    c16 * c16 * half / (half + distance.max(-distance))
}

/// Adds to a pixel's radiance what proxies change of it.
#[inline(always)]
pub(super) fn add<const LEN: usize>(fine: &Receivers, pixel: usize, rows: &[[f32; 4]; LEN], out: &mut [f32; 3]) {
    let mut irradiance = rows[LEN - 1];
    match LEN {
        2 => less(&mut irradiance, rows, &[1.0]),
        5 => less(&mut irradiance, rows, &transfer_vector::<4>(fine, pixel)),
        10 => less(&mut irradiance, rows, &transfer_vector::<9>(fine, pixel)),
        17 => less(&mut irradiance, rows, &transfer_vector::<16>(fine, pixel)),
        26 => less(&mut irradiance, rows, &transfer_vector::<25>(fine, pixel)),
        _ => less(&mut irradiance, rows, &transfer_vector::<36>(fine, pixel)),
    }
    let albedo = [fine.albedo[0][pixel], fine.albedo[1][pixel], fine.albedo[2][pixel]];
    let change = radiance(albedo, [irradiance[0], irradiance[1], irradiance[2]]);
    // The exponential overshoots, and so may the hidden light: no surface is darker than black.
    for (out, change) in out.iter_mut().zip(change) {
        *out = (*out + change).max(0.0);
    }
}

/// Takes the hidden light under a transfer vector away.
#[inline(always)]
fn less(irradiance: &mut [f32; 4], rows: &[[f32; 4]], transfer: &[f32]) {
    for (t, hidden) in transfer.iter().zip(rows) {
        for i in 0..4 {
            irradiance[i] -= t * hidden[i];
        }
    }
}

/// Gathers single pixels into receivers of their own, rows as wide as a tile, to be shaded from scratch.
pub fn gather(fine: &Receivers, pixels: &[u32]) -> Receivers {
    const WIDTH: usize = TILE_GROUPS * LANES;
    let width = pixels.len().min(WIDTH);
    let height = pixels.len().div_ceil(WIDTH);
    let mut gathered = Receivers::nothing(width, height, fine.transfer.len());
    for (i, &pixel) in pixels.iter().enumerate() {
        gathered.copy(gathered.index(i % WIDTH, i / WIDTH), fine, pixel as usize);
    }
    gathered
}

/// Puts the shading of gathered pixels where they belong; `base` and `out` as in [`upsample`].
///
/// # Panics
/// If the shading is not that of the pixels gathered.
pub fn scatter(
    fine: &Receivers,
    pixels: &[u32],
    gathered: &Receivers,
    shading: &Shading,
    base: &[[f32; 3]],
    out: &mut [[f32; 3]],
) {
    let one = |i: usize, pixel: usize, out: &mut [f32; 3]| {
        let place = gathered.index(i % gathered.width(), i / gathered.width());
        let rows = shading.rows(place);
        let place = pixel;
        match rows.len() {
            2 => add::<2>(fine, place, rows.try_into().expect("two rows"), out),
            5 => add::<5>(fine, place, rows.try_into().expect("five rows"), out),
            10 => add::<10>(fine, place, rows.try_into().expect("ten rows"), out),
            17 => add::<17>(fine, place, rows.try_into().expect("17 rows"), out),
            26 => add::<26>(fine, place, rows.try_into().expect("26 rows"), out),
            _ => add::<37>(fine, place, rows.try_into().expect("37 rows"), out),
        }
    };
    for (i, &pixel) in pixels.iter().enumerate() {
        let pixel = pixel as usize;
        let (x, y) = (pixel % fine.stride(), pixel / fine.stride());
        let place = y * fine.width() + x;
        out[place] = base[place];
        one(i, pixel, &mut out[place]);
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::super::{Surface, Viewport, draw};
    use super::*;
    use crate::scene::Camera;

    /// A wall to the left at a distance of 2, and one far behind it to the right.
    fn walls() -> Surface {
        let wall = |x0: f32, x1: f32, z: f32| {
            [(x0, -9.0), (x1, -9.0), (x1, 9.0), (x0, 9.0)].map(|(x, y)| Vec3::new(x, y, z)).to_vec()
        };
        let positions = [wall(-9.0, 0.03, -2.0), wall(-90.0, 90.0, -12.0)].concat();
        Surface {
            normals: vec![Vec3::Z; positions.len()],
            positions,
            triangles: [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]].into(),
            albedo: vec![Vec3::ONE; 4],
            ..Surface::default()
        }
    }

    /// Radiance where the near wall hides irradiance 1 and the far one none.
    fn picture(upsampling: Upsampling) -> (Vec<[f32; 3]>, UpsampleCounts, Receivers) {
        let camera = Camera::new(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 60.0, [64, 48]).unwrap();
        let [fine, coarse] = [1, 4].map(|scale| {
            let viewport = Viewport { camera: camera.clone(), scale };
            let mut receivers = viewport.nothing(0);
            draw(&viewport, &walls(), &mut receivers);
            receivers
        });
        let places = coarse.stride() * coarse.height();
        let near = |i: usize| coarse.depth[i] < 5.0;
        let mut values = Vec::new();
        (0..places).for_each(|i| values.extend([[if near(i) { 1.0 } else { 0.0 }; 4], [0.0; 4]]));
        let shading = Shading { len: 2, values, touched: vec![true; places] };
        let base = vec![[1.0; 3]; 64 * 48];
        let mut out = vec![[0.0; 3]; base.len()];
        let pixel = Viewport { camera, scale: 1 }.pixel();
        let counts = upsample(&coarse, &shading, &fine, Resampling { scale: 4, pixel }, upsampling, &base, &mut out);
        (out, counts, fine)
    }

    #[test]
    fn bilateral_weights_do_not_reach_over_silhouettes() {
        let dark = 1.0 - std::f32::consts::FRAC_1_PI;
        let [bled, kept] = [Upsampling::Bilinear, Upsampling::Bilateral].map(picture);
        let error = |(out, counts, fine): &(Vec<[f32; 3]>, UpsampleCounts, Receivers)| {
            let pixels = (0..out.len()).filter(|i| !counts.unmatched.contains(&(*i as u32)));
            pixels.map(|i| (out[i][0] - if fine.depth[i] < 5.0 { dark } else { 1.0 }).abs()).fold(0.0, f32::max)
        };
        assert!(error(&bled) > 0.1, "{}", error(&bled));
        // Ten units apart, receivers of the other wall weigh 6e-3 at most, times seven where they are nearer.
        assert!(error(&kept) < 7.0 * 6e-3 * std::f32::consts::FRAC_1_PI, "{}", error(&kept));
        assert!(bled.1.unmatched.is_empty() && kept.1.unmatched.len() < 100, "{}", kept.1.unmatched.len());
    }

    #[test]
    fn pixels_shaded_anew_come_back_to_their_places() {
        let (mut out, _, fine) = picture(Upsampling::Bilateral);
        let pixels: Vec<u32> = (0..out.len() as u32).step_by(3).collect();
        let gathered = gather(&fine, &pixels);
        assert_eq!((gathered.width(), gathered.height()), (16, 64));
        let places = gathered.stride() * gathered.height();
        // Each pixel reflects its own number.
        let mut values = vec![[0.0; 4]; 2 * places];
        for (i, pixel) in pixels.iter().enumerate() {
            let place = gathered.index(i % 16, i / 16);
            assert_eq!(gathered.point(place), fine.point(*pixel as usize));
            values[2 * place + 1] = [*pixel as f32; 4];
        }
        let shading = Shading { len: 2, values, touched: vec![true; places] };
        let base = vec![[0.0; 3]; out.len()];
        scatter(&fine, &pixels, &gathered, &shading, &base, &mut out);
        for pixel in pixels {
            let expected = pixel as f32 * std::f32::consts::FRAC_1_PI;
            assert!((out[pixel as usize][1] - expected).abs() <= 1e-6 * expected);
        }
    }
}
