//! Receivers, the plan, and the writers of results.

mod arrays;
mod assembly;
mod baked;
mod by_rays;
mod channels;
mod integrate;
mod layout;
mod partial;
mod pixels;
mod progress;
mod provenance;
mod receivers;
mod request;
mod solver;
mod statistics;
mod tiles;
pub mod writers;

pub use crate::visibility::Skips;
pub use arrays::{Array, Arrays};
pub use baked::{Baked, BakedImage, BakedVertices};
pub use channels::{components, flip_phase};
pub use integrate::{integrate, integrate_with};
pub use partial::Partial;
pub use pixels::Pixels;
pub use progress::Control;
pub use provenance::{Phase, Provenance};
pub use receivers::Receivers;
pub use request::{Method, Outcome, Request};
pub use statistics::Statistics;
pub use tiles::{TILE_RADIUS, TILE_RECEIVERS, tiles};
