//! Receivers, the plan, and the writers of results.

mod arrays;
mod baked;
mod channels;
mod partial;
mod progress;
mod provenance;
mod request;
mod statistics;
pub mod writers;

pub use arrays::{Array, Arrays};
pub use baked::{Baked, BakedImage, BakedVertices};
pub use channels::components;
pub use partial::Partial;
pub use progress::Control;
pub use provenance::{Phase, Provenance};
pub use request::{Method, Request};
pub use statistics::Statistics;
