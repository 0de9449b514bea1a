//! Round trips: `keep`, and conversion from each file format to the other and back.

use crate::common::{bake, folder_names, json_of, samples};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn kept(scene: &Path, folder: &TempDir, name: &str) -> PathBuf {
    let output = folder.path().join(name);
    bake(scene, &output, &["--method", "keep"]);
    output
}

/// A document without what depends on the file format: where the bytes are stored.
fn without_storage(path: &Path) -> Value {
    let mut json = json_of(path);
    let object = json.as_object_mut().expect("an object");
    object.remove("buffers");
    for view in object["bufferViews"].as_array_mut().expect("buffer views") {
        let view = view.as_object_mut().expect("an object");
        view.remove("buffer");
        view.remove("byteOffset");
    }
    for image in object.get_mut("images").and_then(Value::as_array_mut).into_iter().flatten() {
        let image = image.as_object_mut().expect("an object");
        for key in ["uri", "bufferView", "mimeType"] {
            image.remove(key);
        }
    }
    json
}

/// The bytes of every accessor's buffer view, in order.
fn accessor_bytes(path: &Path) -> Vec<Vec<u8>> {
    let document = raykiln_formats::read(path).unwrap_or_else(|e| panic!("{e}"));
    let number = |value: &Value| value.as_u64().unwrap_or(0) as usize;
    let views = document.json["accessors"].as_array().expect("accessors").iter().map(|a| number(&a["bufferView"]));
    let bytes = |view: usize| {
        let view = &document.json["bufferViews"][view];
        let offset = number(&view["byteOffset"]);
        document.buffers[number(&view["buffer"])][offset..offset + number(&view["byteLength"])].to_vec()
    };
    views.map(bytes).collect()
}

#[test]
fn keep_gives_the_file_back_byte_for_byte() {
    for sample in samples().iter().filter(|s| s.scene.extension().is_some_and(|e| e != "obj")) {
        let folder = TempDir::new().unwrap();
        let name = sample.scene.file_name().unwrap().to_str().unwrap();
        let output = kept(&sample.scene, &folder, name);
        assert!(fs::read(&sample.scene).unwrap() == fs::read(&output).unwrap(), "{}", sample.name);
    }
}

#[test]
fn the_other_kind_of_file_says_the_same() {
    for sample in samples().iter().filter(|s| s.scene.extension().is_some_and(|e| e != "obj")) {
        let folder = TempDir::new().unwrap();
        let binary = kept(&sample.scene, &folder, "one.glb");
        let text = kept(&binary, &folder, "two.gltf");
        let again = kept(&text, &folder, "three.glb");
        for other in [&binary, &text, &again] {
            // Embedding an image adds a buffer view; accessors are unchanged.
            let [mut before, mut after] = [&sample.scene, other].map(|path| without_storage(path));
            if before["images"].is_array() {
                for json in [&mut before, &mut after] {
                    json.as_object_mut().unwrap().remove("bufferViews");
                }
            }
            assert_eq!(before, after, "{} as {}", sample.name, other.display());
            assert!(accessor_bytes(&sample.scene) == accessor_bytes(other), "{}: accessors", sample.name);
        }
        assert!(fs::read(&binary).unwrap() == fs::read(&again).unwrap(), "{}: there and back", sample.name);
    }
}

#[test]
fn an_image_beside_the_file_goes_along() {
    let sample = samples().into_iter().find(|s| s.name == "textured").expect("the sample is there");
    let image = fs::read(sample.scene.with_file_name("brick wall.png")).unwrap();
    let folder = TempDir::new().unwrap();

    let text = kept(&sample.scene, &folder, "out.gltf");
    assert_eq!(fs::read(text.with_file_name("brick wall.png")).unwrap(), image, "copied beside .gltf");

    let binary = folder.path().join("out.glb");
    bake(&sample.scene, &binary, &["--method", "single"]);
    let bytes = fs::read(&binary).unwrap();
    assert!(bytes.windows(image.len()).any(|part| part == image), "embedded in .glb");
}

#[test]
fn a_file_may_be_baked_onto_itself() {
    let sample = samples().into_iter().find(|s| s.name == "textured").expect("the sample is there");
    let folder = TempDir::new().unwrap();
    let [elsewhere, itself] = ["elsewhere", "itself"].map(|name| folder.path().join(name));
    for path in [&elsewhere, &itself] {
        fs::create_dir(path).unwrap();
    }
    for file in ["scene.gltf", "scene.bin", "brick wall.png"] {
        fs::copy(sample.scene.with_file_name(file), itself.join(file)).unwrap();
    }
    bake(&sample.scene, &elsewhere.join("scene.gltf"), &["--method", "single"]);
    bake(&itself.join("scene.gltf"), &itself.join("scene.gltf"), &["--method", "single", "--in-place"]);
    for name in folder_names(&elsewhere) {
        assert!(fs::read(elsewhere.join(&name)).unwrap() == fs::read(itself.join(&name)).unwrap(), "{name}");
    }
    assert_eq!(folder_names(&elsewhere), folder_names(&itself));
}

#[test]
fn a_baked_file_baked_again_has_the_same_structure() {
    for method in ["single", "overlap"] {
        for sample in samples() {
            let folder = TempDir::new().unwrap();
            let [once, twice] = ["once.glb", "twice.glb"].map(|name| folder.path().join(name));
            let first = bake(&sample.scene, &once, &["--method", method]);
            let second = bake(&once, &twice, &["--method", method]);
            for metric in ["mesh_groups", "geometries", "instances", "triangles_stored", "overlap_ratio"] {
                assert_eq!(first["after"][metric], second["after"][metric], "{} {method}: {metric}", sample.name);
            }
        }
    }
}
