//! What is integrated over the visible region.

mod light_table;
mod line_harmonics;
mod occlusion;

pub use light_table::{LightMoments, LightTable};
pub use line_harmonics::{LineHarmonics, LineMoments};
pub use occlusion::{ambient_occlusion, bent_normal, transfer, visible_moment};
