//! Sphere proxies: blockers and bouncers of light that move and deform, where contours would have to be found anew.
//!
//! The renderer of Sloan, Govindaraju, Nowrouzezahrai and Snyder, *Image-Based Proxy Accumulation for Real-Time Soft Global
//! Illumination* (2007), in stages with plain buffers between them:
//!
//! | stage | from | to |
//! |---|---|---|
//! | receiver set-up, [`draw`] | [`Surface`]s and a camera | [`Receivers`]: positions, normals, albedo, depth, transfer vectors |
//! | [`splat()`] | receivers and [`Proxy`]s in reach | log visibility, [`HarmonicBuffer`] |
//! | [`exponentiate`] | log visibility | visibility |
//! | [`splat_indirect()`] | receivers and proxies in reach | reflected irradiance and summed solid angle |
//! | [`shade()`] | visibility, reflected irradiance, light | [`Shading`]: hidden light and reflected irradiance |
//! | [`upsample()`] | the shading of coarse receivers | radiance of every pixel of the display |
//!
//! What goes before a frame: [`share_overlap`] tells spheres how much of what they hide others of their body hide, too, and
//! [`Probes`] tell bodies what the set that stands still hides from them.
//!
//! [`Renderer`] runs the stages. What is stored is the light that proxies *hide*: without proxies a picture is that of the unshadowed
//! scene to the bit, and only pixels that some proxy reaches are touched. [`Truth`] judges the result.

mod actor;
mod basis;
mod character;
mod clip;
mod cover;
mod coverage;
mod direct_product;
mod engine;
mod exponential;
mod exponentiate;
mod fit;
mod frame;
#[cfg(feature = "gpu")]
pub mod gpu;
mod harmonic_buffer;
mod indirect;
mod lanes;
mod light;
mod outside_volume;
mod overlap;
mod probes;
mod receiver_setup;
mod receivers;
mod self_shadow;
mod settings;
mod shade;
mod solid;
mod sphere_proxy;
mod sphere_set;
mod splat;
mod splat_indirect;
mod static_set;
mod surface;
mod tightness;
mod tiles;
mod truth;
mod upsample;
mod walker;
mod zonal_log;

pub use actor::{Actor, Skinned};
pub use basis::{MAX_BANDS, basis};
pub use character::{Character, Pose};
pub use clip::Clip;
pub use coverage::Coverage;
pub use direct_product::{DirectProduct, direct_product};
pub use engine::Engine;
pub use exponential::{Exponential, Exponentiator, ONE, OptimalLinear, SquareTerm, matrix_exponential};
pub use exponentiate::exponentiate;
pub use fit::fit;
pub use frame::{FrameStatistics, Renderer};
pub use harmonic_buffer::HarmonicBuffer;
pub use indirect::{ExactOperator, IndirectOperator, IndirectTable, averaged_operator, exact_operator};
pub use lanes::{LANES, Lanes};
pub use light::{DistantLight, ReflectedLight};
pub use outside_volume::{enclosed_volume, outside_volume};
pub use overlap::{Overlap, share_overlap};
pub use probes::Probes;
pub use receiver_setup::{Rectangle, Viewport, draw};
pub use receivers::Receivers;
pub use self_shadow::{ClippedCap, ClippedCapTable, SelfShadowing, clipped_cap};
pub use settings::Settings;
pub use shade::{Interpolant, Shading, ShadingLight, shade};
pub use sphere_proxy::{MAX_PROXIES, Proxy, check_proxies};
pub use sphere_set::{Joint, MAX_SPHERES, Sphere, SphereSet};
pub use splat::splat;
pub use splat_indirect::{INDIRECT_LEN, splat_indirect};
pub use static_set::{baked_surface, static_surface};
pub use surface::Surface;
pub use tightness::Tightness;
pub use tiles::SplatCounts;
pub use truth::{StaticScene, Truth};
pub use upsample::{Resampling, UpsampleCounts, Upsampling, gather, scatter, upsample};
pub use walker::Posed;
pub use zonal_log::{LogTable, log_visibility};
