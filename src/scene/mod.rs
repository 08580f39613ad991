//! What is looked at: geometry, environment light, camera, scene files.

mod geometry;

pub use geometry::{Cleaning, Geometry, Material};
