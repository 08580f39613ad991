use std::f64::consts::SQRT_2;

use glam::DVec3;

use crate::sphere::{self, Order};
use crate::visibility::{Interval, Isolines};

/// Integrals of spherical harmonics over visible parts of u-isolines, in closed form.
///
/// Inside one octant an isoline is a planar arc at distance h from the centre: w(t) = e1 cos t + e2 sin t, and the measure of
/// the octahedral map along it is cos t dt / (sqrt2 h^2) du. A harmonic of band l times cos t is a trigonometric polynomial
/// in t of degree l + 1 and of the parity of l + 1, so that its antiderivative is a combination of few functions of the
/// ends: `[sin t, -cos t, sin 3t / 3, -cos 3t / 3, ...]` for even l, `[t, sin 2t / 2, -cos 2t / 2, ...]` for odd l.
/// The combinations depend on the isoline alone; they are tabulated here for the octant x, y, z > 0, and reflections
/// change signs.
///
/// Each isoline stands for a slab of width 2 / N in u. The combination of every whole octant arc is scaled to the slab's
/// exact integral, so that the sphere as a whole is integrated exactly for any N, and errors arise only where visibility
/// changes.
#[derive(Clone, Debug)]
pub struct LineHarmonics {
    order: Order,
    rows: Vec<Row>,
    /// `(band, parity class)` of every coefficient.
    coefficients: Vec<(usize, usize)>,
}

/// Bands of the largest order and one more, for products with a cosine.
const MOST_BANDS: usize = 11;

/// The table of one |u|.
#[derive(Clone, Debug)]
struct Row {
    arc: OctantArc,
    /// Antiderivatives at the end |z| = 0 of the octant arc.
    end: Box<[f64]>,
    /// For each coefficient its `l + 2` factors, one after another.
    factors: Box<[f64]>,
}

/// An isoline in the octant x, y, z > 0.
#[derive(Clone, Copy, Debug)]
struct OctantArc {
    /// Distance of its plane line from the centre.
    h: f64,
    /// |y| + |z| along it, times sqrt2: its length.
    length: f64,
}

impl OctantArc {
    fn new(u: f64) -> Self {
        let m = 1.0 - u;
        Self { h: (u * u + 0.5 * m * m).sqrt(), length: m * SQRT_2 }
    }

    /// cos t and sin t at the fraction `f` = |y| / (|y| + |z|).
    fn angle(self, f: f64) -> (f64, f64) {
        let q = (f - 0.5) * self.length;
        let r = (self.h * self.h + q * q).sqrt();
        (self.h / r, q / r)
    }
}

/// The antiderivatives at angle t: those of odd frequency, then those of even frequency.
fn antiderivatives(order: Order, (cos, sin): (f64, f64), out: &mut [f64]) {
    let odd = odd_terms(order);
    let (odd, even) = out.split_at_mut(odd);
    even[0] = 2.0 * (sin / (1.0 + cos)).atan();
    let (mut c, mut s) = (cos, sin);
    for k in 1..=order.bands() {
        let pair = if k % 2 == 1 { &mut odd[k - 1..=k] } else { &mut even[k - 1..=k] };
        pair[0] = s / k as f64;
        pair[1] = -c / k as f64;
        (c, s) = (c * cos - s * sin, s * cos + c * sin);
    }
}

/// Number of antiderivatives of odd frequency up to that of the last band times cos t.
fn odd_terms(order: Order) -> usize {
    order.bands().div_ceil(2) * 2
}

fn terms(order: Order) -> usize {
    2 * order.bands() + 1
}

/// Bits: odd in x, odd in y, odd in z.
fn parity(l: usize, m: isize) -> usize {
    let odd = |n: isize| n.rem_euclid(2) == 1;
    usize::from((m < 0) != odd(m)) | usize::from(m < 0) << 1 | usize::from(odd(l as isize + m)) << 2
}

impl LineHarmonics {
    /// Tables for all bands of `order` along these isolines.
    pub fn new(order: Order, isolines: &Isolines) -> Self {
        let half = isolines.len() / 2;
        let width = 2.0 / isolines.len() as f64;
        // Slabs are narrow and what is integrated over them is analytic: the last bit for any number of isolines.
        let nodes = if half < 32 { 48 } else { 8 };
        let rule = sphere::gauss_legendre(nodes);
        let coefficients = (0..order.bands())
            .flat_map(|l| (-(l as isize)..=l as isize).map(move |m| (l, parity(l, m))))
            .collect();
        let mut table = Self { order, rows: Vec::with_capacity(half), coefficients };
        for row in 0..half {
            let u = isolines.u(half + row);
            let arc = OctantArc::new(u);
            let mut end = vec![0.0; terms(order)];
            antiderivatives(order, arc.angle(1.0), &mut end);
            let mut factors = table.factors(u);
            factors.iter_mut().for_each(|f| *f *= width);
            let mut whole = vec![0.0; order.len()];
            for &(x, weight) in &rule {
                let u = u + 0.5 * width * x;
                let mut end = vec![0.0; terms(order)];
                antiderivatives(order, OctantArc::new(u).angle(1.0), &mut end);
                table.accumulate_octant(&table.factors(u), &end, 0.5 * width * weight, &mut whole);
            }
            let mut line = vec![0.0; order.len()];
            table.accumulate_octant(&factors, &end, 1.0, &mut line);
            // What the midpoint misses goes to the first antiderivative: it grows along the arc from end to end.
            let mut at = 0;
            for (i, &(l, _)) in table.coefficients.iter().enumerate() {
                let first = if l % 2 == 0 { end[0] } else { end[odd_terms(order)] };
                factors[at] += (whole[i] - line[i]) / (2.0 * first);
                at += l + 2;
            }
            table.rows.push(Row { arc, end: end.into(), factors: factors.into() });
        }
        table
    }

    /// The bands integrated.
    pub fn order(&self) -> Order {
        self.order
    }

    /// Factors per unit of u at `u` >= 0, by sampling the trigonometric polynomials and transforming.
    fn factors(&self, u: f64) -> Vec<f64> {
        let OctantArc { h, .. } = OctantArc::new(u);
        let m = 1.0 - u;
        let (e1, e2) = (DVec3::new(u, 0.5 * m, 0.5 * m) / h, DVec3::new(0.0, 1.0, -1.0) / SQRT_2);
        let samples = terms(self.order) + 1;
        let mut sampled = vec![0.0; samples * self.order.len()];
        let angle = |s: usize| std::f64::consts::TAU * s as f64 / samples as f64;
        for (s, values) in sampled.chunks_mut(self.order.len()).enumerate() {
            let (sin, cos) = angle(s).sin_cos();
            sphere::evaluate(self.order, e1 * cos + e2 * sin, values);
            values.iter_mut().for_each(|v| *v *= cos / (SQRT_2 * h * h));
        }
        let mut factors = Vec::new();
        for (i, &(l, _)) in self.coefficients.iter().enumerate() {
            let transform = |wave: &dyn Fn(f64) -> f64| -> f64 {
                (0..samples).map(|s| sampled[s * self.order.len() + i] * wave(angle(s))).sum::<f64>()
                    * (2.0 / samples as f64)
            };
            if l % 2 == 1 {
                factors.push(0.5 * transform(&|_| 1.0));
            }
            for k in (2 - (l + 1) % 2..=l + 1).step_by(2) {
                factors.push(transform(&|t| (k as f64 * t).cos()));
                factors.push(transform(&|t| (k as f64 * t).sin()));
            }
        }
        factors
    }

    /// Adds the integrals over a whole octant arc; `end` holds the antiderivatives at its end, the start mirrors it.
    fn accumulate_octant(&self, factors: &[f64], end: &[f64], weight: f64, out: &mut [f64]) {
        let mut arc = vec![0.0; end.len()];
        whole_arc(self.order, end, &mut arc);
        let mut at = 0;
        for (&(l, _), out) in self.coefficients.iter().zip(out) {
            *out += weight * dot(&factors[at..at + l + 2], self.group(&arc, l));
            at += l + 2;
        }
    }

    /// The antiderivatives that band `l` needs.
    fn group<'a>(&self, values: &'a [f64], l: usize) -> &'a [f64] {
        let start = if l % 2 == 0 { 0 } else { odd_terms(self.order) };
        &values[start..start + l + 2]
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Differences of the antiderivatives over a whole octant arc, from t = -T to T: sines double, cosines cancel.
fn whole_arc(order: Order, end: &[f64], out: &mut [f64]) {
    let odd = odd_terms(order);
    for (i, (out, end)) in out.iter_mut().zip(end).enumerate() {
        let sine = if i < odd { i % 2 == 0 } else { i == odd || (i - odd) % 2 == 1 };
        *out = if sine { 2.0 * end } else { 0.0 };
    }
}

/// What one receiver's visible intervals add up to, before the harmonics' factors are applied.
#[derive(Clone, Debug)]
pub struct LineMoments {
    /// Differences of antiderivatives, by |u|, octant and antiderivative.
    sums: Vec<f64>,
    touched: Vec<bool>,
}

impl LineMoments {
    /// Nothing seen yet.
    pub fn new(table: &LineHarmonics) -> Self {
        let rows = table.rows.len();
        Self { sums: vec![0.0; rows * 8 * terms(table.order)], touched: vec![false; rows] }
    }

    /// Adds a visible interval.
    pub fn add(&mut self, table: &LineHarmonics, interval: Interval) {
        const MOST: usize = 2 * MOST_BANDS + 1;
        let half = table.rows.len();
        let (row, behind) = match interval.line.checked_sub(half) {
            Some(row) => (row, 0),
            None => (half - 1 - interval.line, 1),
        };
        let octant = behind | [0b000, 0b100, 0b110, 0b010][interval.quadrant];
        let (from, to) = match interval.quadrant % 2 {
            0 => (interval.from, interval.to),
            _ => (1.0 - interval.to, 1.0 - interval.from),
        };
        let terms = terms(table.order);
        let table_row = &table.rows[row];
        self.touched[row] = true;
        let sums = &mut self.sums[(row * 8 + octant) * terms..][..terms];
        let mut buffer = [0.0; MOST];
        let values = &mut buffer[..terms];
        if from == 0.0 && to == 1.0 {
            whole_arc(table.order, &table_row.end, values);
            sums.iter_mut().zip(values).for_each(|(sum, v)| *sum += *v);
            return;
        }
        for (fraction, sign) in [(to, 1.0), (from, -1.0)] {
            antiderivatives(table.order, table_row.arc.angle(fraction), values);
            sums.iter_mut().zip(&*values).for_each(|(sum, v)| *sum += sign * v);
        }
    }

    /// Adds the integrals of all harmonics to `out` (`order^2` values) and forgets the intervals.
    pub fn finish(&mut self, table: &LineHarmonics, out: &mut [f64]) {
        let terms = terms(table.order);
        for (row, block) in self.sums.chunks_mut(8 * terms).enumerate() {
            if !std::mem::take(&mut self.touched[row]) {
                continue;
            }
            for bit in [1, 2, 4] {
                for octant in (0..8).filter(|octant| octant & bit == 0) {
                    for k in 0..terms {
                        let (a, b) = (block[octant * terms + k], block[(octant | bit) * terms + k]);
                        block[octant * terms + k] = a + b;
                        block[(octant | bit) * terms + k] = a - b;
                    }
                }
            }
            let mut factors = &*table.rows[row].factors;
            for (&(l, parity), out) in table.coefficients.iter().zip(&mut *out) {
                let (own, rest) = factors.split_at(l + 2);
                *out += dot(own, table.group(&block[parity * terms..][..terms], l));
                factors = rest;
            }
            block.fill(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::gauss_legendre;

    fn orders() -> impl Iterator<Item = Order> {
        [1, 2, 4, 8, 10].into_iter().map(|bands| Order::new(bands).unwrap())
    }

    fn integrate(table: &LineHarmonics, intervals: impl IntoIterator<Item = Interval>) -> Vec<f64> {
        let mut moments = LineMoments::new(table);
        intervals.into_iter().for_each(|interval| moments.add(table, interval));
        let mut out = vec![0.0; table.order().len()];
        moments.finish(table, &mut out);
        out
    }

    #[test]
    fn the_whole_sphere_is_exact_for_any_number_of_isolines() {
        for order in orders() {
            for lines in [2, 6, 64] {
                let isolines = Isolines::new(lines).unwrap();
                let table = LineHarmonics::new(order, &isolines);
                let all = (0..4 * lines).map(|i| Interval { line: i / 4, quadrant: i % 4, from: 0.0, to: 1.0 });
                for (i, value) in integrate(&table, all).into_iter().enumerate() {
                    let expected = if i == 0 { (4.0 * std::f64::consts::PI).sqrt() } else { 0.0 };
                    assert!((value - expected).abs() < 1e-13, "{order:?} {lines} {i} {value}");
                }
            }
        }
    }

    /// Quadrature of y along an interval with the octahedral map's density (u^2 + v^2 + (1-|u|-|v|)^2)^(-3/2).
    fn quadrature(order: Order, isolines: &Isolines, interval: Interval) -> Vec<f64> {
        let corners = [DVec3::Z, DVec3::Y, DVec3::NEG_Z, DVec3::NEG_Y, DVec3::Z];
        let u = isolines.u(interval.line);
        let m = 1.0 - u.abs();
        let mut out = vec![0.0; order.len()];
        let mut y = vec![0.0; order.len()];
        for (x, weight) in gauss_legendre(40) {
            let f = interval.from + (interval.to - interval.from) * 0.5 * (x + 1.0);
            let p = DVec3::X * u + m * corners[interval.quadrant].lerp(corners[interval.quadrant + 1], f);
            sphere::evaluate(order, p.normalize(), &mut y);
            let weight = 0.5 * weight * (interval.to - interval.from) * m * p.length().powi(-3);
            out.iter_mut().zip(&y).for_each(|(out, y)| *out += weight * y * 2.0 / isolines.len() as f64);
        }
        out
    }

    #[test]
    fn intervals_agree_with_quadrature_up_to_the_slab_correction() {
        // The correction is that of the midpoint rule in u: 2^-k lines shrink it by 4^-k, what is left by 16^-k.
        let error = |lines: usize| {
            let isolines = Isolines::new(lines).unwrap();
            let order = Order::new(8).unwrap();
            let table = LineHarmonics::new(order, &isolines);
            let mut worst = 0.0f64;
            for quadrant in 0..4 {
                for (line, from, to) in [(lines / 8, 0.1, 0.4), (lines / 2, 0.0, 0.7), (lines - lines / 4, 0.55, 1.0)] {
                    let interval = Interval { line, quadrant, from, to };
                    let (a, b) = (integrate(&table, [interval]), quadrature(order, &isolines, interval));
                    worst = a.iter().zip(&b).fold(worst, |w, (a, b)| w.max((a - b).abs()));
                }
            }
            worst * lines as f64
        };
        let (coarse, fine) = (error(64), error(1024));
        assert!(fine < 2e-5, "{fine}");
        let slope = (coarse / fine).log2() / 4.0;
        assert!((1.9..2.1).contains(&slope), "{slope}");
    }

    #[test]
    fn intervals_add_up() {
        let isolines = Isolines::new(10).unwrap();
        let table = LineHarmonics::new(Order::new(6).unwrap(), &isolines);
        for line in 0..10 {
            for quadrant in 0..4 {
                let part = |from, to| Interval { line, quadrant, from, to };
                let whole = integrate(&table, [part(0.0, 1.0)]);
                let parts = integrate(&table, [part(0.0, 0.3), part(0.8, 1.0), part(0.3, 0.8)]);
                assert!(whole.iter().zip(&parts).all(|(a, b)| (a - b).abs() < 1e-15));
            }
        }
    }

    #[test]
    fn one_receiver_leaves_nothing_behind_for_the_next() {
        let isolines = Isolines::new(4).unwrap();
        let table = LineHarmonics::new(Order::new(3).unwrap(), &isolines);
        let mut moments = LineMoments::new(&table);
        let interval = Interval { line: 3, quadrant: 1, from: 0.2, to: 0.9 };
        let [mut first, mut second] = [vec![0.0; 9], vec![0.0; 9]];
        moments.add(&table, interval);
        moments.finish(&table, &mut first);
        moments.add(&table, interval);
        moments.finish(&table, &mut second);
        assert_eq!(first, second);
        assert_ne!(first, vec![0.0; 9]);
    }
}
