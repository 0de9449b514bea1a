//! The record of provenance: where it is written, how large it is, and where it leads over several bakes and edits.

use crate::common::{Ran, Surface, bake, folder_names, json_of, raykiln, samples};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

fn by_identity(before: &Path, after: &Path) -> Ran {
    let [before, after] = [before, after].map(|path| path.to_str().expect("UTF-8"));
    let fixed = ["--match", "identity", "--device", "cpu", "--rays", "200", "--repeats", "1"];
    raykiln(["verify", before, after].iter().chain(&fixed))
}

#[test]
fn a_record_is_in_the_file_beside_it_or_nowhere() {
    let folder = TempDir::new().unwrap();
    let scene = sample("overlapping");
    for (place, names) in [
        ("file", vec!["file.glb"]),
        ("sidecar", vec!["file.glb", "sidecar.glb", "sidecar.glb.record.json"]),
        ("none", vec!["file.glb", "none.glb", "sidecar.glb", "sidecar.glb.record.json"]),
    ] {
        let output = folder.path().join(place).with_extension("glb");
        bake(&scene, &output, &["--method", "single", "--record", place]);
        assert_eq!(folder_names(folder.path()), names);
        let in_file = json_of(&output).pointer("/extras/raykiln/record").is_some();
        assert_eq!(in_file, place == "file");
        if place != "none" {
            Surface::of_input(&scene).assert_shown_by(&Surface::of_output(&output));
        }
        assert_eq!(by_identity(&scene, &output).status, i32::from(place == "none"));
    }
}

#[test]
fn a_bake_of_a_bake_leads_to_the_first_input() {
    for (name, methods) in [
        ("overlapping", ["per-object", "single", "cluster"]),
        ("instanced", ["bvh", "cluster", "single"]),
        ("copies", ["cluster", "bvh", "per-object"]),
        ("hierarchy", ["single", "cluster", "bvh"]),
    ] {
        let folder = TempDir::new().unwrap();
        let scene = sample(name);
        let mut last = scene.clone();
        for (i, method) in methods.into_iter().enumerate() {
            let output = folder.path().join(format!("{i}.glb"));
            bake(&last, &output, &["--method", method, "--copies", "rigid"]);
            if json_of(&output).pointer("/extras/raykiln/record").is_some() {
                Surface::of_input(&scene).assert_shown_by(&Surface::of_output(&output));
                let ran = by_identity(&scene, &output);
                assert_eq!(ran.status, 0, "{name}, {method}: {}", ran.stderr);
                assert_eq!(by_identity(&last, &output).status, 0, "{name}, {method}: from the last input");
            }
            last = output;
        }
    }
}

#[test]
fn nodes_that_an_earlier_bake_added_go_when_they_are_empty() {
    let folder = TempDir::new().unwrap();
    let scene = sample("overlapping");
    let [first, second] = ["first.glb", "second.glb"].map(|name| folder.path().join(name));
    bake(&scene, &first, &["--method", "single"]);
    bake(&first, &second, &["--method", "cluster"]);
    let nodes = |path: &Path| json_of(path)["nodes"].as_array().unwrap().clone();
    let of_input = nodes(&scene).len();
    assert_eq!(nodes(&first).len(), of_input + 1);
    let last = nodes(&second);
    assert!(last[of_input..].iter().all(|node| node["mesh"].is_u64()), "the group of the first bake is gone");
    let record = |node: &serde_json::Value| node["extras"]["raykiln"].clone();
    let ids: Vec<serde_json::Value> = last.iter().map(|node| record(node)["id"].clone()).collect();
    for node in last[..of_input].iter().filter(|node| record(node)["mesh"].is_object()) {
        let moved_to = record(node)["moved_to"].as_array().expect("it is empty").clone();
        assert!(!moved_to.is_empty() && moved_to.iter().all(|id| ids.contains(id)), "{node}");
    }
}

#[test]
fn a_record_takes_few_bytes() {
    for sample in samples() {
        let folder = TempDir::new().unwrap();
        let output = folder.path().join("out.glb");
        for method in ["single", "cluster"] {
            let report = bake(&sample.scene, &output, &["--method", method]);
            let json = json_of(&output);
            let Some(record) = json.pointer("/extras/raykiln/record/origins") else { continue };
            let triangles = report["after"]["triangles_stored"].as_u64().expect("a number") as usize;
            let nodes = json["nodes"].as_array().map_or(0, Vec::len);
            let bytes = record.as_str().expect("a text").len();
            assert!(bytes <= 4 * triangles + 8 * nodes + 64, "{} {method}: {bytes} bytes of {triangles}", sample.name);
        }
        drop(fs::remove_file(&output));
    }
}
