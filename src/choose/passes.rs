//! The passes of a bake: what was applied, what was skipped, and why.

use std::sync::Arc;
use std::time::Instant;

use glam::DMat3;

use super::ChooseOptions;
use super::plans::Plan;
use crate::cost::Metrics;
use crate::emit;
use crate::layout::{self, Content, Group, Layout, PlacedTrees};
use crate::methods::{self, Instances, Method, PlanId};
use crate::scene::{Opacity, Scene};
use crate::tree::Tree;

/// Triangles count as axis-aligned if the mean area of their boxes is less than this many times that of their tightest
/// boxes.
const LOOSE: f64 = 1.02;

/// A step of a bake that is applied or skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PassId {
    /// Meshes that are copies of others become instances of them.
    FindCopies,
    /// Overlapping objects are regrouped.
    ReduceOverlap,
    /// Instances of shared meshes are opened or written out.
    ChooseInstances,
    /// Groups are stored in frames of their own.
    Frames,
    /// Objects that enclose the rest or lie far outside get groups of their own.
    Isolate,
    /// Triangles that are not opaque get groups of their own.
    SplitOpacity,
    /// Candidates are timed on a device.
    Measure,
    /// The method regroups.
    Regroup,
    /// Vertices of groups are stored relative to the groups' centres.
    CentreFrames,
    /// Triangles are put in tree order.
    Order,
    /// Instances are written as copies of one node.
    InstancingExtension,
    /// Empty nodes are dropped.
    Prune,
}

impl PassId {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            PassId::FindCopies => "find copies",
            PassId::ReduceOverlap => "reduce overlap",
            PassId::ChooseInstances => "open or bake instances",
            PassId::Frames => "frames",
            PassId::Isolate => "isolate",
            PassId::SplitOpacity => "split opacity",
            PassId::Measure => "measure candidates",
            PassId::Regroup => "regroup",
            PassId::CentreFrames => "centre frames",
            PassId::Order => "order by tree",
            PassId::InstancingExtension => "instancing extension",
            PassId::Prune => "prune",
        }
    }
}

/// A step that was applied or skipped.
#[derive(Clone, Debug, PartialEq)]
pub struct Pass {
    /// Which step.
    pub id: PassId,
    /// Whether it changed anything.
    pub applied: bool,
    /// Why.
    pub reason: Reason,
    /// What happened to it afterwards.
    pub buts: Vec<But>,
    /// Duration in seconds.
    pub seconds: f64,
}

/// Why a step was applied or skipped.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// Fewer than two instances may be restructured.
    FewFreeInstances,
    /// No two instance boxes overlap.
    NoOverlap,
    /// No two instance boxes of the scene's core overlap, but objects outside it overlap others.
    OnlyApartOverlap,
    /// Instance boxes of the scene's core overlap.
    Overlap,
    /// No mesh is placed twice by instances that may be restructured.
    NoSharedMesh,
    /// Instances of shared meshes overlap others.
    SharedOverlap,
    /// The boxes of triangles are this many times as large as necessary.
    Loose(f64),
    /// All triangles are axis-aligned.
    AlongAxes,
    /// Some objects enclose the rest or lie far outside.
    SomeApart,
    /// No object encloses the rest or lies far outside.
    NoneApart,
    /// Some triangles are opaque and some are not.
    OpacitiesMeet,
    /// All materials are opaque.
    AllOpaque,
    /// Some triangles are opaque and some are not, but no two of them may be regrouped.
    OpacitiesDoNotMeet,
    /// The user forbids it.
    Forbidden,
    /// This many candidates were timed.
    Timed(usize),
    /// No candidate was timed.
    NotTimed(NotTimed),
    /// Rewritten groups are put in tree order.
    Ordered,
    /// No group is rewritten.
    NothingToOrder,
    /// The layout differs from the input's.
    Regrouped,
    /// The layout is the input's.
    NotRegrouped,
    /// This many groups are stored relative to their centres to keep rounding within the limit.
    Centred(usize),
    /// The unchanged input is written after all.
    InputLeftAlone,
}

/// Why no candidate was timed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotTimed {
    /// No candidate differs from the input.
    NothingDiffers,
    /// No device traces rays.
    NoDevice,
    /// The device could not build or trace any candidate.
    NoneTaken,
    /// The device failed, for this reason.
    Failed(String),
}

/// What happened to a step after it was judged worth trying or not.
#[derive(Clone, Debug, PartialEq)]
pub enum But {
    /// No plan tries it.
    NotTried,
    /// It was tried, but the chosen layout does not use it.
    ChosenWithout,
    /// The chosen plan uses it nevertheless.
    ChosenWith(PlanId),
}

impl Pass {
    /// A step that began at `start` and ends now.
    pub(super) fn since(start: Instant, id: PassId, applied: bool, reason: Reason) -> Pass {
        Pass { id, applied, reason, buts: Vec::new(), seconds: start.elapsed().as_secs_f64() }
    }
}

/// A step that a plan may try.
struct Trial {
    pass: PassId,
    /// Whether a plan tries it.
    is_in: fn(&Plan) -> bool,
    /// Whether the layout that a plan produced shows it.
    shows: fn(&Scene, &Plan, &Layout) -> bool,
}

const TRIALS: [Trial; 5] = [
    Trial {
        pass: PassId::ReduceOverlap,
        is_in: |plan| plan.method == Method::Overlap,
        shows: |_, plan, _| plan.method == Method::Overlap,
    },
    Trial {
        pass: PassId::ChooseInstances,
        is_in: |plan| !matches!(plan.method, Method::Keep | Method::PerObject),
        shows: |scene, _, layout| replaces_shared(scene, layout),
    },
    Trial {
        pass: PassId::Frames,
        is_in: |plan| is_turnable(plan) && plan.options.instances.frames,
        shows: |_, plan, layout| plan.options.instances.frames && layout.groups.iter().any(is_turned),
    },
    Trial {
        pass: PassId::Isolate,
        is_in: |plan| sets_apart(plan) && plan.options.parts.isolate,
        shows: |_, plan, _| sets_apart(plan) && plan.options.parts.isolate,
    },
    Trial {
        pass: PassId::SplitOpacity,
        is_in: |plan| sets_apart(plan) && plan.options.parts.split_opacity,
        shows: |_, plan, _| sets_apart(plan) && plan.options.parts.split_opacity,
    },
];

fn sets_apart(plan: &Plan) -> bool {
    matches!(plan.method, Method::Single | Method::Cluster)
}

/// Whether the plan's groups may have frames of their own.
fn is_turnable(plan: &Plan) -> bool {
    plan.method == Method::Cluster || plan.options.single.turned
}

fn is_turned(group: &Group) -> bool {
    match &group.content {
        Content::Kept(_) => false,
        Content::Piece { frame, .. } | Content::Baked { frame, .. } => frame.matrix3 != DMat3::IDENTITY,
    }
}

/// Whether a mesh with several instances is opened or written out.
fn replaces_shared(scene: &Scene, layout: &Layout) -> bool {
    let mut uses = vec![0u32; scene.meshes.len()];
    scene.instances.iter().for_each(|i| uses[i.mesh.0 as usize] += 1);
    let mut kept = vec![0u32; scene.meshes.len()];
    for placement in &layout.placements {
        if let Content::Kept(mesh) = layout.groups[placement.group as usize].content {
            kept[mesh.0 as usize] += 1;
        }
    }
    uses.iter().zip(kept).any(|(&uses, kept)| uses > 1 && kept < uses)
}

/// Selects the plans that may change something, and states why the others are skipped. A pass is applied if at least
/// one plan tries it.
pub(super) fn worth_a_try(
    scene: &Scene,
    before: &Metrics,
    plans: Vec<Plan>,
    options: &ChooseOptions,
) -> (Vec<Plan>, Vec<Pass>) {
    let forbidden = options.forbidden;
    let (separate, instances) = (separate(scene, before), choose_instances(scene, before));
    let instances = unless(instances, forbidden.choose_instances);
    let frames = unless(frames(scene), !options.layout.instances.frames);
    let isolate = unless(isolate(scene), forbidden.isolate);
    let opacity = unless(split_opacity(scene), forbidden.split_opacity);
    let mut tried: Vec<Plan> = Vec::new();
    for mut plan in plans.into_iter().filter(|plan| plan.method != Method::Overlap || separate.applied) {
        plan.options.instances.frames &= frames.applied;
        plan.options.parts.isolate &= isolate.applied;
        plan.options.parts.split_opacity &= opacity.applied;
        if !instances.applied {
            let instances = &mut plan.options.instances;
            (instances.shared, instances.pieces) = (Instances::BakeOrKeep, None);
        }
        if !tried.iter().any(|other| other.method == plan.method && other.options == plan.options) {
            tried.push(plan);
        }
    }
    let mut passes = vec![separate, instances, frames, isolate, opacity];
    for (pass, trial) in with_trials(&mut passes) {
        if pass.applied && !tried.iter().any(trial.is_in) {
            pass.applied = false;
            pass.buts.push(But::NotTried);
        }
    }
    (tried, passes)
}

/// Records for each tried pass whether the chosen layout uses it.
pub(super) fn tell_used(passes: &mut [Pass], scene: &Scene, plan: &Plan, layout: &Layout) {
    for (pass, trial) in with_trials(passes) {
        let shows = (trial.shows)(scene, plan, layout);
        if pass.applied && !shows {
            pass.buts.push(But::ChosenWithout);
        } else if !pass.applied && shows {
            pass.buts.push(But::ChosenWith(plan.id));
        }
        pass.applied = shows;
    }
}

/// Marks the layout passes as not applied, because the unchanged input is written.
pub(super) fn left_alone(passes: &mut [Pass]) {
    for pass in passes.iter_mut().filter(|pass| pass.applied && pass.id != PassId::Measure) {
        (pass.applied, pass.reason, pass.buts) = (false, Reason::InputLeftAlone, Vec::new());
    }
}

/// The passes that plans may try.
fn with_trials(passes: &mut [Pass]) -> impl Iterator<Item = (&mut Pass, &'static Trial)> {
    passes.iter_mut().filter_map(|pass| {
        let trial = TRIALS.iter().find(|trial| trial.pass == pass.id)?;
        Some((pass, trial))
    })
}

/// Returns the pass, skipped if the user forbids it.
fn unless(pass: Pass, forbidden: bool) -> Pass {
    match forbidden {
        true => Pass { applied: false, reason: Reason::Forbidden, ..pass },
        false => pass,
    }
}

/// Returns why nothing needs to be done against overlap; `None` if instance boxes of the core overlap.
fn lack_of_overlap(before: &Metrics) -> Option<Reason> {
    if before.core_overlap_ratio > 0.0 {
        return None;
    }
    Some(if before.overlap_ratio > 0.0 { Reason::OnlyApartOverlap } else { Reason::NoOverlap })
}

fn separate(scene: &Scene, before: &Metrics) -> Pass {
    let start = Instant::now();
    let free = scene.instances.iter().filter(|i| i.pinned.is_none()).count();
    let reason = match (free, lack_of_overlap(before)) {
        (0 | 1, _) => Reason::FewFreeInstances,
        (_, Some(lack)) => lack,
        (_, None) => Reason::Overlap,
    };
    Pass::since(start, PassId::ReduceOverlap, reason == Reason::Overlap, reason)
}

fn choose_instances(scene: &Scene, before: &Metrics) -> Pass {
    let start = Instant::now();
    let mut free = vec![0u32; scene.meshes.len()];
    scene.instances.iter().filter(|i| i.pinned.is_none()).for_each(|i| free[i.mesh.0 as usize] += 1);
    let shared = free.iter().any(|&count| count > 1);
    let reason = match (shared, lack_of_overlap(before)) {
        (false, _) => Reason::NoSharedMesh,
        (true, Some(lack)) => lack,
        (true, None) => Reason::SharedOverlap,
    };
    Pass::since(start, PassId::ChooseInstances, reason == Reason::SharedOverlap, reason)
}

fn frames(scene: &Scene) -> Pass {
    let start = Instant::now();
    let looseness = methods::looseness(scene);
    let reason = if looseness > LOOSE { Reason::Loose(looseness) } else { Reason::AlongAxes };
    Pass::since(start, PassId::Frames, looseness > LOOSE, reason)
}

fn isolate(scene: &Scene) -> Pass {
    let start = Instant::now();
    let isolates = methods::isolates(scene);
    let reason = if isolates { Reason::SomeApart } else { Reason::NoneApart };
    Pass::since(start, PassId::Isolate, isolates, reason)
}

fn split_opacity(scene: &Scene) -> Pass {
    let start = Instant::now();
    let differ = methods::opacities_differ(scene);
    let opaque = || scene.meshes.iter().flat_map(|m| &m.geometries).all(|g| g.opacity == Opacity::Opaque);
    let reason = match differ {
        true => Reason::OpacitiesMeet,
        false if opaque() => Reason::AllOpaque,
        false => Reason::OpacitiesDoNotMeet,
    };
    Pass::since(start, PassId::SplitOpacity, differ, reason)
}

/// The pass that times candidates on a device, with their number and the duration.
pub(super) fn measuring(raced: Result<usize, NotTimed>, seconds: f64) -> Pass {
    let (applied, reason) = match raced {
        Ok(0) => (false, Reason::NotTimed(NotTimed::NoneTaken)),
        Ok(count) => (true, Reason::Timed(count)),
        Err(why) => (false, Reason::NotTimed(why)),
    };
    Pass { id: PassId::Measure, applied, reason, buts: Vec::new(), seconds }
}

/// Puts the triangles of rewritten groups in tree order; returns their trees like [`layout::order_for_good`].
pub(super) fn order(scene: &Scene, layout: &mut Layout, known: &PlacedTrees) -> (Pass, Vec<Option<Arc<Tree>>>) {
    let start = Instant::now();
    let regrouped = !emit::is_unchanged(layout);
    let trees = if regrouped { layout::order_for_good(scene, layout, known) } else { Vec::new() };
    let reason = if regrouped { Reason::Ordered } else { Reason::NothingToOrder };
    (Pass::since(start, PassId::Order, regrouped, reason), trees)
}
