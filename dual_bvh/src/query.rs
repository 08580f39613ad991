//! The tests of a search, eight lanes at once in single precision.
#![expect(clippy::needless_range_loop, reason = "lane by lane, over several arrays")]

use glam::DVec3;

use crate::Tile;
use crate::node::{FAN, Lanes, Leaf, Node, SLACK, STEPS, WIDTH, up};

/// A tile in single precision.
pub(crate) struct Query {
    /// The centre as the sum of two singles.
    high: [f32; 3],
    low: [f32; 3],
    /// Distances from the centre of which the planes' values must exceed one to be certain: the ball's radius, and that of the box,
    /// along a normal.
    margin: f32,
    half: [f32; 3],
    pub(crate) horizon: Option<Horizon>,
}

pub(crate) struct Horizon {
    normal: [f32; 3],
    half: [f32; 3],
    /// Bound of the normals' absolute components.
    size: [f32; 3],
    margin: f32,
}

impl Query {
    pub(crate) fn new(tile: &Tile<'_>) -> Self {
        let high = tile.center.to_array().map(|x| x as f32);
        let low = (tile.center - DVec3::from_array(high.map(f64::from))).to_array().map(|x| x as f32);
        // What two singles leave of the centre, and what underflows.
        let rest = tile.center.abs().element_sum() / (1u64 << 48) as f64 + 64.0 * f64::from(f32::MIN_POSITIVE);
        let distance = (tile.radius + rest) * (1.0 + SLACK);
        let half = (tile.half + rest) * (1.0 + SLACK);
        let horizon = tile.horizon.map(|(low, high)| {
            let normal = (0.5 * (low + high)).to_array().map(|x| x as f32);
            let middle = DVec3::from_array(normal.map(f64::from));
            let spread = (high - middle).max(middle - low);
            let size = middle.abs() + spread;
            let slack = SLACK * size.element_sum();
            Horizon {
                normal,
                half: spread.to_array().map(|x| up(x * (1.0 + SLACK) + slack)),
                size: size.to_array().map(|x| up(x * (1.0 + SLACK))),
                margin: up(
                    (distance * size.length()).min(half.dot(size)) * (1.0 + SLACK) + f64::from(f32::MIN_POSITIVE)
                ),
            }
        });
        Self { high, low, margin: up(distance), half: half.to_array().map(up), horizon }
    }
}

/// A leaf whose bounds hold a contour, and what its edges' fractions are multiplied with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafHit {
    pub(crate) leaf: u32,
    base: f32,
    factors: [f32; 4],
    margin: f32,
}

/// What the test of a node found: its children that may hold contours, and for those the terms their leaves go on with.
pub(crate) struct NodeTest {
    pub(crate) kept: u32,
    /// The receiver relative to the children's centres.
    q: [Lanes; 3],
    /// Plane values in the middle of the bounds.
    middle: Lanes,
    /// Half widths of the plane values, without those that follow from the tile's size, and these.
    spread: Lanes,
    margin: Lanes,
}

impl NodeTest {
    /// A child is dropped if all its planes have the same sign from anywhere in the tile, |n . q + d| > spread + margin for the
    /// middle of its bounds, or if its box lies below all horizons, n . (x - p) < 0 for all x, p and n. See [`SLACK`] for the
    /// rounding, also that of the margin in the tile's box, five sums and products; comparisons with an overflown term are false
    /// and keep the child.
    #[inline(always)]
    pub(crate) fn new<const DUAL: bool>(node: &Node, query: &Query) -> Self {
        let mut q = [[0.0; WIDTH]; 3];
        for axis in 0..3 {
            for j in 0..WIDTH {
                q[axis][j] = (query.high[axis] - node.center[axis][j]) + query.low[axis];
            }
        }
        let (mut middle, mut spread, mut margin) = ([0.0; WIDTH], [0.0; WIDTH], [0.0; WIDTH]);
        let mut dropped = [false; WIDTH];
        if DUAL {
            for j in 0..WIDTH {
                let [x, y, z] = [q[0][j], q[1][j], q[2][j]];
                let [nx, ny, nz] = &node.normal;
                let [hx, hy, hz] = &node.normal_half;
                middle[j] = nx[j] * x + ny[j] * y + nz[j] * z + node.offset[j];
                spread[j] = hx[j] * x.abs() + hy[j] * y.abs() + hz[j] * z.abs() + node.offset_half[j];
                let [sx, sy, sz] = query.half;
                let reach = sx * (nx[j].abs() + hx[j]) + sy * (ny[j].abs() + hy[j]) + sz * (nz[j].abs() + hz[j]);
                margin[j] = if reach < query.margin { reach } else { query.margin };
                dropped[j] = middle[j].abs() > spread[j] + margin[j];
            }
        }
        if let Some(Horizon { normal: [nx, ny, nz], half: [hx, hy, hz], size: [sx, sy, sz], margin }) = &query.horizon {
            let [bx, by, bz] = &node.half;
            for j in 0..WIDTH {
                let [x, y, z] = [q[0][j], q[1][j], q[2][j]];
                let depth = nx * x + ny * y + nz * z;
                let reach = (sx * bx[j] + sy * by[j] + sz * bz[j]) + (hx * x.abs() + hy * y.abs() + hz * z.abs());
                dropped[j] |= depth > reach + margin;
            }
        }
        Self { kept: !bits(&dropped), q, middle, spread, margin }
    }

    /// The terms of child `j`, a leaf.
    ///
    /// A plane's fractions are rounded to the grid by at most half a step, in sum at most spread / (2 STEPS). Rounding of its value
    /// is at most 16 u (|q|_1 + |d| + spread), and 2^-12 spread pays for the plane itself.
    #[inline(always)]
    pub(crate) fn leaf(&self, leaf: u32, j: usize, node: &Node) -> LeafHit {
        const GRID: f32 = 0.5 / STEPS + 1.0 / 4096.0 + SLACK as f32;
        let [x, y, z] = [self.q[0][j], self.q[1][j], self.q[2][j]];
        let rounding = SLACK as f32 * (x.abs() + y.abs() + z.abs() + node.offset[j].abs());
        LeafHit {
            leaf,
            base: self.middle[j],
            factors: [
                node.normal_half[0][j] * x * (1.0 / STEPS),
                node.normal_half[1][j] * y * (1.0 / STEPS),
                node.normal_half[2][j] * z * (1.0 / STEPS),
                node.offset_half[j] * (1.0 / STEPS),
            ],
            margin: self.margin[j] + GRID * self.spread[j] + rounding,
        }
    }
}

impl LeafHit {
    /// The edges whose planes are not both certain and of the same sign.
    #[inline(always)]
    pub(crate) fn test(&self, leaf: &Leaf) -> u32 {
        let mut values = [[0.0; WIDTH]; 2];
        for (values, [kx, ky, kz, kd]) in values.iter_mut().zip(&leaf.planes) {
            let [fx, fy, fz, fd] = self.factors;
            for j in 0..WIDTH {
                values[j] = self.base
                    + fx * f32::from(kx[j])
                    + fy * f32::from(ky[j])
                    + fz * f32::from(kz[j])
                    + fd * f32::from(kd[j]);
            }
        }
        let mut dropped = [false; WIDTH];
        for j in 0..WIDTH {
            let (v, w, m) = (values[0][j], values[1][j], self.margin);
            let certain = (v > m) & (w > m) | (v < -m) & (w < -m);
            dropped[j] = certain & (leaf.planes[0][3][j] != FAN);
        }
        !bits(&dropped)
    }
}

/// One bit a lane.
#[inline(always)]
fn bits(lanes: &[bool; WIDTH]) -> u32 {
    let mut bits = [0u32; WIDTH];
    for j in 0..WIDTH {
        bits[j] = if lanes[j] { 1 << j } else { 0 };
    }
    bits.iter().fold(0, |all, bit| all | bit)
}
