//! Written files: containers, buffers, commit and rollback.

use std::fs;
use std::path::Path;

use raykiln_formats::document::{Component, Element, Kind};
use raykiln_formats::edit::{NewAccessor, Target};
use raykiln_formats::{Document, read};
use serde_json::{Value, json};

use crate::support::{
    contents, document, folder, glb, names, read_bytes, square, triangle, triangle_bytes, triangle_json, triangles,
    written,
};

/// A JSON tree without the places of its bytes.
fn without_places(doc: &Document) -> Value {
    let mut json = doc.json.clone();
    json.as_object_mut().unwrap().remove("buffers");
    for view in json["bufferViews"].as_array_mut().into_iter().flatten() {
        for key in ["buffer", "byteOffset"] {
            view.as_object_mut().unwrap().remove(key);
        }
    }
    json
}

/// The triangle with unknown things at every level and numbers that are easily spoilt.
fn curious() -> Document {
    let mut json = triangle_json();
    json["asset"]["generator"] = "somebody".into();
    json["ACME_root"] = json!([1, 2.5, 1e-7, 0.1, 123_456_789.123_456_79, -0.0, 1.0, 18446744073709551615_u64]);
    json["extras"] = json!({ "z": 1, "a": { "ü": "❤\u{1}\"" } });
    json["extensions"] = json!({ "ACME_thing": { "mesh": 0 } });
    json["extensionsUsed"] = json!(["ACME_thing"]);
    json["meshes"][0]["primitives"][0]["extensions"] = json!({ "ACME_thing": [] });
    json["nodes"][0]["extras"] = json!(["kept"]);
    document(json, &[triangle_bytes()])
}

#[test]
fn written_documents_read_back_equal() {
    let doc = curious();
    let folder = folder(&[]);
    for name in ["a.glb", "a.gltf"] {
        let back = written(&doc, &folder.path().join(name));
        assert_eq!(without_places(&back), without_places(&doc), "{name}");
        assert_eq!(back.buffers[0], doc.buffers[0]);
        assert_eq!(triangles(&back), triangles(&doc));
        let keys: Vec<&String> = back.json.as_object().unwrap().keys().collect();
        assert_eq!(keys, doc.json.as_object().unwrap().keys().collect::<Vec<_>>());
    }
    assert_eq!(names(folder.path()), ["a.bin", "a.glb", "a.gltf"]);
}

#[test]
fn writing_what_was_written_gives_the_same_bytes() {
    let folder = folder(&[]);
    for name in ["a.glb", "a.gltf"] {
        let path = folder.path().join(name);
        let first = written(&curious(), &path);
        let bytes = fs::read(&path).unwrap();
        written(&first, &path);
        assert_eq!(fs::read(&path).unwrap(), bytes);
    }
}

#[test]
fn outputs_pass_the_checks_of_the_gltf_crate() {
    let folder = folder(&[]);
    let path = folder.path().join("a.glb");
    triangle().stage(&path).unwrap().commit().unwrap();
    let other = gltf::Gltf::open(&path).unwrap();
    let blob = other.blob.clone().unwrap();
    let primitive = other.meshes().next().unwrap().primitives().next().unwrap();
    let positions: Vec<[f32; 3]> = primitive.reader(|_| Some(&blob)).read_positions().unwrap().collect();
    assert_eq!(*positions, *triangles(&triangle()).positions);
}

#[test]
fn a_glb_is_padded_to_four_bytes_everywhere() {
    let mut doc = triangle();
    let element = Element { component: Component::U8, components: 1, normalized: false };
    doc.add_accessor(NewAccessor { data: vec![0, 1, 2], element, target: Target::Indices, bounds: false });
    for extra in 0..4 {
        doc.json["asset"]["extras"] = "x".repeat(extra).into();
        let folder = folder(&[]);
        let path = folder.path().join("a.glb");
        doc.stage(&path).unwrap().commit().unwrap();
        let bytes = fs::read(&path).unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!(word(8), bytes.len());
        let json = word(12);
        assert_eq!((json % 4, bytes[20 + json..].len()), (0, 8 + 40));
        assert_eq!(word(20 + json), 40);
        assert_eq!(bytes[bytes.len() - 4..], [0, 1, 2, 0]);
        assert_eq!(read(&path).unwrap().json["buffers"], json!([{ "byteLength": 39 }]));
    }
}

#[test]
fn shared_bytes_stay_shared_and_unused_ones_go() {
    let mut json = triangle_json();
    json["bufferViews"] = json!([
        { "buffer": 0, "byteOffset": 24, "byteLength": 16 },
        { "buffer": 1, "byteOffset": 4, "byteLength": 36 },
        { "buffer": 0, "byteOffset": 20, "byteLength": 12 },
        { "buffer": 0, "byteOffset": 42, "byteLength": 2 }
    ]);
    json["accessors"][0]["bufferView"] = 1.into();
    json["buffers"] = json!([{ "byteLength": 48 }, { "byteLength": 48 }]);
    let mut other = vec![9; 4];
    other.extend(triangle_bytes());
    other.extend([9; 8]);
    let doc = document(json, &[square(), other]);
    let folder = folder(&[]);
    let back = written(&doc, &folder.path().join("a.glb"));
    let offsets: Vec<u64> =
        back.json["bufferViews"].as_array().unwrap().iter().map(|v| v["byteOffset"].as_u64().unwrap()).collect();
    assert_eq!(offsets, [4, 24, 0, 22]);
    assert_eq!(back.json["buffers"], json!([{ "byteLength": 60 }]));
    assert_eq!(back.buffers[0][0..20], square()[20..40]);
    assert_eq!(back.buffers[0][22..24], square()[42..44]);
    assert_eq!(triangles(&back), triangles(&triangle()));
}

#[test]
fn a_document_without_bytes_has_no_buffer() {
    let json = json!({ "asset": { "version": "2.0" }, "buffers": [{ "byteLength": 0 }], "nodes": [{}] });
    let doc = document(json, &[Vec::new()]);
    let folder = folder(&[]);
    for name in ["a.glb", "a.gltf"] {
        let back = written(&doc, &folder.path().join(name));
        assert_eq!(back.json, json!({ "asset": { "version": "2.0" }, "nodes": [{}] }));
    }
    assert_eq!(names(folder.path()), ["a.glb", "a.gltf"]);
}

#[test]
fn views_of_no_bytes_still_find_a_buffer() {
    let mut doc = triangle();
    doc.json["accessors"][0]["count"] = 0.into();
    doc.json["bufferViews"][0]["byteLength"] = 0.into();
    let folder = folder(&[]);
    assert!(triangles(&written(&doc, &folder.path().join("a.glb"))).corners.is_empty());
}

#[test]
fn properties_of_the_first_buffer_stay_and_losses_are_told() {
    let mut doc = triangle();
    doc.json["buffers"] = json!([
        { "byteLength": 36, "name": "first", "extras": 1 }, { "byteLength": 1 }, { "byteLength": 1, "name": "third" }
    ]);
    doc.buffers.extend([vec![0].into(), vec![0].into()]);
    let folder = folder(&[]);
    let staged = doc.stage(&folder.path().join("a.gltf")).unwrap();
    assert!(staged.warnings[0].to_string().contains("of 1 buffers are lost"));
    let json = read(staged.path()).unwrap().json;
    assert_eq!(json["buffers"], json!([{ "byteLength": 36, "name": "first", "extras": 1, "uri": "a.bin" }]));
}

#[test]
fn views_past_their_buffer_are_refused_in_writing_too() {
    let mut doc = triangle();
    doc.json["bufferViews"][0]["byteLength"] = 37.into();
    let error = doc.stage(Path::new("a.glb")).unwrap_err();
    assert_eq!((error.file.to_str(), error.place.as_str()), (Some("scene.gltf"), "bufferViews[0]"));
}

#[test]
fn other_extensions_and_unwritable_places_are_refused_by_name() {
    let folder = folder(&[("file", b"")]);
    let refused = |name: &str| triangle().stage(&folder.path().join(name)).unwrap_err().to_string();
    assert!(refused("a.obj").contains("must end in .glb or .gltf"));
    assert!(refused("glb").contains("must end in .glb or .gltf"));
    assert!(refused("none/a.glb").contains("none: the folder does not exist"));
    assert!(refused("file/a.glb").contains("file: the folder cannot be written to"));
    fs::create_dir(folder.path().join("dir.glb")).unwrap();
    assert!(refused("dir.glb").contains("is a folder"));
    assert_eq!(names(folder.path()), ["file"]);
}

#[test]
fn nothing_appears_before_commit_and_nothing_stays_without() {
    let folder = folder(&[("a.gltf", b"old"), ("a.bin", b"old bin")]);
    let staged = triangle().stage(&folder.path().join("a.gltf")).unwrap();
    assert_eq!(fs::read(folder.path().join("a.gltf")).unwrap(), b"old");
    assert_eq!(read(staged.path()).unwrap().buffers[0].len(), 36);
    let size = fs::metadata(staged.path()).unwrap().len();
    assert_eq!(staged.bytes(), size + 36);
    drop(staged);
    assert_eq!(names(folder.path()), ["a.bin", "a.gltf"]);
    assert_eq!(fs::read(folder.path().join("a.bin")).unwrap(), b"old bin");
}

#[test]
fn commit_replaces_existing_files() {
    let folder = folder(&[("a.gltf", br#"{"buffers": [{"uri": "a.bin"}]}"#), ("a.bin", b"old bin")]);
    triangle().stage(&folder.path().join("a.gltf")).unwrap().commit().unwrap();
    assert_eq!(names(folder.path()), ["a.bin", "a.gltf"]);
    assert_eq!(fs::read(folder.path().join("a.bin")).unwrap(), triangle_bytes());
}

#[test]
fn a_failed_commit_leaves_everything_as_it_was() {
    let folder = folder(&[("a.bin", b"old bin")]);
    let out = folder.path().join("a.gltf");
    let staged = triangle().stage(&out).unwrap();
    fs::create_dir(&out).unwrap();
    let error = staged.commit().unwrap_err();
    assert_eq!(error.file, out);
    assert!(error.cause.contains("cannot be put in place"));
    assert_eq!(fs::read(folder.path().join("a.bin")).unwrap(), b"old bin");
    assert_eq!(names(folder.path()), ["a.bin"]);
}

#[test]
fn a_failed_commit_removes_what_it_had_put_in_place() {
    let folder = folder(&[]);
    let out = folder.path().join("a.gltf");
    let staged = triangle().stage(&out).unwrap();
    fs::create_dir(&out).unwrap();
    staged.commit().unwrap_err();
    assert!(names(folder.path()).is_empty());
}

/// The triangle as `.gltf` with its buffer in a file.
fn separate(uri: &str) -> Vec<u8> {
    let mut json = triangle_json();
    json["buffers"][0]["uri"] = uri.into();
    format!("  {json}\n").into_bytes()
}

#[test]
fn unchanged_files_come_back_byte_for_byte() {
    let file = glb(&triangle_json(), &triangle_bytes());
    let text = separate("my%20data/a.bin");
    let input = folder(&[("a.glb", &file), ("a.gltf", &text), ("my data/a.bin", &triangle_bytes())]);
    let output = folder(&[]);
    for name in ["a.glb", "a.gltf"] {
        let doc = read(&input.path().join(name)).unwrap();
        let staged = doc.stage_unchanged(&output.path().join(name)).unwrap();
        assert_eq!(read(staged.path()).unwrap().json, doc.json);
        staged.commit().unwrap();
        assert_eq!(fs::read(output.path().join(name)).unwrap(), fs::read(input.path().join(name)).unwrap());
    }
    assert_eq!(names(output.path()), ["a.glb", "a.gltf", "my data/a.bin"]);
}

#[test]
fn unchanged_files_in_the_same_folder_share_their_buffers() {
    let text = separate("a.bin");
    let input = folder(&[("a.gltf", &text), ("a.bin", &triangle_bytes())]);
    let doc = read(&input.path().join("a.gltf")).unwrap();
    let staged = doc.stage_unchanged(&input.path().join("b.gltf")).unwrap();
    assert_eq!(triangles(&read(staged.path()).unwrap()), triangles(&doc));
    staged.commit().unwrap();
    assert_eq!(names(input.path()), ["a.bin", "a.gltf", "b.gltf"]);
    assert_eq!(fs::read(input.path().join("b.gltf")).unwrap(), text);
}

#[test]
fn unchanged_files_of_another_kind_are_written_anew() {
    let doc = read_bytes("a.glb", &glb(&triangle_json(), &triangle_bytes())).unwrap();
    let output = folder(&[]);
    doc.stage_unchanged(&output.path().join("a.gltf")).unwrap().commit().unwrap();
    assert_eq!(read(&output.path().join("a.gltf")).unwrap().kind, Kind::Gltf);
    assert_eq!(names(output.path()), ["a.bin", "a.gltf"]);
}

#[test]
fn unchanged_files_whose_buffers_lie_elsewhere_are_written_anew() {
    let text = separate("../a.bin");
    let input = folder(&[("in/a.gltf", &text), ("a.bin", &triangle_bytes())]);
    let doc = read(&input.path().join("in/a.gltf")).unwrap();
    let output = folder(&[]);
    doc.stage_unchanged(&output.path().join("b.gltf")).unwrap().commit().unwrap();
    assert_eq!(names(output.path()), ["b.bin", "b.gltf"]);
    assert_eq!(contents(&read(&output.path().join("b.gltf")).unwrap()).meshes.len(), 1);
}

#[test]
fn the_buffer_of_an_input_is_not_overwritten() {
    let text = separate("b.bin");
    let input = folder(&[("a.gltf", &text), ("b.bin", &triangle_bytes())]);
    let mut doc = read(&input.path().join("a.gltf")).unwrap();
    doc.buffers[0] = vec![0; 36].into();
    doc.stage(&input.path().join("b.gltf")).unwrap().commit().unwrap();
    assert_eq!(names(input.path()), ["a.gltf", "b.bin", "b.gltf", "b_1.bin"]);
    assert_eq!(fs::read(input.path().join("b.bin")).unwrap(), triangle_bytes());
    assert_eq!(&read(&input.path().join("b.gltf")).unwrap().buffers[0][..], [0; 36]);
}

#[test]
fn an_output_in_place_of_the_input_reuses_its_buffer_name() {
    let text = separate("a.bin");
    let input = folder(&[("a.gltf", &text), ("a.bin", &triangle_bytes())]);
    let doc = read(&input.path().join("a.gltf")).unwrap();
    doc.stage(&input.path().join("a.gltf")).unwrap().commit().unwrap();
    assert_eq!(names(input.path()), ["a.bin", "a.gltf"]);
}

#[test]
fn an_output_in_place_of_an_image_is_refused() {
    let mut json = triangle_json();
    json["images"] = json!([{ "uri": "b.glb" }]);
    let input = folder(&[("a.glb", &glb(&json, &triangle_bytes())), ("b.glb", b"image")]);
    let doc = read(&input.path().join("a.glb")).unwrap();
    for staged in [doc.stage(&input.path().join("b.glb")), doc.stage_unchanged(&input.path().join("b.glb"))] {
        assert!(staged.unwrap_err().cause.contains("refers to"));
    }
}
