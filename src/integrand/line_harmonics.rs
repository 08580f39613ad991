use std::f64::consts::{PI, TAU};

use crate::sphere::{Order, angle, index, rotate};
use crate::visibility::{MeridianFrame, Meridians, Spans};

/// Integrals of spherical harmonics over the visible spans of meridians, in closed form.
///
/// In the axes of the chart ([`Meridians`]) a harmonic is P_lm(v) times cos m u or sin m u. Its antiderivative along an
/// isoline is, with c^2 = 1 - v^2, a polynomial in v for even m, and c times a polynomial in v plus a multiple of the
/// latitude for odd m: so every visible span contributes the powers of v, their products with c, and the latitude at its
/// ends, and all harmonics are linear combinations of the sums of these, weighted by cos m u and sin m u.
///
/// All isolines have the same weight 2 pi / N. What is smooth in u, the whole hemisphere for instance, is periodic, and its error
/// falls exponentially with N; errors arise where visibility changes.
#[derive(Clone, Debug)]
pub struct LineHarmonics {
    order: Order,
    /// For every isoline and m: cos m u and sin m u, times 2 pi / N.
    waves: Vec<[f64; 2]>,
    /// For every l and m <= l the factors of the powers, and of the latitude.
    antiderivatives: Vec<(Vec<f64>, f64)>,
    /// From every frame's axes to the world's: the matrices of all bands, one after another, row-major.
    rotations: [Vec<f64>; MeridianFrame::COUNT],
}

/// Working memory, and what the visible spans of a receiver add up to.
#[derive(Clone, Debug, Default)]
pub struct LineMoments {
    /// Integrals of all harmonics, `order^2`, over the isolines of even and of odd number. Their sum is the integral; either,
    /// doubled, is the integral with half as many isolines.
    pub sets: [Vec<f64>; 2],
    sines: Vec<f64>,
    cosines: Vec<f64>,
    latitudes: Vec<f64>,
}

/// Sums over isolines of one kind, by m, cosine and sine: of W powers, and of the latitude.
struct Sums<const W: usize> {
    powers: [[[f64; W]; 2]; W],
    latitudes: [[f64; 2]; W],
}

impl LineHarmonics {
    /// Tables for all bands of `order` along these isolines.
    pub fn new(order: Order, meridians: &Meridians) -> Self {
        let (bands, lines) = (order.bands(), meridians.len());
        let wave = |line: usize, m: usize| {
            let (sin, cos) = (m as f64 * meridians.u(line)).sin_cos();
            [cos, sin].map(|x| x * TAU / lines as f64)
        };
        Self {
            order,
            waves: (0..lines).flat_map(|line| (0..bands).map(move |m| wave(line, m))).collect(),
            antiderivatives: (0..bands).flat_map(|l| (0..=l).map(move |m| antiderivative(l, m, bands))).collect(),
            rotations: std::array::from_fn(|octant| rotation(order, MeridianFrame::of_octant(octant))),
        }
    }

    /// The bands integrated.
    pub fn order(&self) -> Order {
        self.order
    }

    /// Turns harmonics from the axes of a frame to the world's, and adds them to `out`.
    pub fn turn(&self, frame: MeridianFrame, harmonics: &[f64], out: &mut [f64]) {
        let mut matrices = &*self.rotations[frame.octant()];
        for l in 0..self.order.bands() {
            let band = l * l..(l + 1) * (l + 1);
            for out in &mut out[band.clone()] {
                let (row, rest) = matrices.split_at(2 * l + 1);
                *out += row.iter().zip(&harmonics[band.clone()]).map(|(m, f)| m * f).sum::<f64>();
                matrices = rest;
            }
        }
    }

    /// Integrates over the visible spans, in the axes of the chart.
    pub fn integrate(&self, spans: &Spans, moments: &mut LineMoments) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.integrate_avx2(spans, moments) };
        }
        self.integrate_inline(spans, moments);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn integrate_avx2(&self, spans: &Spans, moments: &mut LineMoments) {
        self.integrate_inline(spans, moments);
    }

    #[inline(always)]
    fn integrate_inline(&self, spans: &Spans, moments: &mut LineMoments) {
        moments.resolve(spans.ends());
        for values in &mut moments.sets {
            values.clear();
            values.resize(self.order.len(), 0.0);
        }
        match self.order.bands() {
            ..=2 => self.sum::<2>(spans, moments),
            3..=4 => self.sum::<4>(spans, moments),
            5..=8 => self.sum::<8>(spans, moments),
            _ => self.sum::<12>(spans, moments),
        }
    }

    #[inline(always)]
    fn sum<const W: usize>(&self, spans: &Spans, moments: &mut LineMoments) {
        let bands = self.order.bands();
        let mut sets = [Sums::<W>::ZERO, Sums::<W>::ZERO];
        for (line, waves) in self.waves.chunks_exact(bands).enumerate() {
            let (mut even, mut odd, mut latitude) = ([0.0; W], [0.0; W], 0.0);
            let mut sign = -1.0;
            let ends = spans.of(line);
            if ends.is_empty() {
                continue;
            }
            for end in ends {
                let (v, c) = (moments.sines[end], moments.cosines[end]);
                let mut power = sign;
                for j in 0..W {
                    odd[j] += c * power;
                    power *= v;
                    even[j] += power;
                }
                latitude += sign * moments.latitudes[end];
                sign = -sign;
            }
            sets[line % 2].add(waves, &even, &odd, latitude);
        }
        for (sums, out) in sets.iter().zip(&mut moments.sets) {
            let mut rows = self.antiderivatives.iter();
            for l in 0..bands {
                for (m, (factors, slope)) in (0..=l).zip(&mut rows) {
                    // The sine of m = 0 is overwritten.
                    for (wave, at) in [index(l, m as isize), index(l, -(m as isize))].into_iter().enumerate().rev() {
                        let powers = sums.powers[m][wave].iter().zip(factors);
                        let powers: f64 = powers.map(|(sum, factor)| sum * factor).sum();
                        out[at] = powers + slope * sums.latitudes[m][wave];
                    }
                }
            }
        }
    }
}

impl LineMoments {
    /// Sines and cosines of the latitudes, and these themselves, from their tangents.
    #[inline(always)]
    fn resolve(&mut self, tangents: &[f64]) {
        let count = tangents.len();
        for values in [&mut self.sines, &mut self.cosines, &mut self.latitudes] {
            values.resize(count, 0.0);
        }
        let (sines, cosines) = (&mut self.sines[..count], &mut self.cosines[..count]);
        let latitudes = &mut self.latitudes[..count];
        for i in 0..count {
            let tangent = tangents[i];
            let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
            cosines[i] = cosine;
            sines[i] = tangent * cosine;
            latitudes[i] = angle(1.0, tangent.abs()).copysign(tangent);
        }
    }
}

impl<const W: usize> Sums<W> {
    const ZERO: Self = Self { powers: [[[0.0; W]; 2]; W], latitudes: [[0.0; 2]; W] };

    /// Adds an isoline: the powers of v and their products with c.
    #[inline(always)]
    fn add(&mut self, waves: &[[f64; 2]], even: &[f64; W], odd: &[f64; W], latitude: f64) {
        for (m, waves) in waves.iter().enumerate().take(W) {
            let powers = if m % 2 == 0 { even } else { odd };
            for (wave, factor) in waves.iter().enumerate() {
                for (sum, power) in self.powers[m][wave].iter_mut().zip(powers) {
                    *sum += factor * power;
                }
                self.latitudes[m][wave] += factor * latitude;
            }
        }
    }
}

/// The matrices of all bands that turn harmonics from the axes of a frame to the world's.
fn rotation(order: Order, frame: MeridianFrame) -> Vec<f64> {
    let columns: Vec<Vec<f64>> = (0..order.len())
        .map(|i| {
            let (mut unit, mut column) = (vec![0.0; order.len()], vec![0.0; order.len()]);
            unit[i] = 1.0;
            rotate(order, frame.axes(), &unit, &mut column);
            column
        })
        .collect();
    let bands = (0..order.bands()).map(|l| l * l..(l + 1) * (l + 1));
    let places = bands.flat_map(|band| band.clone().flat_map(move |i| band.clone().map(move |j| (i, j))));
    places.map(|(i, j)| columns[j][i]).collect()
}

/// The antiderivative of P_lm(v), normalised as the harmonics are: for even m the factors of v, v^2, .., for odd m those of
/// c, c v, c v^2, .. and that of the latitude.
fn antiderivative(l: usize, m: usize, bands: usize) -> (Vec<f64>, f64) {
    let integrand = legendre(l, m);
    let mut factors = vec![0.0; bands];
    if m.is_multiple_of(2) {
        factors.iter_mut().zip(&integrand).enumerate().for_each(|(k, (factor, x))| *factor = x / (k + 1) as f64);
        return (factors, 0.0);
    }
    // With K_k the integral of c v^k: (k + 2) K_k = (k - 1) K_(k-2) - c^3 v^(k-1), K_0 = (c v + latitude) / 2.
    let mut slope = 0.0;
    for (k, &x) in integrand.iter().enumerate() {
        let (mut k, mut x) = (k, x);
        while k > 0 {
            let part = x / (k + 2) as f64;
            factors[k - 1] -= part;
            factors[k + 1] += part;
            if k == 1 {
                break;
            }
            x = part * (k - 1) as f64;
            k -= 2;
        }
        if k == 0 {
            factors[1] += 0.5 * x;
            slope += 0.5 * x;
        }
    }
    (factors, slope)
}

/// P_lm, normalised as the harmonics are, as a polynomial in v; for odd m times c.
fn legendre(l: usize, m: usize) -> Vec<f64> {
    let multiply = |p: &[f64], q: &[f64]| {
        let mut product = vec![0.0; p.len() + q.len() - 1];
        for (i, p) in p.iter().enumerate() {
            q.iter().enumerate().for_each(|(j, q)| product[i + j] += p * q);
        }
        product
    };
    let sides = if m == 0 { 1.0 } else { 2.0 };
    let norm = (l - m + 1..=l + m).fold(sides * (2 * l + 1) as f64 / (4.0 * PI), |x, k| x / k as f64).sqrt();
    let (mut below, mut p) = (vec![0.0], vec![(0..m).fold(norm, |x, k| x * (2 * k + 1) as f64)]);
    for k in m..l {
        let mut next = multiply(&p, &[0.0, (2 * k + 1) as f64]);
        next.iter_mut().zip(&below).for_each(|(next, x)| *next -= (k + m) as f64 * x);
        next.iter_mut().for_each(|x| *x /= (k + 1 - m) as f64);
        (below, p) = (p, next);
    }
    (0..m / 2).fold(p, |p, _| multiply(&p, &[1.0, 0.0, -1.0]))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::sphere::{evaluate, gauss_legendre, hemisphere};

    fn orders() -> impl Iterator<Item = Order> {
        [1, 2, 3, 4, 5, 8, 10].into_iter().map(|bands| Order::new(bands).unwrap()).chain([Order::MAX.raised()])
    }

    fn sum(moments: &LineMoments) -> Vec<f64> {
        let [even, odd] = &moments.sets;
        even.iter().zip(odd).map(|(even, odd)| even + odd).collect()
    }

    /// The error falls with the power N of the tangent of half the pole's distance from the normal.
    #[test]
    fn hemispheres_are_as_good_as_exact() {
        let meridians = Meridians::new(96).unwrap();
        for order in orders() {
            let table = LineHarmonics::new(order, &meridians);
            for normal in [DVec3::Y, DVec3::NEG_X, DVec3::new(0.6, 0.0, -0.8)] {
                let frame = MeridianFrame::facing(Some(normal), false);
                let n = frame.axes().transpose() * normal;
                let horizon = |line: usize| {
                    let (sin, cos) = meridians.u(line).sin_cos();
                    (n.x * cos + n.y * sin) / -n.z
                };
                let spans: Vec<_> = (0..96).map(|line| [(-Meridians::POLE, horizon(line))]).collect();
                let spans = Spans::new(&spans.iter().map(|line| &line[..]).collect::<Vec<_>>());
                let mut moments = LineMoments::default();
                table.integrate(&spans, &mut moments);
                let mut turned = vec![0.0; order.len()];
                table.turn(frame, &sum(&moments), &mut turned);
                for (i, (value, expected)) in turned.iter().zip(hemisphere(order, normal)).enumerate() {
                    assert!((value - expected).abs() < 1e-12, "{order:?} {normal} {i} {value} {expected}");
                }
            }
        }
    }

    #[test]
    fn spans_are_integrated_exactly() {
        let meridians = Meridians::new(12).unwrap();
        for order in orders() {
            let table = LineHarmonics::new(order, &meridians);
            for (line, spans) in [
                (0, vec![(-0.7, 0.3)]),
                (5, vec![(-Meridians::POLE, -1e-3), (0.4, 7.0)]),
                (11, vec![(-900.0, -4.0), (-1.0, 0.0), (2.5, Meridians::POLE)]),
            ] {
                let mut moments = LineMoments::default();
                let all: Vec<&[(f64, f64)]> = (0..12).map(|i| if i == line { &spans[..] } else { &[] }).collect();
                table.integrate(&Spans::new(&all), &mut moments);
                let mut expected = vec![0.0; order.len()];
                let mut y = vec![0.0; order.len()];
                for &(from, to) in &spans {
                    let (a, b) = (f64::atan(from), f64::atan(to));
                    for (s, weight) in gauss_legendre(40) {
                        let (v, c) = (0.5 * (a + b) + 0.5 * (b - a) * s).sin_cos();
                        let (sin, cos) = meridians.u(line).sin_cos();
                        evaluate(order, DVec3::new(c * cos, c * sin, v), &mut y);
                        let weight = 0.5 * (b - a) * c * TAU / 12.0 * weight;
                        expected.iter_mut().zip(&y).for_each(|(sum, y)| *sum += weight * y);
                    }
                }
                for (i, (value, expected)) in sum(&moments).iter().zip(&expected).enumerate() {
                    assert!((value - expected).abs() < 1e-13, "{order:?} {line} {i} {value} {expected}");
                }
            }
        }
    }

    #[test]
    fn the_portable_sums_are_the_same_bits() {
        let meridians = Meridians::new(6).unwrap();
        let spans: Vec<(f64, f64)> = (0..7).map(|i| (f64::from(i) - 3.1, f64::from(i) - 2.6)).collect();
        let spans = Spans::new(&[&spans[..3], &spans[1..2], &[], &spans[..], &spans[4..], &[]]);
        for order in orders() {
            let table = LineHarmonics::new(order, &meridians);
            let (mut one, mut other) = (LineMoments::default(), LineMoments::default());
            table.integrate(&spans, &mut one);
            table.integrate_inline(&spans, &mut other);
            assert_eq!(one.sets, other.sets);
        }
    }
}
