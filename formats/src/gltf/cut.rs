//! Cuts buffer views down to the bytes that accessors read; the rest is not written.

use std::ops::Range;

use serde_json::{Value, json};

use super::accessor::Accessor;
use super::edit::{array, push};
use super::json::unsigned;
use super::references::{self, List};
use crate::document::Document;

/// Largest gap of unused bytes that does not justify another buffer view.
const MOST_GAP: usize = 128;

/// A range of a view, and the accessors that read it.
struct Part {
    bytes: Range<usize>,
    accessors: Vec<usize>,
}

/// Replaces each view that accessors read only in part by one view per part. Views that anything else refers to stay
/// whole.
pub(super) fn cut_views(doc: &mut Document) {
    let whole = whole_views(&mut doc.json);
    let mut parts: Vec<Vec<Part>> = whole.iter().map(|_| Vec::new()).collect();
    for (view, part) in accessor_ranges(doc) {
        match part {
            Some(part) if !whole[view] => parts[view].push(part),
            _ => {}
        }
    }
    for (view, parts) in parts.into_iter().enumerate() {
        let length = doc.json["bufferViews"][view]["byteLength"].as_u64().unwrap_or(0) as usize;
        let joined = joined(parts, length);
        let used: usize = joined.iter().map(|p| p.bytes.len()).sum();
        if !joined.is_empty() && used + MOST_GAP < length {
            cut(&mut doc.json, view, &joined);
        }
    }
}

/// Whether each view must stay as it is: its bytes are compressed, or not only plain accessors refer to it.
fn whole_views(json: &mut Value) -> Vec<bool> {
    let mut whole: Vec<bool> = array(json, "bufferViews").map(|view| view.get("extensions").is_some()).collect();
    // Each reference but those of plain accessors: as many as there are, less the accessors' own.
    let mut references = vec![0_usize; whole.len()];
    references::each(json, List::Views, &mut |view| {
        if let Some(count) = unsigned(view).and_then(|view| references.get_mut(view)) {
            *count += 1;
        }
    });
    for accessor in array(json, "accessors") {
        if let Some(count) = accessor.get("bufferView").and_then(unsigned).and_then(|view| references.get_mut(view)) {
            *count -= 1;
        }
    }
    for (whole, others) in whole.iter_mut().zip(references) {
        *whole |= others > 0;
    }
    whole
}

/// Returns the view of each accessor that has one, and the range it reads. An invalid accessor reads nothing.
fn accessor_ranges(doc: &Document) -> Vec<(usize, Option<Part>)> {
    let accessors = doc.json.get("accessors").and_then(Value::as_array).into_iter().flatten();
    let views = doc.json.get("bufferViews").and_then(Value::as_array).map_or(0, Vec::len);
    let range = |(i, accessor): (usize, &Value)| {
        let view = accessor.get("bufferView").and_then(unsigned).filter(|&view| view < views)?;
        let start = accessor.get("byteOffset").map_or(Some(0), unsigned);
        let end = start.and_then(|start| start.checked_add(Accessor::read(doc, i).ok()?.stored_bytes()));
        let part = start.zip(end).map(|(start, end)| Part { bytes: start..end, accessors: vec![i] });
        Some((view, part))
    };
    accessors.enumerate().filter_map(range).collect()
}

/// Joins parts that lie close together. They start at multiples of 4, which preserves alignment.
fn joined(mut parts: Vec<Part>, length: usize) -> Vec<Part> {
    parts.sort_by_key(|p| (p.bytes.start, p.bytes.end));
    let mut joined: Vec<Part> = Vec::new();
    for part in parts {
        let end = part.bytes.end.next_multiple_of(4).min(length);
        match joined.last_mut() {
            Some(last) if part.bytes.start <= last.bytes.end + MOST_GAP => {
                last.bytes.end = last.bytes.end.max(end);
                last.accessors.extend(part.accessors);
            }
            _ => joined.push(Part { bytes: part.bytes.start / 4 * 4..end, ..part }),
        }
    }
    joined
}

fn cut(json: &mut Value, view: usize, parts: &[Part]) {
    let original = json["bufferViews"][view].clone();
    let offset = original.get("byteOffset").and_then(unsigned).unwrap_or(0);
    for (number, part) in parts.iter().enumerate() {
        let mut new = original.clone();
        new["byteOffset"] = json!(offset + part.bytes.start);
        new["byteLength"] = json!(part.bytes.len());
        let index = match number {
            0 => {
                json["bufferViews"][view] = new;
                view
            }
            _ => push(json, "bufferViews", new),
        };
        for &accessor in &part.accessors {
            let accessor = &mut json["accessors"][accessor];
            let start = accessor.get("byteOffset").and_then(unsigned).unwrap_or(0);
            accessor["bufferView"] = index.into();
            accessor["byteOffset"] = json!(start - part.bytes.start);
        }
    }
}
