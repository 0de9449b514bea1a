//! Candidates that were written to be timed elsewhere: the file that lists them, and their times as text.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::plan::{PlanFile, PlannedDevice, PlannedFile};
use super::text::table;
use super::words::bytes;
use crate::choose::RacedContenders;
use crate::methods::PlanId;
use crate::verify::weights::Overall;

/// Candidates that were written into a folder, the input first.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Exported {
    /// Whether the input keeps to what is allowed, so that it may win.
    pub input_may_win: bool,
    /// The candidates.
    pub candidates: Vec<ExportedCandidate>,
}

/// A candidate that was written.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ExportedCandidate {
    /// Its plan.
    pub plan: PlanId,
    /// Name of its file in the folder.
    pub file: String,
    /// BLAKE3 hash of the files of the output that the bake would write if it won.
    pub output_blake3: String,
    /// Predicted picoseconds per ray; `None` for the input.
    pub sampled_cost: Option<f64>,
    /// Predicted bytes of acceleration structures.
    pub as_bytes: u64,
}

/// The list of candidates in a folder, the input first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct CandidatesFile {
    /// [`CandidatesFile::SCHEMA`].
    pub schema: String,
    /// Version of the program.
    pub raykiln_version: String,
    /// What was baked.
    pub input: PlannedFile,
    /// Whether the input keeps to what is allowed, so that it may win.
    pub input_may_win: bool,
    /// The device that timed them, once one has.
    pub device: Option<PlannedDevice>,
    /// Number of the one that won, once they are timed.
    pub winner: Option<usize>,
    /// The candidates.
    pub candidates: Vec<ExportedEntry>,
}

/// A candidate in the list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ExportedEntry {
    /// Its name.
    pub name: String,
    /// The scene, in the same folder.
    pub file: String,
    /// The plan that `bake --plan` follows, in the same folder.
    pub plan: String,
    /// Predicted picoseconds per ray; none for the input.
    pub sampled_cost: Option<f64>,
    /// Predicted bytes of acceleration structures.
    pub as_bytes: u64,
    /// Its speed in the views that choose, once it is timed.
    pub speed: Option<TimedSpeed>,
    /// Its speed in the views that judge, if it was the fastest in those that choose.
    pub judged: Option<TimedSpeed>,
    /// Why the device could not take it.
    pub failure: Option<String>,
}

/// A speed over that of the input.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct TimedSpeed {
    /// Million rays per second through the input.
    pub before_mrays_per_s: f64,
    /// Million rays per second.
    pub after_mrays_per_s: f64,
    /// The time of the input over its own.
    pub speedup_ratio: f64,
    /// Uncertainty of the speedup; none after a single repeat.
    pub spread_ratio: Option<f64>,
    /// The least speedup of any view.
    pub least_view_ratio: f64,
}

impl From<Overall> for TimedSpeed {
    fn from(overall: Overall) -> TimedSpeed {
        let Overall { before_mrays_per_s, after_mrays_per_s, speedup_ratio, spread_ratio, least_view_ratio, .. } =
            overall;
        let spread_ratio = Some(spread_ratio).filter(|spread| spread.is_finite());
        TimedSpeed { before_mrays_per_s, after_mrays_per_s, speedup_ratio, spread_ratio, least_view_ratio }
    }
}

impl CandidatesFile {
    /// Identifies the JSON form: see `docs/schemas`.
    pub const SCHEMA: &str = "raykiln.candidates/1";
    /// Its name in the folder.
    pub const NAME: &str = "candidates.json";
    /// Name of the plan of the winner in the folder, once they are timed.
    pub const WINNER: &str = "winner.plan.json";

    /// Lists candidates, and returns the plan of each. `plan` is that of the whole bake.
    pub fn of(exported: &Exported, plan: &PlanFile) -> (CandidatesFile, Vec<PlanFile>) {
        let plans = exported.candidates.iter().map(|candidate| {
            let left_alone = candidate.plan.is_input();
            plan.deciding(candidate.plan, candidate.output_blake3.clone(), left_alone)
        });
        let entry = |(number, candidate): (usize, &ExportedCandidate)| ExportedEntry {
            name: candidate.plan.to_string(),
            file: candidate.file.clone(),
            plan: format!("{number}.plan.json"),
            sampled_cost: candidate.sampled_cost,
            as_bytes: candidate.as_bytes,
            speed: None,
            judged: None,
            failure: None,
        };
        let file = CandidatesFile {
            schema: Self::SCHEMA.to_owned(),
            raykiln_version: plan.raykiln_version.clone(),
            input: plan.input.clone(),
            input_may_win: exported.input_may_win,
            device: None,
            winner: None,
            candidates: exported.candidates.iter().enumerate().map(entry).collect(),
        };
        (file, plans.collect())
    }

    /// Reads the list of a folder.
    ///
    /// # Errors
    /// Fails if it cannot be read, is no list of candidates, names a file outside of the folder, or is one of another
    /// version.
    pub fn read(folder: &Path) -> Result<CandidatesFile, String> {
        let text = std::fs::read_to_string(folder.join(Self::NAME)).map_err(|e| format!("cannot be read: {e}"))?;
        let file: CandidatesFile =
            serde_json::from_str(&text).map_err(|e| format!("is not a list of candidates: {e}"))?;
        let here = env!("CARGO_PKG_VERSION");
        let is_inside = |name: &String| Path::new(name).file_name().is_some_and(|own| own == name.as_str());
        match () {
            () if file.schema != Self::SCHEMA => Err(format!("is of schema `{}`, not `{}`", file.schema, Self::SCHEMA)),
            () if file.raykiln_version != here => {
                Err(format!("is of version {}, but this program is version {here}", file.raykiln_version))
            }
            () if file.candidates.is_empty() => Err("has no candidates".into()),
            () if !file.candidates.iter().all(|entry| is_inside(&entry.file) && is_inside(&entry.plan)) => {
                Err("names a file outside of its folder".into())
            }
            () => Ok(file),
        }
    }

    /// Fills in times. The contenders are all candidates but the first.
    pub fn fill_in(&mut self, raced: &RacedContenders, device: PlannedDevice) {
        for (entry, (speed, judged)) in self.candidates[1..].iter_mut().zip(raced.speeds.iter().zip(&raced.judged)) {
            entry.speed = speed.as_ref().ok().copied().map(TimedSpeed::from);
            entry.failure = speed.as_ref().err().cloned();
            entry.judged = judged.map(TimedSpeed::from);
        }
        self.device = Some(device);
        self.winner = Some(raced.winner.map_or(0, |winner| winner + 1));
    }

    /// Returns the times as text.
    pub fn text(&self) -> String {
        let device = self.device.as_ref().map_or("", |device| &device.name);
        let row = |(number, entry): (usize, &ExportedEntry)| {
            let ratio = |speed: &Option<TimedSpeed>| match (speed, &entry.failure) {
                (Some(speed), _) => speed.words(),
                (None, Some(_)) => "failed".into(),
                (None, None) => "-".into(),
            };
            let mark = if Some(number) == self.winner { "* " } else { "  " };
            let judged = entry.judged.map_or("-".into(), |judged| judged.words());
            let least = entry.speed.map_or("-".into(), |speed| format!("{:.3}", speed.least_view_ratio));
            vec![format!("{mark}{}", entry.name), bytes(entry.as_bytes), ratio(&entry.speed), least, judged]
        };
        let rows: Vec<Vec<String>> = self.candidates.iter().enumerate().map(row).collect();
        let failures = self.candidates.iter().filter_map(|entry| Some((&entry.name, entry.failure.as_ref()?)));
        let failures: String = failures.map(|(name, why)| format!("{name}: {why}\n")).collect();
        let winner = self.winner.and_then(|winner| self.candidates.get(winner)).map_or("", |entry| &entry.name);
        let heading = format!("timed on {device}");
        let table = table(&[&heading, "bytes", "speedup", "least view", "judged"], &rows);
        format!("{table}{failures}winner: {winner}\n")
    }
}

impl TimedSpeed {
    fn words(&self) -> String {
        let spread = self.spread_ratio.map_or("?".into(), |spread| format!("{spread:.3}"));
        format!("{:.3} +- {spread}", self.speedup_ratio)
    }
}
