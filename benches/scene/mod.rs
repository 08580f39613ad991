//! What the benchmarks look at, and the check that what they time is right.
#![allow(dead_code, reason = "each benchmark takes what it needs")]

use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, SamplingMode, Throughput};
use dual_bvh::{BuildOptions, DualBvh};
use silhouette::bake::{Receivers, tiles};
use silhouette::reference::{Light, PixelDistribution, Qmc, RayScene, Request};
use silhouette::scene::{Environment, FaceTree, Geometry, Scene};
use silhouette::sphere::Order;

/// A built-in scene with its vertices as receivers.
pub struct Case {
    pub geometry: Geometry,
    pub environment: Environment,
    pub receivers: Receivers,
}

impl Case {
    pub fn new(name: &str) -> Self {
        let scene = Scene::builtin(name).expect("the scene is built in");
        let (receivers, _) = Receivers::vertices(&scene.geometry);
        Self {
            environment: scene.environment.expect("built-in scenes have a sky"),
            geometry: scene.geometry,
            receivers,
        }
    }

    /// What finds contours, and the faces along a ray.
    pub fn searches(&self) -> (DualBvh, FaceTree) {
        let (positions, triangles) = (self.geometry.positions.clone(), self.geometry.triangles.clone());
        let edges = DualBvh::build(positions.clone(), triangles.clone(), &BuildOptions::default()).expect("is clean");
        (edges, FaceTree::new(positions, triangles))
    }

    /// Tiles of a bake of all vertices, spread evenly over it, that hold about `count` receivers. Where few would, more are taken and
    /// cut short: places differ.
    pub fn tiles(&self, count: usize) -> Vec<Vec<u32>> {
        let all = tiles(&self.geometry, &self.receivers.positions, &self.receivers.normals);
        /// Places, at least.
        const PLACES: usize = 6;
        let whole = (count * all.len()).div_ceil(self.receivers.len());
        let (wanted, most) = if whole < PLACES { (PLACES, count.div_ceil(PLACES)) } else { (whole, count) };
        let mut left = count;
        let mut taken: Vec<Vec<u32>> = Vec::new();
        for tile in (0..wanted).map(|i| &all[(2 * i + 1) * all.len() / (2 * wanted)]) {
            let tile = &tile[..tile.len().min(left).min(most)];
            left -= tile.len();
            if !tile.is_empty() {
                taken.push(tile.to_vec());
            }
        }
        taken
    }

    /// Ambient occlusion, harmonics of the visibility of four bands and vector irradiance, one row for each receiver, by
    /// 2^12 rays, and the root mean square of the standard errors of each kind.
    pub fn judge(&self, receivers: &[u32]) -> Judged {
        let qmc = Qmc { samples: 1 << 12, seed: 1 };
        let radiance = |w| self.environment.radiance(w).as_dvec3().to_array();
        let bright = PixelDistribution::of(&self.environment).expect("skies are finite and not black");
        let request = Request {
            ambient_occlusion: true,
            visibility_sh: Some(Order::new(4).expect("four bands are tabulated")),
            vector_irradiance: true,
            light: Some(Light { radiance: &radiance, distribution: Some(&bright) }),
            ..Request::default()
        };
        let seen: Vec<_> = receivers.iter().map(|&i| self.receivers.get(i as usize)).collect();
        let estimates =
            qmc.integrate(&RayScene::new(&self.geometry), &seen, &request).expect("the receivers are finite");
        let columns = request.columns();
        let width = columns.len();
        let part = |range: &std::ops::Range<usize>, of: &[f64]| -> Vec<f64> {
            of.chunks_exact(width).flat_map(|row| &row[range.clone()]).copied().collect()
        };
        let kind =
            |range| Estimate { values: part(&range, &estimates.values), error: rms(part(&range, &estimates.errors)) };
        Judged {
            occlusion: kind(columns.ambient_occlusion),
            harmonics: kind(columns.visibility_sh),
            light: kind(columns.vector_irradiance),
        }
    }
}

/// A group of benchmarks, each of which handles so many receivers.
pub fn group<'a>(criterion: &'a mut Criterion, name: &str, receivers: usize) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_millis(800));
    group.throughput(Throughput::Elements(receivers as u64));
    group
}

/// What independent rays say.
pub struct Judged {
    pub occlusion: Estimate,
    pub harmonics: Estimate,
    pub light: Estimate,
}

/// Values of all receivers, and the rays' own error.
pub struct Estimate {
    values: Vec<f64>,
    error: f64,
}

impl Estimate {
    /// Panics unless `values` are within `tolerance`, and what rays leave open, of the rays'; root mean square.
    pub fn check(&self, what: &str, values: &[f64], tolerance: f64) {
        assert_eq!(values.len(), self.values.len(), "{what}");
        let difference = rms(values.iter().zip(&self.values).map(|(a, b)| a - b));
        assert!(
            difference <= tolerance + 3.0 * self.error,
            "{what}: {difference:.1e} from the rays, whose own error is {:.1e}",
            self.error
        );
    }
}

fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (count, sum) = values.into_iter().fold((0u32, 0.0), |(count, sum), x| (count + 1, sum + x * x));
    (sum / f64::from(count.max(1))).sqrt()
}
