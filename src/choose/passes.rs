//! What is done and what is left out, with the reasons.

use std::sync::Arc;
use std::time::Instant;

use glam::DMat3;

use super::ChooseOptions;
use super::plans::Plan;
use crate::cost::Metrics;
use crate::emit;
use crate::layout::{self, Content, Group, Layout, PlacedTrees};
use crate::methods::{self, Instances, Method};
use crate::report::Pass;
use crate::scene::{Opacity, Scene};
use crate::tree::Tree;
use crate::words::counted;

/// Triangles whose boxes have on average less than this many times the area of the tightest lie along the axes.
const LOOSE: f64 = 1.02;

/// The pass that times candidates, by name.
pub(super) const MEASURING: &str = "measure candidates";

/// Something that a plan may try, by the name of its pass.
struct Trial {
    pass: &'static str,
    /// Whether a plan tries it.
    is_in: fn(&Plan) -> bool,
    /// Whether a layout that a plan came to has it.
    shows: fn(&Scene, &Plan, &Layout) -> bool,
}

const REDUCE_OVERLAP: &str = "reduce overlap";
const CHOOSE_INSTANCES: &str = "open or bake instances";
const FRAMES: &str = "frames";
const ISOLATE: &str = "isolate";
const SPLIT_OPACITY: &str = "split opacity";

const TRIALS: [Trial; 5] = [
    Trial {
        pass: REDUCE_OVERLAP,
        is_in: |plan| plan.method == Method::Overlap,
        shows: |_, plan, _| plan.method == Method::Overlap,
    },
    Trial {
        pass: CHOOSE_INSTANCES,
        is_in: |plan| !matches!(plan.method, Method::Keep | Method::PerObject),
        shows: |scene, _, layout| replaces_shared(scene, layout),
    },
    Trial {
        pass: FRAMES,
        is_in: |plan| is_turnable(plan) && plan.options.instances.frames,
        shows: |_, plan, layout| plan.options.instances.frames && layout.groups.iter().any(is_turned),
    },
    Trial {
        pass: ISOLATE,
        is_in: |plan| sets_apart(plan) && plan.options.parts.isolate,
        shows: |_, plan, _| sets_apart(plan) && plan.options.parts.isolate,
    },
    Trial {
        pass: SPLIT_OPACITY,
        is_in: |plan| sets_apart(plan) && plan.options.parts.split_opacity,
        shows: |_, plan, _| sets_apart(plan) && plan.options.parts.split_opacity,
    },
];

fn sets_apart(plan: &Plan) -> bool {
    matches!(plan.method, Method::Single | Method::Cluster)
}

/// Whether its groups may have frames of their own.
fn is_turnable(plan: &Plan) -> bool {
    plan.method == Method::Cluster || plan.options.single.turned
}

fn is_turned(group: &Group) -> bool {
    match &group.content {
        Content::Kept(_) => false,
        Content::Piece { frame, .. } | Content::Baked { frame, .. } => frame.matrix3 != DMat3::IDENTITY,
    }
}

/// Whether a mesh that several instances place is opened or written out.
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

/// The plans that may change something, and why others are left out. A pass is applied as far as a plan tries it.
pub(super) fn worth_a_try(
    scene: &Scene,
    before: &Metrics,
    plans: Vec<Plan>,
    options: &ChooseOptions,
) -> (Vec<Plan>, Vec<Pass>) {
    let overlap = before.overlap_ratio > 0.0;
    let forbidden = options.forbidden;
    let (separate, instances) = (separate(scene, overlap), choose_instances(scene, overlap));
    let instances = unless(instances, forbidden.choose_instances, "--instances bake-or-keep");
    let frames = unless(frames(scene), !options.layout.instances.frames, "--frames false");
    let isolate = unless(isolate(scene), forbidden.isolate, "--isolate false");
    let opacity = unless(split_opacity(scene), forbidden.split_opacity, "--split-opacity false");
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
            pass.reason = format!("{}, but no candidate of this effort or within these bounds tries it", pass.reason);
        }
    }
    (tried, passes)
}

/// Says of the passes whether what was chosen shows what was tried.
pub(super) fn tell_used(passes: &mut [Pass], scene: &Scene, plan: &Plan, layout: &Layout) {
    for (pass, trial) in with_trials(passes) {
        let shows = (trial.shows)(scene, plan, layout);
        if pass.applied && !shows {
            pass.reason = format!("{}; tried, but what was chosen does without", pass.reason);
        } else if !pass.applied && shows {
            pass.reason = format!("{}, but `{}` does it", pass.reason, plan.id);
        }
        pass.applied = shows;
    }
}

/// The passes that are trials.
fn with_trials(passes: &mut [Pass]) -> impl Iterator<Item = (&mut Pass, &'static Trial)> {
    passes.iter_mut().filter_map(|pass| {
        let trial = TRIALS.iter().find(|trial| trial.pass == pass.name)?;
        Some((pass, trial))
    })
}

/// A pass, left out where the user forbids it.
fn unless(pass: Pass, forbidden: bool, by: &str) -> Pass {
    match forbidden {
        true => Pass { applied: false, reason: format!("{by} forbids it"), ..pass },
        false => pass,
    }
}

fn separate(scene: &Scene, overlap: bool) -> Pass {
    let start = Instant::now();
    let free = scene.instances.iter().filter(|i| i.pinned.is_none()).count();
    let reason = match (free, overlap) {
        (0 | 1, _) => "fewer than two instances may be restructured",
        (_, false) => "no two instance boxes overlap",
        _ => "instance boxes overlap",
    };
    pass(REDUCE_OVERLAP, free > 1 && overlap, reason, start)
}

fn choose_instances(scene: &Scene, overlap: bool) -> Pass {
    let start = Instant::now();
    let mut free = vec![0u32; scene.meshes.len()];
    scene.instances.iter().filter(|i| i.pinned.is_none()).for_each(|i| free[i.mesh.0 as usize] += 1);
    let shared = free.iter().any(|&count| count > 1);
    let reason = match (shared, overlap) {
        (false, _) => "no mesh is placed twice by instances that may be restructured",
        (_, false) => "no two instance boxes overlap",
        _ => "instances of shared meshes overlap others",
    };
    pass(CHOOSE_INSTANCES, shared && overlap, reason, start)
}

fn frames(scene: &Scene) -> Pass {
    let start = Instant::now();
    let looseness = methods::looseness(scene);
    let reason = match looseness > LOOSE {
        true => format!("the boxes of triangles are {looseness:.2} times as large as they need be"),
        false => "all triangles lie along the axes".to_owned(),
    };
    pass(FRAMES, looseness > LOOSE, &reason, start)
}

fn isolate(scene: &Scene) -> Pass {
    let start = Instant::now();
    let isolates = methods::isolates(scene);
    let reason = match isolates {
        true => "some objects enclose the rest or lie far outside",
        false => "no object encloses the scene and none lies far outside",
    };
    pass(ISOLATE, isolates, reason, start)
}

fn split_opacity(scene: &Scene) -> Pass {
    let start = Instant::now();
    let differ = methods::opacities_differ(scene);
    let opaque = || scene.meshes.iter().flat_map(|m| &m.geometries).all(|g| g.opacity == Opacity::Opaque);
    let reason = match differ {
        true => "some triangles are opaque and some are not",
        false if opaque() => "all materials are opaque",
        false => "opaque triangles and others that may be regrouped do not meet",
    };
    pass(SPLIT_OPACITY, differ, reason, start)
}

/// The pass that times candidates on a device.
pub(super) fn measuring(raced: &Result<usize, String>, seconds: f64) -> Pass {
    let (applied, reason) = match raced {
        Ok(0) => (false, "the device could take no candidate: the model decides".to_owned()),
        Ok(1) => (true, "1 candidate was timed in turns with the input".to_owned()),
        Ok(n) => (true, format!("{} were timed in turns with the input", counted(*n, "candidate"))),
        Err(why) => (false, why.clone()),
    };
    Pass { name: MEASURING, applied, reason, seconds }
}

/// Puts the triangles of rewritten groups in tree order; gives their trees, as [`layout::order_for_good`] does.
pub(super) fn order(scene: &Scene, layout: &mut Layout, known: &PlacedTrees) -> (Pass, Vec<Option<Arc<Tree>>>) {
    let start = Instant::now();
    let regrouped = !emit::is_unchanged(layout);
    let trees = if regrouped { layout::order_for_good(scene, layout, known) } else { Vec::new() };
    let reason = if regrouped { "rewritten groups are put in tree order" } else { "no group is rewritten" };
    (pass("order by tree", regrouped, reason, start), trees)
}

pub(super) fn pass(name: &'static str, applied: bool, reason: &str, start: Instant) -> Pass {
    Pass { name, applied, reason: reason.to_owned(), seconds: start.elapsed().as_secs_f64() }
}
