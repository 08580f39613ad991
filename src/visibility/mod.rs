//! From the contours seen by a receiver to the visible region.

mod contours;
mod crossings;
mod depth;
pub mod exact;
mod isolines;
mod meridians;
mod skips;
mod sweep;
mod trace;
mod view;

pub use contours::{Arc, ReceiverContours};
pub(crate) use isolines::cycle;
pub use isolines::{Frame, Isolines};
pub use meridians::{Counts, MeridianFrame, Meridians, Spans};
pub use skips::Skips;
pub use sweep::{Interval, Sweep};
pub use view::{Receiver, Sight, View, Viewer, open_intervals};
