//! What is done and what is left out, with the reasons.

use std::sync::Arc;
use std::time::Instant;

use super::plans::Plan;
use crate::cost::Metrics;
use crate::cost::tree::Tree;
use crate::emit;
use crate::layout::{self, Instances, Layout, Method, PlacedTrees};
use crate::report::Pass;
use crate::scene::{Opacity, Scene};

/// Triangles whose boxes have on average less than this many times the area of the tightest lie along the axes.
const LOOSE: f64 = 1.02;

/// The passes that a layout takes part in, by name.
pub(super) const OF_LAYOUT: [&str; 3] = ["regroup", "centre frames", "order by tree"];

/// The plans that may change something, and why others are left out.
pub(super) fn worth_a_try(scene: &Scene, before: &Metrics, plans: Vec<Plan>) -> (Vec<Plan>, Vec<Pass>) {
    let start = Instant::now();
    let free = scene.instances.iter().filter(|i| i.pinned.is_none()).count();
    let overlap = before.overlap_ratio > 0.0;
    let separate = pass(
        "reduce overlap",
        free > 1 && overlap,
        match (free, overlap) {
            (0 | 1, _) => "fewer than two instances may be restructured",
            (_, false) => "no two instance boxes overlap",
            _ => "instance boxes overlap",
        },
        start,
    );
    let instances = choose_instances(scene, overlap);
    let (frames, isolate, opacity) = (frames(scene), isolate(scene), split_opacity(scene));
    let mut tried: Vec<Plan> = Vec::new();
    for mut plan in plans.into_iter().filter(|plan| plan.method != Method::Overlap || separate.applied) {
        plan.options.frames &= frames.applied;
        plan.options.isolate &= isolate.applied;
        plan.options.split_opacity &= opacity.applied;
        if !instances.applied {
            (plan.options.instances, plan.options.pieces) = (Instances::BakeOrKeep, None);
        }
        if !tried.iter().any(|other| other.method == plan.method && other.options == plan.options) {
            tried.push(plan);
        }
    }
    (tried, vec![separate, instances, frames, isolate, opacity])
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
    pass("open or bake instances", shared && overlap, reason, start)
}

fn frames(scene: &Scene) -> Pass {
    let start = Instant::now();
    let looseness = layout::looseness(scene);
    let reason = match looseness > LOOSE {
        true => format!("the boxes of triangles are {looseness:.2} times as large as they need be"),
        false => "all triangles lie along the axes".to_owned(),
    };
    pass("frames", looseness > LOOSE, &reason, start)
}

fn isolate(scene: &Scene) -> Pass {
    let start = Instant::now();
    let isolates = layout::isolates(scene);
    let reason = match isolates {
        true => "some objects enclose the rest or lie far outside",
        false => "no object encloses the scene and none lies far outside",
    };
    pass("isolate", isolates, reason, start)
}

fn split_opacity(scene: &Scene) -> Pass {
    let start = Instant::now();
    let differ = layout::opacities_differ(scene);
    let opaque = || scene.meshes.iter().flat_map(|m| &m.geometries).all(|g| g.opacity == Opacity::Opaque);
    let reason = match differ {
        true => "some triangles are opaque and some are not",
        false if opaque() => "all materials are opaque",
        false => "opaque triangles and others that may be regrouped do not meet",
    };
    pass("split opacity", differ, reason, start)
}

/// The pass that times candidates on a device.
pub(super) fn measuring(raced: &Result<usize, String>, seconds: f64) -> Pass {
    let (applied, reason) = match raced {
        Ok(0) => (false, "the device could take no candidate: the model decides".to_owned()),
        Ok(n) => (true, format!("{n} candidates were timed in turns with the input")),
        Err(why) => (false, why.clone()),
    };
    Pass { name: "measure candidates", applied, reason, seconds }
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
