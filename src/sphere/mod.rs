//! The unit sphere: octahedral map, harmonics, arcs, closed forms.

pub mod closed_forms;
mod cosine_product;
mod harmonics;
mod octahedron;
mod product;
mod quadrature;
mod rotation;
mod zonal;

pub use cosine_product::cosine_product;
pub use harmonics::{Order, evaluate, evaluate_many, index};
pub use octahedron::{Sheet, octahedral, octahedral_direction, octahedral_jacobian};
pub use product::{TripleEntry, TripleProduct};
pub use quadrature::{gauss_legendre, product_rule};
pub use rotation::rotate;
pub use zonal::{cap, clamped_cosine, hemisphere, legendre, rotate_zonal, zonal_cap};
