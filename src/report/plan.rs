//! Plans: decisions written down, so that a bake can be repeated without a device.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::BakeReport;
use crate::choose::{Decided, DecidedBy};
use crate::methods::PlanId;
use crate::verify::MachineKind;
use crate::verify::verdict::Verdict;

/// Hashes that a plan holds for: BLAKE3, in hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Hashes {
    /// Of the input: its file and what was read from it.
    pub input: String,
    /// Of the files of the output.
    pub output: String,
}

/// A plan as a file. Its options are those of the command line, by name, with their defaults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PlanFile {
    /// [`PlanFile::SCHEMA`].
    pub schema: String,
    /// Version of the program; another one may lay out otherwise.
    pub raykiln_version: String,
    /// What was baked.
    pub input: PlannedFile,
    /// Hash of the files that were written.
    pub output_blake3: String,
    /// Every option that decides what is written.
    pub options: BTreeMap<String, Vec<String>>,
    /// What was decided.
    pub decision: PlannedDecision,
    /// The device that rays were traced on.
    pub device: PlannedDevice,
}

/// The input of a plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PlannedFile {
    /// Where it was; it may be elsewhere.
    #[serde(serialize_with = "super::paths::serialize")]
    pub path: PathBuf,
    /// Hash of the file and of what was read from it.
    pub blake3: String,
}

/// The layout of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PlannedDecision {
    /// The method of the layout.
    pub method: String,
    /// What the decision was based on: `request`, `prediction`, `measurement` or `plan`.
    pub decided_by: String,
    /// The name of the candidate, without refinement and axes.
    pub plan: String,
    /// The entry cost that replaces the candidate's, if any.
    pub entry_cost: Option<f64>,
    /// Number of the rotation of the stored axes; 0 is the identity.
    pub axes: u8,
    /// Whether the input was left alone, byte for byte, whatever the candidate.
    pub left_alone: bool,
}

/// A device, by name, kind and driver.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PlannedDevice {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: String,
    /// Name and version of its driver; empty for the CPU.
    pub driver: String,
}

impl PlannedDevice {
    /// Returns a device of a kind.
    pub fn new(name: impl Into<String>, kind: MachineKind, driver: impl Into<String>) -> PlannedDevice {
        PlannedDevice { name: name.into(), kind: kind.name().to_owned(), driver: driver.into() }
    }
}

impl PlanFile {
    /// Identifies the JSON form: see `docs/schemas`.
    pub const SCHEMA: &str = "raykiln.plan/1";

    /// Returns the plan of a bake with these options.
    pub fn of(
        report: &BakeReport,
        hashes: &Hashes,
        device: PlannedDevice,
        options: BTreeMap<String, Vec<String>>,
    ) -> PlanFile {
        let id = report.method.chosen_candidate;
        PlanFile {
            schema: Self::SCHEMA.to_owned(),
            raykiln_version: report.raykiln_version.to_owned(),
            input: PlannedFile { path: report.input.path.clone(), blake3: hashes.input.clone() },
            output_blake3: hashes.output.clone(),
            options,
            decision: PlannedDecision {
                method: report.method.chosen.to_owned(),
                decided_by: report.method.decided_by.name().to_owned(),
                plan: id.name().to_owned(),
                entry_cost: id.refined_entry_cost(),
                axes: id.axes(),
                left_alone: report.verdict == Verdict::LeftAlone,
            },
            device,
        }
    }

    /// Returns the plan of the same bake if another candidate had been chosen, after measurements elsewhere.
    pub fn deciding(&self, id: PlanId, output_blake3: String, left_alone: bool) -> PlanFile {
        let decision = PlannedDecision {
            method: id.method().name().to_owned(),
            plan: id.name().to_owned(),
            entry_cost: id.refined_entry_cost(),
            axes: id.axes(),
            left_alone,
            ..self.decision.clone()
        };
        PlanFile { output_blake3, decision, ..self.clone() }
    }

    /// Returns the plan as one that measurements on a device decided.
    pub fn measured_on(self, device: PlannedDevice) -> PlanFile {
        let decided_by = DecidedBy::Measurement.name().to_owned();
        PlanFile { device, decision: PlannedDecision { decided_by, ..self.decision }, ..self }
    }

    /// Reads a plan.
    ///
    /// # Errors
    /// Fails if the file cannot be read, is not a plan, or is one of another version.
    pub fn read(path: &Path) -> Result<PlanFile, String> {
        let text = std::fs::read_to_string(path).map_err(|e| format!("cannot be read: {e}"))?;
        PlanFile::parse(&text)
    }

    fn parse(text: &str) -> Result<PlanFile, String> {
        let value: serde_json::Value = serde_json::from_str(text).map_err(|e| format!("is not JSON: {e}"))?;
        match value["schema"].as_str() {
            Some(PlanFile::SCHEMA) => {}
            Some(other) => return Err(format!("is of schema `{other}`, not `{}`", PlanFile::SCHEMA)),
            None => return Err("is not a plan: it has no `schema`".into()),
        }
        let plan: PlanFile = serde_json::from_value(value).map_err(|e| format!("is not a plan: {e}"))?;
        let here = env!("CARGO_PKG_VERSION");
        if plan.raykiln_version != here {
            return Err(format!("is a plan of version {}, but this program is version {here}", plan.raykiln_version));
        }
        Ok(plan)
    }

    /// The hashes that it holds for.
    pub fn hashes(&self) -> Hashes {
        Hashes { input: self.input.blake3.clone(), output: self.output_blake3.clone() }
    }

    /// What was decided.
    pub fn decided(&self) -> Decided {
        let PlannedDecision { plan, entry_cost, axes, .. } = &self.decision;
        Decided::new(plan, *entry_cost, *axes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> PlanFile {
        PlanFile {
            schema: PlanFile::SCHEMA.into(),
            raykiln_version: env!("CARGO_PKG_VERSION").into(),
            input: PlannedFile { path: "in.glb".into(), blake3: "00".into() },
            output_blake3: "11".into(),
            options: [("effort".to_owned(), vec!["3".to_owned()])].into(),
            decision: PlannedDecision {
                method: "cluster".into(),
                decided_by: "measurement".into(),
                plan: "cluster, entry 15".into(),
                entry_cost: Some(15.0 / 1.3),
                axes: 7,
                left_alone: false,
            },
            device: PlannedDevice::new("a device", MachineKind::Gpu, "a driver 1.2"),
        }
    }

    #[test]
    fn a_plan_is_read_as_it_was_written() {
        let written = super::super::json::to_json(&plan());
        let read = PlanFile::parse(&written).expect("a plan");
        assert_eq!(read, plan());
        assert_eq!(read.decided(), Decided::new("cluster, entry 15", Some(15.0 / 1.3), 7));
    }

    #[test]
    fn what_is_no_plan_of_this_version_is_refused() {
        let refusal = |text: &str| PlanFile::parse(text).expect_err("refused");
        assert!(refusal("{").starts_with("is not JSON: "));
        assert_eq!(refusal("{}"), "is not a plan: it has no `schema`");
        assert!(refusal(r#"{"schema": "raykiln.bake/1"}"#).contains("is of schema `raykiln.bake/1`"));
        assert!(refusal(r#"{"schema": "raykiln.plan/1"}"#).contains("missing field"));
        let older = super::super::json::to_json(&PlanFile { raykiln_version: "0.0.9".into(), ..plan() });
        assert!(refusal(&older).contains("version 0.0.9"), "{}", refusal(&older));
    }
}
