//! What is integrated over the visible region.

mod harmonic_light;
mod light_patches;
mod light_region;
mod light_table;
mod line_harmonics;
mod occlusion;

pub use harmonic_light::{environment_harmonics, even_vector_irradiance, relit};
pub use light_region::LightRegion;
pub use light_table::{LightMoments, LightTable};
pub use line_harmonics::{LineHarmonics, LineMoments};
pub use occlusion::{ambient_occlusion, bent_normal, transfer, visible_moment};
