//! Runs of edges of which each starts where the one before ends: they keep their slots in the bands.

use glam::{DVec3, Vec3};

/// The edge that a chain has come to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chain {
    pub edge: u32,
    /// Its normal; the same of unit length, rounded.
    pub normal: DVec3,
    pub rounded: Vec3,
    /// Its first point.
    pub start: DVec3,
    pub starts_above_horizon: bool,
    /// Some vertex could not be told to be above or below of it.
    pub is_doubtful: bool,
    /// The bands that it comes into, from the pole downwards.
    pub first_band: u8,
    pub last_band: u8,
    /// Change of W on crossing it downwards.
    pub jump: i32,
    /// W just above its start, if that is above the horizon.
    pub above: i32,
}

impl Chain {
    pub fn bands(&self) -> std::ops::RangeInclusive<usize> {
        self.first_band.into()..=self.last_band.into()
    }
}
