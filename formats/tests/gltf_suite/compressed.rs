//! Compressed files: their values are those that the reference decoders find, and what is wrong with them is named.
//!
//! `COMPRESSED_SCENES="FILE FILE"` adds files to the comparison.

use std::path::{Path, PathBuf};
use std::process::Command;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use raykiln_formats::{Document, ReadOptions, read};
use serde_json::{Value, json};

use crate::support::{folder, glb, read_bytes, refused, text, triangle_bytes, triangle_json, triangles};

/// The samples, made by `node tests/compressed.mjs write`.
const SAMPLES: [&str; 2] = ["meshopt.glb", "meshopt_khr.glb"];

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/compressed").join(name)
}

/// What glTF Transform with the decoders of meshoptimizer and Draco reads from a file; panics if Node.js is missing.
fn reference(file: &Path) -> Value {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let ran = Command::new("node")
        .args([root.join("tests/compressed.mjs"), "decode".into(), root.join("target/npm"), file.to_owned()])
        .output()
        .expect("node is installed; tests/all.sh does that");
    assert!(ran.status.success(), "{}: {}", file.display(), String::from_utf8_lossy(&ran.stderr));
    serde_json::from_slice(&ran.stdout).expect("JSON")
}

fn bytes_of(accessor: &Value) -> Vec<u8> {
    STANDARD.decode(accessor["base64"].as_str().expect("text")).expect("base64")
}

/// The unsigned integers of an accessor of the reference.
fn integers_of(accessor: &Value) -> Vec<u32> {
    let bytes = bytes_of(accessor);
    let size = match accessor["componentType"].as_u64() {
        Some(5121) => 1,
        Some(5123) => 2,
        _ => 4,
    };
    let number = |bytes: &[u8]| bytes.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte));
    bytes.chunks(size).map(number).collect()
}

/// The tightly packed bytes of an accessor with a buffer view, as read.
fn bytes_read(doc: &Document, accessor: &Value, size: usize) -> Vec<u8> {
    let at = |value: &Value, key: &str| value[key].as_u64().unwrap_or(0) as usize;
    let accessor = &doc.json["accessors"][accessor.as_u64().expect("an index") as usize];
    let view = &doc.json["bufferViews"][at(accessor, "bufferView")];
    let bytes = &doc.buffers[at(view, "buffer")][at(view, "byteOffset") + at(accessor, "byteOffset")..];
    let stride = at(view, "byteStride").max(size);
    (0..at(accessor, "count")).flat_map(|i| &bytes[i * stride..][..size]).copied().collect()
}

/// Holds the primitives and animations of a file against the reference; returns how many accessors there were.
fn compare(file: &Path) -> usize {
    let expected = reference(file);
    let doc = read(file).unwrap_or_else(|e| panic!("{e}"));
    let contents = doc.contents(ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let mut compared = 0;
    for (m, mesh) in expected["meshes"].as_array().expect("a list").iter().enumerate() {
        for (p, primitive) in mesh.as_array().expect("a list").iter().enumerate() {
            let place = format!("{}: meshes[{m}].primitives[{p}]", file.display());
            let attributes = doc.attributes(m, p);
            let names = primitive["attributes"].as_object().expect("an object");
            assert_eq!(attributes.len(), names.len(), "{place}");
            for attribute in attributes {
                let expected = &names[&attribute.name];
                let bytes = (0..attribute.count as u32).flat_map(|i| attribute.bytes(i).to_vec());
                assert_eq!(expected["componentType"], attribute.element.component as u32, "{place}");
                assert!(bytes.eq(bytes_of(expected)), "{place}: {}", attribute.name);
                compared += 1;
            }
            if let Some(triangles) = &contents.meshes[m].primitives[p].triangles {
                assert_eq!(triangles.corners.as_flattened(), integers_of(&primitive["indices"]), "{place}");
                compared += 1;
            }
        }
    }
    compared + compare_animations(&doc, &expected)
}

fn compare_animations(doc: &Document, expected: &Value) -> usize {
    let animations = doc.json["animations"].as_array().into_iter().flatten();
    let samplers = animations.flat_map(|animation| animation["samplers"].as_array().expect("a list"));
    let mut compared = 0;
    for (sampler, expected) in samplers.zip(expected["animations"].as_array().expect("a list")) {
        for (key, expected) in ["input", "output"].into_iter().zip(expected.as_array().expect("two")) {
            let accessor = &doc.json["accessors"][sampler[key].as_u64().expect("an index") as usize];
            let bytes = bytes_of(expected);
            let size = bytes.len() / accessor["count"].as_u64().expect("a count") as usize;
            assert_eq!(bytes_read(doc, &sampler[key], size), bytes, "{key}");
            compared += 1;
        }
    }
    compared
}

#[test]
fn values_are_those_of_the_reference_decoders() {
    for name in SAMPLES {
        assert!(compare(&sample(name)) >= 10, "{name}");
    }
    for scene in std::env::var("COMPRESSED_SCENES").unwrap_or_default().split_whitespace() {
        println!("{scene}: {} accessors are the same", compare(Path::new(scene)));
    }
}

#[test]
fn nothing_of_the_compression_is_left_in_the_document() {
    for name in SAMPLES {
        let doc = read(&sample(name)).unwrap();
        let text = doc.json.to_string();
        assert!(!text.contains("meshopt") && !text.contains("draco"), "{name}: {text}");
        assert_eq!(doc.warnings, [], "{name}");
        assert_eq!(doc.json["buffers"].as_array().unwrap().len(), doc.buffers.len());
    }
}

#[test]
fn a_compressed_file_is_written_without_compression_and_shows_the_same() {
    for name in SAMPLES {
        let doc = read(&sample(name)).unwrap();
        let folder = folder(&[]);
        let out = folder.path().join("out.glb");
        doc.stage(&out).unwrap().commit().unwrap();
        let again = read(&out).unwrap();
        for mesh in 0..2 {
            let [before, after] = [&doc, &again].map(|doc| doc.attributes(mesh, 0));
            for (before, after) in before.iter().zip(&after) {
                assert!((0..before.count as u32).all(|i| before.bytes(i) == after.bytes(i)), "{name}: {}", before.name);
            }
        }
    }
}

/// The uncompressed triangle, with an extension object that is not looked at, as its bytes are there.
fn with_unused_meshopt() -> Value {
    let mut json = triangle_json();
    json["extensionsUsed"] = json!(["EXT_meshopt_compression", "KHR_materials_unlit"]);
    json["buffers"][0]["extensions"] = json!({ "EXT_meshopt_compression": { "fallback": true } });
    json["bufferViews"][0]["extensions"] = json!({ "EXT_meshopt_compression": { "buffer": 0, "byteLength": 9 } });
    json
}

#[test]
fn optional_meshopt_gives_way_to_the_uncompressed_bytes() {
    let doc = read_bytes("a.glb", &glb(&with_unused_meshopt(), &triangle_bytes())).unwrap();
    let mut expected = triangle_json();
    expected["extensionsUsed"] = json!(["KHR_materials_unlit"]);
    assert_eq!(doc.json, expected);
    assert!(doc.warnings[0].to_string().contains("EXT_meshopt_compression of 1 buffer views is left out"));
}

/// A stream of mode `ATTRIBUTES` of the three corners of [`triangle_bytes`], made by the reference encoder.
fn stream() -> Vec<u8> {
    let mut stream = vec![0xA1];
    // The bytes of 1.0 in a vertex of its own, all as they are.
    stream.extend([0xFF; 3]);
    for byte in 0..12 {
        let value = |vertex: usize| triangle_bytes()[12 * vertex + byte];
        let zigzag = |d: u8| (d << 1) ^ (d >> 7).wrapping_neg();
        stream.extend([
            zigzag(value(0)),
            zigzag(value(1).wrapping_sub(value(0))),
            zigzag(value(2).wrapping_sub(value(1))),
        ]);
    }
    stream.extend([0; 24]);
    stream
}

/// The triangle in meshopt compression, with a placeholder for its uncompressed bytes.
fn with_meshopt() -> Value {
    let mut json = triangle_json();
    json["extensionsRequired"] = json!(["KHR_meshopt_compression"]);
    json["extensionsUsed"] = json!(["KHR_meshopt_compression"]);
    json["buffers"] = json!([{ "byteLength": stream().len() }, { "byteLength": 36 }]);
    json["bufferViews"][0]["buffer"] = json!(1);
    json["bufferViews"][0]["extensions"]["KHR_meshopt_compression"] = json!({
        "buffer": 0, "byteLength": stream().len(), "byteStride": 12, "mode": "ATTRIBUTES", "count": 3
    });
    json
}

#[test]
fn meshopt_is_decompressed_if_the_uncompressed_bytes_are_not_there() {
    let doc = read_bytes("a.glb", &glb(&with_meshopt(), &stream())).unwrap();
    assert_eq!(triangles(&doc).positions[1], [1.0, 0.0, 0.0]);
    assert_eq!(doc.json.get("extensionsRequired"), None);
}

#[test]
fn a_missing_fallback_file_is_a_warning_and_the_compressed_form_is_used() {
    let mut json = with_meshopt();
    json["buffers"][0]["uri"] = json!("packed.bin");
    json["buffers"][1]["uri"] = json!("gone.bin");
    let folder = folder(&[("a.gltf", &text(&json)), ("packed.bin", &stream())]);
    let doc = read(&folder.path().join("a.gltf")).unwrap();
    assert_eq!(triangles(&doc).positions[2], [0.0, 1.0, 0.0]);
    let warning = doc.warnings[0].to_string();
    assert!(warning.starts_with("buffers[1].uri: the buffer file") && warning.contains("gone.bin"), "{warning}");
    let out = folder.path().join("out.gltf");
    doc.stage_unchanged(&out).unwrap().commit().unwrap();
    assert_eq!(std::fs::read(out).unwrap(), text(&json));
}

/// An edit of the extension object, and what the error says.
type Fault = (fn(&mut Value), &'static str);

#[test]
fn what_is_wrong_with_compressed_views_is_named() {
    let faults: [Fault; 15] = [
        (|e| e["mode"] = json!("POINTS"), "mode: there is no mode \"POINTS\""),
        (|e| e["filter"] = json!("SOBEL"), "filter: there is no filter \"SOBEL\""),
        (|e| e["filter"] = json!("QUATERNION"), "filter: elements of 12 bytes in mode ATTRIBUTES cannot have it"),
        (|e| e["byteStride"] = json!(6), "byteStride: elements of 6 bytes cannot have the mode ATTRIBUTES"),
        (|e| e["byteStride"] = json!(0), "byteStride: elements of 0 bytes cannot"),
        (|e| e["byteStride"] = json!(260), "byteStride: elements of 260 bytes cannot"),
        (|e| e["count"] = json!(2), "bufferViews[0].byteLength: is 36, but the compressed data holds 2 elements"),
        (|e| e["count"] = json!(4), "the stream is too short for its elements"),
        (|e| e["count"] = json!(1_u64 << 60), "at most 268435456 bytes of decompressed data"),
        (|e| e["count"] = json!(1 << 20), "the stream is too short for its elements"),
        (|e| e["byteLength"] = json!(20), "the stream is too short for its elements"),
        (|e| e["byteOffset"] = json!(9), "pass the end of buffers[0]"),
        (|e| e["buffer"] = json!(7), "buffer: buffers[7] does not exist"),
        (|e| e["mode"] = json!("TRIANGLES"), "elements of 12 bytes cannot have the mode TRIANGLES"),
        (|e| drop(e.as_object_mut().unwrap().remove("mode")), "mode: is missing"),
    ];
    for (change, expected) in faults {
        let mut json = with_meshopt();
        change(&mut json["bufferViews"][0]["extensions"]["KHR_meshopt_compression"]);
        let message = refused("a.glb", &glb(&json, &stream()));
        assert!(message.starts_with("bufferViews[0]") && message.contains(expected), "{message}");
    }
}

#[test]
fn views_that_share_a_stream_cannot_exhaust_memory() {
    let mut json = with_meshopt();
    // Constant elements take next to nothing: 256 blocks of 8192 bytes.
    let [count, stride] = [256 * 128, 64];
    let packed = [&[0xA1][..], &[0xAA; 256 * 16], &[0; 80]].concat();
    json["buffers"] = json!([{ "byteLength": packed.len() }, { "byteLength": count * stride }]);
    let view = |n: usize| {
        json!({ "buffer": 1, "byteLength": count * stride, "name": n, "extensions": { "EXT_meshopt_compression": {
            "buffer": 0, "byteLength": packed.len(), "byteStride": stride, "mode": "ATTRIBUTES", "count": count
        }}})
    };
    json["bufferViews"] = (0..100).map(view).collect();
    let doc = read_bytes("a.glb", &glb(&json, &packed)).unwrap();
    assert_eq!(doc.buffers[2].len(), count * stride);
    json["bufferViews"] = (0..200).map(view).collect();
    let message = refused("a.glb", &glb(&json, &packed));
    assert!(message.starts_with("bufferViews[128]") && message.contains("at most 268435456 bytes"), "{message}");
}

fn with_draco(json: &mut Value) {
    json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    json["meshes"][0]["primitives"][0]["extensions"] =
        json!({ "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": { "POSITION": 0 } } });
}

#[test]
fn optional_draco_gives_way_to_the_uncompressed_accessors() {
    let mut json = triangle_json();
    with_draco(&mut json);
    let doc = read_bytes("a.glb", &glb(&json, &triangle_bytes())).unwrap();
    assert_eq!(doc.json, triangle_json());
    assert!(doc.warnings[0].to_string().contains("KHR_draco_mesh_compression of 1 primitives is left out"));
    assert_eq!(triangles(&doc).positions[1], [1.0, 0.0, 0.0]);
}

#[test]
fn draco_without_uncompressed_accessors_is_refused() {
    let mut json = triangle_json();
    with_draco(&mut json);
    json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    let message = refused("a.glb", &glb(&json, &triangle_bytes()));
    assert!(message.starts_with("meshes[0].primitives[0]"), "{message}");
    assert!(message.contains("is not decompressed yet"));
}
