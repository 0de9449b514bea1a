//! The command `lab`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::{Args, Subcommand, ValueEnum};

use super::args::Output;
use super::progress::Progress;
use super::{FAILED, print, print_error, print_for_people};
use crate::lab;

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct LabArguments {
    /// Configuration of the experiment
    #[arg(value_name = "CONFIG.toml", required = true)]
    config: Option<PathBuf>,
    #[command(subcommand)]
    command: Option<LabCommand>,
}

#[derive(Debug, Subcommand)]
enum LabCommand {
    /// Write scenes to measure and test with
    Generate {
        /// Which scenes
        #[arg(value_enum)]
        scenes: GeneratedScenes,
        /// Folder for the scenes; it is created if it does not exist
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Seed of the random numbers; the same seed gives the same bytes
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Also write the large scenes, about 2 GB
        #[arg(long)]
        large: bool,
    },
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum GeneratedScenes {
    /// Stiff and extreme scenes, listed in docs/extreme.md
    Extreme,
}

/// Runs a command below `lab`, or the experiment that a configuration describes.
pub(super) fn run(arguments: &LabArguments, output: &Output) -> Result<ExitCode> {
    match (&arguments.command, &arguments.config) {
        (Some(LabCommand::Generate { scenes: GeneratedScenes::Extreme, out, seed, large }), _) => {
            generate(out, *seed, *large, output)
        }
        (None, Some(config)) => measure(config, output),
        (None, None) => bail!("a configuration is needed"),
    }
}

/// Writes extreme scenes and states how many.
fn generate(out: &Path, seed: u64, large: bool, output: &Output) -> Result<ExitCode> {
    let mut progress = Progress::new(output.quiet);
    let written = lab::extreme::generate(out, seed, large, &mut |case| progress.enter(case.to_owned()));
    progress.finish();
    let written = written?;
    if !output.quiet {
        print_for_people(&format!("{written} scenes, listed in {}\n", out.join("cases.json").display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs the experiment that a configuration describes and prints its summary.
fn measure(config: &Path, output: &Output) -> Result<ExitCode> {
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
    done.faults.iter().for_each(|fault| print_error(format_args!("{fault}")));
    if !done.faults.is_empty() {
        return Ok(ExitCode::from(FAILED));
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
