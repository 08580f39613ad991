//! Time of a whole bake, from the built-in scene to a file. A sample of what it gives is first compared with rays.

mod scene;

use std::time::Duration;

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use scene::Case;
use silhouette::bake::writers::write;
use silhouette::bake::{Baked, BakedVertices, Method, Provenance, Request, integrate};

/// A quarter of what the command uses.
const METHOD: Method = Method::Isolines { lines: 64 };

fn bake() -> BakedVertices {
    let Case { geometry, receivers, .. } = Case::new("default");
    let request = Request {
        ambient_occlusion: true,
        visibility_sh: true,
        transfer_sh: true,
        bent_normal: true,
        ..Request::default()
    };
    let outcome = integrate(&geometry, None, &receivers, &request, METHOD, None, &()).expect("the scene is clean");
    BakedVertices {
        positions: receivers.positions,
        normals: receivers.normals,
        triangles: geometry.triangles,
        arrays: outcome.arrays,
        provenance: Provenance::new(METHOD.to_string()),
    }
}

fn bench(criterion: &mut Criterion) {
    let case = Case::new("default");
    let baked = bake();
    let sample: Vec<u32> = (0..case.receivers.len() as u32).step_by(100).collect();
    let judged = case.judge(&sample);
    let rows = |name: &str| -> Vec<f64> {
        let array = baked.arrays.get(name).expect("was asked for");
        let width = array.data.len() / array.shape[0];
        sample.iter().flat_map(|&i| &array.data[i as usize * width..][..width]).copied().collect()
    };
    // Measured at 64 lines: below 1e-3; see isolines.rs.
    judged.occlusion.check("occlusion", &rows("ambient_occlusion"), 4e-3);
    judged.harmonics.check("harmonics", &rows("visibility_sh"), 8e-3);

    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = folder.path().join("baked.npz");
    let mut group = criterion.benchmark_group("bake");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(10));
    group.throughput(Throughput::Elements(case.receivers.len() as u64));
    group.bench_function("default scene, 64 lines, .npz", |b| {
        b.iter(|| write(&path, &Baked::Vertices(bake())).expect("the folder is writable"));
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
