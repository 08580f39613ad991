use crate::bake::{Control, Method, Prepared, Skips, Unmoved};
use crate::{Error, Result};

use super::{Quantity, Track};

/// What leaving one kind of needless work undone gains.
#[derive(Clone, Debug, PartialEq)]
pub struct Gain {
    /// Scene it was measured in.
    pub scene: String,
    /// What was computed.
    pub quantity: Quantity,
    /// The kind of work.
    pub skip: &'static str,
    /// Seconds of processor time per receiver with everything left undone that can be.
    pub with: f64,
    /// The same, but this is done after all.
    pub without: f64,
    /// Whether both gave the same bits.
    pub same_bits: bool,
}

/// Isolines along which the gains are measured.
pub(super) const LINES: u32 = 64;
/// Rounds, in each of which all kinds have their turn; the least time counts.
const ROUNDS: usize = 3;

impl Gain {
    /// The gains of all kinds of work on a track, for a quantity along isolines. What `prepared` has built is used again.
    ///
    /// # Errors
    /// As [`Prepared::integrate`], and [`Error::Interrupted`] when `control` asks to stop.
    pub fn measure(
        prepared: &mut Prepared,
        track: &Track,
        quantity: Quantity,
        control: &dyn Control,
    ) -> Result<Vec<Self>> {
        let request = quantity.request();
        let mut run = |skips: Skips| {
            prepared.set_skips(skips);
            let method = Method::Isolines { lines: LINES };
            let outcome = prepared.integrate(&track.receivers, &request, method, None, &Unmoved(control))?;
            if outcome.done.iter().any(|done| !done) {
                return Err(Error::Interrupted);
            }
            Ok((outcome.statistics.processor_seconds / track.receivers.len().max(1) as f64, outcome.arrays))
        };
        let (mut with, expected) = run(Skips::default())?;
        let mut gains: Vec<Self> = Vec::new();
        for _ in 0..ROUNDS {
            with = with.min(run(Skips::default())?.0);
            for (i, (skip, skips)) in Skips::each().into_iter().enumerate() {
                let (without, arrays) = run(skips)?;
                let same_bits = arrays == expected;
                match gains.get_mut(i) {
                    Some(gain) => {
                        gain.without = gain.without.min(without);
                        gain.same_bits &= same_bits;
                    }
                    None => {
                        let scene = track.name.clone();
                        gains.push(Self { scene, quantity, skip, with, without, same_bits });
                    }
                }
            }
        }
        gains.iter_mut().for_each(|gain| gain.with = with);
        Ok(gains)
    }
}
