//! A progress line on the terminal.

use std::borrow::Cow;
use std::io::{IsTerminal, stderr};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Stages shorter than this get no line.
const PATIENCE: Duration = Duration::from_secs(1);

/// Shows the current stage once it has lasted over a second; only on a terminal.
pub(super) struct Progress {
    shown: bool,
    bar: ProgressBar,
    waiting: Option<std::sync::mpsc::Sender<()>>,
}

impl Progress {
    pub(super) fn new(quiet: bool) -> Self {
        Progress { shown: !quiet && stderr().is_terminal(), bar: ProgressBar::hidden(), waiting: None }
    }

    /// Clears the line of the last stage and starts a new one.
    pub(super) fn enter(&mut self, stage: impl Into<Cow<'static, str>>) {
        self.finish();
        if !self.shown {
            return;
        }
        self.bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden()).with_message(stage);
        self.bar.set_style(
            ProgressStyle::with_template("{spinner} {msg} {elapsed}")
                .unwrap_or_else(|_| ProgressStyle::default_spinner()),
        );
        let (done, is_done) = std::sync::mpsc::channel();
        self.waiting = Some(done);
        let bar = self.bar.clone();
        std::thread::spawn(move || {
            let timed_out = is_done.recv_timeout(PATIENCE) == Err(std::sync::mpsc::RecvTimeoutError::Timeout);
            if timed_out && !bar.is_finished() {
                bar.set_draw_target(ProgressDrawTarget::stderr());
                bar.enable_steady_tick(Duration::from_millis(100));
            }
        });
    }

    /// Clears the line.
    pub(super) fn finish(&mut self) {
        self.waiting = None;
        self.bar.finish_and_clear();
    }
}

/// Shows how many runs or assets are done, and an estimate of the time left; only on a terminal.
pub(super) struct Counted(ProgressBar);

impl Counted {
    pub(super) fn new(quiet: bool) -> Self {
        let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(0) };
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg} {elapsed}, {eta} left");
        Counted(bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())))
    }

    /// Shows how many are done.
    pub(super) fn set(&mut self, done: usize, of: usize, message: String) {
        self.0.set_length(of as u64);
        self.0.set_position(done as u64);
        self.0.set_message(message);
    }

    /// Shows the run that begins.
    #[cfg(feature = "lab")]
    pub(super) fn enter(&mut self, step: &crate::lab::thesis::Step) {
        self.set(step.done, step.of, step.name.clone());
    }

    /// Clears the line.
    pub(super) fn finish(&mut self) {
        self.0.finish_and_clear();
    }
}
