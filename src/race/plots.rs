use crate::report::{Curve as Line, Plot};

use super::report::TYPICAL;
use super::{Comparison, Quantity, Race, Row};

impl Race {
    /// Every plot with the name of its file.
    pub(super) fn plots(&self) -> Vec<(String, Plot)> {
        let mut plots = Vec::new();
        for rows in self.events() {
            let first = rows[0];
            let by_method = |row: &Row| Some((row.method.clone(), (1e6 * row.total(), row.rmse)));
            plots.push((
                format!("{}_{}", slug(&first.scene), slug(&first.quantity.to_string())),
                Plot {
                    title: format!("{}, {} triangles, {}", first.scene, first.triangles, first.quantity),
                    x: "microseconds per receiver".into(),
                    y: "RMSE".into(),
                    curves: lines(rows.iter().copied().filter(|row| row.is_point()).filter_map(by_method)),
                },
            ));
        }
        let comparisons = self.comparisons();
        for &quantity in &Quantity::ALL {
            let mut wanted: Vec<(usize, &Comparison)> = comparisons
                .iter()
                .filter(|comparison| comparison.quantity == quantity && comparison.error == 1e-3)
                .filter_map(|comparison| {
                    let row = self.rows.iter().find(|row| row.scene == comparison.scene)?;
                    Some((row.triangles, comparison))
                })
                .collect();
            let family: Vec<_> = wanted.iter().copied().filter(|(_, c)| c.scene.starts_with("knots")).collect();
            if family.len() > 1 {
                wanted = family;
            }
            wanted.sort_by_key(|(triangles, _)| *triangles);
            if wanted.len() > 1 {
                let points = wanted.iter().flat_map(|(triangles, comparison)| {
                    let point = |time: f64| (*triangles as f64, 1e6 * time);
                    comparison.times.iter().map(move |(name, time)| (name.clone(), point(time.seconds)))
                });
                plots.push((
                    format!("triangles_{}", slug(&quantity.to_string())),
                    Plot {
                        title: format!("{quantity} at an RMSE of 1e-3"),
                        x: "triangles".into(),
                        y: "microseconds per receiver".into(),
                        curves: lines(points),
                    },
                ));
            }
        }
        plots.extend(self.threads());
        plots
    }

    /// Time against threads in the largest scene, beside what would be ideal.
    fn threads(&self) -> Option<(String, Plot)> {
        let first = self.rows.first()?.threads;
        let is_typical = |row: &&Row| {
            row.quantity == Quantity::Occlusion && TYPICAL.contains(&(row.method.as_str(), row.count)) && row.counts()
        };
        let largest =
            self.rows.iter().filter(|row| row.threads != first).filter(is_typical).max_by_key(|row| row.triangles)?;
        let rows = self.rows.iter().filter(is_typical).filter(|row| row.scene == largest.scene);
        let mut points: Vec<(String, (f64, f64))> = rows
            .filter_map(|row| Some((row.method.clone(), (row.threads as f64, self.speed_up(row)?.recip()))))
            .collect();
        points.sort_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let mut counts: Vec<f64> = points.iter().map(|(_, (threads, _))| *threads).collect();
        counts.dedup();
        let ideal = counts.into_iter().map(|threads| ("ideal".to_owned(), (threads, first as f64 / threads)));
        let plural = if first == 1 { "" } else { "s" };
        let plot = Plot {
            title: format!("AO in {}: 256 isolines, exact, 1024 rays", largest.scene),
            x: "threads".into(),
            y: format!("time, over that on {first} thread{plural}"),
            curves: lines(points.into_iter().chain(ideal)),
        };
        Some(("threads".into(), plot))
    }
}

/// One line for each name, in the order of first appearance.
fn lines(points: impl Iterator<Item = (String, (f64, f64))>) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for (name, point) in points {
        match lines.iter_mut().find(|line| line.name == name) {
            Some(line) => line.points.push(point),
            None => lines.push(Line { name, points: vec![point] }),
        }
    }
    lines
}

/// A name fit for a file.
fn slug(name: &str) -> String {
    let kept: String =
        name.chars().map(|c| if c.is_alphanumeric() || c == '_' || c == '-' { c } else { ' ' }).collect();
    kept.split_whitespace().collect::<Vec<_>>().join("_").to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::super::{Machine, Settings, Verdict};
    use super::*;

    /// A method whose error falls as its time squared, on so many threads, of which one after the first is worth 0.8.
    fn rows(scene: &str, triangles: usize, method: &str, slowness: f64, threads: usize) -> Vec<Row> {
        let row = |power: i32| Row {
            scene: scene.into(),
            triangles,
            quantity: Quantity::Occlusion,
            method: method.into(),
            setting: format!("{}", 2f64.powi(power)),
            count: 2f64.powi(power),
            threads,
            receivers: 64,
            tiles: 1,
            build_seconds: 1.0,
            seconds: slowness * 2f64.powi(power),
            clock: slowness * 2f64.powi(power) / (0.8 * (threads - 1) as f64 + 1.0),
            planning: 0.0,
            rmse: 4f64.powi(-power),
            worst: 4f64.powi(1 - power),
            stated: 4f64.powi(1 - power),
            verdict: Verdict::Counts,
        };
        if method == "exact" {
            return vec![Row { count: 0.0, rmse: 0.0, ..row(0) }];
        }
        if threads == 1 { (3..12).map(row).collect() } else { vec![row(if method == "qmc" { 10 } else { 8 })] }
    }

    fn race(rows: Vec<Row>) -> Race {
        Race {
            machine: Machine::here(),
            command_line: "silhouette race".into(),
            settings: Settings { repeats: 1, budget: 1.0 },
            rows,
            gains: Vec::new(),
            notes: Vec::new(),
        }
    }

    fn plot(race: &Race, name: &str) -> Option<Plot> {
        race.plots().into_iter().find(|(known, _)| known == name).map(|(_, plot)| plot)
    }

    fn line<'a>(plot: &'a Plot, name: &str) -> &'a [(f64, f64)] {
        &plot.curves.iter().find(|curve| curve.name == name).unwrap().points
    }

    #[test]
    fn time_against_threads_lies_beside_the_ideal() {
        let mut all = rows("small", 10, "isolines", 1e-6, 1);
        for threads in [1, 2, 3] {
            all.extend(rows("large", 100, "isolines", 1e-6, threads));
            all.extend(rows("large", 100, "exact", 1e-4, threads));
            all.extend(rows("large", 100, "qmc", 1e-5, threads));
        }
        let mut race = race(all);
        let plot = plot(&race, "threads").unwrap();
        assert!(plot.title.contains("large") && plot.y.ends_with("on 1 thread"), "{plot:?}");
        let ours = [1.0, 1.8, 2.6];
        for (name, expected) in [("isolines", ours), ("exact", ours), ("qmc", ours), ("ideal", [1.0, 2.0, 3.0])] {
            let points = line(&plot, name);
            for (threads, expected) in (1..=3).zip(expected) {
                let of = points.iter().filter(|point| point.0 == f64::from(threads)).collect::<Vec<_>>();
                assert!(
                    !of.is_empty() && of.iter().all(|point| (point.1 * expected - 1.0).abs() < 1e-12),
                    "{points:?}"
                );
            }
        }
        let csv = race.csv();
        assert!(csv.lines().any(|line| line.contains(",isolines,256,3,") && line.contains(",2.600,")), "{csv}");
        let table = race.markdown();
        assert!(table.contains("| large | qmc | 1024 | 2 | 10240 | 5689 | 1.80 | 90 % |"), "{table}");

        // What is wrong is not fast.
        let wrong = |row: &&mut Row| row.method == "qmc" && row.threads == 2;
        race.rows.iter_mut().find(wrong).unwrap().verdict = Verdict::Disqualified("off".into());
        assert!(!race.markdown().contains("| large | qmc | 1024 | 2 |"));
        assert!(race.csv().lines().any(|line| line.contains(",qmc,1024,2,") && line.contains(",,")));
        assert!(!line(&self::plot(&race, "threads").unwrap(), "qmc").iter().any(|point| point.0 == 2.0));
    }

    #[test]
    fn one_number_of_threads_is_nothing_to_compare() {
        let race = race(rows("small", 10, "isolines", 1e-6, 1));
        assert!(plot(&race, "threads").is_none() && plot(&race, "triangles_ao").is_none());
        assert!(!race.markdown().contains("## Threads"));
    }

    #[test]
    fn time_against_triangles_is_read_at_equal_error() {
        let mut all = rows("large", 1000, "isolines", 4e-6, 1);
        all.extend(rows("small", 10, "isolines", 1e-6, 1));
        let plot = plot(&race(all), "triangles_ao").unwrap();
        // The error is 1e-3 at 31.6 of the knob.
        let expected = [(10.0, 31.6228), (1000.0, 4.0 * 31.6228)];
        for (point, expected) in line(&plot, "isolines").iter().zip(expected) {
            assert!(point.0 == expected.0 && (point.1 / expected.1 - 1.0).abs() < 1e-4, "{point:?}");
        }
        assert_eq!(line(&plot, "isolines").len(), 2);
    }
}
