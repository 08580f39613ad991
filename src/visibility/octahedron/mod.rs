//! The isolines of the octahedral map, for what needs a table of light.

mod pieces;

use std::f32::consts::FRAC_1_SQRT_2;
use std::f64::consts::SQRT_2;
use std::ops::Range;

use dual_bvh::face_sign;
use glam::{DMat3, DVec3, Vec3};

use super::beams::Rays;
use super::chart::{Chart, Outlook, Sector, is_beside, meets_ahead};
use super::contours::{arc_plane, sides};
use super::crossings::{Arcs, Pieces};
use super::spans::Spans;
use crate::{Error, Result};
use pieces::{Passage, Piece, Place, Slopes, passage, spine_jump};

/// The u-isolines of the octahedral map (u, v, w) = (x, y, z) / (|x| + |y| + |z|).
///
/// Isoline `i` is the closed loop `u = u_i`, `u_i = -1 + (2 i + 1) / N`: four great-circle arcs between the *corners*
/// where it meets the planes y = 0 and z = 0. Corners are numbered along the loop, +z, +y, -z, -y; *quadrant* `q` is
/// the arc from corner `q` to corner `q + 1`, and a point on it is given by its fraction `f` in [0, 1]:
///
/// | quadrant | y | z | |y| / (1 - |u|) |
/// |---|---|---|---|
/// | 0 | >= 0 | >= 0 | f |
/// | 1 | >= 0 | < 0 | 1 - f |
/// | 2 | < 0 | < 0 | f |
/// | 3 | < 0 | >= 0 | 1 - f |
///
/// Inside one quadrant every great circle is a straight line in (r, f) with r = x / (|y| + |z|) (Praun and Hoppe 2003),
/// so that its crossings with the isolines need one multiplication and one addition each.
#[derive(Clone, Debug)]
pub struct Isolines {
    /// r = u / (1 - |u|) of every isoline, twice: for its halves.
    ratios: Vec<f64>,
    /// The directions of an isoline lie on a straight line in each quadrant. Its point next to the receiver, normalised: x and |y| = |z|;
    /// and half of its length over the distance of that point.
    middles: Vec<[f32; 3]>,
}

impl Isolines {
    /// The largest number of isolines.
    pub const MAX: usize = 1 << 20;

    /// `count` isolines, even, so that the octants' common boundary u = 0 lies between two of them.
    pub fn new(count: usize) -> Result<Self> {
        if count < 2 || !count.is_multiple_of(2) || count > Self::MAX {
            return Err(Error::input(format!(
                "the number of isolines must be even and between 2 and {}, but it is {count}",
                Self::MAX
            )));
        }
        let ratios = (0..count).map(|i| Self::position(count, i)).map(|u| u / (1.0 - u.abs()));
        let middle = |u: f64| {
            let half = 0.5 * (1.0 - u.abs());
            let distance = (u * u + 2.0 * half * half).sqrt();
            [u / distance, half / distance, half * SQRT_2 / distance].map(|x| x as f32)
        };
        let middles = (0..count).map(|i| middle(Self::position(count, i))).collect();
        Ok(Self { ratios: ratios.clone().chain(ratios).collect(), middles })
    }

    fn position(count: usize, line: usize) -> f64 {
        (2.0 * line as f64 + 1.0 - count as f64) / count as f64
    }

    /// Number of isolines N.
    pub fn len(&self) -> usize {
        self.ratios.len() / 2
    }

    /// Never: there are at least two isolines.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// u of isoline `line`.
    pub fn u(&self, line: usize) -> f64 {
        Self::position(self.len(), line)
    }

    /// How many isolines have a smaller u than a direction with x and |y| + |z| = `m`.
    #[inline(always)]
    fn below(&self, x: f64, m: f64) -> i32 {
        let half = (self.len() / 2) as i32;
        let u = x / (x.abs() + m);
        // The nearest whole number stands in the low bits of the sum with 2^52. NaN, of a zero direction, becomes zero.
        let below = ((u + 1.0) * f64::from(half)).max(0.0) + (1u64 << 52) as f64;
        let below = below.to_bits() as i32;
        if x < 0.0 { below.min(half) } else { below.max(half).min(2 * half) }
    }
}

/// Angle of ties, as a fraction of a quadrant.
const TIE: f64 = 1e-9;

/// What is followed are the halves of isolines, all those in y >= 0 before those in y < 0, from the spine on: positions in [0, 1] run to
/// the fold z = 0 and those in [1, 2] on to the far corner. W is counted where one of them starts.
impl Chart for Isolines {
    type Piece = Piece;

    const START: f64 = 0.0;
    const END: f64 = 2.0;

    #[inline(always)]
    fn lines(&self) -> usize {
        self.ratios.len()
    }

    #[inline(always)]
    fn place(&self, w: DVec3) -> i32 {
        Place::of(w, self).0
    }

    /// Arcs from one quadrant to another may cross any, and the spine.
    #[inline(always)]
    fn reach(&self, a: i32, b: i32) -> Range<usize> {
        let (a, b) = (Place(a), Place(b));
        if a.quadrant() != b.quadrant() {
            return 0..self.lines();
        }
        let [a, b] = [a, b].map(|place| a.quadrant() / 2 * self.len() + place.below() as usize);
        a.min(b)..a.max(b)
    }

    #[inline(always)]
    fn cut(&self, arcs: &Arcs, out: &mut Pieces<Piece>) {
        let slopes = Slopes::new(arcs);
        for lane in 0..arcs.count {
            slopes.cut(arcs, lane, self, out);
        }
    }

    #[inline(always)]
    fn runs(&self, piece: &Piece) -> [Range<usize>; 2] {
        [piece.run(), 0..0]
    }

    #[inline(always)]
    fn cross(&self, piece: &Piece, run: Range<usize>) -> (impl Iterator<Item = f64>, i32) {
        piece.cross(&self.ratios[run])
    }

    fn bases(outlook: Outlook<Self>, changes: &[i32], out: &mut Vec<i32>) {
        let lines = outlook.chart.len();
        let base = base_line(outlook);
        out.clear();
        out.resize(lines, 0);
        for line in base + 1..lines {
            out[line] = out[line - 1] + changes[line];
        }
        for line in (0..base).rev() {
            out[line] = out[line + 1] - changes[line + 1];
        }
        out.extend_from_within(..);
    }

    fn count(outlook: Outlook<Self>, rays: Rays, excluded: &[u32], mut covers: impl FnMut(u32, i32)) {
        let Outlook { chart, axes, position, .. } = outlook;
        let line = base_line(outlook);
        let u = chart.u(line);
        let (start, normals) = (DVec3::new(u, 0.0, 1.0 - u.abs()), [DVec3::Y, DVec3::new(1.0 - u.abs(), 0.0, -u)]);
        let normals = normals.map(|normal| axes * normal);
        let faces = rays.faces;
        rays.visit(position, axes * start, |face| {
            let [a, b, c] = faces.corners(face);
            let corners = [a, b, c].map(|x| x.as_dvec3());
            let directions = corners.map(|x| x - position);
            if !is_beside(directions, normals) && !excluded.contains(&face) {
                let sign = i32::from(face_sign(position, a, b, c));
                let turned = directions.map(|w| outlook.apply(w));
                let places = turned.map(|w| Place::of(w, chart));
                let (mut here, mut total) = (0, 0);
                for (a, b, orientation) in sides(faces.vertices(face)) {
                    let plane = outlook.apply(arc_plane(directions[a], corners[a], corners[b]));
                    if let Some(Passage::Spine(below)) = passage(places[a], places[b], plane, chart) {
                        let jump = spine_jump(orientation * sign, places[b]);
                        total += jump;
                        here += if below <= line as u32 { jump } else { 0 };
                    }
                }
                // A face passed once on the way up the spine is around its end, the pole x, or else around its start, the pole -x. On the
                // sliver of a face whose plane holds the receiver to rounding W may be -1, as its contours have it.
                let is_around_start = total != 0 && !meets_ahead(turned.map(|w| w.to_array()), total > 0);
                let depth = here - if is_around_start { total } else { 0 };
                if depth != 0 {
                    covers(face, depth);
                }
            }
        });
    }

    fn horizons(outlook: Outlook<Self>, out: &mut Vec<f64>) {
        let lines = outlook.chart.len();
        out.resize(2 * lines, 0.0);
        let Some(n) = outlook.normal.map(|n| outlook.apply(n)) else { return out.fill(Self::END) };
        let (right, left) = out.split_at_mut(lines);
        for ((&ratio, right), left) in outlook.chart.ratios[..lines].iter().zip(right).zip(left) {
            *right = horizon(n, ratio, 1.0);
            *left = horizon(n, ratio, -1.0);
        }
    }

    #[inline(always)]
    fn are_apart(from: f64, to: f64) -> bool {
        to - from > TIE
    }

    /// The other half ends at the same far corner.
    fn partner(&self, line: usize) -> Option<usize> {
        line.checked_sub(self.len())
    }

    #[inline(always)]
    fn sectors(&self, line: usize, from: f64, to: f64, mut put: impl FnMut(Sector)) {
        let lines = self.len();
        let (side, line) = if line < lines { (1.0, line) } else { (-1.0, line - lines) };
        let [x, y, width] = self.middles[line];
        // Before the fold |y| grows and z falls; behind it both fall.
        let tangent = |s: f64| (2.0 * s - 1.0) as f32 * width;
        if from < 1.0 {
            let (out, along) = (Vec3::new(x, side * y, y), Vec3::new(0.0, side, -1.0) * FRAC_1_SQRT_2);
            put(Sector { out, along, tangents: [tangent(from), tangent(to.min(1.0))] });
        }
        if to > 1.0 {
            let (out, along) = (Vec3::new(x, side * y, -y), Vec3::new(0.0, -side, -1.0) * FRAC_1_SQRT_2);
            put(Sector { out, along, tangents: [tangent(from.max(1.0) - 1.0), tangent(to - 1.0)] });
        }
    }
}

/// An isoline whose spine is above the horizon, in no plane of the axes, in which many scenes have faces.
fn base_line(outlook: Outlook<Isolines>) -> usize {
    /// Its u.
    const ASIDE: f64 = 0.37;
    let half = outlook.chart.len() / 2;
    let aside = (ASIDE * half as f64) as usize;
    if outlook.normal.is_some_and(|n| outlook.apply(n).x < 0.0) { half - 1 - aside } else { half + aside }
}

/// Where the half of an isoline with ratio `r` on one side, that of the sign of y, sinks below the horizon of normal `n` (in the
/// chart's frame, facing the spine); at once if all of it lies below.
#[inline(always)]
fn horizon(n: DVec3, r: f64, side: f64) -> f64 {
    // What lies in the horizon to rounding counts as below it, a whole quadrant or a corner: contours there are left out either
    // way.
    let level = 1e-12 * ((n.x * r).abs() + n.z);
    let (spine, fold, far) = (n.x * r + n.z, n.x * r + n.y * side, n.x * r - n.z);
    let near = spine / (spine - fold.min(0.0));
    let beyond = (1.0 + fold / (fold - far.min(0.0))).min(Isolines::END.next_down());
    let beyond = if far <= level { beyond } else { Isolines::END };
    let end = if fold <= level { near } else { beyond };
    if spine <= level { Isolines::START } else { end }
}

/// The spans of a receiver that sees everything above its horizon.
pub fn open_spans(isolines: &Isolines, frame: Frame, normal: Option<DVec3>, spans: &mut Spans) {
    let mut horizons = Vec::new();
    Isolines::horizons(Outlook { chart: isolines, axes: frame.axes(), position: DVec3::ZERO, normal }, &mut horizons);
    spans.clear(horizons.len());
    for &horizon in &horizons {
        spans.begin_line();
        spans.add::<Isolines>(Isolines::START, horizon);
    }
    spans.end();
}

/// Which way the isolines lie for a receiver: a rotation of the octahedron onto itself, exact in floating point.
///
/// The chart's x axis, along which isolines follow one another, is one of the world's axes (the y and z axes follow
/// cyclically); quarter turns about it then choose the corner that faces the chart's +z, from which both halves of every
/// isoline are followed. Facing the normal, that corner (the *spine*, over all isolines) is the highest point of its
/// isoline, so each half of an isoline meets the horizon once at most and what is invisible is its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    axis: u8,
    turns: u8,
}

impl Frame {
    /// The frame for a receiver: its spine is where `normal . w` is largest on every isoline, and isolines follow one
    /// another along the axis for which the horizon crosses them most steeply. Where it runs along them, all of it moves
    /// from one side of a line to the other at once, at an error of first order; in the chart its slopes dr/df are
    /// (|n_y| + |n_z|) / |n_x| and (|n_y| - |n_z|) / |n_x|.
    ///
    /// There are three, one for each axis: `rank` 0 is the best, 1 and 2 are for a second look.
    pub fn facing(normal: Option<DVec3>, rank: usize) -> Self {
        let Some(n) = normal else { return Self { axis: rank as u8, turns: 0 } };
        let steepness = |axis: usize| {
            let n = cycle(n, axis).abs();
            (n.y - n.z).abs() / n.x
        };
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| steepness(b).total_cmp(&steepness(a)));
        let axis = axes[rank];
        let n = cycle(n, axis);
        let turns = match (n.z.abs() >= n.y.abs(), n.z >= 0.0, n.y >= 0.0) {
            (true, true, _) => 0,
            (false, _, true) => 1,
            (true, false, _) => 2,
            (false, _, false) => 3,
        };
        Self { axis: axis as u8, turns }
    }

    /// The world's axis that is the chart's x axis: 0, 1 or 2.
    pub fn axis(self) -> usize {
        self.axis as usize
    }

    /// The rotation from the chart's axes to the world's.
    pub fn axes(self) -> DMat3 {
        let apply = |w: DVec3| turn(cycle(w, self.axis()), self.turns);
        DMat3::from_cols(apply(DVec3::X), apply(DVec3::Y), apply(DVec3::Z)).transpose()
    }

    /// The quadrant, before the quarter turns, that the chart's quadrant `quadrant` is.
    pub fn quadrant(self, quadrant: usize) -> usize {
        (quadrant + self.turns as usize) % 4
    }
}

/// The coordinates from the one numbered `axis` on, cyclically.
fn cycle(w: DVec3, axis: usize) -> DVec3 {
    match axis {
        0 => w,
        1 => DVec3::new(w.y, w.z, w.x),
        _ => DVec3::new(w.z, w.x, w.y),
    }
}

fn turn(w: DVec3, turns: u8) -> DVec3 {
    match turns {
        0 => w,
        1 => DVec3::new(w.x, -w.z, w.y),
        2 => DVec3::new(w.x, -w.y, -w.z),
        _ => DVec3::new(w.x, w.z, -w.y),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [DVec3; 4] = [DVec3::Z, DVec3::Y, DVec3::NEG_Z, DVec3::NEG_Y];

    #[test]
    fn a_vertex_lies_between_its_isolines() {
        for count in [2, 16, 254] {
            let isolines = Isolines::new(count).unwrap();
            for step in 0..=1000 {
                let x = (step as f64 - 500.0) / 500.0;
                let m = 1.0 - x.abs();
                let below = isolines.below(x, m) as usize;
                let expected = (0..count).filter(|&i| isolines.u(i) < x - 1e-12).count();
                let above = (0..count).filter(|&i| isolines.u(i) < x + 1e-12).count();
                assert!((expected..=above).contains(&below), "{count} {x} {below}");
            }
            assert_eq!(isolines.below(-1e-300, 1.0), count as i32 / 2);
            assert_eq!(isolines.below(0.0, 0.0), count as i32 / 2);
        }
    }

    #[test]
    fn odd_zero_and_huge_counts_are_refused() {
        for count in [0, 1, 17, Isolines::MAX + 2] {
            assert!(Isolines::new(count).is_err());
        }
    }

    #[test]
    fn frames_turn_the_facing_corner_up() {
        for axis in 0..3 {
            for (turns, &corner) in CORNERS.iter().enumerate() {
                let frame = Frame { axis, turns: turns as u8 };
                let axes = frame.axes();
                assert_eq!(axes.determinant(), 1.0);
                assert_eq!(axes * DVec3::Z, cycle(corner, (3 - axis as usize) % 3));
                for q in 0..4 {
                    let ends = |q: usize| [CORNERS[q], CORNERS[(q + 1) % 4]];
                    let world = ends(frame.quadrant(q)).map(|c| cycle(c, (3 - axis as usize) % 3));
                    assert_eq!(ends(q).map(|c| axes * c), world);
                }
            }
        }
    }

    #[test]
    fn the_spine_is_the_highest_corner_and_the_lines_cross_the_horizon_steeply() {
        for k in 0..1000 {
            let k = k as f64;
            let n = DVec3::new((k * 0.7).sin(), (k * 1.3).cos(), (k * 2.1).sin()).normalize();
            let turned = Frame::facing(Some(n), 0).axes().transpose() * n;
            assert!(turned.z >= turned.y.abs());
            let steepness = |n: DVec3| (n.z.abs() - n.y.abs()).abs() / n.x.abs();
            assert!((0..3).all(|axis| steepness(turned) >= steepness(cycle(n, axis))));
        }
    }
}
