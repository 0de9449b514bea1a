//! The `raykiln` program.

use std::process::ExitCode;

/// A bake alternates between freeing large and small blocks. The GNU C library retains freed memory, up to a third of
/// the peak; mimalloc returns it to the system.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    raykiln::cli::run()
}
