//! Actions: `run` measures environments on scenes, `plot` draws what was measured. They are listed in JSON (listing 4.2 of
//! T. Bilák, "Scene optimization for RTX", master's thesis, Czech Technical University in Prague, 2024) or in TOML; the
//! results of one feed the next. `docs/lab.md` describes every key.

mod config;
mod cooling;
mod plot;
mod run;

use std::path::{Path, PathBuf};

use super::LabError;
use super::bench::RunRow;
use super::thesis::Step;
pub use config::lists_actions;
use config::{Action, Actions};

/// What actions did.
#[derive(Clone, Debug, Default)]
pub struct ActionsResult {
    /// The rows of all runs.
    pub rows: Vec<RunRow>,
    /// The files that were drawn.
    pub figures: Vec<PathBuf>,
    /// The folder of rows, figures and pictures.
    pub out: PathBuf,
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
/// cannot be written. Rows measured until then are kept.
pub fn run_actions(file: &Path, resume: bool, progress: &mut dyn FnMut(&Step)) -> Result<ActionsResult, LabError> {
    let config = Actions::read(file)?;
    let plans = config.actions.iter().map(|action| run::Plan::of(action, &config)).collect::<Result<Vec<_>, _>>()?;
    let mut result = ActionsResult { out: config.out.clone(), ..ActionsResult::default() };
    let mut table = run::Tables::new(&config.out, &plans, resume);
    let (mut done, of) = (0, plans.iter().map(run::Plan::runs).sum());
    for (action, plan) in config.actions.iter().zip(&plans) {
        match &action.what {
            Action::Run(keys) => {
                let mut tell = |name: String| progress(&Step { done, of, name });
                run::run(keys, plan, &mut table, &mut result, &mut tell)?;
                done += plan.runs();
            }
            Action::Plot(keys) => plot::plot(keys, action, &config, &mut result)?,
        }
    }
    Ok(result)
}
