//! Independent judges: quasi-Monte Carlo by ray casting.
