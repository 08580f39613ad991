//! From the contours seen by a receiver to the visible region.

mod contours;
pub mod exact;

pub use contours::{Arc, ReceiverContours};
