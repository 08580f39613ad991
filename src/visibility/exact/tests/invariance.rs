//! Invariances.
