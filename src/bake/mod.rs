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
pub use channels::{components, flip_phase};
pub use partial::Partial;
pub use progress::Control;
pub use provenance::{Phase, Provenance};
pub use request::{Method, Outcome, Request};
pub use statistics::Statistics;

/// Computes what `request` asks for by `method` on `threads` threads, going on from `resume` if there is one.
///
/// # Errors
/// Always, until the engine is connected.
pub fn integrate(
    request: &Request,
    method: Method,
    threads: usize,
    resume: Option<Partial>,
    control: &dyn Control,
) -> crate::Result<Outcome> {
    let _ = (request, method, threads, resume, control);
    Err(crate::Error::input("not wired yet"))
}
