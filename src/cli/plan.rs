//! Plans on the command line: the options that a plan records, and those that it brings back.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, CommandFactory, FromArgMatches};

use super::applies;
use super::args::{Arguments, BakeArguments, Command};
use crate::choose::Choice;
use crate::commands::bake::{BakeOptions, FindCopies, PlanUse};
use crate::methods::Method;
use crate::report::exported::CandidatesFile;
use crate::report::plan::PlanFile;
use crate::verify::VerifyOptions;

/// Arguments that do not decide what is written, and so are not part of a plan.
const NOT_PLANNED: [&str; 22] = [
    "input",
    "output",
    "report",
    "json",
    "plan",
    "write_plan",
    "export_candidates",
    "depfile",
    "emit_report_fd",
    "end_with_stdin",
    "cache",
    "cache_size",
    "device",
    "threads",
    "deny_warnings",
    "root",
    "in_place",
    "max_memory",
    "quiet",
    "verbose",
    "help",
    "version",
];

/// The options of a bake by their long names, with their values or defaults.
pub(super) fn options(bake: &ArgMatches) -> BTreeMap<String, Vec<String>> {
    let values = |argument: &Arg| {
        let values = bake.get_raw(argument.get_id().as_str()).into_iter().flatten();
        values.map(|value| value.to_string_lossy().into_owned()).collect()
    };
    planned().iter().filter_map(|argument| Some((argument.get_long()?.to_owned(), values(argument)))).collect()
}

/// Those of some options of a bake that differ from their defaults: what an output records. Folders that are searched are left
/// out, because they are those of one machine.
pub(super) fn recorded(options: &BTreeMap<String, Vec<String>>) -> Result<BTreeMap<String, Vec<String>>> {
    let words = ["raykiln", "bake", "input", "--output", "output.glb"];
    let matches = Arguments::command().try_get_matches_from(words)?;
    let defaults = self::options(matches.subcommand_matches("bake").context("it is a bake")?);
    let differs = |(option, values): &(&String, &Vec<String>)| {
        option.as_str() != "search" && defaults.get(*option) != Some(*values)
    };
    Ok(options.iter().filter(differs).map(|(option, values)| (option.clone(), values.clone())).collect())
}

/// The arguments that are part of a plan.
fn planned() -> Vec<Arg> {
    let command = Arguments::command();
    let bake = command.find_subcommand("bake").map(|bake| bake.get_arguments().cloned().collect::<Vec<Arg>>());
    bake.unwrap_or_default().into_iter().filter(|a| !NOT_PLANNED.contains(&a.get_id().as_str())).collect()
}

/// Returns the options of a bake that follows a plan: its own, for the files and the device of the command line.
///
/// # Errors
/// Fails if the plan cannot be read, is of another version, or another value of an option is given.
pub(super) fn follow(file: &Path, arguments: &BakeArguments, bake: &ArgMatches) -> Result<BakeOptions> {
    let name = || format!("--plan {}", file.display());
    let plan = read(file).with_context(name)?;
    check_all_given(&plan, bake).with_context(name)?;
    let mut options = restored(&plan).with_context(name)?.options()?;
    options.verify.device = arguments.options()?.verify.device;
    if plan.decision.left_alone {
        (options.choose.method, options.copies) = (Choice::Method(Method::Keep), FindCopies::Off);
    } else {
        options.choose.decided = Some(plan.decided());
    }
    options.plan = PlanUse::Follow(plan.hashes());
    options.recorded = recorded(&plan.options)?;
    Ok(options)
}

/// Reads a plan, or the winner's of a folder of candidates.
fn read(file: &Path) -> Result<PlanFile> {
    let read = |file: &Path| PlanFile::read(file).map_err(|why| anyhow!(why));
    if !file.is_dir() {
        return read(file);
    }
    let winner = file.join(CandidatesFile::WINNER);
    ensure!(winner.is_file(), "the folder has no {}: run `raykiln time` on it", CandidatesFile::WINNER);
    read(&winner)
}

/// Returns how the bake of a plan verifies, and so times.
///
/// # Errors
/// Fails if the plan has options that this program has not.
pub(super) fn verify_options(plan: &PlanFile) -> Result<VerifyOptions> {
    Ok(restored(plan)?.options()?.verify)
}

/// Rejects options that are given with another value than the plan's.
fn check_all_given(plan: &PlanFile, bake: &ArgMatches) -> Result<()> {
    for argument in planned() {
        if let Some((option, values)) = argument.get_long().and_then(|option| plan.options.get_key_value(option)) {
            check_given(option, values, &argument, bake)?;
        }
    }
    Ok(())
}

/// Reads the options of a plan as if they had been given.
fn restored(plan: &PlanFile) -> Result<BakeArguments> {
    let planned = planned();
    let mut words = vec!["raykiln".to_owned(), "bake".into(), "input".into(), "--output".into(), "output.glb".into()];
    for (option, values) in &plan.options {
        let argument = planned.iter().find(|argument| argument.get_long() == Some(option));
        let argument = argument.with_context(|| format!("the plan has an option --{option}, this program has not"))?;
        words.extend(values.iter().filter_map(|value| word(argument, option, value)));
    }
    for option in planned.iter().filter_map(Arg::get_long) {
        ensure!(plan.options.contains_key(option), "the plan has no option --{option}");
    }
    let matches = Arguments::command().try_get_matches_from(words)?;
    match Arguments::from_arg_matches(&matches)?.command {
        Command::Bake(bake) => Ok(*bake),
        _ => bail!("the options are not those of a bake"),
    }
}

/// An option with a value as an argument; none for a switch that is off.
fn word(argument: &Arg, option: &str, value: &str) -> Option<String> {
    match argument.get_action() {
        ArgAction::SetTrue => (value == "true").then(|| format!("--{option}")),
        _ => Some(format!("--{option}={value}")),
    }
}

/// The arguments of a bake that a batch passes on: those that decide what is written, and the device.
fn passed_on() -> Vec<Arg> {
    let command = Arguments::command();
    let bake = command.find_subcommand("bake").map(|bake| bake.get_arguments().cloned().collect::<Vec<Arg>>());
    let is_passed_on = |a: &Arg| a.get_id() == "device" || !NOT_PLANNED.contains(&a.get_id().as_str());
    bake.unwrap_or_default().into_iter().filter(is_passed_on).collect()
}

/// The options of bakes that are given to another command, by their long names.
pub(super) fn given(command: &ArgMatches) -> BTreeMap<String, Vec<String>> {
    let values = |argument: &Arg| {
        let id = argument.get_id().as_str();
        let is_given = command.value_source(id) == Some(ValueSource::CommandLine);
        let values = command.get_raw(id).filter(|_| is_given)?;
        Some((argument.get_long()?.to_owned(), values.map(|value| value.to_string_lossy().into_owned()).collect()))
    };
    passed_on().iter().filter_map(values).collect()
}

/// Returns options of a bake as arguments.
///
/// # Errors
/// Names an option that a bake has not, or a switch that is neither on nor off.
pub(super) fn words(options: &BTreeMap<String, Vec<String>>) -> Result<Vec<String>> {
    let known = passed_on();
    let mut words = Vec::new();
    for (option, values) in options {
        let argument = known.iter().find(|argument| argument.get_long() == Some(option));
        let argument = argument.with_context(|| format!("a bake has no option --{option} that a rule could set"))?;
        let is_switch = matches!(argument.get_action(), ArgAction::SetTrue);
        let is_known = |value: &String| !is_switch || value == "true" || value == "false";
        ensure!(values.iter().all(is_known), "--{option} is `true` or `false`, not `{}`", values.join(" "));
        words.extend(values.iter().filter_map(|value| word(argument, option, value)));
    }
    Ok(words)
}

/// Reads arguments of a bake. Returns its options, and all that are part of a plan by their long names.
///
/// # Errors
/// Says which argument is wrong, or does not apply to the method.
pub(super) fn parsed(words: &[String]) -> Result<(BakeOptions, BTreeMap<String, Vec<String>>)> {
    let fixed = ["raykiln", "bake", "input", "--output", "output.glb"].map(str::to_owned);
    let matches = Arguments::command().try_get_matches_from(fixed.into_iter().chain(words.iter().cloned()));
    let matches = matches.map_err(|e| anyhow!(first_line(&e.to_string())))?;
    let Command::Bake(bake) = Arguments::from_arg_matches(&matches)?.command else { bail!("it is not a bake") };
    let mut bake = bake.options()?;
    applies::check(&applies::given(&matches), &bake.choose)?;
    let planned = options(matches.subcommand_matches("bake").context("it is a bake")?);
    bake.recorded = recorded(&planned)?;
    Ok((bake, planned))
}

/// The first line of an error of the argument parser, without its start.
fn first_line(error: &str) -> String {
    let line = error.lines().next().unwrap_or_default();
    line.strip_prefix("error: ").unwrap_or(line).to_owned()
}

/// Rejects an option that is given with another value than the plan's.
fn check_given(option: &str, values: &[String], argument: &Arg, bake: &ArgMatches) -> Result<()> {
    let id = argument.get_id().as_str();
    if bake.value_source(id) == Some(ValueSource::CommandLine) {
        let given: Vec<String> = bake.get_raw(id).into_iter().flatten().map(|v| v.to_string_lossy().into()).collect();
        let [planned, given_words] = [values, &given].map(|values| values.join(" "));
        ensure!(given == values, "--{option} is `{planned}` in the plan, but `{given_words}` on the command line");
    }
    Ok(())
}
