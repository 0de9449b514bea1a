//! A decision that was made before, and the layout that it leads to.

use super::bounds::Bounds;
use super::candidate::Laid;
use super::evaluate::LaidOutPlans;
use super::outcome::{DecidedBy, Origin, Selection, Why};
use super::plans::{self, Plan};
use super::{Choosing, Chosen, Found, finish, passes, told};
use crate::scene::Scene;

/// A decision of `auto`: enough to make its layout again without timing anything.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Decided {
    /// The name of the plan, without refinement and axes.
    pub plan: String,
    /// The entry cost that replaces the plan's.
    pub entry_cost: Option<f64>,
    /// Number of the rotation of the stored axes; 0 is the identity.
    pub axes: u8,
}

impl Decided {
    /// Returns the decision with these parts.
    pub fn new(plan: impl Into<String>, entry_cost: Option<f64>, axes: u8) -> Decided {
        Decided { plan: plan.into(), entry_cost, axes }
    }
}

/// Lays out again what was decided; `None` if there is no such plan.
///
/// All plans of the effort are laid out, because the trees that they share give the order of the triangles.
pub(super) fn replay(scene: &Scene, choosing: &Choosing, bounds: Bounds, decided: &Decided) -> Option<Chosen> {
    let (options, verify) = (choosing.options, choosing.verify);
    let mut told = told(&options.layout, verify);
    told.instances.max_bytes_ratio = options.max_bytes_ratio();
    let plans = plans::plans(options.effort, &told);
    let (plans, mut passes) = passes::worth_a_try(scene, choosing.before, plans, options);
    let LaidOutPlans { layouts, placed } = choosing.evaluator().lay_out(scene, &plans);
    let (mut plan, mut laid) = layouts.into_iter().find(|(plan, _)| plan.id.name() == decided.plan)?;
    if let Some(entry_cost) = decided.entry_cost {
        plan = refined(plan, entry_cost);
        laid = choosing.evaluator().lay_out(scene, std::slice::from_ref(&plan)).layouts.pop()?.1;
    }
    if decided.axes > 0 {
        plan.id = plan.id.along(decided.axes);
        laid = Laid { axes: decided.axes, ..laid };
    }
    passes::tell_used(&mut passes, scene, &plan, &laid.layout);
    let selection = Selection {
        requested: options.method,
        method: plan.method,
        plan: plan.id,
        decided_by: DecidedBy::Plan,
        why: Why::Planned,
        candidates: Vec::new(),
        chosen: 0,
    };
    let pinned = scene.overlaid(&laid.overlay);
    let found = Found { selection, passes, may_be_left_alone: false };
    Some(finish(&pinned, laid, &placed, found, bounds, verify).with_notes(&pinned, Origin::Chosen(plan.method)))
}

/// Returns a plan with another entry cost.
pub(super) fn refined(mut plan: Plan, entry_cost: f64) -> Plan {
    plan.options.instances.entry_cost = entry_cost;
    plan.id = plan.id.refined(entry_cost);
    plan
}
