//! The same input yields the same bytes for any number of threads.

use crate::common::{bake, methods, samples};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// All bytes of a bake's output files, by file name.
fn output(scene: &Path, method: &str, name: &str, threads: &str) -> Vec<(String, Vec<u8>)> {
    let folder = TempDir::new().expect("a temporary folder");
    bake(scene, &folder.path().join(name), &["--method", method, "--threads", threads]);
    let names = crate::common::folder_names(folder.path());
    names.into_iter().map(|n| (n.clone(), fs::read(folder.path().join(n)).expect("readable"))).collect()
}

#[test]
fn bytes_are_equal_for_any_number_of_threads_and_in_every_run() {
    for sample in samples() {
        for method in methods() {
            let one = output(&sample.scene, method, "out.glb", "1");
            for threads in ["1", "2", "5"] {
                assert!(one == output(&sample.scene, method, "out.glb", threads), "{} {method} {threads}", sample.name);
            }
        }
    }
}

#[test]
fn speeds_on_the_cpu_are_equal_for_any_number_of_threads_and_in_every_run() {
    let sample = samples().into_iter().find(|sample| sample.name == "overlapping").expect("the sample is there");
    let folder = TempDir::new().expect("a temporary folder");
    let speeds = |threads: &str| {
        let more = ["--method", "single", "--threads", threads];
        let report = bake(&sample.scene, &folder.path().join("out.glb"), &more);
        ["overall", "verdict"]
            .map(|key| report[key].clone())
            .into_iter()
            .chain([report["verify"]["kinds"].clone()])
            .chain([report["verify"]["views"].clone()])
            .collect::<Vec<_>>()
    };
    let one = speeds("1");
    assert!(one[0]["speedup_ratio"].as_f64().is_some_and(|ratio| ratio > 0.0 && ratio != 1.0), "{one:?}");
    for threads in ["1", "2", "5"] {
        assert_eq!(one, speeds(threads));
    }
}

#[test]
fn bytes_of_separate_buffers_are_equal_too() {
    for sample in samples() {
        let [one, two] = ["1", "2"].map(|threads| output(&sample.scene, "overlap", "out.gltf", threads));
        assert!(one == two, "{}", sample.name);
    }
}
