/// How the library tells of its progress and learns that it should stop; called from several threads.
pub trait Control: Sync {
    /// `receivers` more are done.
    fn advance(&self, receivers: u64);
    /// Whether to stop: what is under way is finished, nothing new is begun.
    fn cancelled(&self) -> bool;
}

/// Goes on to the end and tells nobody.
pub struct Unattended;

impl Control for Unattended {
    fn advance(&self, _receivers: u64) {}

    fn cancelled(&self) -> bool {
        false
    }
}
