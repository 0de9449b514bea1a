//! Input that cannot be baked: the message names the file, the place and the cause, the exit status is 2, and no file
//! is left behind. Doubtful input is repaired with a warning.

use crate::common::{Ran, folder_names, glb, gltf, raykiln, triangle, write};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// Bakes into the folder `out` beside the input.
fn bake(input: &Path, more: &[&str]) -> (Ran, PathBuf) {
    let out = input.with_file_name("out");
    fs::create_dir_all(&out).expect("a writable folder");
    let (input, output) = (input.as_os_str(), out.join("baked.glb"));
    let arguments = ["bake".as_ref(), input, "-o".as_ref(), output.as_os_str(), "--rays".as_ref(), "100".as_ref()];
    (raykiln(arguments.into_iter().chain(more.iter().map(AsRef::as_ref))), out)
}

/// Asserts that `bake` and `inspect` reject a file with a message that names it and contains each part.
fn assert_refused(name: &str, bytes: impl AsRef<[u8]>, parts: &[&str]) {
    let folder = TempDir::new().expect("a temporary folder");
    let input = write(folder.path(), name, bytes);
    let (ran, out) = bake(&input, &[]);
    assert_names_fault(&ran, name, parts);
    assert_eq!(folder_names(&out), [""; 0], "{name} left something behind");
    assert_eq!(folder_names(folder.path()).len(), 2, "{name} left something beside itself");
    assert_names_fault(&raykiln(["inspect".as_ref(), input.as_os_str()]), name, parts);
}

fn assert_names_fault(ran: &Ran, name: &str, parts: &[&str]) {
    assert_eq!(ran.status, 2, "{name}: {}", ran.stderr);
    assert_eq!(ran.stdout, "", "{name}");
    for part in [&[name], parts].concat() {
        assert!(ran.stderr.contains(part), "{name}: {part:?} is missing in: {}", ran.stderr);
    }
}

/// Asserts that a GLB of one triangle is rejected after `change`.
fn assert_refuses(change: impl FnOnce(&mut Value), parts: &[&str]) {
    assert_refused("changed.glb", gltf(CORNERS, [0, 1, 2], change), parts);
}

#[test]
fn the_triangle_itself_is_accepted() {
    let folder = TempDir::new().unwrap();
    let (ran, out) = bake(&write(folder.path(), "fine.glb", gltf(CORNERS, [0, 1, 2], |_| ())), &[]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert_eq!(folder_names(&out), ["baked.glb"]);
}

#[test]
fn a_missing_file_is_named() {
    let folder = TempDir::new().unwrap();
    let (ran, _) = bake(&folder.path().join("absent.glb"), &[]);
    assert_names_fault(&ran, "absent.glb", &["No such file"]);
}

#[test]
fn an_empty_file_is_refused() {
    for name in ["empty.glb", "empty.gltf"] {
        assert_refused(name, "", &["empty"]);
    }
}

#[test]
fn a_glb_truncated_anywhere_is_refused() {
    let whole = gltf(CORNERS, [0, 1, 2], |_| ());
    for length in [4, 11, 12, 19, 20, 100, whole.len() - 1] {
        assert_refused("short.glb", &whole[..length], &["truncated"]);
    }
}

#[test]
fn truncated_json_is_refused_with_line_and_column() {
    let text = serde_json::to_string_pretty(&triangle()).unwrap();
    assert_refused("short.gltf", &text[..text.len() / 2], &["line ", "column ", "JSON"]);
}

#[test]
fn wrong_magic_is_refused() {
    assert_refused("picture.glb", b"\x89PNG\r\n\x1a\n----------------", &["looks like an image"]);
    assert_refused("text.gltf", "solid cube", &["looks like an STL model"]);
    assert_refused("letter.gltf", "Dear reader", &["magic"]);
}

#[test]
fn another_version_is_refused() {
    assert_refuses(|json| json["asset"]["version"] = json!("1.0"), &["asset.version", "1.0"]);
    let mut bytes = gltf(CORNERS, [0, 1, 2], |_| ());
    bytes[4] = 3;
    assert_refused("future.glb", bytes, &["header", "version 3"]);
}

#[test]
fn lengths_that_overflow_are_refused() {
    let mut bytes = gltf(CORNERS, [0, 1, 2], |_| ());
    bytes[12..16].copy_from_slice(&[0xff; 4]);
    assert_refused("long.glb", bytes, &["chunk 0", "4294967295"]);
    for length in [json!(u32::MAX), json!(u64::MAX), json!(1e300)] {
        assert_refuses(|json| json["buffers"][0]["byteLength"] = length, &["buffers[0]"]);
    }
    assert_refuses(|json| json["bufferViews"][0]["byteOffset"] = json!(u64::MAX - 1), &["bufferViews[0]"]);
    assert_refuses(|json| json["accessors"][0]["count"] = json!(u64::MAX / 12), &["accessors[0]"]);
}

#[test]
fn an_accessor_past_its_buffer_is_refused() {
    assert_refuses(|json| json["accessors"][0]["count"] = json!(4), &["accessors[0]", "bufferViews[0]"]);
    assert_refuses(|json| json["accessors"][0]["byteOffset"] = json!(4), &["accessors[0]"]);
    assert_refuses(|json| json["bufferViews"][1]["byteLength"] = json!(100), &["bufferViews[1]"]);
}

#[test]
fn references_to_nothing_are_refused() {
    let mesh = "meshes[0].primitives[0]";
    assert_refuses(|json| json["nodes"][0]["mesh"] = json!(7), &["nodes[0].mesh", "7"]);
    assert_refuses(|json| json["nodes"][0]["children"] = json!([9]), &["nodes[0].children"]);
    assert_refuses(|json| json["scenes"][0]["nodes"] = json!([3]), &["scenes[0].nodes"]);
    assert_refuses(|json| json["meshes"][0]["primitives"][0]["indices"] = json!(5), &[mesh, "5"]);
    assert_refuses(|json| json["meshes"][0]["primitives"][0]["material"] = json!(0), &[mesh, "material"]);
    assert_refuses(
        |json| json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(-1),
        &[mesh, "POSITION"],
    );
    assert_refuses(|json| json["accessors"][1]["bufferView"] = json!(2), &["accessors[1].bufferView", "2"]);
    assert_refuses(|json| json["bufferViews"][1]["buffer"] = json!(1), &["bufferViews[1].buffer", "1"]);
}

#[test]
fn an_index_past_the_vertices_is_refused() {
    assert_refused("past.glb", gltf(CORNERS, [0, 1, 3], |_| ()), &["accessors[1]", "index 3", "3 vertices"]);
}

#[test]
fn types_that_do_not_fit_are_refused() {
    assert_refuses(|json| json["accessors"][0]["type"] = json!("VEC2"), &["accessors[0]"]);
    assert_refuses(|json| json["accessors"][1]["componentType"] = json!(5126), &["accessors[1]"]);
    assert_refuses(|json| json["accessors"][1]["componentType"] = json!(1), &["accessors[1]"]);
    assert_refuses(|json| json["meshes"] = json!({"primitives": []}), &["meshes"]);
    assert_refuses(|json| json["meshes"][0]["primitives"][0]["mode"] = json!(9), &["meshes[0].primitives[0].mode"]);
}

#[test]
fn node_cycles_and_second_parents_are_refused() {
    let cycle = |json: &mut Value| {
        json["nodes"] = json!([{"children": [1]}, {"children": [0], "mesh": 0}]);
        json["scenes"][0]["nodes"] = json!([0]);
    };
    assert_refuses(cycle, &["nodes["]);
    assert_refuses(|json| json["nodes"][0]["children"] = json!([0]), &["nodes[0]"]);
    let two_parents = |json: &mut Value| {
        json["nodes"] = json!([{"children": [2]}, {"children": [2]}, {"mesh": 0}]);
        json["scenes"][0]["nodes"] = json!([0, 1]);
    };
    assert_refuses(two_parents, &["nodes[2]", "nodes[0]", "nodes[1]"]);
}

#[test]
fn required_extensions_that_are_unknown_are_refused_by_name() {
    let require = |json: &mut Value| {
        json["extensionsUsed"] = json!(["ACME_teleport"]);
        json["extensionsRequired"] = json!(["ACME_teleport"]);
    };
    assert_refuses(require, &["extensionsRequired[0]", "ACME_teleport"]);
}

#[test]
fn a_missing_buffer_file_is_named() {
    let mut json = triangle();
    json["buffers"][0]["uri"] = json!("absent.bin");
    assert_refused("lone.gltf", json.to_string(), &["buffers[0]", "absent.bin"]);
    json["buffers"][0].as_object_mut().unwrap().remove("uri");
    assert_refused("bare.gltf", json.to_string(), &["buffers[0]"]);
    json["buffers"][0]["uri"] = json!("data:application/octet-stream;base64,AAA*");
    assert_refused("torn.gltf", json.to_string(), &["buffers[0].uri", "base64"]);
}

#[test]
fn a_buffer_file_that_is_too_short_is_refused() {
    let folder = TempDir::new().unwrap();
    let mut json = triangle();
    json["buffers"][0]["uri"] = json!("short.bin");
    write(folder.path(), "short.bin", [0; 10]);
    let (ran, out) = bake(&write(folder.path(), "lone.gltf", json.to_string()), &[]);
    assert_names_fault(&ran, "lone.gltf", &["buffers[0]", "42", "10"]);
    assert_eq!(folder_names(&out), [""; 0]);
}

#[test]
fn a_missing_texture_is_a_warning() {
    let folder = TempDir::new().unwrap();
    let textured = |json: &mut Value| {
        json["images"] = json!([{"uri": "absent.png"}]);
        json["textures"] = json!([{"source": 0}]);
        json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
        json["meshes"][0]["primitives"][0]["material"] = json!(0);
    };
    let (ran, out) = bake(&write(folder.path(), "bare.glb", gltf(CORNERS, [0, 1, 2], textured)), &["--json", "-v"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(ran.stderr.contains("absent.png"), "{}", ran.stderr);
    assert!(ran.json()["warnings"].to_string().contains("absent.png"));
    assert_eq!(folder_names(&out), ["baked.glb"]);
}

#[test]
fn triangles_that_are_not_finite_are_dropped_and_counted_unless_strict() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let folder = TempDir::new().unwrap();
        let positions = [CORNERS.as_flattened(), &[bad, 0.0, 0.0]].concat();
        let indices = [0u16, 1, 2, 0, 1, 3, 2, 1, 3];
        let bin: Vec<u8> = positions
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .chain(indices.iter().flat_map(|i| i.to_le_bytes()))
            .collect();
        let mut json = triangle();
        json["accessors"][0]["count"] = json!(4);
        json["accessors"][1]["count"] = json!(9);
        json["bufferViews"] =
            json!([{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 18}]);
        json["buffers"][0]["byteLength"] = json!(66);
        let input = write(folder.path(), "holes.glb", glb(&json, &bin));

        let (ran, _) = bake(&input, &["--json", "-v"]);
        assert_eq!(ran.status, 0, "{}", ran.stderr);
        assert_eq!(ran.json()["input"]["triangles"], 1);
        assert!(ran.json()["warnings"].to_string().contains("2 triangles"), "{}", ran.stdout);
        fs::remove_dir_all(folder.path().join("out")).unwrap();

        let (ran, out) = bake(&input, &["--strict"]);
        assert_names_fault(&ran, "holes.glb", &["2 triangles", "finite"]);
        assert_eq!(folder_names(&out), [""; 0]);
    }
}

#[test]
fn a_scene_without_triangles_is_refused() {
    assert_refuses(|json| json["scenes"][0]["nodes"] = json!([]), &["triangle"]);
    assert_refuses(|json| json["meshes"][0]["primitives"][0]["mode"] = json!(0), &["triangle"]);
    assert_refused("points.obj", "v 0 0 0\np 1\n", &["triangle"]);
    assert_refused("nan.glb", gltf([[f32::NAN; 3]; 3], [0, 1, 2], |_| ()), &["triangle"]);
}

#[test]
fn faulty_obj_lines_are_named() {
    assert_refused("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", &["line 4"]);
    assert_refused("negative.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n", &["line 4"]);
    assert_refused("zero.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", &["line 4"]);
    assert_refused("word.obj", "v 0 zero 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", &["line 1"]);
    assert_refused("huge.obj", "v 0 0 0\nf 1 99999999999999999999 1\n", &["line 2"]);
    assert_refused("none.obj", "", &["none.obj"]);
}

#[test]
fn a_missing_material_library_is_a_warning() {
    let folder = TempDir::new().unwrap();
    let text = "mtllib absent.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let (ran, out) = bake(&write(folder.path(), "bare.obj", text), &["--json"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(ran.json()["warnings"].to_string().contains("absent.mtl"), "{}", ran.stdout);
    assert_eq!(folder_names(&out), ["baked.glb"]);
}

#[test]
fn a_deep_hierarchy_is_baked() {
    const DEPTH: usize = 100_000;
    let folder = TempDir::new().unwrap();
    let deep = |json: &mut Value| {
        let above = (1..DEPTH).map(|child| json!({"children": [child]}));
        json["nodes"] = above.chain([json!({"mesh": 0})]).collect();
    };
    let (ran, _) = bake(&write(folder.path(), "deep.glb", gltf(CORNERS, [0, 1, 2], deep)), &["--method", "single"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
}

#[test]
fn an_output_that_cannot_be_written_is_named() {
    let folder = TempDir::new().unwrap();
    let input = write(folder.path(), "fine.glb", gltf(CORNERS, [0, 1, 2], |_| ()));
    write(folder.path(), "file", "not a folder");
    fs::create_dir(folder.path().join("taken.glb")).unwrap();
    let outputs = [
        ("absent/out.glb", "absent: "),
        ("file/out.glb", "file: "),
        ("taken.glb", "taken.glb: "),
        ("out.fbx", "out.fbx: "),
        ("out", "out: "),
    ];
    for (output, named) in outputs {
        let path = folder.path().join(output);
        let arguments = ["bake".as_ref(), input.as_os_str(), "-o".as_ref(), path.as_os_str()];
        assert_names_fault(&raykiln(arguments), named, &[]);
        assert_eq!(folder_names(folder.path()), ["file", "fine.glb", "taken.glb"], "{output}");
    }
}

#[test]
fn a_report_that_cannot_be_written_is_named() {
    let folder = TempDir::new().unwrap();
    let input = write(folder.path(), "fine.glb", gltf(CORNERS, [0, 1, 2], |_| ()));
    for (name, part) in [("report.txt", "report.txt"), ("absent/report.json", "absent")] {
        let report = folder.path().join(name);
        let (ran, _) = bake(&input, &["--report", report.to_str().unwrap()]);
        assert_names_fault(&ran, part, &[]);
    }
}
