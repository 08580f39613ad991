//! From the contours seen by a receiver to the visible region.

mod beams;
mod chart;
mod contours;
mod crossings;
mod depth;
pub mod exact;
mod front;
mod gaps;
mod meridians;
mod octahedron;
mod outline;
mod searches;
mod skips;
mod spans;
mod sweep;
mod trace;
mod vertices;
mod view;
mod visible_set;

pub use contours::{Arc, ReceiverContours};
pub use crossings::Counts;
pub use meridians::{MeridianFrame, Meridians};
pub use octahedron::{Frame, Isolines, open_spans};
pub use skips::Skips;
pub use spans::Spans;
pub use view::{Receiver, Sight, Sweep, View, Viewer};
