use glam::DVec3;

use super::{Arc, Frame, Isolines, ReceiverContours};

/// A direction's place in the chart: its quadrant, its integer place between the isolines, and |y| / (|y| + |z|).
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    quadrant: u8,
    below: u32,
    fraction: f64,
}

impl Place {
    /// Zeros count as positive, for every arc alike.
    pub(super) fn of(w: DVec3, isolines: &Isolines) -> Self {
        let quadrant = match (w.y >= 0.0, w.z >= 0.0) {
            (true, true) => 0,
            (true, false) => 1,
            (false, false) => 2,
            (false, true) => 3,
        };
        let m = w.y.abs() + w.z.abs();
        Self { quadrant, below: isolines.below(w.x, m), fraction: w.y.abs() / m }
    }

    fn right(self) -> bool {
        self.quadrant < 2
    }

    fn upper(self) -> bool {
        self.quadrant == 0 || self.quadrant == 3
    }
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
/// Decided from the signs of its ends and the plane's bits alone: an arc and each of its faces get the same answer,
/// whether they were clipped at the horizon or not.
pub(super) fn passage(a: Place, b: Place, plane: DVec3, isolines: &Isolines) -> Option<Passage> {
    if a.right() == b.right() {
        return None;
    }
    // The arc's point with y = 0 on the way to the side of b.
    let (x, z) = if b.right() { (plane.z, -plane.x) } else { (-plane.z, plane.x) };
    let below = if x == 0.0 && z == 0.0 { a.below } else { isolines.below(x, z.abs()) };
    let spine = if a.upper() == b.upper() { a.upper() } else { z >= 0.0 };
    Some(if spine { Passage::Spine(below) } else { Passage::Back(below) })
}

/// A part of an arc inside one quadrant of the chart, and the isolines it crosses there.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// 0: the half y >= 0; 1: the half y < 0.
    half: u8,
    /// Beyond the fold, where z < 0.
    far: bool,
    first: u32,
    last: u32,
    slope: f64,
    offset: f64,
    least: f64,
    most: f64,
    /// Change of W when the isoline's half is followed away from the spine.
    jump: i32,
}

/// All crossings of one receiver's contours with the halves of the isolines, sorted along each.
///
/// A half is followed from the spine: `s` in [0, 1] runs to the fold z = 0 and `s` in [1, 2] on to the far corner.
#[derive(Clone, Debug, Default)]
pub(super) struct Crossings {
    places: Vec<Place>,
    pieces: Vec<Piece>,
    /// Number of crossings before half-line `2 * line + half`, with an end mark.
    starts: Vec<u32>,
    next: Vec<u32>,
    keys: Vec<u64>,
    /// Change of W along the spine on reaching each isoline.
    spine: Vec<i32>,
}

/// Low bits of a key that hold the jump; what is left of `s` has a resolution of 2^-44.
const JUMP_BITS: u32 = 8;
const JUMP_BIAS: i32 = 1 << (JUMP_BITS - 1);

/// One crossing as sorted: position in the high bits, jump in the low ones. The sign of a negative zero would sort last.
fn key(s: f64, jump: i32) -> u64 {
    (s.abs().to_bits() & !((1 << JUMP_BITS) - 1)) | (jump + JUMP_BIAS) as u64
}

/// Position and jump of a sorted crossing.
pub(super) fn crossing(key: u64) -> (f64, i32) {
    let mask = (1u64 << JUMP_BITS) - 1;
    (f64::from_bits(key & !mask), (key & mask) as i32 - JUMP_BIAS)
}

impl Crossings {
    /// Crosses every arc above the horizon with the isolines.
    pub(super) fn collect(&mut self, isolines: &Isolines, frame: Frame, contours: &ReceiverContours) {
        self.places.clear();
        self.places.extend(contours.directions.iter().map(|&d| Place::of(frame.apply(d), isolines)));
        self.pieces.clear();
        self.starts.clear();
        self.starts.resize(2 * isolines.len() + 1, 0);
        self.spine.clear();
        self.spine.resize(isolines.len() + 1, 0);
        for arc in &contours.arcs {
            let (a, b) = (arc.a as usize, arc.b as usize);
            let plane = frame.apply(arc.plane);
            let [from, to] = match (contours.heights[a], contours.heights[b]) {
                (ha, hb) if ha >= 0.0 && hb >= 0.0 => [self.places[a], self.places[b]],
                (ha, hb) => {
                    let (da, db) = (contours.directions[a], contours.directions[b]);
                    let clipped = if ha >= 0.0 { db * ha - da * hb } else { da * hb - db * ha };
                    let clipped = Place::of(frame.apply(clipped), isolines);
                    if ha >= 0.0 { [self.places[a], clipped] } else { [clipped, self.places[b]] }
                }
            };
            self.split(isolines, arc, plane, from, to);
        }
        self.bucket(isolines);
    }

    /// Cuts an arc at the planes y = 0 and z = 0 into at most three pieces, and notes where it meets the spine.
    fn split(&mut self, isolines: &Isolines, arc: &Arc, plane: DVec3, from: Place, to: Place) {
        // The arc's point with z = 0 on the way to the side of `to`.
        let fold = |a: Place, b: Place| {
            let (x, y) = if b.upper() { (-plane.y, plane.x) } else { (plane.y, -plane.x) };
            if x == 0.0 && y == 0.0 { a.below } else { isolines.below(x, y.abs()) }
        };
        let mut piece = |quadrant: u8, (below_a, fraction_a): (u32, f64), (below_b, fraction_b): (u32, f64)| {
            self.piece(isolines, arc.jump, plane, quadrant, (below_a, fraction_a), (below_b, fraction_b));
        };
        let (start, end) = ((from.below, from.fraction), (to.below, to.fraction));
        match passage(from, to, plane, isolines) {
            None if from.quadrant == to.quadrant => piece(from.quadrant, start, end),
            None => {
                let at = (fold(from, to), 1.0);
                piece(from.quadrant, start, at);
                piece(to.quadrant, at, end);
            }
            Some(passed) => {
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
                for (place, forward) in [(from, true), (to, false)] {
                    let end = (place.below, place.fraction);
                    let legs = if place.upper() == upper {
                        [Some((place.quadrant, end, at)), None]
                    } else {
                        let bend = (fold(from, to), 1.0);
                        [Some((place.quadrant, end, bend)), Some((beside(place), bend, at))]
                    };
                    for (quadrant, outer, inner) in legs.into_iter().flatten() {
                        if forward { piece(quadrant, outer, inner) } else { piece(quadrant, inner, outer) }
                    }
                }
                if let Passage::Spine(at) = passed {
                    self.spine[at as usize] += spine_jump(arc.jump, to);
                }
            }
        }
    }

    fn piece(
        &mut self,
        isolines: &Isolines,
        jump: i32,
        plane: DVec3,
        quadrant: u8,
        (below_a, fraction_a): (u32, f64),
        (below_b, fraction_b): (u32, f64),
    ) {
        if below_a == below_b {
            return;
        }
        let (half, far) = (quadrant / 2, quadrant == 1 || quadrant == 2);
        let sy = if half == 0 { 1.0 } else { -1.0 };
        let sz = if far { -1.0 } else { 1.0 };
        // plane . (r, sy f, sz (1 - f)) = 0 solved for f.
        let scale = -1.0 / (plane.y * sy - plane.z * sz);
        // At the poles +-x the fraction is NaN, and these take the other end's.
        let (least, most) = (fraction_a.min(fraction_b), fraction_a.max(fraction_b));
        // Away from the spine means to the left of an arc that runs towards +u in the half y >= 0.
        let outward = if (below_b > below_a) == (half == 0) { -jump } else { jump };
        let (first, last) = (below_a.min(below_b), below_a.max(below_b));
        debug_assert!(last as usize <= isolines.len());
        let (slope, offset) = (plane.x * scale, plane.z * sz * scale);
        let mut left = outward;
        while left != 0 {
            let jump = left.clamp(-JUMP_BIAS, JUMP_BIAS - 1);
            left -= jump;
            self.pieces.push(Piece { half, far, first, last, slope, offset, least, most, jump });
            // Differences now, counts after the running sum in `bucket`.
            self.next_count(first, half, 1);
            self.next_count(last, half, -1);
        }
    }

    fn next_count(&mut self, line: u32, half: u8, change: i32) {
        let at = 2 * line as usize + half as usize;
        if at < self.starts.len() {
            self.starts[at] = self.starts[at].wrapping_add_signed(change);
        }
    }

    /// Sorts the crossings of all pieces into their half-lines.
    fn bucket(&mut self, isolines: &Isolines) {
        let half_lines = 2 * isolines.len();
        let (mut running, mut total) = ([0u32; 2], 0u32);
        // The last entry took the differences of pieces that end with the last isoline.
        self.starts[half_lines] = 0;
        for at in 0..half_lines {
            running[at % 2] = running[at % 2].wrapping_add(self.starts[at]);
            self.starts[at] = total;
            total += running[at % 2];
        }
        self.starts[half_lines] = total;
        self.next.clear();
        self.next.extend_from_slice(&self.starts[..half_lines]);
        self.keys.clear();
        self.keys.resize(total as usize, 0);
        let ratios = isolines.ratios();
        for piece in &self.pieces {
            for line in piece.first..piece.last {
                let f = (piece.slope * ratios[line as usize] + piece.offset).max(piece.least).min(piece.most);
                let s = if piece.far { 2.0 - f } else { f };
                let next = &mut self.next[2 * line as usize + piece.half as usize];
                self.keys[*next as usize] = key(s, piece.jump);
                *next += 1;
            }
        }
        for at in 0..half_lines {
            let range = self.starts[at] as usize..self.starts[at + 1] as usize;
            if range.len() > 1 {
                self.keys[range].sort_unstable();
            }
        }
    }

    /// Sorted crossings of one half of an isoline; take each apart with [`crossing`].
    pub(super) fn along(&self, line: usize, half: usize) -> &[u64] {
        let at = 2 * line + half;
        &self.keys[self.starts[at] as usize..self.starts[at + 1] as usize]
    }

    /// Change of W along the spine on reaching `line` from the one below.
    pub(super) fn spine(&self, line: usize) -> i32 {
        self.spine[line]
    }
}

/// Change of W along the spine, towards +u, when an arc with this jump passes it on the way to `to`.
pub(super) fn spine_jump(jump: i32, to: Place) -> i32 {
    if to.right() { jump } else { -jump }
}
