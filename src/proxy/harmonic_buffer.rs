use super::lanes::{LANES, Lanes};

/// One vector of spherical harmonics, or of any numbers, per receiver: what passes from stage to stage.
///
/// Receivers come in groups of eight neighbours in a row; coefficient k of the receiver at place i of the planes of
/// [`Receivers`](super::Receivers) is lane i mod 8 of `groups[i / 8 * len + k]`.
#[derive(Clone, Debug, Default)]
pub struct HarmonicBuffer {
    len: usize,
    groups: Vec<Lanes>,
}

impl HarmonicBuffer {
    /// Zeros for `receivers` places of `len` numbers each.
    pub fn zeros(len: usize, receivers: usize) -> Self {
        Self { len, groups: vec![Lanes::ZERO; receivers.div_ceil(LANES) * len] }
    }

    /// Numbers per receiver.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no receiver or nothing to keep.
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// The numbers of a group of eight.
    pub fn group(&self, group: usize) -> &[Lanes] {
        &self.groups[group * self.len..][..self.len]
    }

    /// All groups one after the other.
    pub fn groups(&self) -> &[Lanes] {
        &self.groups
    }

    /// All groups one after the other, to be written.
    pub fn groups_mut(&mut self) -> &mut [Lanes] {
        &mut self.groups
    }

    /// The vector of the receiver at a place.
    pub fn vector(&self, index: usize) -> Vec<f32> {
        self.group(index / LANES).iter().map(|lanes| lanes.0[index % LANES]).collect()
    }
}
