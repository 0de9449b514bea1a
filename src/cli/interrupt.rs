//! Handles signals that end the program: removes staged files first.
//!
//! Only the program installs handlers, not the library. If files are being renamed into place, all of them are renamed
//! first; a second signal has no effect. On systems other than Unix, hidden folders remain if the program is ended from
//! outside.

/// After this call, Ctrl-C and the signals TERM and HUP remove staged files before they end the program. Signals that
/// were ignored when the program started, as by `nohup`, stay ignored.
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
    // Catches signals only if there is a thread to handle them.
    if thread::Builder::new().name("signals".into()).spawn(wait).is_ok() {
        let _ = is_ready.recv();
    }
}

/// After this call, the program ends as by the signal TERM once its standard input is closed, which happens however the
/// process at the other end of the pipe ends.
pub(super) fn end_with_stdin() {
    use std::io::{Read, stdin};
    const TERMINATED: i32 = 128 + 15;
    std::thread::spawn(|| {
        let mut unused = [0; 64];
        while stdin().read(&mut unused).is_ok_and(|count| count > 0) {}
        raykiln_formats::staging::remove_all();
        #[cfg(unix)]
        signal_hook::low_level::exit(TERMINATED);
        #[cfg(not(unix))]
        std::process::exit(TERMINATED);
    });
}

/// Does nothing: there are no such signals.
#[cfg(not(unix))]
pub(super) fn install_handlers() {}

/// HUP is handled only on systems that show whether `nohup` asked to ignore it.
#[cfg(unix)]
const HANGUP: Option<i32> = if cfg!(target_os = "linux") { Some(signal_hook::consts::SIGHUP) } else { None };

/// Whether the signal was ignored when the program started, as far as the system reports it.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Ends the program like the default action of the signal: a shell sees the status 128 + signal.
#[cfg(unix)]
fn end(signal: i32) -> ! {
    // The kernel does not end the first process of a container by signals without a handler.
    if std::process::id() != 1 {
        let _ = signal_hook::low_level::emulate_default_handler(signal);
    }
    signal_hook::low_level::exit(128 + signal)
}
