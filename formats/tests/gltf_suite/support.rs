//! Small documents, in memory and on disk.

use std::fmt::Debug;
use std::fs;
use std::path::{Path, PathBuf};

use raykiln_formats::contents::Triangles;
use raykiln_formats::document::{Document, Kind};
use raykiln_formats::{Contents, Error, ReadOptions, read};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Bytes of 32-bit floats.
pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Bytes of 16-bit integers.
pub(crate) fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Bytes of 32-bit integers.
pub(crate) fn words(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// The corners of the unit square in the order of a triangle strip.
pub(crate) fn square() -> Vec<u8> {
    floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0])
}

/// A document in memory as if read from `scene.gltf`.
pub(crate) fn document(json: Value, buffers: &[Vec<u8>]) -> Document {
    Document {
        json,
        buffers: buffers.iter().map(|b| b.clone().into()).collect(),
        path: PathBuf::from("scene.gltf"),
        kind: Kind::Gltf,
        warnings: Vec::new(),
        in_memory: None,
        residuals: Default::default(),
        sidecar: None,
    }
}

/// The JSON of one triangle, not indexed: accessor 0 holds the three positions, buffer 0 has 36 bytes.
pub(crate) fn triangle_json() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{
            "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]
        }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "byteLength": 36 }]
    })
}

/// The bytes that [`triangle_json`] refers to.
pub(crate) fn triangle_bytes() -> Vec<u8> {
    square()[..36].to_vec()
}

/// One triangle in memory.
pub(crate) fn triangle() -> Document {
    document(triangle_json(), &[triangle_bytes()])
}

/// A document of one primitive: each accessor has a buffer and a view of its own.
pub(crate) fn primitive(primitive: Value, accessors: &[(Value, Vec<u8>)]) -> Document {
    let mut json = triangle_json();
    json["meshes"][0]["primitives"][0] = primitive;
    for list in ["accessors", "bufferViews", "buffers"] {
        json[list] = json!([]);
    }
    for (i, (accessor, data)) in accessors.iter().enumerate() {
        let mut accessor = accessor.clone();
        accessor["bufferView"] = i.into();
        json["accessors"].as_array_mut().unwrap().push(accessor);
        json["bufferViews"].as_array_mut().unwrap().push(json!({ "buffer": i, "byteLength": data.len() }));
        json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": data.len() }));
    }
    document(json, &accessors.iter().map(|(_, data)| data.clone()).collect::<Vec<_>>())
}

/// The contents with default options.
pub(crate) fn contents(doc: &Document) -> Contents {
    doc.contents(ReadOptions::default()).unwrap()
}

/// The error that the contents end in.
pub(crate) fn refusal(doc: &Document) -> Error {
    doc.contents(ReadOptions::default()).unwrap_err()
}

/// The triangles of the first primitive.
pub(crate) fn triangles(doc: &Document) -> Triangles {
    contents(doc).meshes.remove(0).primitives.remove(0).triangles.unwrap()
}

/// A GLB file, put together independently of the writer.
pub(crate) fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut chunks = Vec::new();
    for (kind, data) in [(b"JSON", text), (b"BIN\0", bin.to_vec())] {
        chunks.extend((data.len().next_multiple_of(4) as u32).to_le_bytes());
        chunks.extend(kind);
        chunks.extend(&data);
        chunks.resize(chunks.len().next_multiple_of(4), 0);
    }
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((12 + chunks.len() as u32).to_le_bytes());
    file.extend(chunks);
    file
}

/// A folder with some files.
pub(crate) fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = TempDir::new().unwrap();
    for (name, bytes) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    folder
}

/// What reading a single file of these bytes gives; from memory it is the same, unless the bytes refer to another file.
pub(crate) fn read_bytes(name: &str, bytes: &[u8]) -> Result<Document, Error> {
    let folder = folder(&[(name, bytes)]);
    let from_file = read(&folder.path().join(name));
    let from_memory = raykiln_formats::read_bytes(name, bytes.to_vec());
    if !from_memory.as_ref().is_err_and(|e| e.cause.starts_with("refers to a file")) {
        assert_eq!(outcome(&from_memory), outcome(&from_file));
    }
    from_file
}

/// The message with which a file is refused.
pub(crate) fn refused(name: &str, bytes: &[u8]) -> String {
    let error = read_bytes(name, bytes).unwrap_err();
    assert!(error.file.ends_with(name));
    format!("{}: {}", error.place, error.cause)
}

/// The bytes of a `.gltf` file.
pub(crate) fn text(json: &Value) -> Vec<u8> {
    json.to_string().into_bytes()
}

/// What was read, or where and why nothing was.
fn outcome(read: &Result<Document, Error>) -> Result<impl PartialEq + Debug, (&str, &str)> {
    let content = |doc: &Document| (doc.json.clone(), doc.buffers.clone(), doc.kind, doc.warnings.clone());
    read.as_ref().map(content).map_err(|e| (e.place.as_str(), e.cause.as_str()))
}

/// Writes a document and reads it back.
pub(crate) fn written(doc: &Document, out: &Path) -> Document {
    doc.stage(out).unwrap().commit().unwrap();
    read(out).unwrap()
}

/// All names below a folder, sorted.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let mut names = Vec::new();
    let mut todo = vec![folder.to_owned()];
    while let Some(next) = todo.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                todo.push(path);
            } else {
                names.push(path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned());
            }
        }
    }
    names.sort();
    names
}

/// Seeded numbers (G. Marsaglia, "Xorshift RNGs", 2003).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// A number below `bound`.
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % bound as u64) as usize
    }
}
