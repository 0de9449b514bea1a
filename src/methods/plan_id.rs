//! Names of candidate layouts.

use std::fmt::{Display, Formatter, Result};

use serde::{Serialize, Serializer};

use super::Method;

/// Identifies a layout: the plan, its refinement, and the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanId {
    method: Method,
    /// The plan's name, unique among all plans.
    plan: &'static str,
    /// The entry cost that replaces the plan's.
    refined_entry_cost: Option<f64>,
    /// Number of the rotation of the stored axes; 0 is the identity.
    axes: u8,
}

impl PlanId {
    /// Creates the id of a method's plan; the name must be unique.
    pub const fn new(method: Method, plan: &'static str) -> PlanId {
        PlanId { method, plan, refined_entry_cost: None, axes: 0 }
    }

    /// Returns the same plan with a different entry cost.
    pub fn refined(self, entry_cost: f64) -> PlanId {
        PlanId { refined_entry_cost: Some(entry_cost), ..self }
    }

    /// Returns the same layout along other axes.
    pub fn along(self, axes: u8) -> PlanId {
        PlanId { axes, ..self }
    }

    /// Returns the name of the plan, without refinement and axes.
    pub fn name(self) -> &'static str {
        self.plan
    }

    /// Returns the entry cost that replaces the plan's, if any.
    pub fn refined_entry_cost(self) -> Option<f64> {
        self.refined_entry_cost
    }

    /// Returns the number of the rotation of the stored axes; 0 is the identity.
    pub fn axes(self) -> u8 {
        self.axes
    }

    /// Returns the method.
    pub fn method(self) -> Method {
        self.method
    }

    /// Whether this is the unchanged input.
    pub fn is_input(self) -> bool {
        self.method == Method::Keep
    }
}

impl From<Method> for PlanId {
    /// Creates the id of a method with unchanged options.
    fn from(method: Method) -> PlanId {
        PlanId::new(method, method.name())
    }
}

impl Display for PlanId {
    fn fmt(&self, f: &mut Formatter) -> Result {
        f.write_str(self.plan)?;
        if let Some(cost) = self.refined_entry_cost {
            write!(f, ", refined to entry {cost:.2}")?;
        }
        match self.axes {
            0 => Ok(()),
            axes => write!(f, ", axes {axes}"),
        }
    }
}

impl Serialize for PlanId {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_plan_refinement_and_axes() {
        let plan = PlanId::new(Method::Cluster, "cluster, entry 15");
        assert_eq!(plan.to_string(), "cluster, entry 15");
        assert_eq!(plan.refined(13.906).refined(16.5).to_string(), "cluster, entry 15, refined to entry 16.50");
        assert_eq!(plan.refined(16.5).along(7).to_string(), "cluster, entry 15, refined to entry 16.50, axes 7");
        assert_eq!(PlanId::from(Method::PerObject).to_string(), "per-object");
    }
}
