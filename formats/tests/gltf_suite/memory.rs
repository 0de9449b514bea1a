//! Documents read from bytes in memory.

use std::fs;

use raykiln_formats::read_bytes;
use serde_json::json;

use crate::support::{folder, glb, triangle_bytes, triangle_json};

#[test]
fn what_was_read_from_memory_is_written_unchanged_byte_for_byte() {
    let bytes = glb(&triangle_json(), &triangle_bytes());
    let folder = folder(&[]);
    let out = folder.path().join("out.glb");
    read_bytes("scene.glb", bytes.clone()).unwrap().stage_unchanged(&out).unwrap().commit().unwrap();
    assert_eq!(fs::read(out).unwrap(), bytes);
}

#[test]
fn bytes_that_refer_to_a_file_are_refused_even_if_the_file_is_there() {
    let folder = folder(&[("scene.bin", &triangle_bytes()), ("picture.png", b"")]);
    let name = folder.path().join("scene.gltf");
    let mut buffer = triangle_json();
    buffer["buffers"][0]["uri"] = json!("scene.bin");
    let mut image = triangle_json();
    image["buffers"][0]["uri"] =
        json!("data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA");
    image["images"] = json!([{ "uri": "picture.png" }]);
    for (json, place) in [(buffer, "buffers[0].uri"), (image, "images[0].uri")] {
        let error = read_bytes(&name, json.to_string().into_bytes()).unwrap_err();
        assert_eq!((error.file.as_path(), error.place.as_str()), (name.as_path(), place));
        assert_eq!(error.cause, "refers to a file, which a scene read from memory cannot do");
    }
}

#[test]
fn material_libraries_of_bytes_are_not_looked_for() {
    let folder = folder(&[("scene.mtl", b"newmtl red\nKd 1 0 0\n")]);
    let obj = "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let doc = read_bytes(folder.path().join("scene.obj"), obj).unwrap();
    assert_eq!(doc.warnings.len(), 1);
    assert_eq!(doc.warnings[0].message, "material library `scene.mtl` not found");
}
