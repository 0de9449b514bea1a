//! Small files defined inline.

use raykiln_formats::edit::RecordPlace;
use raykiln_formats::record::Record;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

/// The bytes of a GLB file.
pub(crate) fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(json).expect("JSON");
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let total = 12 + 8 + text.len() + 8 + bin.len();
    let word = |n: usize| (n as u32).to_le_bytes();
    let header = [*b"glTF", word(2), word(total)].concat();
    [&header[..], &word(text.len()), b"JSON", &text, &word(bin.len()), b"BIN\0", &bin].concat()
}

/// A document of one triangle for the buffer of [`gltf`]: three positions, then three 16-bit indices.
pub(crate) fn triangle() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "only", "mesh": 0}],
        "meshes": [{"name": "shape", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "buffers": [{"byteLength": 42}]
    })
}

/// A GLB file of [`triangle`] after `change`, with these positions and indices.
pub(crate) fn gltf(positions: [[f32; 3]; 3], indices: [u16; 3], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let mut json = triangle();
    change(&mut json);
    let positions = positions.iter().flatten().flat_map(|x| x.to_le_bytes());
    let bin: Vec<u8> = positions.chain(indices.iter().flat_map(|i| i.to_le_bytes())).collect();
    glb(&json, &bin)
}

/// Writes a file into a folder; returns its path.
pub(crate) fn write(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).expect("a temporary folder is writable");
    path
}

/// The names of all files in a folder, including hidden ones.
pub(crate) fn folder_names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("the folder is there");
    let mut names: Vec<String> =
        entries.map(|e| e.expect("readable").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Writes an output again with another record of where its triangles come from.
pub(crate) fn with_record(output: &Path, to: &Path, change: impl FnOnce(&mut Record)) {
    let mut document = raykiln_formats::read(output).expect("readable");
    let contents = document.contents(Default::default()).expect("sound");
    let mut record = contents.provenance.record().expect("an output has a record").clone();
    change(&mut record);
    assert!(document.set_record(&record, RecordPlace::File));
    document.stage(to).expect("staged").commit().expect("written");
}
