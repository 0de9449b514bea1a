//! What is done and what is left out, with the reasons.

use std::time::Instant;

use super::plans::Plan;
use crate::cost::Metrics;
use crate::emit;
use crate::layout::{self, Layout, Method};
use crate::report::Pass;
use crate::scene::Scene;

/// Triangles whose boxes have on average less than this many times the area of the tightest lie along the axes.
const LOOSE: f64 = 1.02;

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
    let start = Instant::now();
    let looseness = layout::looseness(scene);
    let reason = match looseness > LOOSE {
        true => format!("the boxes of triangles are {looseness:.2} times as large as they need be"),
        false => "all triangles lie along the axes".to_owned(),
    };
    let frames = pass("frames", looseness > LOOSE, &reason, start);
    let mut tried = plans;
    tried.retain(|plan| plan.method != Method::Overlap || separate.applied);
    tried.iter_mut().for_each(|plan| plan.options.frames &= frames.applied);
    (tried, vec![separate, frames])
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

/// Puts the triangles of rewritten groups in tree order.
pub(super) fn order(scene: &Scene, layout: &mut Layout) -> Pass {
    let start = Instant::now();
    let regrouped = !emit::is_unchanged(layout);
    if regrouped {
        layout::order_by_tree(scene, layout);
    }
    let reason = if regrouped { "rewritten groups are put in tree order" } else { "no group is rewritten" };
    pass("order by tree", regrouped, reason, start)
}

pub(super) fn pass(name: &'static str, applied: bool, reason: &str, start: Instant) -> Pass {
    Pass { name, applied, reason: reason.to_owned(), seconds: start.elapsed().as_secs_f64() }
}
