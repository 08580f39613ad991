//! Receivers, the plan, and the writers of results.

mod integrate;
mod layout;
mod progress;
mod receivers;
mod request;
mod tiles;

pub use integrate::{Counts, Solution, Statistics, integrate};
pub use progress::Control;
pub use receivers::Receivers;
pub use request::{Method, Request};
pub use tiles::{TILE_RADIUS, TILE_RECEIVERS};
