//! The command line: parses it, runs the command, prints its result, and turns it into an exit status.

mod applies;
mod args;
mod bake;
mod batch;
mod cache;
mod cached;
mod interrupt;
#[cfg(feature = "lab")]
mod lab;
mod memory;
mod plan;
mod progress;
mod render;
mod reports;
mod time;

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow, ensure};
use clap::{ArgMatches, CommandFactory, FromArgMatches};
use raykiln_formats::staging::Hold;

use crate::commands::bake::BakeOptions;
use crate::commands::inspect;
use crate::commands::verify::{self, MatchBy};
use crate::report;
use crate::report::FailOn;
use crate::scene::LoadOptions;
use crate::verify::verdict::Verdict;
use crate::verify::{Matching, VerifyOptions};
pub use memory::end as end_without_memory;

use args::{Arguments, Command, CompareArguments, InspectArguments, Output};
use progress::Progress;
use reports::{Format, Reports};

/// Exit status of a failed verification or fit, and of findings that `--fail-on` names.
const FAILED: u8 = 1;
/// Exit status of bad usage or bad input.
const BAD: u8 = 2;

/// Runs the program with the arguments of the process.
pub fn run() -> ExitCode {
    if is_version_as_json() {
        return ended(print(report::json::to_json(&report::VersionReport::of_this_program()).as_bytes()));
    }
    let matches = Arguments::command().get_matches();
    let arguments = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    if arguments.command.reads_scenes() {
        interrupt::install_handlers();
    }
    let done = in_pool(arguments.output.threads, || dispatch(&arguments, &matches));
    // If a signal removed the staged files, the signal ends the program, not an error caused by their absence.
    drop(Hold::new());
    ended(done)
}

/// Returns the exit status; prints the error, if there is one.
fn ended(done: Result<ExitCode>) -> ExitCode {
    done.unwrap_or_else(|e| {
        print_error(format_args!("{e:#}"));
        ExitCode::from(BAD)
    })
}

/// Whether `--version` and `--json` are given, and nothing else. The parser ends at `--version`, and prints text.
fn is_version_as_json() -> bool {
    let words: Vec<_> = std::env::args_os().skip(1).collect();
    words.len() == 2 && words.iter().any(|w| w == "--json") && words.iter().any(|w| w == "--version" || w == "-V")
}

/// Returns the options of a bake that are given by their long names, as on the command line: a switch is `true` or `false`. They
/// include `device`, but no files.
///
/// # Errors
/// Says which option is not known, has a wrong value, or does not apply to the method.
pub fn bake_options(options: &BTreeMap<String, Vec<String>>) -> Result<BakeOptions, String> {
    let parsed = plan::words(options).and_then(|words| plan::parsed(&words));
    parsed.map(|(bake, _)| bake).map_err(|why| format!("{why:#}"))
}

/// Stack size of a thread in bytes: that of main threads.
const STACK: usize = 8 << 20;

/// Runs a whole command inside one thread pool. A parallel loop that starts outside of it passes every piece of work
/// through a queue and sleeps until it is done, which costs several system calls each time.
fn in_pool(threads: Option<u16>, command: impl FnOnce() -> Result<ExitCode> + Send) -> Result<ExitCode> {
    let threads = threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build();
    let pool = pool.map_err(|e| anyhow!("the threads cannot be started (--threads sets their number): {e}"))?;
    pool.install(command)
}

fn dispatch(arguments: &Arguments, matches: &ArgMatches) -> Result<ExitCode> {
    match &arguments.command {
        Command::Bake(bake) => bake::run(bake, matches, &arguments.output),
        Command::Batch(batch) => batch::run(batch, matches, &arguments.output),
        Command::Time(time) => time::run(time, &arguments.output),
        Command::Verify(verify) => run_verify(verify, &arguments.output),
        Command::Inspect(inspect) => run_inspect(inspect, &arguments.output),
        Command::Render(render) => render::run(render, &arguments.output),
        #[cfg(feature = "lab")]
        Command::Lab(lab) => lab::run(lab, &arguments.output),
        Command::Cache { command } => cache::run(command),
        Command::Devices { json } => {
            let report = report::DevicesReport::of_this_machine();
            let text = if *json { report::json::to_json(&report) } else { report::text::devices(&report) };
            print(text.as_bytes())
        }
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Arguments::command(), "raykiln", &mut script);
            print(&script)
        }
        Command::Man => print(&manual()?),
    }
}

fn run_verify(arguments: &CompareArguments, output: &Output) -> Result<ExitCode> {
    let reports = Reports::check(&arguments.report, &[&arguments.before, &arguments.after])?;
    let mut progress = Progress::new(output.quiet);
    progress.enter("verifying");
    let by = arguments.match_by.into();
    ensure!(!arguments.layout || by != MatchBy::Always(Matching::Surface), "--layout needs triangles that are matched");
    let options = VerifyOptions { same_groups: arguments.layout, ..arguments.verify.options() };
    let compared = verify::compare_and_show(
        &arguments.before,
        &arguments.after,
        by,
        &options,
        &LoadOptions { obj: arguments.obj.options().with_root(arguments.root.clone()), ..LoadOptions::default() },
        reports.have(Format::Page),
    );
    progress.finish();
    let (report, shown) = compared?;
    let json = report::json::to_json(&report);
    let reports = reports.stage(|format| match format {
        Format::Json => json.as_str().into(),
        Format::Page => report::html::verify(&report, shown.as_ref()).into(),
        Format::Sarif => report::to_sarif(&report.input.path, &report.findings).into(),
    })?;
    if arguments.json {
        print(json.as_bytes())?;
    } else if !output.quiet {
        print(report::text::verify(&report, output.verbose > 0).as_bytes())?;
    }
    reports.commit()?;
    let what = match report.verdict {
        Verdict::Failed => "verification failed: ",
        Verdict::CannotTell => "",
        _ => return Ok(ExitCode::SUCCESS),
    };
    print_error(format_args!("{}: {what}{}", report.output.display(), report.verify));
    Ok(ExitCode::from(FAILED))
}

fn run_inspect(arguments: &InspectArguments, output: &Output) -> Result<ExitCode> {
    let reports = Reports::check(&arguments.report, &[&arguments.input])?;
    let mut progress = Progress::new(output.quiet);
    progress.enter("inspecting");
    let obj = arguments.obj.options().with_root(arguments.root.clone());
    let load = LoadOptions { strict: arguments.strict, obj, ..LoadOptions::default() };
    let inspected = inspect::inspect_and_show(arguments.input.as_path().into(), &load, reports.have(Format::Page));
    progress.finish();
    let (report, shown) = inspected?;
    let json = report::json::to_json(&report);
    let reports = reports.stage(|format| match format {
        Format::Json => json.as_str().into(),
        Format::Page => report::html::inspect(&report, shown.as_ref()).into(),
        Format::Sarif => report::to_sarif(&report.input.path, &report.findings).into(),
    })?;
    if arguments.json {
        print(json.as_bytes())?
    } else {
        print(report::text::inspect(&report).as_bytes())?
    };
    reports.commit()?;
    let broken = FailOn::rules_met(&arguments.fail_on, &report.findings);
    if broken.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    print_error(format_args!("{}: breaks {} (--fail-on)", arguments.input.display(), broken.join(", ")));
    Ok(ExitCode::from(FAILED))
}

/// The manual: one page for the program and one per command.
fn manual() -> Result<Vec<u8>> {
    let mut command = Arguments::command();
    command.build();
    let mut pages = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut pages)?;
    for subcommand in command.get_subcommands().filter(|c| c.get_name() != "help") {
        clap_mangen::Man::new(subcommand.clone()).render(&mut pages)?;
    }
    Ok(pages)
}

/// Prints to standard output. A reader that closes the pipe early, such as `head`, is not an error.
fn print(bytes: &[u8]) -> Result<ExitCode> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(e).context("standard output cannot be written to"),
        _ => Ok(ExitCode::SUCCESS),
    }
}

/// Prints an error to standard error.
fn print_error(message: fmt::Arguments<'_>) {
    print_for_people(&format!("error: {message}\n"));
}

/// Prints to standard error. Failures are ignored, so that work continues.
fn print_for_people(text: &str) {
    let _ = io::stderr().lock().write_all(text.as_bytes());
}
