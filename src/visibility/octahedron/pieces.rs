use std::ops::Range;

use glam::DVec3;

use super::Isolines;
use crate::visibility::crossings::{Arcs, LANES, Pieces};

/// Where a direction lies in the chart: its quadrant, its integer place between the isolines, and the bits of both in one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place(pub(super) i32);

impl Place {
    /// Zeros count as positive, for every arc alike.
    #[inline(always)]
    pub(super) fn of(w: DVec3, isolines: &Isolines) -> Self {
        let (left, lower) = (i32::from(w.y < 0.0), i32::from(w.z < 0.0));
        let quadrant = 2 * left + (left ^ lower);
        Self((isolines.below(w.x, w.y.abs() + w.z.abs()) << 2) | quadrant)
    }

    #[inline(always)]
    pub(super) fn quadrant(self) -> usize {
        (self.0 & 3) as usize
    }

    /// How many isolines lie below.
    #[inline(always)]
    pub(super) fn below(self) -> u32 {
        (self.0 >> 2) as u32
    }

    fn right(self) -> bool {
        self.quadrant() < 2
    }

    fn upper(self) -> bool {
        is_upper(self.quadrant())
    }
}

fn is_upper(quadrant: usize) -> bool {
    quadrant == 0 || quadrant == 3
}

/// Where an arc passes from one half of the isolines to the other.
pub(super) enum Passage {
    /// Through the spine (y = 0, z > 0), having this many isolines below it.
    Spine(u32),
    /// Through the far side (y = 0, z < 0).
    Back(u32),
}

/// How the arc from `a` to `b` with this plane passes the plane y = 0, if it does.
///
/// Decided from the signs of its ends and the plane's bits alone: an arc and each of its faces get the same answer.
pub(super) fn passage(a: Place, b: Place, plane: DVec3, isolines: &Isolines) -> Option<Passage> {
    if a.right() == b.right() {
        return None;
    }
    // The arc's point with y = 0 on the way to the side of b.
    let (x, z) = if b.right() { (plane.z, -plane.x) } else { (-plane.z, plane.x) };
    let below = if x == 0.0 && z == 0.0 { a.below() } else { isolines.below(x, z.abs()) as u32 };
    let spine = if a.upper() == b.upper() { a.upper() } else { z >= 0.0 };
    Some(if spine { Passage::Spine(below) } else { Passage::Back(below) })
}

/// Change of W along the spine, towards +u, when an arc with this jump passes it on the way to `to`.
pub(super) fn spine_jump(jump: i32, to: Place) -> i32 {
    if to.right() { jump } else { -jump }
}

/// A part of an arc inside one quadrant of the chart, and the isolines it crosses there.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::visibility) struct Piece {
    /// Halves of isolines.
    first: u32,
    last: u32,
    /// Change of W when the isoline's half is followed away from the spine.
    jump: i32,
    /// Beyond the fold, where z < 0.
    far: bool,
    slope: f64,
    offset: f64,
    least: f64,
    most: f64,
}

impl Piece {
    #[inline(always)]
    pub(super) fn run(&self) -> Range<usize> {
        self.first as usize..self.last as usize
    }

    /// Positions at ratios of isolines, and the jump.
    #[inline(always)]
    pub(super) fn cross(&self, ratios: &[f64]) -> (impl Iterator<Item = f64>, i32) {
        let Self { slope, offset, least, most, far, .. } = *self;
        // Beyond the fold the fraction runs back.
        let (start, sense) = if far { (2.0, -1.0) } else { (0.0, 1.0) };
        (ratios.iter().map(move |ratio| start + sense * (slope * ratio + offset).max(least).min(most)), self.jump)
    }
}

/// An end of a piece: how many isolines lie below, and |y| / (|y| + |z|).
type End = (u32, f64);

/// Great circles in the quadrants where their arcs start: fraction = slope ratio + offset; and the fractions of the arcs' ends.
pub(super) struct Slopes {
    slope: [f64; LANES],
    offset: [f64; LANES],
    fractions: [[f64; LANES]; 2],
}

impl Slopes {
    #[inline(always)]
    pub(super) fn new(Arcs { planes: [x, y, z], ends, places, .. }: &Arcs) -> Self {
        let zero = [0.0; LANES];
        let mut slopes = Self { slope: zero, offset: zero, fractions: [zero; 2] };
        for i in 0..LANES {
            (slopes.slope[i], slopes.offset[i]) = line(DVec3::new(x[i], y[i], z[i]), places[0][i] as usize & 3);
            for (fractions, [_, y, z]) in slopes.fractions.iter_mut().zip(ends) {
                fractions[i] = y[i].abs() / (y[i].abs() + z[i].abs());
            }
        }
        slopes
    }

    /// Adds the pieces of an arc.
    #[inline(always)]
    pub(super) fn cut(&self, arcs: &Arcs, lane: usize, isolines: &Isolines, out: &mut Pieces<Piece>) {
        let [from, to] = [0, 1].map(|end| Place(arcs.places[end][lane]));
        let [start, end] = [(from, 0), (to, 1)].map(|(place, i)| (place.below(), self.fractions[i][lane]));
        let jump = arcs.jumps[lane];
        if from.quadrant() == to.quadrant() {
            push(isolines, jump, (self.slope[lane], self.offset[lane]), from.quadrant(), start, end, out);
        } else {
            let plane = DVec3::new(arcs.planes[0][lane], arcs.planes[1][lane], arcs.planes[2][lane]);
            split(isolines, jump, plane, (from, start), (to, end), out);
        }
    }
}

/// plane . (r, sy f, sz (1 - f)) = 0 solved for f: slope and offset over r.
#[inline(always)]
fn line(plane: DVec3, quadrant: usize) -> (f64, f64) {
    let sy = if quadrant < 2 { 1.0 } else { -1.0 };
    let sz = if (quadrant == 0) | (quadrant == 3) { 1.0 } else { -1.0 };
    let scale = -1.0 / (plane.y * sy - plane.z * sz);
    (plane.x * scale, plane.z * sz * scale)
}

/// Cuts an arc at the planes y = 0 and z = 0 into at most three pieces, and notes where it meets the spine.
fn split(
    isolines: &Isolines,
    jump: i32,
    plane: DVec3,
    (from, start): (Place, End),
    (to, end): (Place, End),
    out: &mut Pieces<Piece>,
) {
    // The arc's point with z = 0 on the way to the side of `b`.
    let fold = |a: Place, b: Place| {
        let (x, y) = if b.upper() { (-plane.y, plane.x) } else { (plane.y, -plane.x) };
        if x == 0.0 && y == 0.0 { a.below() } else { isolines.below(x, y.abs()) as u32 }
    };
    let mut piece = |quadrant: usize, a: End, b: End| {
        push(isolines, jump, line(plane, quadrant), quadrant, a, b, out);
    };
    let Some(passed) = passage(from, to, plane, isolines) else {
        let at = (fold(from, to), 1.0);
        piece(from.quadrant(), start, at);
        piece(to.quadrant(), at, end);
        return;
    };
    let (at, upper) = match passed {
        Passage::Spine(at) => (at, true),
        Passage::Back(at) => (at, false),
    };
    let at = (at, 0.0);
    let beside = |place: Place| match (place.right(), upper) {
        (true, true) => 0,
        (true, false) => 1,
        (false, false) => 2,
        (false, true) => 3,
    };
    for (place, end, forward) in [(from, start, true), (to, end, false)] {
        let legs = if place.upper() == upper {
            [Some((place.quadrant(), end, at)), None]
        } else {
            let bend = (fold(from, to), 1.0);
            [Some((place.quadrant(), end, bend)), Some((beside(place), bend, at))]
        };
        for (quadrant, outer, inner) in legs.into_iter().flatten() {
            if forward { piece(quadrant, outer, inner) } else { piece(quadrant, inner, outer) }
        }
    }
    if let Passage::Spine(at) = passed {
        out.change(at as usize, isolines.len() + 1, spine_jump(jump, to));
    }
}

#[inline(always)]
fn push(
    isolines: &Isolines,
    jump: i32,
    (slope, offset): (f64, f64),
    quadrant: usize,
    (below_a, fraction_a): End,
    (below_b, fraction_b): End,
    out: &mut Pieces<Piece>,
) {
    let half = quadrant / 2;
    // At the poles +-x the fraction is NaN, and these take the other end's.
    let (least, most) = (fraction_a.min(fraction_b), fraction_a.max(fraction_b));
    // Away from the spine means to the left of an arc that runs towards +u in the half y >= 0.
    let outward = if (below_b > below_a) == (half == 0) { -jump } else { jump };
    let before = (half * isolines.len()) as u32;
    let (first, last) = (before + below_a.min(below_b), before + below_a.max(below_b));
    if first < last {
        let far = !is_upper(quadrant);
        out.push(outward, [first as usize..last as usize, 0..0], |jump| Piece {
            first,
            last,
            jump,
            far,
            slope,
            offset,
            least,
            most,
        });
    }
}
