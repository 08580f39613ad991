use glam::DVec3;

use crate::scene::{Geometry, MORTON_BITS, morton};

/// Most receivers that share one contour search.
pub const TILE_RECEIVERS: usize = 64;

/// Groups neighbouring receivers, as indices: along a Morton curve over their bounds, cut after [`TILE_RECEIVERS`] or when a group
/// outgrows the radius that suits the scene. Depends on the positions and the geometry alone.
pub fn tiles(geometry: &Geometry, positions: &[DVec3]) -> Vec<Vec<u32>> {
    gather(positions, radius(geometry))
}

/// Largest radius of a tile: the larger, the more receivers share a search, but the more edges are contours for some of them
/// only, the sooner the finer the mesh is.
///
/// Between one and two hundredths of the scene's diagonal the best was seen to go like the root of the length of an edge: 0.02 and more
/// for 100 000 triangles of a hundred knots, 0.013 for two millions. Lengths are the mean over a few thousand faces.
fn radius(geometry: &Geometry) -> f64 {
    const LEAST: f64 = 0.01;
    const MOST: f64 = 0.02;
    const SCALE: f64 = 0.4;
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

/// The same with a given radius, of the box around a group.
fn gather(positions: &[DVec3], radius: f64) -> Vec<Vec<u32>> {
    let bounds = |points: &mut dyn Iterator<Item = DVec3>| {
        points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
    };
    let (low, high) = bounds(&mut positions.iter().copied());
    let cell = (high - low).max_element().max(f64::MIN_POSITIVE) / (1u64 << MORTON_BITS) as f64;
    let mut order: Vec<(u64, u32)> =
        positions.iter().enumerate().map(|(i, &p)| (morton((p - low) / cell), i as u32)).collect();
    order.sort_unstable();

    let mut tiles: Vec<Vec<u32>> = Vec::new();
    let mut extent = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (_, index) in order {
        let p = positions[index as usize];
        let grown = (extent.0.min(p), extent.1.max(p));
        match tiles.last_mut() {
            Some(tile) if tile.len() < TILE_RECEIVERS && (grown.1 - grown.0).length() <= 2.0 * radius => {
                tile.push(index);
                extent = grown;
            }
            _ => {
                tiles.push(vec![index]);
                extent = (p, p);
            }
        }
    }
    tiles
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::GeometryBuilder;
    use crate::scene::shapes::{Plane, TorusKnot};

    #[test]
    fn every_receiver_is_in_one_small_tile() {
        let positions: Vec<DVec3> = (0..5000)
            .map(|i| {
                let i = i as f64;
                DVec3::new((i * 0.37).sin(), (i * 0.91).cos(), (i * 0.013).sin())
            })
            .collect();
        let tiles = gather(&positions, 0.1);
        let mut seen = vec![0; positions.len()];
        for tile in &tiles {
            assert!(tile.len() <= TILE_RECEIVERS);
            for &a in tile {
                seen[a as usize] += 1;
                assert!(tile.iter().all(|&b| positions[a as usize].distance(positions[b as usize]) <= 0.2));
            }
        }
        assert!(seen.iter().all(|&n| n == 1));
        assert!(tiles.len() < positions.len());
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
        assert!((radii[0] - 0.02).abs() < 1e-9 && (radii[3] - 0.01).abs() < 1e-9, "{radii:?}");
        // Four times as many triangles have edges half as long.
        assert!((radii[1] / radii[2] - 2f64.sqrt()).abs() < 0.05, "{radii:?}");
        assert_eq!(radius(&GeometryBuilder::default().build()), 0.0);
    }

    #[test]
    fn one_place_is_one_row_of_full_tiles() {
        assert_eq!(gather(&[DVec3::ONE; 130], 0.0).iter().map(Vec::len).collect::<Vec<_>>(), [64, 64, 2]);
        assert!(gather(&[], 1.0).is_empty());
    }
}
