//! Runs of edges of which each starts where the one before ends: they keep their slots in the bands.

use std::ops::Range;

use glam::Vec3;

use super::edges::Edge;

/// The edge that a chain has come to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chain {
    pub edge: u32,
    /// Its normal, rounded; the largest component is from 1 to 2.
    pub normal: Vec3,
    /// Change of W on crossing it downwards.
    pub jump: i32,
    /// W just above its start, if that is above the horizon.
    pub above: i32,
    pub starts_above_horizon: bool,
    /// Some vertex could not be told to be above or below of it.
    pub is_doubtful: bool,
    /// The bands that it comes into, from the pole downwards.
    pub first_band: u8,
    pub last_band: u8,
}

impl Chain {
    /// The beginning of an edge: W just above it, whether that is above the horizon, and whether it is in doubt.
    #[inline(always)]
    pub fn new(id: u32, edge: &Edge, above: i32, starts_above_horizon: bool, is_doubtful: bool) -> Self {
        let normal = edge.normal.as_vec3();
        // A power of two; nothing becomes nothing, of no direction.
        let size = normal.abs().max_element().to_bits() >> 23;
        let scale = f32::from_bits((254 - size) << 23);
        Self {
            edge: id,
            normal: normal * scale,
            jump: edge.jump,
            above,
            starts_above_horizon,
            is_doubtful,
            first_band: edge.first_band,
            last_band: edge.last_band,
        }
    }

    /// The bands that it comes into.
    #[inline(always)]
    pub fn bands(&self) -> Range<usize> {
        self.first_band.into()..usize::from(self.last_band) + 1
    }
}
