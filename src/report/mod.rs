//! Tables and pictures of errors.

mod compare;
mod film;
mod hemisphere;
mod inspection;
mod judgement;
mod orthographic;
mod panel;
mod picture;
mod plot;
mod preview;
mod spheres;

pub use compare::{Comparison, Difference, Results};
pub use film::Film;
pub use hemisphere::draw_view;
pub use inspection::{EnvironmentInspection, Inspection, draw_environment, draw_geometry};
pub use judgement::{Deviation, Judgement, Verdict};
pub use picture::{Decades, Picture};
pub use plot::{Curve, Plot};
pub use preview::preview;
pub use spheres::draw_spheres;
