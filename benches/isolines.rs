//! Time of one receiver along isolines, from the search for its contours to its integrals. What is timed is first compared
//! with rays. (The search alone: `cargo bench -p dual_bvh`.)

mod scene;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use dual_bvh::DualBvh;
use scene::{Case, group};
use silhouette::integrand::{LightMoments, LightTable, LineHarmonics, LineMoments, ambient_occlusion};
use silhouette::scene::FaceTree;
use silhouette::sphere::{Order, hemisphere};
use silhouette::visibility::{
    Frame, Isolines, MeridianFrame, Meridians, Sight, Skips, Spans, View, Viewer, open_spans,
};

/// Scene and receivers timed.
const SCENES: [(&str, usize); 6] =
    [("icosphere", 256), ("room", 256), ("building", 256), ("knots_100k", 256), ("knots_2m", 64), ("foliage", 64)];
const LINES: [usize; 3] = [16, 64, 256];

/// Bound on the error along N lines, over N: an interval's end is known to a slab's width, which is 2 / N, and the errors
/// of the slabs, of either sign, do not add up to more than a few of their own size. Measured errors are far smaller.
const FIRST_ORDER: f64 = 0.5;

/// The same of the sky's light, whose total is pi, and of which a small sun holds most: past an edge it is seen whole or not at all
/// along few lines, at a share of the receivers.
const FIRST_ORDER_OF_LIGHT: f64 = 16.0;

/// A scene ready for one number of isolines.
struct Engine<'a> {
    case: &'a Case,
    edges: &'a DualBvh,
    faces: &'a FaceTree,
    isolines: Isolines,
    meridians: Meridians,
    view: View,
}

impl Engine<'_> {
    /// Every receiver's coefficients, one row after another.
    fn harmonics(&mut self, tiles: &[Vec<u32>], table: &LineHarmonics) -> Vec<f64> {
        let viewer = Viewer { edges: self.edges, faces: self.faces };
        let mut moments = LineMoments::default();
        let (mut local, mut row) = (Vec::new(), vec![0.0; table.order().len()]);
        let mut rows = Vec::new();
        for tile in tiles {
            let receivers = tile.iter().map(|&i| self.case.receivers.get(i as usize));
            viewer.approach(receivers.clone(), &mut self.view);
            for receiver in receivers {
                let frame = MeridianFrame::facing(receiver.normal, false);
                row.fill(0.0);
                let sight = viewer.trace(&self.meridians, frame, receiver, Skips::default(), &mut self.view);
                match (sight, receiver.normal) {
                    (Sight::Open, Some(normal)) => row.copy_from_slice(&hemisphere(table.order(), normal)),
                    (Sight::Part(_), _) => {
                        table.integrate(self.view.spans(), &mut moments);
                        let [even, odd] = &moments.sets;
                        local.clear();
                        local.extend(even.iter().zip(odd).map(|(even, odd)| even + odd));
                        table.turn(frame, &local, &mut row);
                    }
                    _ => {}
                }
                rows.extend(&row);
            }
        }
        rows
    }

    /// Every receiver's vector irradiance, colours of axes, one row after another.
    fn light(&mut self, tiles: &[Vec<u32>], table: &LightTable) -> Vec<f64> {
        let viewer = Viewer { edges: self.edges, faces: self.faces };
        let (mut moments, mut open) = (LightMoments::default(), Spans::default());
        let mut rows = Vec::new();
        for tile in tiles {
            let receivers = tile.iter().map(|&i| self.case.receivers.get(i as usize));
            viewer.approach(receivers.clone(), &mut self.view);
            for receiver in receivers {
                let frame = Frame::facing(receiver.normal, 0);
                let light = match viewer.follow(&self.isolines, frame, receiver, Skips::default(), &mut self.view) {
                    Sight::Enclosed => Default::default(),
                    sight => {
                        let is_open = sight == Sight::Open;
                        if is_open {
                            open_spans(&self.isolines, frame, receiver.normal, &mut open);
                        }
                        table.integrate(frame, if is_open { &open } else { self.view.spans() }, &mut moments);
                        moments.vectors()
                    }
                };
                rows.extend(light.iter().flat_map(|light| light.to_array()));
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
        println!("{name}: {count} receivers in {} tiles", tiles.len());
        let all = tiles.concat();
        let judged = case.judge(&all);

        let mut group = group(criterion, name, count);
        for lines in LINES {
            let isolines = Isolines::new(lines).expect("an even number");
            let tolerance = FIRST_ORDER / lines as f64;
            let meridians = Meridians::new(2 * lines).expect("a few");
            let [occlusion, harmonics] =
                [2, 4].map(|bands| LineHarmonics::new(Order::new(bands).expect("few bands"), &meridians));
            let light = LightTable::new(&isolines, &case.environment);
            let mut engine =
                Engine { case: &case, edges: &edges, faces: &faces, isolines, meridians, view: View::default() };

            let rows = engine.harmonics(&tiles, &occlusion);
            let normals = all.iter().map(|&i| case.receivers.normals[i as usize]);
            let values: Vec<f64> =
                rows.chunks_exact(4).zip(normals).map(|(row, n)| ambient_occlusion(row, n)).collect();
            judged.occlusion.check(&format!("{name}: occlusion along {lines} lines"), &values, tolerance);
            let rows = engine.harmonics(&tiles, &harmonics);
            judged.harmonics.check(&format!("{name}: harmonics along {lines} lines"), &rows, tolerance);
            let rows = engine.light(&tiles, &light);
            judged.light.check(
                &format!("{name}: light along {lines} lines"),
                &rows,
                FIRST_ORDER_OF_LIGHT / lines as f64,
            );

            group.bench_function(BenchmarkId::new("occlusion", lines), |b| {
                b.iter(|| black_box(engine.harmonics(&tiles, &occlusion)));
            });
            group.bench_function(BenchmarkId::new("harmonics", lines), |b| {
                b.iter(|| black_box(engine.harmonics(&tiles, &harmonics)));
            });
            group.bench_function(BenchmarkId::new("light", lines), |b| {
                b.iter(|| black_box(engine.light(&tiles, &light)));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
