//! What is integrated over the visible region.

mod light_table;
mod line_harmonics;

pub use light_table::LightTable;
pub use line_harmonics::{LineHarmonics, LineMoments};
