//! Upsampling: from the shading of the coarse receivers to the pixels of the display (Sloan et al. 2007, section 4.2).

use std::fmt;
use std::ops::AddAssign;

use rayon::prelude::*;

use super::Receivers;
use super::lanes::{LANES, dispatch};
use super::shade::{Shading, radiance, transfer_vector};

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
    /// Rows that one task handles.
    const ROWS: usize = 8;
    let rows = match shading.len() {
        2 => upsample_rows::<2>,
        5 => upsample_rows::<5>,
        10 => upsample_rows::<10>,
        17 => upsample_rows::<17>,
        26 => upsample_rows::<26>,
        _ => upsample_rows::<37>,
    };
    let chunks = out.par_chunks_mut(ROWS * width).zip(base.par_chunks(ROWS * width)).enumerate();
    let counts: Vec<UpsampleCounts> = chunks
        .map(|(i, (out, base))| {
            out.copy_from_slice(base);
            rows(coarse, shading, fine, resampling, upsampling, i * ROWS, out)
        })
        .collect();
    let mut total = UpsampleCounts::default();
    counts.into_iter().for_each(|counts| total += counts);
    total
}

/// The receivers on both sides of a pixel along one axis, and the weight of the second.
fn neighbours(pixel: usize, scale: usize, count: usize) -> (usize, usize, f32) {
    let place = (pixel as f32 + 0.5) / scale as f32 - 0.5;
    let low = place.floor();
    let first = (low.max(0.0) as usize).min(count - 1);
    let second = ((low + 1.0).max(0.0) as usize).min(count - 1);
    (first, second, place - low)
}

dispatch! {
    /// Some rows from `first` on, already filled with the radiance without proxies.
    upsample_rows [LEN] (
        coarse: &Receivers,
        shading: &Shading,
        fine: &Receivers,
        resampling: Resampling,
        upsampling: Upsampling,
        first: usize,
        out: &mut [[f32; 3]],
    ) -> UpsampleCounts {
        let scale = resampling.scale;
        let mut counts = UpsampleCounts::default();
        let columns: Vec<_> = (0..fine.width()).map(|x| neighbours(x, scale, coarse.width())).collect();
        for (row, out) in out.chunks_exact_mut(fine.width()).enumerate() {
            let y = first + row;
            let (y0, y1, ty) = neighbours(y, scale, coarse.height());
            for ((x, out), &(x0, x1, tx)) in out.iter_mut().enumerate().zip(&columns) {
                let [above, below] = [y0 * coarse.stride(), y1 * coarse.stride()];
                let samples = [above + x0, above + x1, below + x0, below + x1];
                let touched = &shading.touched;
                if !(touched[samples[0]] | touched[samples[1]] | touched[samples[2]] | touched[samples[3]]) {
                    continue;
                }
                let pixel = fine.index(x, y);
                if !fine.is_seen(pixel) {
                    continue;
                }
                let mut weights = [(1.0 - tx) * (1.0 - ty), tx * (1.0 - ty), (1.0 - tx) * ty, tx * ty];
                if scale > 1 {
                    let compare = upsampling == Upsampling::Bilateral;
                    let agreement = agreement(coarse, samples, fine, pixel, resampling, compare);
                    for (weight, agreement) in weights.iter_mut().zip(agreement) {
                        *weight *= agreement;
                    }
                }
                let sum = weights[0] + weights[1] + weights[2] + weights[3];
                let least = if upsampling == Upsampling::Bilateral { LEAST_WEIGHT } else { f32::MIN_POSITIVE };
                if sum < least {
                    counts.unmatched.push(pixel as u32);
                    continue;
                }
                counts.changed += 1;
                let inverse = 1.0 / sum;
                let mut rows = [[0.0f32; 4]; LEN];
                for (weight, sample) in weights.iter().zip(samples) {
                    let weight = weight * inverse;
                    // Of weight zero are the second neighbours where there is no upsampling, and receivers of nothing.
                    if weight == 0.0 {
                        continue;
                    }
                    let values: &[[f32; 4]; LEN] = shading.rows(sample).try_into().expect("rows are of one length");
                    for (sum, value) in rows.as_flattened_mut().iter_mut().zip(values.as_flattened()) {
                        *sum += weight * value;
                    }
                }
                add(fine, pixel, &rows, out);
            }
        }
        counts
    }
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

/// w^N w^z of equation 11 for four receivers: 0 for those that see nothing.
#[inline(always)]
fn agreement(
    coarse: &Receivers,
    samples: [usize; 4],
    fine: &Receivers,
    pixel: usize,
    resampling: Resampling,
    compare: bool,
) -> [f32; 4] {
    // Four at a time: planes of the receivers' normals and distances first.
    let (mut cosine, mut distance, mut seen) = ([0.0f32; 4], [0.0f32; 4], [0.0f32; 4]);
    let (p, n) = (fine.point(pixel), fine.normal_at(pixel));
    for axis in 0..3 {
        let (normals, positions) = (&coarse.normal[axis], &coarse.position[axis]);
        for k in 0..4 {
            cosine[k] += n[axis] * normals[samples[k]];
            distance[k] += n[axis] * (positions[samples[k]] - p[axis]);
        }
    }
    for k in 0..4 {
        seen[k] = if coarse.depth[samples[k]] < Receivers::NOTHING { 1.0 } else { 0.0 };
    }
    if !compare {
        return seen;
    }
    let half = PLANE_DISTANCE * resampling.pixel * resampling.scale as f32 * fine.depth[pixel];
    for k in 0..4 {
        // The cosine's power 32.
        let c2 = cosine[k].max(0.0) * cosine[k].max(0.0);
        let c4 = c2 * c2;
        let c8 = c4 * c4;
        let c16 = c8 * c8;
        seen[k] *= c16 * c16 * half / (half + distance[k].abs());
    }
    seen
}

/// Gathers single pixels into receivers of their own, rows of up to 1024, to be shaded from scratch.
pub fn gather(fine: &Receivers, pixels: &[u32]) -> Receivers {
    const WIDTH: usize = 64 * LANES;
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
        assert_eq!((gathered.width(), gathered.height()), (512, 2));
        let places = gathered.stride() * gathered.height();
        // Each pixel reflects its own number.
        let mut values = vec![[0.0; 4]; 2 * places];
        for (i, pixel) in pixels.iter().enumerate() {
            let place = gathered.index(i % 512, i / 512);
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
