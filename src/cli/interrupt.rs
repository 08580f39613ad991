//! Ctrl-C: once to stop in good order, twice to stop at once.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};

use crate::bake::writers::discard_unfinished;

use super::say;

/// By convention 128 + SIGINT.
pub const EXIT_CODE: u8 = 130;

/// Whether the running command looks at [`requested`].
static HEEDED: AtomicBool = AtomicBool::new(false);
static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Catches Ctrl-C and requests to terminate from now on.
pub fn listen() {
    let caught = ctrlc::set_handler(|| {
        if HEEDED.load(SeqCst) && !REQUESTED.swap(true, SeqCst) {
            say("stopping when the receivers in hand are finished; press Ctrl-C again to stop at once");
        } else {
            discard_unfinished();
            process::exit(EXIT_CODE.into());
        }
    });
    // Without a handler the system's own stops the process, which is what was asked for.
    let _ = caught;
}

/// Promises that the command will look at [`requested`] often: the first Ctrl-C then only sets it.
pub fn heed() {
    HEEDED.store(true, SeqCst);
}

/// Whether to stop in good order.
pub fn requested() -> bool {
    REQUESTED.load(SeqCst)
}
