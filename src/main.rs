//! The `raykiln` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    raykiln::cli::run()
}
