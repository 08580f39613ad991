//! The race: its tables' contract, and that a false method does not count.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering::SeqCst};

use silhouette::bake::{Array, Arrays, Control, Prepared};
use silhouette::race::{
    Builds, Contestant, Curve, Entrant, Quantity, Row, Run, Settings, Track, Truth, Verdict, race, run_event,
};
use silhouette::scene::Scene;
use silhouette::{Error, Result};

const QUICK: Settings = Settings { repeats: 1, budget: 0.01 };

fn track() -> Result<Track> {
    let scene = Scene::builtin("icosphere")?;
    Track::new("icosphere".into(), scene.geometry, scene.environment, 64, 256)
}

/// Another contestant's values, some of them changed.
struct Liar<'a> {
    honest: &'a Entrant<'a>,
    name: &'static str,
    lie: fn(usize) -> f64,
}

impl Contestant for Liar<'_> {
    fn name(&self) -> &str {
        self.name
    }

    fn ladder(&self) -> Vec<f64> {
        vec![64.0, 256.0]
    }

    fn run(&self, setting: f64, repeat: u32, control: &dyn Control) -> Result<Run> {
        let mut run = self.honest.run(setting, repeat, control)?;
        let mut changed = Arrays::new();
        for array in &run.outcome.arrays {
            let lie = |(i, value): (usize, &f64)| {
                if array.name.ends_with("_error") { *value } else { value + (self.lie)(i) }
            };
            let data = array.data.iter().enumerate().map(lie).collect();
            changed.push(Array::new(array.name.clone(), array.shape.clone(), data))?;
        }
        run.outcome.arrays = changed;
        Ok(run)
    }
}

#[test]
fn a_method_that_is_worse_than_it_states_does_not_count() {
    let track = track().unwrap();
    let prepared = Prepared::new(&track.geometry, Some(&track.environment));
    let quantity = Quantity::Occlusion;
    let truth = Truth::find(&prepared, &track.receivers, &quantity.request(), &()).unwrap();
    assert!(truth.error < 1e-9 && truth.replaced == 0);
    let builds = Builds::measure(&prepared, &track, &()).unwrap();
    let entrants = Entrant::all(&prepared, &track, quantity, &builds, &()).unwrap();
    let isolines = entrants.iter().find(|entrant| entrant.name() == "isolines").unwrap();
    let all = Liar { honest: isolines, name: "all", lie: |_| 0.05 };
    let one = Liar { honest: isolines, name: "one", lie: |i| if i == 17 { 0.5 } else { 0.0 } };
    let none = Liar { honest: isolines, name: "none", lie: |_| 0.0 };
    let mut rows = Vec::new();
    run_event(&track, quantity, &[&all, &one, &none], &truth, Settings { repeats: 2, ..QUICK }, &(), &mut rows)
        .unwrap();
    let of = |name: &str| rows.iter().filter(|row| row.method == name).collect::<Vec<&Row>>();
    for name in ["all", "one"] {
        assert!(!of(name).is_empty());
        for row in of(name) {
            assert!(matches!(&row.verdict, Verdict::Disqualified(why) if why.contains("off by")), "{row:?}");
        }
        assert_eq!(Curve::new(of(name).into_iter()).at(1.0), None, "its time must not count");
    }
    assert!(of("none").iter().all(|row| row.counts()), "{rows:?}");
    assert!(Curve::new(of("none").into_iter()).at(1e-2).is_some());
}

/// Asks to stop after a number of steps.
struct Impatient(AtomicU64);

impl Control for Impatient {
    fn advance(&self, steps: u64) {
        self.0.fetch_sub(steps.min(self.0.load(SeqCst)), SeqCst);
    }

    fn cancelled(&self) -> bool {
        self.0.load(SeqCst) == 0
    }
}

fn run(folder: &Path, quantities: &[Quantity], threads: &[usize], control: &dyn Control) -> Result<()> {
    let tracks = std::iter::once(()).map(|()| track());
    let tracks = tracks.collect::<Vec<_>>().into_iter();
    race(tracks, quantities, threads, QUICK, "silhouette race".into(), folder, control).map(drop)
}

#[test]
fn the_report_holds_everything() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("new");
    run(&folder, &Quantity::ALL, &[1, 2], &()).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();

    let csv = read("race.csv");
    let mut lines = csv.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let expected = "scene triangles quantity method setting threads receivers tiles build_s us_per_receiver";
    assert_eq!(header[..10], expected.split(' ').collect::<Vec<_>>());
    let mut methods = vec!["isolines", "exact", "qmc", "auto"];
    if cfg!(feature = "embree") {
        methods.push("embree");
    }
    for quantity in ["AO", "SH(4)", "light"] {
        for method in &methods {
            let rows: Vec<&str> = csv.lines().filter(|line| line.contains(&format!(",{quantity},{method},"))).collect();
            assert!(!rows.is_empty(), "{quantity} {method}");
            assert!(rows.iter().any(|row| row.ends_with(",counts")), "{rows:?}");
        }
    }
    // On two threads only at one setting, and only the occlusion.
    assert_eq!(csv.lines().filter(|line| line.contains(",AO,isolines,256 lines,2,")).count(), 1);
    assert!(!csv.contains(",light,isolines,256 lines,2,"));

    let report = read("race.md");
    for part in ["silhouette race", "Time at equal error", "## Build", "## Targets", "METHODOLOGY", "cores"] {
        assert!(report.contains(part), "{part} in {report}");
    }
    assert!(report.contains("## Threads") && report.contains("| icosphere | isolines | 256 lines | 2 |"), "{report}");
    assert!(read("threads.svg").contains("ideal"));
    for plot in ["icosphere_ao", "icosphere_sh_4", "icosphere_light", "threads"] {
        assert!(read(&format!("{plot}.svg")).contains("isolines"), "{plot}");
        assert!(folder.join(plot).with_extension("png").exists(), "{plot}");
    }
}

#[test]
fn what_is_finished_is_kept_after_an_interruption() {
    let folder = tempfile::tempdir().unwrap();
    // A thousand steps to an event: the second one is interrupted.
    let control = Impatient(AtomicU64::new(1100));
    let result = run(folder.path(), &[Quantity::Occlusion, Quantity::Harmonics], &[1], &control);
    assert!(matches!(result, Err(Error::Interrupted)), "{result:?}");
    let csv = std::fs::read_to_string(folder.path().join("race.csv")).unwrap();
    assert!(csv.contains(",AO,auto,") && !csv.contains(",SH(4),auto,0.001"), "{csv}");
    assert!(folder.path().join("icosphere_ao.svg").exists());
}
