//! Opens a bake's output in order to damage it.

use serde_json::{Value, json};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A glTF file with one buffer beside it.
pub(crate) struct Opened {
    pub(crate) json: Value,
    buffer: Vec<u8>,
}

impl Opened {
    /// Reads a file written by `raykiln bake -o FILE.gltf`.
    pub(crate) fn read(path: &Path) -> Opened {
        let json: Value = serde_json::from_slice(&fs::read(path).expect("readable")).expect("JSON");
        let uri = json["buffers"][0]["uri"].as_str().expect("a buffer beside the file");
        let buffer = fs::read(path.with_file_name(uri)).expect("readable");
        Opened { json, buffer }
    }

    /// Writes it into a folder.
    pub(crate) fn write(mut self, folder: &Path) -> PathBuf {
        self.json["buffers"][0]["uri"] = "damaged.bin".into();
        fs::write(folder.join("damaged.bin"), &self.buffer).expect("writable");
        super::write(folder, "damaged.gltf", serde_json::to_vec(&self.json).expect("JSON"))
    }

    /// The first primitive of the first mesh.
    pub(crate) fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    /// Index of the accessor of the primitive's positions.
    pub(crate) fn positions(&mut self) -> usize {
        index(&self.primitive()["attributes"]["POSITION"])
    }

    /// Index of the accessor of the primitive's indices.
    pub(crate) fn indices(&mut self) -> usize {
        index(&self.primitive()["indices"])
    }

    /// The integers of an accessor.
    pub(crate) fn numbers(&self, accessor: usize) -> Vec<u32> {
        let (bytes, width) = self.place(accessor);
        let number = |b: &[u8]| b.iter().rev().fold(0, |n, &byte| n << 8 | u32::from(byte));
        self.buffer[bytes].chunks_exact(width).map(number).collect()
    }

    /// Replaces the integers of an accessor by others, at most as many as before.
    pub(crate) fn set_numbers(&mut self, accessor: usize, numbers: &[u32]) {
        let (bytes, width) = self.place(accessor);
        assert!(numbers.len() * width <= bytes.len());
        let packed: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes().into_iter().take(width)).collect();
        self.buffer[bytes.start..bytes.start + packed.len()].copy_from_slice(&packed);
        self.json["accessors"][accessor]["count"] = numbers.len().into();
    }

    /// Adds to the first coordinate of the accessor's first position.
    pub(crate) fn move_vertex(&mut self, accessor: usize, by: f32) {
        let (bytes, _) = self.place(accessor);
        let first: &mut [u8; 4] = self.buffer[bytes].first_chunk_mut().expect("a position");
        *first = (f32::from_le_bytes(*first) + by).to_le_bytes();
        // Extends the bounds so that they stay valid.
        let bounds = &mut self.json["accessors"][accessor];
        bounds["min"][0] = (bounds["min"][0].as_f64().expect("a number") - f64::from(by)).into();
        bounds["max"][0] = (bounds["max"][0].as_f64().expect("a number") + f64::from(by)).into();
    }

    /// Moves the first node that places a mesh.
    pub(crate) fn move_instance(&mut self, by: f64) {
        let nodes = self.json["nodes"].as_array_mut().expect("nodes");
        let node = nodes.iter_mut().find(|n| n.get("mesh").is_some()).expect("a node with a mesh");
        let [x, y, z] = [0, 1, 2].map(|i| node["translation"].get(i).map_or(0.0, |x| x.as_f64().expect("a number")));
        node["translation"] = json!([x + by, y, z]);
    }

    /// The bytes of an accessor without stride, and the size of one number.
    fn place(&self, accessor: usize) -> (Range<usize>, usize) {
        let accessor = &self.json["accessors"][accessor];
        let width = match accessor["componentType"].as_u64() {
            Some(5121) => 1,
            Some(5123) => 2,
            Some(5125 | 5126) => 4,
            other => panic!("componentType {other:?}"),
        };
        let per_element = if accessor["type"] == "VEC3" { 3 } else { 1 };
        let view = &self.json["bufferViews"][index(&accessor["bufferView"])];
        let offset = |of: &Value| of["byteOffset"].as_u64().unwrap_or(0) as usize;
        let start = offset(view) + offset(accessor);
        (start..start + index(&accessor["count"]) * per_element * width, width)
    }
}

fn index(value: &Value) -> usize {
    value.as_u64().unwrap_or_else(|| panic!("no index: {value}")) as usize
}
