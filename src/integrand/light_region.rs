use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};
use smallvec::SmallVec;

use crate::scene::Environment;
use crate::sphere::{BoundaryArc, gauss_legendre};

/// Vector irradiance of textured light over a region given by its boundary.
///
/// In the image's cylindrical chart (longitude phi, s = sine of the latitude; area-preserving) Green's theorem turns the
/// integral of L w into that of -G dphi along the boundary, G(phi, s) being the integral of L w from the lower pole up to s:
/// inside a pixel it is elementary, across pixels a sum. Arcs are cut where they leave a pixel, and each part is integrated
/// by Gauss-Legendre in phi. Nothing is resampled: pixels are clipped exactly.
#[derive(Clone, Debug)]
pub struct LightRegion {
    width: usize,
    height: usize,
    /// Rotation from the scene to the image.
    to_image: DMat3,
    /// Radiance by column, then by row from the lowest.
    radiance: Vec<[f64; 3]>,
    /// For every column and row: per colour the integrals of L cos(theta) and of L s over s from the lower pole to the row's
    /// lower edge, and behind the last row to the upper pole.
    below: Vec<[[f64; 2]; 3]>,
    /// Sines and latitudes of the rows' edges, from the lowest.
    edges: Vec<(f64, f64)>,
    /// Largest radiance, without sign, of any colour.
    brightest: f64,
    rule: Vec<(f64, f64)>,
}

fn longitude(w: DVec3) -> f64 {
    w.x.atan2(w.z)
}

/// Antiderivatives over s of cos(theta) and of s, at latitude theta.
fn antiderivatives(s: f64, theta: f64) -> [f64; 2] {
    [0.5 * (s * theta.cos() + theta), 0.5 * s * s]
}

/// Largest side of a part, radians: coarse images are cut finer than their pixels, so that what is integrated over a part is
/// smooth.
const SMOOTH: f64 = PI / 48.0;

impl LightRegion {
    /// Prepares the sums of an environment.
    pub fn new(environment: &Environment) -> Self {
        let (width, height) = (environment.width(), environment.height());
        let edges: Vec<(f64, f64)> =
            (0..=height).map(|row| PI * (row as f64 / height as f64 - 0.5)).map(|theta| (theta.sin(), theta)).collect();
        let mut radiance = Vec::with_capacity(width * height);
        let mut below = Vec::with_capacity(width * (height + 1));
        for column in 0..width {
            let mut sum = [[0.0; 2]; 3];
            below.push(sum);
            for row in 0..height {
                let light = environment.pixels()[(height - 1 - row) * width + column].as_dvec3().to_array();
                let (low, high) = (edges[row], edges[row + 1]);
                let (low, high) = (antiderivatives(low.0, low.1), antiderivatives(high.0, high.1));
                for colour in 0..3 {
                    for k in 0..2 {
                        sum[colour][k] += light[colour] * (high[k] - low[k]);
                    }
                }
                below.push(sum);
                radiance.push(light);
            }
        }
        let to_image = environment.to_scene().transpose();
        let brightest = radiance.as_flattened().iter().fold(0.0f64, |most, l| most.max(l.abs()));
        Self { width, height, to_image, radiance, below, edges, brightest, rule: gauss_legendre(6) }
    }

    /// Integral of L w per colour over the region on the left of `boundary`, whose solid angle is known; and an estimate of
    /// its error, from the region's solid angle found the same way.
    ///
    /// A corner of the region at a pole of the image has no longitude. Then the region is moved aside by 1e-8 radians, and
    /// the light that this can touch is in the estimate.
    pub fn vectors(&self, boundary: &[BoundaryArc], solid_angle: f64) -> ([DVec3; 3], f64) {
        const ASIDE: f64 = 1e-8;
        // Nearer than this the longitude is rounding. The solid angle need not show it: two lunes of one size between the poles may be
        // taken for each other.
        const NEAREST: f64 = 1e-9;
        let is_at_pole = |w: DVec3| {
            let w = self.to_image * w;
            w.x.hypot(w.z) < NEAREST
        };
        if !boundary.iter().any(|arc| is_at_pole(arc.start) || is_at_pole(arc.end)) {
            let (vectors, error) = self.integrate(boundary, solid_angle, self.to_image);
            if error <= ASIDE * self.brightest {
                return (vectors, error);
            }
        }
        let aside = self.to_image * DMat3::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), ASIDE);
        let (vectors, error) = self.integrate(boundary, solid_angle, aside);
        (vectors, error + ASIDE * self.brightest * boundary.len() as f64)
    }

    fn integrate(&self, boundary: &[BoundaryArc], solid_angle: f64, to_image: DMat3) -> ([DVec3; 3], f64) {
        let mut sum = Sum::default();
        for arc in boundary {
            // An arc within rounding of its length has no length.
            if arc.angle() > 0.0 {
                self.along([arc.start, arc.end, arc.normal].map(|w| to_image * w), &mut sum);
            }
        }
        // The region counted from the lower pole upwards; where it holds the upper pole, that misses everything else.
        let turns = ((solid_angle - sum.solid_angle) / (2.0 * TAU)).round();
        for column in 0..self.width {
            let [left, right] = self.column(column).map(|phi| phi.sin_cos());
            let total = self.below[(column + 1) * (self.height + 1) - 1];
            // The integrals over the column of sin phi, 1 and cos phi; phi falls from left to right.
            let spans = DVec3::new(right.1 - left.1, TAU / self.width as f64, left.0 - right.0);
            for (vector, total) in sum.vectors.iter_mut().zip(total) {
                *vector += turns * DVec3::new(spans.x * total[0], spans.y * total[1], spans.z * total[0]);
            }
        }
        let missed = (sum.solid_angle + turns * 2.0 * TAU - solid_angle).abs();
        (sum.vectors.map(|vector| to_image.transpose() * vector), missed * self.brightest)
    }

    /// Longitudes of a column's left and right edges.
    fn column(&self, column: usize) -> [f64; 2] {
        [column, column + 1].map(|edge| PI * (1.0 - 2.0 * edge as f64 / self.width as f64))
    }

    /// Adds the integral of -G dphi along the arc [start, end, normal], in the image's frame.
    ///
    /// Everything is a function of phi, which turns one way by half a turn at most: on the arc's circle tan(theta) is
    /// -(n_x sin phi + n_z cos phi) / n_y. An arc that passes over a pole turns all at once there, at theta = pi / 2.
    fn along(&self, [start, end, normal]: [DVec3; 3], sum: &mut Sum) {
        let rising = normal.y >= 0.0;
        let ny = if normal.y == 0.0 { f64::MIN_POSITIVE } else { normal.y };
        let (from, to) = (longitude(start), longitude(end));
        let turned = if rising { (to - from).rem_euclid(TAU) } else { (from - to).rem_euclid(TAU) };
        if turned > 1.001 * PI {
            // Backwards by rounding: the arc runs along a meridian.
            return;
        }
        let (low, high) = if rising { (from, from + turned) } else { (from - turned, from) };
        let mut cuts = SmallVec::<[f64; 32]>::from_slice(&[low, high]);
        let step = TAU / (self.width * (TAU / self.width as f64 / SMOOTH).ceil() as usize) as f64;
        let (first, last) = (((low + PI) / step).ceil() as i64, ((high + PI) / step).floor() as i64);
        cuts.extend((first..=last).map(|meridian| step * meridian as f64 - PI));
        // Parallels: sin(phi + psi) = -tan(theta) n_y / hypot(n_x, n_z), for rows that the arc can reach.
        let (level, psi) = (normal.x.hypot(normal.z), normal.z.atan2(normal.x));
        let top = level.atan2(ny.abs());
        let (ends, crests) = ([start.y, end.y].map(|s| s.clamp(-1.0, 1.0).asin()), [top, -top]);
        let passes = |phi: f64| (phi - low).rem_euclid(TAU) < high - low;
        let is_crest = |theta: f64| passes(if (theta > 0.0) == rising { -PI / 2.0 - psi } else { PI / 2.0 - psi });
        let reached = ends.into_iter().chain(crests.into_iter().filter(|&theta| is_crest(theta)));
        let (lowest, highest) =
            reached.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), theta| (low.min(theta), high.max(theta)));
        let rows = self.height * (PI / self.height as f64 / SMOOTH).ceil() as usize;
        let row = |theta: f64| (theta / PI + 0.5) * rows as f64;
        for row in row(lowest).ceil() as usize..=row(highest).floor() as usize {
            let ratio = -(PI * (row as f64 / rows as f64 - 0.5)).tan() * ny / level;
            if ratio.abs() < 1.0 {
                for phi in [ratio.asin() - psi, PI - ratio.asin() - psi] {
                    let phi = low + (phi - low).rem_euclid(TAU);
                    if phi < high {
                        cuts.push(phi);
                    }
                }
            }
        }
        cuts.sort_unstable_by(f64::total_cmp);
        for part in cuts.windows(2) {
            let sign = if rising { -1.0 } else { 1.0 };
            self.part(part[0], part[1], sign, DVec3::new(normal.x, ny, normal.z), sum);
        }
    }

    /// The part of an arc between two longitudes, inside the pixel of its middle.
    fn part(&self, a: f64, b: f64, sign: f64, normal: DVec3, sum: &mut Sum) {
        let tan = |(sin, cos): (f64, f64)| -(normal.x * sin + normal.z * cos) / normal.y;
        let phi = 0.5 * (a + b);
        let turn = (0.5 - 0.5 * phi / PI).rem_euclid(1.0);
        let column = ((turn * self.width as f64) as usize).min(self.width - 1);
        let theta = tan(phi.sin_cos()).atan();
        let row = (((theta / PI + 0.5) * self.height as f64) as usize).min(self.height - 1);
        let light = self.radiance[column * self.height + row];
        let below = self.below[column * (self.height + 1) + row];
        let (edge_s, edge_theta) = self.edges[row];
        let edge = antiderivatives(edge_s, edge_theta);
        for &(x, weight) in &self.rule {
            let (sin, cos) = (phi + 0.5 * (b - a) * x).sin_cos();
            let theta = tan((sin, cos)).atan();
            let s = theta.sin();
            let here = antiderivatives(s, theta);
            let weight = sign * 0.5 * weight * (b - a);
            sum.solid_angle += weight * (s + 1.0);
            for colour in 0..3 {
                let across = below[colour][0] + light[colour] * (here[0] - edge[0]);
                let upwards = below[colour][1] + light[colour] * (here[1] - edge[1]);
                sum.vectors[colour] += weight * DVec3::new(sin * across, upwards, cos * across);
            }
        }
    }
}

#[derive(Default)]
struct Sum {
    vectors: [DVec3; 3],
    solid_angle: f64,
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::UpAxis;

    fn environment(width: usize, height: usize) -> Environment {
        let pixels: Vec<Vec3> =
            (0..width * height).map(|i| Vec3::new(1.0, (i * 7 % 11) as f32, (i * i % 13) as f32)).collect();
        Environment::new(width, height, pixels).unwrap().oriented(UpAxis::Z, 25.0).unwrap()
    }

    fn polygon(corners: &[DVec3]) -> Vec<BoundaryArc> {
        (0..corners.len())
            .map(|i| {
                let (start, end) = (corners[i].normalize(), corners[(i + 1) % corners.len()].normalize());
                BoundaryArc { start, end, normal: start.cross(end).normalize() }
            })
            .collect()
    }

    /// The region between two meridians, from pole to pole, twice: each as large as the other, and not to be taken for it.
    #[test]
    fn lunes_of_one_size_are_not_mistaken_for_each_other() {
        let turned = environment(48, 24);
        let upright = Environment::new(48, 24, turned.pixels().to_vec()).unwrap();
        [turned, upright].iter().for_each(lunes_add_up);
    }

    fn lunes_add_up(sky: &Environment) {
        let light = LightRegion::new(sky);
        let to_scene = light.to_image.transpose();
        let on_equator = |column: usize| {
            let (sin, cos) = (PI * (1.0 - 2.0 * column as f64 / 48.0)).sin_cos();
            DVec3::new(sin, 0.0, cos)
        };
        let lune = |first: usize, last: usize| {
            // Longitudes fall from column to column.
            let [west, east] = [last, first].map(on_equator);
            let corners = [DVec3::NEG_Y, east, DVec3::Y, west];
            let arc = |i: usize| {
                let (start, end): (DVec3, DVec3) = (to_scene * corners[i], to_scene * corners[(i + 1) % 4]);
                BoundaryArc { start, end, normal: start.cross(end).normalize() }
            };
            (0..4).map(arc).collect::<Vec<_>>()
        };
        let totals = |columns: std::ops::Range<usize>| {
            let pixels = sky.patches(1).enumerate().filter(|(i, _)| columns.contains(&(i % 48)));
            pixels.fold([DVec3::ZERO; 3], |mut sum, (_, (moment, radiance))| {
                (0..3).for_each(|colour| sum[colour] += f64::from(radiance[colour]) * moment);
                sum
            })
        };
        for (a, b) in [(3, 20), (0, 12), (6, 30), (12, 40)] {
            let boundary = [lune(a, a + 6), lune(b, b + 6)].concat();
            let (found, error) = light.vectors(&boundary, 2.0 * 4.0 * PI / 8.0);
            let [one, other] = [totals(a..a + 6), totals(b..b + 6)];
            for colour in 0..3 {
                let expected = one[colour] + other[colour];
                assert!(found[colour].distance(expected) < 1e-6, "{a} {b}: {} {expected}", found[colour]);
            }
            assert!(error < 1e-5, "{error:e}");
        }
    }

    /// Solid angle of a spherical triangle.
    fn area(arcs: &[BoundaryArc], apex: DVec3) -> f64 {
        arcs.iter().map(|arc| arc.solid_angle_from(apex)).sum()
    }

    /// The four lunes-halves of an octahedral frame, turned by `q`, tile the sphere; so do they with poles inside, on edges and
    /// on corners.
    #[test]
    fn octants_add_up_to_the_whole_environment() {
        for (width, height) in [(1, 1), (5, 4), (64, 32)] {
            let environment = environment(width, height);
            let whole: DVec3 = environment.patches(1).map(|(w, l)| w * f64::from(l.y)).sum();
            let light = LightRegion::new(&environment);
            for turn in [0.0, 0.3, 1.1] {
                let frame = DMat3::from_rotation_x(turn) * DMat3::from_rotation_z(0.7 * turn);
                let mut sum = DVec3::ZERO;
                for signs in 0..8 {
                    let sign = |bit: i32| if signs >> bit & 1 == 0 { 1.0 } else { -1.0 };
                    let axes = [frame.x_axis * sign(0), frame.y_axis * sign(1), frame.z_axis * sign(2)];
                    let corners = if sign(0) * sign(1) * sign(2) > 0.0 { axes } else { [axes[1], axes[0], axes[2]] };
                    let (vectors, error) = light.vectors(&polygon(&corners), PI / 2.0);
                    // With a corner at a pole the region is moved aside.
                    let allowed = if turn == 0.0 { 1e-5 } else { 1e-10 };
                    assert!(error < allowed, "{error}");
                    sum += vectors[1];
                }
                let allowed = if turn == 0.0 { 1e-6 } else { 1e-11 * (1.0 + whole.length()) };
                assert!(sum.distance(whole) < allowed, "{width} {turn} {sum} {whole}");
            }
        }
    }

    /// Horizons of walls pass over both poles.
    #[test]
    fn hemispheres_of_walls_add_up_and_are_exact() {
        let environment = environment(8, 5);
        let light = LightRegion::new(&environment);
        let whole: DVec3 = environment.patches(1).map(|(w, l)| w * f64::from(l.y)).sum();
        let up = environment.to_scene() * DVec3::Y;
        for side in 0..10 {
            let normal = up.any_orthonormal_vector() * (side as f64 * 0.7).cos()
                + up.cross(up.any_orthonormal_vector()) * (side as f64 * 0.7).sin();
            let halves = [normal, -normal].map(|n| {
                let (a, b) = n.any_orthonormal_pair();
                let (a, b) = (a * 0.96 + b * 0.28, b * 0.96 - a * 0.28);
                let arcs =
                    [(a, b), (b, -a), (-a, -b), (-b, a)].map(|(start, end)| BoundaryArc { start, end, normal: n });
                light.vectors(&arcs, TAU)
            });
            assert!(halves.iter().all(|half| half.1 < 1e-10), "{side} {} {}", halves[0].1, halves[1].1);
            assert!((halves[0].0[1] + halves[1].0[1]).distance(whole) < 1e-10);
        }
    }

    #[test]
    fn a_triangle_agrees_with_the_pixels_it_covers() {
        let environment = environment(24, 12);
        let light = LightRegion::new(&environment);
        let corners = [DVec3::new(0.9, 0.1, 0.3), DVec3::new(-0.2, 0.8, 0.4), DVec3::new(0.1, -0.3, 1.0)];
        let arcs = polygon(&corners);
        let (vectors, _) = light.vectors(&arcs, area(&arcs, corners[0].normalize()));
        let inside = |w: DVec3| arcs.iter().all(|arc| arc.normal.dot(w) > 0.0);
        let expected: DVec3 =
            environment.patches(128).filter(|(w, _)| inside(*w)).map(|(w, l)| w * f64::from(l.z)).sum();
        // Patches on the edge count whole or not at all: 1e4 of them, of 2e-6 steradians times 12 each, at random.
        assert!(vectors[2].distance(expected) < 3e-3, "{} {expected}", vectors[2]);
        assert!(expected.length() > 1.0);
    }
}
