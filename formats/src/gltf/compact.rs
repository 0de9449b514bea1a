//! Removal of meshes, accessors and buffer views that nothing refers to.

use serde_json::Value;

use super::cut::cut_views;
use super::json::unsigned;
use super::references::{self, List};
use crate::document::Document;
use crate::edit::Compacted;

pub(crate) fn compact(doc: &mut Document) -> Compacted {
    let mut removed = Compacted {
        held_by: references::holder(&doc.json, &[List::Meshes, List::Accessors, List::Views]),
        ..Compacted::default()
    };
    if removed.held_by.is_none() {
        removed.meshes = compact_list(&mut doc.json, List::Meshes);
        removed.accessors = compact_list(&mut doc.json, List::Accessors);
        removed.buffer_views = compact_list(&mut doc.json, List::Views);
        if removed.accessors > 0 {
            doc.residuals.clear();
            cut_views(doc);
        }
    }
    // glTF forbids empty lists.
    if let Some(root) = doc.json.as_object_mut() {
        root.retain(|key, value| key == "extras" || value.as_array().is_none_or(|list| !list.is_empty()));
    }
    removed
}

/// Returns whether something refers to each buffer view. Extensions that are not known are not looked at.
pub(super) fn used_views(json: &mut Value) -> Vec<bool> {
    used(json, List::Views)
}

/// Returns whether something refers to each element of a list.
fn used(json: &mut Value, list: List) -> Vec<bool> {
    let count = json.get(list.key()).and_then(Value::as_array).map_or(0, Vec::len);
    let mut used = vec![false; count];
    references::each(json, list, &mut |reference| {
        if let Some(slot) = unsigned(reference).and_then(|i| used.get_mut(i)) {
            *slot = true;
        }
    });
    used
}

/// Removes the elements of a list that nothing refers to, and renumbers the references to the rest. Returns how many were
/// removed. Takes time linear in the size of the document.
fn compact_list(json: &mut Value, list: List) -> usize {
    let used = used(json, list);
    let count = used.len();
    let mut kept = 0;
    let mut numbers = Vec::with_capacity(count);
    for used in &used {
        numbers.push(kept);
        kept += usize::from(*used);
    }
    if kept == count {
        return 0;
    }
    let mut used = used.into_iter();
    if let Some(items) = json.get_mut(list.key()).and_then(Value::as_array_mut) {
        items.retain(|_| used.next().unwrap_or(true));
    }
    references::each(json, list, &mut |reference| {
        if let Some(number) = unsigned(reference).and_then(|i| numbers.get(i)) {
            *reference = Value::from(*number);
        }
    });
    count - kept
}
