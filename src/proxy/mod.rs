//! Sphere proxies: blockers and bouncers of light that move and deform, where contours would have to be found anew.

mod character;
mod clip;
mod cover;
mod fit;
mod outside_volume;
mod solid;
mod sphere_set;
mod tightness;

pub use character::{Character, Pose};
pub use clip::Clip;
pub use fit::fit;
pub use outside_volume::{enclosed_volume, outside_volume};
pub use sphere_set::{Joint, MAX_SPHERES, Sphere, SphereSet};
pub use tightness::Tightness;
