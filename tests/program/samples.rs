//! Every sample matches its `expect.toml`.

use crate::common::{Bake, Number, Sample, Surface, bake, json_of, methods, samples};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Root properties that a bake must not change. Animations are compared separately: their accessors are renumbered.
const UNTOUCHED: [&str; 8] = ["materials", "textures", "images", "samplers", "cameras", "skins", "extensions", "scene"];

#[test]
fn there_are_enough_samples() {
    let samples = samples();
    assert!(samples.len() >= 12, "only {} samples were found", samples.len());
    for sample in samples {
        assert!(sample.expectation.bake.iter().any(|b| !b.unchanged) || sample.name == "clean", "{}", sample.name);
    }
}

#[test]
fn every_method_is_baked_by_several_samples() {
    let samples = samples();
    for method in methods() {
        let count = samples.iter().filter(|s| s.expectation.bake.iter().any(|b| b.method == method)).count();
        assert!(count >= 3, "only {count} samples bake `{method}`");
    }
}

/// One test per sample, so that no failure hides another.
macro_rules! sample_tests {
    ($($name:ident)*) => {
        const TESTED: &[&str] = &[$(stringify!($name)),*];
        $(#[test]
        fn $name() {
            check(stringify!($name));
        })*
    };
}

sample_tests! {
    animated clean copies findings hierarchy instanced materials overlapping plus scattered staggered textured transparent
    woven
}

#[test]
fn every_sample_is_tested() {
    let names: Vec<String> = samples().into_iter().map(|s| s.name).collect();
    assert_eq!(names, TESTED);
}

fn check(name: &str) {
    let sample = samples().into_iter().find(|s| s.name == name).expect("the sample is there");
    let folder = TempDir::new().expect("a temporary folder");
    for (i, expected) in sample.expectation.bake.iter().enumerate() {
        let output = output_path(&sample, &folder, i);
        let report = bake(&sample.scene, &output, &expected.arguments());
        let what = format!("{name} {:?}", expected.arguments());
        let mut input = sample.expectation.input.clone();
        input.extend(expected.input.clone());
        compare(&what, &report["input"], &input);
        compare(&what, &report["before"], &sample.expectation.before);
        compare(&what, &report["after"], &expected.after);
        check_verdict(&what, &report, expected);
        if expected.unchanged {
            assert_eq!(report["before"], report["after"], "{what}");
            check_bytes(&sample.scene, &output);
        } else {
            check_output(&sample, &output, expected, &folder);
        }
    }
}

/// An output path of the sample's own format in a new folder; OBJ becomes GLB.
fn output_path(sample: &Sample, folder: &TempDir, i: usize) -> PathBuf {
    let folder = folder.path().join(i.to_string());
    fs::create_dir(&folder).expect("a new folder");
    let name = sample.scene.file_name().expect("a name");
    let path = folder.join(name);
    if path.extension().is_some_and(|e| e == "obj") { path.with_extension("glb") } else { path }
}

fn compare(what: &str, report: &Value, expected: &BTreeMap<String, Number>) {
    for (key, number) in expected {
        let value = report[key].as_f64().unwrap_or_else(|| panic!("{what}: no {key} in {report}"));
        assert!(number.allows(value), "{what}: {key} is {value}, not {number:?}");
    }
}

fn check_verdict(what: &str, report: &Value, expected: &Bake) {
    let verdict = report["verdict"].as_str().expect("a verdict");
    let allowed: &[&str] = if expected.unchanged { &["left alone"] } else { &["faster", "not faster"] };
    assert!(allowed.contains(&verdict), "{what}: {verdict}");
    for count in ["mismatches", "far_hits"] {
        assert_eq!(report["verify"][count], 0, "{what}: {count}");
    }
    assert!(report["verify"]["hits"].as_u64() > Some(0), "{what}: no ray hit anything");
}

/// Asserts that the output equals the input byte for byte, with every file it refers to.
fn check_bytes(input: &Path, output: &Path) {
    if input.extension() != output.extension() {
        return;
    }
    let same = |a: &Path, b: &Path| assert!(fs::read(a).unwrap() == fs::read(b).unwrap(), "{} differs", b.display());
    same(input, output);
    let json = json_of(input);
    let parts = ["buffers", "images"].into_iter().filter_map(|array| json[array].as_array()).flatten();
    for uri in parts.filter_map(|part| part["uri"].as_str()) {
        let name = uri.replace("%20", " ");
        same(&input.with_file_name(&name), &output.with_file_name(&name));
    }
}

fn check_output(sample: &Sample, output: &Path, expected: &Bake, folder: &TempDir) {
    let input = as_gltf(sample, folder);
    let (before, after) = (json_of(&input), json_of(output));
    let surface = Surface::of_input(&input);
    surface.assert_shown_by(&Surface::of_output(output));
    for (name, area) in &sample.expectation.areas {
        let materials = before["materials"].as_array().expect("materials");
        let material = materials.iter().position(|m| m["name"] == name.as_str()).expect("the material is there");
        assert!(area.allows(surface.area(material)), "{name} covers {}, not {area:?}", surface.area(material));
    }
    for property in UNTOUCHED {
        assert_eq!(before[property], after[property], "{}: {property}", sample.name);
    }
    let mut extras = after["extras"].as_object().cloned().unwrap_or_default();
    assert!(extras.shift_remove("raykiln").is_some(), "{}: the record", sample.name);
    assert_eq!(before["extras"].as_object().cloned().unwrap_or_default(), extras, "{}: extras", sample.name);
    for (i, node) in before["nodes"].as_array().expect("nodes").iter().enumerate() {
        check_node(node, &after["nodes"][i], &after);
    }
    check_animations(&before, &after);
    if let Some(triangles) = &expected.group_triangles {
        assert_eq!(&group_triangles(&after), triangles, "{} {:?}", sample.name, expected.arguments());
    }
}

/// The sample itself or, for an OBJ file, the output of `keep`.
fn as_gltf(sample: &Sample, folder: &TempDir) -> PathBuf {
    if sample.scene.extension().is_none_or(|e| e != "obj") {
        return sample.scene.clone();
    }
    let path = folder.path().join("kept.glb");
    bake(&sample.scene, &path, &["--method", "keep"]);
    path
}

/// Asserts that a node keeps everything except its mesh, and that an emptied one records where its triangles went.
fn check_node(before: &Value, after: &Value, document: &Value) {
    for property in ["name", "translation", "rotation", "scale", "matrix", "camera", "skin"] {
        assert_eq!(before[property], after[property], "{property} of {before}");
    }
    let children = |node: &Value| node["children"].as_array().cloned().unwrap_or_default();
    assert!(children(after).starts_with(&children(before)), "children of {before}");
    let without = |value: &Value, key: &str| {
        let mut object = value.as_object().cloned().unwrap_or_default();
        object.remove(key);
        object
    };
    let instancing = "EXT_mesh_gpu_instancing";
    assert_eq!(without(&before["extensions"], instancing), without(&after["extensions"], instancing));
    assert_eq!(without(&before["extras"], "raykiln"), without(&after["extras"], "raykiln"), "extras of {before}");
    if before["mesh"].is_u64() && !after["mesh"].is_u64() {
        let moved_to = after["extras"]["raykiln"]["moved_to"].as_array().expect("a pointer to the triangles");
        assert!(!moved_to.is_empty());
        let nodes = document["nodes"].as_array().expect("nodes");
        for id in moved_to {
            let shows = |node: &Value| &node["extras"]["raykiln"]["id"] == id && node["mesh"].is_u64();
            assert!(nodes.iter().any(shows), "{id} shows nothing");
        }
    }
}

fn check_animations(before: &Value, after: &Value) {
    let channels = |json: &Value| -> Vec<Value> {
        json["animations"].as_array().into_iter().flatten().map(|a| a["channels"].clone()).collect()
    };
    assert_eq!(channels(before), channels(after));
}

/// Triangles per mesh that a node places, in ascending order.
fn group_triangles(json: &Value) -> Vec<usize> {
    let indices = |primitive: &Value| {
        let accessor = primitive["indices"].as_u64().expect("indices") as usize;
        json["accessors"][accessor]["count"].as_u64().expect("a count") as usize
    };
    let nodes = json["nodes"].as_array().expect("nodes").iter();
    let placed: BTreeSet<usize> = nodes.filter_map(|n| n["mesh"].as_u64()).map(|m| m as usize).collect();
    let meshes = placed.into_iter().map(|mesh| json["meshes"][mesh]["primitives"].as_array().expect("primitives"));
    let mut counts: Vec<usize> = meshes.map(|m| m.iter().map(indices).sum::<usize>() / 3).collect();
    counts.sort_unstable();
    counts
}
