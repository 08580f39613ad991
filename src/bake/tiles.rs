use glam::DVec3;

use crate::scene::Geometry;

/// Most receivers that share one contour search.
pub const TILE_RECEIVERS: usize = 128;

/// Groups neighbouring receivers, as indices: halved along the longest side of their bounds, in which normals that differ count as a
/// distance, until no more than [`TILE_RECEIVERS`] are left that fit into the radius that suits the scene. Depends on the positions, the
/// normals (none, for probes) and the geometry alone. What follows one another is near.
pub fn tiles(geometry: &Geometry, positions: &[DVec3], normals: &[DVec3]) -> Vec<Vec<u32>> {
    gather(positions, normals, radius(geometry))
}

/// Largest radius of a tile: the larger, the more receivers share a search, but the more edges are contours for some of them
/// only, the sooner the finer the mesh is.
///
/// Between one and two hundredths of the scene's diagonal the best was seen to go like the root of the length of an edge: 0.02 and more
/// for 100 000 triangles of a hundred knots, 0.015 for two millions. Lengths are the mean over a few thousand faces.
fn radius(geometry: &Geometry) -> f64 {
    const LEAST: f64 = 0.0125;
    const MOST: f64 = 0.025;
    const SCALE: f64 = 0.5;
    const FACES: usize = 4096;
    let Some([low, high]) = geometry.bounds() else { return 0.0 };
    let diagonal = low.as_dvec3().distance(high.as_dvec3());
    let faces = (0..geometry.triangles.len()).step_by(geometry.triangles.len().div_ceil(FACES).max(1));
    let count = faces.len().max(1) as f64;
    let around =
        faces.map(|face| geometry.corners(face as u32)).map(|[a, b, c]| a.distance(b) + b.distance(c) + c.distance(a));
    let edge = around.sum::<f64>() / (3.0 * count);
    (SCALE * (edge * diagonal).sqrt()).clamp(LEAST * diagonal, MOST * diagonal)
}

/// Opposite normals are as far apart as places at this fraction of the largest diagonal: two sides of a wall see nothing in common, and have
/// no horizon together.
const TURN: f64 = 0.6;

/// The same with a given radius, half the diagonal of the box around a group.
fn gather(positions: &[DVec3], normals: &[DVec3], radius: f64) -> Vec<Vec<u32>> {
    if positions.is_empty() {
        return Vec::new();
    }
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    let mut tiles = Vec::new();
    // The next one last.
    let mut groups = Vec::from([(0, order.len())]);
    while let Some((start, end)) = groups.pop() {
        let members = &mut order[start..end];
        let (low, size) = bounds(members, positions);
        let is_long = size.length() > 2.0 * radius;
        if members.len() <= TILE_RECEIVERS && !is_long {
            members.sort_unstable();
            tiles.push(members.to_vec());
            continue;
        }
        let (first, spread) = if normals.is_empty() { (DVec3::ZERO, DVec3::ZERO) } else { bounds(members, normals) };
        // Splitting a few by their normals does not make them shorter.
        let turn = if members.len() <= TILE_RECEIVERS { 0.0 } else { TURN * radius };
        let longest = |sides: DVec3| (0..3).max_by(|&i, &j| sides[i].total_cmp(&sides[j])).unwrap_or_default();
        let (i, j) = (longest(size), longest(spread));
        let (values, axis, middle) = match turn * spread[j] > size[i] {
            true => (normals, j, first[j] + 0.5 * spread[j]),
            false => (positions, i, low[i] + 0.5 * size[i]),
        };
        let mut below = 0;
        for at in 0..members.len() {
            if values[members[at] as usize][axis] < middle {
                members.swap(below, at);
                below += 1;
            }
        }
        if below == 0 || below == members.len() {
            // All in one place, as far as it can be told.
            let half = members.len() / 2;
            below = if members.len() > TILE_RECEIVERS { half.next_multiple_of(TILE_RECEIVERS) } else { half };
        }
        let middle = start + below;
        groups.extend([(middle, end), (start, middle)]);
    }
    tiles
}

/// Lowest corner and size of the box around some of the points.
fn bounds(members: &[u32], points: &[DVec3]) -> (DVec3, DVec3) {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) =
        members.iter().map(|&i| points[i as usize]).fold(start, |(low, high), p| (low.min(p), high.max(p)));
    (low, high - low)
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::GeometryBuilder;
    use crate::scene::shapes::{Plane, TorusKnot};

    #[test]
    fn every_receiver_is_in_one_small_tile() {
        let points: Vec<DVec3> = (0..5000)
            .map(|i| {
                let i = i as f64;
                DVec3::new((i * 0.37).sin(), (i * 0.91).cos(), (i * 0.013).sin())
            })
            .collect();
        for normals in [&[][..], &points] {
            let tiles = gather(&points, normals, 0.1);
            let mut seen = vec![0; points.len()];
            for tile in &tiles {
                assert!(tile.len() <= TILE_RECEIVERS);
                for &a in tile {
                    seen[a as usize] += 1;
                    assert!(tile.iter().all(|&b| points[a as usize].distance(points[b as usize]) <= 0.2));
                }
            }
            assert!(seen.iter().all(|&n| n == 1));
            assert!(tiles.len() < points.len());
        }
    }

    #[test]
    fn two_sides_of_a_wall_are_two_tiles() {
        let at = |i: u32| DVec3::new(f64::from(i % 16), f64::from(i / 2 % 16), 0.01 * f64::from(i % 2));
        let normal = |i: u32| if i.is_multiple_of(2) { DVec3::NEG_Z } else { DVec3::Z };
        let (points, normals): (Vec<_>, Vec<_>) = (0..256).map(|i| (at(i), normal(i))).unzip();
        let tiles = gather(&points, &normals, 20.0);
        assert!(tiles.iter().all(|tile| tile.iter().all(|i| i % 2 == tile[0] % 2)), "{tiles:?}");
        assert_eq!(tiles.len(), 2);
    }

    #[test]
    fn what_cannot_be_halved_ends() {
        // Neighbouring numbers, and the largest.
        let next = 1.0f64.next_up();
        for ends in [[1.0, next], [f64::MIN, f64::MAX]] {
            let points: Vec<DVec3> = (0..200).map(|i| DVec3::splat(ends[i % 2])).collect();
            let tiles = gather(&points, &[], 0.0);
            assert_eq!(tiles.iter().map(Vec::len).sum::<usize>(), 200);
        }
    }

    #[test]
    fn finer_meshes_have_smaller_tiles() {
        let knot = |triangles: usize| {
            let mut builder = GeometryBuilder::default();
            let mesh = TorusKnot { triangles, ..TorusKnot::default() }.mesh().unwrap();
            builder.add(mesh, DAffine3::IDENTITY).unwrap();
            // Far away, so that the knot is small in the scene.
            let patch = Plane { size: [0.1; 2], ..Plane::default() }.mesh().unwrap();
            builder.add(patch, DAffine3::from_translation(60.0 * DVec3::X)).unwrap();
            builder.build()
        };
        let radii = [100, 5_000, 20_000, 80_000].map(|triangles| {
            let geometry = knot(triangles);
            let [low, high] = geometry.bounds().unwrap();
            radius(&geometry) / f64::from(low.distance(high))
        });
        assert!((radii[0] - 0.025).abs() < 1e-9 && (radii[3] - 0.0125).abs() < 1e-9, "{radii:?}");
        // Four times as many triangles have edges half as long.
        assert!((radii[1] / radii[2] - 2f64.sqrt()).abs() < 0.05, "{radii:?}");
        assert_eq!(radius(&GeometryBuilder::default().build()), 0.0);
    }

    #[test]
    fn one_place_is_one_row_of_full_tiles() {
        assert_eq!(gather(&[DVec3::ONE; 258], &[], 0.0).iter().map(Vec::len).collect::<Vec<_>>(), [128, 128, 2]);
        assert!(gather(&[], &[], 1.0).is_empty());
    }
}
