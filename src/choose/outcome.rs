//! What choosing came to, in numbers and ids; [`crate::report`] puts it into words.

use serde::Serialize;

use super::Choice;
use crate::methods::{Method, PlanId};
use crate::scene::Pinned;
use crate::verify::weights::Overall;

/// What decided on a layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DecidedBy {
    /// The user, who named a method.
    Request,
    /// Predicted costs alone.
    Prediction,
    /// Candidates timed on a device.
    Measurement,
}

/// How a layout was chosen.
#[derive(Clone, Debug)]
pub struct Selection {
    /// What the user asked for.
    pub requested: Choice,
    /// The method of the layout chosen.
    pub method: Method,
    /// Its plan.
    pub plan: PlanId,
    /// What decided.
    pub decided_by: DecidedBy,
    /// Why it was chosen.
    pub why: Why,
    /// All layouts looked at, the input first; none if the user asked for a method.
    pub candidates: Vec<CandidateResult>,
    /// The index of the one chosen.
    pub chosen: usize,
}

/// A layout looked at.
#[derive(Clone, Debug)]
pub struct CandidateResult {
    /// Its plan.
    pub plan: PlanId,
    /// Predicted two-level cost.
    pub predicted_cost: f64,
    /// Predicted picoseconds per ray.
    pub sampled_cost: f64,
    /// Its speed against that of the input, if it was timed; the input's own if others were.
    pub measured: Option<Overall>,
    /// Why it was chosen or not.
    pub outcome: Outcome,
    /// Predicted bytes of acceleration structures.
    pub as_bytes: u64,
    /// Largest position error over the scene's diagonal.
    pub position_error_ratio: f64,
    /// Time to lay it out and cost it.
    pub seconds: f64,
    /// Whether it was timed no more than briefly.
    pub brief: bool,
}

/// How far something is beyond a bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Excess {
    /// Predicted bytes of acceleration structures over the input's.
    Bytes {
        /// What they come to.
        ratio: f64,
        /// What is allowed.
        allowed: f64,
    },
    /// Triangles of a group.
    Triangles {
        /// How many there are.
        count: usize,
        /// How many are allowed.
        allowed: u32,
    },
    /// Longest side of a group's box over that of the scene's.
    Extent {
        /// What it comes to.
        ratio: f64,
        /// What is allowed.
        allowed: f64,
    },
}

/// Why a layout was chosen.
#[derive(Clone, Debug, PartialEq)]
pub enum Why {
    /// The user asked for its method.
    AskedFor,
    /// No candidate keeps to the bounds, and the input stays, which is beyond them by this.
    NothingAllowed(Vec<Excess>),
    /// It was measured to be the fastest; its speed over the input's.
    MeasuredFastest(f64),
    /// It was measured to be the best that the bounds allow, which the input is beyond.
    MeasuredBestAllowed {
        /// Its speed over the input's.
        speedup_ratio: f64,
        /// How far the input is beyond the bounds.
        input: Vec<Excess>,
    },
    /// Nothing was measured to be faster than the input.
    NoneMeasuredFaster,
    /// Only what is beyond the bounds was measured to be faster than the input.
    FasterNotAllowed {
        /// The first such candidate.
        plan: PlanId,
        /// How far it is beyond the bounds.
        excess: Vec<Excess>,
    },
    /// It was predicted to cost clearly less than the input.
    PredictedCheapest {
        /// Predicted picoseconds per ray.
        picoseconds: f64,
        /// Those of the input.
        of_input: f64,
    },
    /// It was predicted to be the cheapest that the bounds allow, which the input is beyond.
    PredictedBestAllowed {
        /// Predicted picoseconds per ray.
        picoseconds: f64,
        /// Those of the input.
        of_input: f64,
        /// How far the input is beyond the bounds.
        input: Vec<Excess>,
    },
    /// Nothing was predicted to cost clearly less than the input.
    NonePredictedCheaper,
    /// Only what is beyond the bounds was predicted to cost clearly less than the input.
    CheaperNotAllowed {
        /// The cheapest such candidate.
        plan: PlanId,
        /// Its predicted cost over the input's.
        cost_ratio: f64,
        /// How far it is beyond the bounds.
        excess: Vec<Excess>,
    },
    /// It is the input, because the plan chosen first was not faster when it was verified.
    NotFasterWhenVerified(PlanId),
}

/// What came of a candidate.
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
    /// It is as fast as the one chosen, which takes fewer bytes.
    MoreBytes,
    /// Its measured speed over that of the one chosen.
    SpeedOfChosen(f64),
    /// Another was chosen, which was not timed.
    AnotherChosen,
    /// Predicted to cost less than the input, but not by enough.
    TooCloseToInput {
        /// Its cost over the input's.
        cost_ratio: f64,
        /// Only less than this is worth a change.
        least: f64,
    },
    /// Predicted to cost less than the one chosen, but not by enough less than the single BLAS.
    TooCloseToSingle {
        /// Its cost over that of the single BLAS.
        cost_ratio: f64,
        /// Only less than this is taken instead.
        least: f64,
    },
    /// Its predicted cost over that of the one chosen.
    CostOfChosen(f64),
    /// It comes to what another candidate came to, because rounding would move instances too far.
    HeldBack {
        /// The other candidate.
        same_as: PlanId,
        /// How many instances stay.
        instances: usize,
        /// The largest position error allowed, over the scene's diagonal.
        max_position_error_ratio: f64,
    },
    /// It was chosen first, but was not faster when it was verified.
    NotFasterWhenVerified,
}

/// Why what is written is what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The user asked for a method.
    Asked(Method),
    /// A candidate was chosen.
    Chosen(Method),
    /// No candidate keeps to the bounds.
    NoneKeeps,
}

/// Something to know about the layout chosen.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// Instances stay, because written out their vertices would move too far.
    HeldBack {
        /// How many.
        instances: usize,
        /// The largest position error allowed, over the scene's diagonal.
        max_position_error_ratio: f64,
    },
    /// It takes more bytes than the user allows.
    TooManyBytes {
        /// How many more.
        excess: Excess,
        /// Why it is written all the same.
        origin: Origin,
    },
    /// Some of its groups are larger than the user allows, for the same cause.
    TooLarge {
        /// How large the largest is.
        excess: Excess,
        /// Its index.
        group: usize,
        /// Its name, or nothing.
        name: String,
        /// How many more there are.
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
    /// The method does not heed the bound.
    NotHeeded(Method),
}
