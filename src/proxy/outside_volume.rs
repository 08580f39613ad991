//! How much of a ball lies outside a closed mesh, in closed form.

use std::f64::consts::PI;

use glam::DVec3;

use crate::scene::Geometry;
use crate::sphere::closed_forms::triangle_solid_angle;

/// Volume of the part of a ball that lies outside a closed mesh wound outwards, whose parts do not overlap (Wang, Zhou,
/// Snyder, Liu, Bao, Peng and Guo 2006, *Variational sphere set approximation for solid objects*, section 3).
///
/// Seen from the ball's centre the inside is the signed sum of the cones over all triangles, each cut off by the ball:
/// where a triangle lies within the ball, a pyramid; beyond it, a sector of the ball. The rounding error is some 1e-15
/// ball volumes per triangle within reach.
pub fn outside_volume(geometry: &Geometry, center: DVec3, radius: f64) -> f64 {
    let corners = (0..geometry.triangles.len() as u32).map(|t| geometry.corners(t).map(|p| p - center));
    4.0 / 3.0 * PI * radius.powi(3) - corners.map(|corners| cone_in_ball(corners, radius)).sum::<f64>()
}

/// Volume that a closed mesh encloses, positive when wound outwards (Gauss).
pub fn enclosed_volume(geometry: &Geometry) -> f64 {
    // Relative to a point of the mesh: far from the origin nothing cancels.
    let origin = geometry.positions.first().map_or(DVec3::ZERO, |p| p.as_dvec3());
    let corners = (0..geometry.triangles.len() as u32).map(|t| geometry.corners(t).map(|p| p - origin));
    corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

/// Volume of the cone from the origin over a triangle, cut off by the ball of radius `r` around the origin; positive when
/// the triangle turns its back to the origin.
fn cone_in_ball([a, b, c]: [DVec3; 3], r: f64) -> f64 {
    let r3 = r.powi(3) / 3.0;
    let nearest_possible = a.length() - (b - a).length().max((c - a).length());
    if nearest_possible >= r {
        return r3 * triangle_solid_angle(a, b, c);
    }
    if [a, b, c].iter().all(|p| p.length_squared() <= r * r) {
        return a.dot(b.cross(c)) / 6.0;
    }
    let Some(n) = (b - a).cross(c - a).try_normalize() else { return 0.0 };
    let h = n.dot(a);
    if h == 0.0 {
        return 0.0;
    }
    if h.abs() >= r {
        return r3 * triangle_solid_angle(a, b, c);
    }
    // In the triangle's plane, around the foot of the perpendicular: the ball is a disc, and the triangle the signed sum of
    // the triangles over its edges.
    let foot = h * n;
    let disc = r * r - h * h;
    let turn = |p: DVec3, q: DVec3| n.dot(p.cross(q)).atan2(p.dot(q));
    // Over an angle of the disc, a cone up to it and a sector of the ball up to the plane in place of what lies below.
    let beyond = |p: DVec3, q: DVec3| {
        let angle = turn(p, q);
        let solid_angle = triangle_solid_angle(foot, foot + p, foot + q);
        h * disc * angle / 6.0 + r3 * (solid_angle - h.signum() * angle * (1.0 - h.abs() / r))
    };
    let within = |p: DVec3, q: DVec3| h * n.dot(p.cross(q)) / 6.0;
    let edge = |u: DVec3, v: DVec3| {
        let d = v - u;
        let (half, constant) = (u.dot(d), u.length_squared() - disc);
        let root = (half * half - d.length_squared() * constant).sqrt();
        let [enter, leave] = [-half - root, -half + root].map(|t| (t / d.length_squared()).clamp(0.0, 1.0));
        if root.is_nan() || enter == leave {
            return beyond(u, v);
        }
        let (p, q) = (u + enter * d, u + leave * d);
        let before = if enter > 0.0 { beyond(u, p) } else { 0.0 };
        let after = if leave < 1.0 { beyond(q, v) } else { 0.0 };
        before + within(p, q) + after
    };
    let [u, v, w] = [a, b, c].map(|p| p - foot);
    edge(u, v) + edge(v, w) + edge(w, u)
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::shapes::{Cuboid, Icosphere, Random, TorusKnot};
    use crate::scene::{GeometryBuilder, Mesh};

    fn geometry(mesh: Mesh) -> Geometry {
        let mut builder = GeometryBuilder::default();
        builder.add(mesh, DAffine3::IDENTITY).unwrap();
        builder.build()
    }

    /// Volume of the cap of height `h` of a ball.
    fn cap(r: f64, h: f64) -> f64 {
        PI * h * h * (3.0 * r - h) / 3.0
    }

    #[test]
    fn a_ball_at_a_box_by_closed_forms() {
        let cube = geometry(Cuboid { size: [2.0; 3], ..Cuboid::default() }.mesh().unwrap());
        let [low, high] = cube.bounds().unwrap().map(|p| p.as_dvec3());
        let middle = low.midpoint(high);
        let ball = |r: f64| 4.0 / 3.0 * PI * r.powi(3);
        let close = |center: DVec3, r: f64, expected: f64| {
            let found = outside_volume(&cube, center, r);
            assert!((found - expected).abs() < 1e-13 * ball(r), "{center} {r}: {found} for {expected}");
        };
        close(middle, 0.9, 0.0);
        close(middle, 1.2, 6.0 * cap(1.2, 0.2));
        close(middle, 10.0, ball(10.0) - 8.0);
        close(middle.with_x(high.x), 0.5, ball(0.5) / 2.0);
        close(middle.with_x(high.x + 0.3), 0.7, ball(0.7) - cap(0.7, 0.4));
        close(middle.with_x(high.x + 0.8), 0.7, ball(0.7));
        close(high, 0.5, 7.0 / 8.0 * ball(0.5));
        assert!((enclosed_volume(&cube) - 8.0).abs() < 1e-12);
    }

    #[test]
    fn agrees_with_points_at_random() {
        let mut random = Random::new(3);
        for mesh in [
            TorusKnot { triangles: 600, ..TorusKnot::default() }.mesh().unwrap(),
            Icosphere { subdivisions: 1, ..Icosphere::default() }.mesh().unwrap(),
        ] {
            let geometry = geometry(mesh);
            for _ in 0..4 {
                let center = geometry.positions[(random.unit() * geometry.positions.len() as f64) as usize].as_dvec3()
                    + 0.3 * random.in_ball();
                let radius = random.between(0.3, 1.0);
                let inside = |p: DVec3| {
                    let corners = (0..geometry.triangles.len() as u32).map(|t| geometry.corners(t).map(|q| q - p));
                    corners.map(|[a, b, c]| triangle_solid_angle(a, b, c)).sum::<f64>() > 2.0 * PI
                };
                let count = 4000;
                let outside = (0..count).filter(|_| !inside(center + radius * random.in_ball())).count();
                let share = outside as f64 / f64::from(count);
                let found = outside_volume(&geometry, center, radius) / (4.0 / 3.0 * PI * radius.powi(3));
                let spread = (found * (1.0 - found) / f64::from(count)).max(0.0).sqrt();
                assert!((found - share).abs() < 4.0 * spread + 1e-9, "{center} {radius}: {found} for {share}");
            }
        }
    }
}
