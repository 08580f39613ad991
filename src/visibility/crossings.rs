use std::ops::Range;

use dual_bvh::{CandidateEdge, Candidates, Contours, Part, Tally};
use glam::DVec3;

use super::chart::{Chart, Outlook};
use super::contours::arc_plane;
use super::vertices::{BELOW, fill};

/// A contour that may cross isolines.
#[derive(Clone, Copy, Debug)]
struct Chord {
    a: u32,
    b: u32,
    jump: i32,
}

/// Arcs side by side.
pub(super) const LANES: usize = 8;

/// A few arcs in the axes of a chart.
pub(super) struct Arcs {
    /// Normals a x b of their planes, by component.
    pub(super) planes: [[f64; LANES]; 3],
    /// Directions of the ends, not normalised, by component.
    pub(super) ends: [[[f64; LANES]; 3]; 2],
    pub(super) places: [[i32; LANES]; 2],
    /// Change of W on the way from the left of an arc to its right.
    pub(super) jumps: [i32; LANES],
    /// Only so many; other lanes repeat the last.
    pub(super) count: usize,
}

/// What arcs are cut into.
#[derive(Clone, Debug, Default)]
pub(super) struct Pieces<P> {
    pieces: Vec<P>,
    /// Isolines outside of this range are not crossed.
    lines: Range<usize>,
    /// Number of crossings before each isoline of the range, with an end mark; zero outside. Differences at first.
    starts: Vec<u32>,
    /// What [`Chart::bases`] are made of, if any of it is not zero.
    changes: Vec<i32>,
}

/// All crossings of one receiver's contours in some groups with the isolines.
#[derive(Clone, Debug, Default)]
pub(super) struct Crossings<P> {
    /// Of the candidates' vertices.
    places: Vec<i32>,
    chords: Vec<Chord>,
    pieces: Pieces<P>,
    next: Vec<u32>,
    keys: Vec<i64>,
    /// W at the start of every isoline less W where it was counted; empty if that is zero.
    bases: Vec<i32>,
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
    /// Groups of bodies whose contours were not looked at because nothing of them can be seen.
    pub hidden: usize,
    /// Groups of bodies whose contours were not looked at because they lie below the horizon.
    pub sunken: usize,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.above += other.above;
        self.below += other.below;
        self.between += other.between;
        self.hidden += other.hidden;
        self.sunken += other.sunken;
    }
}

/// Low bits of a key that hold the jump; what is left of a position has a relative resolution of 2^-44.
const JUMP_BITS: u32 = 8;
const JUMP_BIAS: i32 = 1 << (JUMP_BITS - 1);

/// One crossing as sorted: position in the high bits, jump in the low ones.
#[inline(always)]
fn key(position: f64, jump: i32) -> i64 {
    // Adding zero makes the one zero of the other. Negative numbers sort by their bits turned over.
    let bits = (position + 0.0).to_bits() as i64;
    let ordered = bits ^ ((bits >> 63) as u64 >> 1) as i64;
    ordered & !((1 << JUMP_BITS) - 1) | i64::from(jump + JUMP_BIAS)
}

/// Position and jump of a sorted crossing.
#[inline(always)]
pub(super) fn crossing(key: i64) -> (f64, i32) {
    let mask = (1i64 << JUMP_BITS) - 1;
    let ordered = key & !mask;
    let bits = ordered ^ ((ordered >> 63) as u64 >> 1) as i64;
    (f64::from_bits(bits as u64), (key & mask) as i32 - JUMP_BIAS)
}

impl<P> Pieces<P> {
    /// Adds a piece with this jump that crosses the isolines in these runs; large jumps make several pieces.
    #[inline(always)]
    pub(super) fn push(&mut self, jump: i32, runs: [Range<usize>; 2], piece: impl Fn(i32) -> P) {
        let mut left = jump;
        while left != 0 {
            let jump = left.clamp(-JUMP_BIAS, JUMP_BIAS - 1);
            left -= jump;
            self.pieces.push(piece(jump));
            // Differences now, counts after the running sum in `bucket`.
            for run in &runs {
                if !run.is_empty() {
                    self.starts[run.start] = self.starts[run.start].wrapping_add(1);
                    self.starts[run.end] = self.starts[run.end].wrapping_sub(1);
                    self.lines = self.lines.start.min(run.start)..self.lines.end.max(run.end);
                }
            }
        }
    }

    /// Notes a change for [`Chart::bases`], one of `count`.
    pub(super) fn change(&mut self, at: usize, count: usize, jump: i32) {
        self.changes.resize(count, 0);
        self.changes[at] += jump;
    }

    fn clear(&mut self, lines: usize) {
        self.pieces.clear();
        self.changes.clear();
        if self.starts.len() == lines + 1 {
            self.starts[self.lines.start..=self.lines.end].fill(0);
        } else {
            self.starts.clear();
            self.starts.resize(lines + 1, 0);
        }
        self.lines = lines..0;
    }
}

impl<P: Copy> Crossings<P> {
    /// Forgets all contours.
    pub(super) fn clear(&mut self) {
        self.chords.clear();
        self.counts = Counts::default();
    }

    /// Adds the contours of a group that may cross isolines; with `between`, those that lie between two of them, too.
    pub(super) fn choose<C: Chart<Piece = P>>(
        &mut self,
        outlook: Outlook<C>,
        candidates: &Candidates,
        part: &Part,
        excluded: &[u32],
        contours: &mut Contours,
        between: bool,
    ) {
        self.place(outlook, candidates, part);
        self.add(outlook.position, candidates, part, excluded, contours, between);
    }

    /// Places the vertices of a group between the isolines.
    fn place<C: Chart<Piece = P>>(&mut self, outlook: Outlook<C>, candidates: &Candidates, part: &Part) {
        #[cfg(target_arch = "x86_64")]
        if dual_bvh::has_avx512() {
            // SAFETY: the processor has the features.
            return unsafe { self.place_avx512(outlook, candidates, part) };
        } else if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.place_avx2(outlook, candidates, part) };
        }
        self.place_inline(outlook, candidates, part);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq")]
    fn place_avx512<C: Chart<Piece = P>>(&mut self, outlook: Outlook<C>, candidates: &Candidates, part: &Part) {
        self.place_inline(outlook, candidates, part);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    pub(super) fn place_avx2<C: Chart<Piece = P>>(
        &mut self,
        outlook: Outlook<C>,
        candidates: &Candidates,
        part: &Part,
    ) {
        self.place_inline(outlook, candidates, part);
    }

    #[inline(always)]
    pub(super) fn place_inline<C: Chart<Piece = P>>(
        &mut self,
        outlook: Outlook<C>,
        candidates: &Candidates,
        part: &Part,
    ) {
        let vertices = part.vertices.clone();
        if self.places.len() < vertices.end {
            self.places.resize(vertices.end, 0);
        }
        let coordinates = candidates.coordinates().map(|lanes| &lanes[vertices.clone()]);
        fill(&mut self.places[vertices.clone()], coordinates, outlook);
    }

    /// Adds the contours of a group whose vertices have been placed.
    pub(super) fn add(
        &mut self,
        position: DVec3,
        candidates: &Candidates,
        part: &Part,
        excluded: &[u32],
        contours: &mut Contours,
        between: bool,
    ) {
        let tally = candidates.contours_apart(part, &self.places, between, position, excluded, contours);
        let edges = candidates.edges();
        self.chords.extend(contours.edges().iter().map(|contour| {
            let CandidateEdge { a, b } = edges[contour.edge as usize];
            Chord { a, b, jump: contour.jump }
        }));
        let Tally { contours, inside: above, apart } = tally;
        self.counts += Counts { above, below: contours - above, between: above - apart, ..Counts::default() };
    }

    /// Drops the contours that cross no open isoline; `open` has the number of open ones before each, twice around.
    pub(super) fn drop_covered<C: Chart<Piece = P>>(&mut self, open: &[u32], chart: &C) {
        let (places, chords) = (&*self.places, &mut self.chords);
        let mut count = 0;
        for i in 0..chords.len() {
            let chord = chords[i];
            let [a, b] = [chord.a, chord.b].map(|vertex| places[vertex as usize] & !BELOW);
            let reach = chart.reach(a, b);
            chords[count] = chord;
            count += usize::from(open[reach.start] != open[reach.end]);
        }
        chords.truncate(count);
    }

    /// Crosses the contours that were chosen with the isolines.
    pub(super) fn cross<C: Chart<Piece = P>>(&mut self, outlook: Outlook<C>, candidates: &Candidates) {
        #[cfg(target_arch = "x86_64")]
        if dual_bvh::has_avx512() {
            // SAFETY: the processor has the features.
            return unsafe { self.cross_avx512(outlook, candidates) };
        } else if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature.
            return unsafe { self.cross_avx2(outlook, candidates) };
        }
        self.cross_inline(outlook, candidates);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq")]
    fn cross_avx512<C: Chart<Piece = P>>(&mut self, outlook: Outlook<C>, candidates: &Candidates) {
        self.cross_inline(outlook, candidates);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    pub(super) fn cross_avx2<C: Chart<Piece = P>>(&mut self, outlook: Outlook<C>, candidates: &Candidates) {
        self.cross_inline(outlook, candidates);
    }

    #[inline(always)]
    pub(super) fn cross_inline<C: Chart<Piece = P>>(&mut self, outlook: Outlook<C>, candidates: &Candidates) {
        self.pieces.clear(outlook.chart.lines());
        self.cut(outlook, candidates);
        if self.pieces.lines.is_empty() {
            self.pieces.lines = 0..0;
        }
        self.bases.clear();
        if !self.pieces.changes.is_empty() {
            C::bases(outlook, &self.pieces.changes, &mut self.bases);
        }
        self.bucket(outlook.chart);
    }

    /// The pieces of all chords, a few at a time.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "lane by lane, over several arrays")]
    fn cut<C: Chart<Piece = P>>(&mut self, outlook: Outlook<C>, candidates: &Candidates) {
        let [x, y, z] = candidates.coordinates();
        for chunk in 0..self.chords.len().div_ceil(LANES) {
            let chords = &self.chords[LANES * chunk..];
            let mut corners = [[[0.0; LANES]; 3]; 2];
            let mut arcs = Arcs {
                planes: [[0.0; LANES]; 3],
                ends: [[[0.0; LANES]; 3]; 2],
                places: [[0; LANES]; 2],
                jumps: [0; LANES],
                count: chords.len().min(LANES),
            };
            for lane in 0..LANES {
                // The last lanes repeat the last chord.
                let Chord { a, b, jump } = chords[lane.min(chords.len() - 1)];
                arcs.jumps[lane] = jump;
                for (end, vertex) in [a as usize, b as usize].into_iter().enumerate() {
                    arcs.places[end][lane] = self.places[vertex] & !BELOW;
                    for (axis, values) in [x, y, z].into_iter().enumerate() {
                        corners[end][axis][lane] = f64::from(values[vertex]);
                    }
                }
            }
            for lane in 0..LANES {
                let at = |end: usize| DVec3::new(corners[end][0][lane], corners[end][1][lane], corners[end][2][lane]);
                let directions = [at(0) - outlook.position, at(1) - outlook.position];
                let plane = outlook.apply(arc_plane(directions[0], at(0), at(1)));
                (arcs.planes[0][lane], arcs.planes[1][lane], arcs.planes[2][lane]) = (plane.x, plane.y, plane.z);
                for (end, &direction) in directions.iter().enumerate() {
                    let w = outlook.apply(direction);
                    (arcs.ends[end][0][lane], arcs.ends[end][1][lane], arcs.ends[end][2][lane]) = (w.x, w.y, w.z);
                }
            }
            outlook.chart.cut(&arcs, &mut self.pieces);
        }
    }

    /// Puts the crossings of all pieces to their isolines.
    #[inline(always)]
    fn bucket<C: Chart<Piece = P>>(&mut self, chart: &C) {
        let Pieces { pieces, lines, starts, .. } = &mut self.pieces;
        let range = lines.start..lines.end + 1;
        let (mut running, mut total) = (0u32, 0u32);
        for start in &mut starts[range.clone()] {
            running = running.wrapping_add(*start);
            *start = total;
            total += running;
        }
        if self.next.len() < range.end {
            self.next.resize(starts.len(), 0);
        }
        self.next[range.clone()].copy_from_slice(&starts[range]);
        if self.keys.len() < total as usize {
            self.keys.resize(total as usize, 0);
        }
        for piece in pieces {
            for run in chart.runs(piece) {
                let places = self.next[run.clone()].iter_mut();
                let (positions, jump) = chart.cross(piece, run);
                for (next, position) in places.zip(positions) {
                    self.keys[*next as usize] = key(position, jump);
                    *next += 1;
                }
            }
        }
    }

    /// Isolines outside of this range are not crossed.
    pub(super) fn lines(&self) -> Range<usize> {
        self.pieces.lines.clone()
    }

    /// W at the start of an isoline less W where it is counted.
    #[inline(always)]
    pub(super) fn base(&self, line: usize) -> i32 {
        self.bases.get(line).copied().unwrap_or_default()
    }

    /// Whether W is the same at the start of all isolines.
    pub(super) fn start_alike(&self) -> bool {
        self.bases.is_empty()
    }

    /// The crossings of one isoline, which are now sorted; take each apart with [`crossing`].
    #[inline(always)]
    pub(super) fn sorted(&mut self, line: usize) -> &[i64] {
        let Pieces { lines, starts, .. } = &self.pieces;
        if !lines.contains(&line) {
            return &[];
        }
        let keys = &mut self.keys[starts[line] as usize..starts[line + 1] as usize];
        if keys.len() > 1 {
            keys.sort_unstable();
        }
        keys
    }

    /// What became of the contours.
    pub(super) fn counts(&self) -> Counts {
        self.counts
    }
}
