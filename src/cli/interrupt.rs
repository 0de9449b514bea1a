//! Signals that tell the program to end: it takes away what it has staged first.
//!
//! Only the program heeds them, not the library. Files that are being renamed into place get there first, all of them; a
//! second signal changes nothing. Elsewhere than on Unix hidden folders stay where the program is ended from outside.

/// From now on, Ctrl-C and the signals TERM and HUP remove staged files before they end the program. Those that it was
/// started to ignore, as by `nohup`, it ignores.
#[cfg(unix)]
pub(super) fn install_handlers() {
    use raykiln_formats::staging;
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use std::sync::mpsc;
    use std::thread;

    let heeded: Vec<i32> = [SIGINT, SIGTERM].into_iter().chain(HANGUP).filter(|s| !is_ignored(*s)).collect();
    let (ready, is_ready) = mpsc::channel();
    let wait = move || {
        let signals = Signals::new(heeded);
        let _ = ready.send(());
        if let Some(signal) = signals.ok().and_then(|mut signals| signals.forever().next()) {
            staging::remove_all();
            end(signal);
        }
    };
    // Signals are not caught unless there is a thread that they can reach.
    if thread::Builder::new().name("signals".into()).spawn(wait).is_ok() {
        let _ = is_ready.recv();
    }
}

/// There are no such signals.
#[cfg(not(unix))]
pub(super) fn install_handlers() {}

/// Where it cannot be known whether `nohup` asks to ignore it, the signal is left as it is.
#[cfg(unix)]
const HANGUP: Option<i32> = if cfg!(target_os = "linux") { Some(signal_hook::consts::SIGHUP) } else { None };

/// Whether the program was started with the signal ignored, as far as the system tells.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Ends the program as the signal does where nobody heeds it: a shell sees the status 128 + signal.
#[cfg(unix)]
fn end(signal: i32) -> ! {
    // The first process of a container is not ended by signals that it does not install_handlers.
    if std::process::id() != 1 {
        let _ = signal_hook::low_level::emulate_default_handler(signal);
    }
    signal_hook::low_level::exit(128 + signal)
}
