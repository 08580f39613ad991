use std::collections::BTreeMap;

use serde::Serialize;

use super::PlanReport;

/// What a run did and how long it took.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Receivers solved.
    pub receivers: u64,
    /// Method by name.
    pub method: String,
    /// Bands of the spherical harmonics.
    pub order: usize,
    /// Triangles that cast shadows, after cleaning.
    pub triangles: u64,
    /// Threads used.
    pub threads: usize,
    /// Seconds to build the search structures.
    pub build_seconds: f64,
    /// Seconds to solve all receivers.
    pub integrate_seconds: f64,
    /// Seconds of processor time of that, all threads together; the whole process's.
    pub processor_seconds: f64,
    /// Mean number of contour edges a receiver sees.
    pub contours_per_receiver: f64,
    /// Receivers that raised an alarm: the depth complexity's bookkeeping, or another identity, failed there. All of them
    /// were solved again; see `fallbacks`.
    pub depth_alarms: u64,
    /// How the method was chosen, if it was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan: Option<PlanReport>,
    /// Root mean square of the error in the worst array, from the errors stated; only of a method that was chosen for an error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub estimated_error: Option<f64>,
    /// Counters of work that was not needed, by name.
    pub skipped: BTreeMap<String, u64>,
    /// Counters of receivers solved again another way after an alarm, by that way's name.
    pub fallbacks: BTreeMap<String, u64>,
}

impl Statistics {
    /// The statistics of this run and of another one of the same kind after it, as one.
    #[must_use]
    pub fn then(mut self, other: Self) -> Self {
        let contours = [&self, &other].map(|run| run.contours_per_receiver * run.receivers as f64);
        self.receivers += other.receivers;
        self.contours_per_receiver = contours.iter().sum::<f64>() / self.receivers.max(1) as f64;
        self.build_seconds += other.build_seconds;
        self.integrate_seconds += other.integrate_seconds;
        self.processor_seconds += other.processor_seconds;
        self.depth_alarms += other.depth_alarms;
        for (counts, more) in [(&mut self.skipped, other.skipped), (&mut self.fallbacks, other.fallbacks)] {
            more.into_iter().for_each(|(name, count)| *counts.entry(name).or_default() += count);
        }
        self
    }

    /// One line about the receivers that raised an alarm and how they were solved again; none if there are none.
    pub fn second_looks(&self) -> Option<String> {
        let ways = self.fallbacks.iter().filter(|(_, count)| **count > 0);
        let ways: Vec<String> = ways.map(|(name, count)| format!("{count} by {}", name.replace('_', " "))).collect();
        let alarms = self.depth_alarms;
        (alarms > 0).then(|| {
            format!(
                "{alarms} of {} receivers raised an alarm and were solved again: {}",
                self.receivers,
                ways.join(", ")
            )
        })
    }

    /// The statistics as indented JSON, ending in a newline.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and strings always serialise") + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_add_up() {
        let run = |receivers, contours, open| Statistics {
            receivers,
            contours_per_receiver: contours,
            integrate_seconds: 0.5,
            depth_alarms: 1,
            skipped: [("open_receivers".into(), open)].into(),
            method: "isolines".into(),
            ..Statistics::default()
        };
        let both = run(10, 3.0, 2).then(run(30, 5.0, 4));
        let expected = Statistics { integrate_seconds: 1.0, depth_alarms: 2, ..run(40, 4.5, 6) };
        assert_eq!(both, expected);
        assert_eq!(run(10, 3.0, 2).then(run(0, 0.0, 0)).contours_per_receiver, 3.0);
    }

    #[test]
    fn second_looks_are_told_apart() {
        let mut statistics = Statistics { receivers: 9, ..Statistics::default() };
        assert_eq!(statistics.second_looks(), None);
        statistics.depth_alarms = 3;
        statistics.fallbacks =
            [("rotated_frame", 2), ("other_method", 0), ("rays", 1)].map(|(k, n)| (k.into(), n)).into();
        let line = statistics.second_looks().unwrap();
        assert_eq!(line, "3 of 9 receivers raised an alarm and were solved again: 1 by rays, 2 by rotated frame");
    }
}
