//! The command `lab`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::Result;

use super::args::Output;
use super::progress::Progress;
use super::{FAILED, print, print_error, print_for_people};
use crate::lab;

/// Runs the experiment that a configuration describes and prints its summary.
pub(super) fn run(config: &Path, output: &Output) -> Result<ExitCode> {
    let mut progress = Progress::new(output.quiet);
    let done = lab::run(config, &mut |scene| {
        progress.enter(scene.to_owned());
        if output.verbose > 0 {
            print_note(scene);
        }
    });
    progress.finish();
    let done = done?;
    if !output.quiet {
        print(done.text.as_bytes())?;
        let warnings = done.warnings.iter().filter(|_| output.verbose > 0);
        done.notes.iter().chain(warnings).for_each(|note| print_note(note));
    }
    if let Some(Err(why)) = done.fit {
        print_error(format_args!("{why}; what was measured is in {}", done.out.display()));
        return Ok(ExitCode::from(FAILED));
    }
    Ok(ExitCode::SUCCESS)
}

fn print_note(note: &str) {
    print_for_people(&format!("note: {note}\n"));
}
