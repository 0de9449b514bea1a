//! Plans: a decision that was written down gives the same bytes again.

use crate::common::{Ran, bake, raykiln, samples};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

/// Bakes a sample with a plan; returns the plan's path, the bytes of the output and the report.
fn planned(scene: &Path, folder: &Path, more: &[&str]) -> (PathBuf, Vec<u8>, Value) {
    let (plan, output) = (folder.join("plan.json"), folder.join("first.glb"));
    let plan_text = plan.to_str().expect("UTF-8");
    let report = bake(scene, &output, &[&["--write-plan", plan_text], more].concat());
    (plan.clone(), fs::read(output).expect("written"), report)
}

fn follow(scene: &Path, output: &Path, plan: &Path, more: &[&str]) -> Ran {
    let [scene, output, plan] = [scene, output, plan].map(|path| path.to_str().expect("UTF-8"));
    let fixed = ["bake", scene, "-o", output, "--plan", plan, "--device", "cpu", "--json", "--quiet"];
    raykiln(fixed.iter().chain(more))
}

#[test]
fn a_plan_gives_the_same_bytes() {
    for (name, more) in [
        ("overlapping", &["--method", "overlap", "--skip-overlap-ratio", "0.005", "--overlap-rule", "thesis"][..]),
        ("instanced", &["--method", "auto", "--effort", "4"]),
        ("copies", &["--method", "auto", "--prune", "--keep", "nothing*"]),
        ("clean", &["--method", "auto"]),
        ("hierarchy", &["--method", "keep"]),
    ] {
        let folder = TempDir::new().expect("a folder");
        let (plan, bytes, _) = planned(&sample(name), folder.path(), more);
        let again = folder.path().join("again.glb");
        let ran = follow(&sample(name), &again, &plan, &["--threads", "1"]);
        assert_eq!(ran.status, 0, "{name}: {}", ran.stderr);
        assert!(fs::read(&again).expect("written") == bytes, "{name}");
    }
}

/// As if a device had decided for each of the candidates, one of them refined and along other axes.
#[test]
fn every_candidate_can_be_replayed() {
    let folder = TempDir::new().expect("a folder");
    let scene = sample("overlapping");
    let (plan, _, report) = planned(&scene, folder.path(), &["--method", "auto", "--effort", "3"]);
    let text = fs::read_to_string(&plan).expect("a plan");
    let candidates = report["method"]["candidates"].as_array().expect("candidates");
    let names: Vec<&str> = candidates.iter().filter_map(|candidate| candidate["name"].as_str()).collect();
    assert!(names.len() > 3, "{names:?}");
    for (i, name) in names.into_iter().enumerate() {
        let mut changed: Value = serde_json::from_str(&text).expect("JSON");
        let decision = changed["decision"].as_object_mut().expect("a decision");
        decision.insert("left_alone".into(), false.into());
        decision.insert("plan".into(), name.into());
        if i == 1 {
            decision.insert("axes".into(), 7.into());
        }
        if name.starts_with("cluster") {
            decision.insert("entry_cost".into(), 11.5.into());
        }
        let follow = |plan_file: &Value, more: &[&str]| {
            fs::write(&plan, plan_file.to_string()).expect("written");
            follow(&scene, &folder.path().join("out.glb"), &plan, more)
        };
        changed["output_blake3"] = "unknown".into();
        let other = follow(&changed, &[]);
        // The output of another decision has another hash, which the error tells; the plan with it is followed.
        assert_eq!(other.status, 2, "{name}");
        let found = other.stderr.split("hash is ").nth(1).and_then(|rest| rest.split(',').next()).expect(&other.stderr);
        changed["output_blake3"] = found.into();
        let ran = follow(&changed, &["--threads", "1"]);
        assert_eq!(ran.status, 0, "{name}: {}", ran.stderr);
        let chosen = &ran.json()["method"];
        assert!(chosen["chosen_candidate"].as_str().is_some_and(|chosen| chosen.starts_with(name)), "{chosen}");
        assert_eq!(chosen["decided_by"], "plan");
    }
}

/// As if a device had found that what was chosen is not faster: the copies that it shares are not written.
#[test]
fn an_input_that_was_left_alone_is_left_alone_again() {
    let folder = TempDir::new().expect("a folder");
    let scene = sample("copies");
    let (plan, ..) = planned(&scene, folder.path(), &["--method", "auto"]);
    let mut changed: Value = serde_json::from_str(&fs::read_to_string(&plan).expect("a plan")).expect("JSON");
    let untouched = planned(&scene, folder.path(), &["--method", "keep", "--copies", "off"]).0;
    let untouched: Value = serde_json::from_str(&fs::read_to_string(&untouched).expect("a plan")).expect("JSON");
    assert_eq!(untouched["decision"]["left_alone"], true);
    changed["output_blake3"] = untouched["output_blake3"].clone();
    changed["decision"]["left_alone"] = true.into();
    fs::write(&plan, changed.to_string()).expect("written");
    let ran = follow(&scene, &folder.path().join("out.glb"), &plan, &["--effort", "3"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert_eq!(ran.json()["verdict"], "left alone");
}

#[test]
fn what_differs_from_the_plan_is_said_and_nothing_is_written() {
    let folder = TempDir::new().expect("a folder");
    let (plan, ..) = planned(&sample("overlapping"), folder.path(), &["--method", "auto", "--effort", "2"]);
    let text = fs::read_to_string(&plan).expect("a plan");
    crate::common::schema::assert_conforms(&serde_json::from_str(&text).expect("JSON"));
    let output = folder.path().join("out.glb");
    let refused = |scene: &str, change: &dyn Fn(&str) -> String, more: &[&str]| {
        fs::write(&plan, change(&text)).expect("written");
        let ran = follow(&sample(scene), &output, &plan, more);
        assert_eq!((ran.status, output.exists()), (2, false), "{}", ran.stderr);
        ran.stderr
    };
    let same = |text: &str| text.to_owned();
    let version = format!("\"{}\"", env!("CARGO_PKG_VERSION"));
    for (stderr, words) in [
        (refused("instanced", &same, &[]), "the input differs from that of the plan"),
        (refused("overlapping", &same, &["--effort", "3"]), "--effort is `2` in the plan, but `3` on the command line"),
        (refused("overlapping", &|text| text.replace(&version, "\"0.0.1\""), &[]), "version 0.0.1"),
        (refused("overlapping", &|text| text.replace("\"effort\"", "\"efort\""), &[]), "has an option --efort"),
        (
            refused("overlapping", &|text| text.replace("raykiln.plan/1", "raykiln.bake/1"), &[]),
            "of schema `raykiln.bake/1`",
        ),
        (refused("overlapping", &|_| "{".to_owned(), &[]), "is not JSON"),
    ] {
        assert!(stderr.contains(words) && stderr.contains("--plan"), "{words}: {stderr}");
    }
    fs::write(&plan, &text).expect("written");
    assert_eq!(follow(&sample("overlapping"), &output, &plan, &["--effort", "2"]).status, 0);
}
