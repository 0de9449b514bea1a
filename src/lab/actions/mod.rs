//! Actions: `generate` writes scenes with instances, `run` measures environments on scenes, `plot` draws what was measured.
//! They are listed in JSON (listing 4.2 of T. Bilák, "Scene optimization for RTX", master's thesis, Czech Technical University in Prague, 2024) or in TOML; the
//! results of one feed the next. `docs/lab.md` describes every key.

mod config;
mod generate;
mod plot;
mod run;

use std::path::{Path, PathBuf};

use super::LabError;
use super::bench::RunRow;
use super::thesis::Step;
pub use config::lists_actions;
use config::{Action, Actions, Generated, Listed, PlotKeys, RunKeys};
use run::Plan;

/// What actions did.
#[derive(Clone, Debug, Default)]
pub struct ActionsResult {
    /// The rows of all runs.
    pub rows: Vec<RunRow>,
    /// The scene files that were generated.
    pub scenes: Vec<PathBuf>,
    /// The files that were drawn.
    pub figures: Vec<PathBuf>,
    /// The folder of rows, figures and pictures.
    pub out: PathBuf,
    /// Runs that failed and pictures that could not be drawn, with the causes.
    pub failures: Vec<String>,
    /// What was not done as asked for, in words.
    pub notes: Vec<String>,
    /// What the readers of the scenes repaired or omitted.
    pub warnings: Vec<String>,
}

/// Runs the actions that a file lists. `progress` is told of each run before it begins. With `resume`, rows of an earlier
/// run that are in the folder already are kept instead of measured again.
///
/// # Errors
/// Fails if the file or one that it names is wrong, before anything is measured; or if the device cannot be used or a file
/// cannot be written. Rows measured until then are kept. A scene that cannot be read or traced is a row with the cause, and
/// the others are measured.
pub fn run_actions(file: &Path, resume: bool, progress: &mut dyn FnMut(&Step)) -> Result<ActionsResult, LabError> {
    let config = Actions::read(file)?;
    let plans = plan(&config)?;
    let runs = || plans.iter().filter_map(Planned::run);
    let mut result = ActionsResult { out: config.out.clone(), ..ActionsResult::default() };
    let mut table = run::Tables::new(&config.out, runs().flat_map(Plan::swept), resume);
    let (mut done, of) = (0, runs().map(Plan::runs).sum());
    for planned in &plans {
        match planned {
            Planned::Generate(scenes) => generate::write(scenes, &mut result)?,
            Planned::Run(keys, plan) => {
                let mut tell = |name: String| progress(&Step { done, of, name });
                run::run(keys, plan, &mut table, &mut result, &mut tell)?;
                done += plan.runs();
            }
            Planned::Plot(keys, action) => plot::plot(keys, action, &config, &mut result)?,
        }
    }
    Ok(result)
}

/// An action with all that it names.
enum Planned<'c> {
    Generate(Vec<Generated>),
    Run(&'c RunKeys, Plan),
    Plot(&'c PlotKeys, &'c Listed),
}

impl Planned<'_> {
    fn run(&self) -> Option<&Plan> {
        if let Planned::Run(_, plan) = self { Some(plan) } else { None }
    }
}

/// Reads what all actions name; scenes that one generates can be named by those after it.
fn plan(config: &Actions) -> Result<Vec<Planned<'_>>, LabError> {
    let mut generated = Vec::new();
    let mut plans = Vec::new();
    for action in &config.actions {
        plans.push(match &action.what {
            Action::Generate(keys) => {
                let scenes = generate::scenes(keys, action, config, &generated)?;
                generated.extend(scenes.iter().cloned());
                Planned::Generate(scenes)
            }
            Action::Run(keys) => Planned::Run(keys, Plan::of(keys, action, config, &generated)?),
            Action::Plot(keys) => Planned::Plot(keys, action),
        });
    }
    Ok(plans)
}
