use crate::scene::Environment;
use crate::visibility::{Interval, Isolines};

/// Summed-area tables of an environment's light along u-isolines: of L, and of L times the linear harmonics.
#[derive(Clone, Debug)]
pub struct LightTable;
