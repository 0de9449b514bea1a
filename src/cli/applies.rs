//! Which options of `bake` apply to which methods. An option that is given but does not apply is an error.

use anyhow::{Result, ensure};
use clap::ArgMatches;
use clap::parser::ValueSource;

use crate::choose::plans::{Effort, Plan, plans};
use crate::choose::{Choice, ChooseOptions};
use crate::methods::{Instances, Method};

/// What an option applies to.
struct Applies {
    /// Its name on the command line.
    option: &'static str,
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
const OPTIONS: [Applies; 18] = [
    to_auto_and("effort", &[]),
    to_auto_and("device-class", &[]),
    to("nodes-per-triangle-ratio", &[Method::Bvh]),
    to("min-area-ratio", &[Method::Bvh]),
    to("skip-overlap-ratio", &[Method::Overlap]),
    to("split-or-merge-ratio", &[Method::Overlap]),
    to("split-ratio", &[Method::Overlap]),
    to("termination-overlap-ratio", &[Method::Overlap]),
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

/// The options of [`OPTIONS`] that the user gave to `bake`.
pub(super) fn given(arguments: &ArgMatches) -> Vec<&'static str> {
    let Some(bake) = arguments.subcommand_matches("bake") else { return Vec::new() };
    let is_given = |option: &str| bake.value_source(&option.replace('-', "_")) == Some(ValueSource::CommandLine);
    OPTIONS.iter().map(|applies| applies.option).filter(|option| is_given(option)).collect()
}

/// Rejects options that do not apply.
///
/// # Errors
/// Names the first such option and what it applies to.
pub(super) fn check(given: &[&str], choose: &ChooseOptions) -> Result<()> {
    for applies in OPTIONS.iter().filter(|applies| given.contains(&applies.option)) {
        ensure!(
            applies.to_choice(choose),
            "--{} does not apply to --method {}; it applies to {}",
            applies.option,
            choose.method.name(),
            applies.words(choose)
        );
    }
    Ok(())
}

impl Applies {
    fn to_choice(&self, choose: &ChooseOptions) -> bool {
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
    fn words(&self, choose: &ChooseOptions) -> String {
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

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, FromArgMatches};

    use super::super::args::{Arguments, Command};
    use super::*;

    /// The error for a command line, if any.
    fn refusal(arguments: &str) -> Option<String> {
        let words = ["raykiln", "bake", "in.glb", "-o", "out.glb"].into_iter().chain(arguments.split_whitespace());
        let matches = Arguments::command().try_get_matches_from(words).expect(arguments);
        let parsed = Arguments::from_arg_matches(&matches).expect(arguments);
        let Command::Bake(bake) = parsed.command else { panic!("it is a bake") };
        check(&given(&matches), &bake.options().expect(arguments).choose).err().map(|error| error.to_string())
    }

    /// For each option with a value: the methods that it applies to, without and with `--instances choose`.
    const TABLE: [(&str, &str, &str); 18] = [
        ("--effort 2", "auto", "auto"),
        ("--device-class rt-cores", "auto", "auto"),
        ("--nodes-per-triangle-ratio 0.1", "bvh", "bvh"),
        ("--min-area-ratio 0.1", "bvh", "bvh"),
        ("--skip-overlap-ratio 0.1", "overlap auto", "overlap auto"),
        ("--split-or-merge-ratio 0.1", "overlap auto", "overlap auto"),
        ("--split-ratio 0.1", "overlap auto", "overlap auto"),
        ("--termination-overlap-ratio 0.1", "overlap auto", "overlap auto"),
        ("--min-triangles 9", "bvh overlap auto", "bvh overlap auto"),
        ("--max-bytes-ratio 2", "single bvh overlap cluster auto", "single bvh overlap cluster auto"),
        ("--pieces 4", "auto", "single bvh overlap cluster auto"),
        ("--isolate true", "single cluster auto", "single cluster auto"),
        ("--split-opacity true", "single cluster auto", "single cluster auto"),
        ("--entry-cost 3.5", "cluster auto", "single bvh overlap cluster auto"),
        ("--frames false", "cluster auto", "single bvh overlap cluster auto"),
        ("--max-group-triangles 100", "cluster auto", "cluster auto"),
        ("--max-group-extent-ratio 0.1", "cluster auto", "cluster auto"),
        ("--instances bake-or-keep", "single bvh overlap cluster auto", ""),
    ];

    #[test]
    fn options_are_refused_by_all_methods_that_they_do_not_apply_to() {
        for (option, plain, choosing) in TABLE {
            for method in Method::ALL.map(Method::name).into_iter().chain(["auto"]) {
                let applies = |to: &str| to.split_whitespace().any(|name| name == method);
                let found = refusal(&format!("--method {method} {option}"));
                assert_eq!(found.is_none(), applies(plain), "{method} {option}: {found:?}");
                if !choosing.is_empty() && applies("single bvh overlap cluster auto") {
                    let found = refusal(&format!("--method {method} {option} --instances choose"));
                    assert_eq!(found.is_none(), applies(choosing), "{method} {option}, choosing: {found:?}");
                }
            }
        }
    }

    #[test]
    fn every_layout_option_has_an_entry() {
        let command = Arguments::command();
        let bake = command.find_subcommand("bake").expect("there is a bake");
        let layout = bake.get_arguments().filter(|argument| argument.get_help_heading() == Some("Layout options"));
        for option in layout.filter_map(|argument| argument.get_long()) {
            assert!(OPTIONS.iter().any(|applies| applies.option == option), "{option}");
        }
        let listed = |option: &str| TABLE.iter().any(|row| row.0.split(' ').next() == Some(&format!("--{option}")));
        assert!(OPTIONS.iter().all(|applies| listed(applies.option)));
    }

    #[test]
    fn a_refusal_says_where_the_option_applies() {
        assert_eq!(
            refusal("--method single --entry-cost 3").expect("refused"),
            "--entry-cost does not apply to --method single; \
             it applies to cluster; auto; single, bvh, overlap with --instances choose"
        );
        assert_eq!(
            refusal("--nodes-per-triangle-ratio 0.1").expect("refused"),
            "--nodes-per-triangle-ratio does not apply to --method auto; it applies to bvh; auto from --effort 4 on"
        );
        assert_eq!(refusal("--nodes-per-triangle-ratio 0.1 --effort 4"), None);
        assert_eq!(refusal("--method keep"), None);
    }
}
