//! The product of two functions given by spherical harmonics.

use glam::DVec3;

use super::{
    harmonics::{Order, evaluate},
    quadrature::product_rule,
};

/// The triple-product tensor T_ijk = integral of Y_i Y_j Y_k over the sphere, sparse.
#[derive(Clone, Debug)]
pub struct TripleProduct {
    order: Order,
    /// Non-zeros with i <= j and any k.
    entries: Vec<TripleEntry>,
}

/// A non-zero of the triple-product tensor; it stands for both (i, j, k) and (j, i, k).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TripleEntry {
    /// First index, not above the second.
    pub i: u8,
    /// Second index.
    pub j: u8,
    /// Third index.
    pub k: u8,
    /// The integral of Y_i Y_j Y_k.
    pub value: f64,
}

impl TripleProduct {
    /// The tensor of `order`, all three indices over `order.len()` coefficients.
    ///
    /// Gauss-Legendre (2n latitudes) times trapezoid (4n longitudes) is exact for the integrand's degree 3(n - 1); what is
    /// left of the entries that are zero by symmetry is rounding, below 1e-14, and the smallest true entry up to order 10
    /// is above 1e-4.
    pub fn new(order: Order) -> Self {
        let n = order.len();
        // values[i] = Y_i at all points; weighted[i] = the same times the weight.
        let rule: Vec<(DVec3, f64)> = product_rule(2 * order.bands(), 4 * order.bands()).collect();
        let mut values = vec![vec![0.0; rule.len()]; n];
        let mut y = vec![0.0; n];
        for (p, (w, _)) in rule.iter().enumerate() {
            evaluate(order, *w, &mut y);
            values.iter_mut().zip(&y).for_each(|(row, y)| row[p] = *y);
        }
        let degree = |i: usize| i.isqrt();
        let mut entries = Vec::new();
        for i in 0..n {
            for j in i..n {
                let pair: Vec<f64> =
                    rule.iter().zip(&values[i]).zip(&values[j]).map(|((r, a), b)| r.1 * a * b).collect();
                for (k, third) in values.iter().enumerate() {
                    let (a, b, c) = (degree(i), degree(j), degree(k));
                    if (a + b + c) % 2 == 1 || c > a + b || b > a + c {
                        continue;
                    }
                    let value: f64 = pair.iter().zip(third).map(|(p, y)| p * y).sum();
                    if value.abs() > 1e-10 {
                        entries.push(TripleEntry { i: i as u8, j: j as u8, k: k as u8, value });
                    }
                }
            }
        }
        Self { order, entries }
    }

    /// The order the tensor was made for.
    pub fn order(&self) -> Order {
        self.order
    }

    /// The non-zeros with i <= j, sorted by (i, j, k).
    pub fn entries(&self) -> &[TripleEntry] {
        &self.entries
    }

    /// Coefficients of the product f g, cut off at the tensor's order, into `out`; all slices `order.len()` long.
    ///
    /// # Panics
    /// If a slice has another length.
    pub fn product(&self, f: &[f64], g: &[f64], out: &mut [f64]) {
        let n = self.order.len();
        assert!(f.len() == n && g.len() == n && out.len() == n);
        out.fill(0.0);
        for &TripleEntry { i, j, k, value } in &self.entries {
            let [i, j, k] = [i, j, k].map(usize::from);
            out[k] += value * if i == j { f[i] * g[i] } else { f[i] * g[j] + f[j] * g[i] };
        }
    }

    /// The symmetric matrix M_f with f g = M_f g, row-major, `order.len()` squared values.
    ///
    /// # Panics
    /// If `f` is not `order.len()` long.
    pub fn matrix(&self, f: &[f64]) -> Vec<f64> {
        let n = self.order.len();
        assert_eq!(f.len(), n);
        let mut matrix = vec![0.0; n * n];
        for &TripleEntry { i, j, k, value } in &self.entries {
            let [i, j, k] = [i, j, k].map(usize::from);
            matrix[k * n + j] += value * f[i];
            if i != j {
                matrix[k * n + i] += value * f[j];
            }
        }
        matrix
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::harmonics::tests::directions;

    fn non_zeros(tensor: &TripleProduct) -> usize {
        tensor.entries.iter().map(|e| if e.i == e.j { 1 } else { 2 }).sum()
    }

    #[test]
    fn non_zeros_are_counted() {
        for (bands, count) in [(1, 1), (2, 10), (3, 83), (4, 353), (5, 1158), (6, 2907)] {
            assert_eq!(non_zeros(&TripleProduct::new(Order::new(bands).unwrap())), count, "order {bands}");
        }
    }

    #[test]
    fn zeros_and_non_zeros_are_far_apart() {
        let tensor = TripleProduct::new(Order::MAX);
        assert!(tensor.entries.iter().all(|e| e.value.abs() > 1e-4));
    }

    #[test]
    fn low_bands_multiply_to_their_pointwise_product() {
        // Degrees 4 and 5 add up to 9: the product is kept whole at order 10.
        let order = Order::MAX;
        let tensor = TripleProduct::new(order);
        let coefficients = |bands: usize, seed: f64| -> Vec<f64> {
            (0..100).map(|i| if i < bands * bands { (seed + (i * i) as f64).sin() } else { 0.0 }).collect()
        };
        let (f, g) = (coefficients(5, 1.0), coefficients(6, 2.0));
        let mut product = vec![0.0; 100];
        tensor.product(&f, &g, &mut product);
        let matrix = tensor.matrix(&f);
        for (row, expected) in matrix.chunks(100).zip(&product) {
            let value: f64 = row.iter().zip(&g).map(|(m, g)| m * g).sum();
            assert!((value - expected).abs() < 1e-13);
        }
        let mut y = vec![0.0; 100];
        for w in directions(50) {
            evaluate(order, w, &mut y);
            let at = |f: &[f64]| f.iter().zip(&y).map(|(f, y)| f * y).sum::<f64>();
            assert!((at(&product) - at(&f) * at(&g)).abs() < 1e-12);
        }
    }

    #[test]
    fn one_is_neutral() {
        let tensor = TripleProduct::new(Order::new(4).unwrap());
        let mut one = [0.0; 16];
        one[0] = (4.0 * std::f64::consts::PI).sqrt();
        let g: Vec<f64> = (0..16).map(|i| f64::from(i).cos()).collect();
        let mut out = vec![0.0; 16];
        tensor.product(&one, &g, &mut out);
        assert!(out.iter().zip(&g).all(|(a, b)| (a - b).abs() < 1e-14));
    }
}
