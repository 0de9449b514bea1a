//! The decision between candidates.

use super::bounds::Bounds;
use super::candidate::Candidate;
use super::outcome::{Excess, Outcome, Why};
use super::plans::Effort;
use crate::methods::PlanId;
use crate::verify::VerifyOptions;
use crate::verify::weights::Overall;

/// A candidate that was only predicted is worth a change only if its cost is less than this share of the input's.
const WORTH_A_CHANGE: f64 = 0.95;

/// A candidate that was only predicted replaces the single BLAS only if its cost is less than this share of the single
/// BLAS's: the model does not resolve smaller differences.
const SURER_THAN_SINGLE: f64 = 0.9;

/// Measured speeds that differ by less than this share count as equal: the layout with fewer bytes is chosen.
const EQUAL: f64 = 0.003;

/// A decision.
pub(super) struct Decision {
    /// Index of the chosen candidate.
    pub(super) winner: usize,
    pub(super) why: Why,
    /// The outcome of each candidate.
    pub(super) outcomes: Vec<Outcome>,
    /// Whether any candidate keeps to the bounds; if not, the input is chosen although it exceeds them.
    pub(super) keeps: bool,
    /// Whether the input keeps to the bounds, so that it may still be written instead.
    pub(super) may_be_left_alone: bool,
    /// Whether the chosen one must be faster in the views that judge, too.
    pub(super) needs_judging: bool,
}

/// Candidates that are judged before the input is chosen: each was the fastest left in the views that choose.
const MOST_JUDGED: usize = 4;

/// Indices of the candidates to time: the single BLAS and the best others by prediction, in ascending order.
pub(super) fn contenders(candidates: &[Candidate], effort: Effort) -> Vec<usize> {
    let mut order: Vec<usize> = (0..candidates.len()).filter(|&i| !candidates[i].is_input()).collect();
    let rank = |i: usize| (!candidates[i].plan.is_single(), candidates[i].predicted.picoseconds);
    order.sort_by(|&a, &b| rank(a).0.cmp(&rank(b).0).then(rank(a).1.total_cmp(&rank(b).1)).then(a.cmp(&b)));
    order.truncate(effort.measured().saturating_add(1));
    order.sort_unstable();
    order
}

/// Chooses the candidate that was measured fastest or, without measurements, the one predicted to be clearly cheaper;
/// if nothing beats the input, which comes first, the input. States for every candidate why it was chosen or not.
pub(super) fn decide(candidates: &[Candidate], verify: &VerifyOptions, bounds: &Bounds, measured: bool) -> Decision {
    let refusals = bounds.refusals(candidates);
    let keeps = refusals.contains(&None);
    let choice = Choice { candidates, verify, refusals: &refusals };
    let (winner, why) = match (keeps, measured) {
        (false, _) => (0, Why::NothingAllowed(refusals.first().cloned().flatten().unwrap_or_default())),
        (true, true) => choice.fastest(),
        (true, false) => choice.cheapest(),
    };
    let outcomes: Vec<Outcome> = (0..candidates.len())
        .map(|i| match (&refusals[i], &candidates[i].failure) {
            _ if i == winner => Outcome::Chosen(why.clone()),
            (Some(excess), _) => Outcome::NotAllowed(excess.clone()),
            (None, Some(failure)) => Outcome::Failed(failure.clone()),
            (None, None) if measured => choice.outcome_measured(i, winner),
            (None, None) => choice.outcome_predicted(i, winner),
        })
        .collect();
    let may_be_left_alone = refusals.first().is_none_or(Option::is_none);
    let needs_judging = matches!(why, Why::MeasuredFastest(_));
    Decision { winner, why, outcomes, keeps, may_be_left_alone, needs_judging }
}

/// A layout that was timed, and may win.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timed {
    /// Its number.
    pub(super) id: usize,
    /// Its speed over the input's in the views that choose.
    pub(super) speed: Overall,
    /// That in the views that judge, if it was the fastest.
    pub(super) judged: Option<Overall>,
    /// Predicted bytes of acceleration structures.
    pub(super) as_bytes: u64,
}

/// Returns the fastest layout, or the smallest of those that are as fast; `None` if none is faster than the input, unless the
/// input must change.
pub(super) fn fastest(timed: &[Timed], must_change: bool, least_view_ratio: f64) -> Option<Timed> {
    let is_judged_slower = |timed: &Timed| is_judged_slower(timed.judged.as_ref(), least_view_ratio);
    let judged_slower = timed.iter().filter(|timed| is_judged_slower(timed)).count();
    let may_win = |timed: &&Timed| {
        let is_faster = is_faster(&timed.speed, least_view_ratio) && !is_judged_slower(timed);
        must_change || is_faster && judged_slower < MOST_JUDGED
    };
    let best = timed.iter().filter(may_win).map(|timed| timed.speed.sure_ratio()).fold(0.0, f64::max);
    let equal = timed.iter().filter(may_win).filter(|timed| timed.speed.sure_ratio() >= (1.0 - EQUAL) * best);
    equal.min_by_key(|timed| timed.as_bytes).copied()
}

fn is_faster(speed: &Overall, least_view_ratio: f64) -> bool {
    speed.is_never_slower(least_view_ratio) && speed.speedup_ratio > 1.0 + EQUAL
}

/// Whether a layout was judged and not found faster.
fn is_judged_slower(judged: Option<&Overall>, least_view_ratio: f64) -> bool {
    judged.is_some_and(|judged| !judged.is_never_slower(least_view_ratio))
}

/// Candidates, and how each exceeds the bounds.
struct Choice<'a> {
    candidates: &'a [Candidate],
    verify: &'a VerifyOptions,
    refusals: &'a [Option<Vec<Excess>>],
}

impl Choice<'_> {
    fn speed(&self, i: usize) -> Option<Overall> {
        self.candidates[i].speed(&self.verify.weights)
    }

    fn cost(&self, i: usize) -> f64 {
        self.candidates[i].predicted.picoseconds
    }

    fn id(&self, i: usize) -> PlanId {
        self.candidates[i].plan.id
    }

    /// How far a candidate exceeds the bounds.
    fn excess(&self, i: usize) -> Vec<Excess> {
        self.refusals[i].clone().unwrap_or_default()
    }

    fn is_allowed(&self, i: usize) -> bool {
        self.refusals[i].is_none()
    }

    fn is_faster(&self, speed: &Overall) -> bool {
        is_faster(speed, self.verify.least_view_ratio)
    }

    /// Whether a candidate was judged and not found faster.
    fn is_judged_slower(&self, i: usize) -> bool {
        is_judged_slower(self.candidates[i].judged.as_ref(), self.verify.least_view_ratio)
    }

    /// Returns the cheapest of the given candidates; the first if several are equal.
    fn least(&self, of: impl Iterator<Item = usize>) -> Option<usize> {
        of.min_by(|&a, &b| self.cost(a).total_cmp(&self.cost(b)).then(a.cmp(&b)))
    }

    fn fastest(&self) -> (usize, Why) {
        let timed = || (0..self.candidates.len()).filter_map(|i| Some((i, self.speed(i)?)));
        let must_change = !self.is_allowed(0);
        let judged_slower = (0..self.candidates.len()).filter(|&i| self.is_judged_slower(i)).count();
        let of = |(i, speed)| {
            let Candidate { judged, predicted, .. } = &self.candidates[i];
            Timed { id: i, speed, judged: *judged, as_bytes: predicted.as_bytes }
        };
        let allowed: Vec<Timed> = timed().filter(|(i, _)| self.is_allowed(*i)).map(of).collect();
        let best = fastest(&allowed, must_change, self.verify.least_view_ratio);
        let refused = || timed().find(|(i, speed)| !self.is_allowed(*i) && self.is_faster(speed)).map(|(i, _)| i);
        match (best.map(|best| (best.id, best.speed.speedup_ratio)), refused()) {
            (Some((i, speedup_ratio)), _) if must_change => {
                (i, Why::MeasuredBestAllowed { speedup_ratio, input: self.excess(0) })
            }
            (Some((i, speedup_ratio)), _) => (i, Why::MeasuredFastest(speedup_ratio)),
            (None, _) if must_change => self.cheapest(),
            (None, None) if judged_slower > 0 => (0, Why::NoneJudgedFaster(judged_slower)),
            (None, Some(i)) => (0, Why::FasterNotAllowed { plan: self.id(i), excess: self.excess(i) }),
            (None, None) => (0, Why::NoneMeasuredFaster),
        }
    }

    /// The single BLAS, if it is allowed.
    fn single(&self) -> Option<usize> {
        (0..self.candidates.len()).find(|&i| self.candidates[i].plan.is_single() && self.is_allowed(i))
    }

    fn cheapest(&self) -> (usize, Why) {
        let of_input = self.cost(0);
        let single = self.single();
        let bar = single.map_or(f64::INFINITY, |i| SURER_THAN_SINGLE * self.cost(i));
        let is_sure = |i: usize| Some(i) == single || self.cost(i) < bar;
        let best = self.least((1..self.candidates.len()).filter(|&i| self.is_allowed(i) && is_sure(i)));
        let refused =
            || (1..self.candidates.len()).filter(|&i| !self.is_allowed(i) && self.cost(i) < WORTH_A_CHANGE * of_input);
        if let Some(i) = best.filter(|&i| self.cost(i) < WORTH_A_CHANGE * of_input || !self.is_allowed(0)) {
            let picoseconds = self.cost(i);
            let why = match self.is_allowed(0) {
                true => Why::PredictedCheapest { picoseconds, of_input },
                false => Why::PredictedBestAllowed { picoseconds, of_input, input: self.excess(0) },
            };
            return (i, why);
        }
        let why = match self.least(refused()) {
            None => Why::NonePredictedCheaper,
            Some(i) => {
                Why::CheaperNotAllowed { plan: self.id(i), cost_ratio: self.cost(i) / of_input, excess: self.excess(i) }
            }
        };
        (0, why)
    }

    fn outcome_measured(&self, i: usize, winner: usize) -> Outcome {
        let candidate = &self.candidates[i];
        let Some(speed) = self.speed(i) else {
            return match (i, candidate.brief) {
                (0, _) => Outcome::AnotherFaster,
                (_, Some(_)) => Outcome::BrieflySlower,
                (_, None) => Outcome::NotMeasured,
            };
        };
        let ratio = speed.speedup_ratio;
        match (self.speed(winner), candidate.judged.filter(|_| self.is_judged_slower(i))) {
            _ if ratio < 1.0 - speed.spread_ratio => Outcome::SlowerThanInput,
            (_, Some(Overall { speedup_ratio, least_view_ratio, .. })) => {
                Outcome::NotFasterWhenJudged { speedup_ratio, least_view_ratio }
            }
            _ if !speed.is_faster() => Outcome::NotFasterThanInput,
            _ if !self.is_faster(&speed) => Outcome::SlowInAView(speed.least_view_ratio),
            (Some(best), _) if winner > 0 && speed.sure_ratio() >= (1.0 - EQUAL) * best.sure_ratio() => {
                Outcome::MoreBytes
            }
            (Some(best), _) => Outcome::SpeedOfChosen(ratio / best.speedup_ratio),
            (None, _) => Outcome::AnotherChosen,
        }
    }

    fn outcome_predicted(&self, i: usize, winner: usize) -> Outcome {
        let of = |other: usize| self.cost(i) / self.cost(other);
        let chosen = of(winner);
        match self.single() {
            // The thresholds that rule out a candidate although it is predicted to be cheaper than the chosen one.
            _ if winner == 0 && (WORTH_A_CHANGE..1.0).contains(&chosen) => {
                Outcome::TooCloseToInput { cost_ratio: chosen, least: WORTH_A_CHANGE }
            }
            Some(single) if i != single && chosen < 1.0 => {
                Outcome::TooCloseToSingle { cost_ratio: of(single), least: SURER_THAN_SINGLE }
            }
            _ => Outcome::CostOfChosen(chosen),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DAffine3;

    use super::super::candidate::Laid;
    use super::super::model::Predicted;
    use super::super::plans::Plan;
    use super::*;
    use crate::layout::BlasPer;
    use crate::layout::{Content, Group, Layout};
    use crate::methods::{Method, Options};
    use crate::scene::Overlay;
    use crate::verify::speed::KindSpeed;
    use crate::verify::weights::Weights;
    use crate::verify::{PerKind, RaceResult, ViewSpeeds};

    fn candidate(
        name: &'static str,
        method: Method,
        picoseconds: f64,
        as_bytes: u64,
        largest_group: usize,
    ) -> Candidate {
        let baked =
            Group { name: name.into(), content: Content::Baked { frame: DAffine3::IDENTITY, geometries: vec![] } };
        let groups = if method == Method::Keep { vec![] } else { vec![baked] };
        let laid = Laid {
            layout: Arc::new(Layout { groups, ..Layout::default() }),
            axes: 0,
            passes: vec![],
            overlay: Overlay::default(),
            position_error_ratio: 0.0,
            held_back: 0,
        };
        Candidate {
            accuracy: Default::default(),
            plan: Plan { id: PlanId::new(method, name), method, options: Options::default() },
            laid,
            predicted: Predicted { picoseconds, as_bytes, ..Predicted::default() },
            largest_group,
            longest_group: 0.0,
            lap: None,
            judged: None,
            brief: None,
            seconds: 0.0,
            failure: None,
        }
    }

    fn bounds(most_bytes_ratio: f64, most_triangles: Option<u32>) -> Bounds {
        Bounds {
            most_bytes_ratio,
            is_asked_for: true,
            input_bytes: 1000,
            most_triangles,
            longest_ratio: f64::INFINITY,
            extent: 1.0,
            blas_per: BlasPer::Mesh,
        }
    }

    fn timed(mut candidate: Candidate, speedup_ratio: f64) -> Candidate {
        let kind =
            KindSpeed { before_mrays_per_s: 1.0, after_mrays_per_s: speedup_ratio, speedup_ratio, spread_ratio: 0.01 };
        candidate.lap = Some(RaceResult { views: ViewSpeeds(vec![PerKind::of(|_| kind)]), built: None });
        candidate
    }

    /// The decision, and the outcomes in words.
    fn decided(candidates: Vec<Candidate>, bounds: &Bounds, measured: bool) -> (Decision, Vec<String>) {
        let decision = decide(&candidates, &VerifyOptions::default(), bounds, measured);
        let outcomes = decision.outcomes.iter().map(ToString::to_string).collect();
        (decision, outcomes)
    }

    fn three(largest: usize) -> Vec<Candidate> {
        vec![
            candidate("keep", Method::Keep, 100.0, 1000, 5000),
            candidate("single", Method::Single, 70.0, 1310, 9000),
            candidate("cluster", Method::Cluster, 60.0, 1100, largest),
        ]
    }

    #[test]
    fn what_a_bound_refused_is_no_reason_to_claim_that_nothing_is_cheaper() {
        let (decision, outcomes) = decided(three(400), &bounds(1.0, None), false);
        assert_eq!((decision.winner, decision.keeps), (0, true));
        let why = decision.why.to_string();
        assert!(why.contains("within what is allowed") && why.contains("`cluster` would, at 0.60"), "{why}");
        assert_eq!(outcomes[1], "1.31 times the input's bytes, 1 allowed");
        assert!(outcomes[0].starts_with("chosen: "));
    }

    #[test]
    fn outcomes_tell_bytes_from_groups() {
        let (decision, outcomes) = decided(three(400), &bounds(1.25, Some(500)), false);
        assert_eq!(decision.winner, 2);
        let why = decision.why.to_string();
        assert!(why.contains("the input is not: a group of 5,000 triangles, 500 allowed"), "{why}");
        assert_eq!(outcomes[1], "1.31 times the input's bytes, 1.25 allowed; a group of 9,000 triangles, 500 allowed");
        assert!(!decision.may_be_left_alone);
    }

    #[test]
    fn the_smallest_groups_stand_for_a_bound_that_no_candidate_keeps() {
        assert_eq!(decided(three(8), &bounds(1.25, Some(3)), false).0.winner, 2);
    }

    #[test]
    fn where_no_candidate_keeps_to_all_bounds_the_input_stays() {
        let (decision, outcomes) = decided(three(400), &bounds(1.0, Some(500)), false);
        assert_eq!((decision.winner, decision.keeps), (0, false));
        assert!(outcomes[0].contains("no candidate keeps to all that is allowed"), "{}", outcomes[0]);
        assert_eq!(outcomes[2], "1.10 times the input's bytes, 1 allowed");
    }

    #[test]
    fn outcomes_say_than_what_a_candidate_costs_more() {
        let mut all = three(400);
        all.push(candidate("bvh", Method::Bvh, 65.0, 1000, 10));
        (all[1].predicted.as_bytes, all[2].predicted.picoseconds) = (1000, 140.0);
        let (decision, outcomes) = decided(all, &bounds(1.25, None), false);
        assert_eq!(decision.winner, 1);
        assert_eq!(outcomes[0], "predicted to cost 1.43 times as much as the one chosen");
        assert_eq!(outcomes[2], "predicted to cost 2.00 times as much as the one chosen");
        assert_eq!(outcomes[3], "predicted at 0.93 of `single`: only less than 0.9 is taken instead");
    }

    #[test]
    fn what_is_too_close_to_the_input_is_not_said_to_cost_more() {
        let mut all = three(400);
        (all[1].predicted.picoseconds, all[2].predicted.picoseconds) = (97.0, 120.0);
        all[1].predicted.as_bytes = 1000;
        let (decision, outcomes) = decided(all, &bounds(1.25, None), false);
        assert_eq!(decision.winner, 0);
        assert_eq!(outcomes[1], "predicted at 0.97 of the input: only less than 0.95 is worth a change");
    }

    #[test]
    fn an_input_beyond_the_bounds_is_not_kept_because_it_is_fastest() {
        let mut all = three(400);
        let cluster = timed(all.remove(2), 0.8);
        all.push(cluster);
        let (decision, outcomes) = decided(all, &bounds(1.25, Some(500)), true);
        assert_eq!((decision.winner, decision.may_be_left_alone), (2, false));
        assert!(outcomes[2].contains("measured 0.800 times as fast as the input, the best within what is allowed"));
    }

    #[test]
    fn measured_outcomes_tell_slower_from_not_faster() {
        let mut all = three(400);
        all.push(candidate("bvh", Method::Bvh, 65.0, 1000, 10));
        let speeds = [1.5, 0.9, 1.2];
        let rest = all.split_off(1).into_iter().zip(speeds).map(|(c, speed)| timed(c, speed));
        all.extend(rest);
        all.push(timed(candidate("overlap", Method::Overlap, 65.0, 1000, 10), 1.005));
        let (decision, outcomes) = decided(all, &bounds(2.0, None), true);
        assert_eq!(decision.winner, 1);
        assert_eq!(outcomes[0], "another was measured faster");
        assert_eq!(outcomes[2], "measured slower than the input");
        assert_eq!(outcomes[3], "measured 0.800 times as fast as the one chosen");
        assert_eq!(outcomes[4], "measured no faster than the input beyond the spread");
    }

    /// A candidate that was timed with these speedups in the views that choose.
    fn in_views(of: Candidate, ratios: &[f64]) -> Candidate {
        let view = |ratio: &f64| timed(candidate("", Method::Keep, 1.0, 1, 1), *ratio).lap.map(|lap| lap.views.0[0]);
        let views = ViewSpeeds(ratios.iter().filter_map(view).collect());
        Candidate { lap: Some(RaceResult { views, built: None }), ..of }
    }

    fn judged(of: Candidate, ratios: &[f64]) -> Candidate {
        let speed = in_views(candidate("", Method::Keep, 1.0, 1, 1), ratios).speed(&Weights::default());
        Candidate { judged: speed, ..of }
    }

    #[test]
    fn a_candidate_that_is_too_slow_in_a_view_gives_way_to_the_next() {
        let [keep, single, cluster] = three(400).try_into().unwrap_or_else(|_| unreachable!("three"));
        let (single, cluster) = (in_views(single, &[1.2, 1.2]), in_views(cluster, &[2.0, 1.8, 1.9, 2.1, 0.96]));
        let (decision, outcomes) = decided(vec![keep, single, cluster], &bounds(2.0, None), true);
        assert_eq!((decision.winner, decision.needs_judging), (1, true));
        assert_eq!(outcomes[2], "measured faster than the input, but 0.960 times as fast in one view");
    }

    #[test]
    fn the_spread_over_views_is_taken_off() {
        let [keep, single, cluster] = three(400).try_into().unwrap_or_else(|_| unreachable!("three"));
        let (single, cluster) = (in_views(single, &[1.2, 1.2, 1.2]), in_views(cluster, &[1.0, 1.7, 1.0]));
        assert_eq!(decided(vec![keep, single, cluster], &bounds(2.0, None), true).0.winner, 1);
    }

    #[test]
    fn what_is_judged_slower_gives_way_and_after_four_the_input_stays() {
        let slower = |name| judged(timed(candidate(name, Method::Cluster, 60.0, 1000, 1), 1.5), &[1.3, 1.2, 0.9]);
        let mut all = vec![candidate("keep", Method::Keep, 100.0, 1000, 1), slower("a"), slower("b"), slower("c")];
        all.push(timed(candidate("single", Method::Single, 70.0, 1000, 1), 1.1));
        let (decision, outcomes) = decided(all, &bounds(2.0, None), true);
        assert_eq!((decision.winner, decision.needs_judging), (4, true));
        assert!(
            outcomes[1].contains("in those that judge") && outcomes[1].contains("at least 0.900"),
            "{}",
            outcomes[1]
        );
        let mut all =
            vec![candidate("keep", Method::Keep, 100.0, 1000, 1), slower("a"), slower("b"), slower("c"), slower("d")];
        all.push(timed(candidate("single", Method::Single, 70.0, 1000, 1), 1.1));
        let (decision, _) = decided(all, &bounds(2.0, None), true);
        assert_eq!((decision.winner, decision.needs_judging), (0, false));
        assert_eq!(decision.why, Why::NoneJudgedFaster(4));
    }
}
