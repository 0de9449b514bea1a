//! Compresses the buffer views of an output by meshopt, without loss: no filter, and indices and corners in their order.

use std::collections::HashSet;

use bytes::Bytes;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::gltf::accessor::{Accessor, view_range};
use crate::gltf::json::{At, unsigned};
use crate::meshopt;
use crate::{Document, Error};

/// What the description of a compressed view takes in the JSON, in bytes.
const DESCRIPTION: usize = 170;

/// A buffer view, compressed.
pub(in crate::gltf) struct Compressed {
    pub(in crate::gltf) stream: Bytes,
    mode: meshopt::Mode,
    count: usize,
    stride: usize,
}

/// How a buffer view is read.
#[derive(Clone, Copy, Default)]
enum Reading {
    /// Not at all.
    #[default]
    Unread,
    /// As elements of so many bytes, which may be indices.
    Elements { stride: usize, indices: bool },
    /// In ways that no mode is made for.
    Otherwise,
}

impl Reading {
    fn and(self, other: Reading) -> Reading {
        match (self, other) {
            (Reading::Unread, reading) => reading,
            (Reading::Elements { stride, indices }, Reading::Elements { stride: other, indices: also })
                if stride == other =>
            {
                Reading::Elements { stride, indices: indices && also }
            }
            _ => Reading::Otherwise,
        }
    }
}

/// Returns the compressed form of each buffer view that becomes smaller by it.
pub(in crate::gltf) fn compress(doc: &Document) -> Result<Vec<Option<Compressed>>, Error> {
    let views: Vec<At<'_>> = At::root(doc).list("bufferViews")?.collect();
    let readings = readings(doc, views.len())?;
    let compressed: Vec<_> = views.par_iter().zip(readings).map(|(view, reading)| one(doc, view, reading)).collect();
    compressed.into_iter().collect()
}

fn one(doc: &Document, view: &At<'_>, reading: Reading) -> Result<Option<Compressed>, Error> {
    let Reading::Elements { stride, indices } = reading else { return Ok(None) };
    let (buffer, range) = view_range(doc, view)?;
    let mut bytes = doc.buffers[buffer][range].to_vec();
    let length = bytes.len();
    // The last element may lack the padding after it.
    bytes.resize(length.next_multiple_of(stride), 0);
    let encoded = meshopt::encode(&bytes, stride, indices);
    let smaller = encoded.filter(|(_, stream)| stream.len() + DESCRIPTION < length);
    let count = bytes.len() / stride;
    Ok(smaller.map(|(mode, stream)| Compressed { stream: stream.into(), mode, count, stride }))
}

/// Returns how each buffer view is read. What other properties than accessors refer to is read otherwise, as far as
/// extensions are known.
fn readings(doc: &Document, views: usize) -> Result<Vec<Reading>, Error> {
    let root = At::root(doc);
    let vertices = vertex_accessors(&root)?;
    let mut readings = vec![Reading::default(); views];
    let mut read = |index: Option<At<'_>>, reading: Reading| {
        if let Some(slot) = index.and_then(|index| readings.get_mut(unsigned(index.value)?)) {
            *slot = slot.and(reading);
        }
    };
    for (i, at) in root.list("accessors")?.enumerate() {
        let accessor = Accessor::read(doc, i)?;
        let indices = accessor.kind == "SCALAR" && accessor.is_unsigned() && !vertices.contains(&i);
        read(at.get("bufferView"), Reading::Elements { stride: accessor.stride, indices });
        for part in ["indices", "values"] {
            read(at.get("sparse").and_then(|sparse| sparse.get(part)?.get("bufferView")), Reading::Otherwise);
        }
    }
    for image in root.list("images")? {
        read(image.get("bufferView"), Reading::Otherwise);
    }
    for (view, reading) in root.list("bufferViews")?.zip(&mut readings) {
        if view.get("extensions").is_some() {
            *reading = Reading::Otherwise;
        }
    }
    Ok(readings)
}

/// Returns the accessors of vertex attributes.
fn vertex_accessors(root: &At<'_>) -> Result<HashSet<usize>, Error> {
    let mut found = HashSet::new();
    for mesh in root.list("meshes")? {
        for primitive in mesh.list("primitives")? {
            let attributes = primitive.get("attributes").into_iter().chain(primitive.list("targets")?);
            let accessors = attributes.filter_map(|at| at.value.as_object()).flat_map(|all| all.values());
            found.extend(accessors.filter_map(unsigned));
        }
    }
    Ok(found)
}

impl Compressed {
    /// Bytes of the uncompressed view.
    pub(in crate::gltf) fn length(&self) -> usize {
        self.count * self.stride
    }

    /// Describes the view: its stream is at `offset` of buffer 0, and it would be at `fallback` of buffer 1.
    pub(in crate::gltf) fn describe(&self, view: &Value, offset: usize, fallback: usize) -> Value {
        let mode = meshopt::Mode::ALL.into_iter().find(|(_, mode)| *mode == self.mode).map(|(name, _)| name);
        let mut view = view.clone();
        view["buffer"] = 1.into();
        view["byteOffset"] = fallback.into();
        view["byteLength"] = self.length().into();
        view["extensions"] = json!({ super::WRITTEN: {
            "buffer": 0,
            "byteOffset": offset,
            "byteLength": self.stream.len(),
            "byteStride": self.stride,
            "count": self.count,
            "mode": mode,
        }});
        view
    }
}

/// Returns a buffer that holds nothing, but has room for the uncompressed views.
pub(in crate::gltf) fn placeholder(length: usize) -> Value {
    json!({ "byteLength": length, "extensions": { super::WRITTEN: { "fallback": true } } })
}

/// Returns `extensionsUsed` or `extensionsRequired` with the extension.
pub(in crate::gltf) fn with_extension(json: &Value, list: &str) -> Value {
    let mut names = json.get(list).and_then(Value::as_array).cloned().unwrap_or_default();
    if !names.iter().any(|name| name == super::WRITTEN) {
        names.push(super::WRITTEN.into());
    }
    names.into()
}
