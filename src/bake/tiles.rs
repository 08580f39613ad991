use glam::DVec3;

use crate::scene::{MORTON_BITS, morton};

/// Most receivers that share one contour search.
pub const TILE_RECEIVERS: usize = 64;

/// Largest radius of a tile, as a fraction of the scene's diagonal: beyond it the edges that are contours for some
/// receivers of the tile only outnumber what sharing the search saves.
pub const TILE_RADIUS: f64 = 0.01;

/// With fewer receivers than these, for which the search is more of the work, tiles may be larger by this factor.
const FEW: usize = 32;
const WIDER: f64 = 1.5;

/// Groups neighbouring receivers, as indices: along a Morton curve over their bounds, cut after [`TILE_RECEIVERS`] or
/// when a group outgrows `radius` (of the box around it), which few receivers may by half. Depends on the positions alone.
pub fn tiles(positions: &[DVec3], radius: f64) -> Vec<Vec<u32>> {
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
        let fits = |receivers: usize| {
            let most = if receivers < FEW { WIDER * radius } else { radius };
            receivers < TILE_RECEIVERS && (grown.1 - grown.0).length() <= 2.0 * most
        };
        match tiles.last_mut() {
            Some(tile) if fits(tile.len()) => {
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
    use super::*;

    #[test]
    fn every_receiver_is_in_one_small_tile() {
        let positions: Vec<DVec3> = (0..5000)
            .map(|i| {
                let i = i as f64;
                DVec3::new((i * 0.37).sin(), (i * 0.91).cos(), (i * 0.013).sin())
            })
            .collect();
        let tiles = tiles(&positions, 0.1);
        let mut seen = vec![0; positions.len()];
        for tile in &tiles {
            assert!(tile.len() <= TILE_RECEIVERS);
            let most = if tile.len() > FEW { 0.2 } else { WIDER * 0.2 };
            for &a in tile {
                seen[a as usize] += 1;
                assert!(tile.iter().all(|&b| positions[a as usize].distance(positions[b as usize]) <= most));
            }
        }
        assert!(seen.iter().all(|&n| n == 1));
        assert!(tiles.len() < positions.len());
    }

    #[test]
    fn one_place_is_one_row_of_full_tiles() {
        assert_eq!(tiles(&[DVec3::ONE; 130], 0.0).iter().map(Vec::len).collect::<Vec<_>>(), [64, 64, 2]);
        assert!(tiles(&[], 1.0).is_empty());
    }
}
