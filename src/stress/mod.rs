//! Scenes made to break things, each with a truth to hold against every method.
//!
//! [`battery`] is the list: degenerate receivers, degenerate geometry, numbers at the ends of the range, and what must not
//! change the answer. [`at_random`] puts receivers all over a given mesh, on its corners, edges and faces, in their planes,
//! inside and far away. [`try_case`] solves a case by a method and compares it with its truth and with rays; the [`Row`]s
//! make a [`Table`].

mod battery;
mod case;
mod closed;
mod invariance;
mod judge;
mod pieces;
mod spread;
mod table;

pub use battery::battery;
pub use case::{Case, Term, Truth};
pub use judge::{Settings, try_case};
pub use spread::at_random;
pub use table::{Row, Table, Verdict};
