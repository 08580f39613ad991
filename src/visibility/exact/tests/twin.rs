//! The same integrals by another way: unions of intervals along half circles of azimuth about another pole, taken from the
//! triangles themselves (no contours, no W), summed by Gauss-Legendre rules between all azimuths where anything can change.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DMat3, DVec3};

use super::scenes::{Random, Triangle};
use super::{Answer, exact, order};
use crate::sphere::{evaluate, gauss_legendre};

/// The visible intervals of latitude at one azimuth.
fn visible(cells: &[Vec<DVec3>], horizon: Option<DVec3>, meridian: DVec3) -> Vec<(f64, f64)> {
    // w = meridian cos t + z sin t lies above the plane n where n.meridian + n.z tan t > 0.
    let range = |planes: &[DVec3]| {
        let (mut low, mut high) = (-FRAC_PI_2, FRAC_PI_2);
        for n in planes {
            let (a, b) = (n.dot(meridian), n.z);
            if b > 0.0 {
                low = f64::max(low, (-a).atan2(b));
            } else if b < 0.0 {
                high = f64::min(high, a.atan2(-b));
            } else if a < 0.0 {
                high = -FRAC_PI_2;
            }
        }
        (low, high)
    };
    let mut hidden: Vec<_> = cells.iter().map(|planes| range(planes)).filter(|(low, high)| low < high).collect();
    hidden.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut from, to) = horizon.map_or((-FRAC_PI_2, FRAC_PI_2), |n| range(&[n]));
    let mut intervals = Vec::new();
    for (low, high) in hidden {
        if low > from {
            intervals.push((from, low.min(to)));
        }
        from = from.max(high);
    }
    intervals.push((from, to));
    intervals.retain(|(low, high)| low < high);
    intervals
}

/// The answer by quadrature; its error is some 1e-13 for a few tens of triangles.
pub fn quadrature(triangles: &[Triangle], receiver: DVec3, normal: Option<DVec3>) -> Answer {
    // Another pole, inside the hemisphere.
    let pole = (normal.unwrap_or(DVec3::X) + DVec3::new(0.31, -0.17, 0.23)).normalize();
    let x = pole.any_orthonormal_vector();
    let frame = DMat3::from_cols(x, pole.cross(x), pole);
    let local = |v: DVec3| frame.transpose() * v;
    let corners: Vec<Triangle> = triangles.iter().map(|t| t.map(|corner| local(corner - receiver))).collect();
    let horizon = normal.map(local);
    let cells: Vec<Vec<DVec3>> = corners
        .iter()
        .filter_map(|&[a, b, c]| {
            let volume = a.dot((b - a).cross(c - a));
            let scale = a.length() * (b - a).length() * (c - a).length();
            let planes = vec![a.cross(b - a), b.cross(c - b), c.cross(a - c)];
            (volume.abs() > 1e-14 * scale).then(|| planes.into_iter().map(|n| n * volume.signum()).collect())
        })
        .collect();

    let lines: Vec<DVec3> = cells.iter().flatten().copied().chain(horizon).collect();
    let mut breaks: Vec<f64> = vec![0.0, TAU];
    let mut add = |v: DVec3| breaks.push(v.y.atan2(v.x).rem_euclid(TAU));
    for (i, m) in lines.iter().enumerate() {
        // tan(latitude) = A cos(azimuth) varies within 1/A of its zeros: parts grow geometrically away from them.
        let steepness = (m.z / m.truncate().length()).abs();
        let along = DVec3::new(m.x, m.y, 0.0).normalize_or_zero();
        let across = DVec3::new(-along.y, along.x, 0.0);
        for sign in [-1.0, 1.0] {
            add(sign * across);
            let mut offset = steepness.max(1e-9);
            while offset < 1.0 {
                add(sign * across + offset * along);
                add(sign * across - offset * along);
                offset *= 2.0;
            }
        }
        for n in &lines[..i] {
            let crossing = m.cross(*n);
            if crossing.length() > 1e-12 * m.length() * n.length() {
                add(crossing);
                add(-crossing);
            }
        }
    }
    corners.iter().flatten().for_each(|&v| add(v));
    breaks.sort_by(f64::total_cmp);

    let order = order();
    let mut result = Answer { harmonics: vec![0.0; order.len()], ..Answer::default() };
    let mut y = vec![0.0; order.len()];
    // Degree 9 and a cosine over an interval of half a turn need 32 nodes, short ones fewer.
    let rule = gauss_legendre(12);
    let inner: Vec<_> = (0..=22).map(|n| gauss_legendre(10 + n)).collect();
    let widest = 0.15;
    for pair in breaks.windows(2) {
        let parts = ((pair[1] - pair[0]) / widest).ceil() as usize;
        for part in 0..parts {
            let width = (pair[1] - pair[0]) / parts as f64;
            let middle = pair[0] + (part as f64 + 0.5) * width;
            for &(node, weight) in &rule {
                let (s, c) = (middle + 0.5 * width * node).sin_cos();
                let meridian = DVec3::new(c, s, 0.0);
                for (low, high) in visible(&cells, horizon, meridian) {
                    for &(t, inner_weight) in &inner[(7.0 * (high - low)) as usize] {
                        let (s, c) = (0.5 * ((high + low) + (high - low) * t)).sin_cos();
                        let w = frame * (c * meridian + s * DVec3::Z);
                        let weight = weight * 0.5 * width * inner_weight * 0.5 * (high - low) * c;
                        evaluate(order, w, &mut y);
                        result.harmonics.iter_mut().zip(&y).for_each(|(sum, y)| *sum += weight * y);
                        result.solid_angle += weight;
                        result.vector_area += weight * w;
                    }
                }
            }
        }
    }
    result
}

/// Fails unless the exact answer agrees with the quadrature.
pub fn agree(triangles: &[Triangle], receiver: DVec3, normal: Option<DVec3>, tolerance: f64) {
    let (a, b) = (exact(triangles, receiver, normal), quadrature(triangles, receiver, normal));
    let distance = a.distance(&b);
    assert!(
        distance < tolerance,
        "{distance:e}: {} against {}, {:?}\n{triangles:?}\n{receiver} {normal:?}",
        a.solid_angle,
        b.solid_angle,
        a.residuals
    );
}

#[test]
fn random_triangles_within_a_hemisphere() {
    let mut random = Random(1);
    for count in [1, 1, 2, 2, 3, 3, 4, 5, 6, 8] {
        let triangles = random.soup(count, 1.5);
        agree(&triangles, 0.1 * random.vector(), Some(random.direction()), 1e-12);
    }
}

#[test]
fn random_triangles_on_the_full_sphere() {
    let mut random = Random(2);
    for count in [1, 2, 3, 4, 6] {
        let triangles = random.soup(count, 2.0);
        agree(&triangles, 0.1 * random.vector(), None, 1e-12);
    }
}
