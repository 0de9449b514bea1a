//! [`Job`]: an asset with everything that is decided about it before it is baked.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use raykiln_formats::ObjOptions;

use super::find::Asset;
use super::manifest::Budget;
use crate::commands::cached::Decides;

/// How a bake is run; many assets share it.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The options as arguments of `bake`.
    pub words: Vec<String>,
    /// Every option that decides what is written, with its values.
    pub options: BTreeMap<String, Vec<String>>,
    /// How OBJ files are read.
    pub obj: ObjOptions,
    /// The device that decides, see [`crate::commands::cached::deciding_device`].
    pub device: String,
}

/// An asset to be baked.
#[derive(Clone, Debug)]
pub struct Job {
    /// The asset.
    pub asset: Asset,
    /// The output's path below the folder of outputs, with `/` between the parts.
    pub output_name: String,
    /// The output.
    pub output: PathBuf,
    /// How it is baked.
    pub settings: Arc<Settings>,
    /// What the bake may use.
    pub budget: Budget,
}

/// Why an asset has no output.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The name leads elsewhere.
    #[error("{asset}: the output `{output}` is not a name below the folder of outputs")]
    Outside {
        /// The asset.
        asset: String,
        /// The name.
        output: String,
    },
    /// Another asset has the same output.
    #[error("{asset} and {other} have the same output {output}: give one another name by a rule with `output`")]
    Shared {
        /// The asset.
        asset: String,
        /// The asset that has the output, too.
        other: String,
        /// The output.
        output: String,
    },
    /// The output is an input.
    #[error("{asset}: its output would replace an asset")]
    IsInput {
        /// The asset.
        asset: String,
    },
}

impl Job {
    /// Returns what decides the result; `reports` are those that are wanted besides JSON.
    pub(super) fn decides<'a>(&'a self, reports: &'a [&'a str]) -> Decides<'a> {
        let Settings { options, obj, device, .. } = &*self.settings;
        Decides {
            input: &self.asset.file,
            output: &self.output,
            options,
            obj: obj.clone(),
            device,
            plan: None,
            reports,
        }
    }

    /// The path of a report with this extension, below the folder of outputs. JSON reports get another ending than the
    /// asset's own files may have.
    pub(super) fn report_name(&self, extension: &str) -> String {
        format!("{}.report.{extension}", self.output_name)
    }
}

/// Checks that each job has an output of its own, that is not an asset.
///
/// # Errors
/// Names the first job that has not.
pub fn check(jobs: &[Job]) -> Result<(), OutputError> {
    let mut taken: BTreeMap<String, &Job> = BTreeMap::new();
    let real = |path: &Path| std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let inputs: BTreeSet<PathBuf> = jobs.iter().map(|job| real(&job.asset.file)).collect();
    for job in jobs {
        let asset = job.asset.name.clone();
        let parts = Path::new(&job.output_name).components();
        let hidden = job.output_name.starts_with(super::record::FOLDER);
        if hidden || !parts.into_iter().all(|part| matches!(part, std::path::Component::Normal(_))) {
            return Err(OutputError::Outside { asset, output: job.output_name.clone() });
        }
        // Some file systems do not tell letters by their case.
        if let Some(other) = taken.insert(job.output_name.to_lowercase(), job) {
            let other = other.asset.name.clone();
            return Err(OutputError::Shared { asset, other, output: job.output_name.clone() });
        }
        if inputs.contains(&real(&job.output)) {
            return Err(OutputError::IsInput { asset });
        }
    }
    Ok(())
}
