//! From accumulated log visibility to visibility: exponentials of spherical harmonics.

use std::f64::consts::PI;
use std::fmt;

use super::lanes::{LANES, Lanes};
use super::zonal_log::Logarithm;
use crate::sphere::{Order, TripleProduct, zonal_cap};

/// How the exponential is taken. All isolate the constant band first, exp(f) = e^(f_0 / sqrt(4 pi)) exp(f^) with f^ = f
/// without its band 0 (Ren et al. 2006, section 4.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum Exponential {
    /// Optimal linear: a 1 + b f^, a and b tabulated over |f^| from single spheres. The cheapest, and rough where many
    /// spheres overlap.
    Ol,
    /// The hybrid of Ren et al. 2006: halve until |f^| <= 1/4, optimal linear, square back.
    Hyb,
    /// Halve until |f^| <= 1, then 1 + f^ + f^ f^ / 2, square back: more accurate than `hyb` with one product fewer.
    #[default]
    Ps2,
    /// The exact exponential of the product matrix, in double precision: the judge of the others, slow.
    Matrix,
    /// None: the product itself in 264 directions ([`direct_product`](super::direct_product)). Half the error of four bands,
    /// and slow.
    Direct,
}

impl fmt::Display for Exponential {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ol => "ol",
            Self::Hyb => "hyb",
            Self::Ps2 => "ps2",
            Self::Matrix => "matrix",
            Self::Direct => "direct",
        })
    }
}

/// sqrt(4 pi): the constant 1 in spherical harmonics.
pub const ONE: f32 = 3.544_907_7;

/// Bound on |f^| below which `hyb` uses the optimal linear form. The value of the original is not known; 1/4 works.
pub(super) const HYB_BOUND: f32 = 0.25;
/// Bound on |f^| below which `ps2` uses the quadratic series.
pub(super) const PS2_BOUND: f32 = 1.0;

/// One term of a square: `value` f_i f_j, with i <= j and both orders of i and j counted.
#[derive(Clone, Copy, Debug)]
pub struct SquareTerm {
    /// First factor.
    pub i: u8,
    /// Second factor.
    pub j: u8,
    /// Integral of Y_i Y_j Y_k, twice if i != j.
    pub value: f32,
}

/// An exponential made ready for one order.
#[derive(Clone, Debug)]
pub struct Exponentiator {
    kind: Exponential,
    order: Order,
    product: TripleProduct,
    /// The terms of the square's coefficient k stand at `first[k]..first[k + 1]`.
    first: Vec<usize>,
    terms: Vec<SquareTerm>,
    linear: OptimalLinear,
}

/// a and b of the optimal linear form over |f^|.
#[derive(Clone, Debug)]
pub struct OptimalLinear {
    /// The greatest |f^| that a single sphere reaches.
    pub greatest: f32,
    /// (a, b) at |f^| = `greatest` k / (len - 1).
    pub table: Vec<[f32; 2]>,
}

impl OptimalLinear {
    const INTERVALS: usize = 1024;

    /// For a single sphere with visibility g and log visibility f, with g' = e^(-f_0 / sqrt(4 pi)) g: a = g'_0 / sqrt(4 pi) and
    /// b = g'^ . f^ / f^ . f^. Spheres are taken from small ones up to the one with the greatest |f^|.
    fn new(order: Order) -> Self {
        const SAMPLES: usize = 4096;
        let logarithm = Logarithm::new(order);
        let mut samples = vec![(0.0, [1.0, 1.0])];
        for k in 1..=SAMPLES {
            let c = 1.0 - k as f64 / SAMPLES as f64;
            let log = logarithm.of_cap(c);
            let norm = log[1..].iter().map(|x| x * x).sum::<f64>().sqrt();
            if norm <= samples[samples.len() - 1].0 {
                break;
            }
            let scale = (-log[0] / (4.0 * PI).sqrt()).exp();
            let visibility: Vec<f64> = zonal_cap(order, c).iter().map(|cap| -scale * cap).collect();
            let a = scale + visibility[0] / (4.0 * PI).sqrt();
            let b = visibility[1..].iter().zip(&log[1..]).map(|(g, f)| g * f).sum::<f64>() / (norm * norm);
            samples.push((norm, [a, b]));
        }
        let greatest = samples[samples.len() - 1].0;
        let mut upper = 1;
        let table = (0..=Self::INTERVALS).map(|k| {
            let norm = greatest * k as f64 / Self::INTERVALS as f64;
            while upper + 1 < samples.len() && samples[upper].0 < norm {
                upper += 1;
            }
            let ((low, from), (high, to)) = (samples[upper - 1], samples[upper]);
            let t = (norm - low) / (high - low);
            [0, 1].map(|i| (from[i] + t * (to[i] - from[i])) as f32)
        });
        Self { greatest: greatest as f32, table: table.collect() }
    }

    /// (a, b) for a norm; beyond the greatest the last entry.
    #[inline(always)]
    fn at(&self, norm: f32) -> [f32; 2] {
        let x = (norm / self.greatest).min(1.0) * Self::INTERVALS as f32;
        let k = (x as usize).min(Self::INTERVALS - 1);
        let t = x - k as f32;
        [0, 1].map(|i| self.table[k][i] + t * (self.table[k + 1][i] - self.table[k][i]))
    }
}

impl Exponentiator {
    /// The exponential `kind` for vectors of `order`.
    pub fn new(kind: Exponential, order: Order) -> Self {
        let product = TripleProduct::new(order);
        let mut by_result: Vec<Vec<SquareTerm>> = vec![Vec::new(); order.len()];
        for entry in product.entries() {
            let value = if entry.i == entry.j { entry.value } else { 2.0 * entry.value } as f32;
            by_result[usize::from(entry.k)].push(SquareTerm { i: entry.i, j: entry.j, value });
        }
        let mut first = vec![0];
        for terms in &by_result {
            first.push(first[first.len() - 1] + terms.len());
        }
        Self { kind, order, product, first, terms: by_result.concat(), linear: OptimalLinear::new(order) }
    }

    /// Which exponential this is.
    pub fn kind(&self) -> Exponential {
        self.kind
    }

    /// The order it is for.
    pub fn order(&self) -> Order {
        self.order
    }

    /// The optimal linear form that `ol` and `hyb` use.
    pub fn optimal_linear(&self) -> &OptimalLinear {
        &self.linear
    }

    /// The terms of a square, coefficient by coefficient: those of k stand at `first[k]..first[k + 1]`.
    pub fn square_terms(&self) -> (&[usize], &[SquareTerm]) {
        (&self.first, &self.terms)
    }

    /// exp(f) of eight vectors at once, each with its own number of halvings.
    ///
    /// # Panics
    /// If `LEN` is not the order's number of coefficients.
    #[inline(always)]
    pub(super) fn exponentiate<const LEN: usize>(&self, f: [Lanes; LEN]) -> [Lanes; LEN] {
        assert_eq!(LEN, self.order.len());
        // Whoever wants no logarithms has none to bring back: those that come are brought back exactly.
        if matches!(self.kind, Exponential::Matrix | Exponential::Direct) {
            return self.by_matrix(f);
        }
        let scale = Lanes::each(|i| (f[0].0[i] / ONE).exp());
        let mut h = f;
        h[0] = Lanes::ZERO;
        let norm = h[1..].iter().fold(Lanes::ZERO, |sum, &x| sum + x * x).sqrt();
        let bound = match self.kind {
            Exponential::Hyb => HYB_BOUND,
            Exponential::Ps2 => PS2_BOUND,
            _ => f32::INFINITY,
        };
        // Fewest halvings that bring the norm to the bound; a norm that is not finite gets none.
        let halvings = norm.0.map(|norm| {
            let mut count = 0;
            let mut rest = norm;
            while rest > bound && count < 24 {
                rest *= 0.5;
                count += 1;
            }
            count
        });
        let part = Lanes::each(|i| 0.5f32.powi(halvings[i]));
        h[1..].iter_mut().for_each(|x| *x = *x * part);
        let mut g = match self.kind {
            Exponential::Ps2 => {
                let mut g = self.square(&h);
                g.iter_mut().zip(&h).for_each(|(g, h)| *g = *g * 0.5 + *h);
                g[0] += Lanes::splat(ONE);
                g
            }
            _ => {
                let factors: [[f32; 2]; LANES] = std::array::from_fn(|i| self.linear.at(norm.0[i] * part.0[i]));
                let (a, b) = (Lanes::each(|i| factors[i][0]), Lanes::each(|i| factors[i][1]));
                let mut g = h.map(|h| h * b);
                g[0] = a * ONE;
                g
            }
        };
        let most = halvings.into_iter().max().unwrap_or(0);
        for step in 0..most {
            let squared = self.square(&g);
            // A lane with fewer halvings joins in later.
            let waits = Lanes::each(|i| (step - (most - halvings[i])) as f32);
            for (g, squared) in g.iter_mut().zip(squared) {
                *g = waits.where_below(Lanes::ZERO, *g, squared);
            }
        }
        g.map(|g| g * scale)
    }

    #[inline(always)]
    fn square<const LEN: usize>(&self, f: &[Lanes; LEN]) -> [Lanes; LEN] {
        std::array::from_fn(|k| {
            let terms = &self.terms[self.first[k]..self.first[k + 1]];
            terms
                .iter()
                .fold(Lanes::ZERO, |sum, term| sum + f[usize::from(term.i)] * f[usize::from(term.j)] * term.value)
        })
    }

    fn by_matrix<const LEN: usize>(&self, f: [Lanes; LEN]) -> [Lanes; LEN] {
        let mut out = [Lanes::ZERO; LEN];
        for lane in 0..LANES {
            let vector: Vec<f64> = f.iter().map(|f| f64::from(f.0[lane])).collect();
            let exponential = matrix_exponential(&self.product, &vector);
            out.iter_mut().zip(exponential).for_each(|(out, x)| out.0[lane] = x as f32);
        }
        out
    }
}

/// exp(f) = Exp(M_f) 1 with the product matrix M_f: the exact exponential of functions cut off at the tensor's order.
///
/// The matrix acts on the vector by its Taylor series, in as many steps as keep |M_f| below 1 in each.
///
/// # Panics
/// If `f` has not as many coefficients as the tensor's order.
pub fn matrix_exponential(product: &TripleProduct, f: &[f64]) -> Vec<f64> {
    let n = f.len();
    let matrix = product.matrix(f);
    // No eigenvalue is greater than the greatest row sum.
    let bound = matrix.chunks_exact(n).map(|row| row.iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    let steps = bound.ceil().max(1.0);
    let mut g = vec![0.0; n];
    g[0] = (4.0 * PI).sqrt();
    for _ in 0..steps as usize {
        let mut term = g.clone();
        // 1 / 20! is below the last bit.
        for k in 1..20 {
            let scale = 1.0 / (f64::from(k) * steps);
            term = matrix
                .chunks_exact(n)
                .map(|row| scale * row.iter().zip(&term).map(|(m, t)| m * t).sum::<f64>())
                .collect();
            g.iter_mut().zip(&term).for_each(|(g, t)| *g += t);
        }
    }
    g
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::zonal_log::LogTable;
    use super::*;
    use crate::scene::shapes::Random;
    use crate::sphere::{evaluate, product_rule};

    const ALL: [Exponential; 4] = [Exponential::Matrix, Exponential::Ol, Exponential::Hyb, Exponential::Ps2];

    /// Relative L2 errors of the visibility left by `count` caps anywhere, with half angles even in 5 to 35 degrees, against
    /// the projection of the true product: mean and standard error of the mean over `draws`, for each of [`ALL`].
    fn errors<const LEN: usize>(internal: Order, count: usize, draws: usize) -> [(f64, f64); 4] {
        const OUT: usize = 16;
        let order = Order::new(4).unwrap();
        let rule: Vec<(DVec3, f64)> = product_rule(60, 120).collect();
        let mut y = vec![0.0; rule.len() * OUT];
        for ((w, _), y) in rule.iter().zip(y.chunks_exact_mut(OUT)) {
            evaluate(order, *w, y);
        }
        let table = LogTable::new(internal);
        let exponentials = ALL.map(|kind| Exponentiator::new(kind, internal));
        let mut random = Random::new(count as u64);
        let mut samples = [const { Vec::new() }; 4];
        for _ in 0..draws {
            let mut log = [Lanes::ZERO; LEN];
            let mut caps = Vec::new();
            for _ in 0..count {
                let axis = random.in_ball().normalize();
                let c = random.between(5.0, 35.0).to_radians().cos();
                caps.push((axis, c));
                let row = table.row((1.0 - c) as f32);
                let mut y = [0.0; LEN];
                evaluate(internal, axis, &mut y);
                for (k, log) in log.iter_mut().enumerate() {
                    *log += Lanes::splat(row[k.isqrt()] * y[k] as f32);
                }
            }
            let mut truth = [0.0; OUT];
            for ((w, weight), y) in rule.iter().zip(y.chunks_exact(OUT)) {
                if caps.iter().all(|(axis, c)| w.dot(*axis) < *c) {
                    truth.iter_mut().zip(y).for_each(|(sum, y)| *sum += weight * y);
                }
            }
            let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
            for (samples, exponential) in samples.iter_mut().zip(&exponentials) {
                let g = exponential.exponentiate(log);
                let difference: Vec<f64> = (0..OUT).map(|k| f64::from(g[k].0[3]) - truth[k]).collect();
                samples.push(norm(&difference) / norm(&truth));
            }
        }
        samples.map(|samples| {
            let n = samples.len() as f64;
            let mean = samples.iter().sum::<f64>() / n;
            let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
            (mean, (variance / n).sqrt())
        })
    }

    #[test]
    fn errors_are_those_measured_independently() {
        // For 5, 12 and 20 caps, order 4: matrix, ol, hyb, ps2.
        let expected =
            [(5, [0.034, 0.069, 0.034, 0.035]), (12, [0.095, 0.197, 0.098, 0.095]), (20, [0.155, 0.326, 0.163, 0.156])];
        for (count, expected) in expected {
            for (k, (mean, deviation)) in errors::<16>(Order::new(4).unwrap(), count, 60).into_iter().enumerate() {
                // Both are means over random draws; theirs is rounded to three digits and of unknown spread, taken as ours.
                let allowed = 3.0 * 2f64.sqrt() * deviation + 0.0005;
                assert!((mean - expected[k]).abs() < allowed, "{} of {count}: {mean} +- {deviation}", ALL[k]);
            }
        }
    }

    #[test]
    fn accumulating_at_order_six_halves_the_error() {
        let [four, six] = [errors::<16>(Order::new(4).unwrap(), 12, 40), errors::<36>(Order::new(6).unwrap(), 12, 40)];
        for k in [0, 3] {
            let ratio = six[k].0 / four[k].0;
            assert!((0.35..0.6).contains(&ratio), "{}: {ratio}", ALL[k]);
        }
    }

    #[test]
    fn the_quadratic_series_lacks_the_third_power() {
        let order = Order::new(4).unwrap();
        let [matrix, quadratic] = [Exponential::Matrix, Exponential::Ps2].map(|kind| Exponentiator::new(kind, order));
        let mut random = Random::new(6);
        for norm in [0.05, 0.2, 0.9] {
            let mut f: [Lanes; 16] = std::array::from_fn(|_| Lanes::each(|_| random.between(-1.0, 1.0) as f32));
            f[0] = Lanes::ZERO;
            let length = f.iter().fold(Lanes::ZERO, |sum, x| sum + *x * *x).sqrt();
            let f = f.map(|x| x / length * norm);
            let (exact, found) = (matrix.exponentiate(f), quadratic.exponentiate(f));
            // A product with f is at most its greatest value, norm sqrt(15 / 4 pi), times as long.
            let greatest = norm * (15.0 / (4.0 * std::f32::consts::PI)).sqrt();
            let rest = ONE * (greatest.exp() - 1.0 - greatest - 0.5 * greatest * greatest) + 1e-6;
            for lane in 0..LANES {
                let squares = exact.iter().zip(&found).map(|(a, b)| (a.0[lane] - b.0[lane]).powi(2));
                let error = squares.sum::<f32>().sqrt();
                assert!(error < rest, "{norm}: {error} {rest}");
            }
        }
    }

    #[test]
    fn nothing_accumulated_is_one_to_the_bit() {
        for kind in ALL {
            let g = Exponentiator::new(kind, Order::new(4).unwrap()).exponentiate([Lanes::ZERO; 16]);
            assert_eq!(g[0], Lanes::splat(ONE), "{kind}");
            assert!(g[1..].iter().all(|x| *x == Lanes::ZERO), "{kind}");
        }
    }

    #[test]
    fn lanes_halve_on_their_own() {
        let order = Order::new(4).unwrap();
        let (mut mixed, mut random) = ([Lanes::ZERO; 16], Random::new(3));
        for (k, f) in mixed.iter_mut().enumerate() {
            *f = Lanes::each(|i| if k == 0 { -0.5 } else { 0.3 * i as f32 * random.between(-1.0, 1.0) as f32 });
        }
        for kind in ALL {
            let exponential = Exponentiator::new(kind, order);
            let together = exponential.exponentiate(mixed);
            for lane in 0..LANES {
                let alone = exponential.exponentiate(mixed.map(|f| Lanes::splat(f.0[lane])));
                assert!((0..16).all(|k| alone[k].0[0] == together[k].0[lane]), "{kind}");
            }
        }
    }

    #[test]
    fn matrix_exponential_of_a_constant_is_its_exponential() {
        let product = TripleProduct::new(Order::new(3).unwrap());
        let mut f = vec![0.0; 9];
        f[0] = -2.5 * (4.0 * PI).sqrt();
        let g = matrix_exponential(&product, &f);
        assert!((g[0] / (4.0 * PI).sqrt() - (-2.5f64).exp()).abs() < 1e-15);
    }
}
