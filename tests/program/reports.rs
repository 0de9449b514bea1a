//! Reports are true and complete.

use crate::common::{bake, raykiln, samples};
use serde_json::Value;
use std::path::PathBuf;
use tempfile::TempDir;

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

fn report_of(name: &str, more: &[&str]) -> Value {
    let folder = TempDir::new().expect("a temporary folder");
    bake(&sample(name), &folder.path().join("out.glb"), more)
}

fn text_of(name: &str, more: &[&str]) -> String {
    let folder = TempDir::new().expect("a temporary folder");
    let (scene, out) = (sample(name), folder.path().join("out.glb"));
    let ran = raykiln(["bake", scene.to_str().unwrap(), "-o", out.to_str().unwrap()].iter().chain(more));
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    ran.stderr
}

fn notes(report: &Value) -> Vec<&str> {
    report["notes"].as_array().expect("notes").iter().filter_map(Value::as_str).collect()
}

fn pass<'r>(report: &'r Value, name: &str) -> &'r Value {
    let passes = report["passes"].as_array().expect("passes");
    passes.iter().find(|p| p["name"] == name).expect("the pass is reported")
}

fn candidates(report: &Value) -> &Vec<Value> {
    report["method"]["candidates"].as_array().expect("candidates")
}

#[test]
fn the_speed_that_decides_is_reported() {
    let report = report_of("overlapping", &["--weights", "shadow=2"]);
    let (overall, shadow) = (&report["overall"], &report["verify"]["kinds"]["shadow"]);
    for key in ["speedup_ratio", "spread_ratio"] {
        let [a, b] = [overall, shadow].map(|speed| speed[key].as_f64());
        let is_same = a.zip(b).map_or(a == b, |(a, b)| (a - b).abs() <= 1e-9 * b.abs());
        assert!(is_same, "{key}: {a:?} for {b:?}");
    }
    assert_eq!(overall["measured_on"], "cpu");
    assert!(text_of("overlapping", &["--method", "single"]).contains("weighted over ray kinds"));
}

#[test]
fn what_a_bake_was_told_is_in_its_report() {
    let more = ["--weights", "primary=1,random=0.5", "--seed", "7", "--effort", "1", "--max-group-triangles", "9"];
    let told = report_of("overlapping", &more)["options"].clone();
    assert_eq!((&told["seed"], &told["effort"], &told["max_group_triangles"]), (&7.into(), &1.into(), &9.into()));
    assert_eq!((&told["weights"]["random"], &told["weights"]["shadow"]), (&0.5.into(), &0.0.into()));
    assert_eq!((&told["max_bytes_ratio"], &told["isolate"]), (&1.25.into(), &Value::Null));
    let told = report_of("overlapping", &["--method", "single", "--isolate", "true"])["options"].clone();
    assert_eq!((&told["max_bytes_ratio"], &told["isolate"]), (&Value::Null, &true.into()));
}

#[test]
fn cpu_speeds_are_said_to_tell_nothing_of_a_device() {
    let report = report_of("overlapping", &["--method", "single"]);
    let words = report["verdict_reason"].as_str().expect("words");
    assert!(words.contains("CPU") && words.contains("tell nothing of a device"), "{words}");
    assert!(text_of("overlapping", &["--method", "single"]).replace("\n ", "").contains("tell nothing of a device"));
}

#[test]
fn bounds_that_do_not_hold_are_named_with_how_far_and_why() {
    let cases: [(&[&str], &[&str]); 3] = [
        (&["--max-group-triangles", "3", "--keep", "*"], &["12 triangles", "11 groups more", "--keep protects it"]),
        (
            &["--method", "cluster", "--max-group-triangles", "8", "--max-bytes-ratio", "1"],
            &["--max-bytes-ratio 1", "`cluster`"],
        ),
        (
            &["--max-group-triangles", "8", "--max-bytes-ratio", "0.5"],
            &["--max-group-triangles 8", "no candidate keeps to all"],
        ),
    ];
    for (more, words) in cases {
        let report = report_of("overlapping", more);
        let said = |note: &&str| note.contains("does not hold") && words.iter().all(|w| note.contains(w));
        assert!(notes(&report).iter().any(said), "{more:?}: {words:?} is missing in {:?}", notes(&report));
    }
}

#[test]
fn groups_of_meshes_that_stay_instanced_are_said_to_be_beyond_a_bound() {
    let report =
        report_of("instanced", &["--method", "cluster", "--max-group-triangles", "1", "--max-bytes-ratio", "1"]);
    let whole = notes(&report).into_iter().find(|note| note.contains("stays whole"));
    assert!(whole.is_some_and(|note| note.contains("its mesh is placed ")), "{:?}", notes(&report));
}

#[test]
fn nothing_is_noted_where_bounds_hold() {
    for more in
        [&["--max-group-triangles", "100000"][..], &["--max-group-extent-ratio", "1"], &["--max-bytes-ratio", "9"], &[]]
    {
        let report = report_of("overlapping", more);
        assert!(notes(&report).iter().all(|note| !note.contains("does not hold")), "{more:?}: {:?}", notes(&report));
    }
}

#[test]
fn candidates_that_rounding_holds_back_are_listed() {
    let report = report_of("overlapping", &["--max-position-error-ratio", "1e-13"]);
    let turned = candidates(&report).iter().find(|c| c["name"] == "single, turned").expect("it is listed");
    let outcome = turned["outcome"].as_str().expect("words");
    assert!(outcome.starts_with("comes to `single`: 8 instances stay") && outcome.contains("1e-13"), "{outcome}");
}

#[test]
fn an_explicit_false_forbids() {
    let with = report_of("transparent", &["--effort", "6"]);
    assert!(with["method"]["candidates"].to_string().contains("opacity split"));
    let forbid = ["--effort", "6", "--split-opacity", "false", "--isolate", "false", "--frames", "false"];
    let without = report_of("transparent", &forbid);
    assert!(!without["method"]["candidates"].to_string().contains("opacity split"));
    for (name, option) in [("split opacity", "--split-opacity"), ("isolate", "--isolate"), ("frames", "--frames")] {
        let pass = pass(&without, name);
        assert_eq!((&pass["applied"], &pass["reason"]), (&false.into(), &format!("{option} false forbids it").into()));
    }
}

#[test]
fn passes_that_what_was_chosen_does_without_are_not_applied() {
    for name in ["clean", "overlapping", "transparent", "instanced"] {
        let report = report_of(name, &["--effort", "5"]);
        let chosen = report["method"]["chosen_candidate"].as_str().expect("a name");
        let is_applied = |name: &str| pass(&report, name)["applied"] == true;
        assert_eq!(is_applied("isolate"), chosen.contains("isolated"), "{name}: {chosen}");
        assert_eq!(is_applied("split opacity"), chosen.contains("opacity split"), "{name}: {chosen}");
        assert_eq!(is_applied("reduce overlap"), chosen == "overlap", "{name}: {chosen}");
        let has_frames = ["cluster", "single, turned"].iter().any(|plan| chosen.starts_with(plan));
        assert!(!is_applied("frames") || has_frames, "{name}: {chosen}");
    }
}

#[test]
fn the_candidate_written_costs_what_the_table_says() {
    for name in ["overlapping", "transparent", "instanced"] {
        let report = report_of(name, &["--effort", "4"]);
        let chosen = candidates(&report).iter().find(|c| c["name"] == report["method"]["chosen_candidate"]);
        let cost = chosen.expect("it is listed")["predicted_cost"].as_f64();
        assert_eq!(cost, report["after"]["two_level_cost"].as_f64(), "{name}");
    }
}

#[test]
fn lines_of_the_table_of_candidates_are_short() {
    let text = text_of("overlapping", &["--effort", "6", "-v", "--max-position-error-ratio", "1e-13"]);
    let table =
        text.lines().skip_while(|line| !line.starts_with("candidate ")).take_while(|line| !line.starts_with("pass "));
    let longest = table.clone().map(|line| line.chars().count()).max();
    assert!(longest.is_some_and(|longest| longest <= 140), "{longest:?}:\n{text}");
    assert!(table.clone().next().is_some_and(|heading| heading.contains("error") && heading.contains("outcome")));
}

#[test]
fn inspect_says_how_many_rules_it_checked() {
    let json = raykiln(["inspect", sample("materials").to_str().unwrap(), "--json"]).json();
    let checked = json["rules_checked"].as_array().expect("rules").len();
    let text = raykiln(["inspect", sample("materials").to_str().unwrap()]).stdout;
    if json["findings"].as_array().is_some_and(Vec::is_empty) {
        assert!(text.contains(&format!("none of the {checked} vendor rules checked is broken")), "{text}");
    } else {
        assert!(text.contains("findings"), "{text}");
    }
    let documented = include_str!("../../docs/inspect.md");
    for rule in json["rules_checked"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        assert!(documented.contains(&format!("\n| {rule} | ")), "{rule}");
    }
}

#[test]
fn bakes_with_overlap_tell_what_each_round_did() {
    let rounds = |more: &[&str]| report_of("overlapping", more)["overlap_rounds"].clone();
    let improved = rounds(&["--method", "overlap"]);
    let list = improved["list"].as_array().expect("rounds");
    let taken = improved["taken"].as_u64().expect("a round") as usize;
    assert!(list.len() > 1 && taken > 0, "{improved}");
    assert!(list[taken]["overlap_ratio"].as_f64() < list[0]["overlap_ratio"].as_f64());
    assert!(list.iter().all(|round| round["two_level_cost"].as_f64() >= round["sah_cost"].as_f64()));
    let sum: u64 = list[..=taken].iter().filter_map(|round| round["splits"].as_u64()).sum();
    assert_eq!(improved["splits"], sum);
    let literal = rounds(&["--method", "overlap", "--overlap-rule", "thesis"]);
    assert_eq!(literal["taken"], literal["list"].as_array().expect("rounds").len() - 1);
    assert!(rounds(&["--method", "single"]).is_null());
    assert!(text_of("overlapping", &["--method", "overlap", "-v"]).contains("\nrounds: "));
}
