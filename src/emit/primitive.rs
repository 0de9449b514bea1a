//! Meshes and primitives of the new document.

use raykiln_formats::Document;
use raykiln_formats::contents::Source;
use raykiln_formats::document::{Component, Element, NewAccessor, Target};
use serde_json::{Map, Value, json};

use super::gather::{Gathered, NewPrimitive};
use crate::scene::Scene;

/// `extras.raykiln` of a glTF object, made if missing; `None` where the file's own `extras` is no object and so has
/// no room for a key.
pub(super) fn raykiln_extras(object: &mut Value) -> Option<&mut Map<String, Value>> {
    let extras = object.as_object_mut()?.entry("extras").or_insert_with(|| json!({}));
    extras.as_object_mut()?.entry("raykiln").or_insert_with(|| json!({})).as_object_mut()
}

/// Takes off what an earlier bake recorded of the nodes it was made from: this bake's input is that bake's output.
pub(super) fn forget_sources(document: &mut Document) {
    let nodes = document.json.get_mut("nodes").and_then(Value::as_array_mut);
    for node in nodes.into_iter().flatten().filter_map(Value::as_object_mut) {
        if let Some(extras) = node.get_mut("extras").and_then(Value::as_object_mut) {
            remove_key(extras, "raykiln", "source");
            if extras.is_empty() {
                node.shift_remove("extras");
            }
        }
    }
}

/// Records on every primitive of the scene that it is the input's primitive. Those that a layout rewrites vanish
/// with their mesh; the others keep the record when meshes are renumbered.
pub(super) fn mark_untouched(document: &mut Document, scene: &Scene) {
    for mesh in &scene.meshes {
        for geometry in &mesh.geometries {
            let (m, p) = (mesh.source as usize, geometry.primitive as usize);
            if let Some(extras) = raykiln_extras(&mut document.json["meshes"][m]["primitives"][p]) {
                *extras = Map::from_iter([("source".to_owned(), json!({ "mesh": m, "primitive": p }))]);
            }
        }
    }
}

/// Adds a mesh with the gathered primitives; returns its index.
pub(super) fn push_mesh(document: &mut Document, name: &str, gathered: Gathered) -> usize {
    let primitives: Vec<Value> = gathered.primitives.into_iter().map(|p| push_primitive(document, p)).collect();
    let mut mesh = Map::new();
    if !name.is_empty() {
        mesh.insert("name".into(), name.into());
    }
    mesh.insert("primitives".into(), primitives.into());
    push(&mut document.json, "meshes", mesh.into())
}

/// Appends to one of the root object's arrays; returns the index.
pub(super) fn push(json: &mut Value, array: &str, value: Value) -> usize {
    if !json[array].is_array() {
        json[array] = json!([]);
    }
    let list = json[array].as_array_mut().expect("made an array above");
    list.push(value);
    list.len() - 1
}

fn push_primitive(document: &mut Document, new: NewPrimitive) -> Value {
    let inherited = inherited(&document.json["meshes"][new.like.0]["primitives"][new.like.1]);
    let mut primitive = Map::new();
    let attributes: Map<String, Value> =
        new.attributes.into_iter().map(|(name, data)| (name, document.push_accessor(data).into())).collect();
    primitive.insert("attributes".into(), attributes.into());
    primitive.insert("indices".into(), document.push_accessor(new.indices).into());
    if let Some(material) = new.material {
        primitive.insert("material".into(), material.into());
    }
    primitive.extend(inherited);
    let mut primitive = Value::from(primitive);
    let provenance = provenance(document, &new.sources, &new.runs);
    if let Some(extras) = raykiln_extras(&mut primitive) {
        extras.insert("provenance".into(), provenance);
    }
    primitive
}

/// What a rewritten primitive takes over from the primitives it is made of, which agree in it.
fn inherited(primitive: &Value) -> Map<String, Value> {
    let mut properties = primitive.as_object().cloned().unwrap_or_default();
    for own in ["attributes", "indices", "material", "mode", "targets"] {
        properties.shift_remove(own);
    }
    remove_key(&mut properties, "extras", "raykiln");
    remove_key(&mut properties, "extensions", "KHR_draco_mesh_compression");
    properties
}

/// Removes a key of a nested object, and the object where nothing is left in it.
pub(super) fn remove_key(object: &mut Map<String, Value>, outer: &str, key: &str) -> Option<Value> {
    let inner = object.get_mut(outer)?.as_object_mut()?;
    let removed = inner.shift_remove(key);
    if inner.is_empty() {
        object.shift_remove(outer);
    }
    removed
}

/// Adds an accessor of numbers; returns its index.
pub(super) fn push_runs(document: &mut Document, numbers: &[u32]) -> usize {
    document.push_accessor(NewAccessor {
        data: bytemuck::cast_slice(numbers).to_vec(),
        element: Element { component: Component::U32, components: 1, normalized: false },
        target: Target::Other,
        bounds: false,
    })
}

fn provenance(document: &mut Document, sources: &[Source], runs: &[[u32; 3]]) -> Value {
    let runs = push_runs(document, runs.as_flattened());
    let sources: Vec<Value> = sources.iter().map(|s| json!([s.node, s.copy, s.mesh, s.primitive])).collect();
    json!({ "sources": sources, "runs": runs })
}
