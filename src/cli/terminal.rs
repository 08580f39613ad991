//! Progress on standard error: a bar on a terminal, a line now and then elsewhere.

use std::io::{self, IsTerminal};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::bake::Control;

use super::{interrupt, say};

/// Between two lines where there is no terminal.
const PAUSE: Duration = Duration::from_secs(10);

/// The user's view of a computation and hold on it.
pub struct Terminal {
    bar: ProgressBar,
    /// When to write the next plain line; none where a bar is drawn or nothing is wanted.
    next_line: Option<Mutex<Instant>>,
}

impl Terminal {
    /// Shows progress unless `quiet`, and stops in good order on the first Ctrl-C.
    pub fn new(quiet: bool) -> Self {
        interrupt::heed();
        let terminal = io::stderr().is_terminal();
        let target = if terminal && !quiet { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(None, target);
        if let Ok(style) = ProgressStyle::with_template("{msg:14} {wide_bar} {percent:>3} %, {eta} left") {
            bar.set_style(style);
        }
        let next_line = (!terminal && !quiet).then(|| Mutex::new(Instant::now() + PAUSE));
        Self { bar, next_line }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Control for Terminal {
    fn begin(&self, stage: &str, total: u64) {
        self.bar.reset();
        self.bar.set_length(total);
        self.bar.set_message(stage.to_owned());
    }

    fn advance(&self, steps: u64) {
        self.bar.inc(steps);
        // A thread that finds another one writing has nothing to add.
        let Some(mut next) = self.next_line.as_ref().and_then(|next| next.try_lock().ok()) else { return };
        if Instant::now() >= *next {
            *next = Instant::now() + PAUSE;
            let percent = 100 * self.bar.position() / self.bar.length().unwrap_or(0).max(1);
            say(format_args!("{}: {percent} %, {} s left", self.bar.message(), self.bar.eta().as_secs()));
        }
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}
