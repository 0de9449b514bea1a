//! Which layout to write: the method asked for, or with `auto` the best of many.
//!
//! Candidates are laid out, ranked by what rays are predicted to cost ([`model`]), and, where a device traces, the best
//! few of them are built and timed in turns with the input: structure is where predictions fail. The input as it is
//! always competes, and wins where nothing beats it. What counts is the layout as its consumer builds it: with one BLAS a
//! primitive, each geometry of a group is a group of its own.

#[cfg(any(feature = "cli", feature = "lab"))]
pub(crate) mod applies;
mod bounds;
mod candidate;
mod decide;
mod elsewhere;
mod evaluate;
pub mod model;
mod outcome;
mod passes;
pub mod plans;
mod refine;
mod replay;
mod segments;
#[cfg(test)]
mod tests_of_seams;

use std::sync::Arc;
use std::time::Instant;

use crate::cost::Metrics;
use crate::cost::mesh_trees::MeshTrees;
use crate::layout::BlasPer;
use crate::layout::{self, Layout, PlacedTrees};
use crate::methods::{self, Cache, Method, PartOptions};
use crate::scene::{Overlay, Scene};
use crate::tree::Tree;
use crate::verify::weights::Overall;
use crate::verify::{Machine, MachineKind, Timing, VerifyOptions};
use bounds::Bounds;
pub(crate) use candidate::{Candidate, written};
use candidate::{Laid, lay_out};
use decide::Decision;
pub use elsewhere::{Contender, RacedContenders, race_contenders};
pub(crate) use evaluate::{Duplicate, Evaluated, Evaluator};
use model::Class;
pub use outcome::{CandidateResult, DecidedBy, Excess, GroupCause, Note, Origin, Outcome, Selection, Why};
pub use passes::{But, NotTimed, Pass, PassId, Reason};
use plans::{Effort, Plan};
use refine::Round;
pub use replay::Decided;

/// How the layout is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Choice {
    /// The best of many candidates; the input as it is among them.
    #[default]
    Auto,
    /// One method.
    Method(Method),
}

impl From<Method> for Choice {
    fn from(method: Method) -> Choice {
        Choice::Method(method)
    }
}

impl Choice {
    /// The name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Choice::Auto => "auto",
            Choice::Method(method) => method.name(),
        }
    }
}

/// What `auto` must not try, though it might pay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Forbidden {
    /// Groups of their own for what encloses the rest or lies far outside.
    pub isolate: bool,
    /// Groups of their own for triangles that are not opaque.
    pub split_opacity: bool,
    /// Instances opened or written out where that is predicted to pay, mesh by mesh.
    pub choose_instances: bool,
}

/// What choosing may be told.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct ChooseOptions {
    /// How the layout is chosen.
    pub method: Choice,
    /// What the methods may be told.
    pub layout: methods::Options,
    /// How many candidates `auto` looks at, and how closely.
    pub effort: Effort,
    /// What kind of device the rays of the user run on, for predictions.
    pub class: Class,
    /// What is ruled out.
    pub forbidden: Forbidden,
    /// What `auto` decided before and shall not decide again.
    pub decided: Option<Decided>,
    /// Whether `auto` also returns the candidates that are worth timing ([`Chosen::contenders`]), to be timed elsewhere.
    pub export: bool,
    /// How many rays of each kind `auto` ranks candidates by; `None`: as many as suit the effort.
    pub(crate) ranking_rays: Option<usize>,
}

impl ChooseOptions {
    /// Predicted bytes of acceleration structures allowed over the input's; `None`: any.
    pub fn max_bytes_ratio(&self) -> Option<f64> {
        let of_auto = Some(AUTO_MAX_BYTES_RATIO).filter(|_| self.method == Choice::Auto);
        self.layout.instances.max_bytes_ratio.or(of_auto)
    }
}

/// Bytes of acceleration structures that `auto` allows over the input's where the user sets no limit.
const AUTO_MAX_BYTES_RATIO: f64 = 1.25;

/// The layout to write, and how it came about.
pub struct Chosen {
    /// The layout, ready to be written.
    pub layout: Layout,
    /// Trees of the groups that are written anew, as [`layout::order_for_good`] gives them.
    pub trees: Vec<Option<Arc<Tree>>>,
    /// How it was chosen.
    pub selection: Selection,
    /// What was done and left out.
    pub passes: Vec<Pass>,
    /// What to know about it.
    pub notes: Vec<Note>,
    /// Whether the input as it is may be written instead, if this one turns out not to be faster: it was chosen for its
    /// speed rather than asked for, and the input keeps to what is allowed.
    pub may_be_left_alone: bool,
    /// What the layout was chosen with: pins of instances that could not be written out within the position error allowed.
    pub overlay: Overlay,
    /// The allowed candidates that a device would time, if [`ChooseOptions::export`] asks for them.
    pub contenders: Vec<Contender>,
    bounds: Bounds,
}

impl Chosen {
    /// The input as it is instead, for a candidate that was not faster when it was measured again.
    pub fn left_alone(self, scene: &Scene) -> Chosen {
        let layout = methods::run(Method::Keep, scene, &methods::Options::default());
        let mut passes = self.passes;
        passes::left_alone(&mut passes);
        let mut selection = self.selection;
        let why = Why::NotFasterWhenVerified(selection.plan);
        selection.candidates[selection.chosen].outcome = Outcome::NotFasterWhenVerified;
        selection.candidates[0].outcome = Outcome::Chosen(why.clone());
        let plan = selection.candidates[0].plan;
        let selection = Selection { method: Method::Keep, plan, why, chosen: 0, ..selection };
        let pinned = scene.overlaid(&self.overlay);
        let origin = Origin::Chosen(Method::Keep);
        Chosen { layout, trees: Vec::new(), selection, passes, notes: Vec::new(), ..self }.with_notes(&pinned, origin)
    }

    /// Notes what of the layout is beyond what the user allows.
    fn with_notes(mut self, scene: &Scene, origin: Origin) -> Chosen {
        let notes = self.bounds.notes(scene, &self.layout, origin);
        self.notes.extend(notes);
        self
    }
}

/// Chooses a layout and readies it for writing. `trees` are known trees of the scene's meshes, `metrics` those of the input, which bound bytes,
/// and of the scene, in which meshes may stand in for copies.
pub fn choose(
    scene: &Scene,
    trees: &MeshTrees,
    metrics: [&Metrics; 2],
    machine: &Machine,
    options: &ChooseOptions,
    verify: &VerifyOptions,
) -> Chosen {
    let [input, before] = metrics;
    let bounds = Bounds::new(scene, input, options, verify);
    match options.method {
        Choice::Method(method) => asked_for(scene, method, options, verify, bounds),
        Choice::Auto => best(scene, &Choosing { trees, before, machine, options, verify }, bounds),
    }
}

/// Like [`choose`], but if `auto` has decided before, makes that layout again. `None` if it is none of its plans.
pub fn choose_or_replay(
    scene: &Scene,
    trees: &MeshTrees,
    metrics: [&Metrics; 2],
    machine: &Machine,
    options: &ChooseOptions,
    verify: &VerifyOptions,
) -> Option<Chosen> {
    let [input, before] = metrics;
    match (&options.decided, options.method) {
        (Some(decided), Choice::Auto) => {
            let choosing = Choosing { trees, before, machine, options, verify };
            replay::replay(scene, &choosing, Bounds::new(scene, input, options, verify), decided)
        }
        _ => Some(choose(scene, trees, metrics, machine, options, verify)),
    }
}

fn asked_for(scene: &Scene, method: Method, options: &ChooseOptions, verify: &VerifyOptions, bounds: Bounds) -> Chosen {
    let mut plan = Plan { id: method.into(), method, options: told(&options.layout, verify) };
    // Worth their time only to those who ask for the method.
    plan.options.overlap.series = true;
    let mut cache = Cache::serving([&plan.options]);
    let laid = lay_out(&mut cache, scene, &plan, verify.max_position_error_ratio);
    let pinned = scene.overlaid(&laid.overlay);
    let selection = Selection {
        requested: options.method,
        method,
        plan: plan.id,
        decided_by: DecidedBy::Request,
        why: Why::AskedFor,
        candidates: Vec::new(),
        chosen: 0,
    };
    let found = Found { selection, passes: Vec::new(), may_be_left_alone: false };
    let chosen = finish(&pinned, laid, &cache.into_trees(), found, bounds, verify);
    // What could not be written out where it is may still become a copy of one node.
    Chosen { overlay: Overlay::default(), ..chosen }.with_notes(&pinned, Origin::Asked(method))
}

/// What the methods are told, and how the consumer builds what they lay out.
fn told(options: &methods::Options, verify: &VerifyOptions) -> methods::Options {
    let one_geometry_per_group = verify.build.blas_per == BlasPer::Primitive;
    methods::Options { parts: PartOptions { one_geometry_per_group, ..options.parts }, ..options.clone() }
}

/// What choosing among candidates takes.
struct Choosing<'a> {
    /// Known trees of the scene's meshes.
    trees: &'a MeshTrees,
    /// The metrics of the scene as it is.
    before: &'a Metrics,
    machine: &'a Machine,
    options: &'a ChooseOptions,
    verify: &'a VerifyOptions,
}

/// The best candidate within the bounds.
fn best(scene: &Scene, choosing: &Choosing, bounds: Bounds) -> Chosen {
    let Choosing { options, verify, .. } = *choosing;
    let mut told = told(&options.layout, verify);
    told.instances.max_bytes_ratio = options.max_bytes_ratio();
    let plans = plans::plans(options.effort, &told);
    let (plans, mut passes) = passes::worth_a_try(scene, choosing.before, plans, options);
    let Evaluated { mut candidates, duplicates, placed } = choosing.evaluate(scene, &plans);
    let start = Instant::now();
    let contenders = decide::contenders(&candidates, options.effort);
    let exported = match options.export {
        true => elsewhere::contenders(scene, &candidates, &contenders, &placed, &bounds),
        false => Vec::new(),
    };
    let mut raced = choosing.race(scene, &mut candidates, &contenders, Timing::Full);
    if let Ok(count) = &mut raced {
        *count += choosing.refine(scene, &mut candidates, &bounds);
    }
    let measured = raced.as_ref().is_ok_and(|&count| count > 0);
    passes.push(passes::measuring(raced, start.elapsed().as_secs_f64()));
    let decision = choosing.decide(scene, &mut candidates, &bounds, measured);
    let results = results(&candidates, decision.outcomes, &duplicates, verify);
    let winner = candidates.swap_remove(decision.winner);
    passes::tell_used(&mut passes, scene, &winner.plan, &winner.laid.layout);
    let selection = Selection {
        requested: options.method,
        method: winner.plan.method,
        plan: winner.plan.id,
        decided_by: if measured { DecidedBy::Measurement } else { DecidedBy::Prediction },
        why: decision.why,
        candidates: results,
        chosen: decision.winner,
    };
    let pinned = scene.overlaid(&winner.laid.overlay);
    let origin = if decision.keeps { Origin::Chosen(winner.plan.method) } else { Origin::NoneKeeps };
    let found = Found { selection, passes, may_be_left_alone: decision.may_be_left_alone };
    let chosen = finish(&pinned, winner.laid, &placed, found, bounds, verify).with_notes(&pinned, origin);
    Chosen { contenders: exported, ..chosen }
}

/// What came of all candidates, and of the plans that come to another one only because rounding must not move vertices too
/// far. The input, which is the first, is its own measure if others were timed.
fn results(
    candidates: &[Candidate],
    outcomes: Vec<Outcome>,
    duplicates: &[Duplicate],
    verify: &VerifyOptions,
) -> Vec<CandidateResult> {
    let result = |(candidate, outcome): (&Candidate, _)| candidate.result(&verify.weights, outcome);
    let mut results: Vec<CandidateResult> = candidates.iter().zip(outcomes).map(result).collect();
    let timed = candidates.iter().find_map(|c| c.speed(&verify.weights));
    if let (Some(input), Some(timed)) = (results.first_mut(), timed) {
        let after_mrays_per_s = timed.before_mrays_per_s;
        input.measured = Some(Overall { after_mrays_per_s, speedup_ratio: 1.0, spread_ratio: 0.0, ..timed });
    }
    let of_duplicate = |duplicate: &Duplicate| {
        let same = &results[duplicate.same_as];
        let outcome = Outcome::HeldBack {
            same_as: same.plan,
            instances: duplicate.held_back,
            max_position_error_ratio: verify.max_position_error_ratio,
        };
        CandidateResult { plan: duplicate.plan, outcome, seconds: duplicate.seconds, ..same.clone() }
    };
    let more: Vec<CandidateResult> = duplicates.iter().filter(|d| d.held_back > 0).map(of_duplicate).collect();
    results.extend(more);
    results
}

impl Choosing<'_> {
    /// Lays out plans and predicts what rays of the kinds that count take in each layout.
    fn evaluate(&self, scene: &Scene, plans: &[Plan]) -> Evaluated {
        self.evaluator().evaluate(scene, plans)
    }

    fn evaluator(&self) -> Evaluator<'_> {
        let Choosing { trees, before, options, verify, .. } = *self;
        Evaluator {
            trees,
            two_level_cost: before.two_level_cost,
            rays_per_kind: options.ranking_rays.unwrap_or(options.effort.rays()),
            all_kinds: false,
            class: options.class,
            verify,
        }
    }

    /// Times the candidates chosen on the device, if there is one; gives their number, or why there are none.
    fn race(
        &self,
        scene: &Scene,
        candidates: &mut [Candidate],
        chosen: &[usize],
        care: Timing,
    ) -> Result<usize, NotTimed> {
        if chosen.is_empty() {
            return Err(NotTimed::NothingDiffers);
        }
        let scene_of = written(scene, chosen.iter().map(|&i| &candidates[i].laid).collect());
        let laps = self.machine.race(scene, chosen.len(), scene_of, care, self.verify);
        let weights = &self.verify.weights;
        let mut count = 0;
        for (&i, lap) in chosen.iter().zip(laps.ok_or(NotTimed::NoDevice)?.map_err(NotTimed::Failed)?) {
            match lap {
                Ok(lap) => {
                    let candidate = &mut candidates[i];
                    match care {
                        Timing::Brief => candidate.brief = Some(lap.views.overall(weights).sure_ratio()),
                        Timing::Full => candidate.lap = Some(lap),
                        Timing::Judging => candidate.judged = Some(lap.views.overall(weights)),
                    }
                    count += 1;
                }
                Err(why) => candidates[i].failure = Some(why),
            }
        }
        Ok(count)
    }

    /// Decides by the views that choose. A candidate that is faster in them but not in the views that judge, or too slow
    /// in one of those, gives way to the next one, and after [`MOST_JUDGED`] of them to the input.
    fn decide(&self, scene: &Scene, candidates: &mut [Candidate], bounds: &Bounds, measured: bool) -> Decision {
        loop {
            let decision = decide::decide(candidates, self.verify, bounds, measured);
            let is_to_judge = decision.needs_judging && candidates[decision.winner].judged.is_none();
            if !is_to_judge || self.race(scene, candidates, &[decision.winner], Timing::Judging).is_err() {
                return decision;
            }
            if candidates[decision.winner].judged.is_none() {
                return decision;
            }
        }
    }

    /// Times candidates near the fastest, round by round; gives their number.
    fn refine(&self, scene: &Scene, candidates: &mut Vec<Candidate>, bounds: &Bounds) -> usize {
        let weights = &self.verify.weights;
        // Software drivers take longer to try, and what they build depends less on axes.
        let is_gpu = self.machine.name().1 == MachineKind::Gpu;
        let mut count = 0;
        for round in refine::rounds(self.options.effort) {
            let mut near = match *round {
                Round::Axes { .. } if !is_gpu => refine::other_axes(candidates, weights, bounds, 1, 1),
                Round::Axes { of, ways } => refine::other_axes(candidates, weights, bounds, of, ways),
                Round::Entry(step) => match refine::other_entries(candidates, weights, bounds, step) {
                    plans if plans.is_empty() => Vec::new(),
                    plans => self.evaluate(scene, &plans).candidates,
                },
            };
            near.retain(|new| !candidates.iter().any(|known| known.laid.is_same(&new.laid)));
            let all: Vec<usize> = (0..near.len()).collect();
            let care = if matches!(round, Round::Axes { .. }) { Timing::Brief } else { Timing::Full };
            count += self.race(scene, &mut near, &all, care).unwrap_or(0);
            if care == Timing::Brief {
                let best = refine::worth_a_closer_look(&near);
                // None of them is less well known than before if that fails.
                let _ = self.race(scene, &mut near, &best, Timing::Full);
            }
            candidates.extend(near);
        }
        count
    }
}

/// How a layout was chosen, and what was done before it was.
struct Found {
    selection: Selection,
    passes: Vec<Pass>,
    may_be_left_alone: bool,
}

/// Puts the triangles of what is written in tree order.
fn finish(
    scene: &Scene,
    laid: Laid,
    placed: &PlacedTrees,
    found: Found,
    bounds: Bounds,
    verify: &VerifyOptions,
) -> Chosen {
    let Found { selection, mut passes, may_be_left_alone } = found;
    let held_back =
        Note::HeldBack { instances: laid.held_back, max_position_error_ratio: verify.max_position_error_ratio };
    let notes = if laid.held_back > 0 { vec![held_back] } else { Vec::new() };
    let mut layout = Arc::unwrap_or_clone(laid.layout);
    layout::turn_axes(&mut layout, laid.axes);
    passes.extend(laid.passes);
    let (pass, trees) = passes::order(scene, &mut layout, placed);
    passes.push(pass);
    let contenders = Vec::new();
    Chosen { layout, trees, selection, passes, notes, may_be_left_alone, overlay: laid.overlay, contenders, bounds }
}
