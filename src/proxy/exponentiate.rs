//! The exponentiation pass: visibility from accumulated log visibility.

use rayon::prelude::*;

use super::exponential::{Exponentiator, ONE};
use super::harmonic_buffer::HarmonicBuffer;
use super::lanes::{Lanes, dispatch};

/// Groups of eight receivers that one task handles.
const CHUNK: usize = 256;

/// Takes the exponential of every receiver's vector; `out` keeps as many coefficients as it has, cutting the rest off.
/// Receivers at which nothing was accumulated get exactly 1. Returns the number of groups of eight that were all such.
///
/// # Panics
/// If `log` is not of the exponential's order, or `out` has another number of receivers or more coefficients.
pub fn exponentiate(log: &HarmonicBuffer, exponentiator: &Exponentiator, out: &mut HarmonicBuffer) -> u64 {
    let (len, out_len) = (log.len(), out.len());
    assert_eq!(len, exponentiator.order().len());
    assert!(out_len <= len && log.groups().len() / len == out.groups().len() / out_len);
    let chunk = match len {
        1 => exponentiate_chunk::<1>,
        4 => exponentiate_chunk::<4>,
        9 => exponentiate_chunk::<9>,
        16 => exponentiate_chunk::<16>,
        25 => exponentiate_chunk::<25>,
        _ => exponentiate_chunk::<36>,
    };
    let pairs = log.groups().par_chunks(CHUNK * len).zip(out.groups_mut().par_chunks_mut(CHUNK * out_len));
    pairs.map(|(log, out)| chunk(exponentiator, log, out, out_len)).sum()
}

dispatch! {
    /// A run of groups.
    exponentiate_chunk [LEN] (exponentiator: &Exponentiator, log: &[Lanes], out: &mut [Lanes], out_len: usize) -> u64 {
        let mut untouched = 0;
        for (log, out) in log.as_chunks::<LEN>().0.iter().zip(out.chunks_exact_mut(out_len)) {
            if log.iter().all(|lanes| *lanes == Lanes::ZERO) {
                untouched += 1;
                out.fill(Lanes::ZERO);
                out[0] = Lanes::splat(ONE);
                continue;
            }
            let visibility = exponentiator.exponentiate(*log);
            out.copy_from_slice(&visibility[..out_len]);
        }
        untouched
    }
}
