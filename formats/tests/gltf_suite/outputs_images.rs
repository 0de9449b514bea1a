//! Images of written files.

use std::fs;
use std::path::Path;

use raykiln_formats::document::Staged;
use raykiln_formats::{Document, ObjOptions, read, read_with};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::support::{folder, glb, names, triangle_bytes, triangle_json};

const PNG: &[u8] = b"\x89PNG\r\n\x1A\nrest";
const JPEG: &[u8] = b"\xFF\xD8\xFF\xE0";

/// A folder `in` with a GLB of the triangle that has these images, and these files.
fn scene(images: &Value, files: &[(&str, &[u8])]) -> (TempDir, Document) {
    let mut json = triangle_json();
    json["images"] = images.clone();
    let file = glb(&json, &triangle_bytes());
    let mut all = vec![("in/a.glb", &file[..])];
    all.extend(files);
    let folder = folder(&all);
    let anywhere = ObjOptions::default().with_root(Some("/".into()));
    let doc = read_with(&folder.path().join("in/a.glb"), &anywhere).unwrap();
    fs::create_dir(folder.path().join("out")).unwrap();
    (folder, doc)
}

/// The images after writing, and the warnings.
fn committed(staged: Staged, out: &Path) -> (Value, Vec<String>) {
    let warnings = staged.warnings.iter().map(ToString::to_string).collect();
    staged.commit().unwrap();
    (read(out).unwrap().json["images"].clone(), warnings)
}

fn written(folder: &TempDir, doc: &Document, name: &str) -> (Value, Vec<String>) {
    let out = folder.path().join(name);
    committed(doc.stage(&out).unwrap(), &out)
}

#[test]
fn a_glb_embeds_image_files_and_data_uris_with_their_type() {
    let images = json!([
        { "uri": "my%20textures/wood.jpg", "name": "wood", "extras": 7 },
        { "uri": "data:image/png;base64,/9j/4A==", "mimeType": "image/png" },
        { "uri": "my textures/wood.jpg" }
    ]);
    let (folder, doc) = scene(&images, &[("in/my textures/wood.jpg", PNG)]);
    let (images, warnings) = written(&folder, &doc, "out/b.glb");
    let expected = json!([
        { "name": "wood", "extras": 7, "mimeType": "image/png", "bufferView": 1 },
        { "mimeType": "image/jpeg", "bufferView": 2 },
        { "mimeType": "image/png", "bufferView": 1 }
    ]);
    assert_eq!((images, warnings), (expected, vec![]));
    assert_eq!(names(&folder.path().join("out")), ["b.glb"]);
    let back = read(&folder.path().join("out/b.glb")).unwrap();
    assert_eq!(back.json["bufferViews"][1], json!({ "buffer": 0, "byteOffset": 36, "byteLength": 12 }));
    assert_eq!(&back.buffers[0][36..48], PNG);
    assert_eq!(&back.buffers[0][48..], JPEG);
}

#[test]
fn image_types_are_told_by_content() {
    let files: [(&str, &[u8], &str); 6] = [
        ("in/0", PNG, "image/png"),
        ("in/1", JPEG, "image/jpeg"),
        ("in/2", b"RIFF\0\0\0\0WEBPVP8 ", "image/webp"),
        ("in/3", b"\xABKTX 20\xBB\r\n\x1A\n", "image/ktx2"),
        ("in/4", b"DDS |", "image/vnd-ms.dds"),
        ("in/5", b"\0\0\0\x20ftypavif", "image/avif"),
    ];
    let images: Value = (0..6).map(|i| json!({ "uri": i.to_string() })).collect();
    let (folder, doc) = scene(&images, &files.map(|(name, data, _)| (name, data)));
    let (images, _) = written(&folder, &doc, "out/b.glb");
    for (image, (_, _, mime)) in images.as_array().unwrap().iter().zip(files) {
        assert_eq!(image["mimeType"], mime);
    }
}

#[test]
fn missing_images_stay_references_with_a_warning() {
    let images = json!([{ "uri": "gone.png" }]);
    let (folder, doc) = scene(&images, &[]);
    for out in ["out/b.glb", "out/b.gltf"] {
        let (after, warnings) = written(&folder, &doc, out);
        assert_eq!(after, images);
        assert_eq!(warnings, ["images[0]: the image gone.png is missing; it stays a reference"]);
    }
}

#[test]
fn images_of_other_types_stay_files_beside_a_glb() {
    let images = json!([{ "uri": "a.tga" }]);
    let (folder, doc) = scene(&images, &[("in/a.tga", b"old tga")]);
    let (after, warnings) = written(&folder, &doc, "out/b.glb");
    assert_eq!(after, images);
    assert!(warnings[0].contains("the image a.tga is neither PNG"));
    assert_eq!(names(&folder.path().join("out")), ["a.tga", "b.glb"]);
}

#[test]
fn images_of_other_schemes_and_broken_ones_stay() {
    let images =
        json!([{ "uri": "https://example.org/a.png" }, { "uri": "data:image/png;base64,@" }, { "uri": "%FF" }]);
    let (folder, doc) = scene(&images, &[]);
    let (after, warnings) = written(&folder, &doc, "out/b.glb");
    assert_eq!(after, images);
    assert_eq!(warnings.len(), 3);
    let (after, warnings) = written(&folder, &doc, "out/b.gltf");
    assert_eq!((after, warnings.len()), (images, 1));
}

#[test]
fn gltf_in_another_folder_takes_its_images_along() {
    let images =
        json!([{ "uri": "textures/a%20b.png" }, { "uri": "./textures/a b.png" }, { "uri": "data:image/png,x" }]);
    let (folder, doc) = scene(&images, &[("in/textures/a b.png", PNG)]);
    assert_eq!(written(&folder, &doc, "out/b.gltf"), (images, vec![]));
    assert_eq!(names(&folder.path().join("out")), ["b.bin", "b.gltf", "textures/a b.png"]);
}

#[test]
fn gltf_in_the_same_folder_leaves_its_images() {
    let images = json!([{ "uri": "a.png" }, { "uri": "../c.png" }]);
    let (folder, doc) = scene(&images, &[("in/a.png", PNG), ("c.png", PNG)]);
    assert_eq!(written(&folder, &doc, "in/b.gltf"), (images, vec![]));
    assert_eq!(names(folder.path()), ["c.png", "in/a.glb", "in/a.png", "in/b.bin", "in/b.gltf"]);
}

#[test]
fn images_outside_the_folder_get_names_of_their_own() {
    let elsewhere = folder(&[("b.gltf", PNG)]);
    let absolute = elsewhere.path().join("b.gltf");
    let images = json!([
        { "uri": "x y.png" }, { "uri": "../x y.png" }, { "uri": "../sub/x y.png" }, { "uri": "../x%20y.png" },
        { "uri": absolute.to_str().unwrap() }
    ]);
    let (folder, doc) = scene(&images, &[("in/x y.png", PNG), ("x y.png", JPEG), ("sub/x y.png", b"third")]);
    let (images, warnings) = written(&folder, &doc, "out/b.gltf");
    let uris: Vec<&str> = images.as_array().unwrap().iter().map(|i| i["uri"].as_str().unwrap()).collect();
    assert_eq!(uris, ["x y.png", "x%20y_1.png", "x%20y_2.png", "x%20y_1.png", "b_1.gltf"]);
    assert!(warnings.is_empty());
    let out = folder.path().join("out");
    assert_eq!(names(&out), ["b.bin", "b.gltf", "b_1.gltf", "x y.png", "x y_1.png", "x y_2.png"]);
    assert_eq!(fs::read(out.join("x y_1.png")).unwrap(), JPEG);
    assert_eq!(fs::read(out.join("x y_2.png")).unwrap(), b"third");
}

#[test]
fn replacing_a_different_image_is_told() {
    let images = json!([{ "uri": "a.png" }, { "uri": "b.png" }]);
    let files: [(&str, &[u8]); 4] = [("in/a.png", PNG), ("in/b.png", PNG), ("out/a.png", PNG), ("out/b.png", JPEG)];
    let mut json = triangle_json();
    json["images"] = images;
    let file = glb(&json, &triangle_bytes());
    let folder = folder(&[&[("in/a.glb", &file[..])], &files[..]].concat());
    let doc = read(&folder.path().join("in/a.glb")).unwrap();
    let (_, warnings) = written(&folder, &doc, "out/c.gltf");
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].contains("b.png"));
    assert_eq!(fs::read(folder.path().join("out/b.png")).unwrap(), PNG);
}

#[test]
fn unchanged_files_take_their_images_along() {
    let images = json!([{ "uri": "t/a.png" }, { "uri": "gone.png" }]);
    let (folder, doc) = scene(&images, &[("in/t/a.png", PNG)]);
    let out = folder.path().join("out/b.glb");
    let (after, warnings) = committed(doc.stage_unchanged(&out).unwrap(), &out);
    assert_eq!(after, images);
    assert_eq!(warnings, ["the image gone.png is missing"]);
    assert_eq!(names(&folder.path().join("out")), ["b.glb", "t/a.png"]);
    assert_eq!(fs::read(&out).unwrap(), fs::read(folder.path().join("in/a.glb")).unwrap());
}

#[test]
fn unchanged_files_with_images_outside_are_written_anew() {
    let (folder, doc) = scene(&json!([{ "uri": "../a.png" }]), &[("a.png", PNG)]);
    let out = folder.path().join("out/b.glb");
    let (after, _) = committed(doc.stage_unchanged(&out).unwrap(), &out);
    assert_eq!(after[0]["mimeType"], "image/png");
    let beside = folder.path().join("in/b.glb");
    let (after, _) = committed(doc.stage_unchanged(&beside).unwrap(), &beside);
    assert_eq!(after[0]["uri"], "../a.png");
}
