//! What a sphere hides of a receiver's hemisphere when the receiver's own tangent plane cuts it, or when the receiver lies
//! inside of it.

use std::f64::consts::PI;
use std::fmt;
use std::sync::LazyLock;

use super::lanes::{LANES, Lanes};

/// The rule for spheres that reach below the receiver's tangent plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum SelfShadowing {
    /// No rule: whole spheres, also of what lies below the horizon; a receiver inside of one sees half of everything.
    Whole,
    /// The replacement by Ren et al. 2006, section 5: the sphere between the tangent plane and the blocker's top. It jumps
    /// where the centre passes through the plane, and hides too little near contact.
    Replaced,
    /// Continuous: the cap is clipped by the horizon and replaced by the cap of equal solid angle about the centroid of what
    /// is left.
    #[default]
    Clipped,
}

impl fmt::Display for SelfShadowing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Whole => "whole",
            Self::Replaced => "replaced",
            Self::Clipped => "clipped",
        })
    }
}

/// What is left of a cap above a horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClippedCap {
    /// Its solid angle.
    pub solid_angle: f64,
    /// Angle from the cap's axis to the direction of the centroid, towards the normal.
    pub tilt: f64,
}

/// The part above n.w = 0 of the cap of half angle asin(`alpha`), alpha in (0, 1], about an axis with n.axis = `elevation`.
///
/// The solid angle by Gauss and Bonnet, the centroid from the moment integral of w = 1/2 contour integral of w x dw (the form
/// factor of Snyder 1996, section 2.2, is its component along n). With c the elevation, k = cos theta, s = alpha, q the sine
/// of the angle between axis and normal, h_r half the rim's arc above the horizon and h_h half the horizon's arc in the cap:
///
/// ```text
/// solid angle = 2 (pi - acos(c / s) - k h_r)
/// moment = s^2 h_r axis - k s sin(h_r) a + h_h n          a: unit vector from the axis towards n
/// ```
pub fn clipped_cap(alpha: f64, elevation: f64) -> ClippedCap {
    let (s, c) = (alpha, elevation);
    let k = (1.0 - s * s).max(0.0).sqrt();
    if c >= s {
        return ClippedCap { solid_angle: 2.0 * PI * s * s / (1.0 + k), tilt: 0.0 };
    }
    if c <= -s {
        return ClippedCap { solid_angle: 0.0, tilt: alpha.asin() };
    }
    let q = (1.0 - c * c).max(0.0).sqrt();
    let half_rim = (-c * k / (s * q)).clamp(-1.0, 1.0).acos();
    let half_horizon = (k / q).clamp(-1.0, 1.0).acos();
    let solid_angle = 2.0 * (PI - (c / s).acos() - k * half_rim);
    // n = c axis + q a.
    let along = s * s * half_rim + half_horizon * c;
    let across = half_horizon * q - k * s * half_rim.sin();
    ClippedCap { solid_angle: solid_angle.max(0.0), tilt: across.atan2(along) }
}

/// [`clipped_cap`] over alpha and elevation / alpha, ready for bilinear interpolation.
#[derive(Clone, Debug)]
pub struct ClippedCapTable {
    /// Row for alpha = i / INTERVALS, column for elevation = alpha (2 j / INTERVALS - 1): the share of the cap's solid angle
    /// that is left, and tilt / alpha.
    entries: Vec<[f32; 2]>,
}

static TABLE: LazyLock<ClippedCapTable> = LazyLock::new(ClippedCapTable::new);

impl ClippedCapTable {
    /// Intervals along each axis.
    pub const INTERVALS: usize = 64;

    fn new() -> Self {
        let n = Self::INTERVALS;
        let entries = (0..=n).flat_map(|i| {
            // Small caps stand in for the row of alpha = 0, which exists only as a limit.
            let alpha = (i as f64 / n as f64).max(1e-2);
            let whole = 2.0 * PI * alpha * alpha / (1.0 + (1.0 - alpha * alpha).sqrt());
            (0..=n).map(move |j| {
                // Where nothing is left, the tilt's limit is wanted.
                let place = (2.0 * j as f64 / n as f64 - 1.0).max(-0.999);
                let clipped = clipped_cap(alpha, alpha * place);
                let share = if j == 0 { 0.0 } else { clipped.solid_angle / whole };
                [share as f32, (clipped.tilt / alpha) as f32]
            })
        });
        Self { entries: entries.collect() }
    }

    /// The one table.
    pub fn get() -> &'static Self {
        &TABLE
    }

    /// Rows of [`Self::INTERVALS`] + 1 entries: alpha from 0 to 1 down, elevation / alpha from -1 to 1 across; in each the
    /// share of the cap's solid angle that is left, and tilt / alpha.
    pub fn entries(&self) -> &[[f32; 2]] {
        &self.entries
    }

    /// The share of the cap's solid angle that is left, and the tilt.
    #[inline(always)]
    fn at(&self, alpha: f32, elevation: f32) -> [f32; 2] {
        let n = Self::INTERVALS;
        let x = alpha * n as f32;
        let y = (elevation / alpha * 0.5 + 0.5).clamp(0.0, 1.0) * n as f32;
        let (i, j) = ((x as usize).min(n - 1), (y as usize).min(n - 1));
        let (s, t) = (x - i as f32, y - j as f32);
        let row = |i: usize, k: usize| {
            let [a, b] = [self.entries[i * (n + 1) + j][k], self.entries[i * (n + 1) + j + 1][k]];
            a + t * (b - a)
        };
        let [share, tilt] = [0, 1].map(|k| row(i, k) + s * (row(i + 1, k) - row(i, k)));
        [share, tilt * alpha]
    }
}

/// A sphere as eight receivers see it, after the rule.
pub(super) struct Seen {
    /// Unit direction.
    pub(super) axis: [Lanes; 3],
    /// u = 1 - cos theta.
    pub(super) u: Lanes,
    /// Factor on what the sphere does: 1 unless it is faded out, 0 where it is dropped.
    pub(super) weight: Lanes,
}

/// How deep inside of a sphere, over its radius, a receiver must lie for the sphere to be dropped: for a centre in the tangent
/// plane or below it, and for one straight above.
pub(super) const INSIDE: [f32; 2] = [0.1, 0.5];

/// Applies `rule` to a sphere of `radius` whose centre lies at `offset` from the receivers, in units of length, with the
/// receivers' unit normals. `distance` is the offset's length and `inverse` one over it.
#[inline(always)]
pub(super) fn seen(
    rule: SelfShadowing,
    offset: [Lanes; 3],
    distance: Lanes,
    inverse: Lanes,
    radius: f32,
    normal: [Lanes; 3],
) -> Seen {
    let axis = [offset[0] * inverse, offset[1] * inverse, offset[2] * inverse];
    let one = Lanes::splat(1.0);
    let alpha = (inverse * radius).min(one);
    let elevation = axis[0] * normal[0] + axis[1] * normal[1] + axis[2] * normal[2];
    let mut seen = Seen { axis, u: versine(alpha), weight: one };
    // |elevation| < alpha: the tangent plane cuts the sphere.
    match rule {
        SelfShadowing::Whole => {}
        SelfShadowing::Clipped => {
            if elevation.any_below(alpha) {
                clip(&mut seen, alpha, elevation, normal);
            }
            if distance.any_below(Lanes::splat(radius)) {
                let depth = one - distance / radius;
                let width = elevation.max(Lanes::ZERO) * (INSIDE[1] - INSIDE[0]) + Lanes::splat(INSIDE[0]);
                seen.weight = seen.weight * (one - depth.max(Lanes::ZERO) / width).smoothstep();
            }
        }
        SelfShadowing::Replaced => {
            if elevation.any_below(alpha) {
                replace(&mut seen, offset, distance, elevation, radius, normal);
            }
        }
    }
    seen
}

/// 1 - cos theta from the sine, without cancellation.
#[inline(always)]
fn versine(alpha: Lanes) -> Lanes {
    let one = Lanes::splat(1.0);
    alpha * alpha / (one + (one - alpha * alpha).max(Lanes::ZERO).sqrt())
}

#[inline(always)]
fn clip(seen: &mut Seen, alpha: Lanes, elevation: Lanes, normal: [Lanes; 3]) {
    let table = ClippedCapTable::get();
    for lane in 0..LANES {
        let (alpha, c) = (alpha.0[lane], elevation.0[lane]);
        if c >= alpha {
            continue;
        }
        if c <= -alpha {
            seen.weight.0[lane] = 0.0;
            continue;
        }
        let [share, tilt] = table.at(alpha, c);
        seen.u.0[lane] *= share;
        let (sin, cos) = tilt.sin_cos();
        // axis cos + a sin with a = (n - c axis) / q.
        let ratio = sin / (1.0 - c * c).max(1e-12).sqrt();
        for (axis, normal) in seen.axis.iter_mut().zip(normal) {
            axis.0[lane] = axis.0[lane] * (cos - c * ratio) + normal.0[lane] * ratio;
        }
    }
}

/// With h the centre's height over the tangent plane, |h| < r: the sphere of radius (r + h) / 2 whose lowest point lies on the
/// plane, straight below or above the centre. With h <= 0 its radius is scaled from 0 at the circle in which the plane cuts
/// the blocker to 1 at twice that circle; inside it, and for receivers in the blocker, there is no sphere.
#[inline(always)]
fn replace(seen: &mut Seen, offset: [Lanes; 3], distance: Lanes, elevation: Lanes, r: f32, normal: [Lanes; 3]) {
    for lane in 0..LANES {
        let d = distance.0[lane];
        let h = elevation.0[lane] * d;
        if h >= r {
            continue;
        }
        let inside = d < r;
        if h <= -r || (inside && h <= 0.0) {
            seen.weight.0[lane] = 0.0;
            continue;
        }
        let mut radius = 0.5 * (r + h);
        if h <= 0.0 {
            let circle = (r * r - h * h).max(0.0).sqrt();
            let foot = (d * d - h * h).max(0.0).sqrt();
            let scale = ((foot - circle) / circle.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            radius *= scale;
        }
        let lift = 0.5 * (r - h);
        let moved: [f32; 3] = std::array::from_fn(|k| offset[k].0[lane] + lift * normal[k].0[lane]);
        let length = moved.iter().map(|x| x * x).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
        let alpha = (radius / length).min(1.0);
        seen.u.0[lane] = alpha * alpha / (1.0 + (1.0 - alpha * alpha).max(0.0).sqrt());
        for (axis, moved) in seen.axis.iter_mut().zip(moved) {
            axis.0[lane] = moved / length;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::sphere::product_rule;

    #[test]
    fn clipped_caps_equal_quadrature() {
        let rule: Vec<(DVec3, f64)> = product_rule(400, 800).collect();
        for (alpha, elevation) in
            [(0.3f64, 0.1f64), (0.3, -0.2), (0.8, 0.5), (0.8, -0.7), (1.0, 0.3), (1.0, -0.6), (0.5, 0.9)]
        {
            let axis = DVec3::new((1.0 - elevation * elevation).sqrt(), 0.0, elevation);
            let k = (1.0 - alpha * alpha).sqrt();
            let (mut solid_angle, mut moment) = (0.0, DVec3::ZERO);
            for (w, weight) in &rule {
                if w.z > 0.0 && w.dot(axis) > k {
                    solid_angle += weight;
                    moment += *w * *weight;
                }
            }
            let clipped = clipped_cap(alpha, elevation);
            // The rule's cells along the boundary count or not: about 6 / 800 of its length over sqrt(cells).
            assert!((clipped.solid_angle - solid_angle).abs() < 3e-3, "{alpha} {elevation}: {clipped:?} {solid_angle}");
            let tilt = axis.angle_between(moment);
            assert!((clipped.tilt - tilt).abs() < 3e-3, "{alpha} {elevation}: {clipped:?} {tilt}");
        }
    }

    #[test]
    fn clipped_hemispheres_are_lunes() {
        for elevation in [-0.8, -0.1, 0.2, 0.7] {
            let clipped = clipped_cap(1.0, elevation);
            let beta = f64::acos(elevation);
            assert!((clipped.solid_angle - 2.0 * (PI - beta)).abs() < 1e-14);
            assert!((clipped.tilt - 0.5 * beta).abs() < 1e-12);
        }
    }

    fn one(rule: SelfShadowing, centre: [f32; 3], radius: f32) -> (DVec3, f32, f32) {
        let offset = centre.map(Lanes::splat);
        let distance = centre.iter().map(|x| x * x).sum::<f32>().sqrt();
        let normal = [0.0, 0.0, 1.0].map(Lanes::splat);
        let seen = seen(rule, offset, Lanes::splat(distance), Lanes::splat(1.0 / distance), radius, normal);
        let axis = DVec3::from(seen.axis.map(|x| f64::from(x.0[5])));
        assert!((axis.length() - 1.0).abs() < 1e-5, "{axis}");
        (axis, seen.u.0[5], seen.weight.0[5])
    }

    #[test]
    fn all_rules_leave_clear_spheres_alone() {
        let centre = [1.0, 2.0, 2.0];
        for rule in [SelfShadowing::Whole, SelfShadowing::Replaced, SelfShadowing::Clipped] {
            let (axis, u, weight) = one(rule, centre, 1.5);
            assert!(axis.distance(DVec3::new(1.0, 2.0, 2.0) / 3.0) < 1e-6);
            assert!((u - (1.0 - 0.75f32.sqrt())).abs() < 1e-6 && weight == 1.0);
        }
    }

    #[test]
    fn clipping_is_continuous_and_replacing_is_not() {
        // Over the height of the centre, through both tangencies and the plane; outside and inside of the sphere.
        let largest_step = |rule, x: f32| {
            let blocked = |h: f32| {
                let (_, u, weight) = one(rule, [x, 0.0, h], 1.0);
                u * weight
            };
            (-3000..3000).map(|i| i as f32 * 5e-4).map(|h| (blocked(h + 5e-4) - blocked(h)).abs()).fold(0.0, f32::max)
        };
        // Slopes are below 3 per unit of height but for the clipped rule's fade, which falls over a tenth of a radius.
        for x in [0.3, 0.95, 1.05, 1.6] {
            assert!(largest_step(SelfShadowing::Clipped, x) < 0.02, "{x}: {}", largest_step(SelfShadowing::Clipped, x));
        }
        assert!(largest_step(SelfShadowing::Replaced, 1.05) > 0.05);
    }

    #[test]
    fn table_equals_closed_form() {
        let table = ClippedCapTable::get();
        for i in 0..50 {
            for j in 0..50 {
                let alpha = (f64::from(i) + 0.6) / 50.0;
                let elevation = alpha * ((f64::from(j) + 0.5) / 25.0 - 1.0);
                let [share, tilt] = table.at(alpha as f32, elevation as f32);
                let exact = clipped_cap(alpha, elevation);
                let whole = clipped_cap(alpha, 1.0).solid_angle;
                // Close to contact, the first sliver above the horizon grows like a square root.
                let allowed = if alpha < 0.9 { 2e-3 } else { 3e-2 };
                assert!((f64::from(share) - exact.solid_angle / whole).abs() < allowed, "{alpha} {elevation}");
                assert!(
                    (f64::from(tilt) - exact.tilt).abs() < 2.0 * allowed.max(1e-2),
                    "{alpha} {elevation} {tilt} {exact:?}"
                );
            }
        }
    }
}
