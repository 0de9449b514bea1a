//! Experiments: measure layouts of scenes, count what rays traverse in each, and fit prices to the measured times.
//! `docs/lab.md` describes the configuration, the tables and the fit.

mod actions;
mod bench;
mod config;
mod cooling;
mod error_vs_time;
pub mod extreme;
mod fit;
mod flags;
mod matrix;
mod motion;
mod nnls;
mod output;
mod plot;
mod quality;
mod reading;
mod rows;
mod tables;
pub mod thesis;
mod thesis_files;

use std::fmt::{Display, Write};
use std::path::{Path, PathBuf};

pub use actions::{ActionsResult, lists_actions, run_actions};
pub use bench::{KindRun, MotionRun, RunRow};
pub use cooling::Limits;
pub use error_vs_time::{ErrorRow, Value};
pub use fit::{Fit, FitError, KindFit, Predicted, SCHEMA};
pub use flags::FlagsRow;
pub use motion::{MotionRow, PolicySummary};
pub use quality::Quality;
pub use rows::{KindRow, Row};
pub use thesis_files::{Converted, convert};

use crate::choose::model::Class;
use crate::verify::{Machine, MachineKind};
use config::Config;
use reading::ReadScene;

/// Why an experiment failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LabError {
    /// The configuration is invalid.
    #[error("{}:{line}: {cause}", file.display())]
    Config {
        /// The configuration file.
        file: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong.
        cause: String,
    },
    /// A file or folder cannot be read or written.
    #[error("{}: {cause}", file.display())]
    File {
        /// Its path.
        file: PathBuf,
        /// The cause.
        cause: String,
    },
    /// A scene cannot be read, or the device cannot take it.
    #[error("{0}; `skip_broken = true` leaves such scenes out")]
    Scene(String),
    /// The device cannot be used.
    #[error("{0}")]
    Device(String),
    /// A scene cannot be read; says which and why.
    #[error("{0}")]
    Read(String),
}

impl LabError {
    fn file(file: &Path, cause: impl Display) -> LabError {
        LabError::File { file: file.to_owned(), cause: cause.to_string() }
    }
}

/// The result of an experiment.
#[derive(Debug, Default)]
pub struct Lab {
    /// A row for each layout of each scene.
    pub rows: Vec<Row>,
    /// A row for each tracer of each layout, of the experiment `error-vs-time`.
    pub error_rows: Vec<ErrorRow>,
    /// A row for each layout of each scene with each set of build flags, of the experiment `flags`.
    pub flag_rows: Vec<FlagsRow>,
    /// What the frames of each policy come to, of the experiment `motion`.
    pub policies: Vec<PolicySummary>,
    /// Hits that rounding does not explain, of the experiment `motion`, in words.
    pub faults: Vec<String>,
    /// The fitted prices, if requested.
    pub fit: Option<Result<Fit, FitError>>,
    /// The folder with the tables.
    pub out: PathBuf,
    /// What was omitted or not done as requested, in words.
    pub notes: Vec<String>,
    /// What the readers of the scenes repaired or omitted.
    pub warnings: Vec<String>,
    /// A summary in Markdown.
    pub text: String,
}

/// Runs the experiment that a configuration describes and writes its tables. `progress` receives each scene's name
/// before the scene is measured. If prices cannot be fitted, the tables of layouts are written nevertheless.
///
/// # Errors
/// Fails if the configuration is invalid, the device is missing, a scene cannot be read or the device cannot take it
/// (unless such scenes are to be skipped), or a folder cannot be written to; then nothing is written.
pub fn run(config: &Path, progress: &mut dyn FnMut(&str)) -> Result<Lab, LabError> {
    let config = Config::read(config)?;
    output::check(&config.out)?;
    let machine = Machine::open(&config.verify.device);
    let machine = machine.map_err(|e| LabError::Device(e.to_string().replace("--device", "`device`")))?;
    let notes: Vec<String> = machine.notes().iter().map(ToString::to_string).collect();
    match &config {
        Config { error_vs_time: Some(_), .. } => measure_errors(config, &machine, notes, progress),
        Config { motion: Some(moving), .. } => measure_motion(&config, moving, &machine, notes, progress),
        Config { flags: Some(flags), .. } => measure_flags(&config, flags, &machine, notes, progress),
        _ => measure_layouts(config, &machine, notes, progress),
    }
}

/// Sets errors against run time.
fn measure_errors(
    config: Config,
    machine: &Machine,
    mut notes: Vec<String>,
    progress: &mut dyn FnMut(&str),
) -> Result<Lab, LabError> {
    let Config { scenes, out, skip_broken, error_vs_time: Some(experiment), .. } = config else {
        unreachable!("the experiment is part of the configuration")
    };
    let done = error_vs_time::run(&experiment, &scenes, &out, machine, skip_broken, progress)?;
    notes.extend(done.notes);
    let text = format!("{} rows in {}\n", done.rows.len(), out.display());
    Ok(Lab { error_rows: done.rows, out, notes, warnings: done.warnings, text, ..Lab::default() })
}

/// What experiments over layouts of scenes have in common.
fn common(config: &Config) -> motion::Common<'_> {
    motion::Common {
        scenes: &config.scenes,
        plans: &config.plans,
        verify: &config.verify,
        out: &config.out,
        skip_broken: config.skip_broken,
    }
}

/// Builds layouts with sets of flags.
fn measure_flags(
    config: &Config,
    flags: &flags::Flags,
    machine: &Machine,
    mut notes: Vec<String>,
    progress: &mut dyn FnMut(&str),
) -> Result<Lab, LabError> {
    let flags::Measured { rows, notes: more, warnings, text } = flags::run(flags, &common(config), machine, progress)?;
    notes.extend(more);
    Ok(Lab { flag_rows: rows, out: config.out.clone(), notes, warnings, text, ..Lab::default() })
}

/// Traces frames of scenes that move.
fn measure_motion(
    config: &Config,
    moving: &motion::Motion,
    machine: &Machine,
    mut notes: Vec<String>,
    progress: &mut dyn FnMut(&str),
) -> Result<Lab, LabError> {
    let common = common(config);
    let motion::Measured { summaries, notes: more, warnings, faults, text } =
        motion::run(moving, &common, machine, progress)?;
    notes.extend(more);
    Ok(Lab { policies: summaries, faults, out: config.out.clone(), notes, warnings, text, ..Lab::default() })
}

/// Times layouts and, if requested, fits prices to them.
fn measure_layouts(
    config: Config,
    machine: &Machine,
    mut notes: Vec<String>,
    progress: &mut dyn FnMut(&str),
) -> Result<Lab, LabError> {
    let class = config.fit.unwrap_or_default();
    let (mut rows, mut warnings) = (Vec::new(), Vec::new());
    for (name, path) in &config.scenes {
        progress(name);
        match measure(name, path, machine, class, &config) {
            Ok((of_scene, of_reader)) => {
                rows.extend(of_scene);
                warnings.extend(of_reader);
            }
            Err(why) if config.skip_broken => notes.push(format!("left out: {why}")),
            Err(why) => return Err(LabError::Scene(why)),
        }
    }
    notes.extend(rows.iter().filter_map(untimed));
    let fit = config.fit.map(|class| fit::fit(&rows, class));
    let fitted = fit.as_ref().and_then(|fit| fit.as_ref().ok()).map(|fit| (fit, class));
    output::write(&config.out, &rows, fitted)?;
    let text = fitted.map_or_else(|| summary(&rows, machine), |(fit, class)| output::markdown(fit, class));
    Ok(Lab { rows, fit, out: config.out, notes, warnings, text, ..Lab::default() })
}

/// Measures the layouts of a scene file; also returns what its reader repaired or omitted.
fn measure(
    name: &str,
    path: &Path,
    machine: &Machine,
    class: Class,
    config: &Config,
) -> Result<(Vec<Row>, Vec<String>), String> {
    let ReadScene { scene, warnings, .. } = reading::read(path)?;
    let rows = matrix::measure(name, &scene, machine, class, config);
    Ok((rows.map_err(|why| format!("{}: {why}", path.display()))?, warnings))
}

/// Why a layout has no times.
fn untimed(row: &Row) -> Option<String> {
    row.failure.as_ref().map(|why| format!("{}: `{}` was not timed: {why}", row.scene, row.layout))
}

/// States how much was measured, if no prices are fitted.
fn summary(rows: &[Row], machine: &Machine) -> String {
    let (device, kind) = machine.name();
    let scenes = rows::by_scene(rows).len();
    let mut text = format!("{} layouts of {scenes} scenes on {device} ({})\n", rows.len(), kind.name());
    if kind != MachineKind::Gpu {
        let _ = writeln!(text, "These were not timed on a GPU and say nothing of one.");
    }
    text
}
