//! Outputs of other tools that show the same as their input are verified as the same.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Ran, bake, raykiln, samples};
use tempfile::TempDir;

/// An operation of another tool, and how far it moves corners, over the scene's diagonal.
const OPERATIONS: [(&str, &str); 7] = [
    ("blender", "1e-6"),
    ("dedup", "1e-6"),
    ("flatten", "1e-6"),
    ("join", "1e-6"),
    ("quantize", "1e-4"),
    ("gltfpack", "1e-4"),
    ("gltfpack-noq", "1e-6"),
];

/// Rewrites a file with another tool; panics if Node.js or the tool is missing.
fn rewritten(operation: &str, input: &Path, folder: &Path) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let output = folder.join(operation).with_extension("glb");
    let ran = Command::new("node")
        .arg(root.join("tests/peers.mjs"))
        .arg(root.join("target/npm"))
        .arg(operation)
        .args([input, &output])
        .output()
        .expect("node is installed; tests/all.sh does that");
    assert!(ran.status.success(), "{operation}: {}", String::from_utf8_lossy(&ran.stderr));
    output
}

fn verify(before: &Path, after: &Path, ratio: &str) -> Ran {
    let [before, after] = [before, after].map(|path| path.to_str().expect("UTF-8"));
    let fixed = ["--device", "cpu", "--rays", "500", "--repeats", "1", "--json"];
    raykiln(["verify", before, after, "--max-position-error-ratio", ratio].iter().chain(&fixed))
}

fn gltf_samples() -> impl Iterator<Item = crate::common::Sample> {
    samples().into_iter().filter(|s| s.scene.extension().is_some_and(|e| e != "obj"))
}

/// What an operation really loses of a sample: all tools drop an extension that they do not know. gltfpack turns the
/// carousel, whose keys are half a turn apart, the other way, and its grid is as coarse as the sky dome is large.
fn loss(sample: &str, operation: &str) -> Option<&'static str> {
    match (sample, operation) {
        ("hierarchy", _) => Some("ACME_spin"),
        ("findings", "gltfpack") => Some("triangles missing"),
        ("animated", "gltfpack" | "gltfpack-noq") => Some("animation-keys: carousel.rotation"),
        _ => None,
    }
}

/// Operations on outputs: how far they move corners, and whether they keep the layout.
const ON_OUTPUTS: [(&str, &str, bool); 9] = [
    ("copy", "1e-6", true),
    ("dedup", "1e-6", true),
    ("prune", "1e-6", true),
    ("instance", "1e-6", true),
    ("quantize", "1e-4", true),
    ("meshopt", "1e-4", true),
    ("gltfpack-keep", "1e-6", true),
    ("join", "1e-6", false),
    ("gltfpack-noq", "1e-6", false),
];

/// Samples, and methods that make several groups of them.
const BAKED: [(&str, &str); 3] = [("overlapping", "cluster"), ("instanced", "per-object"), ("scattered", "bvh")];

#[test]
fn outputs_are_verified_after_other_tools_which_keep_the_layout_or_undo_it() {
    let folder = TempDir::new().expect("a temporary folder");
    let mut undone = 0;
    for (name, method) in BAKED {
        let sample = samples().into_iter().find(|sample| sample.name == name).expect("the sample is there").scene;
        let output = folder.path().join(name).with_extension("glb");
        bake(&sample, &output, &["--method", method]);
        for (operation, ratio, keeps) in ON_OUTPUTS {
            let after = rewritten(operation, &output, folder.path());
            let ran = verify(&sample, &after, ratio);
            assert_eq!(ran.status, 0, "{name} {operation}: {}", ran.stderr);
            let report = ran.json();
            let notes = report["notes"].as_array().expect("notes").iter().filter_map(|note| note.as_str());
            let about_record: Vec<&str> = notes.filter(|note| note.contains("record")).collect();
            let is_stale = about_record.iter().all(|note| note.contains("stale"));
            assert!(about_record.len() <= 1 && is_stale, "{name} {operation}: {about_record:?}");
            let [before, after] = [&output, &after].map(|path| path.to_str().expect("UTF-8"));
            let fixed =
                ["--layout", "--device", "cpu", "--rays", "500", "--repeats", "1", "--max-position-error-ratio"];
            let ran = raykiln(["verify", before, after].iter().chain(&fixed).chain(&[ratio]));
            let is_another = ran.stderr.contains("the layout is another");
            assert_eq!(ran.status != 0, is_another, "{name} {operation}: {}", ran.stderr);
            assert!(!keeps || !is_another, "{name} {operation}: {}", ran.stderr);
            undone += u32::from(is_another);
        }
    }
    assert!(undone > 0, "a tool that joins meshes is found out");
}

#[test]
fn what_other_tools_leave_the_same_is_the_same() {
    for sample in gltf_samples() {
        let folder = TempDir::new().expect("a temporary folder");
        for (operation, ratio) in OPERATIONS {
            let output = rewritten(operation, &sample.scene, folder.path());
            let ran = verify(&sample.scene, &output, ratio);
            if let Some(loss) = loss(&sample.name, operation) {
                assert_eq!(ran.status, 1, "{} {operation} is a loss", sample.name);
                assert!(ran.stderr.contains(loss), "{} {operation}: {}", sample.name, ran.stderr);
                continue;
            }
            assert_eq!(ran.status, 0, "{} {operation}: {}", sample.name, ran.stderr);
            assert_eq!(ran.json()["matched_by"], "place");
        }
    }
}
