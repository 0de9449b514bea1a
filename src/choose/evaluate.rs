//! Plans become candidates: each is laid out, and what rays take in its layout as its consumer builds it is predicted.
//!
//! `auto` ranks candidates by these numbers, and `raykiln lab` fits prices to them.

use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::candidate::{Candidate, Known, Laid, lay_out};
use super::model::{Class, Ranking};
use super::plans::Plan;
use super::segments;
use crate::cost::mesh_trees::MeshTrees;
use crate::layout::PlacedTrees;
use crate::methods::{Cache, PlanId};
use crate::scene::Scene;
use crate::verify::VerifyOptions;
use crate::verify::accuracy::Probe;
use crate::verify::cpu::{Reference, TwoLevel};
use crate::verify::rays;
use crate::verify::views::Role;

/// What plans for a scene are evaluated with.
pub(crate) struct Evaluator<'a> {
    /// Known trees of the scene's meshes.
    pub(crate) trees: &'a MeshTrees,
    /// The two-level cost of the scene as it is, as its consumer builds it.
    pub(crate) two_level_cost: f64,
    /// Rays of each kind that are traced on the CPU.
    pub(crate) rays_per_kind: usize,
    /// Whether ray kinds that weigh 0 are traced too. They count for no ranking.
    pub(crate) all_kinds: bool,
    /// The device class whose prices predict times.
    pub(crate) class: Class,
    /// Seed and weights of the rays, the largest position error, and how the consumer builds a layout.
    pub(crate) verify: &'a VerifyOptions,
}

/// What is known of plans.
pub(crate) struct Evaluated {
    /// Those that differ, in their order.
    pub(crate) candidates: Vec<Candidate>,
    /// The others, in their order.
    pub(crate) duplicates: Vec<Duplicate>,
    /// The trees that laying them out built.
    pub(crate) placed: PlacedTrees,
}

/// A plan that comes to the same layout as an earlier one.
pub(crate) struct Duplicate {
    pub(crate) plan: PlanId,
    /// Index of the candidate.
    pub(crate) same_as: usize,
    /// Instances that stay as they are because rounding would move their vertices too far; without them the layouts might
    /// differ.
    pub(crate) held_back: usize,
    /// Time to lay it out.
    pub(crate) seconds: f64,
}

impl Evaluator<'_> {
    /// Lays out every plan, without those that come to what an earlier one came to, and predicts what rays take in each
    /// layout. All but the seconds is equal for any number of threads.
    pub(crate) fn evaluate(&self, scene: &Scene, plans: &[Plan]) -> Evaluated {
        let Evaluator { trees, two_level_cost, class, all_kinds, verify, .. } = *self;
        let vantage = vantage(scene);
        let moved = (vantage != DVec3::ZERO).then(|| scene.translated(-vantage));
        let seen = moved.as_ref().unwrap_or(scene);
        let of_input = TwoLevel::build_to_count(seen, trees);
        let sampling = verify.sampling(self.rays_per_kind, Some(Role::Choose));
        let rays = rays::generate(seen, &Reference::new(&of_input), &sampling);
        let (weights, blas_per) = (verify.weights, verify.build.blas_per);
        let ranking = Ranking { rays: &rays, vantage, class, weights, all_kinds, blas_per };
        let plans = segments::given(plans, &of_input, &rays, &weights, vantage);
        let kinds = ranking.costs(&of_input);
        let of_input = if moved.is_some() { TwoLevel::build_to_count(scene, trees) } else { of_input };
        let probe = Probe::new(scene, &Reference::new(&of_input), verify);
        let accuracy = probe.measure(&of_input.padded(scene));
        let LaidOut { layouts, duplicates, placed } = lay_out_all(scene, &plans, verify.max_position_error_ratio);
        let known = Known { trees, placed: &placed, cost: two_level_cost, kinds, accuracy, probe: &probe };
        let candidates = rank_all(scene, layouts, &known, &ranking);
        Evaluated { candidates, duplicates, placed }
    }
}

impl Evaluator<'_> {
    /// Lays plans out as [`Evaluator::evaluate`] does, and predicts nothing.
    pub(crate) fn lay_out(&self, scene: &Scene, plans: &[Plan]) -> LaidOutPlans {
        let Evaluator { trees, verify, .. } = *self;
        let plans = if plans.iter().any(Plan::is_by_rays) {
            let vantage = vantage(scene);
            let seen = scene.translated(-vantage);
            let of_input = TwoLevel::build_to_count(&seen, trees);
            let sampling = verify.sampling(self.rays_per_kind, Some(Role::Choose));
            let rays = rays::generate(&seen, &Reference::new(&of_input), &sampling);
            segments::given(plans, &of_input, &rays, &verify.weights, vantage)
        } else {
            plans.to_vec()
        };
        let LaidOut { layouts, placed, .. } = lay_out_all(scene, &plans, verify.max_position_error_ratio);
        LaidOutPlans { layouts: layouts.into_iter().map(|(plan, laid, _)| (plan.clone(), laid)).collect(), placed }
    }
}

/// Layouts that differ, each with the first plan that leads to it, and the trees that laying them out built.
pub(crate) struct LaidOutPlans {
    pub(crate) layouts: Vec<(Plan, Laid)>,
    pub(crate) placed: PlacedTrees,
}

/// A scene farther from the origin than so many of its diagonals is ranked as seen from its middle.
const FAR: f64 = 1024.0;

/// Where a scene is seen from when layouts are ranked: so far from the origin that rays in single precision miss what
/// they are meant for, what they meet tells nothing of layouts.
fn vantage(scene: &Scene) -> DVec3 {
    let bounds = scene.core().bounds();
    let is_far = bounds.center().abs().max_element() > FAR * bounds.diagonal();
    if is_far { bounds.center() } else { DVec3::ZERO }
}

/// The layout of a plan, and the seconds that it took.
type TimedLayout<'p> = (&'p Plan, Laid, f64);

/// What plans come to.
struct LaidOut<'p> {
    /// The layouts that differ.
    layouts: Vec<TimedLayout<'p>>,
    duplicates: Vec<Duplicate>,
    placed: PlacedTrees,
}

fn lay_out_all<'p>(scene: &Scene, plans: &'p [Plan], max_error_ratio: f64) -> LaidOut<'p> {
    let mut layouts: Vec<TimedLayout> = Vec::new();
    let mut duplicates = Vec::new();
    let mut cache = Cache::serving(plans.iter().map(|plan| &plan.options));
    for plan in plans {
        let start = Instant::now();
        let laid = lay_out(&mut cache, scene, plan, max_error_ratio);
        let seconds = start.elapsed().as_secs_f64();
        match layouts.iter().position(|(_, other, _)| other.is_same(&laid)) {
            None => layouts.push((plan, laid, seconds)),
            Some(same_as) => {
                duplicates.push(Duplicate { plan: plan.id, same_as, held_back: laid.held_back, seconds });
            }
        }
    }
    LaidOut { layouts, duplicates, placed: cache.into_trees() }
}

/// Candidates ranked side by side: each takes memory for its trees.
const RANKED_AT_ONCE: usize = 2;

/// Predicts what each layout costs.
fn rank_all(scene: &Scene, layouts: Vec<TimedLayout>, known: &Known, ranking: &Ranking) -> Vec<Candidate> {
    let rank = |(plan, laid, seconds): TimedLayout| {
        let start = Instant::now();
        let candidate = Candidate::new(scene, known, plan.clone(), laid, ranking);
        Candidate { seconds: seconds + start.elapsed().as_secs_f64(), ..candidate }
    };
    let mut candidates = Vec::with_capacity(layouts.len());
    let mut layouts = layouts.into_iter();
    loop {
        // The first one is mostly the input, which has its trees already.
        let some: Vec<_> = layouts.by_ref().take(RANKED_AT_ONCE + usize::from(candidates.is_empty())).collect();
        if some.is_empty() {
            return candidates;
        }
        candidates.par_extend(some.into_par_iter().map(rank));
    }
}
