//! Compressed files: their values are those that the reference decoders find, and what is wrong with them is named.
//!
//! `COMPRESSED_SCENES="FILE FILE"` adds files to the comparison.

use std::path::{Path, PathBuf};
use std::process::Command;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use raykiln_formats::document::Compression;
use raykiln_formats::{Document, ReadOptions, read};
use serde_json::{Value, json};

use crate::support::{Random, folder, glb, read_bytes, refused, text, triangle_bytes, triangle_json, triangles};

/// The samples, made by `node tests/compressed.mjs write`.
const SAMPLES: [&str; 4] = ["meshopt.glb", "meshopt_khr.glb", "draco.glb", "draco_sequential.glb"];

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
    // 192 MiB each.
    let (claim, packed) = (3 << 20, [0xA0; 9]);
    json["buffers"] = json!([{ "byteLength": packed.len() }, { "byteLength": 64 * claim }]);
    let view = json!({ "buffer": 1, "byteLength": 64 * claim, "extensions": { "EXT_meshopt_compression": {
        "buffer": 0, "byteLength": 9, "byteStride": 64, "mode": "ATTRIBUTES", "count": claim
    }}});
    json["bufferViews"] = vec![view; 2].into();
    let message = refused("a.glb", &glb(&json, &packed));
    assert!(message.starts_with("bufferViews[1]") && message.contains("at most 268435456 bytes"), "{message}");
}

fn with_unused_draco(json: &mut Value) {
    json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    json["meshes"][0]["primitives"][0]["extensions"] =
        json!({ "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": { "POSITION": 0 } } });
}

#[test]
fn optional_draco_gives_way_to_the_uncompressed_accessors() {
    let mut json = triangle_json();
    with_unused_draco(&mut json);
    let doc = read_bytes("a.glb", &glb(&json, &triangle_bytes())).unwrap();
    assert_eq!(doc.json, triangle_json());
    assert!(doc.warnings[0].to_string().contains("KHR_draco_mesh_compression of 1 primitives is left out"));
    assert_eq!(triangles(&doc).positions[1], [1.0, 0.0, 0.0]);
}

/// The JSON and the binary chunk of a sample.
fn parts(name: &str) -> (Value, Vec<u8>) {
    let bytes = std::fs::read(sample(name)).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    (serde_json::from_slice(&bytes[20..20 + length]).unwrap(), bytes[28 + length..].to_vec())
}

/// Reads the Draco sample after a change of its JSON.
fn changed(change: impl FnOnce(&mut Value)) -> Result<Document, String> {
    let (mut json, bin) = parts("draco.glb");
    change(&mut json);
    read_bytes("a.glb", &glb(&json, &bin)).map_err(|e| format!("{}: {}", e.place, e.cause))
}

/// The extension object of the sample's first primitive.
fn extension(json: &mut Value) -> &mut Value {
    &mut json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]
}

#[test]
fn what_is_wrong_with_draco_primitives_is_named() {
    let faults: [Fault; 10] = [
        (|j| extension(j)["attributes"]["POSITION"] = json!(9), "POSITION: the stream has no attribute with the id 9"),
        (|j| extension(j)["attributes"]["POSITION"] = json!(2), "the accessor has 3 components, but the stream has 2"),
        (|j| extension(j)["attributes"]["POSITION"] = json!(-1), "POSITION: expected an unsigned integer, found -1"),
        (|j| extension(j)["attributes"]["WEIGHTS_0"] = json!(0), "attributes.WEIGHTS_0: is missing"),
        (|j| j["accessors"][1]["componentType"] = json!(5123), "a value of the stream does not fit the accessor"),
        (
            |j| j["accessors"][5]["componentType"] = json!(5121),
            "_PART: a value of the stream does not fit the accessor",
        ),
        (|j| j["meshes"][0]["primitives"][0]["mode"] = json!(1), "primitives of mode 1 cannot be compressed"),
        (|j| extension(j)["bufferView"] = json!(7), "bufferView: bufferViews[7] does not exist"),
        (|j| j["bufferViews"][0]["byteLength"] = json!(1000), "the stream cannot be decompressed"),
        (|j| j["bufferViews"][0]["byteOffset"] = json!(4), "the stream cannot be decompressed"),
    ];
    for (change, expected) in faults {
        let message = changed(change).expect_err(expected);
        assert!(message.starts_with("meshes[0].primitives[0]") && message.contains(expected), "{message}");
    }
}

#[test]
fn counts_that_contradict_the_stream_are_corrected_with_a_warning() {
    let doc = changed(|json| json["accessors"][1]["count"] = json!(400)).unwrap();
    assert_eq!(doc.json["accessors"][1]["count"], json!(429));
    let expected = "accessors[1]: count is 400, but the Draco stream has 429 elements, which are used";
    assert_eq!(doc.warnings[0].to_string(), expected);
}

#[test]
fn index_types_that_are_too_small_for_the_stream_are_widened() {
    let doc = changed(|json| json["accessors"][0]["componentType"] = json!(5121)).unwrap();
    assert_eq!(doc.json["accessors"][0]["componentType"], json!(5123));
    assert_eq!(triangles(&doc).corners.len(), 768);
}

#[test]
fn integers_of_the_stream_become_the_type_of_the_accessor() {
    let before = changed(|_| ()).unwrap();
    let after = changed(|json| json["accessors"][5]["componentType"] = json!(5126)).unwrap();
    let [before, after] = [&before, &after].map(|doc| doc.attributes(0, 0).pop().unwrap().numbers(6));
    assert_eq!((before, after), ([1800.0, 0.0, 0.0, 1.0], [1800.0, 0.0, 0.0, 1.0]));
}

#[test]
fn primitives_without_indices_get_those_of_the_stream() {
    let remove = |json: &mut Value| drop(json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices"));
    let doc = changed(remove).unwrap();
    assert_eq!(triangles(&doc).corners, triangles(&changed(|_| ()).unwrap()).corners);
}

#[test]
fn the_triangles_of_a_strip_are_a_list() {
    let doc = changed(|json| json["meshes"][0]["primitives"][0]["mode"] = json!(5)).unwrap();
    assert_eq!(triangles(&doc).corners, triangles(&changed(|_| ()).unwrap()).corners);
}

#[test]
fn primitives_share_a_stream_and_its_accessors() {
    let doc = changed(|json| json["meshes"][1] = json["meshes"][0].clone()).unwrap();
    assert_eq!(doc.json["meshes"][0], doc.json["meshes"][1]);
    assert_eq!(doc.json["accessors"].as_array().unwrap().len(), 12);
}

#[test]
fn an_accessor_that_two_streams_claim_is_parted() {
    let doc = changed(|json| json["meshes"][1]["primitives"][0]["attributes"]["POSITION"] = json!(1)).unwrap();
    let apart = changed(|_| ()).unwrap();
    for mesh in 0..2 {
        let [positions, expected] = [&doc, &apart].map(|doc| doc.attributes(mesh, 0)[0].data.to_vec());
        assert_eq!(positions, expected);
    }
}

#[test]
fn the_bounds_of_positions_are_those_of_the_decoded_ones() {
    let doc = changed(|json| json["accessors"][1]["min"] = json!([7, 7, 7])).unwrap();
    let least = doc.json["accessors"][1]["min"][0].as_f64().unwrap();
    assert!((-2.51..-2.49).contains(&least), "{least}");
}

#[test]
fn the_views_of_streams_do_not_stay_behind() {
    let (json, _) = parts("draco.glb");
    let doc = changed(|_| ()).unwrap();
    let views = doc.json["bufferViews"].as_array().unwrap();
    assert_eq!((json["bufferViews"].as_array().unwrap().len(), views.len()), (2, 12));
}

#[test]
fn accessors_that_share_a_stream_cannot_exhaust_memory() {
    let many = |json: &mut Value| {
        let accessor = json["accessors"][1].clone();
        let primitive = json["meshes"][0]["primitives"][0].clone();
        json["accessors"] = Value::Array(vec![accessor; 20_000]);
        let with = |i: usize| {
            let mut primitive = primitive.clone();
            primitive["attributes"] = json!({ "POSITION": i });
            primitive["extensions"]["KHR_draco_mesh_compression"]["attributes"] = json!({ "POSITION": 0 });
            primitive.as_object_mut().unwrap().remove("indices");
            primitive
        };
        json["meshes"][0]["primitives"] = (1..20_000).map(with).collect();
        json["meshes"].as_array_mut().unwrap().pop();
        json["nodes"].as_array_mut().unwrap().pop();
        json["scenes"][0]["nodes"] = json!([0]);
    };
    let message = changed(many).unwrap_err();
    assert!(message.contains("at most 268435456 bytes of decompressed data"), "{message}");
}

#[test]
fn damaged_samples_are_read_or_refused() {
    let count = std::env::var("DAMAGED_SAMPLES").map_or(60, |count| count.parse().expect("a number"));
    for name in SAMPLES {
        let (json, bin) = parts(name);
        for seed in 1..=count {
            let mut random = Random(seed);
            let mut bin = bin.clone();
            for _ in 0..=random.below(4) {
                let at = random.below(bin.len());
                bin[at] = random.below(256) as u8;
            }
            let read = raykiln_formats::read_bytes("a.glb", glb(&json, &bin));
            if let Ok(doc) = read {
                let _ = doc.contents(ReadOptions::default());
            }
        }
    }
}

/// All accessors and views of a document, as they are read.
fn everything(doc: &Document) -> (Value, Vec<Vec<u8>>) {
    let mut json = doc.json.clone();
    let views = json["bufferViews"].as_array_mut().unwrap();
    let bytes = |view: &mut Value| {
        let at = |key: &str| view[key].as_u64().unwrap_or(0) as usize;
        let bytes = doc.buffers[at("buffer")][at("byteOffset")..][..at("byteLength")].to_vec();
        view.as_object_mut().unwrap().retain(|key, _| ["byteStride", "target", "name"].contains(&key.as_str()));
        bytes
    };
    let bytes = views.iter_mut().map(bytes).collect();
    json["buffers"].take();
    (json, bytes)
}

#[test]
fn what_is_written_compressed_is_read_back_byte_by_byte() {
    let folder = folder(&[]);
    for (name, ending) in SAMPLES.iter().zip(["glb", "gltf", "gltf", "glb"]) {
        let doc = read(&sample(name)).unwrap();
        let [plain, small] = [Compression::None, Compression::Meshopt].map(|compression| {
            let out = folder.path().join(format!("{compression:?}.{ending}"));
            let staged = doc.stage_with(&out, compression).unwrap();
            let bytes = staged.bytes();
            staged.commit().unwrap();
            (out, bytes)
        });
        assert!(10 * small.1 < 9 * plain.1, "{name}: {} of {} bytes", small.1, plain.1);
        let [plain, small] = [plain.0, small.0].map(|out| everything(&read(&out).unwrap()));
        assert!(plain == small, "{name}");
    }
}

#[test]
fn other_decoders_read_what_is_written_compressed() {
    let folder = folder(&[]);
    for name in SAMPLES {
        let out = folder.path().join(name);
        read(&sample(name)).unwrap().stage_with(&out, Compression::Meshopt).unwrap().commit().unwrap();
        assert!(compare(&out) >= 10, "{name}");
    }
}

#[test]
fn a_file_that_does_not_become_smaller_is_written_without_the_extension() {
    let folder = folder(&[]);
    let out = folder.path().join("out.glb");
    let doc = read_bytes("a.glb", &glb(&triangle_json(), &triangle_bytes())).unwrap();
    doc.stage_with(&out, Compression::Meshopt).unwrap().commit().unwrap();
    assert_eq!(read(&out).unwrap().json, triangle_json());
    assert!(!String::from_utf8_lossy(&std::fs::read(out).unwrap()).contains("meshopt"));
}
