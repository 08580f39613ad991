//! Independent judges: quasi-Monte Carlo by ray casting.

mod crossing;
#[cfg(test)]
mod fixtures;
mod pixel_distribution;
pub mod qmc;
mod rays;
mod sobol;

pub use pixel_distribution::PixelDistribution;
pub use rays::{Hit, RayScene};
pub use sobol::Sobol;
