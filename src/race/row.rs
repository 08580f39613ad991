use super::Quantity;

/// One method at one setting in one scene: what a line of the table says.
#[derive(Clone, Debug)]
pub struct Row {
    /// The scene's name.
    pub scene: String,
    /// Its size.
    pub triangles: usize,
    /// What was integrated.
    pub quantity: Quantity,
    /// `isolines`, `exact`, `qmc`, `embree`, `auto`.
    pub method: String,
    /// The setting in words: `256 lines`, `1024 rays`, `1e-3`.
    pub setting: String,
    /// Lines or rays; for `auto` the error asked for; 0 where there is nothing to set.
    pub count: f64,
    /// Threads that it ran on.
    pub threads: usize,
    /// Receivers that were measured.
    pub receivers: usize,
    /// Tiles that they are, each with one search for contours.
    pub tiles: usize,
    /// Seconds to build everything that the method needs, from nothing.
    pub build_seconds: f64,
    /// Seconds per receiver: of the processor on one thread, on the clock on several. The least of all repeats.
    pub seconds: f64,
    /// Seconds per receiver on the clock, the least of all repeats: by these, numbers of threads are compared.
    pub clock: f64,
    /// Seconds per receiver of a whole bake that planning takes; only `auto` plans.
    pub planning: f64,
    /// Root mean square of the difference from the reference.
    pub rmse: f64,
    /// Largest absolute difference.
    pub worst: f64,
    /// Root mean square of the errors that the method states.
    pub stated: f64,
    /// Whether the time counts.
    pub verdict: Verdict,
}

/// Whether a row's time counts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Its values are as good as they claim.
    Counts,
    /// They are not, and why.
    Disqualified(String),
}

impl Row {
    /// Whether the time counts.
    pub fn counts(&self) -> bool {
        self.verdict == Verdict::Counts
    }

    /// Seconds per receiver, with what planning costs each.
    pub fn total(&self) -> f64 {
        self.seconds + self.planning
    }
}
