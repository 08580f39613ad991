use std::cmp::Ordering;
use std::ops::Range;

use glam::DVec3;

use super::Meridians;
use crate::visibility::crossings::{Arcs, LANES};

/// The isolines that an arc crosses from one place to another: so many from the first on, around the sphere.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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

    /// All isolines that any way between these places crosses, going on to count after a whole turn.
    #[inline(always)]
    pub(super) fn reach(a: usize, b: usize, lines: usize) -> Range<usize> {
        let ahead = if b >= a { b - a } else { b + lines - a };
        // Of two ways of the same length both are looked at.
        match (2 * ahead).cmp(&lines) {
            Ordering::Less => a..a + ahead,
            Ordering::Equal => 0..lines,
            Ordering::Greater => b..b + lines - ahead,
        }
    }

    /// The isolines, in at most two runs.
    #[inline(always)]
    pub(super) fn runs(self, lines: usize) -> [Range<usize>; 2] {
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

/// A great circle where it crosses isolines: `tangent = sine sin u + cosine cos u`, within bounds.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::visibility) struct Piece {
    pub(super) way: Way,
    /// Change of W along the isolines.
    pub(super) jump: i32,
    pub(super) sine: f64,
    pub(super) cosine: f64,
    pub(super) least: f64,
    pub(super) most: f64,
}

/// The great circles of arcs side by side.
pub(super) struct Circles {
    ways: [Way; LANES],
    sine: [f64; LANES],
    cosine: [f64; LANES],
    least: [f64; LANES],
    most: [f64; LANES],
}

impl Circles {
    #[inline(always)]
    #[expect(clippy::manual_clamp, reason = "bounds that are no numbers, of zero directions, become the widest")]
    pub(super) fn new(arcs: &Arcs, lines: usize) -> Self {
        let Arcs { planes: [x, y, z], ends, places, .. } = arcs;
        let mut ways = [Way { first: 0, count: 0, rises: false }; LANES];
        for i in 0..LANES {
            ways[i] = Way::new(places[0][i], places[1][i], lines as i32, || DVec3::new(x[i], y[i], z[i]));
        }
        let zero = [0.0; LANES];
        let mut circles = Self { ways, sine: zero, cosine: zero, least: zero, most: zero };
        for i in 0..LANES {
            // The longitude rises if the pole z is to the left. Of circles through the poles, to rounding, it is known as well.
            let steep = z[i].abs().max(1e-200 * (x[i].abs() + y[i].abs()));
            let scale = if ways[i].rises { -1.0 / steep } else { 1.0 / steep };
            let (sine, cosine) = (y[i] * scale, x[i] * scale);
            let tangent = |[east, up, north]: &[[f64; LANES]; 3]| north[i] / (east[i] * east[i] + up[i] * up[i]).sqrt();
            let tangents = [tangent(&ends[0]), tangent(&ends[1])];
            let (low, high) = (tangents[0].min(tangents[1]), tangents[0].max(tangents[1]));
            // The latitude's derivatives by longitude at the ends: between different signs lies an extremum.
            let climb = |[east, up, _]: &[[f64; LANES]; 3]| sine * east[i] - cosine * up[i];
            let climbs = [climb(&ends[0]), climb(&ends[1])];
            let (early, late) = if ways[i].rises { (climbs[0], climbs[1]) } else { (climbs[1], climbs[0]) };
            let peak = (sine * sine + cosine * cosine).sqrt();
            let high = if (early > 0.0) & (late < 0.0) { high.max(peak) } else { high };
            let low = if (early < 0.0) & (late > 0.0) { low.min(-peak) } else { low };
            circles.sine[i] = sine;
            circles.cosine[i] = cosine;
            circles.least[i] = low.max(-Meridians::POLE).min(Meridians::POLE);
            circles.most[i] = high.max(-Meridians::POLE).min(Meridians::POLE);
        }
        circles
    }

    #[inline(always)]
    pub(super) fn way(&self, lane: usize) -> Way {
        self.ways[lane]
    }

    #[inline(always)]
    pub(super) fn piece(&self, lane: usize, jump: i32) -> Piece {
        let (sine, cosine) = (self.sine[lane], self.cosine[lane]);
        Piece { way: self.ways[lane], jump, sine, cosine, least: self.least[lane], most: self.most[lane] }
    }
}
