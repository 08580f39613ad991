//! Independent judges: quasi-Monte Carlo by ray casting.

mod crossing;
#[cfg(test)]
mod fixtures;
mod pixel_distribution;
mod qmc;
mod rays;
mod request;
mod sobol;

pub use pixel_distribution::PixelDistribution;
pub use qmc::Qmc;
pub use rays::{Hit, RayScene};
pub use request::{Columns, Estimates, Light, Request};
pub use sobol::Sobol;
