//! The stages on a graphics processor: WGSL twins of the ones on the CPU, by the same names.
//!
//! Proxies are gathered by tiles of receivers and written once, rather than drawn with additive blending: that needs neither
//! blendable targets of single precision nor more than 32 bytes a sample, sums in a fixed order, and takes as long (on Mesa's
//! software device 59 ms against 50 for a splat, both a part of a frame).

mod device;
mod kernel;
mod passes;
mod renderer;
mod setup;
mod source;
#[cfg(test)]
mod tests;

pub use device::Gpu;
pub use renderer::Renderer;
