use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use rayon::ThreadPoolBuilder;

use crate::bake::writers::atomically;
use crate::bake::{Control, Prepared, Unmoved};
use crate::{Error, Result};

use super::contestant::{AtOneSetting, Builds, Contestant, Entrant};
use super::event::{EVENT_STEPS, Settings, run_event};
use super::{Comparison, Gain, Machine, Quantity, Row, Track, Truth, Verdict};

/// All that a race found, and how.
#[derive(Clone, Debug)]
pub struct Race {
    /// What it ran on.
    pub machine: Machine,
    /// The command that was given.
    pub command_line: String,
    /// How hard it tried.
    pub settings: Settings,
    /// Every contestant at every setting.
    pub rows: Vec<Row>,
    /// What leaving needless work undone gains.
    pub gains: Vec<Gain>,
    /// What else is to be known, a sentence each.
    pub notes: Vec<String>,
}

/// Settings at which threads are compared: one that is typical for each method.
pub(super) const TYPICAL: [(&str, f64); 4] = [("isolines", 256.0), ("exact", 0.0), ("qmc", 1024.0), ("embree", 1024.0)];

/// Races over `tracks` for `quantities`, on the first number of `threads`; on the others each method runs once more, at one
/// typical setting, for the occlusion. After every event the tables and plots of all so far are written into `folder`, which is made if it
/// is missing.
///
/// # Errors
/// A track that cannot be made; [`Error::Interrupted`], after what is finished has been written; as [`run_event`].
pub fn race(
    tracks: impl ExactSizeIterator<Item = Result<Track>>,
    quantities: &[Quantity],
    threads: &[usize],
    settings: Settings,
    command_line: String,
    folder: &Path,
    control: &dyn Control,
) -> Result<Race> {
    std::fs::create_dir_all(folder).map_err(|error| Error::file(folder, error))?;
    let pools = threads.iter().map(|&count| ThreadPoolBuilder::new().num_threads(count).build());
    let pools = pools.collect::<std::result::Result<Vec<_>, _>>();
    let pools =
        pools.map_err(|error| Error::input(format!("the threads cannot be started ({error}); ask for fewer")))?;
    let mut race = Race {
        machine: Machine::here(),
        command_line,
        settings,
        rows: Vec::new(),
        gains: Vec::new(),
        notes: Vec::new(),
    };
    control.begin("racing", EVENT_STEPS * (tracks.len() * quantities.len()) as u64);
    for track in tracks {
        let track = track?;
        let mut prepared = Prepared::new(&track.geometry, Some(&track.environment));
        let [first, more @ ..] = &pools[..] else { return Err(Error::input("a race needs a thread")) };
        let builds = first.install(|| Builds::measure(&prepared, &track, control))?;
        for &quantity in quantities {
            let result = first.install(|| race.event(&track, &prepared, &builds, quantity, None, control));
            let on_more = |pool: &rayon::ThreadPool| {
                pool.install(|| race.event(&track, &prepared, &builds, quantity, Some(&TYPICAL), &Unmoved(control)))
            };
            let more = if quantity == Quantity::Occlusion { more } else { &[] };
            let result = result.and_then(|()| more.iter().try_for_each(on_more));
            race.write(folder)?;
            result?;
        }
        for quantity in [Quantity::Occlusion, Quantity::Light] {
            race.gains.extend(first.install(|| Gain::measure(&mut prepared, &track, quantity, control))?);
        }
        race.write(folder)?;
    }
    Ok(race)
}

impl Race {
    /// One quantity on one track, on the threads of the current pool: all settings, or only those named.
    fn event(
        &mut self,
        track: &Track,
        prepared: &Prepared,
        builds: &Builds,
        quantity: Quantity,
        only: Option<&[(&str, f64)]>,
        control: &dyn Control,
    ) -> Result<()> {
        let truth = Truth::find(prepared, &track.receivers, &quantity.request(), control)?;
        if only.is_none() && truth.replaced > 0 {
            self.notes.push(format!(
                "{}, {quantity}: at {} of {} receivers rays decided for the isolines' value as reference.",
                track.name,
                truth.replaced,
                track.receivers.len()
            ));
        }
        let entrants = Entrant::all(prepared, track, quantity, builds, control)?;
        let fixed: Vec<AtOneSetting> = only
            .unwrap_or_default()
            .iter()
            .filter_map(|&(name, setting)| {
                Some(AtOneSetting { contestant: entrants.iter().find(|entrant| entrant.name() == name)?, setting })
            })
            .collect();
        let contestants: Vec<&dyn Contestant> = match only {
            Some(_) => fixed.iter().map(|entrant| entrant as _).collect(),
            None => entrants.iter().map(|entrant| entrant as _).collect(),
        };
        run_event(track, quantity, &contestants, &truth, self.settings, control, &mut self.rows)
    }

    /// Rows of the main number of threads, scene by scene and quantity by quantity.
    pub(super) fn events(&self) -> Vec<Vec<&Row>> {
        let mut events: Vec<Vec<&Row>> = Vec::new();
        let main = self.rows.first().map(|row| row.threads);
        for row in self.rows.iter().filter(|row| Some(row.threads) == main) {
            match events.iter_mut().find(|rows| rows[0].scene == row.scene && rows[0].quantity == row.quantity) {
                Some(rows) => rows.push(row),
                None => events.push(vec![row]),
            }
        }
        events
    }

    /// How many times as fast, on the clock, a row was as the same setting on the first number of threads; none if the values of either
    /// do not count.
    pub fn speed_up(&self, row: &Row) -> Option<f64> {
        let main = self.rows.first()?.threads;
        let before = self.rows.iter().find(|other| {
            other.threads == main
                && (&other.scene, other.quantity, &other.method) == (&row.scene, row.quantity, &row.method)
                && other.count == row.count
        })?;
        let can_be_compared = before.counts() && row.counts() && before.clock > 0.0 && row.clock > 0.0;
        can_be_compared.then(|| before.clock / row.clock)
    }

    /// Times at equal error, event by event.
    pub fn comparisons(&self) -> Vec<Comparison> {
        self.events().iter().flat_map(|rows| Comparison::of(rows)).collect()
    }

    /// Writes `race.csv`, `race.md` and all plots, each as `.svg` and `.png`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        for (name, text) in [("race.csv", self.csv()), ("race.md", self.markdown())] {
            let path = folder.join(name);
            atomically(&path, |file| file.write_all(text.as_bytes()).map_err(|error| Error::file(&path, error)))?;
        }
        for (name, plot) in self.plots() {
            for extension in ["svg", "png"] {
                plot.write(&folder.join(&name).with_extension(extension))?;
            }
        }
        Ok(())
    }

    /// Every row, a line each, times in microseconds.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "scene,triangles,quantity,method,setting,threads,receivers,tiles,build_s,us_per_receiver,planning_us_per_receiver,\
             clock_us_per_receiver,speed_up,rmse,worst,stated_rms,verdict\n",
        );
        for row in &self.rows {
            let verdict = match &row.verdict {
                Verdict::Counts => "counts".to_owned(),
                Verdict::Disqualified(why) => format!("disqualified: {why}"),
            };
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{:.4},{:.4},{:.4},{:.4},{},{:.3e},{:.3e},{:.3e},{}",
                quoted(&row.scene),
                row.triangles,
                row.quantity,
                row.method,
                quoted(&row.setting),
                row.threads,
                row.receivers,
                row.tiles,
                row.build_seconds,
                1e6 * row.seconds,
                1e6 * row.planning,
                1e6 * row.clock,
                self.speed_up(row).map_or(String::new(), |ratio| format!("{ratio:.3}")),
                row.rmse,
                row.worst,
                row.stated,
                quoted(&verdict),
            );
        }
        text
    }

    /// What a reader wants to know first: times at equal error, ratios beside what is aimed for, what did not count.
    pub fn markdown(&self) -> String {
        let mut text = format!(
            "# Race\n\n{}.\n\n`{}`\n\nAt most {} s a run, {} rounds. How it was measured, and in whose favour it leans: \
             `benches/METHODOLOGY.md`. All rows: `race.csv`.\n",
            self.machine, self.command_line, self.settings.budget, self.settings.repeats
        );
        self.write_targets(&mut text);
        self.write_times(&mut text);
        self.write_threads(&mut text);
        self.write_builds(&mut text);
        self.write_gains(&mut text);
        let bad: Vec<&Row> = self.rows.iter().filter(|row| !row.counts()).collect();
        let _ = writeln!(text, "\n## What did not count\n");
        if bad.is_empty() && self.notes.is_empty() {
            text.push_str("Nothing: every row is as good as it states.\n");
        }
        for row in bad {
            if let Verdict::Disqualified(why) = &row.verdict {
                let _ = writeln!(text, "- {}, {}, {}, {}: {why}.", row.scene, row.quantity, row.method, row.setting);
            }
        }
        for note in &self.notes {
            let _ = writeln!(text, "- {note}");
        }
        text
    }

    fn write_targets(&self, text: &mut String) {
        let with_targets = self.comparisons().into_iter().filter(|comparison| comparison.target.is_some());
        let mut lines = String::new();
        let (mut met, mut all) = (0, 0);
        for comparison in with_targets {
            let Comparison { scene, quantity, error, ratio, target, auto, .. } = &comparison;
            let (ratio, target) = (ratio.map_or("-".into(), significant), target.map_or("-".into(), significant));
            let auto = auto.map_or("-".into(), |(slowness, _)| format!("{slowness:.2}"));
            let verdict = match comparison.is_met() {
                Some(true) => "met",
                Some(false) => "**missed**",
                None => "not measured",
            };
            met += u32::from(comparison.is_met() == Some(true));
            all += 1;
            let _ = writeln!(lines, "| {scene} | {quantity} | {error:.0e} | {ratio} | {target} | {auto} | {verdict} |");
        }
        if all > 0 {
            let _ = write!(
                text,
                "\n## Targets\n\nEmbree's time over ours (the better of isolines and exact), at equal error: {met} of {all} \
                 met. Where a draw is asked for, the planner may call rays: it may then take {} times the best \
                 single method.\n\n\
                 | scene | quantity | RMSE | ratio | target | auto / best | |\n|---|---|--:|--:|--:|--:|---|\n{lines}",
                super::targets::SLACK
            );
        }
    }

    fn write_times(&self, text: &mut String) {
        text.push_str(
            "\n## Time at equal error\n\nMicroseconds a receiver; `~` beyond what was measured, by the fitted power law; rays are \
             interpolated between powers of two, except for auto / best, which counts what can be had. Auto includes planning, spread over the whole bake.\n",
        );
        for rows in self.events() {
            let first = rows[0];
            let _ = writeln!(
                text,
                "\n### {}, {} triangles, {}, {} receivers in {} tiles\n",
                first.scene, first.triangles, first.quantity, first.receivers, first.tiles
            );
            let mut methods: Vec<&str> = Vec::new();
            for row in &rows {
                if row.method != "auto" && !methods.contains(&row.method.as_str()) {
                    methods.push(&row.method);
                }
            }
            let _ = writeln!(
                text,
                "| RMSE | {} | embree / ours | auto chose | auto | auto / best | auto's error / asked |",
                methods.join(" | ")
            );
            let _ = writeln!(text, "|--:|{}--:|---|--:|--:|--:|", "--:|".repeat(methods.len()));
            for comparison in Comparison::of(&rows) {
                let time = |method: &str| match comparison.times.iter().find(|(name, _)| name == method) {
                    Some((_, time)) => {
                        format!("{}{}", if time.extrapolated { "~" } else { "" }, significant(1e6 * time.seconds))
                    }
                    None => "-".into(),
                };
                let times: Vec<String> = methods.iter().map(|method| time(method)).collect();
                let auto = rows.iter().find(|row| row.method == "auto" && row.count == comparison.error);
                let chose = auto.and_then(|row| row.setting.split_once(": ")).map_or("-", |(_, setting)| setting);
                let total = auto.map_or("-".into(), |row| significant(1e6 * row.total()));
                let (slowness, reached) = match comparison.auto {
                    Some((slowness, reached)) => (format!("{slowness:.2}"), format!("{reached:.2}")),
                    None => ("-".into(), "-".into()),
                };
                let _ = writeln!(
                    text,
                    "| {:.0e} | {} | {} | {chose} | {total} | {slowness} | {reached} |",
                    comparison.error,
                    times.join(" | "),
                    comparison.ratio.map_or("-".into(), significant),
                );
            }
        }
    }

    fn write_threads(&self, text: &mut String) {
        let Some(first) = self.rows.first().map(|row| row.threads) else { return };
        let mut lines = String::new();
        for row in self.rows.iter().filter(|row| row.threads != first) {
            let Some(ratio) = self.speed_up(row) else { continue };
            let _ = writeln!(
                lines,
                "| {} | {} | {} | {} | {} | {} | {ratio:.2} | {:.0} % |",
                row.scene,
                row.method,
                row.setting,
                row.threads,
                significant(1e6 * ratio * row.clock),
                significant(1e6 * row.clock),
                100.0 * ratio * first as f64 / row.threads as f64
            );
        }
        if !lines.is_empty() {
            let _ = write!(
                text,
                "\n## Threads\n\nOcclusion at one setting of each method, microseconds a receiver on the clock, beside those of \
                 the same setting on {first}.\n\n| scene | method | setting | threads | time on {first} | time | speed-up | of the ideal |\n\
                 |---|---|---|--:|--:|--:|--:|--:|\n{lines}"
            );
        }
    }

    fn write_builds(&self, text: &mut String) {
        text.push_str("\n## Build\n\nSeconds from nothing, the dearest setting's tables included.\n\n");
        text.push_str("| scene | triangles | method | seconds |\n|---|--:|---|--:|\n");
        let mut seen: Vec<(&str, &str)> = Vec::new();
        for rows in self.events() {
            for row in &rows {
                if row.method == "auto" || seen.contains(&(&row.scene, &row.method)) {
                    continue;
                }
                seen.push((&row.scene, &row.method));
                let longest = rows.iter().filter(|other| other.method == row.method).map(|other| other.build_seconds);
                let longest = longest.fold(0.0, f64::max);
                let _ = writeln!(text, "| {} | {} | {} | {longest:.3} |", row.scene, row.triangles, row.method);
            }
        }
    }

    fn write_gains(&self, text: &mut String) {
        if self.gains.is_empty() {
            return;
        }
        let _ = write!(
            text,
            "\n## What is not done\n\nAlong {} isolines, microseconds of processor time a receiver: with all \
             needless work left undone, and with one kind of it done after all.\n\n\
             | scene | of | work | left undone | done | done / undone | same bits |\n|---|---|---|--:|--:|--:|---|\n",
            super::gain::LINES
        );
        for Gain { scene, quantity, skip, with, without, same_bits } in &self.gains {
            let (times, ratio) = ([with, without].map(|time| significant(1e6 * time)), without / with);
            let same = if *same_bits { "yes" } else { "**no**" };
            let _ = writeln!(
                text,
                "| {scene} | {quantity} | {} | {} | {} | {ratio:.2} | {same} |",
                skip.replace('_', " "),
                times[0],
                times[1]
            );
        }
    }
}

/// A number in three significant digits.
fn significant(x: f64) -> String {
    let digits = (2 - x.abs().log10().floor() as i32).clamp(0, 6) as usize;
    format!("{x:.digits$}")
}

/// A field of a table of comma-separated values.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field.into() }
}
