//! Independent judges: quasi-Monte Carlo by ray casting.

mod crossing;
#[cfg(test)]
mod fixtures;
mod pixel_distribution;
mod qmc;
mod rays;
mod sobol;

pub use pixel_distribution::PixelDistribution;
pub use qmc::{Columns, Estimates, Light, Qmc, Request};
pub use rays::{Hit, RayScene};
pub use sobol::Sobol;
