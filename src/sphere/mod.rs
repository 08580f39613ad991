//! The unit sphere: octahedral map, harmonics, arcs, closed forms.
