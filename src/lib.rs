//! Exact visibility for rendering.

pub mod bake;
pub mod cli;
mod error;
pub mod integrand;
pub mod reference;
pub mod report;
pub mod scene;
pub mod sphere;
pub mod stress;
pub mod visibility;

pub use error::{Error, Result};
