//! Receivers, the plan, and the writers of results.

mod arrays;
mod assembly;
mod baked;
#[cfg(feature = "embree")]
mod by_embree;
mod by_rays;
mod channels;
mod gradients;
mod integrate;
mod layout;
mod partial;
mod pilot;
mod pixels;
mod plan;
mod prepared;
mod progress;
mod provenance;
mod receivers;
mod request;
mod solver;
mod statistics;
mod tiles;
mod update;
pub mod writers;

pub use crate::visibility::Skips;
pub use arrays::{Array, Arrays};
pub use baked::{Baked, BakedImage, BakedVertices};
pub use channels::{components, flip_phase};
pub use integrate::integrate;
pub use partial::Partial;
pub use pixels::Pixels;
pub use plan::{Candidate, Family, Goal, Plan, PlanReport};
pub use prepared::Prepared;
pub use progress::{Control, Unmoved};
pub use provenance::{Phase, Provenance};
pub use receivers::Receivers;
pub use request::{Method, Outcome, Request};
pub use statistics::Statistics;
pub use tiles::{TILE_RECEIVERS, tiles};
pub use update::Changes;
