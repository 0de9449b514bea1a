//! Reads and writes the record of provenance: `extras.raykiln.record` of the root, or a file beside the scene.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Map, Value, json};

use super::geometry_hash::geometry_hash;
use crate::Document;
use crate::edit::raykiln_extras;
use crate::record::{self, GeometryHash, Provenance, Record};

const SCHEMA: &str = "raykiln.record/1";

/// Uncompressed bytes of a record that any file may have.
const LEAST_LIMIT: u64 = 16 << 20;

/// Uncompressed bytes of a record per byte of its text and of the file's buffers, at most.
const PER_BYTE: u64 = 16;

/// Returns what a document says of its provenance, and the hash of its geometry.
pub(super) fn provenance(doc: &Document) -> (Provenance, GeometryHash) {
    let geometry = geometry_hash(doc);
    let in_file = doc.json.get("extras").and_then(|extras| extras.get("raykiln")?.get("record"));
    let provenance = match in_file.or(doc.sidecar.as_ref()) {
        None => Provenance::Unrecorded,
        Some(record) => read(record, geometry, doc).unwrap_or_else(Provenance::Damaged),
    };
    (provenance, geometry)
}

fn read(record: &Value, geometry: GeometryHash, doc: &Document) -> Result<Provenance, &'static str> {
    let text = |key| record.get(key).and_then(Value::as_str);
    if text("schema") != Some(SCHEMA) {
        return Err("it is of another version");
    }
    if text("geometry").ok_or("it lacks the hash of the geometry")?.parse::<GeometryHash>()? != geometry {
        return Ok(Provenance::Stale);
    }
    let input = text("input").ok_or("it lacks the hash of the input")?.parse()?;
    let origins = text("origins").ok_or("it lacks its origins")?;
    let bytes = STANDARD.decode(origins).map_err(|_| "its origins are not base64")?;
    let most = PER_BYTE.saturating_mul(origins.len() as u64 + doc.distinct_bytes());
    let record = record::decode(input, &bytes, most.saturating_add(LEAST_LIMIT))?;
    Ok(Provenance::Recorded(Arc::new(record)))
}

/// Returns a record as JSON, bound to the geometry that a document has now.
pub(crate) fn to_json(record: &Record, doc: &Document) -> Value {
    json!({
        "schema": SCHEMA,
        "input": record.input.to_string(),
        "geometry": geometry_hash(doc).to_string(),
        "origins": STANDARD.encode(record::encode(record)),
    })
}

/// Puts a record into the root's extras; returns whether they have room for it.
pub(crate) fn put(doc: &mut Document, record: Value) -> bool {
    let place = raykiln_extras(&mut doc.json);
    place.map(|extras| *extras = Map::from_iter([("record".to_owned(), record)])).is_some()
}

/// Largest size of a record beside a file.
const MOST_BYTES: u64 = 1 << 30;

/// Reads the record that lies beside a scene; `None` if there is none, or it is not JSON.
pub(super) fn beside(scene: &Path) -> Option<Value> {
    let file = File::open(record::sidecar(scene)).ok().filter(|file| file.metadata().is_ok_and(|m| m.is_file()))?;
    let mut text = Vec::new();
    file.take(MOST_BYTES).read_to_end(&mut text).ok()?;
    serde_json::from_slice(&text).ok()
}
