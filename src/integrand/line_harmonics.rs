use std::f64::consts::SQRT_2;

use glam::DVec3;

use crate::sphere::{self, Order};
use crate::visibility::{Interval, Isolines, cycle};

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
    /// One table for each axis along which isolines may follow one another.
    axes: [Axis; 3],
}

#[derive(Clone, Debug)]
struct Axis {
    rows: Vec<Row>,
    /// `(band, parity class)` of every coefficient; bits: odd along the chart's x, y, z.
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

    /// Antiderivatives where z = 0; where y = 0 they are mirrored.
    fn end(self, order: Order) -> Vec<f64> {
        let mut end = vec![0.0; terms(order)];
        antiderivatives(order, self.angle(1.0), &mut end);
        end
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

/// Bits: odd along the axis numbered `axis` and along the two that follow it.
fn parity(l: usize, m: isize, axis: usize) -> usize {
    let odd = |n: isize| n.rem_euclid(2) == 1;
    let along = [(m < 0) != odd(m), m < 0, odd(l as isize + m)];
    (0..3).fold(0, |bits, i| bits | usize::from(along[(axis + i) % 3]) << i)
}

impl LineHarmonics {
    /// Tables for all bands of `order` along these isolines.
    pub fn new(order: Order, isolines: &Isolines) -> Self {
        Self { order, axes: [0, 1, 2].map(|axis| Axis::new(order, isolines, axis)) }
    }

    /// The bands integrated.
    pub fn order(&self) -> Order {
        self.order
    }

    fn rows(&self) -> usize {
        self.axes[0].rows.len()
    }
}

impl Axis {
    fn new(order: Order, isolines: &Isolines, axis: usize) -> Self {
        let half = isolines.len() / 2;
        let width = 2.0 / isolines.len() as f64;
        // Slabs are narrow and what is integrated over them is analytic: the last bits for any number of isolines.
        let nodes = if half < 32 { 48 } else { 8 };
        let rule = sphere::gauss_legendre(nodes);
        let coefficients: Vec<_> = (0..order.bands())
            .flat_map(|l| (-(l as isize)..=l as isize).map(move |m| (l, parity(l, m, axis))))
            .collect();
        let whole = |factors: &[f64], end: &[f64]| -> Vec<f64> {
            let mut arc = vec![0.0; end.len()];
            whole_arc(order, end, &mut arc);
            let own = coefficients.iter().scan(factors, |rest, &(l, _)| rest.split_off(..l + 2).map(|own| (l, own)));
            own.map(|(l, own)| dot(own, group(order, &arc, l))).collect()
        };
        let rows = (0..half).map(|row| {
            let u = isolines.u(half + row);
            let arc = OctantArc::new(u);
            let end = arc.end(order);
            let mut factors = octant_factors(order, &coefficients, axis, u);
            factors.iter_mut().for_each(|f| *f *= width);
            let mut missed: Vec<f64> = whole(&factors, &end).iter().map(|line| -line).collect();
            for &(x, weight) in &rule {
                let u = u + 0.5 * width * x;
                let slab = whole(&octant_factors(order, &coefficients, axis, u), &OctantArc::new(u).end(order));
                missed.iter_mut().zip(slab).for_each(|(missed, slab)| *missed += 0.5 * width * weight * slab);
            }
            // What the midpoint misses goes to the first antiderivative: it grows along the arc from end to end.
            let mut rest = &mut factors[..];
            for (missed, &(l, _)) in missed.iter().zip(&coefficients) {
                let (own, others) = rest.split_at_mut(l + 2);
                own[0] += missed / (2.0 * group(order, &end, l)[0]);
                rest = others;
            }
            Row { arc, end: end.into(), factors: factors.into() }
        });
        Self { rows: rows.collect(), coefficients }
    }
}

/// Factors of every coefficient per unit of u, at `u` >= 0: the trigonometric polynomials, sampled and transformed.
fn octant_factors(order: Order, coefficients: &[(usize, usize)], axis: usize, u: f64) -> Vec<f64> {
    let OctantArc { h, .. } = OctantArc::new(u);
    let m = 1.0 - u;
    let (e1, e2) = (DVec3::new(u, 0.5 * m, 0.5 * m) / h, DVec3::new(0.0, 1.0, -1.0) / SQRT_2);
    let samples = terms(order) + 1;
    let mut sampled = vec![0.0; samples * order.len()];
    let angle = |s: usize| std::f64::consts::TAU * s as f64 / samples as f64;
    for (s, values) in sampled.chunks_mut(order.len()).enumerate() {
        let (sin, cos) = angle(s).sin_cos();
        sphere::evaluate(order, cycle(e1 * cos + e2 * sin, (3 - axis) % 3), values);
        values.iter_mut().for_each(|v| *v *= cos / (SQRT_2 * h * h));
    }
    let waves: Vec<Vec<(f64, f64)>> =
        (0..=order.bands()).map(|k| (0..samples).map(|s| (k as f64 * angle(s)).sin_cos()).collect()).collect();
    let mut factors = Vec::new();
    for (i, &(l, _)) in coefficients.iter().enumerate() {
        for k in ((l + 1) % 2..=l + 1).step_by(2) {
            let (mut sine, mut cosine) = (0.0, 0.0);
            for (s, (sin, cos)) in waves[k].iter().enumerate() {
                sine += sampled[s * order.len() + i] * sin;
                cosine += sampled[s * order.len() + i] * cos;
            }
            let scale = 2.0 / samples as f64;
            match k {
                0 => factors.push(0.5 * scale * cosine),
                _ => factors.extend([scale * cosine, scale * sine]),
            }
        }
    }
    factors
}

/// The antiderivatives that band `l` needs.
fn group(order: Order, values: &[f64], l: usize) -> &[f64] {
    let start = if l.is_multiple_of(2) { 0 } else { odd_terms(order) };
    &values[start..start + l + 2]
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
        let rows = table.rows();
        Self { sums: vec![0.0; rows * 8 * terms(table.order)], touched: vec![false; rows] }
    }

    /// Adds a visible interval.
    pub fn add(&mut self, table: &LineHarmonics, interval: Interval) {
        const MOST: usize = 2 * MOST_BANDS + 1;
        let half = table.rows();
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
        // All axes have the same arcs.
        let table_row = &table.axes[0].rows[row];
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

    /// Adds the integrals of all harmonics over the isolines of even and of odd number to the two of `out` (`order^2`
    /// values each), and forgets the intervals, whose isolines follow one another along the axis numbered `axis`.
    ///
    /// Their sum is the integral; either set, doubled, is the integral with half as many isolines.
    pub fn finish(&mut self, table: &LineHarmonics, axis: usize, out: [&mut [f64]; 2]) {
        let Axis { rows, coefficients } = &table.axes[axis];
        let terms = terms(table.order);
        for (row, block) in self.sums.chunks_mut(8 * terms).enumerate() {
            if !std::mem::take(&mut self.touched[row]) {
                continue;
            }
            // Reflections along y and z; along x they lead from a line of one set to one of the other.
            for bit in [2, 4] {
                for octant in (0..8).filter(|octant| octant & bit == 0) {
                    for k in 0..terms {
                        let (a, b) = (block[octant * terms + k], block[(octant | bit) * terms + k]);
                        block[octant * terms + k] = a + b;
                        block[(octant | bit) * terms + k] = a - b;
                    }
                }
            }
            let mut factors = &*rows[row].factors;
            let set = (rows.len() + row) % 2;
            for (i, &(l, parity)) in coefficients.iter().enumerate() {
                let (own, rest) = factors.split_at(l + 2);
                let side = |octant: usize| dot(own, group(table.order, &block[octant * terms..][..terms], l));
                let sign = if parity & 1 == 0 { 1.0 } else { -1.0 };
                out[set][i] += side(parity & 0b110);
                out[1 - set][i] += sign * side(parity | 1);
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

    fn integrate(table: &LineHarmonics, axis: usize, intervals: impl IntoIterator<Item = Interval>) -> Vec<f64> {
        let mut moments = LineMoments::new(table);
        intervals.into_iter().for_each(|interval| moments.add(table, interval));
        let mut sets = [(); 2].map(|()| vec![0.0; table.order().len()]);
        let [even, odd] = &mut sets;
        moments.finish(table, axis, [even, odd]);
        sets[0].iter().zip(&sets[1]).map(|(even, odd)| even + odd).collect()
    }

    #[test]
    fn the_whole_sphere_is_exact_for_any_number_of_isolines() {
        for order in orders() {
            for lines in [2, 6, 64] {
                let isolines = Isolines::new(lines).unwrap();
                let table = LineHarmonics::new(order, &isolines);
                let all = (0..4 * lines).map(|i| Interval { line: i / 4, quadrant: i % 4, from: 0.0, to: 1.0 });
                for (i, value) in integrate(&table, lines % 3, all).into_iter().enumerate() {
                    let expected = if i == 0 { (4.0 * std::f64::consts::PI).sqrt() } else { 0.0 };
                    assert!((value - expected).abs() < 1e-13, "{order:?} {lines} {i} {value}");
                }
            }
        }
    }

    /// Quadrature of y along an interval with the octahedral map's density (u^2 + v^2 + (1-|u|-|v|)^2)^(-3/2).
    fn quadrature(order: Order, isolines: &Isolines, axis: usize, interval: Interval) -> Vec<f64> {
        let corners = [DVec3::Z, DVec3::Y, DVec3::NEG_Z, DVec3::NEG_Y, DVec3::Z];
        let u = isolines.u(interval.line);
        let m = 1.0 - u.abs();
        let mut out = vec![0.0; order.len()];
        let mut y = vec![0.0; order.len()];
        for (x, weight) in gauss_legendre(40) {
            let f = interval.from + (interval.to - interval.from) * 0.5 * (x + 1.0);
            let p = DVec3::X * u + m * corners[interval.quadrant].lerp(corners[interval.quadrant + 1], f);
            sphere::evaluate(order, cycle(p.normalize(), (3 - axis) % 3), &mut y);
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
                    let (a, b) = (
                        integrate(&table, quadrant % 3, [interval]),
                        quadrature(order, &isolines, quadrant % 3, interval),
                    );
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
                let whole = integrate(&table, 1, [part(0.0, 1.0)]);
                let parts = integrate(&table, 1, [part(0.0, 0.3), part(0.8, 1.0), part(0.3, 0.8)]);
                assert!(whole.iter().zip(&parts).all(|(a, b)| (a - b).abs() < 1e-15));
            }
        }
    }

    #[test]
    fn one_receiver_leaves_nothing_behind_for_the_next_and_a_line_belongs_to_one_set() {
        let isolines = Isolines::new(4).unwrap();
        let table = LineHarmonics::new(Order::new(3).unwrap(), &isolines);
        let mut moments = LineMoments::new(&table);
        for line in 0..4 {
            let interval = Interval { line, quadrant: 1, from: 0.2, to: 0.9 };
            let mut sets = [(); 4].map(|()| vec![0.0; 9]);
            let [even, odd, even_again, odd_again] = &mut sets;
            moments.add(&table, interval);
            moments.finish(&table, 0, [even, odd]);
            moments.add(&table, interval);
            moments.finish(&table, 0, [even_again, odd_again]);
            assert_eq!(sets[..2], sets[2..]);
            assert_ne!(sets[line % 2], vec![0.0; 9]);
            assert_eq!(sets[1 - line % 2], vec![0.0; 9]);
        }
    }
}
