//! The command `lab`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::{Args, Subcommand, ValueEnum};

use super::args::Output;
use super::progress::{Counted, Progress};
use super::{FAILED, print, print_error, print_for_people};
use crate::lab;

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct LabArguments {
    /// Configuration of the experiment, or a list of actions in JSON or TOML
    #[arg(value_name = "CONFIG", required = true)]
    config: Option<PathBuf>,
    /// Keep rows of an earlier run of the actions instead of measuring them again
    #[arg(long)]
    resume: bool,
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
    /// Repeat the experiments of the thesis "Scene optimization for RTX" (docs/thesis.md)
    Thesis(ThesisArguments),
    /// Convert a scene file (.scn) or an environment file (.env) to TOML, or back
    Convert {
        /// File to convert: .scn, .env, or .toml
        file: PathBuf,
        /// File to write: .toml, .scn or .env
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
    },
}

#[derive(Debug, Args)]
struct ThesisArguments {
    /// Folder with the scenes of the thesis, each in a folder of its own
    #[arg(long, value_name = "DIR", required_unless_present = "redraw")]
    scenes: Option<PathBuf>,
    /// Folder for rows, figures and pages; it is created if it does not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Trace few rays once; without scenes of the thesis, take the largest others
    #[arg(long)]
    quick: bool,
    /// Seconds that each trial is timed for; the thesis has 10
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = seconds)]
    seconds: f64,
    /// What traces: auto, cpu, an index or part of a name
    #[arg(long, value_name = "DEVICE", default_value = "auto")]
    device: String,
    /// Degrees Celsius to which a GPU cools down before each run
    #[arg(long, value_name = "CELSIUS", default_value_t = 60.0, value_parser = at_least_zero)]
    max_temperature: f64,
    /// Seconds after which a run begins even if the GPU is warmer
    #[arg(long, value_name = "SECONDS", default_value_t = 300.0, value_parser = at_least_zero)]
    cooling_timeout: f64,
    /// Keep rows of an earlier run that are in the folder already
    #[arg(long)]
    resume: bool,
    /// Measure nothing: write figures and pages again from the rows that are in the folder
    #[arg(long, conflicts_with_all = ["scenes", "quick", "seconds", "device", "max_temperature", "cooling_timeout", "resume"])]
    redraw: bool,
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
        (Some(LabCommand::Thesis(arguments)), _) => thesis(arguments, output),
        (Some(LabCommand::Convert { file, output: to }), _) => convert(file, to, output),
        (None, Some(config)) if lab::lists_actions(config) => act(config, arguments.resume, output),
        (None, Some(_)) if arguments.resume => bail!("--resume needs a list of actions"),
        (None, Some(config)) => measure(config, output),
        (None, None) => bail!("a configuration is needed"),
    }
}

impl ThesisArguments {
    /// Repeats the experiments, or only draws them again.
    fn run(&self, progress: &mut dyn FnMut(&lab::thesis::Step)) -> Result<lab::thesis::ThesisResult, lab::LabError> {
        let Some(scenes) = self.scenes.clone() else { return lab::thesis::redraw(&self.out) };
        let options = lab::thesis::ThesisOptions {
            scenes,
            out: self.out.clone(),
            quick: self.quick,
            seconds: self.seconds,
            device: self.device.as_str().into(),
            limits: lab::Limits { temperature: self.max_temperature, timeout: self.cooling_timeout },
            resume: self.resume,
        };
        lab::thesis::thesis(&options, progress)
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

/// Shows the step that begins; with `-v`, its name stays.
fn enter(progress: &mut Counted, step: &lab::thesis::Step, output: &Output) {
    progress.enter(step);
    if output.verbose > 0 {
        print_note(&step.name);
    }
}

/// Runs the actions of a file, and states what was written.
fn act(file: &Path, resume: bool, output: &Output) -> Result<ExitCode> {
    let mut progress = Counted::new(output.quiet);
    let done = lab::run_actions(file, resume, &mut |step| enter(&mut progress, step, output));
    progress.finish();
    let done = done?;
    if !output.quiet {
        let (scenes, rows, figures) = (done.scenes.len(), done.rows.len(), done.figures.len());
        let generated = if scenes > 0 { format!("{scenes} scenes, ") } else { String::new() };
        print(format!("{generated}{rows} runs and {figures} pictures in {}\n", done.out.display()).as_bytes())?;
        let warnings = done.warnings.iter().filter(|_| output.verbose > 0);
        done.notes.iter().chain(warnings).for_each(|note| print_note(note));
    }
    done.failures.iter().for_each(|why| print_error(format_args!("{why}")));
    Ok(if done.failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(FAILED) })
}

/// Reads a number of at least 0.
fn at_least_zero(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| *number >= 0.0 && number.is_finite());
    number.ok_or_else(|| "not a number of at least 0".to_owned())
}

/// Reads a number of seconds.
fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (1e-3..=3600.0).contains(seconds));
    seconds.ok_or_else(|| "not a number of seconds from 0.001 to 3600".to_owned())
}

/// Repeats the thesis's experiments, and states where the page is.
fn thesis(arguments: &ThesisArguments, output: &Output) -> Result<ExitCode> {
    let mut progress = Counted::new(output.quiet);
    let done = arguments.run(&mut |step| enter(&mut progress, step, output));
    progress.finish();
    let done = done?;
    if !output.quiet {
        print(format!("{} rows; the page is {}\n", done.rows, done.page.display()).as_bytes())?;
        let warnings = done.warnings.iter().filter(|_| output.verbose > 0);
        done.notes.iter().chain(warnings).for_each(|note| print_note(note));
    }
    done.failures.iter().for_each(|why| print_error(format_args!("{why}")));
    Ok(if done.failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(FAILED) })
}

/// Converts a file, and states what is lost.
fn convert(file: &Path, to: &Path, output: &Output) -> Result<ExitCode> {
    let lab::Converted { comments } = lab::convert(file, to)?;
    if comments > 0 && !output.quiet {
        let plural = if comments == 1 { "comment is" } else { "comments are" };
        print_note(&format!("{comments} {plural} not carried over to {}", to.display()));
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
