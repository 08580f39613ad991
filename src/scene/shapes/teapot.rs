use glam::DVec3;
use serde::Deserialize;

use super::super::Mesh;
use super::check;
use super::grid::append_grid;
use crate::Result;

/// The Utah teapot (Newell 1975) with the bottom added later: 32 bicubic Bézier patches in their original size, with x
/// from the handle (-3) to the spout (3.434) and, turned to y up, a height of 3.15.
///
/// Rim, body, lid and bottom are turned from one profile; handle and spout are mirrored halves.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Teapot {
    /// Cells along both sides of every patch; two triangles to a cell. Default 8.
    pub divisions: u32,
}

impl Default for Teapot {
    fn default() -> Self {
        Self { divisions: 8 }
    }
}

/// A control point of a profile: distance from the axis, height, and how far along the tangent of a quarter turn the
/// next control points lie, relative to the distance.
type ProfilePoint = (f64, f64, f64);

/// Each runs so that turning it counter-clockwise, seen from the top, faces outwards: upwards on an outer side.
const PROFILES: [[ProfilePoint; 4]; 6] = [
    // Rim.
    [(1.5, 2.4, ARC), (1.4375, 2.53125, ARC), (1.3375, 2.53125, ARC), (1.4, 2.4, ARC)],
    // Upper and lower body.
    [(2.0, 0.9, ARC), (2.0, 1.35, ARC), (1.75, 1.875, ARC), (1.5, 2.4, ARC)],
    [(1.5, 0.15, ARC), (1.5, 0.225, ARC), (2.0, 0.45, ARC), (2.0, 0.9, ARC)],
    // Knob, with the one tangent that differs, and lid.
    [(0.2, 2.7, ARC), (0.0, 2.85, ARC), (0.8, 3.15, 0.45 / 0.8), (0.0, 3.15, ARC)],
    [(1.3, 2.4, ARC), (1.3, 2.55, ARC), (0.4, 2.55, ARC), (0.2, 2.7, ARC)],
    // Bottom.
    [(0.0, 0.0, ARC), (1.425, 0.0, ARC), (1.5, 0.075, ARC), (1.5, 0.15, ARC)],
];

/// The original's approximation of a quarter circle.
const ARC: f64 = 0.56;

/// Control points (x, z) of the middle line where a half patch of handle or spout meets its mirror image, and the
/// half width in between.
type Section = ((f64, f64), (f64, f64), f64);

/// Handle and spout: sections from end to end; the first point is the inner side, the second the outer one.
const LIMBS: [[Section; 4]; 4] = [
    [
        ((-1.6, 2.025), (-1.5, 2.25), 0.3),
        ((-2.3, 2.025), (-2.5, 2.25), 0.3),
        ((-2.7, 2.025), (-3.0, 2.25), 0.3),
        ((-2.7, 1.8), (-3.0, 1.8), 0.3),
    ],
    [
        ((-2.7, 1.8), (-3.0, 1.8), 0.3),
        ((-2.7, 1.575), (-3.0, 1.35), 0.3),
        ((-2.5, 1.125), (-2.65, 0.9375), 0.3),
        ((-2.0, 0.9), (-1.9, 0.6), 0.3),
    ],
    [
        ((1.7, 1.425), (1.7, 0.6), 0.66),
        ((2.6, 1.425), (3.1, 0.825), 0.66),
        ((2.3, 2.1), (2.4, 2.025), 0.25),
        ((2.7, 2.4), (3.3, 2.4), 0.25),
    ],
    [
        ((2.7, 2.4), (3.3, 2.4), 0.25),
        ((2.8, 2.475), (3.525, 2.49375), 0.25),
        ((2.9, 2.475), (3.45, 2.5125), 0.15),
        ((2.8, 2.4), (3.2, 2.4), 0.15),
    ],
];

impl Teapot {
    /// The teapot's triangles, those of zero area at the poles of lid and bottom left out.
    ///
    /// # Errors
    /// No divisions or too many.
    pub fn mesh(&self) -> Result<Mesh> {
        check("teapot", &[], 64.0 * f64::from(self.divisions).powi(2))?;
        let mut mesh = Mesh { name: "teapot".into(), ..Mesh::default() };
        for patch in patches() {
            append_grid(&mut mesh, [self.divisions; 2], |u, v| evaluate(&patch, u, v), |_, _| true);
        }
        let positions = &mesh.positions;
        mesh.triangles.retain(|t| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            a != b && b != c && c != a
        });
        Ok(mesh)
    }
}

/// The 32 patches, as rows of control points, y up.
fn patches() -> impl Iterator<Item = [[DVec3; 4]; 4]> {
    let turned = PROFILES.into_iter().flat_map(|profile| {
        (0..4).map(move |quarter| {
            profile.map(|(radius, height, arc)| {
                let tangent = radius * arc;
                [(radius, 0.0), (radius, tangent), (tangent, radius), (0.0, radius)].map(|(x, y)| {
                    let (x, y) = [(x, y), (-y, x), (-x, -y), (y, -x)][quarter];
                    DVec3::new(x, height, -y)
                })
            })
        })
    });
    let limbs = LIMBS.into_iter().flat_map(|sections| {
        // The mirror image runs the other way round, so that both halves face outwards.
        [1.0, -1.0].map(|side| {
            sections.map(|(inner, outer, width)| {
                let ring = [(inner, 0.0), (inner, width), (outer, width), (outer, 0.0)];
                let ring = ring.map(|((x, z), y)| DVec3::new(x, z, side * y));
                if side > 0.0 { ring } else { [ring[3], ring[2], ring[1], ring[0]] }
            })
        })
    });
    turned.chain(limbs)
}

/// A point of a bicubic Bézier patch; equal bits where patches share a row or column of control points at their ends.
fn evaluate(patch: &[[DVec3; 4]; 4], u: f64, v: f64) -> DVec3 {
    let bernstein = |t: f64| {
        let s = 1.0 - t;
        [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
    };
    let along = |row: &[DVec3; 4]| -> DVec3 { row.iter().zip(bernstein(u)).map(|(&p, w)| p * w).sum() };
    patch.iter().zip(bernstein(v)).map(|(row, w)| along(row) * w).sum()
}

#[cfg(test)]
mod tests {
    use super::super::super::{EdgeKind, Geometry};
    use super::super::tests::{geometry, volume};
    use super::*;

    fn teapot(divisions: u32) -> Geometry {
        geometry(Teapot { divisions }.mesh())
    }

    #[test]
    fn bounds_are_the_known_ones() {
        let [low, high] = teapot(64).bounds().unwrap();
        assert_eq!((low.x, low.y, low.z), (-3.0, 0.0, -2.0));
        assert_eq!((high.y, high.z), (3.15, 2.0));
        assert!((high.x - 3.434).abs() < 5e-4, "{}", high.x);
    }

    #[test]
    fn patches_close_up() {
        let n = 6;
        let pot = teapot(n);
        let topology = pot.topology();
        assert_eq!(pot.cleaning.degenerate_triangles, 0);
        // Two poles, where four patches each lose n triangles; all other triangles are there.
        assert_eq!(pot.triangles.len(), (64 * n * n - 8 * n) as usize);
        // Body with rim and bottom, lid with knob, handle, spout.
        assert_eq!(topology.bodies(), 4);
        // The open rings: rim, lid, two ends of the handle (of two patches), two of the spout.
        assert_eq!(topology.count(EdgeKind::Boundary), (2 * 4 * n + 4 * 2 * n) as usize);
        assert_eq!(topology.count(EdgeKind::NonManifold) + topology.count(EdgeKind::InconsistentlyWound), 0);
    }

    #[test]
    fn every_patch_faces_outwards() {
        // Seen from a point on the axis of its body or limb, the middle of a patch faces away.
        for (i, patch) in patches().enumerate() {
            let middle = evaluate(&patch, 0.5, 0.5);
            let du = evaluate(&patch, 0.501, 0.5) - evaluate(&patch, 0.499, 0.5);
            let dv = evaluate(&patch, 0.5, 0.501) - evaluate(&patch, 0.5, 0.499);
            let within = match i / 4 {
                // Inside the bead of the rim, and inside the pot under its knob, lid and over its bottom.
                0 => DVec3::new(1.43 * middle.x, 0.0, 1.43 * middle.z) / middle.x.hypot(middle.z) + 2.44 * DVec3::Y,
                1..=5 => DVec3::new(0.0, [0.0, 1.2, 0.6, 2.9, 2.4, 0.3][i / 4], 0.0),
                _ => (0..4).map(|v| (patch[v][0] + patch[v][3]) * [0.125, 0.375, 0.375, 0.125][v] / 2.0).sum(),
            };
            assert!(du.cross(dv).dot(middle - within) > 0.0, "patch {i}");
        }
    }

    #[test]
    fn body_converges_to_the_volume_of_its_profile() {
        // All sections of body and bottom are alike: their area is r^2 times that of the unit ring of four arcs.
        let steps = 4096;
        let arc = [DVec3::X, DVec3::X + ARC * DVec3::Y, DVec3::Y + ARC * DVec3::X, DVec3::Y];
        let ring: Vec<DVec3> = (0..=steps).map(|i| evaluate(&[arc; 4], f64::from(i) / f64::from(steps), 0.0)).collect();
        let ring_area: f64 = ring.windows(2).map(|pair| 2.0 * pair[0].cross(pair[1]).z).sum();
        let mut expected = 0.0;
        for profile in [1, 2, 5].map(|i| PROFILES[i]) {
            let row = profile.map(|(r, z, _)| DVec3::new(r, z, 0.0));
            let point = |i: i32| evaluate(&[row; 4], f64::from(i) / f64::from(steps), 0.0);
            for i in 0..steps {
                let (a, b) = (point(i), point(i + 1));
                expected += ring_area * (a.x * a.x + a.x * b.x + b.x * b.x) / 3.0 * (b.y - a.y);
            }
        }
        let error = |n| {
            let mut mesh = Mesh::default();
            for (_, patch) in patches().enumerate().filter(|(i, _)| [1, 2, 5].contains(&(i / 4))) {
                append_grid(&mut mesh, [n; 2], |u, v| evaluate(&patch, u, v), |_, _| true);
            }
            // Gauss' integral adds nothing for the missing cover when the origin lies in its plane.
            mesh.positions.iter_mut().for_each(|p| p.y -= 2.4);
            expected - volume(&geometry(Ok(mesh)))
        };
        let ratio = error(12) / error(24);
        assert!((3.8..4.2).contains(&ratio), "{expected} {ratio}");
    }
}
