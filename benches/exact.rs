//! Time of one receiver by the exact method, from the search for its contours to harmonics of four bands, in tiles as a bake
//! makes them; and of each step alone. What is timed is first compared with rays.

mod scene;

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use scene::{Case, group};
use silhouette::sphere::Order;
use silhouette::visibility::{Skips, View, Viewer};

/// Scene and receivers timed.
const SCENES: [(&str, usize); 6] =
    [("icosphere", 256), ("room", 256), ("building", 256), ("knots_100k", 64), ("knots_2m", 48), ("foliage", 24)];

/// Rounding of thousands of arcs: nothing beside the rays' own error.
const TOLERANCE: f64 = 1e-9;

/// The steps of one receiver's life: the search, of its tile and as far as it is needed, is part of the region's.
const STEPS: [&str; 2] = ["region", "integrals"];

struct Engine<'a> {
    case: &'a Case,
    viewer: Viewer<'a>,
    view: View,
    order: Order,
    /// What each step has taken.
    steps: [Duration; 2],
}

impl Engine<'_> {
    /// Every receiver's coefficients, one row after another.
    fn harmonics(&mut self, tiles: &[Vec<u32>]) -> Vec<f64> {
        let mut rows = Vec::new();
        let mut row = vec![0.0; self.order.len()];
        let mut clock = Instant::now();
        let mut lap = |step: &mut Duration| {
            let now = Instant::now();
            *step += now - clock;
            clock = now;
        };
        let [solution, integrals] = &mut self.steps;
        for tile in tiles {
            let receivers = tile.iter().map(|&i| self.case.receivers.get(i as usize));
            self.viewer.approach(receivers.clone(), &mut self.view);
            for receiver in receivers {
                let region = self.viewer.solve(0, receiver, Skips::default(), &mut self.view);
                lap(solution);
                assert!(!region.residuals().alarm(), "{:?}", region.residuals());
                region.harmonics(self.order, &mut row);
                rows.extend_from_slice(&row);
                lap(integrals);
            }
        }
        rows
    }
}

fn bench(criterion: &mut Criterion) {
    for (name, count) in SCENES {
        let case = Case::new(name);
        let (edges, faces) = case.searches();
        let tiles = case.tiles(count);
        let count = tiles.iter().map(Vec::len).sum::<usize>();
        let order = Order::new(4).expect("few bands");
        let viewer = Viewer { edges: &edges, faces: &faces };
        let mut engine = Engine { case: &case, viewer, view: View::default(), order, steps: Default::default() };

        let judged = case.judge(&tiles[0]);
        let rows = engine.harmonics(&tiles[..1]);
        judged.harmonics.check(&format!("{name}: exact harmonics"), &rows, TOLERANCE);
        engine.steps = Default::default();
        engine.harmonics(&tiles);
        let microseconds = engine.steps.map(|step| step.as_secs_f64() * 1e6 / count as f64);
        let steps: Vec<String> = STEPS.iter().zip(microseconds).map(|(step, us)| format!("{step} {us:.1}")).collect();
        println!("{name}: {count} receivers in {} tiles; us per receiver: {}", tiles.len(), steps.join(", "));

        let mut group = group(criterion, name, count);
        group.bench_function("exact", |b| b.iter(|| black_box(engine.harmonics(&tiles))));
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
