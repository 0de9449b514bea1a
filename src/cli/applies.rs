//! Rejects options of `bake` that are given but do not apply to the method.

use anyhow::{Result, ensure};
use clap::ArgMatches;
use clap::parser::ValueSource;

use crate::choose::ChooseOptions;
use crate::choose::applies::OPTIONS;

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

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, FromArgMatches};

    use super::super::args::{Arguments, Command};
    use super::*;
    use crate::methods::Method;

    /// The error for a command line, if any.
    fn refusal(arguments: &str) -> Option<String> {
        let words = ["raykiln", "bake", "in.glb", "-o", "out.glb"].into_iter().chain(arguments.split_whitespace());
        let matches = Arguments::command().try_get_matches_from(words).expect(arguments);
        let parsed = Arguments::from_arg_matches(&matches).expect(arguments);
        let Command::Bake(bake) = parsed.command else { panic!("it is a bake") };
        check(&given(&matches), &bake.options().expect(arguments).choose).err().map(|error| error.to_string())
    }

    /// For each option with a value: the methods that it applies to, without and with `--instances choose`.
    const TABLE: [(&str, &str, &str); 19] = [
        ("--effort 2", "auto", "auto"),
        ("--device-class rt-cores", "auto", "auto"),
        ("--nodes-per-triangle-ratio 0.1", "bvh", "bvh"),
        ("--min-area-ratio 0.1", "bvh", "bvh"),
        ("--skip-overlap-ratio 0.1", "overlap auto", "overlap auto"),
        ("--split-or-merge-ratio 0.1", "overlap auto", "overlap auto"),
        ("--split-ratio 0.1", "overlap auto", "overlap auto"),
        ("--termination-overlap-ratio 0.1", "overlap auto", "overlap auto"),
        ("--overlap-rule thesis", "overlap auto", "overlap auto"),
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
