use glam::{DVec2, DVec3, Vec3};

/// Cuts a polygon into triangles that keep its winding and use all its corners.
///
/// Strictly convex polygons are fanned from their first corner; others lose one ear at a time (Meisters 1975) in the
/// plane of their area vector. A corner in the middle of a straight side stays a corner of some triangle, so that no
/// T-junction arises. What self-intersects beyond repair is fanned.
///
/// `positions` must hold every index of `corners`.
pub(super) fn triangulate(corners: &[u32], positions: &[Vec3], triangles: &mut Vec<[u32; 3]>) {
    if let &[a, b, c] = corners {
        triangles.push([a, b, c]);
        return;
    }
    let at = |v: u32| positions[v as usize].as_dvec3();
    let Some(&origin) = corners.first() else { return };
    let area: DVec3 = (0..corners.len())
        .map(|i| (at(corners[i]) - at(origin)).cross(at(corners[(i + 1) % corners.len()]) - at(origin)))
        .sum();
    // Seen from the tip of the area vector, along its largest component, the polygon runs counter-clockwise.
    let flat = |v: u32| {
        let p = at(v) - at(origin);
        let (flat, towards) = match area.abs().max_position() {
            0 => (DVec2::new(p.y, p.z), area.x),
            1 => (DVec2::new(p.z, p.x), area.y),
            _ => (DVec2::new(p.x, p.y), area.z),
        };
        if towards < 0.0 { DVec2::new(flat.y, flat.x) } else { flat }
    };

    let mut left: Vec<(u32, DVec2)> = corners.iter().map(|&v| (v, flat(v))).collect();
    let turn = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - b);
    let neighbours = |left: &[(u32, DVec2)], i: usize| {
        let n = left.len();
        [left[(i + n - 1) % n], left[i], left[(i + 1) % n]]
    };
    let is_convex = (0..left.len()).all(|i| {
        let [a, b, c] = neighbours(&left, i);
        turn(a.1, b.1, c.1) > 0.0
    });
    while !is_convex && left.len() > 3 {
        let ear = (0..left.len()).find(|&i| {
            let [a, b, c] = neighbours(&left, i);
            let inside = |p: DVec2| turn(a.1, b.1, p) >= 0.0 && turn(b.1, c.1, p) >= 0.0 && turn(c.1, a.1, p) >= 0.0;
            let is_corner = |p: DVec2| p == a.1 || p == b.1 || p == c.1;
            turn(a.1, b.1, c.1) > 0.0 && !left.iter().any(|&(_, p)| !is_corner(p) && inside(p))
        });
        let Some(i) = ear else { break };
        triangles.push(neighbours(&left, i).map(|(v, _)| v));
        left.remove(i);
    }
    triangles.extend(left[1..].windows(2).map(|pair| [left[0].0, pair[0].0, pair[1].0]));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(polygon: &[Vec3]) -> Vec<[u32; 3]> {
        let corners: Vec<u32> = (0..polygon.len() as u32).collect();
        let mut triangles = Vec::new();
        triangulate(&corners, polygon, &mut triangles);
        triangles
    }

    /// Sum of unsigned areas: equal to the polygon's area only if nothing overlaps or sticks out.
    fn area(polygon: &[Vec3], triangles: &[[u32; 3]]) -> f32 {
        let corner = |v: u32| polygon[v as usize];
        triangles.iter().map(|&[a, b, c]| (corner(b) - corner(a)).cross(corner(c) - corner(a)).length() / 2.0).sum()
    }

    #[test]
    fn convex_polygon_is_fanned() {
        let quad = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        assert_eq!(cut(&quad), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn concave_polygons_keep_their_area_and_winding_from_every_side() {
        // An arrow head whose notch a fan from the first corner would cover.
        let arrow = [[0.0, 0.0], [4.0, 2.0], [0.0, 4.0], [1.0, 2.0]];
        // A comb of area 11: three teeth of 1 x 2 over a bar of 5 x 1.
        let comb = [
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 3.0],
            [4.0, 3.0],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 3.0],
            [2.0, 3.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ];
        let lift: [fn([f32; 2]) -> Vec3; 6] = [
            |[x, y]| Vec3::new(x, y, 7.0),
            |[x, y]| Vec3::new(y, x, 7.0),
            |[x, y]| Vec3::new(7.0, x, y),
            |[x, y]| Vec3::new(7.0, y, x),
            |[x, y]| Vec3::new(y, 7.0, x),
            |[x, y]| Vec3::new(x, 7.0, y),
        ];
        for (outline, expected) in [(&arrow[..], 6.0), (&comb[..], 11.0)] {
            for lift in lift {
                for shift in 0..outline.len() {
                    let mut polygon: Vec<Vec3> = outline.iter().map(|&p| lift(p)).collect();
                    polygon.rotate_left(shift);
                    let triangles = cut(&polygon);
                    assert_eq!(triangles.len(), polygon.len() - 2);
                    assert_eq!(area(&polygon, &triangles), expected);
                    let whole =
                        polygon.iter().zip(polygon.iter().cycle().skip(1)).map(|(a, b)| a.cross(*b)).sum::<Vec3>();
                    for [a, b, c] in triangles.iter().map(|t| t.map(|v| polygon[v as usize])) {
                        assert!((b - a).cross(c - a).dot(whole) > 0.0);
                    }
                }
            }
        }
    }

    #[test]
    fn corner_on_a_straight_side_is_used_by_a_proper_triangle() {
        let polygon = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
        for shift in 0..polygon.len() {
            let mut polygon = polygon;
            polygon.rotate_left(shift);
            for [a, b, c] in cut(&polygon).iter().map(|t| t.map(|v| polygon[v as usize])) {
                assert!((b - a).cross(c - a).z > 0.0);
            }
        }
    }

    #[test]
    fn hopeless_polygons_still_come_out() {
        assert_eq!(cut(&[Vec3::ZERO; 5]).len(), 3);
        assert_eq!(cut(&[Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)]).len(), 2);
    }
}
