//! The `raykiln` program.

use std::process::ExitCode;

use mimalloc::MiMalloc;
use raykiln_allocator::OrEnd;

/// A bake alternates between freeing large and small blocks. The GNU C library retains freed memory, up to a third of
/// the peak; mimalloc returns it to the system. If memory is refused, the program ends with an error.
#[global_allocator]
static ALLOCATOR: OrEnd<MiMalloc> = OrEnd::new(MiMalloc, raykiln::cli::end_without_memory);

fn main() -> ExitCode {
    raykiln::cli::run()
}
