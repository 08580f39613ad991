//! The peer: quasi-Monte Carlo on Embree 3, as fast as a user would have it.

mod caster;
mod directions;
mod integrator;

pub use caster::EmbreeScene;
pub use integrator::{EmbreeQmc, Memory as EmbreeMemory};
