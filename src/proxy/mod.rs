//! Sphere proxies: blockers and bouncers of light that move and deform, where contours would have to be found anew.

mod sphere_set;

pub use sphere_set::{Sphere, SphereSet};
