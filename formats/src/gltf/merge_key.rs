//! Determines which primitives may be joined.

use std::fmt::Write;

use serde_json::Value;

use super::accessor::Accessor;
use super::json::At;
use super::references::table::compresses;

/// Returns a text that is equal for primitives with the same vertex attributes, extensions and extras. Positions,
/// normals and tangents count as 32-bit floats, because joining transforms them; provenance is ignored.
pub(super) fn merge_key(primitive: &At<'_>, attributes: &[(&str, Accessor<'_>)]) -> String {
    let mut types: Vec<String> = attributes.iter().map(|(name, accessor)| attribute_type(name, accessor)).collect();
    types.sort_unstable();
    let mut key = types.join(" ");
    let hidden: [(&str, IsHidden); 2] = [("extensions", compresses), ("extras", |key| key == "raykiln")];
    for (property, hidden) in hidden {
        key.push('|');
        if let Some(at) = primitive.get(property) {
            write_canonical(&mut key, at.value, Some(hidden));
        }
    }
    key
}

/// Whether a property does not count.
type IsHidden = fn(&str) -> bool;

fn attribute_type(name: &str, accessor: &Accessor<'_>) -> String {
    let e = accessor.element;
    match name {
        "POSITION" | "NORMAL" | "TANGENT" => format!("{name}:F32x{}", e.components),
        _ => format!("{name}:{:?}x{}{}", e.component, e.components, if e.normalized { "n" } else { "" }),
    }
}

/// Writes JSON with sorted properties; an object that contains only what is `hidden` counts as absent. The parser limits the
/// depth.
fn write_canonical(out: &mut String, value: &Value, hidden: Option<IsHidden>) {
    match value {
        Value::Object(map) => {
            let mut entries: Vec<_> = map.iter().filter(|(key, _)| !hidden.is_some_and(|hidden| hidden(key))).collect();
            if entries.is_empty() && hidden.is_some() {
                return;
            }
            entries.sort_unstable_by_key(|(key, _)| *key);
            out.push('{');
            for (key, value) in entries {
                // Writing to a string cannot fail.
                let _ = write!(out, "{}:", Value::from(key.as_str()));
                write_canonical(out, value, None);
                out.push(',');
            }
            out.push('}');
        }
        Value::Array(list) => {
            out.push('[');
            for value in list {
                write_canonical(out, value, None);
                out.push(',');
            }
            out.push(']');
        }
        other => {
            let _ = write!(out, "{other}");
        }
    }
}
