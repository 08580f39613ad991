//! The octahedral map: the sphere unfolded onto the octahedron |u| + |v| + |w| = 1, seen from above and from below.
//!
//! A direction (x, y, z) has the coordinates (u, v, w) = (x, y, z) / (|x| + |y| + |z|). The sheet z >= 0 and the sheet
//! z < 0 each fill the square |u| + |v| <= 1. Within one octant an arc of a great circle is a straight line, because the
//! octant's face of the octahedron is a plane.

use glam::{DVec2, DVec3};

/// One of the two halves of the sphere that the octahedral map lays on the square |u| + |v| <= 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sheet {
    /// z >= 0.
    Upper,
    /// z < 0.
    Lower,
}

/// Sheet and coordinates (u, v) of the direction `w`, of any length but zero.
pub fn octahedral(w: DVec3) -> (Sheet, DVec2) {
    let sheet = if w.z < 0.0 { Sheet::Lower } else { Sheet::Upper };
    (sheet, w.truncate() / (w.x.abs() + w.y.abs() + w.z.abs()))
}

/// The unit direction at `uv` (|u| + |v| <= 1) on `sheet`.
pub fn octahedral_direction(sheet: Sheet, uv: DVec2) -> DVec3 {
    let height = 1.0 - uv.x.abs() - uv.y.abs();
    uv.extend(if sheet == Sheet::Upper { height } else { -height }).normalize()
}

/// Solid angle per unit of area: d omega = (u^2 + v^2 + (1 - |u| - |v|)^2)^(-3/2) du dv, on either sheet.
///
/// The exponent printed in Sloan, Nowrouzezahrai and Yuan 2014, +3/2, is a slip: the planes of the octahedron lie at
/// 1/sqrt(3) from the centre and their area element is sqrt(3) du dv, which leaves the inverse cube of the distance.
pub fn octahedral_jacobian(uv: DVec2) -> f64 {
    let height = 1.0 - uv.x.abs() - uv.y.abs();
    (uv.length_squared() + height * height).powf(-1.5)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::sphere::{closed_forms::triangle_solid_angle, harmonics::tests::directions, quadrature::gauss_legendre};

    #[test]
    fn directions_return() {
        for w in directions(100) {
            let (sheet, uv) = octahedral(3.0 * w);
            assert!((octahedral_direction(sheet, uv) - w).length() < 1e-15);
        }
    }

    #[test]
    fn both_sheets_make_the_sphere() {
        // Quadrant by quadrant, where the integrand is smooth, with v = (1 - u) t.
        let rule = gauss_legendre(32);
        let mut sum = 0.0;
        for (i, &(a, wa)) in rule.iter().enumerate() {
            for &(b, wb) in &rule[..] {
                let (u, t) = (0.5 + 0.5 * a, 0.5 + 0.5 * b);
                let signs = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)][i % 4];
                let uv = DVec2::new(signs.0 * u, signs.1 * (1.0 - u) * t);
                sum += 2.0 * 4.0 * 0.25 * wa * wb * (1.0 - u) * octahedral_jacobian(uv);
            }
        }
        assert!((sum - 4.0 * PI).abs() < 1e-12, "{sum}");
    }

    #[test]
    fn jacobian_is_the_solid_angle_of_a_small_cell() {
        let h = 1e-4;
        for sheet in [Sheet::Upper, Sheet::Lower] {
            for (u, v) in [(0.2, 0.3), (-0.5, 0.1), (-0.1, -0.8), (0.4, -0.4)] {
                let at = |a: f64, b: f64| octahedral_direction(sheet, DVec2::new(u + a, v + b));
                let third = h / 3.0;
                let angle = triangle_solid_angle(at(-third, -third), at(2.0 * third, -third), at(-third, 2.0 * third));
                // Sampled at the centroid: second order in h.
                let expected = 0.5 * h * h * octahedral_jacobian(DVec2::new(u, v));
                assert!((angle.abs() / expected - 1.0).abs() < 1e-7, "{sheet:?} {u} {v}");
            }
        }
    }

    #[test]
    fn arcs_are_straight_within_an_octant() {
        for signs in [DVec3::ONE, DVec3::new(-1.0, 1.0, -1.0), DVec3::new(1.0, -1.0, -1.0)] {
            let (a, b) = (DVec3::new(0.9, 0.1, 0.3) * signs, DVec3::new(0.2, 0.5, 0.7) * signs);
            let ends = [a, b].map(|w| octahedral(w).1);
            for k in 1..10 {
                let middle = octahedral(a.lerp(b, 0.1 * f64::from(k))).1;
                assert!((middle - ends[0]).perp_dot(ends[1] - ends[0]).abs() < 1e-15);
            }
        }
    }
}
