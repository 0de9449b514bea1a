//! What changes to the JSON of a document are made of.

use bytes::Bytes;
use serde_json::{Map, Number, Value, json};

use crate::document::{Component, Document, Element};
use crate::edit::{NewAccessor, Target};

/// Returns the elements of an array property; none if it is absent or not an array.
pub(crate) fn array<'v>(object: &'v mut Value, key: &str) -> std::slice::IterMut<'v, Value> {
    object.get_mut(key).and_then(Value::as_array_mut).map(|list| list.iter_mut()).unwrap_or_default()
}

/// Calls a function for every primitive.
pub(super) fn each_primitive(json: &mut Value, mut change: impl FnMut(&mut Value)) {
    for mesh in array(json, "meshes") {
        array(mesh, "primitives").for_each(&mut change);
    }
}

/// Appends to a top-level list, creating it if needed; returns the index of the new element.
pub(crate) fn push(json: &mut Value, list: &str, item: Value) -> usize {
    if !json.is_object() {
        *json = Value::Object(Map::new());
    }
    append(&mut json[list], item)
}

/// Appends to a list, replacing any value that is not one; returns the index of the new element.
pub(crate) fn append(list: &mut Value, item: Value) -> usize {
    match list.as_array_mut() {
        Some(all) => {
            all.push(item);
            all.len() - 1
        }
        None => {
            *list = Value::Array(vec![item]);
            0
        }
    }
}

/// Removes a key of a nested object, and the object where nothing is left in it.
pub(crate) fn remove_key(object: &mut Map<String, Value>, outer: &str, key: &str) -> Option<Value> {
    let inner = object.get_mut(outer)?.as_object_mut()?;
    let removed = inner.shift_remove(key);
    if inner.is_empty() {
        object.shift_remove(outer);
    }
    removed
}

pub(crate) fn add_accessor(doc: &mut Document, new: NewAccessor) -> usize {
    let NewAccessor { data, element, target, bounds } = new;
    let bounds = bounds.then(|| min_max(&data, element)).flatten();
    let count = data.len() / element.size();
    let stride = match target {
        Target::Vertices => element.size().next_multiple_of(4),
        Target::Indices | Target::Other => element.size(),
    };
    let data = pad(data, element.size(), stride);
    let mut view = json!({ "buffer": 0, "byteLength": data.len() });
    if stride != element.size() {
        view["byteStride"] = stride.into();
    }
    match target {
        Target::Vertices => view["target"] = 34962.into(),
        Target::Indices => view["target"] = 34963.into(),
        Target::Other => {}
    }
    let buffer = push(&mut doc.json, "buffers", json!({ "byteLength": data.len() }));
    view["buffer"] = buffer.into();
    doc.buffers.resize(buffer, Bytes::new());
    doc.buffers.push(data.into());
    let view = push(&mut doc.json, "bufferViews", view);
    let mut accessor = json!({ "bufferView": view, "componentType": element.component as u32 });
    if element.normalized {
        accessor["normalized"] = true.into();
    }
    accessor["count"] = count.into();
    accessor["type"] = kind(element).into();
    if let Some((min, max)) = bounds {
        accessor["min"] = min;
        accessor["max"] = max;
    }
    push(&mut doc.json, "accessors", accessor)
}

/// Spreads elements to a larger stride, padded with zeros.
fn pad(data: Vec<u8>, size: usize, stride: usize) -> Vec<u8> {
    if size == stride {
        return data;
    }
    let mut padded = vec![0; data.len() / size * stride];
    for (to, from) in padded.chunks_exact_mut(stride).zip(data.chunks_exact(size)) {
        to[..size].copy_from_slice(from);
    }
    padded
}

fn kind(element: Element) -> &'static str {
    match element.components {
        1 => "SCALAR",
        2 => "VEC2",
        3 => "VEC3",
        _ => "VEC4",
    }
}

/// Returns the smallest and largest value of each component, as stored; `None` if empty or one is infinite.
fn min_max(data: &[u8], element: Element) -> Option<(Value, Value)> {
    let mut bounds = vec![(f64::INFINITY, f64::NEG_INFINITY); element.components];
    let size = element.component.size();
    for vector in data.chunks_exact(element.size()) {
        for ((min, max), c) in bounds.iter_mut().zip(vector.chunks_exact(size)) {
            let x = element.component.number(c);
            (*min, *max) = (min.min(x), max.max(x));
        }
    }
    let number = |x: f64| -> Option<Value> {
        // Adding zero turns -0 into 0. The shortest text of a widened f32 parses back to the same f32.
        let number = Number::from_f64(x + 0.0)?;
        Some(if element.component == Component::F32 { number.into() } else { Value::from(x as i64) })
    };
    let min: Option<Vec<Value>> = bounds.iter().map(|(min, _)| number(*min)).collect();
    let max: Option<Vec<Value>> = bounds.iter().map(|(_, max)| number(*max)).collect();
    Some((min?.into(), max?.into()))
}
