//! Meshes that are copies of others become instances of them, and every triangle can be traced back to its source.

use crate::common::{Surface, bake, glb, json_of, methods, raykiln, with_record, write};
use glam::{DAffine3, DQuat, DVec3, dvec3};
use raykiln_formats::record::{Placed, Record};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A bumpy strip without symmetries: corners and triangles.
fn strip() -> (Vec<DVec3>, Vec<[u16; 3]>) {
    let point = |i: u16| {
        let (x, y) = (f64::from(i / 2), f64::from(i % 2));
        dvec3(0.25 * x, y + 0.03 * x, (1.7 * x).sin() * 0.3 + 0.2 * y)
    };
    let corners = (0..80).map(point).collect();
    let triangles = (0..78).map(|i| if i % 2 == 0 { [i, i + 1, i + 2] } else { [i, i + 2, i + 1] }).collect();
    (corners, triangles)
}

/// Distant placements: rotated, scaled, every third mirrored.
fn motion(i: u32) -> DAffine3 {
    let axis = dvec3(f64::from(i % 3) + 0.2, f64::from(i % 5), 1.0).normalize();
    let place = dvec3(f64::from(i % 4) * 14.0, f64::from(i / 4) * 14.0, f64::from(i % 7));
    let side = if i % 3 == 2 { -1.0 } else { 1.0 };
    let scale = 1.0 + 0.1 * f64::from(i % 4);
    let turn = DQuat::from_axis_angle(axis, f64::from(i));
    DAffine3::from_scale_rotation_translation(dvec3(side * scale, scale, scale), turn, place)
}

/// Normals, positions and triangles.
type Written = (Vec<[f32; 3]>, Vec<[f32; 3]>, Vec<[u16; 3]>);

/// A copy with its normals, which point along z, rotated likewise; triangles in reversed order if `reversed`.
fn baked(i: u32, reversed: bool) -> Written {
    moved(strip(), &motion(i), reversed)
}

fn moved((corners, mut triangles): (Vec<DVec3>, Vec<[u16; 3]>), by: &DAffine3, reversed: bool) -> Written {
    if by.matrix3.determinant() < 0.0 {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    if reversed {
        triangles.reverse();
    }
    let normal = by.transform_vector3(DVec3::Z).normalize().as_vec3().to_array();
    let positions: Vec<[f32; 3]> = corners.iter().map(|&p| by.transform_point3(p).as_vec3().to_array()).collect();
    (vec![normal; positions.len()], positions, triangles)
}

/// A GLB file of copies, each with its placement applied; the even ones have a rotated parent and a child of their own.
fn flattened(folder: &Path, count: u32) -> PathBuf {
    file_of((0..count).map(|i| baked(i, i % 5 == 4)).collect(), folder, [0.6, 0.8])
}

/// A GLB file of meshes; the even ones have a parent rotated about z by `turn`, and a child of their own.
fn file_of(written: Vec<Written>, folder: &Path, turn: [f64; 2]) -> PathBuf {
    let count = written.len() as u32;
    let mut bin: Vec<u8> = Vec::new();
    let (mut views, mut accessors, mut meshes, mut nodes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (i, (normals, positions, triangles)) in (0u32..).zip(written) {
        let low = (0..3).map(|axis| positions.iter().map(|p| p[axis]).fold(f32::INFINITY, f32::min));
        let high = (0..3).map(|axis| positions.iter().map(|p| p[axis]).fold(f32::NEG_INFINITY, f32::max));
        let bounds = json!([low.collect::<Vec<_>>(), high.collect::<Vec<_>>()]);
        let parts: [(&[u8], u32, &str, usize); 3] = [
            (bytemuck::cast_slice(&positions), 5126, "VEC3", positions.len()),
            (bytemuck::cast_slice(&normals), 5126, "VEC3", normals.len()),
            (bytemuck::cast_slice(&triangles), 5123, "SCALAR", 3 * triangles.len()),
        ];
        let first = accessors.len();
        for (data, component, kind, length) in parts {
            views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": data.len()}));
            accessors.push(
                json!({"bufferView": views.len() - 1, "componentType": component, "count": length, "type": kind}),
            );
            bin.extend(data);
        }
        (accessors[first]["min"], accessors[first]["max"]) = (bounds[0].clone(), bounds[1].clone());
        let attributes = json!({"POSITION": first, "NORMAL": first + 1});
        let primitive = json!({"attributes": attributes, "indices": first + 2, "material": 0});
        meshes.push(json!({"name": format!("mesh {i}"), "primitives": [primitive]}));
        nodes.push(json!({"name": format!("node {i}"), "mesh": i, "extras": {"number": i}}));
    }
    for i in (0..count as usize).step_by(2) {
        nodes[i]["children"] = json!([nodes.len()]);
        nodes.push(json!({"name": format!("below {i}"), "translation": [1, 2, 3]}));
    }
    nodes
        .push(json!({"rotation": [0.0, 0.0, turn[0], turn[1]], "children": (0..count).step_by(2).collect::<Vec<_>>()}));
    let mut roots: Vec<usize> = (1..count as usize).step_by(2).collect();
    roots.push(nodes.len() - 1);
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes, "meshes": meshes,
        "materials": [{"name": "grey"}], "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": bin.len()}]
    });
    write(folder, "flattened.glb", glb(&json, &bin))
}

fn pass(report: &Value) -> &Value {
    let passes = report["passes"].as_array().expect("passes");
    passes.iter().find(|p| p["name"] == "find copies").unwrap_or(&Value::Null)
}

fn verify(before: &Path, after: &Path) -> Value {
    let [before, after] = [before, after].map(|p| p.to_str().expect("UTF-8"));
    let fixed = ["--json", "--quiet", "--device", "cpu", "--rays", "2000", "--repeats", "1"];
    let ran = raykiln(["verify", before, after].iter().chain(&fixed));
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    ran.json()
}

#[test]
fn copies_written_out_become_instances_of_one_mesh() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = flattened(folder.path(), 12);
    let output = folder.path().join("shared.glb");
    let report = bake(&input, &output, &["--method", "keep", "--copies", "rigid"]);
    assert_eq!(pass(&report)["applied"], true, "{report}");
    assert!(pass(&report)["reason"].as_str().expect("a reason").starts_with("11 meshes are copies of 1;"), "{report}");
    assert_eq!(report["after"]["mesh_groups"], 1);
    assert_eq!(report["after"]["instances"], 12);
    for count in ["mismatches", "far_hits"] {
        assert_eq!(report["verify"][count], 0, "{count}");
    }
    let [before, after] = [&input, &output].map(|p| fs::metadata(p).expect("a file").len());
    assert!(3 * after < 2 * before, "{after} bytes of {before}");

    Surface::of_input(&input).assert_shown_by(&Surface::of_output(&output));
    assert_eq!(verify(&input, &output)["matched_by"], "place");
    let (before, after) = (json_of(&input), json_of(&output));
    assert_eq!(after["meshes"].as_array().map(Vec::len), Some(1));
    for (i, node) in before["nodes"].as_array().expect("nodes").iter().enumerate() {
        let now = &after["nodes"][i];
        assert_eq!((&node["name"], &node["extras"]["number"]), (&now["name"], &now["extras"]["number"]));
        if let (Some(mesh), None) = (node["mesh"].as_u64(), now["mesh"].as_u64()) {
            assert_eq!(now["extras"]["raykiln"]["mesh"]["name"], before["meshes"][mesh as usize]["name"]);
        }
    }
}

/// Rotates about an axis that is not a coordinate axis, and moves along x.
fn turned(solid: (Vec<DVec3>, Vec<[u16; 3]>), angle: f64, place: f64) -> Written {
    let turn = DQuat::from_axis_angle(dvec3(0.3, 1.0, 0.7).normalize(), angle);
    moved(solid, &DAffine3::from_rotation_translation(turn, dvec3(place, 0.0, 0.0)), false)
}

/// A strip of another shape: not a copy of the first.
fn other_strip() -> (Vec<DVec3>, Vec<[u16; 3]>) {
    let (corners, triangles) = strip();
    (corners.into_iter().map(|p| p * dvec3(8.0, 0.1, 0.1)).collect(), triangles)
}

#[test]
fn turned_copies_with_looser_boxes_do_not_keep_equal_meshes_from_being_shared() {
    let folder = TempDir::new().expect("a temporary folder");
    let equal = (0..8).map(|_| turned(strip(), 0.0, 0.0));
    // Each long strip occurs twice.
    let long = (0..16).map(|i| turned(other_strip(), f64::from(i / 2), 3.0 * f64::from(i / 2)));
    let input = file_of(equal.chain(long).collect(), folder.path(), [0.0, 1.0]);
    let output = folder.path().join("out.glb");
    let bake = |more: &[&str]| bake(&input, &output, &[&["--method", "keep", "--copies"], more].concat());
    let exact = bake(&["exact"]);
    assert_eq!(exact["after"]["mesh_groups"], 9, "{}", pass(&exact));
    let rigid = bake(&["rigid"]);
    assert_eq!((&rigid["after"]["mesh_groups"], &rigid["verify"]["mismatches"]), (&json!(9), &json!(0)));
    // What is connected with its twin is never turned.
    let reason = pass(&rigid)["reason"].as_str().expect("a reason");
    assert!(reason.contains("15 meshes are copies of 9; "), "{reason}");
    Surface::of_input(&input).assert_shown_by(&Surface::of_output(&output));
    let [before, after] = ["before", "after"].map(|side| rigid[side]["two_level_cost"].as_f64().expect("a cost"));
    assert!(after <= 1.01 * before, "{after} after {before}");

    let report = crate::common::bake(&input, &output, &["--method", "auto", "--effort", "0"]);
    assert!(pass(&report)["reason"].as_str().expect("a reason").contains("15 meshes are copies of 9"), "{report}");
    Surface::of_input(&input).assert_shown_by(&Surface::of_output(&output));
}

#[test]
fn every_method_can_work_on_copies() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = flattened(folder.path(), 12);
    let surface = Surface::of_input(&input);
    for method in methods().into_iter().chain(["auto"]) {
        let output = folder.path().join(format!("{method}.glb"));
        let report = bake(&input, &output, &["--method", method, "--copies", "rigid"]);
        if report["verdict"] != "left alone" {
            surface.assert_shown_by(&Surface::of_output(&output));
        }
        let again = folder.path().join(format!("{method}-again.glb"));
        bake(&input, &again, &["--method", method, "--copies", "rigid", "--threads", "1"]);
        assert!(fs::read(&output).expect("a file") == fs::read(&again).expect("a file"), "{method}");
    }
}

#[test]
fn pruned_nodes_do_not_lead_astray() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = flattened(folder.path(), 12);
    let output = folder.path().join("pruned.glb");
    let more = ["--method", "keep", "--copies", "rigid", "--prune"];
    for instancing in ["nodes", "extension"] {
        let report = bake(&input, &output, &[&more[..], &["--instancing", instancing]].concat());
        assert_eq!(report["verify"]["mismatches"], 0);
        Surface::of_input(&input).assert_shown_by(&Surface::of_output(&output));
    }
}

#[test]
fn copies_become_copies_of_one_node_that_names_their_meshes() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = flattened(folder.path(), 12);
    let output = folder.path().join("copies.glb");
    let report = bake(&input, &output, &["--method", "keep", "--copies", "rigid", "--instancing", "extension"]);
    // Mirrored ones have a node of their own.
    assert_eq!(report["copied"], json!({"nodes": 2, "copies": 12, "stay": 0}));
    Surface::of_input(&input).assert_shown_by(&Surface::of_output(&output));
    assert_eq!(verify(&input, &output)["matched_by"], "place");
}

#[test]
fn an_output_with_copies_can_be_baked_again() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = flattened(folder.path(), 12);
    let shared = folder.path().join("shared.glb");
    bake(&input, &shared, &["--method", "keep", "--copies", "rigid"]);
    let again = folder.path().join("again.glb");
    let report = bake(&shared, &again, &["--method", "keep", "--copies", "rigid"]);
    assert_eq!(pass(&report)["reason"], "no two meshes are alike");
    assert_eq!(report["verdict"], "left alone");
    assert!(fs::read(&shared).expect("a file") == fs::read(&again).expect("a file"));
    let single = folder.path().join("single.glb");
    let report = bake(&shared, &single, &["--method", "single"]);
    assert_eq!(report["verify"]["mismatches"], 0);
    assert_eq!(report["after"]["mesh_groups"], 1);
}

#[test]
fn keep_looks_for_no_copies_unless_told_to() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = flattened(folder.path(), 4);
    let output = folder.path().join("kept.glb");
    let report = bake(&input, &output, &["--method", "keep"]);
    assert!(pass(&report).is_null());
    assert!(fs::read(&input).expect("a file") == fs::read(&output).expect("a file"));
    let report = bake(&input, &output, &["--method", "keep", "--copies", "exact"]);
    assert_eq!(pass(&report)["applied"], false);
    assert_eq!(report["verdict"], "left alone");
}

#[test]
fn repeated_objects_of_an_obj_file_become_instances() {
    let mut text = String::new();
    for i in 0..9 {
        let (_, positions, triangles) = baked(i, i % 4 == 3);
        let base = i as usize * positions.len() + 1;
        text += &format!("o strip{i}\n");
        positions.iter().for_each(|p| text += &format!("v {} {} {}\n", p[0], p[1], p[2]));
        for t in triangles {
            let [a, b, c] = t.map(|v| usize::from(v) + base);
            text += &format!("f {a} {b} {c}\n");
        }
    }
    let folder = TempDir::new().expect("a temporary folder");
    let input = write(folder.path(), "strips.obj", text);
    let output = folder.path().join("out.glb");
    let report = bake(&input, &output, &["--method", "keep", "--copies", "rigid"]);
    // Objects are stored around their own middle, so that the model may be one whose box is loose when turned.
    assert!(pass(&report)["reason"].as_str().expect("a reason").starts_with("8 meshes are copies of 1"), "{report}");
    assert_eq!(report["after"]["mesh_groups"], if pass(&report)["applied"] == true { 1 } else { 9 });
    assert_eq!(report["verify"]["mismatches"], 0);
    let kept = folder.path().join("kept.glb");
    bake(&input, &kept, &["--method", "keep"]);
    match pass(&report)["applied"] == true {
        true => Surface::of_input(&kept).assert_shown_by(&Surface::of_output(&output)),
        false => assert_eq!(fs::read(&kept).expect("a file"), fs::read(&output).expect("a file")),
    }
}

#[test]
fn damaged_records_of_copies_are_refused_or_found_wrong() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = flattened(folder.path(), 5);
    let output = folder.path().join("shared.glb");
    bake(&input, &output, &["--method", "keep", "--copies", "rigid"]);
    type Damage = fn(&mut Record);
    let damages: [(&str, Damage); 4] = [
        ("no list", |record| record.placed[1].list = 77),
        ("another node", |record| record.placed[1].input = Some((u32::MAX, 0))),
        ("no node", |record| record.placed[1].input = None),
        ("two alike", |record| record.placed[1] = Placed { node: record.placed[1].node, ..record.placed[0] }),
    ];
    for (name, damage) in damages {
        let path = folder.path().join("damaged.glb");
        with_record(&output, &path, damage);
        let [before, after] = [&input, &path].map(|p| p.to_str().expect("UTF-8"));
        let fixed = ["--match", "identity", "--json", "--quiet", "--device", "cpu", "--rays", "500", "--repeats", "1"];
        let ran = raykiln(["verify", before, after].iter().chain(&fixed));
        assert_eq!(ran.status, 1, "{name}: {}", ran.stderr);
    }
}
