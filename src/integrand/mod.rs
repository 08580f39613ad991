//! What is integrated over the visible region.
