//! Methods against each other: time at equal error, every value checked before its time counts.
//!
//! What is compared, and in whose favour the comparison leans, is told in `benches/METHODOLOGY.md`.

mod contestant;
mod curve;
mod event;
mod gain;
mod machine;
mod plots;
mod report;
mod row;
mod targets;
mod track;
mod truth;

pub use contestant::{Builds, Contestant, Entrant, Run};
pub use curve::{Curve, Time};
pub use event::{Settings, run_event};
pub use gain::Gain;
pub use machine::Machine;
pub use report::{Race, race};
pub use row::{Row, Verdict};
pub use targets::{Comparison, TARGETS, Target};
pub use track::{Quantity, Track, over_plane};
pub use truth::{Distance, Truth};
