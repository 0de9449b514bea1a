//! Ends the program if memory is refused, as under `ulimit -v`.

use std::cell::Cell;
use std::io::{Cursor, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use std::{fmt, thread};

use anyhow::{Context, Result, ensure};
use raykiln_formats::staging;

use super::BAD;
use crate::commands::batch::memory::resident_bytes;

/// The longest that removing staged files may take; another thread may be waiting for memory with the files in hand.
const PATIENCE: Duration = Duration::from_secs(2);

thread_local! {
    /// Whether this thread is ending the program.
    static IS_ENDING: Cell<bool> = const { Cell::new(false) };
}

/// Prints an error, removes staged files, and ends the program with exit status 2. Never unwinds; its own steps need
/// next to no memory, and if even that is refused, the program ends at once.
pub fn end(bytes: usize) -> ! {
    static IS_ENDED: AtomicBool = AtomicBool::new(false);
    if IS_ENDING.replace(true) {
        exit();
    }
    if IS_ENDED.swap(true, Ordering::SeqCst) {
        loop {
            thread::sleep(PATIENCE);
        }
    }
    print(format_args!("{bytes} more bytes are needed than the system, or a limit such as `ulimit -v`, grants"));
    staging::remove_all_within(PATIENCE);
    exit()
}

/// Watches the memory that the program has in use, and ends it as if more were refused before that exceeds `most` bytes.
///
/// # Errors
/// Fails if the system does not report it.
pub(super) fn limit(most: u64) -> Result<()> {
    let used = || resident_bytes(std::process::id());
    ensure!(used().is_some(), "--max-memory needs Linux");
    let watch = move || {
        while used().is_none_or(|used| used < most - most / ALARM) {
            thread::sleep(BETWEEN_LOOKS);
        }
        IS_ENDING.set(true);
        print(format_args!("the bake needs more than {most} bytes (--max-memory)"));
        staging::remove_all_within(PATIENCE);
        exit()
    };
    thread::Builder::new().name("memory".into()).spawn(watch).context("the memory cannot be watched")?;
    Ok(())
}

/// The program ends when this share of the limit is left: less is not used up between two looks.
const ALARM: u64 = 16;
/// Time between two looks at the memory in use.
const BETWEEN_LOOKS: Duration = Duration::from_millis(1);

/// Prints the error without allocating.
fn print(cause: fmt::Arguments) {
    let mut text = Cursor::new([0; 160]);
    let _ = writeln!(text, "error: out of memory: {cause}");
    let length = text.position() as usize;
    let _ = std::io::stderr().write_all(&text.get_ref()[..length]);
}

/// Ends the program without running what is registered to run at its end, which may need memory.
fn exit() -> ! {
    #[cfg(unix)]
    signal_hook::low_level::exit(BAD.into());
    #[cfg(not(unix))]
    std::process::exit(BAD.into())
}
