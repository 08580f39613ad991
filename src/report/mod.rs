//! Tables and pictures of errors.

mod compare;
mod picture;
mod plot;

pub use compare::{Comparison, Difference, Results};
pub use picture::Picture;
pub use plot::{Curve, Plot};
