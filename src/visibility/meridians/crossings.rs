use std::ops::Range;

use dual_bvh::{Candidates, Contours};
use glam::DVec3;

use super::vertices::{Vertex, Vertices};
use super::{MeridianFrame, Meridians};
use crate::visibility::contours::arc_plane;

/// The ends of the part of an arc that lies above the horizon, of which one may be where it passes the horizon.
///
/// Decided from the ends alone: an arc and each of its faces get the same. Between ends on one side of a pole it passes the
/// horizon on that side, however low they are.
#[inline(always)]
pub(in crate::visibility) fn above_horizon(a: Vertex, b: Vertex, lines: usize) -> Option<[Vertex; 2]> {
    let on_horizon = |above: Vertex, below: Vertex| {
        let east = below.east * above.up - above.east * below.up;
        let north = below.north * above.up - above.north * below.up;
        Vertex { place: if east < 0.0 { lines as i32 } else { 0 }, east, up: 0.0, north }
    };
    match (a.place >= 0, b.place >= 0) {
        (false, false) => None,
        (true, true) => Some([a, b]),
        (true, false) => Some([a, on_horizon(a, b)]),
        (false, true) => Some([on_horizon(b, a), b]),
    }
}

/// The isolines that an arc crosses from one place to another, and +1 if they pass it from its left to its right on their
/// way, otherwise -1.
#[inline(always)]
pub(in crate::visibility) fn crossed(a: i32, b: i32) -> (Range<u32>, i32) {
    // Towards larger longitudes the left of an arc is on the side of the pole z.
    (a.min(b) as u32..a.max(b) as u32, if a < b { -1 } else { 1 })
}

/// A contour that crosses isolines, both of whose ends lie above the horizon.
#[derive(Clone, Copy, Debug, Default)]
struct Chord {
    a: u32,
    b: u32,
    jump: i32,
}

/// A great circle where it crosses isolines: `tangent = sine sin u + cosine cos u`, within bounds.
#[derive(Clone, Copy, Debug)]
struct Piece {
    first: u32,
    last: u32,
    /// Change of W along the isolines.
    jump: i32,
    sine: f64,
    cosine: f64,
    least: f64,
    most: f64,
}

/// All crossings of one receiver's contours with the isolines, sorted along each.
#[derive(Clone, Debug, Default)]
pub(in crate::visibility) struct Crossings {
    vertices: Vertices,
    chords: Vec<Chord>,
    /// Contours that pass the horizon.
    cut: Vec<Chord>,
    pieces: Vec<Piece>,
    /// Number of crossings before each isoline, with an end mark.
    starts: Vec<u32>,
    next: Vec<u32>,
    keys: Vec<i64>,
    count: Counts,
}

/// What became of the contours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Contours with a part above the horizon.
    pub above: usize,
    /// Contours below the horizon.
    pub below: usize,
    /// Of those above, the ones that lie between two isolines.
    pub between: usize,
}

/// Bound of the tangents: cosines of 1e-9, whose squares are lost beside 1.
pub(super) const FARTHEST: f64 = (1u64 << 30) as f64;

/// Low bits of a key that hold the jump; what is left of a tangent has a relative resolution of 2^-44.
const JUMP_BITS: u32 = 8;
const JUMP_BIAS: i32 = 1 << (JUMP_BITS - 1);

/// One crossing as sorted: position in the high bits, jump in the low ones.
#[inline(always)]
fn key(tangent: f64, jump: i32) -> i64 {
    // Adding zero makes the one zero of the other. Negative numbers sort by their bits turned over.
    let bits = (tangent + 0.0).to_bits() as i64;
    let ordered = bits ^ ((bits >> 63) as u64 >> 1) as i64;
    ordered & !((1 << JUMP_BITS) - 1) | i64::from(jump + JUMP_BIAS)
}

/// Tangent and jump of a sorted crossing.
#[inline(always)]
pub(super) fn crossing(key: i64) -> (f64, i32) {
    let mask = (1i64 << JUMP_BITS) - 1;
    let ordered = key & !mask;
    let bits = ordered ^ ((ordered >> 63) as u64 >> 1) as i64;
    (f64::from_bits(bits as u64), (key & mask) as i32 - JUMP_BIAS)
}

impl Crossings {
    /// Crosses every contour above the horizon with the isolines.
    pub(in crate::visibility) fn collect(
        &mut self,
        meridians: &Meridians,
        frame: MeridianFrame,
        candidates: &Candidates,
        contours: &Contours,
        position: DVec3,
    ) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.collect_avx2(meridians, frame, candidates, contours, position) };
        }
        self.collect_inline(meridians, frame, candidates, contours, position);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn collect_avx2(
        &mut self,
        meridians: &Meridians,
        frame: MeridianFrame,
        candidates: &Candidates,
        contours: &Contours,
        position: DVec3,
    ) {
        self.collect_inline(meridians, frame, candidates, contours, position);
    }

    #[inline(always)]
    fn collect_inline(
        &mut self,
        meridians: &Meridians,
        frame: MeridianFrame,
        candidates: &Candidates,
        contours: &Contours,
        position: DVec3,
    ) {
        self.vertices.fill(candidates, position, frame, meridians.len());
        self.choose(candidates, contours);
        self.pieces.clear();
        self.starts.clear();
        self.starts.resize(meridians.len() + 1, 0);
        for at in 0..self.cut.len() {
            self.cut_at_horizon(self.cut[at], meridians, frame, candidates, position);
        }
        self.pieces(frame, candidates, position);
        self.bucket(meridians);
    }

    /// Keeps the contours that cross isolines.
    #[inline(always)]
    fn choose(&mut self, candidates: &Candidates, contours: &Contours) {
        let (edges, places) = (candidates.edges(), &*self.vertices.places);
        let contours = contours.edges();
        self.chords.resize(contours.len() + 1, Chord::default());
        self.cut.clear();
        let (mut count, mut below) = (0, 0);
        for contour in contours {
            let edge = &edges[contour.edge as usize];
            let [a, b] = [edge.a, edge.b].map(|vertex| places[vertex as usize]);
            let chord = Chord { a: edge.a, b: edge.b, jump: contour.jump };
            // All are written, those that cross stay: which they are is hard to predict.
            self.chords[count] = chord;
            count += usize::from((a != b) & (a >= 0) & (b >= 0));
            below += usize::from((a < 0) & (b < 0));
            if (a ^ b) < 0 {
                self.cut.push(chord);
            }
        }
        self.chords.truncate(count);
        let above = contours.len() - below;
        self.count = Counts { above, below, between: above - count - self.cut.len() };
    }

    fn cut_at_horizon(
        &mut self,
        Chord { a, b, jump }: Chord,
        meridians: &Meridians,
        frame: MeridianFrame,
        candidates: &Candidates,
        position: DVec3,
    ) {
        let [xa, xb] = [a, b].map(|vertex| candidates.position(vertex));
        let plane = frame.apply(arc_plane(xa - position, xa, xb));
        let [a, b] = [a, b].map(|vertex| self.vertices.get(vertex));
        if let Some([a, b]) = above_horizon(a, b, meridians.len()) {
            let circle = Circles::new(
                plane.to_array().map(|x| [x]),
                [[a.east], [b.east]],
                [[a.up], [b.up]],
                [[a.north], [b.north]],
                [a.place < b.place],
            );
            self.push(circle.get(0), [a.place, b.place], jump);
        }
    }

    /// The circles of all chords, four at a time.
    #[inline(always)]
    fn pieces(&mut self, frame: MeridianFrame, candidates: &Candidates, position: DVec3) {
        const LANES: usize = 4;
        let chords = std::mem::take(&mut self.chords);
        let [x, y, z] = candidates.coordinates();
        for chunk in chords.chunks(LANES) {
            // The last lanes repeat the last chord.
            let chord = |lane: usize| chunk[lane.min(chunk.len() - 1)];
            let from: [usize; LANES] = std::array::from_fn(|lane| chord(lane).a as usize);
            let to: [usize; LANES] = std::array::from_fn(|lane| chord(lane).b as usize);
            let at = |values: &[f32], vertices: [usize; LANES]| vertices.map(|vertex| f64::from(values[vertex]));
            let of = |values: &[f64]| [from, to].map(|vertices| vertices.map(|vertex| values[vertex]));
            let places = [from, to].map(|vertices| vertices.map(|vertex| self.vertices.places[vertex]));
            let (xa, ya, za) = (at(x, from), at(y, from), at(z, from));
            let (xb, yb, zb) = (at(x, to), at(y, to), at(z, to));
            let mut planes = [[0.0; LANES]; 3];
            for lane in 0..LANES {
                let (a, b) = (DVec3::new(xa[lane], ya[lane], za[lane]), DVec3::new(xb[lane], yb[lane], zb[lane]));
                let plane = frame.apply(arc_plane(a - position, a, b));
                (planes[0][lane], planes[1][lane], planes[2][lane]) = (plane.x, plane.y, plane.z);
            }
            let rising = std::array::from_fn(|lane| places[0][lane] < places[1][lane]);
            let circles =
                Circles::new(planes, of(&self.vertices.east), of(&self.vertices.up), of(&self.vertices.north), rising);
            for (lane, chord) in chunk.iter().enumerate() {
                self.push(circles.get(lane), [places[0][lane], places[1][lane]], chord.jump);
            }
        }
        self.chords = chords;
    }

    #[inline(always)]
    fn push(&mut self, [sine, cosine, least, most]: [f64; 4], [a, b]: [i32; 2], jump: i32) {
        let (lines, sense) = crossed(a, b);
        let Range { start: first, end: last } = lines;
        let mut left = if first < last { sense * jump } else { 0 };
        while left != 0 {
            let jump = left.clamp(-JUMP_BIAS, JUMP_BIAS - 1);
            left -= jump;
            self.pieces.push(Piece { first, last, jump, sine, cosine, least, most });
            // Differences now, counts after the running sum in `bucket`.
            self.starts[first as usize] = self.starts[first as usize].wrapping_add(1);
            self.starts[last as usize] = self.starts[last as usize].wrapping_sub(1);
        }
    }

    /// Sorts the crossings of all pieces into their isolines.
    #[inline(always)]
    fn bucket(&mut self, meridians: &Meridians) {
        let (mut running, mut total) = (0u32, 0u32);
        for start in &mut self.starts {
            running = running.wrapping_add(*start);
            *start = total;
            total += running;
        }
        self.next.clear();
        self.next.extend_from_slice(&self.starts);
        if self.keys.len() < total as usize {
            self.keys.resize(total as usize, 0);
        }
        let (cos, sin) = (&*meridians.cos, &*meridians.sin);
        for piece in &self.pieces {
            let lines = piece.first as usize..piece.last as usize;
            let places = self.next[lines.clone()].iter_mut();
            for (next, (cos, sin)) in places.zip(cos[lines.clone()].iter().zip(&sin[lines])) {
                let tangent = (piece.sine * sin + piece.cosine * cos).max(piece.least).min(piece.most);
                self.keys[*next as usize] = key(tangent, piece.jump);
                *next += 1;
            }
        }
        for line in 0..meridians.len() {
            let range = self.starts[line] as usize..self.starts[line + 1] as usize;
            if range.len() > 1 {
                self.keys[range].sort_unstable();
            }
        }
    }

    /// Sorted crossings of one isoline; take each apart with [`crossing`].
    pub(super) fn along(&self, line: usize) -> &[i64] {
        &self.keys[self.starts[line] as usize..self.starts[line + 1] as usize]
    }

    /// What became of the contours.
    pub(in crate::visibility) fn counts(&self) -> Counts {
        self.count
    }
}

/// The great circles of N arcs side by side.
struct Circles<const N: usize> {
    sine: [f64; N],
    cosine: [f64; N],
    least: [f64; N],
    most: [f64; N],
}

impl<const N: usize> Circles<N> {
    /// From the planes' normals, the ends in the chart, and whether the longitude rises from
    /// the first end to the second.
    #[inline(always)]
    fn new(
        [x, y, z]: [[f64; N]; 3],
        east: [[f64; N]; 2],
        up: [[f64; N]; 2],
        north: [[f64; N]; 2],
        rising: [bool; N],
    ) -> Self {
        let mut circles = Self { sine: [0.0; N], cosine: [0.0; N], least: [0.0; N], most: [0.0; N] };
        for i in 0..N {
            // The longitude rises if the pole z is to the left. Of circles through the poles, to rounding, it is known as well.
            let steep = z[i].abs().max(1e-200 * (x[i].abs() + y[i].abs()));
            let scale = if rising[i] { -1.0 / steep } else { 1.0 / steep };
            let (sine, cosine) = (y[i] * scale, x[i] * scale);
            // The latitude's derivative at either end, by longitude: between different signs lies an extremum.
            let ascends = [0, 1].map(|end| sine * east[end][i] - cosine * up[end][i] > 0.0);
            let descends = [0, 1].map(|end| sine * east[end][i] - cosine * up[end][i] < 0.0);
            let (early, late) = if rising[i] { (0, 1) } else { (1, 0) };
            let peak = (sine * sine + cosine * cosine).sqrt();
            let tangents =
                [0, 1].map(|end| north[end][i] / (east[end][i] * east[end][i] + up[end][i] * up[end][i]).sqrt());
            let (low, high) = (tangents[0].min(tangents[1]), tangents[0].max(tangents[1]));
            let high = if ascends[early] & descends[late] { high.max(peak) } else { high };
            let low = if descends[early] & ascends[late] { low.min(-peak) } else { low };
            circles.sine[i] = sine;
            circles.cosine[i] = cosine;
            circles.least[i] = low.max(-FARTHEST).min(FARTHEST);
            circles.most[i] = high.max(-FARTHEST).min(FARTHEST);
        }
        circles
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> [f64; 4] {
        [self.sine[lane], self.cosine[lane], self.least[lane], self.most[lane]]
    }
}
