//! The `raykiln` program.

use std::process::ExitCode;

/// A bake frees large and small pieces of memory in turn. The GNU C library keeps what was freed, up to a third of the
/// peak; mimalloc gives it back.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    raykiln::cli::run()
}
