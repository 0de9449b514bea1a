//! `batch`: many assets, some of them bad; what a second run does; what a killed run leaves; budgets; shards.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use crate::common::schema::assert_conforms;
use crate::common::{Ran, folder_names, gltf, raykiln, samples, write};
use serde_json::Value;
use tempfile::TempDir;

const FEW_RAYS: [&str; 9] = ["--quiet", "--device", "cpu", "--rays", "100", "--repeats", "1", "--views", "2"];

/// A folder `assets` with `count` small scenes in two folders, all different.
fn assets(count: usize) -> TempDir {
    let folder = TempDir::new().expect("a folder");
    fs::create_dir_all(folder.path().join("assets/in")).expect("created");
    for i in 0..count {
        let name = if i % 2 == 0 { format!("assets/{i}.glb") } else { format!("assets/in/{i}.glb") };
        let corners = [[0.0, 0.0, 0.0], [1.0 + i as f32, 0.0, 0.0], [0.0, 1.0, 0.0]];
        write(folder.path(), &name, gltf(corners, [0, 1, 2], |_| ()));
    }
    folder
}

/// Runs a batch in a folder.
fn batch(folder: &Path, more: &[&str]) -> Ran {
    let output = Command::new(env!("CARGO_BIN_EXE_raykiln"))
        .current_dir(folder)
        .arg("batch")
        .args(FEW_RAYS.iter().chain(more))
        .output()
        .expect("the program starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    Ran { status: output.status.code().unwrap_or(-1), stdout: text(output.stdout), stderr: text(output.stderr) }
}

const GLOB: [&str; 3] = ["assets/**/*.glb", "--out", "baked"];

fn summary(folder: &Path) -> Value {
    let text = fs::read_to_string(folder.join("baked/summary.json")).expect("there is a summary");
    let summary = serde_json::from_str(&text).expect("JSON");
    assert_conforms(&summary);
    summary
}

/// The numbers of assets that were baked, cached, unchanged, failed and missing.
fn counts(summary: &Value) -> [u64; 5] {
    ["baked", "cached", "unchanged", "failed", "missing"]
        .map(|status| summary["counts"][status].as_u64().expect(status))
}

/// All visible files below a folder with their bytes, but for the summary.
fn outputs(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all = Vec::new();
    for name in folder_names(folder).into_iter().filter(|name| name != ".raykiln" && !name.starts_with("summary.")) {
        let path = folder.join(&name);
        match path.is_dir() {
            true => all.extend(outputs(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes))),
            false => all.push((name, fs::read(path).expect("readable"))),
        }
    }
    all
}

#[test]
fn folders_are_mirrored_and_one_bad_asset_stops_nothing() {
    let folder = assets(3);
    write(folder.path(), "assets/in/bad.glb", "glTF but no more");
    let events = ["--events", "events.jsonl", "--report", "json", "--cache", "cache", "--jobs", "2"];
    let ran = batch(folder.path(), &[&GLOB[..], &events].concat());
    assert_eq!((ran.status, ran.stdout.as_str()), (1, ""), "{}", ran.stderr);
    assert!(ran.stderr.contains("1 of 4 assets"), "{}", ran.stderr);
    let summary = summary(folder.path());
    assert_eq!(counts(&summary), [3, 0, 0, 1, 0]);
    let bad = &summary["assets"][3];
    assert_eq!((bad["asset"].as_str(), bad["status"].as_str()), (Some("in/bad.glb"), Some("failed")));
    assert!(bad["reason"].as_str().expect("a reason").contains("bad.glb"), "{bad}");
    let names: Vec<String> = outputs(&folder.path().join("baked")).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["0.glb", "0.glb.report.json", "2.glb", "2.glb.report.json", "in/1.glb", "in/1.glb.report.json"]);
    let page = fs::read_to_string(folder.path().join("baked/summary.html")).expect("there is a page");
    assert!(page.contains("1 of 4 assets failed") && page.contains("./in/1.glb"));
    let lines = fs::read_to_string(folder.path().join("events.jsonl")).expect("there are events");
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    lines.iter().for_each(assert_conforms);
    let of = |event: &str| lines.iter().filter(|line| line["event"] == event).count();
    assert_eq!(["begin", "start", "done", "end"].map(of), [1, 4, 4, 1]);
    assert_eq!(batch(folder.path(), &[&GLOB[..], &["--cache", "cache", "--fail-on", "never"]].concat()).status, 0);
}

#[test]
fn a_second_run_bakes_only_what_changed() {
    let folder = assets(4);
    let run = |more: &[&str]| {
        let ran = batch(folder.path(), &[&GLOB[..], &["--cache", "cache", "--json"], more].concat());
        assert_eq!(ran.status, 0, "{}", ran.stderr);
        counts(&ran.json())
    };
    assert_eq!(run(&[]), [4, 0, 0, 0, 0]);
    let first = outputs(&folder.path().join("baked"));
    assert_eq!(run(&["--threads", "1", "--jobs", "1"]), [0, 0, 4, 0, 0]);
    fs::remove_file(folder.path().join("baked/0.glb")).expect("removed");
    write(folder.path(), "baked/2.glb", "damaged");
    assert_eq!(run(&[]), [0, 2, 2, 0, 0]);
    assert!(outputs(&folder.path().join("baked")) == first);
    let glb = gltf([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]], [0, 1, 2], |_| ());
    write(folder.path(), "assets/2.glb", glb);
    assert_eq!(run(&[]), [1, 0, 3, 0, 0]);
    assert_eq!(run(&["--seed", "3"]), [4, 0, 0, 0, 0]);
    fs::remove_dir_all(folder.path().join("baked")).expect("removed");
    assert_eq!(run(&["--seed", "3"]), [0, 4, 0, 0, 0]);
}

#[test]
fn rules_of_a_manifest_say_how_and_where_to_bake() {
    let folder = assets(3);
    fs::copy(
        samples().into_iter().find(|s| s.name == "overlapping").expect("there").scene,
        folder.path().join("assets/many.glb"),
    )
    .expect("copied");
    write(
        folder.path(),
        "raykiln.toml",
        "inputs = [\"assets/**/*.glb\"]\nout = \"baked\"\n\
         [[rule]]\nglob = \"**\"\noptions = { method = \"keep\", seed = 5 }\nmax-output-bytes = \"2kB\"\n\
         [[rule]]\nglob = \"in/*\"\noutput = \"{stem}-{folder}.gltf\"\n\
         [[rule]]\nglob = \"2.glb\"\nskip = true\n",
    );
    let ran = batch(folder.path(), &["--json"]);
    assert_eq!(ran.status, 1, "{}", ran.stderr);
    let summary = ran.json();
    assert_eq!((counts(&summary), summary["over_budget"].as_u64()), ([3, 0, 0, 0, 0], Some(1)));
    assert!(summary["assets"].as_array().expect("rows").iter().all(|row| row["method"] == "keep"));
    assert!(ran.stderr.contains("--fail-on"), "{}", ran.stderr);
    let names: Vec<String> = outputs(&folder.path().join("baked")).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["0.glb", "1-in.bin", "1-in.gltf", "many.glb"]);
    assert_eq!(counts(&batch(folder.path(), &["--json", "--fail-on", "slower"]).json()), [0, 0, 3, 0, 0]);
}

#[test]
fn bad_usage_is_refused_before_anything_is_baked() {
    let folder = assets(1);
    write(folder.path(), "assets/0.obj", "f 1 2 3");
    let manifests = [
        ("bad.toml", "[[rule]]\nglob = \"**\"\noptions = { magic = 1 }", "--magic"),
        ("value.toml", "[[rule]]\nglob = \"**\"\noptions = { method = \"magic\" }", "magic"),
        ("applies.toml", "[[rule]]\nglob = \"**\"\noptions = { method = \"keep\", entry-cost = 3 }", "--entry-cost"),
        ("outside.toml", "[[rule]]\nglob = \"**\"\noutput = \"../x.glb\"", "not a name below"),
        ("form.toml", "rules = 3", "rules"),
    ];
    for (name, text, words) in manifests {
        write(folder.path(), name, text);
        let ran = batch(folder.path(), &[&GLOB[..], &["--manifest", name]].concat());
        assert_eq!(ran.status, 2, "{name}: {}", ran.stderr);
        assert!(ran.stderr.contains(words), "{words} is missing in {}", ran.stderr);
    }
    for (arguments, words) in [
        (&["none/*.glb", "--out", "baked"][..], "no file"),
        (&["assets/*", "--out", "baked"], "same output"),
        (&["assets/*.glb", "--out", "assets"], "replace an asset"),
        (&["assets/*.glb"], "--out"),
        (&["--out", "baked"], "raykiln.toml"),
        (&["assets/*.glb", "--out", "baked", "--shard", "3/2"], "K/N"),
        (&["assets/*.glb", "--out", "baked", "--fail-on", "often"], "slower"),
        (&["assets/*.glb", "--out", "baked", "--root", "baked"], "--root"),
    ] {
        let ran = batch(folder.path(), arguments);
        assert_eq!(ran.status, 2, "{arguments:?}: {}", ran.stderr);
        assert!(ran.stderr.contains(words), "{words} is missing in {}", ran.stderr);
    }
    assert!(outputs(&folder.path().join("assets")).iter().all(|(name, _)| name.starts_with("0.")));
}

#[test]
fn shards_bake_everything_once_and_are_collected() {
    let folder = assets(5);
    let run = |more: &[&str]| batch(folder.path(), &[&GLOB[..], more].concat());
    let first: [u64; 5] = counts(&run(&["--shard", "1/2", "--json"]).json());
    assert!(!folder.path().join("baked/summary.json").exists());
    let ran = run(&["--collect"]);
    assert_eq!((ran.status, counts(&summary(folder.path()))[4]), (1, 5 - first[0]), "{}", ran.stderr);
    let second = counts(&run(&["--shard", "2/2", "--json"]).json());
    assert_eq!(first[0] + second[0], 5);
    assert_eq!((run(&["--collect"]).status, counts(&summary(folder.path()))), (0, [0, 0, 5, 0, 0]));
}

#[test]
fn lists_name_assets_too() {
    let folder = assets(2);
    write(folder.path(), "list.txt", "assets/0.glb\n\nassets/in/1.glb\n");
    let ran = batch(folder.path(), &["--list", "list.txt", "--root", "assets", "--out", "baked"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let names: Vec<String> = outputs(&folder.path().join("baked")).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["0.glb", "in/1.glb"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_bake_beyond_its_budget_is_ended_and_leaves_nothing() {
    let folder = assets(2);
    let rules = "[[rule]]\nglob = \"in/*\"\nmax-memory = \"1MB\"\n[[rule]]\nglob = \"0.glb\"\nmax-seconds = 1e-3\n";
    write(folder.path(), "rules.toml", rules);
    let more = ["--manifest", "rules.toml", "--rays", "1000000", "--json"];
    let ran = raykiln_in(folder.path(), &more);
    assert_eq!(ran.status, 1, "{}", ran.stderr);
    let reasons = ran.json();
    let reason = |i: usize| reasons["assets"][i]["reason"].as_str().expect("a reason").to_owned();
    assert!(reason(0).contains("max-seconds") && reason(1).contains("max-memory"), "{reasons}");
    assert!(outputs(&folder.path().join("baked")).is_empty());
    assert_eq!(folder_names(&folder.path().join("baked")), [".raykiln", "in", "summary.html", "summary.json"]);
    assert_eq!(folder_names(&folder.path().join("baked/in")), [""; 0]);
}

/// Runs a batch with as many rays as `more` says.
fn raykiln_in(folder: &Path, more: &[&str]) -> Ran {
    let patterns = GLOB.map(|word| match word {
        "assets/**/*.glb" => folder.join(word).display().to_string(),
        "baked" => folder.join(word).display().to_string(),
        word => word.to_owned(),
    });
    let manifest = more.iter().map(|word| match word.ends_with(".toml") {
        true => folder.join(word).display().to_string(),
        false => (*word).to_owned(),
    });
    let fixed = ["batch", "--quiet", "--device", "cpu"].map(str::to_owned);
    raykiln(fixed.into_iter().chain(patterns).chain(manifest))
}

#[test]
fn memory_is_divided_among_bakes() {
    let folder = assets(3);
    // Less than two bakes are predicted to take: one runs at a time.
    let ran = batch(folder.path(), &[&GLOB[..], &["--max-memory", "300MiB", "--jobs", "3", "--json"]].concat());
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let summary = ran.json();
    if cfg!(target_os = "linux") {
        assert!(summary["peak_memory_bytes"].as_u64().is_some_and(|peak| peak < 300 << 20), "{summary}");
    }
    let ran = batch(folder.path(), &["assets/**/*.glb", "--out", "other", "--max-memory", "1MiB", "--json"]);
    if cfg!(target_os = "linux") {
        assert_eq!((ran.status, counts(&ran.json())[3]), (1, 3), "{}", ran.stderr);
    }
}

/// Kills and interrupts a batch at random instants, the same ones in each run of the test; the next run goes on. What was in
/// flight is baked again, and nothing else.
#[cfg(unix)]
#[test]
fn a_batch_that_is_ended_at_random_instants_goes_on_where_it_was() {
    let folder = assets(6);
    let mut random = fastrand::Rng::with_seed(16);
    let rounds = 8;
    for round in 0..rounds {
        let events = format!("events-{round}.jsonl");
        let mut child = Command::new(env!("CARGO_BIN_EXE_raykiln"))
            .current_dir(folder.path())
            .arg("batch")
            .args(FEW_RAYS.iter().chain(&GLOB).chain(&["--cache", "cache", "--jobs", "1", "--events", &events]))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        thread::sleep(Duration::from_millis(random.u64(0..600)));
        match random.bool() {
            true => child.kill().expect("it is killed or has ended"),
            false => {
                let interrupt = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
                interrupt.expect("there is the command `kill`");
            }
        }
        child.wait().expect("it ends");
    }
    let ran =
        batch(folder.path(), &[&GLOB[..], &["--cache", "cache", "--json", "--events", "events-last.jsonl"]].concat());
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let [begun, ended, most] = bakes(folder.path());
    assert!(begun <= 6 + rounds && most == 1, "{begun} bakes begun, {ended} ended, up to {most} of one asset");
    let baked = outputs(&folder.path().join("baked"));
    let visible = |all: &[(String, Vec<u8>)]| all.iter().filter(|(name, _)| !name.contains(".raykiln-")).count();
    assert_eq!(visible(&baked), 6);
    let whole = batch(folder.path(), &["assets/**/*.glb", "--out", "whole"]);
    assert_eq!(whole.status, 0, "{}", whole.stderr);
    assert!(outputs(&folder.path().join("whole")).iter().all(|output| baked.contains(output)));
}

/// By the events of all runs: the number of bakes that began, the number that ended, and the most of one asset that ended.
#[cfg(unix)]
fn bakes(folder: &Path) -> [usize; 3] {
    let (mut begun, mut ended) = (0, std::collections::BTreeMap::<String, usize>::new());
    for name in folder_names(folder).iter().filter(|name| name.starts_with("events-")) {
        let text = fs::read_to_string(folder.join(name)).expect("readable");
        // The last line may be cut off.
        for event in text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok()) {
            begun += usize::from(event["event"] == "start");
            if event["row"]["status"] == "baked" {
                *ended.entry(event["row"]["asset"].as_str().expect("a name").to_owned()).or_default() += 1;
            }
        }
    }
    [begun, ended.values().sum(), ended.values().copied().max().unwrap_or(0)]
}
