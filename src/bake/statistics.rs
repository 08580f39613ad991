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
    /// The statistics as indented JSON, ending in a newline.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and strings always serialise") + "\n"
    }
}
