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
            // Rounding must not leave the farthest corner out.
            ball.radius = reach(ball) * (1.0 + 4.0 * f64::EPSILON);
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
