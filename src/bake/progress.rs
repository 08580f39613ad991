/// The caller's hand on a long computation: it is told what is done and may ask to stop.
///
/// The unit `()` neither listens nor interrupts.
pub trait Control: Sync {
    /// A stage of `total` steps begins.
    fn begin(&self, stage: &str, total: u64) {
        let _ = (stage, total);
    }

    /// `steps` more steps of the stage are done. Called from any thread.
    fn advance(&self, steps: u64);

    /// Whether to stop. Work in hand is finished and kept; nothing new is begun.
    fn cancelled(&self) -> bool;
}

/// Stops when the control it holds asks to, and tells it nothing: for parts of a longer work that counts by itself.
pub struct Unmoved<'a>(pub &'a dyn Control);

impl Control for Unmoved<'_> {
    fn advance(&self, _: u64) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

impl Control for () {
    fn advance(&self, _: u64) {}

    fn cancelled(&self) -> bool {
        false
    }
}
