//! The files that a glTF file refers to and the number of its triangles, from its JSON alone.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::binary::{CHUNK_HEADER, HEADER, MAGIC};
use super::uri::{self, Uri};
use crate::extension_names::EXT_MESH_GPU_INSTANCING;
use crate::outline::Outline;
use crate::{Error, record};

pub(crate) fn outline(path: &Path) -> Result<Outline, Error> {
    let text = json_text(path).map_err(|e| Error::io(path, "", &e))?;
    let json: Value = serde_json::from_slice(&text).map_err(|e| Error::whole(path, e))?;
    let record = Some(record::sidecar(path)).filter(|file| file.is_file());
    let files = ["buffers", "images"].into_iter().flat_map(|list| files_of(&json, list, path)).chain(record).collect();
    let meshes: Vec<u64> = elements(&json, "meshes").map(|mesh| triangles_of(&json, mesh)).collect();
    let placed = elements(&json, "nodes").map(|node| {
        let mesh = index(node.get("mesh")).and_then(|mesh| meshes.get(mesh));
        mesh.map_or(0, |triangles| triangles.saturating_mul(copies_of(&json, node)))
    });
    Ok(Outline {
        files,
        bytes: 0,
        triangles_stored: meshes.iter().fold(0, |sum, triangles| sum.saturating_add(*triangles)),
        triangles_placed: placed.fold(0, u64::saturating_add),
    })
}

/// Reads the JSON of a file, and of a binary file no more than that.
fn json_text(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let mut text = Vec::new();
    (&mut file).take((HEADER + CHUNK_HEADER) as u64).read_to_end(&mut text)?;
    if !text.starts_with(MAGIC) {
        file.read_to_end(&mut text)?;
        return Ok(text);
    }
    let length = text.get(HEADER..HEADER + 4).and_then(|word| word.try_into().ok()).map_or(0, u32::from_le_bytes);
    text.clear();
    file.take(length.into()).read_to_end(&mut text)?;
    text.truncate(text.trim_ascii_end().iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1));
    Ok(text)
}

/// The files that the elements of a list refer to.
pub(super) fn files_of<'a>(json: &'a Value, list: &'a str, scene: &'a Path) -> impl Iterator<Item = PathBuf> + 'a {
    elements(json, list).filter_map(move |element| {
        let text = element.get("uri")?.as_str()?;
        let Uri::File(name) = uri::parse(text) else { return None };
        Some(uri::locate(uri::folder_of(scene), text, &name))
    })
}

fn elements<'a>(json: &'a Value, list: &str) -> impl Iterator<Item = &'a Value> {
    json.get(list).and_then(Value::as_array).into_iter().flatten()
}

/// The number of triangles of a mesh, as if all its primitives were lists of triangles.
fn triangles_of(json: &Value, mesh: &Value) -> u64 {
    let corners = |primitive: &Value| {
        let accessor = primitive.get("indices").or_else(|| primitive.get("attributes")?.get("POSITION"));
        count(json, accessor)
    };
    elements(mesh, "primitives").map(corners).fold(0, u64::saturating_add) / 3
}

/// The number of times that a node places its mesh.
fn copies_of(json: &Value, node: &Value) -> u64 {
    let instancing = node.get("extensions").and_then(|extensions| extensions.get(EXT_MESH_GPU_INSTANCING));
    let attributes = instancing.and_then(|instancing| instancing.get("attributes")?.as_object());
    attributes.map_or(1, |attributes| count(json, attributes.values().next()))
}

fn count(json: &Value, accessor: Option<&Value>) -> u64 {
    let accessor = index(accessor).and_then(|accessor| json.get("accessors")?.get(accessor));
    accessor.and_then(|accessor| accessor.get("count")?.as_u64()).unwrap_or(0)
}

fn index(value: Option<&Value>) -> Option<usize> {
    value.and_then(Value::as_u64).and_then(|index| usize::try_from(index).ok())
}
