//! Which options of `bake` apply to which methods.

use super::plans::{Effort, Plan, plans};
use super::{Choice, ChooseOptions};
use crate::methods::{Instances, Method};

/// What an option applies to.
pub(crate) struct Applies {
    /// Its name on the command line.
    pub(crate) option: &'static str,
    /// The methods, regardless of other options.
    to: &'static [Method],
    /// Further methods with `--instances choose`.
    if_choosing: &'static [Method],
    /// Whether it applies to `auto` regardless of its plans.
    to_auto: bool,
}

/// The methods that write instances out.
const BAKING: &[Method] = &[Method::Single, Method::Bvh, Method::Overlap, Method::Cluster];

const fn to(option: &'static str, to: &'static [Method]) -> Applies {
    Applies { option, to, if_choosing: &[], to_auto: false }
}

const fn to_auto_and(option: &'static str, to: &'static [Method]) -> Applies {
    Applies { option, to, if_choosing: &[], to_auto: true }
}

const fn if_choosing(option: &'static str, to: &'static [Method]) -> Applies {
    Applies { option, to, if_choosing: BAKING, to_auto: false }
}

/// The options that do not apply to every method.
pub(crate) const OPTIONS: [Applies; 19] = [
    to_auto_and("effort", &[]),
    to_auto_and("device-class", &[]),
    to("nodes-per-triangle-ratio", &[Method::Bvh]),
    to("min-area-ratio", &[Method::Bvh]),
    to("skip-overlap-ratio", &[Method::Overlap]),
    to("split-or-merge-ratio", &[Method::Overlap]),
    to("split-ratio", &[Method::Overlap]),
    to("termination-overlap-ratio", &[Method::Overlap]),
    to("overlap-rule", &[Method::Overlap]),
    to("min-triangles", &[Method::Bvh, Method::Overlap]),
    to_auto_and("max-bytes-ratio", BAKING),
    to("instances", BAKING),
    if_choosing("pieces", &[]),
    to("isolate", &[Method::Single, Method::Cluster]),
    to("split-opacity", &[Method::Single, Method::Cluster]),
    if_choosing("entry-cost", &[Method::Cluster]),
    if_choosing("frames", &[Method::Cluster]),
    to_auto_and("max-group-triangles", &[Method::Cluster]),
    to_auto_and("max-group-extent-ratio", &[Method::Cluster]),
];

impl Applies {
    /// Whether the option applies to what is chosen by.
    pub(crate) fn to_choice(&self, choose: &ChooseOptions) -> bool {
        match choose.method {
            Choice::Method(method) => self.to_method(method, choose.layout.instances.shared),
            Choice::Auto => self.to_auto(choose, choose.effort),
        }
    }

    fn to_method(&self, method: Method, shared: Instances) -> bool {
        self.to.contains(&method) || (shared == Instances::Choose && self.if_choosing.contains(&method))
    }

    fn to_auto(&self, choose: &ChooseOptions, effort: Effort) -> bool {
        self.to_auto || plans(effort, &choose.layout).iter().any(|plan| self.to_plan(plan, choose))
    }

    fn to_plan(&self, plan: &Plan, choose: &ChooseOptions) -> bool {
        // A single BLAS in a frame of its own is what `cluster` yields if entering a second one costs too much.
        let is_turned = plan.options.single.turned;
        let of_plan = plan.options.instances.entry_cost;
        let has_own = self.option == "entry-cost" && (is_turned || of_plan != choose.layout.instances.entry_cost);
        let shared = match choose.forbidden.choose_instances {
            true => Instances::BakeOrKeep,
            false => plan.options.instances.shared,
        };
        !has_own && self.to_method(if is_turned { Method::Cluster } else { plan.method }, shared)
    }

    /// What the option applies to, in words.
    #[cfg(feature = "cli")]
    pub(crate) fn words(&self, choose: &ChooseOptions) -> String {
        let names =
            |methods: &mut dyn Iterator<Item = &Method>| methods.map(|m| m.name()).collect::<Vec<_>>().join(", ");
        let always = names(&mut self.to.iter());
        let choosing = names(&mut self.if_choosing.iter().filter(|method| !self.to.contains(method)));
        let auto = (0..=Effort::MOST).find(|&level| self.to_auto(choose, Effort::new(level)));
        let auto = match auto {
            Some(level) if level > choose.effort.level() => format!("auto from --effort {level} on"),
            Some(_) => "auto".to_owned(),
            None => String::new(),
        };
        let choosing = if choosing.is_empty() { choosing } else { format!("{choosing} with --instances choose") };
        let all: Vec<String> = [always, auto, choosing].into_iter().filter(|words| !words.is_empty()).collect();
        all.join("; ")
    }
}
