use std::f64::consts::PI;

use crate::sphere::{Order, angle, index};
use crate::visibility::{Meridians, Spans};

/// Integrals of spherical harmonics over the visible spans of a hemisphere's isolines, in closed form.
///
/// In the axes of the chart ([`Meridians`]) a harmonic is P_lm(v) times cos m u or sin m u. Its antiderivative along an
/// isoline is, with c^2 = 1 - v^2, a polynomial in v for even m, and c times a polynomial in v plus a multiple of the
/// latitude for odd m: so every visible span contributes the powers of v, their products with c, and the latitude at its
/// ends, and all harmonics are linear combinations of the sums of these, weighted by cos m u and sin m u.
///
/// Each isoline stands for a slab of width pi / N in u, over which cos m u and sin m u are integrated. So the whole hemisphere
/// is exact for any N, and errors arise only where visibility changes.
#[derive(Clone, Debug)]
pub struct LineHarmonics {
    order: Order,
    /// For every isoline and m: integrals of cos m u and sin m u over its slab.
    waves: Vec<[f64; 2]>,
    /// For every l and m <= l the factors of the powers, and of the latitude.
    antiderivatives: Vec<(Vec<f64>, f64)>,
    open: LineMoments,
}

/// Working memory, and what one hemisphere's visible spans add up to, in the axes of the chart.
#[derive(Clone, Debug, Default)]
pub struct LineMoments {
    /// Integrals of all harmonics, `order^2`.
    pub sum: Vec<f64>,
    /// The same with the isolines' signs in turn, less at the first and last: either set of every other isoline, doubled, is
    /// the integral with half as many, and this is the difference of the two.
    pub difference: Vec<f64>,
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
        let width = PI / lines as f64;
        let wave = |line: usize, m: usize| match m {
            0 => [width, 0.0],
            _ => {
                let (m, slab) = (m as f64, 2.0 / m as f64 * (0.5 * m as f64 * width).sin());
                let (sin, cos) = (m * meridians.u(line)).sin_cos();
                [slab * cos, slab * sin]
            }
        };
        let mut table = Self {
            order,
            waves: (0..lines).flat_map(|line| (0..bands).map(move |m| wave(line, m))).collect(),
            antiderivatives: (0..bands).flat_map(|l| (0..=l).map(move |m| antiderivative(l, m, bands))).collect(),
            open: LineMoments::default(),
        };
        let mut open = LineMoments::default();
        table.integrate(&Spans::open(meridians), &mut open);
        table.open = open;
        table
    }

    /// The bands integrated.
    pub fn order(&self) -> Order {
        self.order
    }

    /// The integrals over the whole hemisphere, to the bit what [`LineHarmonics::integrate`] makes of it.
    pub fn open(&self) -> &LineMoments {
        &self.open
    }

    /// Integrates over the visible spans.
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
        for values in [&mut moments.sum, &mut moments.difference] {
            values.clear();
            values.resize(self.order.len(), 0.0);
        }
        match self.order.bands() {
            ..=4 => self.sum::<4>(spans, moments),
            5..=8 => self.sum::<8>(spans, moments),
            _ => self.sum::<12>(spans, moments),
        }
    }

    #[inline(always)]
    fn sum<const W: usize>(&self, spans: &Spans, moments: &mut LineMoments) {
        let bands = self.order.bands();
        let lines = self.waves.len() / bands;
        let mut sets = [Sums::<W>::ZERO, Sums::<W>::ZERO];
        let mut rim = Sums::<W>::ZERO;
        for (line, waves) in self.waves.chunks_exact(bands).enumerate() {
            let (mut even, mut odd, mut latitude) = ([0.0; W], [0.0; W], 0.0);
            let mut sign = -1.0;
            for end in spans.of(line) {
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
            sets[line % 2].add(waves, &even, &odd, latitude, 1.0);
            // Half of what is missing beyond the first and last isolines, as their neighbours have it.
            let less = match line.min(lines - 1 - line) {
                _ if lines < 4 => continue,
                0 => 0.75,
                1 => 0.25,
                _ => continue,
            };
            rim.add(waves, &even, &odd, latitude, if line % 2 == 0 { less } else { -less });
        }
        let [evens, odds] = &sets;
        let mut rows = self.antiderivatives.iter();
        for l in 0..bands {
            for (m, (factors, slope)) in (0..=l).zip(&mut rows) {
                for (wave, at) in [index(l, m as isize), index(l, -(m as isize))].into_iter().enumerate() {
                    if m == 0 && wave == 1 {
                        continue;
                    }
                    let [even, odd, rim] = [evens, odds, &rim].map(|sums| {
                        let powers = sums.powers[m][wave].iter().zip(factors);
                        powers.map(|(sum, factor)| sum * factor).sum::<f64>() + slope * sums.latitudes[m][wave]
                    });
                    moments.sum[at] = even + odd;
                    moments.difference[at] = even - odd - rim;
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
    fn add(&mut self, waves: &[[f64; 2]], even: &[f64; W], odd: &[f64; W], latitude: f64, scale: f64) {
        for (m, waves) in waves.iter().enumerate().take(W) {
            let powers = if m % 2 == 0 { even } else { odd };
            for (wave, factor) in waves.iter().enumerate() {
                let factor = scale * factor;
                for j in 0..W {
                    self.powers[m][wave][j] += factor * powers[j];
                }
                self.latitudes[m][wave] += factor * latitude;
            }
        }
    }
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

    #[test]
    fn the_hemisphere_is_exact_for_any_number_of_isolines() {
        for order in orders() {
            for lines in [1, 2, 3, 7, 64] {
                let table = LineHarmonics::new(order, &Meridians::new(lines).unwrap());
                // The chart's normal is y.
                let expected = hemisphere(order, DVec3::Y);
                for (i, (value, expected)) in table.open().sum.iter().zip(&expected).enumerate() {
                    assert!((value - expected).abs() < 2e-13, "{order:?} {lines} {i} {value} {expected}");
                }
                // The waves are smooth from line to line, if there are many.
                if lines == 64 {
                    let rest = table.open().difference.iter().fold(0.0f64, |worst, x| worst.max(x.abs()));
                    assert!(rest < (order.len() as f64 / (lines * lines) as f64), "{order:?} {lines} {rest}");
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
                (5, vec![(-Spans::POLE, -1e-3), (0.4, 7.0)]),
                (11, vec![(-900.0, -4.0), (-1.0, 0.0), (2.5, Spans::POLE)]),
            ] {
                let mut moments = LineMoments::default();
                let all: Vec<&[(f64, f64)]> = (0..12).map(|i| if i == line { &spans[..] } else { &[] }).collect();
                table.integrate(&Spans::new(&all), &mut moments);
                // Over the slab, where the spans' ends stay.
                let mut expected = vec![0.0; order.len()];
                let mut y = vec![0.0; order.len()];
                for &(from, to) in &spans {
                    let (a, b) = (f64::atan(from), f64::atan(to));
                    for (s, ws) in gauss_legendre(40) {
                        for (t, wt) in gauss_legendre(12) {
                            let latitude = 0.5 * (a + b) + 0.5 * (b - a) * s;
                            let u = meridians.u(line) + 0.5 * PI / 12.0 * t;
                            let (v, c) = latitude.sin_cos();
                            evaluate(order, DVec3::new(c * u.cos(), c * u.sin(), v), &mut y);
                            let weight = 0.25 * (b - a) * c * PI / 12.0 * ws * wt;
                            expected.iter_mut().zip(&y).for_each(|(sum, y)| *sum += weight * y);
                        }
                    }
                }
                for (i, (value, expected)) in moments.sum.iter().zip(&expected).enumerate() {
                    assert!((value - expected).abs() < 1e-13, "{order:?} {line} {i} {value} {expected}");
                }
            }
        }
    }

    #[test]
    fn the_portable_sums_are_the_same_bits() {
        let meridians = Meridians::new(5).unwrap();
        let spans: Vec<(f64, f64)> = (0..7).map(|i| (f64::from(i) - 3.1, f64::from(i) - 2.6)).collect();
        let spans = Spans::new(&[&spans[..3], &spans[1..2], &[], &spans[..], &spans[4..]]);
        for order in orders() {
            let table = LineHarmonics::new(order, &meridians);
            let (mut one, mut other) = (LineMoments::default(), LineMoments::default());
            table.integrate(&spans, &mut one);
            table.integrate_inline(&spans, &mut other);
            assert_eq!((one.sum, one.difference), (other.sum, other.difference));
        }
    }
}
