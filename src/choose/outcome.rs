//! The result of choosing a layout, in numbers and ids; [`crate::report`] puts it into words.

use serde::Serialize;

use super::Choice;
use crate::methods::{Method, PlanId};
use crate::scene::Pinned;
use crate::verify::accuracy::Accuracy;
use crate::verify::weights::Overall;

/// What a choice is based on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DecidedBy {
    /// The user, who named a method.
    Request,
    /// Predicted costs alone.
    Prediction,
    /// Candidates timed on a device.
    Measurement,
    /// A plan, in which an earlier decision was written down.
    Plan,
}

impl DecidedBy {
    /// Returns the name in reports.
    pub fn name(self) -> &'static str {
        match self {
            DecidedBy::Request => "request",
            DecidedBy::Prediction => "prediction",
            DecidedBy::Measurement => "measurement",
            DecidedBy::Plan => "plan",
        }
    }
}

/// How a layout was chosen.
#[derive(Clone, Debug)]
pub struct Selection {
    /// What the user asked for.
    pub requested: Choice,
    /// The method of the chosen layout.
    pub method: Method,
    /// Its plan.
    pub plan: PlanId,
    /// What the choice is based on.
    pub decided_by: DecidedBy,
    /// Why it was chosen.
    pub why: Why,
    /// All layouts considered, the input first; empty if the user asked for a method.
    pub candidates: Vec<CandidateResult>,
    /// Index of the chosen candidate.
    pub chosen: usize,
}

/// A layout that was considered.
#[derive(Clone, Debug)]
pub struct CandidateResult {
    /// Its plan.
    pub plan: PlanId,
    /// Predicted two-level cost.
    pub predicted_cost: f64,
    /// Predicted picoseconds per ray.
    pub sampled_cost: f64,
    /// Its speed relative to the input in the views that choose, if it was timed; the input's own if others were timed.
    pub measured: Option<Overall>,
    /// Its speed in the views that judge, if it was the fastest in those that choose.
    pub judged: Option<Overall>,
    /// Why it was chosen or not.
    pub outcome: Outcome,
    /// Predicted bytes of acceleration structures.
    pub as_bytes: u64,
    /// Largest position error over the scene's diagonal.
    pub position_error_ratio: f64,
    /// What tracing it costs in accuracy.
    pub accuracy: Accuracy,
    /// Seconds spent on laying it out and computing its cost.
    pub seconds: f64,
    /// Whether it was timed only briefly.
    pub brief: bool,
}

/// How far something exceeds a bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Excess {
    /// Predicted bytes of acceleration structures over the input's.
    Bytes {
        /// The ratio found.
        ratio: f64,
        /// The ratio allowed.
        allowed: f64,
    },
    /// Triangles per group.
    Triangles {
        /// The number found.
        count: usize,
        /// The number allowed.
        allowed: u32,
    },
    /// Longest side of a group's box over that of the scene.
    Extent {
        /// The ratio found.
        ratio: f64,
        /// The ratio allowed.
        allowed: f64,
    },
}

/// Why a layout was chosen.
#[derive(Clone, Debug, PartialEq)]
pub enum Why {
    /// The user asked for its method.
    AskedFor,
    /// A plan says so.
    Planned,
    /// No candidate keeps to the bounds, so the input stays; it exceeds them by this.
    NothingAllowed(Vec<Excess>),
    /// It was measured fastest; its speed over the input's.
    MeasuredFastest(f64),
    /// It was measured best among the allowed candidates; the input is not allowed.
    MeasuredBestAllowed {
        /// Its speed over the input's.
        speedup_ratio: f64,
        /// How far the input exceeds the bounds.
        input: Vec<Excess>,
    },
    /// Nothing was measured faster than the input.
    NoneMeasuredFaster,
    /// As many candidates were measured faster in the views that choose, but in the views that judge they were not, or were
    /// too slow in one.
    NoneJudgedFaster(usize),
    /// Only candidates beyond the bounds were measured faster than the input.
    FasterNotAllowed {
        /// The first such candidate.
        plan: PlanId,
        /// How far it exceeds the bounds.
        excess: Vec<Excess>,
    },
    /// It was predicted to cost clearly less than the input.
    PredictedCheapest {
        /// Predicted picoseconds per ray.
        picoseconds: f64,
        /// The input's.
        of_input: f64,
    },
    /// It was predicted cheapest among the allowed candidates; the input is not allowed.
    PredictedBestAllowed {
        /// Predicted picoseconds per ray.
        picoseconds: f64,
        /// The input's.
        of_input: f64,
        /// How far the input exceeds the bounds.
        input: Vec<Excess>,
    },
    /// Nothing was predicted to cost clearly less than the input.
    NonePredictedCheaper,
    /// Only candidates beyond the bounds were predicted to cost clearly less than the input.
    CheaperNotAllowed {
        /// The cheapest such candidate.
        plan: PlanId,
        /// Its predicted cost over the input's.
        cost_ratio: f64,
        /// How far it exceeds the bounds.
        excess: Vec<Excess>,
    },
    /// It is the input, because the plan chosen first was not faster during verification.
    NotFasterWhenVerified(PlanId),
}

/// The outcome of a candidate.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It was chosen.
    Chosen(Why),
    /// It is beyond the bounds.
    NotAllowed(Vec<Excess>),
    /// The device could not take it; its reason.
    Failed(String),
    /// The input: another was measured to be faster.
    AnotherFaster,
    /// It was timed briefly, and another of its kind was faster.
    BrieflySlower,
    /// It was predicted to cost more than those that were timed.
    NotMeasured,
    /// It was measured to be slower than the input.
    SlowerThanInput,
    /// It was measured to be no faster than the input beyond the spread.
    NotFasterThanInput,
    /// It is faster on average, but in the views that choose one is too slow.
    SlowInAView(f64),
    /// It was the fastest in the views that choose; in those that judge it is not faster.
    NotFasterWhenJudged {
        /// Its speed over the input's there.
        speedup_ratio: f64,
        /// The least of any view.
        least_view_ratio: f64,
    },
    /// It is as fast as the chosen one, which takes fewer bytes.
    MoreBytes,
    /// Its measured speed over that of the chosen one.
    SpeedOfChosen(f64),
    /// Another one was chosen, which was not timed.
    AnotherChosen,
    /// Predicted to cost less than the input, but not by enough.
    TooCloseToInput {
        /// Its cost over the input's.
        cost_ratio: f64,
        /// The ratio below which a change is worth it.
        least: f64,
    },
    /// Predicted to cost less than the chosen one, but not by enough less than the single BLAS.
    TooCloseToSingle {
        /// Its cost over that of the single BLAS.
        cost_ratio: f64,
        /// The ratio below which it is chosen instead.
        least: f64,
    },
    /// Its predicted cost over that of the chosen one.
    CostOfChosen(f64),
    /// It equals another candidate, because rounding would move the vertices of some instances too far.
    HeldBack {
        /// The other candidate.
        same_as: PlanId,
        /// The number of instances that stay.
        instances: usize,
        /// The largest position error allowed, over the scene's diagonal.
        max_position_error_ratio: f64,
    },
    /// It was chosen first, but was not faster during verification.
    NotFasterWhenVerified,
}

/// Why this layout is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The user asked for a method.
    Asked(Method),
    /// A candidate was chosen.
    Chosen(Method),
    /// No candidate keeps to the bounds.
    NoneKeeps,
}

/// A remark about the chosen layout.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// Instances stay, because their vertices would move too far if written out.
    HeldBack {
        /// The number of instances.
        instances: usize,
        /// The largest position error allowed, over the scene's diagonal.
        max_position_error_ratio: f64,
    },
    /// It takes more bytes than the user allows.
    TooManyBytes {
        /// By how much.
        excess: Excess,
        /// Why it is written nevertheless.
        origin: Origin,
    },
    /// Some of its groups exceed the user's limit for the same cause.
    TooLarge {
        /// By how much the largest exceeds it.
        excess: Excess,
        /// Its index.
        group: usize,
        /// Its name; may be empty.
        name: String,
        /// The number of further groups.
        others: usize,
        /// Why it is so large.
        cause: GroupCause,
    },
}

/// Why a group is as large as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupCause {
    /// It is pinned.
    Pinned(Pinned),
    /// A piece of a mesh that this many instances place.
    Opened(usize),
    /// A whole mesh that this many instances place.
    Shared(usize),
    /// No candidate keeps to the bounds.
    InputStays,
    /// It cannot be divided further.
    Indivisible,
    /// The method ignores the bound.
    NotHeeded(Method),
}
