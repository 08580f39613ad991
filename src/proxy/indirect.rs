//! Light that spheres reflect towards a receiver: point-sampled, averaged, exact (Sloan et al. 2007, section 5).

use std::f64::consts::PI;
use std::fmt;

use glam::DVec3;

use super::lanes::Lanes;
use super::light::ReflectedLight;
use crate::sphere::{Order, clamped_cosine, evaluate, gauss_legendre, index};

/// How the light that a proxy reflects is found. All leave out shadows upon the proxy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum IndirectOperator {
    /// The radiance of the point nearest to the receiver, all over the proxy's disc (equation 13).
    PointSampled,
    /// The mean radiance of the disc (equation 15).
    #[default]
    Averaged,
    /// The radiance of every point of the disc (equation 17).
    Exact,
}

impl fmt::Display for IndirectOperator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::PointSampled => "point-sampled",
            Self::Averaged => "averaged",
            Self::Exact => "exact",
        })
    }
}

const BANDS: usize = 3;

fn order() -> Order {
    Order::new(BANDS).expect("three bands are an order")
}

/// D(theta), equation 14: the zonal coefficients of the operator that averages a function of the surface normal over the
/// disc of a sphere of sine `alpha` in (0, 1] about the z axis; bands 0 to 2.
pub fn averaged_operator(alpha: f64) -> [f64; BANDS] {
    let matrix = exact_operator(alpha);
    let solid_angle = 2.0 * PI * alpha * alpha / (1.0 + (1.0 - alpha * alpha).sqrt());
    // The mean is the part of band 0 of the image, times its harmonic: integral of v y_l = sqrt(4 pi) M_0l.
    std::array::from_fn(|l| (4.0 * PI).sqrt() * matrix.zonal[0][l] / solid_angle)
}

/// M(theta), equation 16, in three bands. It couples harmonics of equal m only, and alike those of m and -m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExactOperator {
    /// m = 0: row l of the incident radiance, column l of the normal's function.
    pub zonal: [[f64; 3]; 3],
    /// |m| = 1, l = 1 and 2.
    pub first: [[f64; 2]; 2],
    /// |m| = 2, l = 2.
    pub second: f64,
}

/// The operator for a sphere of sine `alpha` in (0, 1] in the direction z.
///
/// Integrated over rays with v = sqrt(s_z^2 - cos^2 theta) in [0, alpha], which takes the square root at the limb away: the
/// ray of height z = sqrt(cos^2 theta + v^2) hits at the distance z - v, dz = v / z dv, and the integral over the longitude
/// is 2 pi for m = 0, else pi.
pub fn exact_operator(alpha: f64) -> ExactOperator {
    let mut matrix = ExactOperator::default();
    let (mut seen, mut normal) = ([0.0; 9], [0.0; 9]);
    let squared = 1.0 - alpha * alpha;
    for (x, weight) in gauss_legendre(64) {
        let v = 0.5 * alpha * (x + 1.0);
        let z = (squared + v * v).sqrt();
        let ray = DVec3::new((1.0 - z * z).max(0.0).sqrt(), 0.0, z);
        let solid_angle = 0.5 * alpha * weight * v / z;
        evaluate(order(), ray, &mut seen);
        evaluate(order(), (ray * (z - v) - DVec3::Z) / alpha, &mut normal);
        let product = |m: isize, i: usize, j: usize| {
            (if m == 0 { 2.0 * PI } else { PI }) * solid_angle * seen[index(i, m)] * normal[index(j, m)]
        };
        for i in 0..3 {
            for j in 0..3 {
                matrix.zonal[i][j] += product(0, i, j);
            }
        }
        for i in 0..2 {
            for j in 0..2 {
                matrix.first[i][j] += product(1, i + 1, j + 1);
            }
        }
        matrix.second += product(2, 2, 2);
    }
    matrix
}

/// An operator over spheres of every size, ready for the splat pass: rows over x = sqrt(1 - cos theta) in [0, 1], in which
/// everything is smooth.
#[derive(Clone, Debug)]
pub struct IndirectTable {
    operator: IndirectOperator,
    /// Over the solid angle. Point-sampled and averaged: factors of the constant, linear and quadratic part of
    /// [`ReflectedLight`] along the direction, which give the mean radiance. Exact: see [`exact_row`].
    rows: Vec<[f32; 16]>,
}

impl IndirectTable {
    /// Intervals of the table.
    pub const INTERVALS: usize = 128;

    /// The table of `operator`.
    pub fn new(operator: IndirectOperator) -> Self {
        let rows = (0..=Self::INTERVALS).map(|k| {
            // Tiny spheres stand in for the row of size 0, which exists only as a limit.
            let u = (k as f64 / Self::INTERVALS as f64).max(1e-3).powi(2);
            let alpha = (u * (2.0 - u)).sqrt();
            match operator {
                IndirectOperator::PointSampled => padded([1.0, -1.0, 1.0]),
                IndirectOperator::Averaged => {
                    let d = averaged_operator(alpha);
                    padded(std::array::from_fn::<_, 3, _>(|l| (4.0 * PI / (2 * l + 1) as f64).sqrt() * d[l]))
                }
                IndirectOperator::Exact => exact_row(alpha),
            }
        });
        Self { operator, rows: rows.collect() }
    }

    /// Which operator this is.
    pub fn operator(&self) -> IndirectOperator {
        self.operator
    }

    /// The rows, x from 0 to 1 in [`Self::INTERVALS`] steps.
    pub fn rows(&self) -> &[[f32; 16]] {
        &self.rows
    }

    /// Interpolated rows for eight spheres.
    #[inline(always)]
    fn at<const N: usize>(&self, u: Lanes) -> [Lanes; N] {
        let mut out = [Lanes::ZERO; N];
        let x = u.sqrt() * Self::INTERVALS as f32;
        for lane in 0..super::LANES {
            let x = x.0[lane];
            let k = (x as usize).min(Self::INTERVALS - 1);
            let t = x - k as f32;
            let (a, b) = (&self.rows[k], &self.rows[k + 1]);
            for (i, out) in out.iter_mut().enumerate() {
                out.0[lane] = a[i] + t * (b[i] - a[i]);
            }
        }
        out
    }
}

fn padded(values: [f64; 3]) -> [f32; 16] {
    std::array::from_fn(|i| values.get(i).map_or(0.0, |x| *x as f32))
}

/// M over the solid angle, row by row (nine of m = 0, four of |m| = 1, one of |m| = 2), times the factors that turn the parts
/// of [`ReflectedLight`] into coefficients about the direction, and those of the clamped cosine:
///
/// ```text
/// m = 0: constant sqrt(4 pi), linear . z sqrt(4 pi / 3), z . Q z sqrt(4 pi / 5)
/// m = 1: linear . x sqrt(4 pi / 3), 2 x . Q z sqrt(4 pi / 15)          m = 2: (2 x . Q x + z . Q z) sqrt(4 pi / 15)
/// ```
fn exact_row(alpha: f64) -> [f32; 16] {
    let m = exact_operator(alpha);
    let solid_angle = 2.0 * PI * alpha * alpha / (1.0 + (1.0 - alpha * alpha).sqrt());
    let zonal = clamped_cosine(order(), DVec3::Z);
    // Turned to a normal, the cosine's coefficients are sqrt(4 pi / (2l + 1)) times the zonal ones times y.
    let cosine = |l: usize| (4.0 * PI / (2 * l + 1) as f64).sqrt() * zonal[index(l, 0)];
    let band = |l: usize| (4.0 * PI / (2 * l + 1) as f64).sqrt();
    let fifteenth = (4.0 * PI / 15.0).sqrt();
    let mut row = [0.0; 16];
    for i in 0..3 {
        for j in 0..3 {
            row[3 * i + j] = cosine(i) * m.zonal[i][j] * band(j);
        }
    }
    for i in 0..2 {
        row[9 + 2 * i] = cosine(i + 1) * m.first[i][0] * band(1);
        row[10 + 2 * i] = cosine(i + 1) * m.first[i][1] * fifteenth;
    }
    row[13] = cosine(2) * m.second * fifteenth;
    row.map(|x| (x / solid_angle) as f32)
}

/// Irradiance, per colour, that eight receivers get from a white proxy in the directions `axis`, over the proxy's solid angle.
#[inline(always)]
pub(super) fn irradiance_per_solid_angle(
    table: &IndirectTable,
    light: &ReflectedLight,
    axis: [Lanes; 3],
    u: Lanes,
    normal: [Lanes; 3],
) -> [Lanes; 3] {
    let c = dot(axis, normal);
    let mut out = [Lanes::ZERO; 3];
    if table.operator != IndirectOperator::Exact {
        let [w0, w1, w2] = table.at::<3>(u);
        let cosine = cap_cosine(u, c);
        for (colour, out) in out.iter_mut().enumerate() {
            let linear = vector(light.linear[colour], axis);
            let quadratic = dot(apply(light.quadratic[colour], axis), axis);
            *out = (w0 * light.constant[colour] + w1 * linear + w2 * quadratic) * cosine;
        }
        return out;
    }
    let m = table.at::<14>(u);
    // The frame (x, y, z = axis) with the normal (s, 0, c).
    let s = (Lanes::splat(1.0) - c * c).max(Lanes::splat(1e-12)).sqrt();
    let inverse = Lanes::splat(1.0) / s;
    let across = |k: usize| (normal[k] - axis[k] * c) * inverse;
    let x = [across(0), across(1), across(2)];
    // y_lm of the normal for m >= 0.
    let y = [
        Lanes::splat(0.282_094_8),
        c * 0.488_602_5,
        c * c * 0.946_174_7 - Lanes::splat(0.315_391_57),
        s * 0.488_602_5,
        s * c * 1.092_548_4,
        s * s * 0.546_274_2,
    ];
    for (colour, out) in out.iter_mut().enumerate() {
        let (constant, linear) = (light.constant[colour], vector(light.linear[colour], axis));
        let image = apply(light.quadratic[colour], axis);
        let quadratic = dot(image, axis);
        let across = vector(light.linear[colour], x);
        let mixed = dot(image, x) * 2.0;
        let twice = dot(apply(light.quadratic[colour], x), x) * 2.0 + quadratic;
        for i in 0..3 {
            *out += y[i] * (m[3 * i] * constant + m[3 * i + 1] * linear + m[3 * i + 2] * quadratic);
        }
        *out += y[3] * (m[9] * across + m[10] * mixed);
        *out += y[4] * (m[11] * across + m[12] * mixed);
        *out += y[5] * (m[13] * twice);
    }
    out
}

/// V . H over the solid angle: irradiance from a cap of radiance 1, in three bands, sum of V_l h_l P_l(c).
#[inline(always)]
fn cap_cosine(u: Lanes, c: Lanes) -> Lanes {
    // V_l over 2 pi u: with k = 1 - u = cos theta and alpha^2 = u (2 - u),
    // V_0 = sqrt(pi) u, V_1 = sqrt(pi/3) 3/2 alpha^2, V_2 = sqrt(pi/5) 5/2 k alpha^2; h = sqrt(pi)/2, sqrt(pi/3), sqrt(5 pi)/8.
    let two = Lanes::splat(2.0) - u;
    let k = Lanes::splat(1.0) - u;
    Lanes::splat(0.25) + two * c * 0.25 + k * two * (c * c * 1.5 - Lanes::splat(0.5)) * 0.156_25
}

#[inline(always)]
fn dot(a: [Lanes; 3], b: [Lanes; 3]) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn vector(a: [f32; 3], b: [Lanes; 3]) -> Lanes {
    b[0] * a[0] + b[1] * a[1] + b[2] * a[2]
}

/// The symmetric matrix (xx, yy, zz, xy, yz, zx) times a vector.
#[inline(always)]
fn apply([xx, yy, zz, xy, yz, zx]: [f32; 6], [x, y, z]: [Lanes; 3]) -> [Lanes; 3] {
    [x * xx + y * xy + z * zx, x * xy + y * yy + z * yz, x * zx + y * yz + z * zz]
}

#[cfg(test)]
mod tests {
    use super::super::light::DistantLight;
    use super::*;
    use crate::sphere::product_rule;

    /// The normal of a sphere of sine `alpha` about z where the ray along s first meets it.
    fn hit(alpha: f64, s: DVec3) -> Option<DVec3> {
        let discriminant = s.z * s.z - (1.0 - alpha * alpha);
        (s.z > 0.0 && discriminant > 0.0).then(|| (s * (s.z - discriminant.sqrt()) - DVec3::Z) / alpha)
    }

    #[test]
    fn operators_equal_quadrature_over_rays() {
        for alpha in [0.2, 0.5, 0.8, 0.95] {
            let exact = exact_operator(alpha);
            let mean = averaged_operator(alpha);
            let k = f64::sqrt(1.0 - alpha * alpha);
            let (mut matrix, mut average) = ([[0.0; 9]; 9], [0.0; 9]);
            let (mut seen, mut normal) = ([0.0; 9], [0.0; 9]);
            for (x, weight) in gauss_legendre(400) {
                let z = k + (1.0 - k) * 0.5 * (x + 1.0);
                for step in 0..12 {
                    let (sin, cos) = (2.0 * PI * f64::from(step) / 12.0).sin_cos();
                    let r = (1.0 - z * z).sqrt();
                    let s = DVec3::new(r * cos, r * sin, z);
                    let weight = 0.5 * (1.0 - k) * weight * 2.0 * PI / 12.0;
                    evaluate(order(), s, &mut seen);
                    evaluate(order(), hit(alpha, s).unwrap(), &mut normal);
                    for i in 0..9 {
                        average[i] += weight * normal[i] / (2.0 * PI * (1.0 - k));
                        for j in 0..9 {
                            matrix[i][j] += weight * seen[i] * normal[j];
                        }
                    }
                }
            }
            // The square root at the limb limits this rule to about 1 / 400^2.
            let close = |a: f64, b: f64| assert!((a - b).abs() < 5e-6, "alpha {alpha}: {a} {b}");
            for (i, row) in matrix.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    let (li, lj) = (i.isqrt(), j.isqrt());
                    let (mi, mj) = (i as isize - (li * li + li) as isize, j as isize - (lj * lj + lj) as isize);
                    let expected = match mi.abs() {
                        _ if mi != mj => 0.0,
                        0 => exact.zonal[li][lj],
                        1 => exact.first[li - 1][lj - 1],
                        _ => exact.second,
                    };
                    close(*value, expected);
                }
            }
            for l in 0..3 {
                close(average[index(l, 0)], mean[l]);
            }
        }
    }

    #[test]
    fn averages_are_the_printed_ones() {
        for alpha in [0.1f64, 0.3, 0.6, 0.9, 0.99] {
            let d = 1.0 / alpha;
            let e = (d * d - 1.0).sqrt();
            let mean = averaged_operator(alpha);
            let first =
                -(3f64.sqrt()) * (2.0 * d.powi(3) - 2.0 * e * d * d - e + 1.0) / (6.0 * PI.sqrt() * d * (d - e));
            let second = 5f64.sqrt() * (6.0 * d.powi(5) - 6.0 * e * d.powi(4) - 3.0 * e * d * d - e + 4.0)
                / (20.0 * PI.sqrt() * d * d * (d - e));
            for (a, b) in mean.iter().zip([0.5 / PI.sqrt(), first, second]) {
                assert!((a - b).abs() < 1e-9, "{alpha}: {a} {b}");
            }
        }
    }

    #[test]
    fn irradiance_equals_rays() {
        let four = Order::new(4).unwrap();
        let mixed = |i: usize, k: usize| ((5 * i + 3 * k) % 7) as f64 / 7.0 - 0.2;
        // x^2 - y^2 about z: what the mixed light has little of.
        let second = |i: usize, _: usize| if i == 8 { 1.0 } else { 0.0 };
        let lights: [&dyn Fn(usize, usize) -> f64; 2] = [&mixed, &second];
        let [mixed, second] = lights.map(|light| {
            DistantLight::from_coefficients(four, [0, 1, 2].map(|k| (0..16).map(|i| light(i, k)).collect()))
        });
        let rule: Vec<(DVec3, f64)> = product_rule(300, 600).collect();
        let skew = DVec3::new(2.0, -1.0, 2.0) / 3.0;
        // Cells of the rule along the rim count or not: a few 1e-3 of the greatest radiance, here 1 and 0.14.
        for (light, axis, alpha, n, allowed) in [
            (&mixed, skew, 0.4, DVec3::new(1.0, 1.0, 0.3), 2e-3),
            (&mixed, skew, 0.7, DVec3::new(0.1, -0.8, 1.0), 2e-3),
            (&mixed, skew, 0.9, skew, 2e-3),
            (&second, DVec3::Z, 0.7, DVec3::new(0.9, 0.0, 0.44), 3e-4),
        ] {
            let reflected = light.reflected();
            let frame =
                glam::DMat3::from_cols(axis.any_orthonormal_vector(), axis.cross(axis.any_orthonormal_vector()), axis);
            let n = n.normalize();
            let cosine = clamped_cosine(order(), n);
            let mut y = [0.0; 9];
            // Order 3 of the cosine, radiance of every point; and the mean of the latter.
            let (mut exact, mut mean, mut cap, mut solid_angle) = ([0.0; 3], [0.0; 3], 0.0, 0.0);
            for (s, weight) in &rule {
                let Some(normal) = hit(alpha, frame.transpose() * *s) else { continue };
                evaluate(order(), *s, &mut y);
                let cosine: f64 = cosine.iter().zip(&y).map(|(c, y)| c * y).sum();
                let radiance = light.irradiance(frame * normal).map(|e| e / PI);
                for colour in 0..3 {
                    exact[colour] += weight * cosine * radiance[colour];
                    mean[colour] += weight * radiance[colour];
                }
                cap += weight * cosine;
                solid_angle += weight;
            }
            let [axis, normal] = [axis, n].map(|v| v.to_array().map(|x| Lanes::splat(x as f32)));
            let u = Lanes::splat((1.0 - f64::sqrt(1.0 - alpha * alpha)) as f32);
            let value = |operator| {
                irradiance_per_solid_angle(&IndirectTable::new(operator), &reflected, axis, u, normal)
                    .map(|x| f64::from(x.0[4]))
            };
            let (by_exact, by_mean) = (value(IndirectOperator::Exact), value(IndirectOperator::Averaged));
            let by_point = value(IndirectOperator::PointSampled);
            let nearest = light.irradiance(-DVec3::from(axis.map(|x| f64::from(x.0[0])))).map(|e| e / PI);
            for colour in 0..3 {
                assert!((by_exact[colour] - exact[colour] / solid_angle).abs() < allowed, "exact {alpha} {colour}");
                let averaged = mean[colour] / solid_angle * cap / solid_angle;
                assert!((by_mean[colour] - averaged).abs() < allowed, "averaged {alpha} {colour}");
                assert!(
                    (by_point[colour] - nearest[colour] * cap / solid_angle).abs() < allowed,
                    "point {alpha} {colour}"
                );
            }
        }
    }
}
