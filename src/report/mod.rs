//! Reports: the data (this module), as JSON ([`json`]) and as text for people ([`text`]).

pub mod candidates;
mod choice;
mod devices;
mod findings;
pub mod json;
pub(crate) mod notes;
mod passes;
mod reported_options;
pub mod text;
pub mod verdict;
mod verification;
pub(crate) mod words;

pub use devices::{Device, DeviceLimits, DevicesReport};
pub(crate) use findings::Broken;
pub use findings::{Finding, Severity};
pub use passes::Pass;
pub use reported_options::{ReportedOptions, Speed};

use std::path::PathBuf;

use serde::Serialize;

pub use crate::choose::DecidedBy;
use crate::choose::{CandidateResult, Selection, Why};
use crate::cost::Metrics;
use crate::emit::Copied;
use crate::layout::BlasPer;
use crate::methods::PlanId;
use crate::scene::Scene;
use crate::verify::verdict::Verdict;
use crate::verify::{Matching, Verification};

/// What a bake did. Times are seconds, sizes bytes, ratios plain quotients.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct BakeReport {
    /// [`BakeReport::SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub raykiln_version: &'static str,
    /// What was read.
    pub input: Input,
    /// Where the output went.
    pub output: PathBuf,
    /// What the bake was told.
    pub options: ReportedOptions,
    /// What is taken to be one BLAS in `before`, `after` and all that is predicted.
    pub blas_per: BlasPer,
    /// The input's layout.
    pub before: Metrics,
    /// The output's layout; as `before` where the output was refused.
    pub after: Metrics,
    /// How the layout was chosen.
    pub method: MethodReport,
    /// What was done besides, or left out, and why.
    pub passes: Vec<Pass>,
    /// What tracing both files showed.
    pub verify: Verification,
    /// The speed that the verdict goes by.
    pub overall: Speed,
    /// What came of it.
    pub verdict: Verdict,
    /// The same in words, and what it rests on.
    pub verdict_reason: String,
    /// Time by stage.
    pub seconds: Seconds,
    /// Largest amount of memory the process had in use, where the system tells.
    pub peak_memory_bytes: Option<u64>,
    /// Size of the output's files.
    pub output_bytes: u64,
    /// With `--instancing extension`: instances written as copies of one node.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub copied: Option<Copied>,
    /// What the reader mended or left out.
    pub warnings: Vec<String>,
    /// What the method and the writer left out, and why.
    pub notes: Vec<String>,
}

/// What a scene is made of.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Input {
    /// The file.
    pub path: PathBuf,
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
    /// Those of them that must stay as they are.
    pub pinned_instances: u64,
}

/// How a layout was chosen.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct MethodReport {
    /// What the user asked for.
    pub requested: &'static str,
    /// The method of what was written.
    pub chosen: &'static str,
    /// The candidate that was written.
    pub chosen_candidate: PlanId,
    /// What decided.
    pub decided_by: DecidedBy,
    /// Why, in words.
    pub reason: String,
    /// All layouts looked at; the input first, unless the user asked for a method.
    pub candidates: Vec<Candidate>,
}

/// A layout looked at.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Candidate {
    /// Its method, and what the method was told.
    #[serde(rename = "name")]
    pub id: PlanId,
    /// Two-level cost; of the candidate that was written, that of `after`.
    pub predicted_cost: f64,
    /// Sampled cost: predicted picoseconds a ray, in the weighted mean over the kinds of rays. None where nothing was
    /// traced to predict it.
    pub sampled_cost: Option<f64>,
    /// Rays a second on a device, in millions, in the weighted mean over the kinds of rays; none where it was not timed.
    pub measured_mrays_per_s: Option<f64>,
    /// Its speed over that of the input, measured in turns, all kinds of rays as they are weighted; none where it was not
    /// timed. 1 for the input where others were.
    pub measured_speedup_ratio: Option<f64>,
    /// How far off that may be; infinite (`null` in JSON) for too few repeats.
    pub measured_spread_ratio: Option<f64>,
    /// Why it was chosen or not.
    pub outcome: String,
    /// Predicted bytes of BLASes and TLAS.
    pub as_bytes: u64,
    /// Largest position error over the scene's diagonal; none for layouts that were not written.
    pub position_error_ratio: Option<f64>,
    /// Time to lay it out and cost it.
    pub seconds: f64,
    /// Whether it was timed no more than briefly, along other axes than one that is listed.
    #[serde(skip)]
    pub brief: bool,
}

/// Time by stage, in seconds.
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
    /// Reading it back and tracing both.
    pub verify: f64,
    /// All of it.
    pub total: f64,
}

/// What comparing two files found.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct VerifyReport {
    /// [`VerifyReport::SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub raykiln_version: &'static str,
    /// The file held to be right.
    pub input: Input,
    /// The file verified.
    pub output: PathBuf,
    /// What is taken to be one BLAS in `before` and `after`.
    pub blas_per: BlasPer,
    /// The input's layout.
    pub before: Metrics,
    /// The output's layout.
    pub after: Metrics,
    /// `identity`: the output says which triangle of the input each of its own is. `surface`: it does not, so that only
    /// what rays see was compared.
    pub matched_by: Matching,
    /// What tracing both files showed.
    pub verify: Verification,
    /// The speed that the verdict goes by.
    pub overall: Speed,
    /// What came of it.
    pub verdict: Verdict,
    /// Time it took, in seconds.
    pub seconds: f64,
    /// What the reader mended or left out.
    pub warnings: Vec<String>,
    /// What was done otherwise than asked.
    pub notes: Vec<String>,
}

/// What `inspect` found.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct InspectReport {
    /// [`InspectReport::SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub raykiln_version: &'static str,
    /// What was read.
    pub input: Input,
    /// Its layout.
    pub before: Metrics,
    /// The pairs of objects that overlap most, worst first.
    pub worst_pairs: Vec<OverlappingPair>,
    /// The vendor rules that were checked, by their ids.
    pub rules_checked: Vec<&'static str>,
    /// Those of them that the scene breaks.
    pub findings: Vec<Finding>,
    /// What the reader mended or left out.
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
    /// Surface area of the intersection of their boxes over that of the scene's box.
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
            outcome: result.outcome.to_string(),
            as_bytes: result.as_bytes,
            position_error_ratio: Some(result.position_error_ratio),
            seconds: result.seconds,
            brief: result.brief,
        }
    }
}

impl BakeReport {
    /// Identifies its JSON form: see `docs/schemas`.
    pub const SCHEMA: &str = "raykiln.bake/1";
}

impl VerifyReport {
    /// Identifies its JSON form: see `docs/schemas`.
    pub const SCHEMA: &str = "raykiln.verify/1";
}

impl InspectReport {
    /// Identifies its JSON form: see `docs/schemas`.
    pub const SCHEMA: &str = "raykiln.inspect/1";
}

impl MethodReport {
    /// Completes the entry of the candidate that was written, of which more is known now. A method that was asked for
    /// has none before: it is not costed until it is written.
    pub fn with_written(mut self, after: &Metrics, position_error_ratio: f64, seconds: f64) -> Self {
        if self.candidates.is_empty() {
            self.candidates.push(Candidate::written(self.chosen_candidate, after, seconds));
        }
        if let Some(candidate) = self.candidates.iter_mut().find(|c| c.id == self.chosen_candidate) {
            candidate.position_error_ratio = Some(position_error_ratio);
            candidate.predicted_cost = after.two_level_cost;
        }
        self
    }
}

impl Candidate {
    /// The layout that was asked for.
    fn written(id: PlanId, metrics: &Metrics, seconds: f64) -> Self {
        Candidate {
            id,
            predicted_cost: metrics.two_level_cost,
            sampled_cost: None,
            measured_mrays_per_s: None,
            measured_speedup_ratio: None,
            measured_spread_ratio: None,
            outcome: Why::AskedFor.to_string(),
            as_bytes: metrics.as_bytes(),
            position_error_ratio: None,
            seconds,
            brief: false,
        }
    }
}

impl Input {
    /// Counts a scene.
    pub fn of(path: PathBuf, scene: &Scene) -> Input {
        let geometries = || scene.meshes.iter().flat_map(|m| &m.geometries);
        Input {
            path,
            triangles: scene.triangles_stored(),
            vertices: geometries().map(|g| g.positions.len() as u64).sum(),
            objects: scene.objects(),
            materials: scene.materials.len() as u64,
            nodes: scene.nodes as u64,
            instances: scene.instances.len() as u64,
            pinned_instances: scene.instances.iter().filter(|i| i.pinned.is_some()).count() as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::Method;
    use crate::verify::MachineKind;
    use crate::verify::weights::Weights;

    /// A candidate that costs something.
    pub(super) fn candidate(id: impl Into<PlanId>, sampled_cost: f64) -> Candidate {
        let written = Candidate::written(id.into(), &Metrics::default(), 0.5);
        Candidate { sampled_cost: Some(sampled_cost), outcome: "not chosen".into(), ..written }
    }

    /// The input and one BLAS, which is chosen and predicted to be twice as fast.
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

    /// On `a device`, of nothing.
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
        let method = method(DecidedBy::Prediction).with_written(&after, 1e-9, 2.0);
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
