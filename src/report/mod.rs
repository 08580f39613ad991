//! Tables and pictures of errors.
