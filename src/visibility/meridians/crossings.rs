use std::cmp::Ordering;
use std::ops::Range;

use dual_bvh::{Candidates, Contours, Part};
use glam::DVec3;

use super::vertices::{BELOW, fill};
use super::{MeridianFrame, Meridians};
use crate::visibility::contours::arc_plane;

/// The isolines that an arc crosses from one place to another: so many from the first on, around the sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::visibility) struct Way {
    first: u32,
    count: u32,
    /// Whether the longitude rises on the way.
    rises: bool,
}

impl Way {
    /// The way between ends with these places, on an arc whose plane has the normal a x b in the chart: the shorter way, for
    /// arcs are below half a turn, and so is the longitude on them. The plane decides if both are as short, alike for a contour
    /// and for the faces along it.
    #[inline(always)]
    pub(in crate::visibility) fn new(a: i32, b: i32, lines: i32, plane: impl FnOnce() -> DVec3) -> Self {
        let ahead = if b >= a { b - a } else { b - a + lines };
        let rises = if 2 * ahead == lines { plane().z >= 0.0 } else { 2 * ahead < lines };
        let (first, count) = if rises { (a, ahead) } else { (b, if ahead == 0 { 0 } else { lines - ahead }) };
        Self { first: first as u32, count: count as u32, rises }
    }

    /// The isolines, in at most two runs.
    #[inline(always)]
    fn runs(self, lines: usize) -> [Range<usize>; 2] {
        let (first, end) = (self.first as usize, (self.first + self.count) as usize);
        [first..end.min(lines), 0..end.max(lines) - lines]
    }

    /// Whether it crosses an isoline.
    pub(in crate::visibility) fn crosses(self, line: usize, lines: usize) -> bool {
        self.runs(lines).iter().any(|run| run.contains(&line))
    }

    /// +1 if isolines pass the arc from its left to its right, otherwise -1: where the longitude rises, the left of an arc is
    /// on the side of the pole z, where isolines end.
    #[inline(always)]
    pub(in crate::visibility) fn sense(self) -> i32 {
        if self.rises { -1 } else { 1 }
    }
}

/// A contour that crosses isolines.
#[derive(Clone, Copy, Debug, Default)]
struct Chord {
    a: u32,
    b: u32,
    jump: i32,
}

/// A great circle where it crosses isolines: `tangent = sine sin u + cosine cos u`, within bounds.
#[derive(Clone, Copy, Debug)]
struct Piece {
    way: Way,
    /// Change of W along the isolines.
    jump: i32,
    sine: f64,
    cosine: f64,
    least: f64,
    most: f64,
}

/// All crossings of one receiver's contours in one group with the isolines.
#[derive(Clone, Debug, Default)]
pub(in crate::visibility) struct Crossings {
    /// Of the candidates' vertices.
    places: Vec<i32>,
    chords: Vec<Chord>,
    pieces: Vec<Piece>,
    /// Isolines outside of this range are not crossed.
    lines: Range<usize>,
    /// Number of crossings before each isoline of the range, with an end mark; zero outside.
    starts: Vec<u32>,
    next: Vec<u32>,
    keys: Vec<i64>,
    counts: Counts,
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
    /// Groups of bodies whose contours were not looked at because nothing of them can be seen along the isolines.
    pub hidden: usize,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.above += other.above;
        self.below += other.below;
        self.between += other.between;
        self.hidden += other.hidden;
    }
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

/// Where a receiver looks from, and how.
#[derive(Clone, Copy)]
pub(in crate::visibility) struct Outlook<'a> {
    pub(in crate::visibility) meridians: &'a Meridians,
    pub(in crate::visibility) frame: MeridianFrame,
    pub(in crate::visibility) position: DVec3,
    pub(in crate::visibility) normal: Option<DVec3>,
}

impl Crossings {
    /// Forgets all contours.
    pub(in crate::visibility) fn clear(&mut self) {
        self.chords.clear();
        self.counts = Counts::default();
    }

    /// Places the contours of a group between the isolines and adds those that cross some; with `between`, the others too.
    pub(in crate::visibility) fn choose(
        &mut self,
        outlook: Outlook,
        candidates: &Candidates,
        part: &Part,
        contours: &Contours,
        between: bool,
    ) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.choose_avx2(outlook, candidates, part, contours, between) };
        }
        self.choose_inline(outlook, candidates, part, contours, between);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn choose_avx2(
        &mut self,
        outlook: Outlook,
        candidates: &Candidates,
        part: &Part,
        contours: &Contours,
        between: bool,
    ) {
        self.choose_inline(outlook, candidates, part, contours, between);
    }

    #[inline(always)]
    pub(in crate::visibility) fn choose_inline(
        &mut self,
        outlook: Outlook,
        candidates: &Candidates,
        part: &Part,
        contours: &Contours,
        between: bool,
    ) {
        fill(&mut self.places, candidates, part, contours, outlook);
        self.keep(candidates, contours, between);
    }

    /// Drops the contours that cross no open isoline; `open` has the number of open ones before each, twice around.
    pub(in crate::visibility) fn drop_covered(&mut self, open: &[u32], lines: usize) {
        let (places, chords) = (&*self.places, &mut self.chords);
        let mut count = 0;
        for i in 0..chords.len() {
            let chord = chords[i];
            let [a, b] = [chord.a, chord.b].map(|vertex| (places[vertex as usize] & !BELOW) as usize);
            let ahead = if b >= a { b - a } else { b + lines - a };
            // Of two ways of the same length both are looked at.
            let (first, last) = match (2 * ahead).cmp(&lines) {
                Ordering::Less => (a, a + ahead),
                Ordering::Equal => (0, lines),
                Ordering::Greater => (b, b + lines - ahead),
            };
            chords[count] = chord;
            count += usize::from(open[first] != open[last]);
        }
        chords.truncate(count);
    }

    /// Crosses the contours that were chosen with the isolines.
    pub(in crate::visibility) fn cross(&mut self, outlook: Outlook, candidates: &Candidates) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.cross_avx2(outlook, candidates) };
        }
        self.cross_inline(outlook, candidates);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn cross_avx2(&mut self, outlook: Outlook, candidates: &Candidates) {
        self.cross_inline(outlook, candidates);
    }

    #[inline(always)]
    pub(in crate::visibility) fn cross_inline(&mut self, outlook: Outlook, candidates: &Candidates) {
        let lines = outlook.meridians.len();
        self.pieces.clear();
        if self.starts.len() == lines + 1 {
            self.starts[self.lines.start..=self.lines.end].fill(0);
        } else {
            self.starts.clear();
            self.starts.resize(lines + 1, 0);
            self.next.resize(lines + 1, 0);
        }
        self.lines = lines..0;
        self.circles(outlook, candidates);
        if self.lines.is_empty() {
            self.lines = 0..0;
        }
        self.bucket(outlook.meridians);
    }

    /// Keeps the contours that cross isolines above the horizon.
    #[inline(always)]
    fn keep(&mut self, candidates: &Candidates, contours: &Contours, between: bool) {
        let (edges, contours) = (candidates.edges(), contours.edges());
        let places = &*self.places;
        let old = self.chords.len();
        self.chords.resize(old + contours.len() + 1, Chord::default());
        let chords = &mut self.chords[old..];
        let (mut count, mut below, mut crossing) = (0, 0, 0);
        for contour in contours {
            let edge = &edges[contour.edge as usize];
            let (a, b) = (places[edge.a as usize], places[edge.b as usize]);
            let is_below = a & b & BELOW != 0;
            // All are written, those that cross stay: which they are is hard to predict.
            chords[count] = Chord { a: edge.a, b: edge.b, jump: contour.jump };
            let crosses = ((a ^ b) & !BELOW != 0) & !is_below;
            count += usize::from(crosses | between);
            crossing += usize::from(crosses);
            below += usize::from(is_below);
        }
        self.chords.truncate(old + count);
        let above = contours.len() - below;
        self.counts += Counts { above, below, between: above - crossing, hidden: 0 };
    }

    /// The circles of all chords, four at a time.
    #[inline(always)]
    fn circles(&mut self, Outlook { meridians, frame, position, .. }: Outlook, candidates: &Candidates) {
        const LANES: usize = 4;
        let lines = meridians.len();
        let [x, y, z] = candidates.coordinates();
        for chunk in 0..self.chords.len().div_ceil(LANES) {
            let chords = &self.chords[LANES * chunk..];
            let (mut planes, mut ends) = ([[0.0; LANES]; 3], [[[0.0; LANES]; 3]; 2]);
            let mut ways = [Way { first: 0, count: 0, rises: false }; LANES];
            let mut corners = [[[0.0; LANES]; 3]; 2];
            for lane in 0..LANES {
                // The last lanes repeat the last chord.
                let Chord { a, b, .. } = chords[lane.min(chords.len() - 1)];
                for (end, vertex) in [a as usize, b as usize].into_iter().enumerate() {
                    for (axis, values) in [x, y, z].into_iter().enumerate() {
                        corners[end][axis][lane] = f64::from(values[vertex]);
                    }
                }
            }
            for lane in 0..LANES {
                let at = |end: usize| DVec3::new(corners[end][0][lane], corners[end][1][lane], corners[end][2][lane]);
                let directions = [at(0) - position, at(1) - position];
                let plane = frame.apply(arc_plane(directions[0], at(0), at(1)));
                (planes[0][lane], planes[1][lane], planes[2][lane]) = (plane.x, plane.y, plane.z);
                for (end, &direction) in directions.iter().enumerate() {
                    let w = frame.apply(direction);
                    (ends[end][0][lane], ends[end][1][lane], ends[end][2][lane]) = (w.x, w.y, w.z);
                }
            }
            for lane in 0..LANES {
                let Chord { a, b, .. } = chords[lane.min(chords.len() - 1)];
                let plane = || DVec3::new(planes[0][lane], planes[1][lane], planes[2][lane]);
                let [a, b] = [a, b].map(|vertex| self.places[vertex as usize] & !BELOW);
                ways[lane] = Way::new(a, b, lines as i32, plane);
            }
            let circles = Circles::new(&planes, &ends, &ways);
            for lane in 0..chords.len().min(LANES) {
                let mut left = ways[lane].sense() * chords[lane].jump;
                while left != 0 {
                    let jump = left.clamp(-JUMP_BIAS, JUMP_BIAS - 1);
                    left -= jump;
                    self.pieces.push(circles.piece(lane, ways[lane], jump));
                    // Differences now, counts after the running sum in `bucket`.
                    for run in ways[lane].runs(lines) {
                        if !run.is_empty() {
                            self.starts[run.start] = self.starts[run.start].wrapping_add(1);
                            self.starts[run.end] = self.starts[run.end].wrapping_sub(1);
                            self.lines = self.lines.start.min(run.start)..self.lines.end.max(run.end);
                        }
                    }
                }
            }
        }
    }

    /// Puts the crossings of all pieces to their isolines.
    #[inline(always)]
    fn bucket(&mut self, meridians: &Meridians) {
        let range = self.lines.start..self.lines.end + 1;
        let (mut running, mut total) = (0u32, 0u32);
        for start in &mut self.starts[range.clone()] {
            running = running.wrapping_add(*start);
            *start = total;
            total += running;
        }
        self.next[range.clone()].copy_from_slice(&self.starts[range]);
        if self.keys.len() < total as usize {
            self.keys.resize(total as usize, 0);
        }
        let (cos, sin) = (&*meridians.cos, &*meridians.sin);
        for piece in &self.pieces {
            for run in piece.way.runs(meridians.len()) {
                let places = self.next[run.clone()].iter_mut();
                for (next, (cos, sin)) in places.zip(cos[run.clone()].iter().zip(&sin[run])) {
                    let tangent = (piece.sine * sin + piece.cosine * cos).max(piece.least).min(piece.most);
                    self.keys[*next as usize] = key(tangent, piece.jump);
                    *next += 1;
                }
            }
        }
    }

    /// Isolines outside of this range are not crossed.
    pub(in crate::visibility) fn lines(&self) -> Range<usize> {
        self.lines.clone()
    }

    /// The crossings of one isoline, which are now sorted; take each apart with [`crossing`].
    pub(in crate::visibility) fn sorted(&mut self, line: usize) -> &[i64] {
        if !self.lines.contains(&line) {
            return &[];
        }
        let keys = &mut self.keys[self.starts[line] as usize..self.starts[line + 1] as usize];
        if keys.len() > 1 {
            keys.sort_unstable();
        }
        keys
    }

    /// What became of the contours.
    pub(in crate::visibility) fn counts(&self) -> Counts {
        self.counts
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
    /// From the planes' normals, the directions of the ends, and the ways from the first to the second.
    #[inline(always)]
    #[expect(clippy::manual_clamp, reason = "bounds that are no numbers, of zero directions, become the widest")]
    fn new([x, y, z]: &[[f64; N]; 3], ends: &[[[f64; N]; 3]; 2], ways: &[Way; N]) -> Self {
        let mut circles = Self { sine: [0.0; N], cosine: [0.0; N], least: [0.0; N], most: [0.0; N] };
        for i in 0..N {
            // The longitude rises if the pole z is to the left. Of circles through the poles, to rounding, it is known as well.
            let steep = z[i].abs().max(1e-200 * (x[i].abs() + y[i].abs()));
            let scale = if ways[i].rises { -1.0 / steep } else { 1.0 / steep };
            let (sine, cosine) = (y[i] * scale, x[i] * scale);
            let tangent = |[east, up, north]: &[[f64; N]; 3]| north[i] / (east[i] * east[i] + up[i] * up[i]).sqrt();
            let tangents = [tangent(&ends[0]), tangent(&ends[1])];
            let (low, high) = (tangents[0].min(tangents[1]), tangents[0].max(tangents[1]));
            // The latitude's derivatives by longitude at the ends: between different signs lies an extremum.
            let climb = |[east, up, _]: &[[f64; N]; 3]| sine * east[i] - cosine * up[i];
            let climbs = [climb(&ends[0]), climb(&ends[1])];
            let (early, late) = if ways[i].rises { (climbs[0], climbs[1]) } else { (climbs[1], climbs[0]) };
            let peak = (sine * sine + cosine * cosine).sqrt();
            let high = if (early > 0.0) & (late < 0.0) { high.max(peak) } else { high };
            let low = if (early < 0.0) & (late > 0.0) { low.min(-peak) } else { low };
            circles.sine[i] = sine;
            circles.cosine[i] = cosine;
            circles.least[i] = low.max(-FARTHEST).min(FARTHEST);
            circles.most[i] = high.max(-FARTHEST).min(FARTHEST);
        }
        circles
    }

    #[inline(always)]
    fn piece(&self, lane: usize, way: Way, jump: i32) -> Piece {
        let (sine, cosine) = (self.sine[lane], self.cosine[lane]);
        Piece { way, jump, sine, cosine, least: self.least[lane], most: self.most[lane] }
    }
}
