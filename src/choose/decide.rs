//! The decision between candidates.

use super::candidate::Candidate;
use super::plans::Effort;
use crate::layout::Method;
use crate::verify::weights::Weights;

/// A candidate that was only predicted must cost less than this share of the input to be worth a change.
const WORTH_A_CHANGE: f64 = 0.95;

/// A candidate that was only predicted must cost less than this share of the single BLAS to be taken instead of it: the
/// model is not sure enough of anything closer.
const SURER_THAN_SINGLE: f64 = 0.9;

/// Layouts whose measured times differ by less than this share are equal: the one with fewer bytes is taken.
const EQUAL: f64 = 0.003;

/// Lengths that were computed in different ways may differ by this share.
const ROUNDING: f64 = 1e-6;

/// What a layout may take.
pub(super) struct Bounds {
    /// Predicted bytes of acceleration structures.
    pub(super) most_bytes: f64,
    /// Triangles of a group that could be divided; `None`: any number.
    pub(super) most_triangles: Option<u32>,
    /// Longest side of the world box of such a group, in world units; infinite: any length.
    pub(super) longest: f64,
}

/// What was decided.
pub(super) struct Decision {
    /// Index of the candidate.
    pub(super) winner: usize,
    pub(super) reason: String,
}

/// The candidates to be timed: the single BLAS and the best others by prediction, in their order.
pub(super) fn contenders(candidates: &[Candidate], effort: Effort) -> Vec<usize> {
    let mut order: Vec<usize> = (0..candidates.len()).filter(|&i| !candidates[i].is_input()).collect();
    let rank = |i: usize| (candidates[i].plan.method != Method::Single, candidates[i].sampled_cost);
    order.sort_by(|&a, &b| rank(a).0.cmp(&rank(b).0).then(rank(a).1.total_cmp(&rank(b).1)).then(a.cmp(&b)));
    order.truncate(effort.measured().saturating_add(1));
    order.sort_unstable();
    order
}

/// Takes the candidate that was measured to be the fastest, or else predicted to be clearly cheaper; the input, which is
/// the first one, where nothing beats it. Says of every candidate why it was chosen or not.
pub(super) fn decide(candidates: &mut [Candidate], weights: &Weights, bounds: &Bounds, measured: bool) -> Decision {
    let allowed = bounds.allow(candidates);
    let (winner, reason) = match measured {
        true => fastest(candidates, weights, &allowed),
        false => cheapest(candidates, &allowed),
    };
    for (i, candidate) in candidates.iter_mut().enumerate() {
        if i == winner {
            candidate.outcome = format!("chosen: {reason}");
        } else if !allowed[i] {
            candidate.outcome = "its groups or its bytes are beyond what is allowed".to_owned();
        } else if candidate.outcome.is_empty() {
            candidate.outcome = match (measured, candidate.lap.is_some()) {
                (true, true) => "measured to be slower, or not faster by more than the spread",
                (true, false) if i == 0 => "another is faster",
                (true, false) if candidate.brief.is_some() => "timed briefly to be slower than another of its kind",
                (true, false) => "predicted to cost more than those that were measured",
                (false, _) => "predicted not to cost clearly less",
            }
            .to_owned();
        }
    }
    Decision { winner, reason }
}

impl Bounds {
    /// Which candidates keep to the bounds on bytes and groups; the input, which is the first, where none does.
    pub(super) fn allow(&self, candidates: &[Candidate]) -> Vec<bool> {
        let largest = self.most_triangles.map_or(usize::MAX, |n| n as usize);
        // No method makes a triangle shorter: what the best of them leaves is as good as the bound.
        let shortest = candidates.iter().map(|c| c.longest_group).fold(f64::INFINITY, f64::min);
        let longest = self.longest.max(shortest) * (1.0 + ROUNDING);
        let allows = |c: &Candidate| {
            let in_bounds = c.largest_group <= largest && c.longest_group <= longest;
            in_bounds && (c.is_input() || c.as_bytes as f64 <= self.most_bytes)
        };
        let mut allowed: Vec<bool> = candidates.iter().map(allows).collect();
        if !allowed.contains(&true) {
            allowed.iter_mut().take(1).for_each(|input| *input = true);
        }
        allowed
    }
}

fn fastest(candidates: &[Candidate], weights: &Weights, allowed: &[bool]) -> (usize, String) {
    let overall = |i: usize| candidates[i].speed(weights);
    let faster = (0..candidates.len()).filter(|&i| allowed[i]).filter_map(|i| {
        let overall = overall(i)?;
        (overall.is_faster() && overall.speedup_ratio > 1.0 + EQUAL).then_some((i, overall.speedup_ratio))
    });
    let faster: Vec<(usize, f64)> = faster.collect();
    let best = faster.iter().map(|f| f.1).fold(0.0, f64::max);
    let equal = faster.into_iter().filter(|f| f.1 >= (1.0 - EQUAL) * best);
    match equal.min_by_key(|f| candidates[f.0].as_bytes) {
        Some((i, speedup)) => (i, format!("measured {speedup:.3} times as fast as the input, the fastest")),
        None => (0, "no candidate was measured faster than the input by more than the spread".to_owned()),
    }
}

fn cheapest(candidates: &[Candidate], allowed: &[bool]) -> (usize, String) {
    let input = candidates[0].sampled_cost;
    let single = (0..candidates.len()).find(|&i| candidates[i].plan.method == Method::Single && allowed[i]);
    let bar = single.map_or(f64::INFINITY, |i| SURER_THAN_SINGLE * candidates[i].sampled_cost);
    let best = (1..candidates.len())
        .filter(|&i| allowed[i] && (Some(i) == single || candidates[i].sampled_cost < bar))
        .min_by(|&a, &b| candidates[a].sampled_cost.total_cmp(&candidates[b].sampled_cost).then(a.cmp(&b)));
    match best.filter(|&i| candidates[i].sampled_cost < WORTH_A_CHANGE * input || !allowed[0]) {
        Some(i) => {
            let cost = candidates[i].sampled_cost;
            (i, format!("predicted to take {cost:.0} picoseconds a ray, the input {input:.0}; nothing was measured"))
        }
        None => (0, "nothing is predicted to cost clearly less than the input; nothing was measured".to_owned()),
    }
}
