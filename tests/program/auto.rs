//! `--method auto` with the model alone: what it chooses, what it leaves unchanged, and what it reports.

use crate::common::{Opened, bake, folder_names, json_of, methods, raykiln, samples, write};
use glam::{DMat3, DVec3, EulerRot, dvec3};
use serde_json::{Value, json};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

/// The corners of a box, in the order that [`FACES`] expects.
fn corners(center: DVec3, size: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        center + size * dvec3((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64) - 0.5 * size
    })
}

const FACES: &str = "f -8 -6 -5 -7\nf -4 -3 -1 -2\nf -8 -7 -3 -4\nf -6 -2 -1 -5\nf -8 -4 -2 -6\nf -7 -5 -1 -3\n";

/// A rotated room with 400 boxes in it, as an OBJ file.
fn turned_room(folder: &Path) -> PathBuf {
    let turn = DMat3::from_euler(EulerRot::ZYX, 0.8, 0.35, 0.5);
    let mut text = String::new();
    let mut add = |center: DVec3, size: DVec3| {
        for corner in corners(center, size) {
            let [x, y, z] = (turn * corner).as_vec3().to_array();
            writeln!(text, "v {x} {y} {z}").expect("a string takes all");
        }
        text += FACES;
    };
    add(DVec3::ZERO, dvec3(20.0, 6.0, 20.0));
    for i in 0..400u32 {
        let at = |salt: u32| f64::from(i.wrapping_mul(2_654_435_761).wrapping_mul(salt | 1) >> 16) / 65_536.0 - 0.5;
        add(dvec3(18.0 * at(3), 5.0 * at(5), 18.0 * at(11)), dvec3(0.2, 1.5 + at(7), 0.1 + f64::from(i % 7) * 0.2));
    }
    write(folder, "room.obj", text)
}

fn auto(scene: &Path, more: &[&str]) -> (TempDir, Value) {
    let folder = TempDir::new().expect("a temporary folder");
    let report = bake(scene, &folder.path().join("out.glb"), more);
    (folder, report)
}

#[test]
fn a_turned_room_is_stored_in_its_own_frame() {
    let folder = TempDir::new().unwrap();
    let (out, report) = auto(&turned_room(folder.path()), &[]);
    assert_ne!(report["verdict"], "failed");
    assert_ne!(report["method"]["chosen"], "keep", "{}", report["method"]);
    let document = json_of(&out.path().join("out.glb"));
    let nodes = document["nodes"].as_array().expect("nodes");
    let placed: Vec<&Value> = nodes.iter().filter(|n| n["mesh"].is_u64()).collect();
    let is_turned = |n: &&Value| n["rotation"].is_array() || n["matrix"].is_array();
    assert!(!placed.is_empty() && placed.iter().any(is_turned), "{placed:?}");
    let cost = |side: &str| report[side]["two_level_cost"].as_f64().unwrap();
    assert!(cost("after") < 0.9 * cost("before"), "{} after {}", cost("after"), cost("before"));
    assert_eq!(report["verify"]["mismatches"], 0);
}

#[test]
fn a_clean_scene_is_left_alone_to_the_last_byte() {
    let scene = sample("clean");
    for effort in ["1", "3", "6"] {
        let (out, report) = auto(&scene, &["--effort", effort]);
        assert_eq!(report["verdict"], "left alone", "effort {effort}: {}", report["method"]);
        assert!(fs::read(&scene).unwrap() == fs::read(out.path().join("out.glb")).unwrap(), "effort {effort}");
        assert_eq!(folder_names(out.path()), ["out.glb"]);
    }
}

#[test]
fn more_effort_looks_at_no_fewer_candidates() {
    let mut counts = Vec::new();
    for effort in 0..=6 {
        let (_out, report) = auto(&sample("overlapping"), &["--effort", &effort.to_string()]);
        assert_ne!(report["verdict"], "failed");
        counts.push(report["method"]["candidates"].as_array().expect("candidates").len());
    }
    assert!(counts[0] >= 2 && counts.is_sorted() && counts[6] > counts[0], "{counts:?}");
    let out = TempDir::new().unwrap();
    let (input, output) = (sample("clean"), out.path().join("out.glb"));
    let ran = raykiln(["bake", input.to_str().unwrap(), "-o", output.to_str().unwrap(), "--effort", "7"]);
    assert_eq!(ran.status, 2);
}

#[test]
fn weights_are_read_and_wrong_ones_refused() {
    for weights in ["primary=1", "diffuse=2,random=0.5", "primary=1,shadow=1,diffuse=1,random=1"] {
        let (_out, report) = auto(&sample("overlapping"), &["--weights", weights]);
        assert_ne!(report["verdict"], "failed", "{weights}");
    }
    let (input, out) = (sample("overlapping"), TempDir::new().unwrap());
    let output = out.path().join("out.glb");
    for weights in ["", "primary", "primary=", "primary=-1", "primary=nan", "primary=0", "glow=1", "primary=1;shadow=1"]
    {
        let ran = raykiln(["bake", input.to_str().unwrap(), "-o", output.to_str().unwrap(), "--weights", weights]);
        assert_eq!(ran.status, 2, "{weights:?}: {}", ran.stderr);
        assert!(ran.stdout.is_empty() && !ran.stderr.is_empty(), "{weights:?}");
    }
    assert!(folder_names(out.path()).is_empty());
}

fn words(value: &Value) -> bool {
    value.as_str().is_some_and(|text| text.split_whitespace().count() > 1)
}

#[test]
fn every_pass_and_candidate_says_why() {
    for name in ["clean", "overlapping", "transparent", "materials"] {
        let (_out, report) = auto(&sample(name), &["--effort", "6"]);
        let passes = report["passes"].as_array().expect("passes");
        for pass in ["reduce overlap", "frames", "isolate", "split opacity", "measure candidates"] {
            assert!(passes.iter().any(|p| p["name"] == pass), "{name}: {pass}");
        }
        assert!(passes.iter().all(|p| words(&p["reason"]) && p["applied"].is_boolean()), "{name}: {passes:?}");
        let candidates = report["method"]["candidates"].as_array().expect("candidates");
        assert!(candidates.iter().all(|c| words(&c["outcome"])), "{name}: {candidates:?}");
        let chosen = |c: &&Value| c["outcome"].as_str().is_some_and(|o| o.starts_with("chosen: "));
        assert_eq!(candidates.iter().filter(chosen).count(), 1, "{name}");
        assert!(words(&report["method"]["reason"]), "{name}");
    }
}

#[test]
fn passes_with_nothing_to_do_say_so() {
    let (_out, report) = auto(&sample("clean"), &[]);
    let reason = |name: &str| {
        let passes = report["passes"].as_array().expect("passes");
        let pass = passes.iter().find(|p| p["name"] == name).expect("the pass is reported");
        assert_eq!(pass["applied"], false, "{pass}");
        pass["reason"].as_str().expect("a reason").to_owned()
    };
    assert_eq!(reason("reduce overlap"), "no two instance boxes overlap");
    assert_eq!(reason("isolate"), "no object encloses the scene and none lies far outside");
    assert_eq!(reason("split opacity"), "all materials are opaque");
    let candidates = report["method"]["candidates"].to_string();
    assert!(!candidates.contains("isolated") && !candidates.contains("opacity split"), "{candidates}");
}

#[test]
fn bytes_are_equal_for_one_thread_and_three() {
    let folder = TempDir::new().unwrap();
    let scenes = ["overlapping", "instanced", "transparent", "clean"].map(sample);
    for scene in scenes.iter().chain([&turned_room(folder.path())]) {
        let [one, three] = ["1", "3"].map(|threads| {
            let (out, _report) = auto(scene, &["--threads", threads]);
            fs::read(out.path().join("out.glb")).expect("written")
        });
        assert!(one == three, "{}", scene.display());
    }
}

#[test]
fn triangles_that_are_not_opaque_get_groups_of_their_own_when_asked() {
    for method in ["single", "cluster"] {
        let (out, report) = auto(&sample("transparent"), &["--method", method, "--split-opacity", "true"]);
        assert_eq!(report["verify"]["mismatches"], 0);
        let document = json_of(&out.path().join("out.glb"));
        let opaque = |p: &Value| {
            document["materials"][p["material"].as_u64().expect("a material") as usize]["alphaMode"].is_null()
        };
        let placed = document["nodes"].as_array().expect("nodes").iter().filter_map(|n| n["mesh"].as_u64());
        let kinds: Vec<[bool; 2]> = placed
            .map(|mesh| {
                let primitives = document["meshes"][mesh as usize]["primitives"].as_array().expect("primitives");
                [primitives.iter().any(opaque), !primitives.iter().all(opaque)]
            })
            .collect();
        assert!(kinds.len() > 1 && kinds.iter().all(|k| k[0] != k[1]), "{method}: {kinds:?}");
    }
}

#[test]
fn a_sky_is_set_apart_when_asked() {
    let folder = TempDir::new().unwrap();
    let mut text = String::new();
    for (name, count, size) in [("houses", 200, 1.0), ("sky", 1, 1000.0)] {
        writeln!(text, "o {name}").unwrap();
        for i in 0..count {
            for c in corners(dvec3(if count > 1 { 2.0 * f64::from(i) } else { 200.0 }, 0.0, 0.0), DVec3::splat(size)) {
                writeln!(text, "v {} {} {}", c.x, c.y, c.z).unwrap();
            }
            text += FACES;
        }
    }
    let scene = write(folder.path(), "town.obj", text);
    let (_out, plain) = auto(&scene, &["--method", "single"]);
    let (_out, apart) = auto(&scene, &["--method", "single", "--isolate", "true"]);
    assert_eq!((&plain["after"]["mesh_groups"], &apart["after"]["mesh_groups"]), (&1.into(), &2.into()));
    assert_eq!(apart["verify"]["mismatches"], 0);
}

#[test]
fn with_one_blas_a_primitive_costs_are_those_of_geometries() {
    let scene = sample("materials");
    for method in methods().into_iter().chain(["auto"]) {
        let (_out, report) = auto(&scene, &["--method", method, "--blas-per", "primitive"]);
        assert_eq!(report["blas_per"], "primitive");
        for side in ["before", "after"] {
            assert_eq!(report[side]["mesh_groups"], report[side]["geometries"], "{method} {side}");
        }
        let notes = report["notes"].to_string();
        assert!(notes.contains("one BLAS per primitive") && notes.contains("one BLAS per mesh"), "{method}: {notes}");
    }
    let cost = |per: &str| {
        let (_out, report) = auto(&scene, &["--method", "single", "--blas-per", per]);
        (report["after"]["two_level_cost"].as_f64().unwrap(), report["after"]["instances"].as_u64().unwrap())
    };
    let ((mesh, one), (primitive, several)) = (cost("mesh"), cost("primitive"));
    assert_eq!((one, several), (1, 3));
    assert!(primitive > mesh, "{primitive} and {mesh}");
}

#[test]
fn with_one_blas_a_primitive_a_single_group_of_many_materials_is_not_chosen() {
    let folder = TempDir::new().unwrap();
    let mut text = String::new();
    for i in 0..600u32 {
        writeln!(text, "o box {i}\nusemtl paint {}", i % 40).unwrap();
        let at = dvec3(f64::from(i % 25), f64::from(i / 25), 0.3 * f64::from(i % 3));
        for c in corners(at, DVec3::splat(0.4)) {
            writeln!(text, "v {} {} {}", c.x, c.y, c.z).unwrap();
        }
        text += FACES;
    }
    let scene = write(folder.path(), "paints.obj", text);
    let sampled = |per: &str| {
        let (_out, report) = auto(&scene, &["--blas-per", per, "--effort", "2"]);
        let candidates = report["method"]["candidates"].as_array().expect("candidates").clone();
        let of =
            |name: &str| candidates.iter().find(|c| c["name"] == name).map(|c| c["sampled_cost"].as_f64().unwrap());
        (of("keep").expect("a candidate"), of("single").expect("a candidate"), report["method"]["chosen"].clone())
    };
    let (keep, single, chosen) = sampled("primitive");
    assert!(single > 2.0 * keep && chosen != "single", "{single} for {keep}: {chosen}");
    let (_, single_of_meshes, _) = sampled("mesh");
    assert!(single > 2.0 * single_of_meshes, "{single} for {single_of_meshes}");
}

/// An axis-aligned object of many small boxes in two distant heaps, for which one BLAS is best.
fn two_heaps(folder: &Path) -> PathBuf {
    let mut text = String::from("o heaps\n");
    for i in 0..64u32 {
        let within = dvec3((i % 4) as f64, (i / 4 % 4) as f64, (i / 16 % 2) as f64);
        let heap = if i < 32 { 0.0 } else { 100.0 };
        for corner in corners(within + DVec3::X * heap, DVec3::splat(0.9)) {
            writeln!(text, "v {} {} {}", corner.x, corner.y, corner.z).expect("a string takes all");
        }
        text += FACES;
    }
    write(folder, "heaps.obj", text)
}

#[test]
fn a_bound_on_extents_holds_though_the_input_is_cheaper() {
    let folder = TempDir::new().unwrap();
    let scene = two_heaps(folder.path());
    let (_, report) = auto(&scene, &[]);
    assert_eq!(report["after"]["mesh_groups"], 1, "without a bound: {}", report["method"]);
    let (_out, report) = auto(&scene, &["--max-group-extent-ratio", "0.1"]);
    assert_ne!(report["method"]["chosen"], "keep", "{}", report["method"]);
    assert!(report["after"]["mesh_groups"].as_u64().is_some_and(|n| n >= 2), "{}", report["after"]);
    let input = &report["method"]["candidates"][0];
    let outcome = input["outcome"].as_str().expect("words");
    assert!(outcome.contains("of the scene's length, 0.1 allowed"), "{outcome}");
}

/// A sample moved away from the origin: its root nodes become children of a translated node.
fn moved(name: &str, folder: &Path, by: [f64; 3]) -> PathBuf {
    let mut opened = Opened::read(&sample(name));
    let nodes = opened.json["nodes"].as_array_mut().expect("nodes");
    let root = nodes.len();
    nodes.push(json!({"name": "moved", "translation": by}));
    let roots = std::mem::replace(&mut opened.json["scenes"][0]["nodes"], json!([root]));
    opened.json["nodes"][root]["children"] = roots;
    opened.write(folder)
}

#[test]
fn layouts_rank_far_from_the_origin_as_near_it() {
    let folder = TempDir::new().unwrap();
    let costs = |by: [f64; 3]| -> Vec<(String, f64, f64)> {
        let report = auto(&moved("textured", folder.path(), by), &["--effort", "2"]).1;
        let number = |c: &Value, key: &str| c[key].as_f64().expect("a number");
        let all = report["method"]["candidates"].as_array().expect("candidates").iter();
        all.map(|c| (c["name"].to_string(), number(c, "predicted_cost"), number(c, "sampled_cost"))).collect()
    };
    let (near, far) = (costs([0.0; 3]), costs([3e6, -1e6, 2e6]));
    assert!(near.len() > 1, "{near:?}");
    assert_eq!(near.len(), far.len());
    for (near, far) in near.iter().zip(&far) {
        assert_eq!(near.0, far.0);
        assert!((far.1 / near.1 - 1.0).abs() < 0.2 && (far.2 / near.2 - 1.0).abs() < 0.2, "{near:?} {far:?}");
    }
}

#[test]
fn only_the_relation_of_weights_counts() {
    let sampled = |scale: &str| {
        let folder = TempDir::new().expect("a temporary folder");
        let weights = format!("primary={scale},shadow={scale},diffuse={scale}");
        let report = bake(&sample("overlapping"), &folder.path().join("out.glb"), &["--weights", &weights]);
        let candidates = report["method"]["candidates"].as_array().expect("candidates").clone();
        let cost = |c: &Value| c["sampled_cost"].as_f64().filter(|cost| *cost > 0.0).expect("a cost");
        (report["method"]["chosen_candidate"].clone(), candidates.iter().map(cost).collect::<Vec<_>>())
    };
    let (chosen, costs) = sampled("1");
    for scale in ["1e308", "1e-320"] {
        let (same, close) = sampled(scale);
        assert_eq!(chosen, same, "{scale}");
        assert!(costs.len() == close.len(), "{scale}");
        assert!(costs.iter().zip(&close).all(|(a, b)| (a - b).abs() <= 1e-9 * a), "{scale}: {close:?} for {costs:?}");
    }
}

#[test]
fn the_first_command_of_the_readme_finds_a_gain() {
    let readme = include_str!("../../README.md");
    let command = readme.lines().find_map(|line| line.strip_prefix("cargo run --release -- ")).expect("a command");
    let folder = TempDir::new().expect("a temporary folder");
    let out = folder.path().join("baked.glb");
    let out = out.to_str().expect("UTF-8");
    let words = command.split(' ').map(|word| if word == "baked.glb" { out } else { word });
    let ran = raykiln(words.chain(["--json", "--rays", "2000", "--repeats", "1"]));
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let report = ran.json();
    assert_eq!(report["method"]["requested"], "auto");
    let candidates = report["method"]["candidates"].as_array().expect("candidates");
    let cost = |name: &Value| {
        let found = candidates.iter().find(|candidate| candidate["name"] == *name);
        found.and_then(|candidate| candidate["predicted_cost"].as_f64()).expect("a predicted cost")
    };
    let chosen = cost(&report["method"]["chosen_candidate"]);
    assert!(chosen < 0.9 * cost(&"keep".into()), "{chosen}");
}
