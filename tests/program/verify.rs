//! `raykiln verify` on two files of one scene, whichever program wrote them.

use crate::common::{Opened, Ran, bake, gltf, raykiln, samples, with_record, write};
use raykiln_formats::record::GeometryHash;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

fn verify(before: &Path, after: &Path, more: &[&str]) -> Ran {
    let (before, after) = (before.to_str().unwrap(), after.to_str().unwrap());
    let fixed = ["verify", before, after, "--device", "cpu", "--rays", "1000", "--repeats", "1"];
    raykiln(fixed.iter().chain(more))
}

/// A sample's bake as another program might have written it: without records of where its triangles come from.
fn by_a_stranger(sample_name: &str, folder: &Path, change: impl FnOnce(&mut Value)) -> PathBuf {
    let output = folder.join("out.gltf");
    bake(&sample(sample_name), &output, &["--method", "single"]);
    let mut json: Value = serde_json::from_slice(&fs::read(&output).unwrap()).unwrap();
    let strip = |value: &mut Value| {
        value["extras"].as_object_mut().map(|extras| extras.remove("raykiln"));
    };
    json["nodes"].as_array_mut().unwrap().iter_mut().filter(|n| n["extras"].is_object()).for_each(strip);
    strip(&mut json);
    change(&mut json);
    fs::write(&output, serde_json::to_vec(&json).unwrap()).unwrap();
    output
}

#[test]
fn a_bake_is_verified_triangle_by_triangle() {
    for name in ["overlapping", "materials", "instanced"] {
        let folder = TempDir::new().unwrap();
        let output = folder.path().join("out.glb");
        bake(&sample(name), &output, &["--method", "single"]);
        let ran = verify(&sample(name), &output, &["--json"]);
        assert_eq!((ran.status, ran.stderr.as_str()), (0, ""), "{name}");
        let report = ran.json();
        assert_eq!(report["matched_by"], "place", "{name}");
        let placed = &report["before"]["triangles_placed"];
        assert_eq!(&report["verify"]["structure"]["triangles_after"], placed, "{name}");
        assert_eq!(report["verify"]["mismatches"], 0, "{name}");
    }
}

#[test]
fn a_file_against_itself_is_not_timed() {
    for name in ["overlapping", "textured"] {
        let ran = verify(&sample(name), &sample(name), &["--json"]);
        assert_eq!((ran.status, ran.stderr.as_str()), (0, ""), "{name}");
        let report = ran.json();
        assert_eq!((&report["verdict"], &report["verify"]["speed_by"]), (&"not faster".into(), &"nothing".into()));
        assert_eq!(report["overall"]["speedup_ratio"], 1.0);
        let notes = report["notes"].as_array().unwrap();
        assert!(notes.iter().any(|note| note.as_str().is_some_and(|note| note.contains("nothing was timed"))));
        assert!(report["verify"]["hits"].as_u64() > Some(0), "{name}: rays are compared nevertheless");
    }
}

#[test]
fn a_slow_view_is_no_gain() {
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.glb");
    bake(&sample("overlapping"), &output, &["--method", "single"]);
    let judged = |least: &str| verify(&sample("overlapping"), &output, &["--least-view-ratio", least, "--json"]).json();
    let report = judged("0");
    let views = report["verify"]["views"].as_array().unwrap();
    let judging: Vec<f64> = views.iter().filter_map(|view| view["speedup_ratio"].as_f64()).collect();
    assert_eq!(judging.len(), views.len() / 2);
    let least = judging.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(report["overall"]["least_view_ratio"].as_f64(), Some(least));
    assert_eq!(judged(&(least + 1e-6).to_string())["verdict"], "not faster");
}

#[test]
fn of_a_strangers_output_all_triangles_are_compared_by_place() {
    for name in ["overlapping", "materials", "instanced", "textured"] {
        let folder = TempDir::new().unwrap();
        let output = by_a_stranger(name, folder.path(), |_| {});
        let ran = verify(&sample(name), &output, &["--json"]);
        assert_eq!((ran.status, ran.stderr.as_str()), (0, ""), "{name}");
        let report = ran.json();
        assert_eq!(report["matched_by"], "place", "{name}");
        let structure = &report["verify"]["structure"];
        assert_eq!(structure["triangles_after"], report["before"]["triangles_placed"], "{name}");
        assert!(structure["power"]["area"].as_f64() > Some(0.0), "{name}: {structure}");
        let ran = verify(&sample(name), &output, &["--match", "surface"]);
        assert!(ran.status == 0 && ran.stdout.contains("only surfaces are compared"), "{}", ran.stdout);
    }
}

#[test]
fn a_strangers_faults_are_failures() {
    let folder = TempDir::new().unwrap();
    let output = by_a_stranger("materials", folder.path(), |json| {
        let materials = json["materials"].as_array_mut().unwrap();
        materials.iter_mut().for_each(|m| m["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.1, 0.2, 0.3, 1.0]));
    });
    let ran = verify(&sample("materials"), &output, &[]);
    assert_eq!(ran.status, 1, "{}{}", ran.stdout, ran.stderr);
    assert!(ran.stderr.contains("another material"), "{}", ran.stderr);

    let before = write(folder.path(), "before.glb", gltf(CORNERS, [0, 1, 2], |_| {}));
    let moved = CORNERS.map(|[x, y, z]| [x + 0.01, y, z]);
    let after = write(folder.path(), "after.glb", gltf(moved, [0, 1, 2], |_| {}));
    let report = folder.path().join("report.json");
    let ran = verify(&before, &after, &["--report", report.to_str().unwrap()]);
    assert_eq!(ran.status, 1, "{}", ran.stdout);
    let json: Value = serde_json::from_slice(&fs::read(&report).unwrap()).unwrap();
    assert_eq!(json["verdict"], "failed");
    let ratio = json["verify"]["structure"]["suggested_max_position_error_ratio"].as_f64().unwrap();
    assert_eq!(verify(&before, &after, &["--max-position-error-ratio", &ratio.to_string()]).status, 0, "{ratio}");
    // This limit exceeds the movement: 0.01 units with a diagonal of 1.4.
    assert_eq!(verify(&before, &after, &["--max-position-error-ratio", "0.02"]).status, 0);
}

#[test]
fn how_triangles_are_matched_can_be_chosen() {
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.gltf");
    bake(&sample("overlapping"), &output, &["--method", "single"]);
    // Imitates a tool that reorders triangles and copies extras.
    let mut opened = Opened::read(&output);
    let indices = opened.indices();
    let reordered: Vec<u32> = opened.numbers(indices).chunks(3).rev().flatten().copied().collect();
    opened.set_numbers(indices, &reordered);
    let reordered = opened.write(folder.path());
    for (by, status, matched_by) in [("auto", 0, "place"), ("identity", 1, "identity"), ("surface", 0, "surface")] {
        let ran = verify(&sample("overlapping"), &reordered, &["--match", by, "--json"]);
        assert_eq!(ran.status, status, "{by}: {}", ran.stderr);
        let report = ran.json();
        assert_eq!(report["matched_by"], matched_by, "{by}");
        let note = report["notes"]
            .as_array()
            .unwrap()
            .iter()
            .any(|n| n.as_str().unwrap().contains("the record of provenance is stale"));
        assert!(note, "{report}");
    }
}

#[test]
fn extras_about_another_file_are_not_believed() {
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.gltf");
    bake(&sample("overlapping"), &output, &["--method", "single"]);
    let foreign = folder.path().join("foreign.glb");
    with_record(&output, &foreign, |record| record.input = GeometryHash([3; 32]));
    let ran = verify(&sample("overlapping"), &foreign, &["--json"]);
    assert_eq!((ran.status, ran.json()["matched_by"].as_str()), (0, Some("place")), "{}", ran.stderr);
    assert!(ran.stdout.contains("the record of provenance leads to another input"), "{}", ran.stdout);
    let ran = verify(&sample("overlapping"), &foreign, &["--match", "identity"]);
    assert!(ran.status == 1 && ran.stderr.contains("recorded as another one"), "{}", ran.stderr);
}

#[test]
fn what_cannot_be_read_ends_with_status_2() {
    let folder = TempDir::new().unwrap();
    let good = write(folder.path(), "good.glb", gltf(CORNERS, [0, 1, 2], |_| {}));
    let bad = write(folder.path(), "bad.glb", b"glTF");
    for (before, after) in [(&good, &bad), (&bad, &good), (&good, &folder.path().join("none.glb"))] {
        let ran = verify(before, after, &[]);
        assert_eq!((ran.status, ran.stdout.as_str()), (2, ""));
        assert!(ran.stderr.starts_with("error: "), "{}", ran.stderr);
    }
}

#[test]
fn a_device_verifies_two_files_too() {
    let folder = TempDir::new().unwrap();
    let output = by_a_stranger("overlapping", folder.path(), |_| {});
    let (before, after) = (sample("overlapping"), output);
    let (before, after) = (before.to_str().unwrap(), after.to_str().unwrap());
    let ran = raykiln(["verify", before, after, "--device", "llvmpipe", "--rays", "500", "--repeats", "1", "--json"]);
    assert_eq!((ran.status, ran.stderr.as_str()), (0, ""));
    assert!(ran.json()["verify"]["blas_bytes"]["before"].as_u64() > Some(0));
}

/// A triangle placed by a node for each of these translations.
fn placed(corners: [[f32; 3]; 3], translations: &[[f64; 3]]) -> Vec<u8> {
    gltf(corners, [0, 1, 2], |json| {
        let node = |(i, at): (usize, &[f64; 3])| json!({"mesh": 0, "name": format!("part {i}"), "translation": at});
        json["nodes"] = translations.iter().enumerate().map(node).collect();
        json["scenes"][0]["nodes"] = (0..translations.len()).collect();
    })
}

#[test]
fn objects_too_small_for_rays_to_tell_are_missed_all_the_same() {
    let folder = TempDir::new().unwrap();
    let at_8e6 = CORNERS.map(|[x, y, z]| [x + 8e6, y, z]);
    let row = |count: usize| (0..count).map(|i| [3.0 * i as f64, 0.0, 0.0]).collect::<Vec<_>>();
    let far = |count: usize| [&[[1e11, 0.0, 0.0]], &row(count)[..]].concat();
    let pairs = [
        (placed(at_8e6, &row(40)), placed(at_8e6, &row(30)), 10, "part 30"),
        (placed(CORNERS, &far(40)), placed(CORNERS, &far(1)), 39, "part 2"),
    ];
    for (before, after, missing, first) in pairs {
        let before = write(folder.path(), "before.glb", before);
        let after = write(folder.path(), "after.glb", after);
        let same = verify(&before, &before, &[]);
        assert_eq!(same.status, 0, "{}", same.stderr);
        let ran = verify(&before, &after, &["--json"]);
        let words = [format!("{missing} triangles missing"), format!("`{first}`")];
        assert!(ran.status == 1 && words.iter().all(|w| ran.stderr.contains(w)), "{}", ran.stderr);
        assert_eq!(ran.json()["verify"]["structure"]["missing"]["count"], missing);
    }
}
