//! Layouts of a scene, made by each method with each combination of settings.

use std::borrow::Cow;
use std::time::Instant;

use glam::DVec3;

use super::config::ErrorVsTime;
use super::errors::{PositionErrors, position_errors};
use super::settings::{Combination, Value};
use crate::choose::{ChooseOptions, choose};
use crate::commands::measure::measure_with;
use crate::cost::mesh_trees::MeshTrees;
use crate::layout::{Layout, as_built, stored};
use crate::methods::PlanId;
use crate::scene::Scene;
use crate::verify::Machine;
use crate::verify::cpu::TwoLevel;

/// A layout of a scene.
pub(super) struct Made {
    /// The method asked for.
    pub(super) method: &'static str,
    /// The layout's name.
    pub(super) name: String,
    /// Values of the swept settings, in their order.
    pub(super) values: Vec<Option<Value>>,
    /// Seconds to choose and make it.
    pub(super) seconds: f64,
    /// Index of an earlier layout that is equal, or its own.
    pub(super) same_as: usize,
    /// The layout; `None` if an earlier one is equal.
    pub(super) layout: Option<Layout>,
    pub(super) positions: PositionErrors,
    pub(super) two_level_cost: f64,
}

/// Makes all layouts of an experiment for a scene.
pub(super) fn make_all(scene: &Scene, experiment: &ErrorVsTime, machine: &Machine) -> Vec<Made> {
    let trees = MeshTrees::build(scene);
    let metrics = measure_with(scene, &trees, experiment.bake.verify.build.blas_per);
    let mut all: Vec<Made> = Vec::new();
    for &method in &experiment.methods {
        let mut bake = experiment.bake.clone();
        bake.choose = ChooseOptions { method, ..bake.choose };
        for combination in experiment.sweep.combinations(&bake) {
            let Combination { bake, values } = combination;
            let start = Instant::now();
            let chosen = choose(scene, &trees, [&metrics; 2], machine, &bake.choose, &bake.verify);
            let seconds = start.elapsed().as_secs_f64();
            let named = Made { seconds, values, ..Made::unmeasured(method.name(), chosen.selection.plan) };
            let made = named.measured(scene, as_built(scene, &chosen.layout, bake.verify.build.blas_per), &all);
            all.push(made);
        }
    }
    all
}

impl Made {
    fn unmeasured(method: &'static str, plan: PlanId) -> Made {
        Made {
            method,
            name: plan.to_string(),
            values: Vec::new(),
            seconds: 0.0,
            same_as: 0,
            layout: None,
            positions: PositionErrors::default(),
            two_level_cost: 0.0,
        }
    }

    /// Measures the layout, unless an earlier one is equal.
    fn measured(self, scene: &Scene, layout: Cow<Layout>, earlier: &[Made]) -> Made {
        let is_known = |made: &Made| made.layout.as_ref().is_some_and(|other| other.is_same(&layout));
        match earlier.iter().position(is_known) {
            Some(same_as) => {
                let Made { positions, two_level_cost, .. } = &earlier[same_as];
                Made { same_as, positions: positions.clone(), two_level_cost: *two_level_cost, ..self }
            }
            None => {
                let (positions, two_level_cost) = measure(scene, &layout);
                Made { same_as: earlier.len(), layout: Some(layout.into_owned()), positions, two_level_cost, ..self }
            }
        }
    }
}

/// Returns the position errors and the two-level cost of a layout.
fn measure(scene: &Scene, layout: &Layout) -> (PositionErrors, f64) {
    let stored = stored(scene, layout);
    let positions = position_errors(scene, layout, &stored);
    // Seen from its middle: far from the origin, boxes in single precision are larger.
    let center = scene.bounds().center();
    let center = if center.is_finite() { center } else { DVec3::ZERO };
    let trees = TwoLevel::build_to_count(&stored.translated(-center), &MeshTrees::default());
    (positions, trees.cost(scene.bounds().area()))
}
