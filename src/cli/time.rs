//! The command `time`: times candidates that `bake --export-candidates` wrote.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow};
use clap::Args;
use raykiln_formats::staging::{Folder, Hold};

use super::args::Output;
use super::progress::Progress;
use super::{plan, print, print_for_people};
use crate::commands::time;
use crate::report::exported::CandidatesFile;
use crate::report::json::to_json;
use crate::report::plan::PlanFile;
use crate::verify::DeviceChoice;

pub(super) const EXAMPLES: &str = "Examples:
  raykiln bake scene.glb -o baked.glb --export-candidates scene.candidates    # on a farm, without a GPU
  raykiln time scene.candidates                                               # on a machine with the GPU
  raykiln bake scene.glb -o baked.glb --plan scene.candidates                 # anywhere";

#[derive(Debug, Args)]
pub(super) struct TimeArguments {
    /// Folders of candidates, as `bake --export-candidates` writes them
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Device that traces rays: `auto` (the first GPU), or a Vulkan device by index or part of its name
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    device: String,
    /// Print the lists of candidates with their times as JSON, one after the other
    #[arg(long)]
    json: bool,
}

/// Times the candidates of each folder, and writes the times and the winner's plan there.
pub(super) fn run(arguments: &TimeArguments, output: &Output) -> Result<ExitCode> {
    for folder in &arguments.folders {
        let timed = time_one(folder, arguments, output).with_context(|| folder.display().to_string())?;
        if arguments.json {
            print(to_json(&timed).as_bytes())?;
        }
        if !output.quiet {
            print_for_people(&format!("{}\n{}", folder.display(), timed.text()));
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn time_one(folder: &Path, arguments: &TimeArguments, output: &Output) -> Result<CandidatesFile> {
    let mut list = CandidatesFile::read(folder).map_err(|why| anyhow!("{}: {why}", CandidatesFile::NAME))?;
    let plan_of = |number: usize| {
        let name = &list.candidates[number].plan;
        PlanFile::read(&folder.join(name)).map_err(|why| anyhow!("{name}: {why}"))
    };
    let plans: Vec<PlanFile> = (0..list.candidates.len()).map(plan_of).collect::<Result<_>>()?;
    let mut options = plan::verify_options(&plans[0]).with_context(|| list.candidates[0].plan.clone())?;
    options.device = DeviceChoice::from(arguments.device.as_str());
    let mut progress = Progress::new(output.quiet);
    progress.enter(format!("timing {}", folder.display()));
    let timed = time::time(folder, &mut list, &options);
    progress.finish();
    timed?;
    let winner = list.winner.and_then(|winner| plans.into_iter().nth(winner)).zip(list.device.clone());
    let winner = winner.map(|(plan, device)| plan.measured_on(device)).context("nothing won")?;
    put(folder, &list, &winner).context("the times cannot be written")?;
    Ok(list)
}

/// Writes the list and the winner's plan under other names, and renames them.
fn put(folder: &Path, list: &CandidatesFile, winner: &PlanFile) -> Result<()> {
    let hidden = Folder::new_in(folder)?;
    let files = [(CandidatesFile::NAME, to_json(list)), (CandidatesFile::WINNER, to_json(winner))];
    for (name, text) in &files {
        fs::write(hidden.path().join(name), text)?;
    }
    let _hold = Hold::new();
    for (name, _) in &files {
        fs::rename(hidden.path().join(name), folder.join(name))?;
    }
    Ok(())
}
