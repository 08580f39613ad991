//! Runs of edges of which each starts where the one before ends: they keep their slots in the bands.

use glam::Vec3;

use super::edges::Edge;

/// The edge that a chain has come to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chain {
    pub edge: u32,
    /// Its normal of unit length, rounded.
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
        Self {
            edge: id,
            // Nothing becomes nothing, of no direction.
            normal: normal * normal.length_squared().sqrt().recip().min(f32::MAX),
            jump: edge.jump,
            above,
            starts_above_horizon,
            is_doubtful,
            first_band: edge.first_band,
            last_band: edge.last_band,
        }
    }

    pub fn bands(&self) -> std::ops::RangeInclusive<usize> {
        self.first_band.into()..=self.last_band.into()
    }
}
