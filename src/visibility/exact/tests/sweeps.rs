//! Two sweeps, one answer.

use glam::DVec3;

use super::scenes::{Random, Triangle, contours, cuboid, depth, knot, quad};
use super::{Answer, order};
use crate::visibility::exact::chart::Chart;
use crate::visibility::exact::edges::Edges;
use crate::visibility::exact::{Region, masks, sweep};
use crate::visibility::{Arc, ReceiverContours};

/// The regions that the sweep by masks, if it is certain, and the ordered one find.
fn both_regions(
    contours: &ReceiverContours,
    normal: Option<DVec3>,
    depth: impl Fn(DVec3) -> i32,
) -> (Option<Region>, Region) {
    let chart = Chart::new(normal.unwrap_or(DVec3::Z), 0);
    let mut edges = Edges::default();
    assert!(edges.fill(contours, normal, &chart, false).is_ok());
    let at_pole = depth(chart.pole());
    let mut fast = Region::default();
    let certain = masks::sweep(&edges, &mut masks::Buffers::default(), &chart, at_pole, &mut fast).ok();
    let mut ordered = Region::default();
    let check = sweep::sweep(&edges, &mut sweep::Queue::default(), &chart, at_pole, &mut ordered);
    for (check, expected) in certain.into_iter().chain([check]) {
        assert_eq!(depth(check), expected);
    }
    (certain.map(|_| fast), ordered)
}

/// Their answers.
fn both(triangles: &[Triangle], receiver: DVec3, normal: Option<DVec3>) -> (Option<Answer>, Answer) {
    let contours = contours(triangles, receiver, normal);
    let (certain, ordered) = both_regions(&contours, normal, |w| depth(triangles, receiver, w));
    let answer = |region: Region| {
        let mut harmonics = vec![0.0; order().len()];
        region.harmonics(order(), &mut harmonics);
        let (solid_angle, vector_area) = (region.solid_angle(), region.vector_area());
        Answer { solid_angle, vector_area, harmonics, residuals: *region.residuals() }
    };
    (certain.map(answer), answer(ordered))
}

/// The same contours with arcs and vertices in another order.
fn shuffled(contours: &ReceiverContours, random: &mut Random) -> ReceiverContours {
    let mut order = |count: usize| {
        let mut order: Vec<usize> = (0..count).collect();
        for i in (1..count).rev() {
            order.swap(i, (random.number() * (i + 1) as f64) as usize);
        }
        order
    };
    let vertices = order(contours.directions.len());
    let mut places = vec![0; vertices.len()];
    vertices.iter().enumerate().for_each(|(place, &vertex)| places[vertex] = place as u32);
    let arcs = order(contours.arcs.len()).into_iter().map(|k| contours.arcs[k]);
    let mut result = ReceiverContours::default();
    result.directions = vertices.iter().map(|&vertex| contours.directions[vertex]).collect();
    result.heights = vertices.iter().map(|&vertex| contours.heights[vertex]).collect();
    result.arcs = arcs.map(|arc| Arc { a: places[arc.a as usize], b: places[arc.b as usize], ..arc }).collect();
    result
}

/// Tiles have contours in orders of their own: to the bit nothing may depend on it, whatever coincides.
#[test]
fn the_order_of_contours_changes_no_bit() {
    let mut random = Random(33);
    let knots: Vec<Triangle> = (0..3).flat_map(|_| knot(3.0 * random.vector(), 0.5, 40, 8)).collect();
    let grid: Vec<Triangle> = (0..27)
        .flat_map(|k| {
            let low = DVec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9)) * 2.0 - 2.5;
            cuboid(low, low + 1.0)
        })
        .collect();
    for (scene, size) in [(random.soup(60, 1.5), 0.0), (knots, 1.0), (grid, 2.0)] {
        for _ in 0..6 {
            let receiver = size * random.vector().round();
            for normal in [Some(random.direction()), Some(DVec3::Y), None] {
                let contours = contours(&scene, receiver, normal);
                let depth = |w: DVec3| depth(&scene, receiver, w);
                let bits = |region: &Region| (region.boundary.clone(), region.solid_angle, region.residuals);
                let (certain, ordered) = both_regions(&contours, normal, depth);
                for _ in 0..3 {
                    let (again, ordered_again) = both_regions(&shuffled(&contours, &mut random), normal, depth);
                    assert!(again.as_ref().map(bits) == certain.as_ref().map(bits));
                    assert!(bits(&ordered_again) == bits(&ordered));
                }
            }
        }
    }
}

/// Hundreds of active edges: several bands, several words of slots.
#[test]
fn crowds_in_general_position() {
    let mut random = Random(31);
    let knots: Vec<Triangle> = (0..6).flat_map(|_| knot(4.0 * random.vector(), 0.5, 60, 12)).collect();
    for (scene, receivers) in [(random.soup(60, 1.5), 20), (random.soup(1500, 0.4), 3), (knots, 5)] {
        for _ in 0..receivers {
            let receiver = 0.3 * random.vector();
            for normal in [Some(random.direction()), None] {
                let (certain, ordered) = both(&scene, receiver, normal);
                let distance = certain.expect("nothing coincides here").distance(&ordered);
                assert!(distance < 1e-12, "{distance:e}");
            }
        }
    }
}

/// Coincident edges and vertices: where the sweep by masks answers it is right, and where it cannot be certain it says so.
#[test]
fn what_coincides_is_in_doubt() {
    let mut random = Random(32);
    let corner = |x: f64, y: f64| DVec3::new(x, y, 1.0);
    let square = quad(corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0));
    let twice = [square.to_vec(), square.map(|t| t.map(|corner| 2.0 * corner)).to_vec()].concat();
    let (certain, _) = both(&twice, DVec3::ZERO, Some(DVec3::Z));
    assert!(certain.is_none());
    let boxes: Vec<Triangle> = [(0.0, 0.0), (1.0, 0.0), (2.0, 2.0), (0.0, 3.0)]
        .into_iter()
        .flat_map(|(x, y)| cuboid(DVec3::new(x, y, 0.0), DVec3::new(x + 1.0, y + 1.0, 1.0)))
        .collect();
    let mut doubts = 0;
    for _ in 0..40 {
        let receiver = (8.0 * random.vector()).round() / 4.0 + DVec3::new(0.125, 0.0, 1.0);
        let (certain, ordered) = both(&boxes, receiver, Some(random.direction()));
        match certain {
            Some(certain) => assert!(certain.distance(&ordered) < 1e-12),
            None => doubts += 1,
        }
    }
    assert!(doubts < 30, "{doubts}");
}
