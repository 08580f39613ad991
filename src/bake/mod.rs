//! Receivers, the plan, and the writers of results.
