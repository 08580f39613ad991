//! The isolines of an equal-area chart, for what needs no table of light.

mod pieces;

use std::f64::consts::TAU;
use std::ops::Range;

use dual_bvh::face_sign;
use glam::{DMat3, DVec3, Vec3};

use super::beams::Rays;
use super::chart::{Chart, Outlook, Sector, meets_ahead};
use super::contours::{arc_plane, sides};
use super::crossings::{Arcs, Pieces};
use crate::sphere::rough_angle;
use crate::{Error, Result};
use pieces::{Circles, Piece, Way};

/// Isolines of longitude: half great circles from one pole to the opposite one.
///
/// With the axes of a [`MeridianFrame`], a direction is `(c cos u, c sin u, v)`, c^2 = 1 - v^2, with the longitude u and the sine
/// v of the latitude: Lambert's equal-area cylinder (1772), in which the solid angle is du dv. Isoline `i` has the longitude
/// `u_i = (i + 1/2) 2 pi / N`. All start in one direction, the pole -z, well above the horizon, and end where they meet it; a
/// great circle with normal `q` crosses them where the tangent of the latitude is `-(q_x cos u + q_y sin u) / q_z`.
#[derive(Clone, Debug)]
pub struct Meridians {
    cos: Vec<f64>,
    sin: Vec<f64>,
}

impl Meridians {
    /// The largest number of isolines.
    pub const MAX: usize = 1 << 21;

    /// Tangent of the latitude that stands for a pole; its negative for the other. Cosines of 1e-9 have squares that are lost beside 1.
    pub const POLE: f64 = (1u64 << 30) as f64;

    /// `count` isolines around the sphere, even.
    ///
    /// # Errors
    /// A count that is odd, below 4 or above [`Meridians::MAX`].
    pub fn new(count: usize) -> Result<Self> {
        if !(4..=Self::MAX).contains(&count) || !count.is_multiple_of(2) {
            return Err(Error::input(format!(
                "the number of meridians must be even and between 4 and {}, but it is {count}",
                Self::MAX
            )));
        }
        let (sin, cos) = (0..count).map(|line| Self::longitude(count, line).sin_cos()).unzip();
        Ok(Self { cos, sin })
    }

    fn longitude(count: usize, line: usize) -> f64 {
        (line as f64 + 0.5) * TAU / count as f64
    }

    /// Number of isolines N.
    pub fn len(&self) -> usize {
        self.cos.len()
    }

    /// Never: there are at least four isolines.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Longitude of isoline `line`.
    pub fn u(&self, line: usize) -> f64 {
        Self::longitude(self.len(), line)
    }
}

/// Axes of the chart for a receiver: one of eight, by the octant of its normal.
///
/// The isolines start near the octant's diagonal. That is never further from the normal than 55 degrees, so that they cross the
/// horizon steeply; and it is far from the planes of the axes, in which edges of many scenes are seen: an edge that lies in
/// a plane through the pole is seen along the isolines, and all of it moves from one side of a line to the other at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeridianFrame {
    octant: u8,
    axes: DMat3,
}

impl MeridianFrame {
    /// Number of frames.
    pub const COUNT: usize = 8;

    /// Where the isolines of the first octant start: off the diagonal, where the diagonals of cubes and squares are.
    const START: DVec3 = DVec3::new(0.523, 0.615, 0.590);

    /// The best frame for a receiver with this normal (a probe takes any), or the second best for another look.
    pub fn facing(normal: Option<DVec3>, second: bool) -> Self {
        let normal = normal.unwrap_or(DVec3::ONE);
        let mut octant = (0..3).fold(0, |octant, axis| octant | usize::from(normal[axis] < 0.0) << axis);
        if second {
            // Beyond the nearest of its octant's sides.
            let size = normal.abs();
            let nearest = (0..3).min_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or_default();
            octant ^= 1 << nearest;
        }
        Self::of_octant(octant)
    }

    /// The frame of an octant, 0 to 7; bits: negative along x, y, z.
    pub fn of_octant(octant: usize) -> Self {
        let sign = |axis: usize| if octant >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let start = (DVec3::new(sign(0), sign(1), sign(2)) * Self::START).normalize();
        let x = start.cross(DVec3::Y).normalize();
        Self { octant: octant as u8, axes: DMat3::from_cols(x, x.cross(start), -start) }
    }

    /// Its octant.
    pub fn octant(self) -> usize {
        self.octant as usize
    }

    /// The rotation from the chart's axes to the world's.
    pub fn axes(self) -> DMat3 {
        self.axes
    }
}

/// Whether a triangle, given by its corners in the chart's axes, covers the direction -z, where it is clear whatever the rounding.
#[inline(always)]
fn covers_start([a, b, c]: [DVec3; 3]) -> Option<bool> {
    const MARGIN: f64 = 1e-6;
    let margin = MARGIN * a.abs().max(b.abs()).max(c.abs()).element_sum();
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    if (low.max_element() > margin) | (high.x.min(high.y) < -margin) {
        return Some(false);
    }
    // On which side of each edge the axis passes, if not too close.
    let side = |a: DVec3, b: DVec3| {
        let area = a.x * b.y - a.y * b.x;
        let is_clear = area.abs() > margin * ((b.x - a.x).abs() + (b.y - a.y).abs());
        if is_clear { area.signum() as i32 } else { 0 }
    };
    let sides = [side(a, b), side(b, c), side(c, a)];
    match (sides.contains(&1), sides.contains(&-1), sides.contains(&0)) {
        (true, true, _) => Some(false),
        (_, _, false) if high.z < -margin => Some(true),
        _ => None,
    }
}

/// Angle of ties.
const TIE: f64 = 1e-9;

/// Positions are tangents of the latitude. All isolines start in one direction, where W is counted.
impl Chart for Meridians {
    type Piece = Piece;

    const START: f64 = -Self::POLE;
    const END: f64 = Self::POLE;

    #[inline(always)]
    fn lines(&self) -> usize {
        self.len()
    }

    /// How many isolines have a smaller longitude, or none: all. A vertex beside an isoline may get to its other side, by less than
    /// a crossing is wide: crossings are kept between the latitudes of their arc's ends.
    #[inline(always)]
    fn place(&self, w: DVec3) -> i32 {
        let lines = self.len();
        let longitude = rough_angle(w.x, w.y.abs());
        let longitude = if w.y < 0.0 { TAU - longitude } else { longitude };
        // The nearest whole number stands in the low bits of the sum with 2^52. NaN, in the direction of a pole, becomes zero.
        let before = (longitude * (lines as f64 / TAU)).max(0.0) + (1u64 << 52) as f64;
        let before = before.to_bits() as i32;
        if before == lines as i32 { 0 } else { before }
    }

    #[inline(always)]
    fn reach(&self, a: i32, b: i32) -> Range<usize> {
        Way::reach(a as usize, b as usize, self.len())
    }

    #[inline(always)]
    fn cut(&self, arcs: &Arcs, out: &mut Pieces<Piece>) {
        let lines = self.len();
        let circles = Circles::new(arcs, lines);
        for lane in 0..arcs.count {
            let way = circles.way(lane);
            out.push(way.sense() * arcs.jumps[lane], way.runs(lines), |jump| circles.piece(lane, jump));
        }
    }

    #[inline(always)]
    fn runs(&self, piece: &Piece) -> [Range<usize>; 2] {
        piece.way.runs(self.len())
    }

    #[inline(always)]
    fn cross(&self, piece: &Piece, run: Range<usize>) -> (impl Iterator<Item = f64>, i32) {
        let Piece { sine, cosine, least, most, .. } = *piece;
        let lines = self.cos[run.clone()].iter().zip(&self.sin[run]);
        (lines.map(move |(cos, sin)| (sine * sin + cosine * cos).max(least).min(most)), piece.jump)
    }

    fn bases(_: Outlook<Self>, _: &[i32], _: &mut Vec<i32>) {}

    /// A face that isolines leave once more often than they enter it, whichever of them is looked at, is around their start; once less often, around
    /// their end. Where its plane holds the receiver, [`meets_ahead`] tells which.
    fn count(outlook: Outlook<Self>, rays: Rays, excluded: &[u32], mut covers: impl FnMut(u32, i32)) {
        let Outlook { chart, axes, position, .. } = outlook;
        let lines = chart.len();
        let faces = rays.faces;
        rays.visit(position, -axes.z_axis, |face| {
            let [a, b, c] = faces.corners(face);
            let corners = [a, b, c].map(|x| x.as_dvec3());
            let directions = corners.map(|x| x - position);
            let turned = directions.map(|w| outlook.apply(w));
            let is_clear = covers_start(turned);
            if is_clear == Some(false) || excluded.contains(&face) {
                return;
            }
            if is_clear == Some(true) {
                covers(face, 1);
            } else {
                let sign = i32::from(face_sign(position, a, b, c));
                let places = turned.map(|w| chart.place(w));
                let mut total = 0;
                for (a, b, orientation) in sides(faces.vertices(face)) {
                    let plane = || outlook.apply(arc_plane(directions[a], corners[a], corners[b]));
                    let way = Way::new(places[a], places[b], lines as i32, plane);
                    total += if way.crosses(0, lines) { orientation * sign * way.sense() } else { 0 };
                }
                if total != 0 && !meets_ahead(turned.map(|w| [w.z, w.x, w.y]), total > 0) {
                    covers(face, -total);
                }
            }
        });
    }

    fn horizons(outlook: Outlook<Self>, out: &mut Vec<f64>) {
        let Outlook { chart, normal, .. } = outlook;
        let lines = chart.len();
        out.resize(lines, 0.0);
        let Some(n) = normal.map(|n| outlook.apply(n)) else { return out.fill(Self::END) };
        let (cos, sin) = (&chart.cos[..lines], &chart.sin[..lines]);
        for (line, out) in out.iter_mut().enumerate() {
            *out = (n.x * cos[line] + n.y * sin[line]) / -n.z;
        }
    }

    #[inline(always)]
    fn are_apart(from: f64, to: f64) -> bool {
        to - from > TIE * (1.0 + from.abs().min(to.abs()).powi(2))
    }

    /// All isolines end in one direction.
    fn partner(&self, _: usize) -> Option<usize> {
        Some(0)
    }

    #[inline(always)]
    fn sectors(&self, line: usize, from: f64, to: f64, mut put: impl FnMut(Sector)) {
        let out = Vec3::new(self.cos[line] as f32, self.sin[line] as f32, 0.0);
        put(Sector { out, along: Vec3::Z, tangents: [from as f32, to as f32] });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_rotations_and_start_well_above_the_horizon() {
        for k in 0..2000 {
            let k = f64::from(k);
            let n = DVec3::new((k * 0.7).sin(), (k * 1.3).cos(), (k * 2.1).sin()).normalize();
            for (second, steepest) in [(false, 0.5), (true, 0.25)] {
                let frame = MeridianFrame::facing(Some(n), second);
                assert!((frame.axes().determinant() - 1.0).abs() < 1e-14);
                let start = -frame.axes().z_axis;
                assert!(start.dot(n) > steepest, "{n} {second} {}", start.dot(n));
                assert_eq!(frame, MeridianFrame::of_octant(frame.octant()));
            }
        }
    }

    #[test]
    fn odd_counts_few_and_too_many_are_refused() {
        for count in [0, 2, 5, Meridians::MAX + 2] {
            assert!(Meridians::new(count).is_err());
        }
        assert_eq!(Meridians::new(4).unwrap().u(1), 0.75 * TAU / 2.0);
    }
}
