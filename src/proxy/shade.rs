//! The shading pass: light that the proxies hide and light that they add, at every receiver.

use std::f32::consts::PI;
use std::fmt;
use std::sync::LazyLock;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::exponential::ONE;
use super::harmonic_buffer::HarmonicBuffer;
use super::lanes::{LANES, Lanes, dispatch};
use super::light::{DistantLight, cosine_harmonics};
use super::{MAX_BANDS, Receivers, basis};
use crate::sphere::{Order, clamped_cosine};

/// What is kept of the shading at every receiver, to be interpolated between receivers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum Interpolant {
    /// The hidden light in spherical harmonics, applied to every pixel's own normal.
    #[default]
    Vectors,
    /// The hidden irradiance under the receiver's normal: cheaper, and blunt where normals vary.
    Shades,
}

impl fmt::Display for Interpolant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Vectors => "vectors",
            Self::Shades => "shades",
        })
    }
}

/// The shading of every receiver.
///
/// For the receiver at place i of the planes of [`Receivers`], rows `i * len()..` of `values`: `len() - 1` rows of hidden
/// light (R, G, B, unused), then the irradiance that the proxies reflect.
#[derive(Clone, Debug, Default)]
pub struct Shading {
    pub(super) len: usize,
    /// Rows, see above.
    pub values: Vec<[f32; 4]>,
    /// Whether any proxy does anything at the receiver.
    pub touched: Vec<bool>,
}

impl Shading {
    /// Rows per receiver.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no receiver.
    pub fn is_empty(&self) -> bool {
        self.touched.is_empty()
    }

    /// The rows of the receiver at a place.
    #[inline(always)]
    pub fn rows(&self, index: usize) -> &[[f32; 4]] {
        &self.values[index * self.len..][..self.len]
    }

    /// Places at which proxies do something.
    pub fn count_touched(&self) -> usize {
        self.touched.iter().filter(|touched| **touched).count()
    }
}

/// A distant light as the shading pass wants it.
#[derive(Clone, Debug)]
pub struct ShadingLight {
    order: Order,
    /// Coefficients per colour, R, G, B.
    coefficients: Vec<[f32; 3]>,
    /// Product matrices: row k, column j, colour.
    product: Vec<[f32; 3]>,
}

impl ShadingLight {
    /// Prepares a light.
    pub fn new(light: &DistantLight) -> Self {
        let matrices = light.product_matrices();
        let coefficients = light.coefficients();
        Self {
            order: light.order(),
            coefficients: (0..light.order().len()).map(|k| [0, 1, 2].map(|c| coefficients[c][k] as f32)).collect(),
            product: (0..matrices[0].len()).map(|i| [0, 1, 2].map(|c| matrices[c][i])).collect(),
        }
    }

    /// The order of the light, and of the visibility.
    pub fn order(&self) -> Order {
        self.order
    }

    /// Coefficients, colours side by side.
    pub fn coefficients(&self) -> &[[f32; 3]] {
        &self.coefficients
    }

    /// Product matrices, colours side by side: hidden light k is the sum over j of `product()[k * order.len() + j]` times
    /// coefficient j of 1 - visibility.
    pub fn product(&self) -> &[[f32; 3]] {
        &self.product
    }

    /// Coefficients of hidden light that a receiver needs: those in which its transfer vector is not zero. Without a transfer
    /// vector those of the clamped cosine: bands 0 to 2, from order 5 on 0 to 4.
    pub fn needed(&self, receivers: &Receivers) -> usize {
        let bands = self.order.bands();
        match receivers.transfer.is_empty() {
            true if bands <= 4 => self.order.len().min(9),
            true => 25,
            false => self.order.len(),
        }
    }

    /// Irradiance without proxies at a place.
    pub fn unshadowed(&self, receivers: &Receivers, index: usize) -> [f32; 3] {
        match self.needed(receivers) {
            4 => self.sum::<4>(receivers, index),
            9 => self.sum::<9>(receivers, index),
            16 => self.sum::<16>(receivers, index),
            25 => self.sum::<25>(receivers, index),
            _ => self.sum::<36>(receivers, index),
        }
    }

    #[inline(always)]
    fn sum<const LEN: usize>(&self, receivers: &Receivers, index: usize) -> [f32; 3] {
        let transfer = transfer_vector::<LEN>(receivers, index);
        let mut sum = [0.0; 3];
        for (t, light) in transfer.iter().zip(&self.coefficients) {
            for colour in 0..3 {
                sum[colour] += t * light[colour];
            }
        }
        sum
    }
}

/// The transfer vector of one receiver, cut off after `LEN` coefficients: its own, or else the clamped cosine about its normal.
#[inline(always)]
pub(super) fn transfer_vector<const LEN: usize>(receivers: &Receivers, index: usize) -> [f32; LEN] {
    if receivers.transfer.is_empty() {
        let mut out = [0.0; LEN];
        cosine_into(receivers.normal_at(index), &mut out);
        out
    } else {
        std::array::from_fn(|k| receivers.transfer[k][index])
    }
}

/// The first coefficients of the clamped cosine about `n`: as many as `out` has, a square of a number of bands up to 6.
#[inline(always)]
pub(super) fn cosine_into(n: Vec3, out: &mut [f32]) {
    if out.len() <= 9 {
        let len = out.len();
        out.copy_from_slice(&cosine_harmonics(n)[..len]);
    } else {
        let order = Order::new(out.len().isqrt()).unwrap_or(Order::MAX);
        let exact = clamped_cosine(order, n.as_dvec3().normalize_or(DVec3::Z));
        out.iter_mut().zip(exact).for_each(|(out, x)| *out = x as f32);
    }
}

/// What the clamped cosine multiplies the harmonics of every band with.
pub(super) static COSINE: LazyLock<[f32; MAX_BANDS]> = LazyLock::new(|| {
    let zonal = clamped_cosine(Order::new(MAX_BANDS).expect("an order"), DVec3::Z);
    std::array::from_fn(|l| ((4.0 * std::f64::consts::PI / (2 * l + 1) as f64).sqrt() * zonal[l * l + l]) as f32)
});

/// The clamped cosine about eight normals: `LEN` = `BANDS` squared coefficients.
#[inline(always)]
pub(super) fn cosine_lanes<const BANDS: usize, const LEN: usize>(normal: [Lanes; 3]) -> [Lanes; LEN] {
    let mut y = basis::<BANDS, LEN>(normal);
    for (l, factor) in COSINE.iter().enumerate().take(BANDS) {
        y[l * l..(l + 1) * (l + 1)].iter_mut().for_each(|y| *y = *y * *factor);
    }
    y
}

/// Shades every receiver: hidden light from the visibility, and reflected light from the indirect pass, if there was one, with
/// overlap taken back. Returns the number of groups of eight that no proxy touches.
///
/// With the summed solid angle w of the proxies and the visibility O of the environment, what is reflected is weighted by
/// (4 pi - sqrt(4 pi) O_0) / w, the solid angle of the union over the sum (Sloan et al. 2007, equation 12): 0 for 0 / 0 and never
/// more than 1, so that overlap adds no light.
///
/// # Panics
/// If the buffers are of other sizes than the receivers, or of another order than the light.
pub fn shade(
    receivers: &Receivers,
    visibility: &HarmonicBuffer,
    indirect: Option<&HarmonicBuffer>,
    light: &ShadingLight,
    interpolant: Interpolant,
    out: &mut Shading,
) -> u64 {
    assert_eq!(visibility.len(), light.order.len());
    let places = receivers.stride() * receivers.height();
    let needed = light.needed(receivers);
    out.len = match interpolant {
        Interpolant::Vectors => needed + 1,
        Interpolant::Shades => 2,
    };
    out.values.resize(places * out.len, [0.0; 4]);
    out.touched.resize(places, false);
    let len = out.len;
    /// Groups that one task handles.
    const CHUNK: usize = 128;
    let values = out.values.par_chunks_mut(CHUNK * LANES * len);
    let touched = out.touched.par_chunks_mut(CHUNK * LANES);
    let chunks = values.zip(touched).enumerate();
    chunks
        .map(|(i, (values, touched))| {
            shade_chunk(receivers, visibility, indirect, light, interpolant, needed, i * CHUNK, values, touched)
        })
        .sum()
}

dispatch! {
    /// A run of groups from `first` on.
    shade_chunk [] (
        receivers: &Receivers,
        visibility: &HarmonicBuffer,
        indirect: Option<&HarmonicBuffer>,
        light: &ShadingLight,
        interpolant: Interpolant,
        needed: usize,
        first: usize,
        values: &mut [[f32; 4]],
        touched: &mut [bool],
    ) -> u64 {
        let len = values.len() / touched.len();
        let coefficients = light.order.len();
        let mut untouched = 0;
        for (i, (values, touched)) in values.chunks_exact_mut(LANES * len).zip(touched.chunks_exact_mut(LANES)).enumerate() {
            let group = first + i;
            // 1 - O, exactly zero where there is no proxy.
            let mut blocked = [Lanes::ZERO; 36];
            let mut any = false;
            for (k, (blocked, visibility)) in blocked.iter_mut().zip(visibility.group(group)).enumerate() {
                *blocked = Lanes::splat(if k == 0 { ONE } else { 0.0 }) - *visibility;
                any |= *blocked != Lanes::ZERO;
            }
            let reflected = indirect.map(|indirect| reflected(indirect.group(group), blocked[0]));
            any |= reflected.is_some_and(|colours| colours.iter().any(|lanes| *lanes != Lanes::ZERO));
            touched.fill(any);
            if !any {
                untouched += 1;
                values.fill([0.0; 4]);
                continue;
            }
            let mut shades = [Lanes::ZERO; 3];
            let mut transfer = [[0.0; 36]; LANES];
            if interpolant == Interpolant::Shades {
                for (lane, transfer) in transfer.iter_mut().enumerate() {
                    let index = group * LANES + lane;
                    if receivers.transfer.is_empty() {
                        cosine_into(receivers.normal_at(index), &mut transfer[..needed]);
                    } else {
                        transfer.iter_mut().zip(&receivers.transfer).for_each(|(t, plane)| *t = plane[index]);
                    }
                }
            }
            #[expect(clippy::needless_range_loop, reason = "the second index, across the lanes' rows")]
            for k in 0..needed {
                let row = &light.product[k * coefficients..(k + 1) * coefficients];
                let mut hidden = [Lanes::ZERO; 3];
                for (matrix, blocked) in row.iter().zip(&blocked) {
                    for colour in 0..3 {
                        hidden[colour] += *blocked * matrix[colour];
                    }
                }
                match interpolant {
                    Interpolant::Vectors => scatter(values, len, k, &hidden),
                    Interpolant::Shades => {
                        let t = Lanes::each(|lane| transfer[lane][k]);
                        shades.iter_mut().zip(hidden).for_each(|(sum, hidden)| *sum += t * hidden);
                    }
                }
            }
            if interpolant == Interpolant::Shades {
                scatter(values, len, 0, &shades);
            }
            scatter(values, len, len - 1, &reflected.unwrap_or([Lanes::ZERO; 3]));
        }
        untouched
    }
}

/// Writes a row of eight receivers.
#[inline(always)]
fn scatter(values: &mut [[f32; 4]], len: usize, row: usize, colours: &[Lanes; 3]) {
    for lane in 0..LANES {
        let [r, g, b] = colours;
        values[lane * len + row] = [r.0[lane], g.0[lane], b.0[lane], 0.0];
    }
}

/// Irradiance reflected by proxies, overlap taken back.
#[inline(always)]
fn reflected(indirect: &[Lanes], blocked: Lanes) -> [Lanes; 3] {
    let solid_angle = indirect[3];
    let union = (blocked * ONE).max(Lanes::ZERO);
    let ratio = union / solid_angle.max(Lanes::splat(f32::MIN_POSITIVE));
    let weight = Lanes::ZERO.where_below(solid_angle, ratio.min(Lanes::splat(1.0)), Lanes::ZERO);
    // The cosine's three bands are negative somewhere behind the receiver.
    let colour = |k: usize| (indirect[k] * weight).max(Lanes::ZERO);
    [colour(0), colour(1), colour(2)]
}

/// Radiance of a diffuse surface under an irradiance.
#[inline(always)]
pub(super) fn radiance([r, g, b]: [f32; 3], irradiance: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = irradiance;
    [r * (1.0 / PI) * x, g * (1.0 / PI) * y, b * (1.0 / PI) * z]
}

/// Bands up to which [`basis`] reaches are those of the longest transfer vector.
const _: () = assert!(MAX_BANDS * MAX_BANDS == 36);
