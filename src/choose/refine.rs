//! Candidates near the best measured one.
//!
//! The cost of a layout on a device varies by a few per cent with every few groups, and no model predicts where.
//! Therefore the neighbourhood of the best layout is measured too: first the same plan with a slightly lower and a
//! slightly higher entry cost, in shrinking steps (a pattern search: R. Hooke, T. A. Jeeves, "Direct Search" Solution
//! of Numerical and Statistical Problems, Journal of the ACM 8(2), 1961), then the same layout stored along other axes,
//! which changes only what the driver builds from it.

use super::bounds::Bounds;
use super::candidate::{Candidate, Laid};
use super::plans::{Effort, Plan};
use super::replay::refined;
use crate::layout::WAYS;
use crate::methods::Method;
use crate::verify::weights::Weights;

/// What to try next.
#[derive(Clone, Copy, Debug)]
pub(super) enum Round {
    /// Divide and multiply the fastest candidate's entry cost by this factor.
    Entry(f64),
    /// Store the fastest `of` candidates in `ways` other axis orientations.
    Axes { of: usize, ways: usize },
}

/// Candidates below this share of the fastest speed are not stored along other axes.
const NEAR_FASTEST: f64 = 0.95;

/// Number of briefly timed candidates that are timed again.
const LOOKED_AT_CLOSELY: usize = 4;

/// Step through the axis orientations, coprime to their number, so that the first few differ much.
const STRIDE: usize = 7;

/// The rounds, in order.
pub(super) fn rounds(effort: Effort) -> &'static [Round] {
    use Round::{Axes, Entry};
    match effort.level() {
        ..3 => &[],
        3 => &[Axes { of: 3, ways: 8 }],
        4 => &[Axes { of: 3, ways: 11 }],
        5 => &[Entry(1.3), Entry(1.15), Axes { of: 3, ways: 23 }],
        _ => &[Entry(1.3), Entry(1.15), Entry(1.07), Entry(1.5), Axes { of: 5, ways: 23 }],
    }
}

/// The timed candidates that are allowed, fastest first by the speedup that is sure.
fn fastest<'c>(candidates: &'c [Candidate], weights: &Weights, bounds: &Bounds) -> Vec<(f64, &'c Candidate)> {
    let speed = |c: &'c Candidate| Some((c.speed(weights)?.sure_ratio(), c));
    let allowed = bounds.allow(candidates).into_iter();
    let mut timed: Vec<_> = candidates.iter().zip(allowed).filter(|c| c.1).filter_map(|c| speed(c.0)).collect();
    timed.sort_by(|a, b| b.0.total_cmp(&a.0));
    timed
}

/// The neighbours of the fastest candidate so far; none if it has no entry cost to change.
pub(super) fn other_entries(candidates: &[Candidate], weights: &Weights, bounds: &Bounds, step: f64) -> Vec<Plan> {
    let fastest = fastest(candidates, weights, bounds);
    fastest.first().map_or_else(Vec::new, |(_, best)| neighbours(&best.plan, step))
}

fn neighbours(plan: &Plan, step: f64) -> Vec<Plan> {
    if plan.method != Method::Cluster {
        return Vec::new();
    }
    let near = |factor: f64| refined(plan.clone(), plan.options.instances.entry_cost * factor);
    [1.0 / step, step].map(near).to_vec()
}

/// The fastest candidates so far along other axes, unless clearly slower than the fastest or the input.
pub(super) fn other_axes(
    candidates: &[Candidate],
    weights: &Weights,
    bounds: &Bounds,
    of: usize,
    ways: usize,
) -> Vec<Candidate> {
    let fastest = fastest(candidates, weights, bounds);
    let least = NEAR_FASTEST * fastest.first().map_or(1.0, |(speed, _)| speed.max(1.0));
    let near = fastest.into_iter().take(of).filter(|(speed, _)| *speed >= least);
    near.flat_map(|(_, candidate)| (1..=ways).map(|i| turned(candidate, i * STRIDE % usize::from(WAYS)))).collect()
}

/// Indices of the fastest briefly timed candidates.
pub(super) fn worth_a_closer_look(near: &[Candidate]) -> Vec<usize> {
    let mut timed: Vec<(f64, usize)> = near.iter().enumerate().filter_map(|(i, c)| Some((c.brief?, i))).collect();
    timed.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    timed.into_iter().take(LOOKED_AT_CLOSELY).map(|(_, i)| i).collect()
}

/// A candidate stored along other axes; its predicted cost is the same.
fn turned(candidate: &Candidate, axes: usize) -> Candidate {
    let laid = Laid { axes: axes as u8, ..candidate.laid.clone() };
    let plan = Plan { id: candidate.plan.id.along(axes as u8), ..candidate.plan.clone() };
    Candidate { plan, laid, lap: None, judged: None, brief: None, seconds: 0.0, failure: None, ..*candidate }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::{InstanceOptions, Options, PlanId};

    fn plan(method: Method, entry_cost: f64) -> Plan {
        let instances = InstanceOptions { entry_cost, ..InstanceOptions::default() };
        let options = Options { instances, ..Options::default() };
        Plan { id: method.into(), method, options }
    }

    #[test]
    fn neighbours_lie_on_both_sides() {
        let near = neighbours(&plan(Method::Cluster, 10.0), 1.25);
        assert_eq!(near.iter().map(|p| p.options.instances.entry_cost).collect::<Vec<_>>(), [8.0, 12.5]);
        let ids = [&near[0], &near[1], &neighbours(&near[1], 1.25)[0]].map(|plan| plan.id);
        assert_eq!(ids, [8.0, 12.5, 10.0].map(|cost| PlanId::from(Method::Cluster).refined(cost)));
    }

    #[test]
    fn what_has_no_entry_cost_has_no_neighbours() {
        assert!(neighbours(&plan(Method::Single, 10.0), 1.25).is_empty());
    }

    #[test]
    fn more_effort_refines_more() {
        let tried = |round: &Round| match round {
            Round::Entry(_) => 2,
            Round::Axes { of, ways } => of * ways,
        };
        let counts = [0, 2, 3, 4, 5, 6].map(|level| rounds(Effort::new(level)).iter().map(tried).sum::<usize>());
        assert_eq!(counts[..2], [0, 0]);
        assert!(counts[1..].windows(2).all(|c| c[0] < c[1]), "{counts:?}");
    }

    #[test]
    fn all_ways_are_tried_once() {
        let mut ways: Vec<usize> = (0..usize::from(WAYS)).map(|i| i * STRIDE % usize::from(WAYS)).collect();
        ways.sort_unstable();
        assert!(ways.into_iter().eq(0..usize::from(WAYS)));
    }
}
