//! Integrals along an arc of a great circle of harmonics times a linear function.

use std::f64::consts::PI;
use std::sync::LazyLock;

use glam::DVec3;

use super::{BoundaryArc, Order, evaluate_many, gauss_legendre};

/// Integral of (n.w)(m.w) along an arc, by its length: with w = start cos t + tangent sin t, the integrals of cos^2,
/// cos sin and sin^2 from 0 to tau are (tau + sin cos)/2, sin^2/2 and (tau - sin cos)/2.
pub fn cosine_along(arc: &BoundaryArc, n: DVec3, m: DVec3) -> f64 {
    let tangent = arc.normal.cross(arc.start);
    let tau = arc.angle();
    let (sin, cos) = tau.sin_cos();
    let (n_start, n_tangent) = (n.dot(arc.start), n.dot(tangent));
    let (m_start, m_tangent) = (m.dot(arc.start), m.dot(tangent));
    0.5 * (n_start * m_start * (tau + sin * cos)
        + (n_start * m_tangent + n_tangent * m_start) * sin * sin
        + n_tangent * m_tangent * (tau - sin * cos))
}

/// Writes to `out` (`order.len()` values) the integrals of y (m.w) along an arc of at most half a turn, by its length.
///
/// Gauss-Legendre with as many nodes as the arc needs: the truncation error is below 1e-15 times the largest |y|
/// and the largest |m.w| on the arc, less than rounding.
///
/// # Panics
/// If `out` has another length.
pub fn harmonics_along(order: Order, arc: &BoundaryArc, m: DVec3, out: &mut [f64]) {
    assert_eq!(out.len(), order.len());
    out.fill(0.0);
    let tau = arc.angle();
    let rule = rule(order.bands() as f64 * tau.abs());
    let tangent = arc.normal.cross(arc.start);
    let (mut directions, mut values) = ([DVec3::ZERO; LANES], [0.0; LANES * LONGEST_ROW]);
    for nodes in rule.chunks(LANES) {
        let directions = &mut directions[..nodes.len()];
        let values = &mut values[..nodes.len() * order.len()];
        for (w, (x, _)) in directions.iter_mut().zip(nodes) {
            let (sin, cos) = (0.5 * tau * (1.0 + x)).sin_cos();
            *w = cos * arc.start + sin * tangent;
        }
        evaluate_many(order, directions, values);
        for ((row, w), (_, weight)) in values.chunks_exact(order.len()).zip(directions).zip(nodes) {
            let weight = 0.5 * tau * weight * m.dot(*w);
            out.iter_mut().zip(row).for_each(|(sum, y)| *sum += weight * y);
        }
    }
}

/// Directions evaluated side by side.
const LANES: usize = 8;
/// Coefficients of the largest order, [`Order::MAX`] raised.
const LONGEST_ROW: usize = 121;

/// A rule and the largest product of degree and angle that it is for.
type Rule = (f64, Vec<(f64, f64)>);

/// The rule for trigonometric polynomials of a degree over an angle, by their product.
///
/// n nodes leave an error of c_n tau^(2n+1) |f^(2n)|, c_n = n!^4 / ((2n+1) (2n)!^3) (Davis and Rabinowitz 1984, section
/// 2.7), and |f^(2n)| <= degree^(2n) max |f| over the circle (Bernstein 1912). Over the circle m.w reaches more than its
/// largest value on the arc by a factor up to sqrt(tau^2 + pi^2) / tau: on the arc there is its value in the middle, p, and
/// half the difference of those at the ends, q sin(tau/2). That leaves c_n (degree tau)^(2n) times pi sqrt(2) at most.
fn rule(degree_angle: f64) -> &'static [(f64, f64)] {
    /// Relative error of a rule where its reach ends.
    const TOLERANCE: f64 = 2e-16;
    static RULES: LazyLock<Vec<Rule>> = LazyLock::new(|| {
        // Eleven bands over half a turn.
        let farthest = 11.0 * PI;
        let mut rules: Vec<Rule> = Vec::new();
        // ln c_n, from c_0 = 1.
        let mut log = 0.0;
        let mut n = 0;
        while rules.last().is_none_or(|&(reach, _)| reach < farthest) {
            n += 1;
            let k = n as f64;
            let ratio = k.powi(4) * (2.0 * k - 1.0) / ((2.0 * k + 1.0) * (2.0 * k * (2.0 * k - 1.0)).powi(3));
            log += f64::ln(ratio);
            rules.push((((TOLERANCE.ln() - log) / (2.0 * k)).exp(), gauss_legendre(n)));
        }
        rules
    });
    let needed = RULES.partition_point(|&(reach, _)| reach < degree_angle).min(RULES.len() - 1);
    &RULES[needed].1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::evaluate;
    use crate::sphere::harmonics::tests::directions;

    /// Arcs of many lengths and positions, with linear functions whose largest value on the arc is about one: by the foot
    /// of a line at distance `foot` and by any vector.
    fn arcs() -> Vec<(BoundaryArc, DVec3)> {
        let spread = directions(20);
        let angles = [1e-12, 1e-3, 0.02, 0.1, 0.5, 1.0, 1.7, 2.5, 3.1, PI - 1e-9];
        let arc = |(i, &start): (usize, &DVec3), angle: f64| {
            let normal = start.cross(spread[(7 * i + 3) % 20]).normalize();
            let (sin, cos) = angle.sin_cos();
            let tangent = normal.cross(start);
            let arc = BoundaryArc { start, end: cos * start + sin * tangent, normal };
            // 1 at the start and falling to 0 at the end, or any.
            let falling = if i % 2 == 0 { start - tangent * cos / sin.max(angle / PI) } else { spread[(3 * i) % 20] };
            (arc, falling)
        };
        spread.iter().take(20).enumerate().flat_map(|start| angles.map(|angle| arc(start, angle))).collect()
    }

    /// Gauss-Legendre with 40 nodes, which is exact to rounding for degree 11 over half a turn.
    fn by_many_nodes(arc: &BoundaryArc, f: impl Fn(DVec3) -> f64) -> f64 {
        let tau = arc.angle();
        let point = |t: f64| t.cos() * arc.start + t.sin() * arc.normal.cross(arc.start);
        gauss_legendre(40).iter().map(|(x, weight)| 0.5 * tau * weight * f(point(0.5 * tau * (1.0 + x)))).sum()
    }

    #[test]
    fn harmonics_equal_many_nodes() {
        for bands in [1, 2, 5, 10, 11] {
            let order = Order::new(bands.min(10)).unwrap();
            let order = if bands > 10 { order.raised() } else { order };
            let mut result = vec![f64::NAN; order.len()];
            for (arc, m) in arcs() {
                harmonics_along(order, &arc, m, &mut result);
                for i in [0, order.len() / 3, order.len() / 2, order.len() - 1] {
                    let expected = by_many_nodes(&arc, |w| {
                        let mut y = vec![0.0; order.len()];
                        evaluate(order, w, &mut y);
                        y[i] * m.dot(w)
                    });
                    let error = (result[i] - expected).abs();
                    assert!(error < 1e-14, "{error:e}: order {bands}, coefficient {i}, angle {}", arc.angle());
                }
            }
        }
    }

    #[test]
    fn cosines_equal_many_nodes() {
        let n = DVec3::new(0.36, -0.48, 0.8);
        for (arc, m) in arcs() {
            let error = (cosine_along(&arc, n, m) - by_many_nodes(&arc, |w| n.dot(w) * m.dot(w))).abs();
            assert!(error < 1e-14, "{error:e}: angle {}", arc.angle());
        }
    }

    #[test]
    fn short_arcs_need_few_nodes() {
        assert_eq!(rule(1e-9).len(), 1);
        assert!(rule(0.5).len() <= 6);
        assert!(rule(11.0 * PI).len() < 40);
    }
}
