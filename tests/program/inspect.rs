//! What `inspect` finds, how it is written, and when it fails.

use crate::common::{Ran, bake, raykiln, samples};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

/// Inspects a sample.
fn inspect(name: &str, more: &[&str]) -> Ran {
    let input = sample(name);
    raykiln(["inspect", input.to_str().expect("UTF-8")].iter().chain(more))
}

/// The rules of findings, with what each names first and how many objects it is about.
fn summary(report: &Value) -> Vec<(String, String, u64)> {
    let text = |finding: &Value, key: &str| finding[key].as_str().expect("text").to_owned();
    let one = |f: &Value| (text(f, "rule"), text(f, "object"), f["count"].as_u64().expect("a count"));
    report["findings"].as_array().expect("findings").iter().map(one).collect()
}

#[test]
fn each_fault_of_the_sample_is_a_finding_with_its_remedy() {
    let report = inspect("findings", &["--json"]).json();
    let expected = [
        ("RK001", "islands", 2),
        ("RK002", "islands", 1),
        ("RK003", "rock 0", 39),
        ("RK005", "sky", 1),
        ("RK006", "cables", 1),
        ("RK014", "forgotten mark", 1),
    ];
    assert_eq!(summary(&report), expected.map(|(rule, object, count)| (rule.to_owned(), object.to_owned(), count)));
    for finding in report["findings"].as_array().expect("findings") {
        for key in ["message", "by_hand", "by_bake"] {
            assert!(finding[key].as_str().is_some_and(|text| text.len() > 10), "{finding}");
        }
        assert!(finding["cost"]["text"].as_str().is_some_and(|text| text.len() > 10), "{finding}");
    }
    let text = inspect("findings", &[]).stdout;
    assert!(text.contains("RK006 warning (long thin triangles): 300 triangles of 1 mesh"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 140), "{text}");
}

#[test]
fn a_bake_reports_the_findings_about_its_input() {
    let folder = TempDir::new().expect("a temporary folder");
    let report = bake(&sample("findings"), &folder.path().join("out.glb"), &["--method", "single"]);
    let mut findings = report["findings"].as_array().expect("findings").clone();
    let gone = findings.iter_mut().map(|f| {
        let gone = f.as_object_mut().and_then(|f| f.remove("gone_after")).and_then(|gone| gone.as_bool());
        (f["rule"].as_str().expect("an id").to_owned(), gone.expect("true or false"))
    });
    let gone: BTreeMap<String, bool> = gone.collect();
    // Merging ends overlaps and copies, and leaves empty space in the box.
    assert_eq!(["RK001", "RK002", "RK003"].map(|rule| gone.get(rule)), [Some(&true), Some(&false), Some(&true)]);
    assert_eq!(findings, inspect("findings", &["--json"]).json()["findings"].as_array().expect("findings").clone());
}

#[test]
fn fail_on_decides_the_exit_status() {
    let status = |conditions: &[&str]| {
        let more: Vec<&str> = conditions.iter().flat_map(|&condition| ["--fail-on", condition]).collect();
        inspect("findings", &more)
    };
    assert_eq!(status(&[]).status, 0);
    assert_eq!(status(&["error"]).status, 0);
    assert_eq!(status(&["RK016", "error"]).status, 0);
    let failed = status(&["RK014", "rk006"]);
    assert_eq!(failed.status, 1);
    assert!(failed.stderr.contains("breaks RK006, RK014"), "{}", failed.stderr);
    assert!(failed.stdout.contains("RK006"), "{}", failed.stdout);
    assert_eq!(status(&["warning"]).status, 1);
    let unknown = status(&["RK018"]);
    assert_eq!(unknown.status, 2);
    assert!(unknown.stderr.contains("a rule from `RK001` to `RK017`"), "{}", unknown.stderr);
}

/// Asserts that files are valid SARIF 2.1.0; panics if Node.js or the validator is missing.
fn assert_valid_sarif(files: &[PathBuf]) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let modules = root.join("target/npm");
    assert!(
        modules.join("node_modules/ajv-draft-04").is_dir(),
        "the validator is not installed: run tests/all.sh once"
    );
    let script = root.join("tests/validate_sarif.mjs");
    let output = Command::new("node").arg(script).arg(modules).args(files).output().expect("node is installed");
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(output.status.success(), "{text}");
    assert_eq!(text.lines().count(), files.len(), "a line for each file:\n{text}");
}

#[test]
fn findings_are_written_as_valid_sarif() {
    let folder = TempDir::new().expect("a temporary folder");
    let [of_inspect, of_clean, of_bake, of_verify] =
        ["a b.sarif", "clean.SARIF", "bake.sarif", "verify.sarif"].map(|name| folder.path().join(name));
    let path = |file: &PathBuf| file.to_str().expect("UTF-8").to_owned();
    assert_eq!(inspect("findings", &["--report", &path(&of_inspect)]).status, 0);
    assert_eq!(inspect("clean", &["--report", &path(&of_clean)]).status, 0);
    let json = folder.path().join("bake.json");
    let reports = ["--method", "single", "--report", &path(&of_bake), "--report", &path(&json)];
    let output = folder.path().join("out.glb");
    bake(&sample("findings"), &output, &reports);
    assert!(json.is_file());
    let files = [path(&sample("findings")), path(&output)];
    let ran = raykiln(["verify", &files[0], &files[1], "--device", "cpu", "--report", &path(&of_verify)]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let rules = |file: &PathBuf| -> Vec<String> {
        let log: Value = serde_json::from_slice(&std::fs::read(file).expect("a log")).expect("JSON");
        let results = log["runs"][0]["results"].as_array().expect("results");
        results.iter().filter_map(|result| result["ruleId"].as_str()).map(str::to_owned).collect()
    };
    let expected = ["RK001", "RK002", "RK003", "RK005", "RK006", "RK014"];
    assert_eq!([&of_inspect, &of_verify].map(rules), [expected, expected]);
    assert_valid_sarif(&[of_inspect, of_clean, of_bake, of_verify]);
}

#[test]
fn a_comparison_finds_what_a_bake_finds() {
    let folder = TempDir::new().expect("a temporary folder");
    let output = folder.path().join("out.glb");
    let baked = bake(&sample("findings"), &output, &["--method", "single"]);
    let files = [sample("findings"), output].map(|file| file.to_str().expect("UTF-8").to_owned());
    let compared = raykiln(["verify", &files[0], &files[1], "--device", "cpu", "--json"]).json();
    assert_eq!(compared["findings"], baked["findings"]);
    let gone: Vec<bool> =
        compared["findings"].as_array().expect("a list").iter().map(|f| f["gone_after"] == true).collect();
    assert!(gone.contains(&true), "{gone:?}");
}

#[test]
fn the_test_would_notice_invalid_sarif() {
    let folder = TempDir::new().expect("a temporary folder");
    let file = folder.path().join("bad.sarif");
    std::fs::write(&file, r#"{"version": "2.1.0", "runs": [{"tool": {}}]}"#).expect("writable");
    assert!(std::panic::catch_unwind(|| assert_valid_sarif(&[file])).is_err());
}

#[test]
fn of_what_moves_it_says_whether_refitting_will_do() {
    let report = inspect("animated", &["--json"]).json();
    let motion = report["motion"].as_array().expect("a list");
    assert_eq!(motion.len(), 1, "{motion:?}");
    assert_eq!((&motion[0]["moving_instances"], &motion[0]["deforming_instances"]), (&2.into(), &0.into()));
    assert!(motion[0]["tlas"]["cost_over_fresh_ratio"].as_f64() >= Some(1.0), "{}", motion[0]);
    let folder = TempDir::new().expect("a temporary folder");
    let baked = bake(&sample("animated"), &folder.path().join("out.glb"), &["--method", "single"]);
    assert_eq!(baked["motion"], report["motion"]);
    assert!(inspect("animated", &[]).stdout.contains("\nwhat moves\n"));
    assert_eq!(inspect("overlapping", &["--json"]).json()["motion"], serde_json::json!([]));
    assert!(!inspect("overlapping", &[]).stdout.contains("what moves"));
}
