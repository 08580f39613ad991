//! Tables and pictures of errors.

mod compare;
mod panel;
mod picture;
mod plot;

pub use compare::{Comparison, Difference, Results};
pub use picture::{Decades, Picture};
pub use plot::{Curve, Plot};
