//! Candidates near the best that was measured.
//!
//! What a layout costs on a device changes by some per cent with every few groups, up and down, and no model says where. So
//! the neighbourhood of the best is measured too: the same plan with a somewhat lower and a somewhat higher entry cost,
//! from step to step nearer (a pattern search: R. Hooke, T. A. Jeeves, "Direct Search" Solution of Numerical and
//! Statistical Problems, Journal of the ACM 8(2), 1961).

use super::candidate::Candidate;
use super::plans::{Effort, PROHIBITIVE, Plan};
use crate::layout::Method;
use crate::verify::weights::Weights;

/// By how much entry costs change from round to round.
const STEPS: [f64; 4] = [1.3, 1.15, 1.07, 1.5];

/// What a refined plan is called, after its first name.
const REFINED: &str = ", refined to entry ";

/// How many rounds there are.
pub(super) fn rounds(effort: Effort) -> usize {
    match effort.level() {
        ..5 => 0,
        5 => 2,
        _ => STEPS.len(),
    }
}

/// The plans of a round: neighbours of the fastest candidate so far; none where it has no entry cost to change.
pub(super) fn plans(candidates: &[Candidate], weights: &Weights, round: usize) -> Vec<Plan> {
    let speed = |c: &Candidate| c.lap.as_ref().map_or(0.0, |lap| weights.overall(&lap.kinds).speedup_ratio);
    let best = candidates.iter().filter(|c| c.lap.is_some()).reduce(|a, b| if speed(b) > speed(a) { b } else { a });
    best.map_or_else(Vec::new, |best| neighbours(&best.plan, STEPS[round % STEPS.len()]))
}

fn neighbours(plan: &Plan, step: f64) -> Vec<Plan> {
    if plan.method != Method::Cluster || plan.options.entry_cost >= PROHIBITIVE {
        return Vec::new();
    }
    let name = plan.name.split(REFINED).next().unwrap_or_default();
    let near = |factor: f64| {
        let mut near = plan.clone();
        near.options.entry_cost *= factor;
        near.name = format!("{name}{REFINED}{:.2}", near.options.entry_cost);
        near
    };
    [1.0 / step, step].map(near).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Options;

    fn plan(method: Method, entry_cost: f64) -> Plan {
        Plan { name: "cluster".into(), method, options: Options { entry_cost, ..Options::default() } }
    }

    #[test]
    fn neighbours_lie_on_both_sides() {
        let near = neighbours(&plan(Method::Cluster, 10.0), 1.25);
        assert_eq!(near.iter().map(|p| p.options.entry_cost).collect::<Vec<_>>(), [8.0, 12.5]);
        assert_eq!(
            [&near[0].name, &near[1].name],
            ["cluster, refined to entry 8.00", "cluster, refined to entry 12.50"]
        );
        assert_eq!(neighbours(&near[1], 1.25)[0].name, "cluster, refined to entry 10.00");
    }

    #[test]
    fn what_has_no_entry_cost_has_no_neighbours() {
        assert!(neighbours(&plan(Method::Single, 10.0), 1.25).is_empty());
        assert!(neighbours(&plan(Method::Cluster, PROHIBITIVE), 1.25).is_empty());
        assert!(plans(&[], &Weights::default(), 0).is_empty());
    }

    #[test]
    fn only_much_effort_refines() {
        assert_eq!([0, 4, 5, 6].map(|level| rounds(Effort::new(level))), [0, 0, 2, 4]);
    }
}
