//! The hash that binds a record of provenance to the geometry that it is of.

use std::collections::HashMap;

use rayon::prelude::*;
use serde_json::Value;

use super::accessor::Accessor;
use super::json::{At, unsigned};
use crate::Document;
use crate::extension_names::EXT_MESH_GPU_INSTANCING;
use crate::record::GeometryHash;

/// What of an accessor counts.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum As {
    /// All elements as they are stored.
    Elements,
    /// Corners of triangles, in any type of integer, whichever corner of a triangle comes first.
    Triangles,
    /// Indices in any type of integer.
    Indices,
}

/// Hashes the geometry of a document. Each accessor is read once, however many primitives share it.
pub(crate) fn geometry_hash(doc: &Document) -> GeometryHash {
    let root = At::root(doc);
    let list = |key| doc.json.get(key).and_then(Value::as_array).into_iter().flatten();
    let primitives = |mesh: &'_ Value| mesh.get("primitives").and_then(Value::as_array).cloned().unwrap_or_default();
    let mut wanted: Vec<(usize, As)> = Vec::new();
    let mut all = blake3::Hasher::new();
    let refer = |accessor: Option<&Value>, kind: As, wanted: &mut Vec<(usize, As)>| {
        wanted.push((accessor.and_then(unsigned).unwrap_or(usize::MAX), kind));
    };
    for mesh in list("meshes") {
        let primitives = primitives(mesh);
        all.update(&(primitives.len() as u64).to_le_bytes());
        for primitive in &primitives {
            let mode = primitive.get("mode").and_then(unsigned).unwrap_or(4);
            all.update(&(mode as u64).to_le_bytes());
            let position = primitive.get("attributes").and_then(|attributes| attributes.get("POSITION"));
            refer(position, As::Elements, &mut wanted);
            let kind = if mode == 4 { As::Triangles } else { As::Indices };
            refer(primitive.get("indices"), kind, &mut wanted);
        }
    }
    for node in root.list("nodes").into_iter().flatten() {
        let mesh = node.value.get("mesh").and_then(unsigned).unwrap_or(usize::MAX);
        all.update(&(mesh as u64).to_le_bytes());
        let copies = node.extension(EXT_MESH_GPU_INSTANCING).and_then(|copies| copies.get("attributes"));
        let attribute = |name| copies.and_then(|copies| copies.get(name));
        for name in ["TRANSLATION", "ROTATION", "SCALE"].into_iter().filter(|_| copies.is_some()) {
            refer(attribute(name).map(|at| at.value), As::Elements, &mut wanted);
        }
    }
    let hashes = hashes(doc, &wanted);
    for accessor in &wanted {
        all.update(&hashes[accessor]);
    }
    GeometryHash(*all.finalize().as_bytes())
}

fn hashes(doc: &Document, wanted: &[(usize, As)]) -> HashMap<(usize, As), [u8; 32]> {
    let mut once = wanted.to_vec();
    once.sort_unstable();
    once.dedup();
    once.into_par_iter().map(|(accessor, kind)| ((accessor, kind), hash(doc, accessor, kind))).collect()
}

/// Hashes an accessor; one that is missing or damaged counts as nothing.
fn hash(doc: &Document, accessor: usize, kind: As) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    if let Ok(accessor) = Accessor::read(doc, accessor) {
        match (kind, accessor.scalars()) {
            (As::Triangles, Some(mut corners)) => {
                corners.as_chunks_mut::<3>().0.iter_mut().for_each(begin_with_smallest);
                hasher.update(bytemuck::cast_slice(&corners));
            }
            (As::Indices, Some(indices)) => {
                hasher.update(bytemuck::cast_slice(&indices));
            }
            _ => elements(&accessor, &mut hasher),
        }
    }
    *hasher.finalize().as_bytes()
}

fn begin_with_smallest(corners: &mut [u32; 3]) {
    let smallest = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
    corners.rotate_left(smallest);
}

fn elements(accessor: &Accessor<'_>, hasher: &mut blake3::Hasher) {
    let size = accessor.element.size();
    let (bytes, stride) = accessor.bytes();
    hasher.update(&[accessor.element.component.size() as u8, u8::from(accessor.element.normalized)]);
    hasher.update(&(accessor.count as u64).to_le_bytes());
    if stride == size {
        hasher.update(&bytes[..bytes.len().min(accessor.count * size)]);
    } else {
        for element in bytes.chunks(stride).take(accessor.count) {
            hasher.update(&element[..size]);
        }
    }
}
