//! Reports: the data (this module), as JSON ([`json`]) and as text ([`text`]).

pub mod batch;
pub mod cached;
pub mod candidates;
mod choice;
mod contents;
mod depfile;
mod devices;
pub mod exported;
mod files;
mod findings;
pub mod html;
pub mod json;
mod motion;
pub(crate) mod notes;
mod passes;
mod paths;
pub mod plan;
mod precision;
pub mod render;
mod reported_options;
mod size;
mod speed;
pub mod study;
pub mod text;
pub mod verdict;
mod verification;
mod version;
pub(crate) mod words;

pub use depfile::depfile;
pub use devices::{Device, DeviceLimits, DevicesReport};
pub use files::OutputCompression;
pub(crate) use findings::{Broken, Objects, compare_with_output};
pub use findings::{Cost, FailOn, Finding, NoSuchRule, Rule, Severity, Work, to_sarif};
pub use passes::Pass;
pub use reported_options::{ReportedOptions, Speed};
pub use size::{Size, SizeVerdict};
pub use version::VersionReport;

use std::path::PathBuf;

use serde::Serialize;

pub use crate::choose::DecidedBy;
use crate::choose::{CandidateResult, Selection};
use crate::cost::Metrics;
use crate::emit::Copied;
use crate::layout::{BlasPer, Rounds};
use crate::methods::PlanId;
use crate::motion::advice::Advice;
use crate::scene::{self, Scene};
use crate::verify::accuracy::Accuracy;
use crate::verify::sight::DeviceError;
use crate::verify::verdict::Verdict;
use crate::verify::{Matching, Verification};

/// What a bake did. Times are in seconds, sizes in bytes; ratios are plain quotients.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct BakeReport {
    /// [`BakeReport::SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub raykiln_version: &'static str,
    /// What was read.
    pub input: Input,
    /// The output file.
    #[serde(serialize_with = "paths::serialize")]
    pub output: PathBuf,
    /// Options of the bake.
    pub options: ReportedOptions,
    /// What counts as one BLAS in `before`, `after` and all predictions.
    pub blas_per: BlasPer,
    /// Metrics of the input's layout.
    pub before: Metrics,
    /// Metrics of the output's layout, also if the output was rejected.
    pub after: Metrics,
    /// Whether the output's acceleration structures are smaller than the input's.
    pub size: Size,
    /// The vendor rules that the input breaks.
    pub findings: Vec<Finding>,
    /// Whether what moves can be refitted, by animation.
    pub motion: Vec<Advice>,
    /// How the layout was chosen.
    pub method: MethodReport,
    /// Which other steps were applied or skipped, and why.
    pub passes: Vec<Pass>,
    /// What each round of `overlap` did, if that is the method.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overlap_rounds: Option<Rounds>,
    /// Results of tracing both files.
    pub verify: Verification,
    /// The speed that the verdict is based on.
    pub overall: Speed,
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in words, and what it is based on.
    pub verdict_reason: String,
    /// Time per stage.
    pub seconds: Seconds,
    /// Peak memory use of the process; `None` if the system does not report it.
    pub peak_memory_bytes: Option<u64>,
    /// Size of the output's files.
    pub output_bytes: u64,
    /// How the output is compressed.
    pub output_compression: OutputCompression,
    /// With `--instancing extension`: instances written as copies of one node.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub copied: Option<Copied>,
    /// What the reader repaired or omitted.
    pub warnings: Vec<String>,
    /// What the method and the writer omitted, and why.
    pub notes: Vec<String>,
}

/// What a scene consists of.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Input {
    /// The file.
    #[serde(serialize_with = "paths::serialize")]
    pub path: PathBuf,
    /// Its size with its buffers, without images in files of their own; `None` if the file cannot be looked at again.
    pub bytes: Option<u64>,
    /// Triangles stored.
    pub triangles: u64,
    /// Vertices stored.
    pub vertices: u64,
    /// Geometries placed by all instances.
    pub objects: u64,
    /// Materials in the file.
    pub materials: u64,
    /// Nodes in the file.
    pub nodes: u64,
    /// Instances in the default scene.
    pub instances: u64,
    /// Instances that must stay as they are.
    pub pinned_instances: u64,
    /// What rounding to single precision cost when an OBJ file was read; none where every corner is stored exactly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reading_error: Option<ReadingError>,
}

/// How far corners are from where the decimals of the file put them.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ReadingError {
    /// The largest distance over all corners, in the units of the file.
    pub max: f64,
    /// The largest distance over the diagonal of the corner's own object.
    pub ratio_of_object: f64,
    /// The name of the object with the largest ratio.
    pub object: String,
}

/// How a layout was chosen.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct MethodReport {
    /// What the user asked for.
    pub requested: &'static str,
    /// The method of the layout written.
    pub chosen: &'static str,
    /// The candidate that was written.
    pub chosen_candidate: PlanId,
    /// What the choice is based on.
    pub decided_by: DecidedBy,
    /// Why, in words.
    pub reason: String,
    /// All layouts considered; the input first, unless the user asked for a method.
    pub candidates: Vec<Candidate>,
}

/// A layout that was considered.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Candidate {
    /// Its method and the method's options.
    #[serde(rename = "name")]
    pub id: PlanId,
    /// Two-level cost; for the written candidate, that of `after`.
    pub predicted_cost: f64,
    /// Sampled cost: predicted picoseconds per ray, weighted mean over ray kinds. `None` if nothing was traced to
    /// predict it.
    pub sampled_cost: Option<f64>,
    /// Million rays per second on a device, weighted mean over ray kinds; `None` if it was not timed.
    pub measured_mrays_per_s: Option<f64>,
    /// Its speed over that of the input in the views that choose, measured in pairs, weighted over ray kinds; `None` if it
    /// was not timed. 1 for the input if others were timed.
    pub measured_speedup_ratio: Option<f64>,
    /// Uncertainty of `measured_speedup_ratio`; infinite (`null` in JSON) if there are too few repeats.
    pub measured_spread_ratio: Option<f64>,
    /// Its speed over that of the input in the views that judge; `None` if it was never the fastest in those that choose.
    pub judged_speedup_ratio: Option<f64>,
    /// The least of these speeds of any view that judges.
    pub judged_least_view_ratio: Option<f64>,
    /// Why it was chosen or not.
    pub outcome: String,
    /// Predicted bytes of BLASes and TLAS.
    pub as_bytes: u64,
    /// Its two-level cost over the least of all candidates.
    pub cost_ratio: f64,
    /// Picoseconds per ray on a device, weighted mean over ray kinds; `None` if it was not timed.
    pub measured_picoseconds: Option<f64>,
    /// Largest position error over the scene's diagonal; `None` if not measured.
    pub position_error_ratio: Option<f64>,
    /// What tracing it costs in accuracy: traced on the CPU, and for the written candidate as verified.
    #[serde(flatten)]
    pub accuracy: Accuracy,
    /// Time spent on laying it out and computing its cost.
    pub seconds: f64,
    /// Whether it was timed only briefly, as a listed candidate stored along other axes.
    #[serde(skip)]
    pub brief: bool,
}

/// Time per stage, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Seconds {
    /// Reading the input.
    pub read: f64,
    /// Measuring the layouts of input and output.
    pub analyse: f64,
    /// Choosing a layout.
    pub optimise: f64,
    /// Writing the output, staged.
    pub write: f64,
    /// Reading the output back and tracing both files.
    pub verify: f64,
    /// The whole bake.
    pub total: f64,
}

/// The result of comparing two files.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct VerifyReport {
    /// [`VerifyReport::SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub raykiln_version: &'static str,
    /// The reference file.
    pub input: Input,
    /// The file that was verified.
    #[serde(serialize_with = "paths::serialize")]
    pub output: PathBuf,
    /// Its size, as [`Input::bytes`].
    pub output_bytes: Option<u64>,
    /// What counts as one BLAS in `before` and `after`.
    pub blas_per: BlasPer,
    /// Metrics of the input's layout.
    pub before: Metrics,
    /// Metrics of the output's layout.
    pub after: Metrics,
    /// `place`: all triangles were compared by place. `identity`: that place must be the one that the output records.
    /// `surface`: only what rays see was compared.
    pub matched_by: Matching,
    /// Results of tracing both files.
    pub verify: Verification,
    /// The vendor rules that the reference file breaks, and whether the other one does so too.
    pub findings: Vec<Finding>,
    /// The speed that the verdict is based on.
    pub overall: Speed,
    /// The verdict.
    pub verdict: Verdict,
    /// Duration in seconds.
    pub seconds: f64,
    /// What the reader repaired or omitted.
    pub warnings: Vec<String>,
    /// What was not done as requested.
    pub notes: Vec<String>,
}

/// The result of `inspect`.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct InspectReport {
    /// [`InspectReport::SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub raykiln_version: &'static str,
    /// What was read.
    pub input: Input,
    /// Metrics of its layout.
    pub before: Metrics,
    /// The pairs of objects that overlap most, worst first.
    pub worst_pairs: Vec<OverlappingPair>,
    /// The vendor rules that were checked: all.
    pub rules_checked: Vec<Rule>,
    /// The rules that the scene breaks.
    pub findings: Vec<Finding>,
    /// Whether what moves can be refitted, by animation.
    pub motion: Vec<Advice>,
    /// What single precision may do to a ray as long as the scene, and which objects it cannot tell therefore.
    pub device_error: DeviceError,
    /// What the reader repaired or omitted.
    pub warnings: Vec<String>,
}

/// Two objects whose boxes overlap.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct OverlappingPair {
    /// The first object.
    pub a: String,
    /// The second object.
    pub b: String,
    /// Surface area of the intersection of their boxes over that of the box of the scene's core.
    pub overlap_ratio: f64,
}

impl From<Selection> for MethodReport {
    fn from(selection: Selection) -> MethodReport {
        MethodReport {
            requested: selection.requested.name(),
            chosen: selection.method.name(),
            chosen_candidate: selection.plan,
            decided_by: selection.decided_by,
            reason: selection.why.to_string(),
            candidates: selection.candidates.into_iter().map(Candidate::from).collect(),
        }
    }
}

impl From<CandidateResult> for Candidate {
    fn from(result: CandidateResult) -> Candidate {
        Candidate {
            id: result.plan,
            predicted_cost: result.predicted_cost,
            sampled_cost: Some(result.sampled_cost),
            measured_mrays_per_s: result.measured.map(|m| m.after_mrays_per_s),
            measured_speedup_ratio: result.measured.map(|m| m.speedup_ratio),
            measured_spread_ratio: result.measured.map(|m| m.spread_ratio),
            judged_speedup_ratio: result.judged.map(|judged| judged.speedup_ratio),
            judged_least_view_ratio: result.judged.map(|judged| judged.least_view_ratio),
            outcome: result.outcome.to_string(),
            as_bytes: result.as_bytes,
            cost_ratio: 1.0,
            measured_picoseconds: result.measured.map(|m| 1e6 / m.after_mrays_per_s).filter(|ps| ps.is_finite()),
            position_error_ratio: Some(result.position_error_ratio),
            accuracy: result.accuracy,
            seconds: result.seconds,
            brief: result.brief,
        }
    }
}

impl BakeReport {
    /// Identifies the JSON form: see `docs/schemas`.
    pub const SCHEMA: &str = "raykiln.bake/1";
}

impl VerifyReport {
    /// Identifies the JSON form: see `docs/schemas`.
    pub const SCHEMA: &str = "raykiln.verify/1";
}

impl InspectReport {
    /// Identifies the JSON form: see `docs/schemas`.
    pub const SCHEMA: &str = "raykiln.inspect/1";
}

impl MethodReport {
    /// Completes the entry of the written candidate with what is known now. A requested method has no entry yet: its
    /// cost is not computed until it is written.
    pub fn with_written(mut self, after: &Metrics, verified: &Verification, seconds: f64) -> Self {
        if self.candidates.is_empty() {
            self.candidates.push(Candidate::written(self.chosen_candidate, self.reason.clone(), after, seconds));
        }
        if let Some(candidate) = self.candidates.iter_mut().find(|c| c.id == self.chosen_candidate) {
            candidate.position_error_ratio = Some(verified.position_error_ratio);
            candidate.accuracy = verified.accuracy();
            candidate.predicted_cost = after.two_level_cost;
        }
        let least = self.candidates.iter().map(|c| c.predicted_cost).fold(f64::INFINITY, f64::min);
        for candidate in self.candidates.iter_mut().filter(|_| least > 0.0) {
            candidate.cost_ratio = candidate.predicted_cost / least;
        }
        self
    }
}

impl Candidate {
    /// The layout that the user asked for.
    fn written(id: PlanId, outcome: String, metrics: &Metrics, seconds: f64) -> Self {
        Candidate {
            id,
            predicted_cost: metrics.two_level_cost,
            sampled_cost: None,
            measured_mrays_per_s: None,
            measured_speedup_ratio: None,
            measured_spread_ratio: None,
            judged_speedup_ratio: None,
            judged_least_view_ratio: None,
            outcome,
            as_bytes: metrics.as_bytes(),
            cost_ratio: 1.0,
            measured_picoseconds: None,
            position_error_ratio: None,
            accuracy: Accuracy::default(),
            seconds,
            brief: false,
        }
    }
}

impl Input {
    /// Counts what a scene consists of.
    pub fn of(path: PathBuf, bytes: Option<u64>, scene: &Scene) -> Input {
        let geometries = || scene.meshes.iter().flat_map(|m| &m.geometries);
        Input {
            path,
            bytes,
            triangles: scene.triangles_stored(),
            vertices: geometries().map(|g| g.positions.len() as u64).sum(),
            objects: scene.objects(),
            materials: scene.materials.len() as u64,
            nodes: scene.nodes as u64,
            instances: scene.instances.len() as u64,
            pinned_instances: scene.instances.iter().filter(|i| i.pinned.is_some()).count() as u64,
            reading_error: ReadingError::of(scene),
        }
    }
}

impl ReadingError {
    fn of(scene: &Scene) -> Option<ReadingError> {
        let scene::ReadingError { max, ratio_of_object, object } = scene.reading_error()?;
        Some(ReadingError { max, ratio_of_object, object: scene.instances[object.0 as usize].name.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::Method;
    use crate::verify::MachineKind;
    use crate::verify::weights::Weights;

    /// A speed that is the same in all views.
    pub(super) fn speed(measured_on: MachineKind, speedup_ratio: f64, spread_ratio: f64) -> Speed {
        Speed {
            measured_on,
            before_mrays_per_s: 10.0,
            after_mrays_per_s: 10.0 * speedup_ratio,
            speedup_ratio,
            spread_ratio,
            repeats_spread_ratio: spread_ratio,
            views_spread_ratio: 0.0,
            least_view_ratio: speedup_ratio,
            most_view_ratio: speedup_ratio,
        }
    }

    /// A candidate with a sampled cost.
    pub(super) fn candidate(id: impl Into<PlanId>, sampled_cost: f64) -> Candidate {
        let written = Candidate::written(id.into(), String::new(), &Metrics::default(), 0.5);
        Candidate { sampled_cost: Some(sampled_cost), outcome: "not chosen".into(), ..written }
    }

    /// The input and a single BLAS, which is chosen and predicted to be twice as fast.
    pub(super) fn method(decided_by: DecidedBy) -> MethodReport {
        MethodReport {
            requested: "auto",
            chosen: "single",
            chosen_candidate: Method::Single.into(),
            decided_by,
            reason: "a reason".into(),
            candidates: vec![candidate(Method::Keep, 200.0), candidate(Method::Single, 100.0)],
        }
    }

    /// The verification of an empty scene on `a device`.
    pub(super) fn verification() -> Verification {
        let options = crate::verify::VerifyOptions { rays_per_kind: 1, ..Default::default() };
        Verification {
            device: "a device".into(),
            ..crate::verify::verify(&Scene::default(), &Scene::default(), &options)
        }
    }

    #[test]
    fn the_candidate_written_costs_what_was_written() {
        let after = Metrics { two_level_cost: 7.0, ..Metrics::default() };
        let method = method(DecidedBy::Prediction).with_written(
            &after,
            &Verification { position_error_ratio: 1e-9, ..verification() },
            2.0,
        );
        assert_eq!(method.candidates[1].predicted_cost, 7.0);
        assert_eq!(method.candidates[1].position_error_ratio, Some(1e-9));
        assert_eq!(method.candidates[0].predicted_cost, 0.0);
    }

    #[test]
    fn speeds_that_no_device_built_for_are_those_of_the_cpu() {
        let speed = Speed::of(&verification(), &Weights::default(), MachineKind::Gpu);
        assert_eq!((speed.measured_on, speed.speedup_ratio), (MachineKind::Cpu, 1.0));
        assert!(!speed.is_faster() && !speed.is_slower());
    }
}
