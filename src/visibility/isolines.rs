use glam::DVec3;

use crate::{Error, Result};

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
    ratios: Vec<f64>,
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
        let ratios = (0..count).map(|i| Self::position(count, i)).map(|u| u / (1.0 - u.abs())).collect();
        Ok(Self { ratios })
    }

    fn position(count: usize, line: usize) -> f64 {
        (2.0 * line as f64 + 1.0 - count as f64) / count as f64
    }

    /// Number of isolines N.
    pub fn len(&self) -> usize {
        self.ratios.len()
    }

    /// Never: there are at least two isolines.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// u of isoline `line`.
    pub fn u(&self, line: usize) -> f64 {
        Self::position(self.len(), line)
    }

    /// r = u / (1 - |u|) of every isoline.
    pub(super) fn ratios(&self) -> &[f64] {
        &self.ratios
    }

    /// How many isolines have a smaller u than a direction with x and |y| + |z| = `m`.
    ///
    /// This integer *is* a vertex's position between the isolines for everything that follows: all arcs that share the
    /// vertex use the same one, so that the jumps along every isoline add up whatever the rounding.
    pub(super) fn below(&self, x: f64, m: f64) -> u32 {
        let n = self.len() as f64;
        let u = x / (x.abs() + m);
        // Float-to-integer casts saturate and map NaN (a zero direction) to zero.
        let below = ((u + 1.0) * n * 0.5 - 0.5).ceil() as u32;
        let half = (self.len() / 2) as u32;
        if x < 0.0 { below.min(half) } else { below.clamp(half, self.len() as u32) }
    }
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

    /// World to chart.
    pub fn apply(self, w: DVec3) -> DVec3 {
        turn(cycle(w, self.axis()), self.turns)
    }

    /// Chart to world.
    pub fn invert(self, w: DVec3) -> DVec3 {
        cycle(turn(w, (4 - self.turns) % 4), (3 - self.axis()) % 3)
    }

    /// The quadrant, before the quarter turns, that the chart's quadrant `quadrant` is.
    pub fn quadrant(self, quadrant: usize) -> usize {
        (quadrant + self.turns as usize) % 4
    }
}

/// The coordinates from the one numbered `axis` on, cyclically.
pub(crate) fn cycle(w: DVec3, axis: usize) -> DVec3 {
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
            assert_eq!(isolines.below(-1e-300, 1.0), count as u32 / 2);
            assert_eq!(isolines.below(0.0, 0.0), count as u32 / 2);
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
                let w = DVec3::new(1.0, 2.0, 3.0);
                assert_eq!(frame.invert(frame.apply(w)), w);
                assert_eq!(frame.apply(cycle(corner, (3 - axis as usize) % 3)), DVec3::Z);
                for q in 0..4 {
                    let ends = |q: usize| [CORNERS[q], CORNERS[(q + 1) % 4]];
                    let world = ends(frame.quadrant(q)).map(|c| cycle(c, (3 - axis as usize) % 3));
                    assert_eq!(ends(q).map(|c| frame.invert(c)), world);
                }
            }
        }
    }

    #[test]
    fn the_spine_is_the_highest_corner_and_the_lines_cross_the_horizon_steeply() {
        for k in 0..1000 {
            let k = k as f64;
            let n = DVec3::new((k * 0.7).sin(), (k * 1.3).cos(), (k * 2.1).sin()).normalize();
            let turned = Frame::facing(Some(n), 0).apply(n);
            assert!(turned.z >= turned.y.abs());
            let steepness = |n: DVec3| (n.z.abs() - n.y.abs()).abs() / n.x.abs();
            assert!((0..3).all(|axis| steepness(turned) >= steepness(cycle(n, axis))));
        }
    }
}
