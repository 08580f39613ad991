//! Contour edges of a triangle mesh from any point.

/// Why a tree could not be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {}
