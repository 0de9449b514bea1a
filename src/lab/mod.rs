//! Experiments: scenes times layouts, what rays meet in each and how long they take, and prices fitted to that.
//! `docs/lab.md` describes the configuration, the tables and the fit.

mod config;
mod fit;
mod matrix;
mod nnls;
mod output;
mod quality;
mod rows;

use std::fmt::{Display, Write};
use std::path::{Path, PathBuf};

pub use fit::{Fit, FitError, KindFit, Predicted, SCHEMA};
pub use quality::Quality;
pub use rows::{KindRow, Row};

use crate::choose::model::Class;
use crate::commands::verify;
use crate::verify::{Machine, MachineKind};
use config::Config;

/// Why an experiment came to nothing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LabError {
    /// The configuration says something that it cannot say.
    #[error("{}:{line}: {cause}", file.display())]
    Config {
        /// The configuration.
        file: PathBuf,
        /// Where in it, from 1.
        line: usize,
        /// What is wrong.
        cause: String,
    },
    /// A file or folder cannot be read or written.
    #[error("{}: {cause}", file.display())]
    File {
        /// Its path.
        file: PathBuf,
        /// Why.
        cause: String,
    },
    /// A scene cannot be read, or the device cannot take it.
    #[error("{0}; `skip_broken = true` leaves such scenes out")]
    Scene(String),
    /// The device cannot do it.
    #[error("{0}")]
    Device(String),
}

impl LabError {
    fn file(file: &Path, cause: impl Display) -> LabError {
        LabError::File { file: file.to_owned(), cause: cause.to_string() }
    }
}

/// What an experiment came to.
#[derive(Debug)]
pub struct Lab {
    /// A row for each layout of each scene.
    pub rows: Vec<Row>,
    /// The prices, where they were asked for.
    pub fit: Option<Result<Fit, FitError>>,
    /// Where the tables are.
    pub out: PathBuf,
    /// What was left out or done otherwise than asked, in words.
    pub notes: Vec<String>,
    /// What the readers of the scenes mended or left out.
    pub warnings: Vec<String>,
    /// A summary in Markdown.
    pub text: String,
}

/// Runs the experiment of a configuration and writes its tables. `progress` is told each scene before its turn. Where
/// prices cannot be fitted, the tables of layouts are written all the same.
///
/// # Errors
/// A configuration that makes no sense, a device that is not there, a scene that cannot be read or that the device cannot
/// take (unless they are to be left out), a folder that cannot be written to; nothing is written then.
pub fn run(config: &Path, progress: &mut dyn FnMut(&str)) -> Result<Lab, LabError> {
    let config = Config::read(config)?;
    output::check(&config.out)?;
    let machine = Machine::open(&config.verify.device);
    let machine = machine.map_err(|e| LabError::Device(e.to_string().replace("--device", "`device`")))?;
    let mut notes: Vec<String> = machine.notes().iter().map(ToString::to_string).collect();
    let class = config.fit.unwrap_or_default();
    let (mut rows, mut warnings) = (Vec::new(), Vec::new());
    for (name, path) in &config.scenes {
        progress(name);
        match measure(name, path, &machine, class, &config) {
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
    let text = fitted.map_or_else(|| summary(&rows, &machine), |(fit, class)| output::markdown(fit, class));
    Ok(Lab { rows, fit, out: config.out, notes, warnings, text })
}

/// The rows of a scene file, and what its reader mended or left out.
fn measure(
    name: &str,
    path: &Path,
    machine: &Machine,
    class: Class,
    config: &Config,
) -> Result<(Vec<Row>, Vec<String>), String> {
    let (scene, warnings) = verify::read(path).map_err(|e| e.to_string())?;
    if scene.triangles_placed() == 0 {
        return Err(format!("{}: there are no triangles to trace", path.display()));
    }
    let rows = matrix::measure(name, &scene, machine, class, config);
    Ok((rows.map_err(|why| format!("{}: {why}", path.display()))?, warnings))
}

/// Why a layout has no times.
fn untimed(row: &Row) -> Option<String> {
    row.failure.as_ref().map(|why| format!("{}: `{}` was not timed: {why}", row.scene, row.layout))
}

/// How much was measured, where no prices are fitted.
fn summary(rows: &[Row], machine: &Machine) -> String {
    let (device, kind) = machine.name();
    let scenes = rows::by_scene(rows).len();
    let mut text = format!("{} layouts of {scenes} scenes on {device} ({})\n", rows.len(), kind.name());
    if kind != MachineKind::Gpu {
        let _ = writeln!(text, "These were not timed on a GPU and say nothing of one.");
    }
    text
}
