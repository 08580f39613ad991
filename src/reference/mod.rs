//! Independent judges: quasi-Monte Carlo by ray casting.

mod crossing;
#[cfg(feature = "embree")]
mod embree;
mod embree_variant;
#[cfg(test)]
mod fixtures;
mod hit;
mod pixel_distribution;
mod qmc;
mod rays;
mod request;
mod sobol;

#[cfg(feature = "embree")]
pub use embree::{EmbreeMemory, EmbreeQmc, EmbreeScene};
pub use embree_variant::{EmbreeKernel, EmbreeQuality, EmbreeVariant};
pub use hit::{Hit, first_hit};
pub use pixel_distribution::PixelDistribution;
pub use qmc::Qmc;
pub use rays::RayScene;
pub use request::{Columns, Estimates, Light, Request};
pub use sobol::Sobol;
