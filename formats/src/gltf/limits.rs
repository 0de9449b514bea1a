//! What a file may unfold to: accessors, meshes and copies can be referred to any number of times, so that a small file
//! could otherwise exhaust memory and time.
//!
//! Whatever is referred to once takes at least one byte of a buffer per element, so that no limit rejects it.

use std::collections::{BTreeSet, HashSet};

use serde_json::Value;

use super::json::unsigned;
use crate::{Document, Error};

/// Positions, each accessor counted once, that any file may have: 96 MiB of them.
const POSITIONS: u64 = 1 << 23;
/// Triangles, each primitive counted, that any file may have.
const TRIANGLES: u64 = 1 << 22;
/// Copies of meshes by `EXT_mesh_gpu_instancing`, each node counted, that any file may have.
const COPIES: u64 = 1 << 19;
/// A single accessor that claims this many elements is not counted here, but reported at its own place.
const MOST: u64 = 1 << 30;

/// Rejects files whose primitives have more positions or triangles than bytes.
pub(super) fn check_meshes(doc: &Document) -> Result<(), Error> {
    let meshes = doc.json.get("meshes").and_then(Value::as_array).into_iter().flatten();
    let primitives = || meshes.clone().flat_map(|mesh| mesh["primitives"].as_array().into_iter().flatten());
    let count = |accessor: usize| {
        let count = doc.json["accessors"].get(accessor).and_then(|accessor| unsigned(&accessor["count"]));
        count.map_or(0, |count| count as u64).min(MOST)
    };
    let position = |primitive: &Value| unsigned(&primitive["attributes"]["POSITION"]);
    let accessors: BTreeSet<usize> = primitives().filter_map(position).collect();
    check(doc, "vertices", POSITIONS, accessors.into_iter().map(count).filter(|count| *count < MOST).sum())?;
    let triangles = |primitive: &Value| {
        let corners = unsigned(&primitive["indices"]).or_else(|| position(primitive)).map_or(0, count);
        if matches!(unsigned(&primitive["mode"]), None | Some(4)) { corners / 3 } else { corners }
    };
    check(doc, "triangles", TRIANGLES, primitives().map(triangles).filter(|count| *count < MOST / 3).sum())
}

/// Rejects files whose nodes place more copies than there are bytes; `placed` is the number so far.
pub(super) fn check_copies(doc: &Document, placed: u64) -> Result<(), Error> {
    check(doc, "copies", COPIES, placed)
}

fn check(doc: &Document, what: &str, always: u64, total: u64) -> Result<(), Error> {
    if total <= always {
        return Ok(());
    }
    let most = always.max(doc.distinct_bytes());
    if total <= most {
        return Ok(());
    }
    let place = if what == "copies" { "nodes" } else { "meshes" };
    let cause = format_args!(
        "there are {total} {what} in all, because parts of the file are used many times; a file of this size can have \
         at most {most}"
    );
    Err(Error::at(&doc.path, place, cause))
}

impl Document {
    /// The number of bytes of all buffers; those of a file that several buffers name count once.
    pub(crate) fn distinct_bytes(&self) -> u64 {
        let mut starts = HashSet::new();
        let own = self.buffers.iter().filter(|buffer| starts.insert(buffer.as_ptr()));
        own.map(|buffer| buffer.len() as u64).sum()
    }
}
