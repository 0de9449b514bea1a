//! Stiff and extreme scenes: every method ends as each case states. `RAYKILN_WRITE_DOCS=1` remakes `docs/extreme.md`.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::Command;

use raykiln::lab::extreme::{self, BOUND, Case, Outcome};
use serde_json::Value;
use tempfile::TempDir;

use crate::common::{Ran, folder_names, methods, raykiln};

const FEW_RAYS: [&str; 8] = ["--json", "--quiet", "--device", "cpu", "--rays", "200", "--repeats", "1"];

/// Bakes a file with a method.
fn bake(input: &Path, output: &Path, method: &str) -> Ran {
    let paths = ["bake", input.to_str().expect("UTF-8"), "-o", output.to_str().expect("UTF-8"), "--method", method];
    raykiln(paths.iter().chain(&FEW_RAYS))
}

/// Verifies an output from the files alone.
fn verify(input: &Path, output: &Path) -> Ran {
    let paths = ["verify", input.to_str().expect("UTF-8"), output.to_str().expect("UTF-8")];
    raykiln(paths.iter().chain(&FEW_RAYS))
}

/// The methods to bake a file with: all and `auto`, but one for files so large that these would take long.
fn methods_for(input: &Path) -> Vec<&'static str> {
    let is_large = fs::metadata(input).expect("a file").len() > 1 << 20;
    if is_large { vec!["cluster"] } else { methods().into_iter().chain(["auto"]).collect() }
}

/// Checks one case with all methods and `auto`. Outputs of equal bytes are verified once.
fn check(case: &Case) {
    let folder = TempDir::new().unwrap();
    let input = folder.path().join("in.glb");
    case.write(&input, 1).expect("a temporary folder is writable");
    let mut verified = BTreeSet::new();
    for method in methods_for(&input) {
        let output = folder.path().join("out.glb");
        let at = format!("{} with {method}", case.name);
        let ran = bake(&input, &output, method);
        if let Outcome::Refused(message) = case.outcome {
            assert_eq!(ran.status, 2, "{at}: {}", ran.stderr);
            assert!(ran.stderr.starts_with("error: ") && ran.stderr.lines().count() == 1, "{at}: {}", ran.stderr);
            assert!(ran.stderr.contains("in.glb: ") && ran.stderr.contains(message), "{at}: {}", ran.stderr);
            assert_eq!(folder_names(folder.path()), ["in.glb"], "{at}");
            continue;
        }
        assert_eq!(ran.status, 0, "{at}: {}", ran.stderr);
        assert_outcome(case.outcome, &ran.json(), &at);
        if verified.insert(fs::read(&output).expect("an output")) {
            let ran = verify(&input, &output);
            assert_from_files(&ran, &at);
        }
        fs::remove_file(&output).expect("an output");
        assert_eq!(folder_names(folder.path()), ["in.glb"], "{at}");
    }
    assert!(verified.is_empty() == matches!(case.outcome, Outcome::Refused(_)), "{}", case.name);
}

/// The largest error of a position over the size of the scene.
fn error(report: &Value) -> f64 {
    report["verify"]["position_error_ratio"].as_f64().expect("a number")
}

/// Checks what `verify` says: all triangles are compared by place, whatever rays can tell.
fn assert_from_files(ran: &Ran, at: &str) {
    assert_eq!(ran.status, 0, "verify {at}: {}", ran.stderr);
    let report = ran.json();
    assert!(error(&report) <= BOUND, "verify {at}: {}", error(&report));
}

fn assert_outcome(outcome: Outcome, report: &Value, at: &str) {
    let warnings = report["warnings"].as_array().expect("warnings");
    let warns = |message: &str| warnings.iter().any(|w| w.as_str().is_some_and(|w| w.contains(message)));
    let hits = report["verify"]["hits"].as_u64().expect("a number");
    match outcome {
        Outcome::Exact => assert_eq!(error(report), 0.0, "{at}"),
        Outcome::Bounded | Outcome::CannotTell => assert!(error(report) <= BOUND, "{at}: {}", error(report)),
        Outcome::Dropped(message) => assert!(warns(message), "{at}: {warnings:?}"),
        _ => panic!("{at}: {outcome:?} is not an outcome of a bake that ends well"),
    }
    assert!(hits > 0 || outcome == Outcome::CannotTell, "{at}: no ray hits anything");
    assert!(matches!(outcome, Outcome::Dropped(_)) || warnings.is_empty(), "{at}: {warnings:?}");
}

/// Checks the cases of a group, every `of`-th from `part` on.
fn check_group(name: &str, part: usize, of: usize) {
    let (_, cases) = extreme::GROUPS.into_iter().find(|(group, _)| *group == name).expect("a group");
    let small = cases.iter().filter(|case| !case.large);
    small.skip(part).step_by(of).for_each(check);
}

#[test]
fn extreme_coordinates_end_as_stated() {
    check_group("Coordinates", 0, 1);
}

#[test]
fn extreme_triangles_end_as_stated() {
    check_group("Triangles", 0, 1);
}

#[test]
fn extreme_transforms_end_as_stated() {
    check_group("Transforms", 0, 1);
}

#[test]
fn extreme_structures_end_as_stated() {
    check_group("Structure", 0, 1);
}

#[test]
fn extreme_values_end_as_stated() {
    check_group("Values", 0, 1);
}

/// Runs a command with 2 GB of address space; returns the status and what it printed to standard error.
#[cfg(target_os = "linux")]
fn within_two_gigabytes(arguments: &[&str]) -> (Option<i32>, String) {
    let command = "ulimit -v 2000000 && exec \"$0\" \"$@\"";
    let ran = Command::new("sh").args(["-c", command, env!("CARGO_BIN_EXE_raykiln")]).args(arguments).output();
    let ran = ran.expect("a shell");
    (ran.status.code(), String::from_utf8_lossy(&ran.stderr).into_owned())
}

#[cfg(target_os = "linux")]
#[test]
fn small_files_take_at_most_two_gigabytes_whatever_they_say() {
    let folder = TempDir::new().unwrap();
    let mut small = 0;
    for case in
        extreme::cases().filter(|case| case.name.ends_with("-from-a-small-file") || case.name.contains("shared"))
    {
        let input = folder.path().join("in.glb");
        case.write(&input, 1).expect("a temporary folder is writable");
        assert!(fs::metadata(&input).expect("a file").len() < 2 << 20, "{} is small", case.name);
        let output = folder.path().join("out.glb");
        let paths = ["bake", input.to_str().unwrap(), "-o", output.to_str().unwrap(), "--method", "keep"];
        let (status, words) = within_two_gigabytes(&[&paths[..], &FEW_RAYS[1..]].concat());
        let refused = matches!(case.outcome, Outcome::Refused(_));
        assert_eq!(status, Some(if refused { 2 } else { 0 }), "{}: {words}", case.name);
        assert!(!words.contains("out of memory"), "{}: {words}", case.name);
        small += 1;
    }
    assert!(small >= 4, "{small} cases");
}

#[test]
fn the_command_writes_every_case_and_a_list() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("cases");
    let ran = raykiln(["lab", "generate", "extreme", "--out", out.to_str().unwrap(), "--seed", "7"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert_eq!(folder_names(folder.path()), ["cases"]);
    let list: Value = serde_json::from_slice(&fs::read(out.join("cases.json")).unwrap()).expect("JSON");
    let list = list.as_array().expect("a list");
    let small: Vec<&Case> = extreme::cases().filter(|case| !case.large).collect();
    assert_eq!(list.len(), small.len());
    for (listed, case) in list.iter().zip(&small) {
        assert_eq!((listed["name"].as_str(), listed["what"].as_str()), (Some(case.name), Some(case.what)));
        assert!(listed["outcome"].is_string(), "{listed}");
        let written = fs::read(out.join(listed["file"].as_str().expect("a name"))).expect("a file");
        let again = folder.path().join("again.glb");
        case.write(&again, 7).unwrap();
        assert!(written == fs::read(&again).unwrap(), "{} is the same for the same seed", case.name);
    }
    assert_eq!(folder_names(&out).len(), small.len() + 1);
}

/// The place of the last node of the deep chain in exact arithmetic, on the axis along which all nodes move: JSON gives
/// 0.001, which is read as the nearest 64-bit float.
fn exact_end(nodes: u64) -> f64 {
    // The float is 0.001 * 2^62 / 2^62 with an integer numerator of 53 bits, so that the product fits into 128 bits.
    let step = (0.001_f64 * 2_f64.powi(62)) as u128;
    (step * u128::from(nodes)) as f64 / 2_f64.powi(62)
}

#[test]
fn the_end_of_a_deep_chain_is_within_2e_12_of_exact_arithmetic() {
    let folder = TempDir::new().unwrap();
    let input = folder.path().join("in.glb");
    let chain = extreme::cases().find(|case| case.name == "deep-chain").expect("the case");
    chain.write(&input, 1).unwrap();
    let document = raykiln_formats::read(&input).expect("sound");
    let (scene, _) = raykiln::scene::load(&document, &Default::default()).expect("sound");
    let end = scene.instances.last().expect("an instance");
    assert_eq!(end.node, 99_999);
    let exact = exact_end(100_000);
    let along = end.transform.translation.z;
    let error = (along - exact).abs() / exact;
    println!("the end is at {along}, exactly {exact}: relative error {error:e}");
    assert!(error > 0.0 && error < 2e-12, "{error:e}");
    // Each fourth quarter turn is none; the turns of 100,000 nodes add up to none.
    let turned = (end.transform.matrix3 - glam::DMat3::IDENTITY).to_cols_array().into_iter().map(f64::abs);
    assert!(turned.fold(0.0, f64::max) < 1e-10);
}

/// The outcome of a case in words.
fn words(outcome: Outcome) -> String {
    match outcome {
        Outcome::Exact => "exact".into(),
        Outcome::Bounded => "within the bound".into(),
        Outcome::Refused(message) => format!("refused: `{message}`"),
        Outcome::Dropped(message) => format!("dropped and counted: `{message}`"),
        Outcome::CannotTell => "within the bound by triangles; rays cannot tell".into(),
        other => panic!("{other:?} has no words"),
    }
}

/// The page of all cases.
fn page() -> String {
    let mut text = String::from(include_str!("extreme_head.md"));
    for (group, cases) in extreme::GROUPS {
        let _ = write!(text, "\n## {group}\n\n| case | what is extreme | outcome |\n| --- | --- | --- |\n");
        for case in cases {
            let name = if case.large { format!("`{}` (large)", case.name) } else { format!("`{}`", case.name) };
            let _ = writeln!(text, "| {name} | {} | {} |", case.what, words(case.outcome));
        }
    }
    text
}

#[test]
fn the_page_lists_every_case_with_its_outcome() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/extreme.md");
    if std::env::var_os("RAYKILN_WRITE_DOCS").is_some_and(|write| write == "1") {
        fs::write(&path, page()).expect("docs can be written to");
    }
    let committed = fs::read_to_string(&path).expect("docs/extreme.md");
    assert!(
        committed == page(),
        "RAYKILN_WRITE_DOCS=1 cargo test --test program the_page_lists remakes docs/extreme.md"
    );
}
