//! Ends the program if memory is refused, as under `ulimit -v`.

use std::cell::Cell;
use std::io::{Cursor, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use raykiln_formats::staging;

use super::BAD;

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
    print(bytes);
    staging::remove_all_within(PATIENCE);
    exit()
}

/// Prints the error without allocating.
fn print(bytes: usize) {
    let mut text = Cursor::new([0; 160]);
    let _ = writeln!(
        text,
        "error: out of memory: {bytes} more bytes are needed than the system, or a limit such as `ulimit -v`, grants"
    );
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
