use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use glam::DVec3;

use super::overlap::share_overlap;
use super::{Proxy, Surface};
use crate::scene::Walker;

/// A body as it stands at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Posed {
    /// What is seen of it.
    pub surface: Surface,
    /// What stands for it.
    pub proxies: Vec<Proxy>,
}

const LIMBS: usize = Walker::LIMBS;

/// Ends of a limb, with their radii.
type Limb = [(DVec3, f64); 2];

impl Walker {
    /// The figure `time` seconds after it started.
    pub fn pose(&self, time: f64) -> Posed {
        let limbs = self.limbs(time);
        Posed { surface: self.surface(&limbs), proxies: self.proxies(&limbs) }
    }

    /// Where the limbs are: in units of the height, x to the right, z forward, then put on the circle.
    fn limbs(&self, time: f64) -> [Limb; LIMBS] {
        let phase = PI * self.pace * time;
        // A step is as long as the legs' spread.
        let travelled = 0.36 * self.height * self.pace * time;
        let angle = self.start.to_radians() + travelled / self.circle;
        let (sin, cos) = angle.sin_cos();
        let (outward, forward) = (DVec3::new(sin, 0.0, cos), DVec3::new(cos, 0.0, -sin));
        let origin = DVec3::from(self.center) + self.circle * outward;
        let place = |p: DVec3| origin + self.height * (p.x * outward + p.y * DVec3::Y + p.z * forward);

        let bob = 0.012 * (2.0 * phase).cos();
        let sway = 0.015 * phase.sin();
        let hip = DVec3::new(sway, 0.50 + bob, 0.0);
        let neck = DVec3::new(-0.4 * sway, 0.82 + bob, 0.015);
        let head = DVec3::new(-0.6 * sway, 0.925 + bob, 0.03);
        let turn = |length: f64, angle: f64| DVec3::new(0.0, -length * angle.cos(), length * angle.sin());
        let leg = |side: f64| {
            let swing = (phase + if side > 0.0 { 0.0 } else { PI }).sin();
            let lift = (phase + if side > 0.0 { FRAC_PI_2 } else { -FRAC_PI_2 }).sin().max(0.0);
            let top = hip + DVec3::new(0.055 * side, -0.02, 0.0);
            let knee = top + turn(0.24, 0.45 * swing + 0.15 * lift);
            let foot = knee + turn(0.22, 0.45 * swing - 0.1 - 0.7 * lift);
            (top, knee, foot)
        };
        let arm = |side: f64| {
            let swing = -(phase + if side > 0.0 { 0.0 } else { PI }).sin();
            let top = neck + DVec3::new(0.115 * side, -0.02, 0.0);
            let elbow = top + turn(0.17, 0.5 * swing) + DVec3::new(0.03 * side, 0.0, 0.0);
            let hand = elbow + turn(0.16, 0.5 * swing + 0.5);
            (top, elbow, hand)
        };
        let ((lt, lk, lf), (rt, rk, rf)) = (leg(-1.0), leg(1.0));
        let ((ls, le, lh), (rs, re, rh)) = (arm(-1.0), arm(1.0));
        let limb = |a: DVec3, ra: f64, b: DVec3, rb: f64| [(place(a), ra * self.height), (place(b), rb * self.height)];
        [
            limb(hip, 0.085, neck, 0.095),
            limb(neck, 0.04, head, 0.065),
            limb(lt, 0.062, lk, 0.045),
            limb(lk, 0.043, lf, 0.030),
            limb(rt, 0.062, rk, 0.045),
            limb(rk, 0.043, rf, 0.030),
            limb(ls, 0.042, le, 0.033),
            limb(le, 0.031, lh, 0.027),
            limb(rs, 0.042, re, 0.033),
            limb(re, 0.031, rh, 0.027),
        ]
    }

    fn surface(&self, limbs: &[Limb; LIMBS]) -> Surface {
        let mut surface = Surface::default();
        for limb in limbs {
            rounded_cone(limb, &mut surface);
        }
        surface.triangles = triangles(limbs.len());
        surface.albedo = vec![self.albedo.into(); surface.triangles.len()];
        surface
    }

    /// Balls along the limbs, as many on each as its share of all lengths over their radii.
    fn proxies(&self, limbs: &[Limb; LIMBS]) -> Vec<Proxy> {
        let wanted = limbs.map(|[(a, ra), (b, rb)]| 1.0 + a.distance(b) / (ra + rb));
        let total: f64 = wanted.iter().sum();
        let spare = self.spheres - LIMBS;
        let (mut proxies, mut due) = (Vec::with_capacity(self.spheres), 0.0);
        for ([(a, ra), (b, rb)], wanted) in limbs.iter().zip(wanted) {
            let before = f64::round(due) as usize;
            due += spare as f64 * wanted / total;
            let count = 1 + f64::round(due) as usize - before;
            for k in 0..count {
                // One alone stands in the middle, several reach from end to end.
                let t = if count == 1 { 0.5 } else { k as f64 / (count - 1) as f64 };
                let (center, radius) = (a.lerp(*b, t).as_vec3(), (ra + t * (rb - ra)) as f32);
                proxies.push(Proxy { center, radius, albedo: self.albedo.into(), share: 1.0 });
            }
        }
        share_overlap(&mut proxies);
        proxies
    }
}

/// Corners around a limb.
const AROUND: usize = 20;
/// Rings of corners on each of its round ends, from the pole on.
const RINGS: usize = 7;

/// Adds the corners of the surface that a ball sweeps.
fn rounded_cone([(a, ra), (b, rb)]: &Limb, surface: &mut Surface) {
    let axis = (*b - *a).normalize_or(DVec3::Y);
    let (u, v) = axis.any_orthonormal_pair();
    // Where the straight side leaves the balls: its normals have this height along the axis.
    let tangent = ((ra - rb) / a.distance(*b).max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0).asin();
    for ring in 0..2 * RINGS {
        let (center, radius, low, high, k) = if ring < RINGS {
            (*a, *ra, -FRAC_PI_2, tangent, ring)
        } else {
            (*b, *rb, tangent, FRAC_PI_2, ring - RINGS)
        };
        let (sin, cos) = (low + (high - low) * k as f64 / (RINGS - 1) as f64).sin_cos();
        for step in 0..AROUND {
            let (s, c) = (TAU * step as f64 / AROUND as f64).sin_cos();
            let normal = sin * axis + cos * (c * u + s * v);
            surface.positions.push((center + radius * normal).as_vec3());
            surface.normals.push(normal.as_vec3());
        }
    }
}

/// Triangles of `limbs` rounded cones, counter-clockwise seen from outside.
fn triangles(limbs: usize) -> Arc<[[u32; 3]]> {
    let mut triangles = Vec::new();
    for limb in 0..limbs {
        for ring in 0..2 * RINGS - 1 {
            for step in 0..AROUND {
                let at = |ring: usize, step: usize| ((limb * 2 * RINGS + ring) * AROUND + step % AROUND) as u32;
                let (a, b, c, d) = (at(ring, step), at(ring, step + 1), at(ring + 1, step), at(ring + 1, step + 1));
                // The rings at the poles are points.
                if ring > 0 {
                    triangles.push([a, b, d]);
                }
                if ring < 2 * RINGS - 2 {
                    triangles.push([a, d, c]);
                }
            }
        }
    }
    triangles.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_those_of_many_balls() {
        let walker = Walker { spheres: 4000, start: 30.0, ..Walker::default() };
        let posed = walker.pose(1.3);
        assert_eq!(posed.proxies.len(), 4000);
        assert!(posed.proxies.iter().all(|proxy| proxy.radius > 0.0 && proxy.share > 0.0 && proxy.share < 0.2));
        for p in &posed.surface.positions {
            let distance =
                posed.proxies.iter().map(|proxy| proxy.center.distance(*p) - proxy.radius).fold(f32::MAX, f32::min);
            // Corners lie on their own limb's surface: on a ball, or inside of another limb's.
            assert!(distance < 2e-3, "{distance}");
        }
        // Outside: the normals of faces agree with those of corners.
        let surface = &posed.surface;
        for t in surface.triangles.iter() {
            let [a, b, c] = t.map(|v| surface.positions[v as usize]);
            assert!((b - a).cross(c - a).dot(surface.normals[t[0] as usize]) > 0.0);
        }
    }

    #[test]
    fn straight_sides_touch_the_balls_along_them() {
        let limbs = Walker::default().limbs(0.7);
        for limb @ [(a, ra), (b, rb)] in &limbs {
            let mut surface = Surface::default();
            rounded_cone(limb, &mut surface);
            for step in 0..AROUND {
                let [from, to] = [RINGS - 1, RINGS].map(|ring| surface.positions[ring * AROUND + step].as_dvec3());
                let middle = from.midpoint(to);
                let ball = |k: i32| (a.lerp(*b, f64::from(k) / 1e3), ra + f64::from(k) / 1e3 * (rb - ra));
                let outside = (0..=1000).map(ball).map(|(c, r)| c.distance(middle) - r).fold(f64::INFINITY, f64::min);
                // A thousand balls miss the straight line by about length^2 / 8 radius / 1000^2.
                assert!(outside.abs() < 1e-5, "{outside}");
            }
        }
    }

    #[test]
    fn walkers_walk_and_swing() {
        let walker = Walker::default();
        let [now, later] = [0.0, 0.4].map(|time| walker.pose(time));
        assert_eq!(now.surface.triangles, later.surface.triangles);
        let feet = |posed: &Posed| posed.surface.positions.iter().map(|p| p.y).fold(f32::MAX, f32::min);
        assert!(feet(&now).abs() < 0.12 && feet(&later).abs() < 0.12, "{} {}", feet(&now), feet(&later));
        let moved: Vec<f32> =
            now.proxies.iter().zip(&later.proxies).map(|(a, b)| a.center.distance(b.center)).collect();
        let (least, most) = moved.iter().fold((f32::MAX, 0.0f32), |(l, m), x| (l.min(*x), m.max(*x)));
        assert!(most > 1.3 * least, "{least} {most}");
    }
}
