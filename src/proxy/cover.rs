//! Whether balls cover a surface, decided on whole triangles.

use glam::DVec3;

use super::Sphere;
use crate::scene::Geometry;

/// A ball in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ball {
    pub(super) center: DVec3,
    pub(super) radius: f64,
}

impl From<&Sphere> for Ball {
    fn from(sphere: &Sphere) -> Self {
        Self { center: sphere.center.as_dvec3(), radius: sphere.radius.into() }
    }
}

impl Ball {
    pub(super) fn holds(&self, p: DVec3) -> bool {
        self.center.distance_squared(p) <= self.radius * self.radius
    }

    fn holds_all(&self, corners: [DVec3; 3]) -> bool {
        corners.iter().all(|&p| self.holds(p))
    }
}

/// Grows balls, each as little as possible, until every triangle lies in their union.
///
/// A piece of a triangle that lies in one ball with its corners lies there as a whole, balls being convex; any other is cut
/// in four. Pieces below `finest` are not cut again: the ball that has to grow least takes them in.
pub(super) fn cover(geometry: &Geometry, balls: &mut [Ball], finest: f64) {
    visit_pieces(geometry, balls, finest, |balls, near, piece| {
        let reach = |ball: &Ball| piece.iter().map(|p| p.distance(ball.center)).fold(0.0, f64::max);
        let growth = |i: u32| {
            let ball = &balls[i as usize];
            reach(ball) - ball.radius
        };
        let all: Vec<u32>;
        let candidates = if near.is_empty() {
            all = (0..balls.len() as u32).collect();
            &all
        } else {
            near
        };
        if let Some(&least) = candidates.iter().min_by(|&&i, &&j| growth(i).total_cmp(&growth(j))) {
            let ball = &mut balls[least as usize];
            // Rounding must not leave the farthest corner out; a ball that has grown since may hold the piece already.
            ball.radius = ball.radius.max(reach(ball) * (1.0 + 4.0 * f64::EPSILON));
        }
        true
    });
}

/// A piece of the surface, smaller than `finest`, that does not lie in any single ball; none where the balls cover the
/// surface.
pub(super) fn uncovered(geometry: &Geometry, balls: &[Ball], finest: f64) -> Option<[DVec3; 3]> {
    let mut found = None;
    visit_pieces(geometry, &mut balls.to_vec(), finest, |_, _, piece| {
        found = Some(piece);
        false
    });
    found
}

/// Calls `visit` with the pieces below `finest` that no single ball holds and with the balls that meet them, until it
/// returns false.
fn visit_pieces(
    geometry: &Geometry,
    balls: &mut [Ball],
    finest: f64,
    mut visit: impl FnMut(&mut [Ball], &[u32], [DVec3; 3]) -> bool,
) {
    // The ball that held the last piece is likely to hold the next.
    let mut last = 0;
    let mut stack: Vec<([DVec3; 3], Vec<u32>)> = Vec::new();
    for t in 0..geometry.triangles.len() as u32 {
        let corners = geometry.corners(t);
        if balls[last].holds_all(corners) {
            continue;
        }
        stack.push((corners, meeting(balls, 0..balls.len() as u32, corners)));
        while let Some((piece, near)) = stack.pop() {
            if let Some(&holder) = near.iter().find(|&&i| balls[i as usize].holds_all(piece)) {
                last = holder as usize;
                continue;
            }
            let [a, b, c] = piece;
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            if longest <= finest {
                if !visit(balls, &near, piece) {
                    return;
                }
                continue;
            }
            let [ab, bc, ca] = [a.midpoint(b), b.midpoint(c), c.midpoint(a)];
            for piece in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                let near = meeting(balls, near.iter().copied(), piece);
                stack.push((piece, near));
            }
        }
    }
}

/// The balls that a piece may meet.
fn meeting(balls: &[Ball], candidates: impl Iterator<Item = u32>, piece: [DVec3; 3]) -> Vec<u32> {
    let middle = (piece[0] + piece[1] + piece[2]) / 3.0;
    let extent = piece.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
    let meets = |i: &u32| {
        let ball = &balls[*i as usize];
        ball.center.distance_squared(middle) <= (ball.radius + extent).powi(2)
    };
    candidates.filter(meets).collect()
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::GeometryBuilder;
    use crate::scene::shapes::Plane;

    /// A square with sides of 2 around the origin in y = 0, and a ball for every quarter of it.
    fn square() -> (Geometry, Vec<Ball>) {
        let mut builder = GeometryBuilder::default();
        builder.add(Plane { size: [2.0, 2.0], ..Plane::default() }.mesh().unwrap(), DAffine3::IDENTITY).unwrap();
        let centers = [[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]];
        let ball = |[x, z]: [f64; 2]| Ball { center: DVec3::new(x, 0.0, z), radius: 0.5f64.sqrt() + 1e-12 };
        (builder.build(), centers.map(ball).to_vec())
    }

    #[test]
    fn a_square_is_covered_by_its_quarters_and_by_nothing_less() {
        let (square, balls) = square();
        assert_eq!(uncovered(&square, &balls, 1e-3), None);
        for i in 0..4 {
            let mut smaller = balls.clone();
            smaller[i].radius -= 2e-3;
            let piece = uncovered(&square, &smaller, 1e-4).expect("a corner is left out");
            assert!(piece.iter().any(|p| !balls.iter().zip(0..).any(|(ball, k)| k != i && ball.holds(*p))));
        }
    }

    #[test]
    fn balls_grow_until_all_is_covered_and_no_further() {
        let (square, mut balls) = square();
        balls.iter_mut().for_each(|ball| ball.radius -= 0.1);
        cover(&square, &mut balls, 1e-3);
        assert_eq!(uncovered(&square, &balls, 1e-3), None);
        // One alone has to reach the corners.
        let mut alone = [Ball { center: DVec3::ZERO, radius: 0.5 }];
        cover(&square, &mut alone, 1e-3);
        assert!((alone[0].radius - 2f64.sqrt()).abs() < 1e-14, "{alone:?}");
    }
}
