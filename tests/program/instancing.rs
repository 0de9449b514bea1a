//! `--instancing extension`: instances become copies of one node, for all samples and methods.

use crate::common::{bake, folder_names, json_of, methods, samples};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const EXTENSION: [&str; 2] = ["--instancing", "extension"];

fn sample(name: &str) -> std::path::PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

/// All bytes of a bake's output files, by file name.
fn output(scene: &Path, more: &[&str], threads: &str) -> Vec<(String, Vec<u8>)> {
    let folder = TempDir::new().expect("a temporary folder");
    bake(scene, &folder.path().join("out.glb"), &[more, &EXTENSION, &["--threads", threads]].concat());
    let names = folder_names(folder.path());
    names.into_iter().map(|n| (n.clone(), fs::read(folder.path().join(n)).expect("readable"))).collect()
}

#[test]
fn bytes_are_equal_for_one_thread_and_four() {
    for sample in samples() {
        for method in methods() {
            let more = ["--method", method, "--copies", "rigid"];
            assert!(output(&sample.scene, &more, "1") == output(&sample.scene, &more, "4"), "{} {method}", sample.name);
        }
    }
}

#[test]
fn the_report_counts_copies_and_nodes() {
    let folder = TempDir::new().expect("a temporary folder");
    let out = folder.path().join("out.glb");
    let report = bake(&sample("instanced"), &out, &["--method", "keep", "--instancing", "extension"]);
    // The mirrored one keeps its node: no instancing node holds mirrored copies beside plain ones.
    assert_eq!(report["copied"], serde_json::json!({"nodes": 1, "copies": 5, "stay": 0}));
    let note = "5 instances are copies of 1 node: 4 nodes fewer place a mesh";
    assert!(report["notes"].as_array().expect("notes").iter().any(|n| n == note), "{}", report["notes"]);
    assert!(report["passes"].as_array().expect("passes").iter().any(|p| p["reason"] == note && p["applied"] == true));
    assert_eq!(report["verify"]["mismatches"], 0);
    let json = json_of(&out);
    assert_eq!(json["nodes"].as_array().expect("nodes").iter().filter(|n| n["mesh"].is_u64()).count(), 2);
    let nodes = bake(&sample("instanced"), &out, &["--method", "keep"]);
    assert!(nodes.get("copied").is_none() && nodes["verdict"] == "left alone");
}
