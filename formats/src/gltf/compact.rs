//! Removal of meshes, accessors and buffer views that nothing refers to.

use serde_json::Value;

use super::cut::cut_views;
use super::edit::{array, each_primitive};
use super::extensions;
use super::json::unsigned;
use crate::document::Document;
use crate::edit::Compacted;
use crate::extension_names::{EXT_MESH_GPU_INSTANCING, KHR_DRACO_MESH_COMPRESSION};

/// Calls a function with every reference to the elements of one top-level list.
type Visit = fn(&mut Value, &mut dyn FnMut(&mut Value));

pub(crate) fn compact(doc: &mut Document) -> Compacted {
    let mut removed = Compacted { held_by: extensions::first_unknown(&doc.json), ..Compacted::default() };
    if removed.held_by.is_none() {
        removed.meshes = compact_list(&mut doc.json, "meshes", mesh_references);
        removed.accessors = compact_list(&mut doc.json, "accessors", accessor_references);
        removed.buffer_views = compact_list(&mut doc.json, "bufferViews", view_references);
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
    used(json, "bufferViews", view_references)
}

/// Returns whether something refers to each element of a list.
fn used(json: &mut Value, list: &str, visit: Visit) -> Vec<bool> {
    let mut used = vec![false; json.get(list).and_then(Value::as_array).map_or(0, Vec::len)];
    visit(json, &mut |reference| {
        if let Some(slot) = unsigned(reference).and_then(|i| used.get_mut(i)) {
            *slot = true;
        }
    });
    used
}

/// Removes the elements of a list that nothing refers to, and renumbers the references to the rest. Returns how many
/// were removed. Takes time linear in the size of the document.
fn compact_list(json: &mut Value, list: &str, visit: Visit) -> usize {
    let used = used(json, list, visit);
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
    if let Some(items) = json.get_mut(list).and_then(Value::as_array_mut) {
        items.retain(|_| used.next().unwrap_or(true));
    }
    visit(json, &mut |reference| {
        if let Some(number) = unsigned(reference).and_then(|i| numbers.get(i)) {
            *reference = Value::from(*number);
        }
    });
    count - kept
}

fn mesh_references(json: &mut Value, visit: &mut dyn FnMut(&mut Value)) {
    for node in array(json, "nodes") {
        node.get_mut("mesh").into_iter().for_each(&mut *visit);
    }
}

fn accessor_references(json: &mut Value, visit: &mut dyn FnMut(&mut Value)) {
    each_primitive(json, |primitive| {
        values(primitive.get_mut("attributes"), visit);
        primitive.get_mut("indices").into_iter().for_each(&mut *visit);
        for target in array(primitive, "targets") {
            values(Some(target), visit);
        }
        primitive.pointer_mut("/extras/raykiln/provenance/runs").into_iter().for_each(&mut *visit);
    });
    for skin in array(json, "skins") {
        skin.get_mut("inverseBindMatrices").into_iter().for_each(&mut *visit);
    }
    for animation in array(json, "animations") {
        for sampler in array(animation, "samplers") {
            for key in ["input", "output"] {
                sampler.get_mut(key).into_iter().for_each(&mut *visit);
            }
        }
    }
    for node in array(json, "nodes") {
        for path in ["/extras/raykiln/source/runs", "/extras/raykiln/source/nodes", "/extras/raykiln/source/meshes"] {
            node.pointer_mut(path).into_iter().for_each(&mut *visit);
        }
        let instancing = node.get_mut("extensions").and_then(|e| e.get_mut(EXT_MESH_GPU_INSTANCING));
        values(instancing.and_then(|e| e.get_mut("attributes")), visit);
    }
}

fn view_references(json: &mut Value, visit: &mut dyn FnMut(&mut Value)) {
    for accessor in array(json, "accessors") {
        for path in ["/bufferView", "/sparse/indices/bufferView", "/sparse/values/bufferView"] {
            accessor.pointer_mut(path).into_iter().for_each(&mut *visit);
        }
    }
    for image in array(json, "images") {
        image.get_mut("bufferView").into_iter().for_each(&mut *visit);
    }
    each_primitive(json, |primitive| {
        let draco = primitive.get_mut("extensions").and_then(|e| e.get_mut(KHR_DRACO_MESH_COMPRESSION));
        draco.and_then(|d| d.get_mut("bufferView")).into_iter().for_each(&mut *visit);
    });
}

/// Visits the values of all properties of an object.
fn values(object: Option<&mut Value>, visit: &mut dyn FnMut(&mut Value)) {
    let map = object.and_then(Value::as_object_mut);
    map.into_iter().flat_map(|map| map.values_mut()).for_each(visit);
}
