//! Two sweeps, one answer.

use glam::DVec3;

use super::scenes::{Random, Triangle, contours, cuboid, depth, knot, quad};
use super::{Answer, order};
use crate::visibility::exact::chart::Chart;
use crate::visibility::exact::edges::Edges;
use crate::visibility::exact::{Region, masks, sweep};

/// The answers of the sweep by masks, if it is certain, and of the ordered one.
fn both(triangles: &[Triangle], receiver: DVec3, normal: Option<DVec3>) -> (Option<Answer>, Answer) {
    let contours = contours(triangles, receiver, normal);
    let chart = Chart::new(normal.unwrap_or(DVec3::Z), 0);
    let mut edges = Edges::default();
    assert!(edges.fill(&contours, normal, &chart, false).is_ok());
    let at_pole = depth(triangles, receiver, chart.pole());
    let answer = |region: &Region, (check, expected): (DVec3, i32)| {
        assert_eq!(depth(triangles, receiver, check), expected);
        let mut harmonics = vec![0.0; order().len()];
        region.harmonics(order(), &mut harmonics);
        let (solid_angle, vector_area) = (region.solid_angle(), region.vector_area());
        Answer { solid_angle, vector_area, harmonics, residuals: *region.residuals() }
    };
    let mut region = Region::default();
    let certain = masks::sweep(&edges, &mut masks::Buffers::default(), &chart, at_pole, &mut region).ok();
    let certain = certain.map(|check| answer(&region, check));
    let check = sweep::sweep(&edges, &mut sweep::Queue::default(), &chart, at_pole, &mut region);
    (certain, answer(&region, check))
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
