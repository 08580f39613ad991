//! Known answers: solid angles and form factors of simple shapes seen from a point.
//!
//! Shapes are given relative to the receiver, which sits at the origin. A *form factor* here is the share of the
//! cosine-weighted hemisphere about the unit normal that the shape covers, (1/pi) integral of max(0, n.w), so that
//! ambient occlusion (accessibility) is one minus the form factor of what occludes.

use std::f64::consts::{FRAC_1_PI, PI};

use glam::DVec3;

use super::{BoundaryArc, Order, region_harmonics};

/// Signed solid angle of the triangle (a, b, c), positive when a.(b x c) > 0 (van Oosterom and Strackee 1983, eq. 8).
/// Corners need no particular length; in (-2 pi, 2 pi].
pub fn triangle_solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let [la, lb, lc] = [a, b, c].map(DVec3::length);
    2.0 * a.dot(b.cross(c)).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
}

/// Solid angle of a planar convex polygon, corners in order; not negative.
pub fn polygon_solid_angle(corners: &[DVec3]) -> f64 {
    corners.windows(2).skip(1).map(|edge| triangle_solid_angle(corners[0], edge[0], edge[1])).sum::<f64>().abs()
}

/// Form factor of a planar convex polygon of any winding, whatever part of it lies below the horizon.
///
/// The part above n.w = 0 is cut out, then Lambert's formula (Lambert 1760; Goral et al. 1984, eq. 16):
/// F = 1/(2 pi) |sum over edges of angle(a, b) n.(a x b)/|a x b||.
pub fn polygon_form_factor(corners: &[DVec3], n: DVec3) -> f64 {
    let above = above_horizon(corners, n);
    let sum: f64 = (0..above.len())
        .map(|k| {
            let (a, b) = (above[k].start, above[(k + 1) % above.len()].start);
            let normal = a.cross(b);
            let sine = normal.length();
            if sine > 0.0 { sine.atan2(a.dot(b)) * n.dot(normal) / sine } else { 0.0 }
        })
        .sum();
    0.5 * FRAC_1_PI * sum.abs()
}

/// SH coefficients of the directions that a planar convex polygon covers, `order.len()` of them: of its part above n.w = 0
/// where there is a horizon. The polygon's plane must not hold the receiver.
pub fn polygon_harmonics(order: Order, corners: &[DVec3], n: Option<DVec3>) -> Vec<f64> {
    let mut harmonics = vec![0.0; order.len()];
    if corners.len() < 3 {
        return harmonics;
    }
    // Any three corners that are not in line tell the winding; the sum over a fan does without choosing them.
    let fan = corners.windows(2).skip(1).map(|edge| triangle_solid_angle(corners[0], edge[0], edge[1]));
    let mut corners = corners.to_vec();
    if fan.sum::<f64>() < 0.0 {
        corners.reverse();
    }
    let sides = match n {
        Some(n) => above_horizon(&corners, n),
        None => corners.into_iter().map(|start| Side { start, is_level: false }).collect(),
    };
    if sides.len() < 3 {
        return harmonics;
    }
    let arcs: Vec<BoundaryArc> = (0..sides.len())
        .filter_map(|k| {
            let (Side { start, is_level }, end) = (sides[k], sides[(k + 1) % sides.len()].start);
            // It may pass the receiver as near as the polygon's plane does, and then its ends tell no direction.
            let horizon = n.filter(|_| is_level);
            let normal = horizon.or_else(|| start.cross(end - start).try_normalize())?;
            Some(BoundaryArc { start: start.normalize(), end: end.normalize(), normal })
        })
        .collect();
    // By Girard's theorem, whose angles are well-conditioned where the receiver all but lies on the polygon.
    let turns = (0..arcs.len()).map(|k| {
        let (from, to) = (arcs[k], arcs[(k + 1) % arcs.len()]);
        to.start.dot(from.normal.cross(to.normal)).atan2(from.normal.dot(to.normal))
    });
    let solid_angle = 2.0 * PI - turns.sum::<f64>();
    region_harmonics(order, &arcs, solid_angle, &mut harmonics);
    harmonics
}

/// A side of a polygon, to the start of the next one.
#[derive(Clone, Copy, Debug)]
struct Side {
    start: DVec3,
    /// Whether it is where the horizon cuts the polygon.
    is_level: bool,
}

/// The part of a planar convex polygon above n.w = 0.
fn above_horizon(corners: &[DVec3], n: DVec3) -> Vec<Side> {
    let mut above = Vec::with_capacity(corners.len() + 1);
    for (k, &a) in corners.iter().enumerate() {
        let b = corners[(k + 1) % corners.len()];
        let (ha, hb) = (n.dot(a), n.dot(b));
        if ha >= 0.0 {
            above.push(Side { start: a, is_level: ha == 0.0 && hb < 0.0 });
        }
        if (ha > 0.0 && hb < 0.0) || (ha < 0.0 && hb > 0.0) {
            above.push(Side { start: a.lerp(b, ha / (ha - hb)), is_level: hb < 0.0 });
        }
    }
    above
}

/// Form factor of a disc of `radius` parallel to the receiver's plane at `height` above it, its centre `offset` to the side
/// (Howell's catalogue of radiation configuration factors, B-13).
pub fn disc_form_factor(radius: f64, height: f64, offset: f64) -> f64 {
    let [r, h, a] = [radius, height, offset].map(|x| x * x);
    0.5 * (1.0 - (h + a - r) / ((h + a + r) * (h + a + r) - 4.0 * a * r).sqrt())
}

/// Form factor of a rectangle of sides `a` and `b` parallel to the receiver's plane at `height`, one corner straight above
/// the receiver (Howell's catalogue, B-3).
pub fn rectangle_form_factor(a: f64, b: f64, height: f64) -> f64 {
    let (x, y) = (a / height, b / height);
    let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    0.5 * FRAC_1_PI * (x / p * (y / p).atan() + y / q * (x / q).atan())
}

/// Form factor of an upright wall of infinite length: `height` over the receiver's plane, at `distance`: half of one minus
/// the cosine of the wall's angle of elevation.
pub fn wall_form_factor(height: f64, distance: f64) -> f64 {
    0.5 * (1.0 - distance / distance.hypot(height))
}

/// Form factor of a sphere of `radius` about `centre`, the receiver outside of it, whatever part lies below the horizon
/// (Snyder 1996, section 2.2; Howell's catalogue, B-43).
///
/// With s = radius / distance and c = n.centre / distance: s^2 c where the sphere stands clear of the horizon (c >= s), 0
/// below (c <= -s). Between, Lambert's contour integral over the arc of the cap's rim that lies above the horizon and the
/// horizon's own arc, on which the integrand is constant.
pub fn sphere_form_factor(centre: DVec3, radius: f64, n: DVec3) -> f64 {
    let distance = centre.length();
    let s = radius / distance;
    let c = n.dot(centre) / distance;
    if c >= s {
        return s * s * c;
    }
    if c <= -s {
        return 0.0;
    }
    // Half the rim's arc above the horizon, as an angle about the centre's axis: cos t > -c k / (s q).
    let q = (1.0 - c * c).sqrt();
    let k = (1.0 - s * s).sqrt();
    let half_rim = (-c * k / (s * q)).clamp(-1.0, 1.0).acos();
    // Half the horizon's arc within the cap: cos t > k / q.
    let half_horizon = (k / q).clamp(-1.0, 1.0).acos();
    // (1/2pi) times the integral of n.(w x dw): over the rim s^2 c dt - s k q cos t dt, over the horizon dt.
    FRAC_1_PI * (s * s * c * half_rim - s * k * q * half_rim.sin() + half_horizon)
}

/// Solid angle of a sphere of `radius` at `distance` from its centre.
pub fn sphere_solid_angle(radius: f64, distance: f64) -> f64 {
    let s = radius / distance;
    // 1 - sqrt(1 - s^2) without the cancellation.
    2.0 * PI * s * s / (1.0 + (1.0 - s * s).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::quadrature::gauss_legendre;

    #[test]
    fn octants_and_tiny_triangles() {
        assert!((triangle_solid_angle(DVec3::X, 2.0 * DVec3::Y, 3.0 * DVec3::Z) - 0.5 * PI).abs() < 1e-15);
        assert!((triangle_solid_angle(DVec3::X, DVec3::Z, DVec3::Y) + 0.5 * PI).abs() < 1e-15);
        let (h, far) = (1e-6, DVec3::new(0.0, 0.0, 10.0));
        let tiny = triangle_solid_angle(far, far + h * DVec3::X, far + h * DVec3::Y);
        assert!((tiny / (0.5 * h * h / 100.0) - 1.0).abs() < 1e-6);
        let cube = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 1.0));
        assert!((polygon_solid_angle(&cube) - 4.0 * PI / 6.0).abs() < 1e-14);
    }

    #[test]
    fn polygons_equal_rectangles_and_walls() {
        let corners = [(0.0, 0.0), (0.7, 0.0), (0.7, 1.9), (0.0, 1.9)].map(|(x, y)| DVec3::new(x, y, 0.4));
        let expected = rectangle_form_factor(0.7, 1.9, 0.4);
        assert!((polygon_form_factor(&corners, DVec3::Z) - expected).abs() < 1e-15);
        // The form factor of a half space: a very long wall, which starts below the horizon.
        let long = 1e7;
        let wall = [(-long, -3.0), (long, -3.0), (long, 2.0), (-long, 2.0)].map(|(x, z)| DVec3::new(x, 1.5, z));
        assert!((polygon_form_factor(&wall, DVec3::Z) - wall_form_factor(2.0, 1.5)).abs() < 1e-13);
    }

    #[test]
    fn polygon_harmonics_start_with_solid_angle_and_form_factor() {
        let corners = [(-1.0, -2.0), (3.0, -1.0), (2.0, 2.0), (-1.5, 1.0)].map(|(x, z)| DVec3::new(x, 1.5, z));
        let order = Order::new(3).unwrap();
        let y = |harmonics: &[f64], n: DVec3| {
            // The cosine from band 1: Y_1 = sqrt(3/4pi) (y, z, x).
            (4.0 * PI / 3.0).sqrt() * DVec3::new(harmonics[3], harmonics[1], harmonics[2]).dot(n) * FRAC_1_PI
        };
        for n in [DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.48, -0.64), -DVec3::Y] {
            for turned in [false, true] {
                let mut corners = corners.to_vec();
                if turned {
                    corners.reverse();
                }
                let harmonics = polygon_harmonics(order, &corners, Some(n));
                assert!((y(&harmonics, n) - polygon_form_factor(&corners, n)).abs() < 1e-14, "{n}");
            }
        }
        let (all, up, down) = (None, Some(DVec3::Z), Some(-DVec3::Z));
        let [all, up, down] = [all, up, down].map(|n| polygon_harmonics(order, &corners, n));
        assert!((all[0] * (4.0 * PI).sqrt() - polygon_solid_angle(&corners)).abs() < 1e-14);
        assert!((0..order.len()).all(|i| (all[i] - up[i] - down[i]).abs() < 1e-14));
    }

    /// What a receiver hides that all but lies on a polygon is the half space behind it, to the distance over that from the
    /// sides.
    #[test]
    fn polygons_within_reach_hide_a_half_space() {
        let height = 1e-12;
        let order = Order::new(4).unwrap();
        for (n, x, z) in [
            (DVec3::new(-0.64, -0.06, 0.76), 0.0, 0.0),
            (DVec3::new(0.3, 0.9, -0.2), 0.0, 0.0),
            (DVec3::new(0.1, -0.9, 0.5), 0.0, 0.0),
            (DVec3::new(-0.82, 0.16, -0.55), -0.5, -0.95),
            (DVec3::new(0.31, -0.05, 0.95), 0.99, 0.9),
        ] {
            let n = n.normalize();
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            let corners = corners.map(|corner| DVec3::new(corner.0 - x, -height, corner.1 - z));
            let distance = 1.0 - f64::max(f64::abs(x), f64::abs(z));
            // The lune between the horizon and the polygon's plane, by quarters of its sides.
            let axis = n.cross(DVec3::NEG_Y).normalize();
            let side = |normal: DVec3, from: DVec3| {
                let turned = normal.cross(from);
                [(from, turned), (turned, -from)].map(|(start, end)| BoundaryArc { start, end, normal })
            };
            let arcs = [side(n, -axis), side(DVec3::NEG_Y, axis)].concat();
            let mut lune = vec![0.0; order.len()];
            region_harmonics(order, &arcs, 2.0 * n.angle_between(DVec3::Y), &mut lune);
            for (found, expected) in polygon_harmonics(order, &corners, Some(n)).iter().zip(&lune) {
                let allowed = 20.0 * height / distance;
                assert!((found - expected).abs() < allowed, "{n}: {found} instead of {expected}");
            }
        }
    }

    #[test]
    fn polygons_with_many_sides_become_discs() {
        let (radius, height, offset) = (0.8, 0.6, 1.1);
        let corners: Vec<_> = (0..4000)
            .map(|k| {
                let (s, c) = (2.0 * PI * f64::from(k) / 4000.0).sin_cos();
                DVec3::new(offset + radius * c, radius * s, height)
            })
            .collect();
        // The polygon lacks 2 pi^2 / (3 k^2) of the disc's area.
        let expected = disc_form_factor(radius, height, offset);
        assert!((polygon_form_factor(&corners, DVec3::Z) / expected - 1.0).abs() < 1e-6);
        assert!((disc_form_factor(0.3, 0.4, 0.0) - 0.36).abs() < 1e-15);
    }

    /// Share of the cosine-weighted hemisphere within the cap: rings about the cap's axis, each clipped at the horizon.
    fn sphere_by_quadrature(s: f64, c: f64) -> f64 {
        let q = (1.0 - c * c).sqrt();
        let ring = |angle: f64| {
            let (sine, cosine) = angle.sin_cos();
            // n.w = a + b cos t; integral of max(0, n.w) dt over the ring.
            let (a, b) = (c * cosine, q * sine);
            let half = (-a / b).clamp(-1.0, 1.0).acos();
            2.0 * (a * half + b * half.sin()) * sine
        };
        let end = s.asin();
        // The ring's integrand has a kink where the ring first touches the horizon.
        let kink = c.asin().abs().min(end);
        [(0.0, kink), (kink, end)]
            .into_iter()
            .filter(|(lo, hi)| hi > lo)
            .flat_map(|(lo, hi)| {
                // A cubic substitution with a slope of zero at both ends tames the square roots there.
                gauss_legendre(200).into_iter().map(move |(x, w)| {
                    let t = 0.25 * (2.0 + x * (3.0 - x * x));
                    w * (hi - lo) * 0.75 * (1.0 - x * x) * ring(lo + (hi - lo) * t)
                })
            })
            .sum::<f64>()
            * FRAC_1_PI
    }

    #[test]
    fn spheres_equal_quadrature_at_any_height() {
        for s in [0.05, 0.3, 0.7, 0.95, 0.999] {
            for step in -20..=20 {
                let c = 0.999 * f64::from(step) / 20.0;
                let centre = 2.0 * DVec3::new((1.0 - c * c).sqrt(), 0.0, c);
                let value = sphere_form_factor(centre, 2.0 * s, DVec3::Z);
                assert!((value - sphere_by_quadrature(s, c)).abs() < 1e-9, "s {s} c {c}: {value}");
            }
        }
    }

    #[test]
    fn sphere_has_the_solid_angle_of_its_cap() {
        assert!((sphere_solid_angle(1.0, 1.0) - 2.0 * PI).abs() < 1e-15);
        let half_angle = 0.4f64;
        assert!((sphere_solid_angle(half_angle.sin(), 1.0) - 2.0 * PI * (1.0 - half_angle.cos())).abs() < 1e-15);
    }
}
