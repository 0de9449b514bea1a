//! Which layout to write.

use std::time::Instant;

use super::BakeOptions;
use crate::cost::{self, Metrics};
use crate::emit;
use crate::layout::{self, Layout, Method};
use crate::report::{Candidate, MethodReport, Pass};
use crate::scene::{Pinned, Scene};

/// How the layout is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The method with the least predicted cost; the input as it is among them.
    #[default]
    Auto,
    /// One method.
    Method(Method),
}

impl Choice {
    fn name(self) -> &'static str {
        match self {
            Choice::Auto => "auto",
            Choice::Method(method) => method.name(),
        }
    }
}

/// Bytes of acceleration structures that `auto` allows over the input's where the user sets no limit.
const AUTO_MAX_BYTES_RATIO: f64 = 1.25;

/// A candidate must cost less than this share of the input to be worth a change.
const WORTH_A_CHANGE: f64 = 0.99;

/// The layout to write, and how it came about.
pub(super) struct Chosen {
    pub(super) layout: Layout,
    pub(super) report: MethodReport,
    pub(super) passes: Vec<Pass>,
}

/// Chooses a layout and readies it for writing. Instances that could not be written out within the position error
/// allowed become pinned.
pub(super) fn choose(scene: &mut Scene, before: &Metrics, options: &BakeOptions) -> Chosen {
    let (method, candidates, reason) = match options.method {
        Choice::Method(method) => (method, Vec::new(), "asked for".to_owned()),
        Choice::Auto => cheapest(scene, before, &auto_options(options)),
    };
    let layout_options = match options.method {
        Choice::Auto => auto_options(options),
        Choice::Method(_) => options.layout.clone(),
    };
    let (layout, passes) = lay_out(scene, method, &layout_options, options.verify.max_position_error_ratio);
    let report = MethodReport { requested: options.method.name(), chosen: method.name(), reason, candidates };
    Chosen { layout, report, passes }
}

fn auto_options(options: &BakeOptions) -> layout::Options {
    let max_bytes_ratio = options.layout.max_bytes_ratio.or(Some(AUTO_MAX_BYTES_RATIO));
    layout::Options { max_bytes_ratio, ..options.layout.clone() }
}

/// The method of least predicted cost, all candidates, and the reason.
fn cheapest(scene: &Scene, before: &Metrics, options: &layout::Options) -> (Method, Vec<Candidate>, String) {
    let candidates: Vec<(Method, Candidate)> = Method::ALL
        .into_iter()
        .map(|method| {
            let start = Instant::now();
            let layout = layout::run(method, scene, options);
            let metrics = if emit::is_unchanged(&layout) { before.clone() } else { cost::measure(scene, &layout) };
            (method, Candidate::new(method.name(), &metrics, start.elapsed().as_secs_f64()))
        })
        .collect();
    let worth = |c: &Candidate| c.predicted_cost < WORTH_A_CHANGE * before.two_level_cost;
    let best = candidates
        .iter()
        .filter(|(method, c)| *method == Method::Keep || worth(c))
        .min_by(|a, b| a.1.predicted_cost.total_cmp(&b.1.predicted_cost));
    let (method, cost) = best.map_or((Method::Keep, before.two_level_cost), |(m, c)| (*m, c.predicted_cost));
    let reason = match method {
        Method::Keep => "no method is predicted to cost less than the input as it is".to_owned(),
        _ => format!("least predicted cost: {cost:.2} against {:.2} of the input", before.two_level_cost),
    };
    (method, candidates.into_iter().map(|(_, c)| c).collect(), reason)
}

/// Runs a method, keeps its rounding within the limit and puts its triangles in tree order.
fn lay_out(scene: &mut Scene, method: Method, options: &layout::Options, max_error_ratio: f64) -> (Layout, Vec<Pass>) {
    let start = Instant::now();
    let mut layout = layout::run(method, scene, options);
    let regrouped = !emit::is_unchanged(&layout);
    let reason = if regrouped { "the layout differs from the input's" } else { "the layout is the input's" };
    let mut passes = vec![pass("regroup", regrouped, reason, start)];

    let start = Instant::now();
    let mut settled = emit::settle(scene, &mut layout, max_error_ratio);
    let mut refused = 0;
    while !settled.refused.is_empty() {
        refused += settled.refused.len();
        scene.pin(&settled.refused, Pinned::Precision);
        layout = layout::run(method, scene, options);
        settled = emit::settle(scene, &mut layout, max_error_ratio);
    }
    if refused > 0 {
        layout.notes.push(format!(
            "{refused} instances stay as they are: written out, their vertices would move farther than allowed"
        ));
    }
    let reason = match settled.centred {
        0 => "rounding stays within the limit in world coordinates".to_owned(),
        n => format!("{n} groups are stored around their centre so that rounding stays within the limit"),
    };
    passes.push(pass("centre frames", settled.centred > 0, &reason, start));

    let start = Instant::now();
    if regrouped {
        layout::order_by_tree(scene, &mut layout);
    }
    let reason = if regrouped { "rewritten groups are put in tree order" } else { "no group is rewritten" };
    passes.push(pass("order by tree", regrouped, reason, start));
    (layout, passes)
}

fn pass(name: &'static str, applied: bool, reason: &str, start: Instant) -> Pass {
    Pass { name, applied, reason: reason.to_owned(), seconds: start.elapsed().as_secs_f64() }
}
