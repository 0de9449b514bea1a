//! Time per stage.

use std::time::Instant;

use crate::report::Seconds;

/// A stage of a bake, in the order of the data flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reading the input.
    Read,
    /// Measuring a layout.
    Analyse,
    /// Choosing a layout.
    Optimise,
    /// Writing the output.
    Write,
    /// Reading the output back and tracing rays through input and output.
    Verify,
    /// Gathering what a page shows of the scenes; not part of the bake's time.
    Show,
}

impl Stage {
    /// The text shown to the user.
    pub fn label(self) -> &'static str {
        match self {
            Stage::Read => "reading",
            Stage::Analyse => "analysing",
            Stage::Optimise => "choosing a layout",
            Stage::Write => "writing",
            Stage::Verify => "verifying",
            Stage::Show => "drawing the page",
        }
    }
}

/// Adds up the time spent in each stage and reports every change of stage.
pub(super) struct Clock<'a> {
    started: Instant,
    current: Option<(Stage, Instant)>,
    seconds: Seconds,
    progress: &'a mut dyn FnMut(Stage),
}

impl<'a> Clock<'a> {
    pub(super) fn start(progress: &'a mut dyn FnMut(Stage)) -> Self {
        Clock { started: Instant::now(), current: None, seconds: Seconds::default(), progress }
    }

    pub(super) fn enter(&mut self, stage: Stage) {
        self.leave();
        (self.progress)(stage);
        self.current = Some((stage, Instant::now()));
    }

    fn leave(&mut self) {
        let Some((stage, since)) = self.current.take() else { return };
        let sum = match stage {
            Stage::Read => &mut self.seconds.read,
            Stage::Analyse => &mut self.seconds.analyse,
            Stage::Optimise => &mut self.seconds.optimise,
            Stage::Write => &mut self.seconds.write,
            Stage::Verify => &mut self.seconds.verify,
            // Not part of the bake.
            Stage::Show => return self.started += since.elapsed(),
        };
        *sum += since.elapsed().as_secs_f64();
    }

    pub(super) fn stop(mut self) -> Seconds {
        self.leave();
        self.seconds.total = self.started.elapsed().as_secs_f64();
        self.seconds
    }
}

/// The peak resident set size of this process in bytes; `None` if the system does not report it (only Linux does).
pub(super) fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}
