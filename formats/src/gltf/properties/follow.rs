//! Follows references.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use bytes::Bytes;
use serde_json::Value;

use super::super::accessor::{Accessor, view_range};
use super::super::json::{At, unsigned};
use super::super::references::{self, List, table};
use super::{element, materials};
use crate::Document;
use crate::extension_names::*;
use crate::properties::Property;

/// Returns a value without following anything. The parser limits the depth.
pub(super) fn plain(value: &Value) -> Property {
    match value {
        Value::Null => Property::Null,
        Value::Bool(value) => Property::Bool(*value),
        Value::Number(number) => Property::Number(number.as_f64().unwrap_or(f64::NAN)),
        Value::String(text) => Property::Text(text.clone()),
        Value::Array(list) => Property::List(list.iter().map(plain).collect()),
        Value::Object(map) => Property::Object(map.iter().map(|(key, value)| (key.clone(), plain(value))).collect()),
    }
}

/// Returns the elements of an accessor.
fn numbers(doc: &Document, accessor: &Value) -> Option<Vec<f64>> {
    let accessor = Accessor::read(doc, unsigned(accessor)?).ok()?;
    Some(accessor.all_numbers())
}

/// The numbers of accessors, each read once: many channels of an animation may share them.
pub(super) struct Numbers<'d> {
    doc: &'d Document,
    known: HashMap<usize, Arc<[f64]>>,
}

impl<'d> Numbers<'d> {
    pub(super) fn of(doc: &'d Document) -> Numbers<'d> {
        Numbers { doc, known: HashMap::new() }
    }

    /// Returns the elements of the accessor that an index refers to; none if it is malformed.
    pub(super) fn get(&mut self, index: &Value) -> Arc<[f64]> {
        let Some(number) = unsigned(index) else { return Arc::default() };
        let doc = self.doc;
        self.known.entry(number).or_insert_with(|| numbers(doc, index).unwrap_or_default().into()).clone()
    }
}

/// Returns the extensions of an object by name, with the references of those that are known followed.
pub(super) fn extensions(doc: &Document, at: &At<'_>) -> BTreeMap<String, Property> {
    let all = at.get("extensions").and_then(|all| all.value.as_object());
    let followed = all.into_iter().flatten().map(|(name, value)| (name.clone(), extension(doc, name, value)));
    followed.filter_map(|(name, property)| Some((name, property?))).collect()
}

/// Returns an extension of a node, mesh, primitive or scene; `None` if it is compression or says nothing more.
fn extension(doc: &Document, name: &str, value: &Value) -> Option<Property> {
    let referred = |list: &str, key: &str| {
        let index = unsigned(value.get(key)?)?;
        doc.json.get("extensions")?.get(name)?.get(list)?.get(index)
    };
    match name {
        _ if table::compresses(name) => None,
        EXT_MESH_GPU_INSTANCING => copies(doc, value),
        KHR_LIGHTS_PUNCTUAL => Some(referred("lights", "light").map_or_else(|| plain(value), light)),
        EXT_LIGHTS_IMAGE_BASED => Some(referred("lights", "light").map_or_else(|| plain(value), images)),
        KHR_XMP | KHR_XMP_JSON_LD => Some(referred("packets", "packet").map_or_else(|| plain(value), plain)),
        KHR_MATERIALS_VARIANTS => Some(variants(doc, value)),
        _ => Some(referred_data(doc, name, value)),
    }
}

/// Returns what `EXT_mesh_gpu_instancing` says besides where the copies are.
fn copies(doc: &Document, value: &Value) -> Option<Property> {
    let attributes = value.get("attributes")?.as_object()?;
    let more = attributes.iter().filter(|(name, _)| !["TRANSLATION", "ROTATION", "SCALE"].contains(&name.as_str()));
    let more: BTreeMap<_, _> =
        more.filter_map(|(name, accessor)| Some((name.clone(), Property::Numbers(numbers(doc, accessor)?)))).collect();
    (!more.is_empty()).then_some(Property::Object(more))
}

/// Returns a light of `KHR_lights_punctual` without its name and without properties that equal their default.
fn light(value: &Value) -> Property {
    let Property::Object(mut light) = plain(value) else { return plain(value) };
    light.remove("name");
    let one = Property::Number(1.0);
    light.retain(|key, value| match key.as_str() {
        "intensity" => *value != one,
        "color" => *value != Property::List(vec![one.clone(); 3]),
        _ => true,
    });
    Property::Object(light)
}

/// Follows the lists of images of a light of `EXT_lights_image_based`.
fn images(light: &Value) -> Property {
    let mut followed = plain(light);
    fn follow(property: &mut Property) {
        match property {
            Property::List(list) => list.iter_mut().for_each(follow),
            Property::Number(index) => *property = Property::Image(*index as usize),
            _ => {}
        }
    }
    if let Property::Object(map) = &mut followed {
        map.get_mut("specularImages").into_iter().for_each(follow);
    }
    followed
}

/// Returns the material that each variant shows, by the variant's name.
fn variants(doc: &Document, value: &Value) -> Property {
    let root = doc.json.get("extensions").and_then(|e| e.get(KHR_MATERIALS_VARIANTS));
    let name = |index: &Value| {
        let variant = root.and_then(|root| root.get("variants")?.get(unsigned(index)?)?.get("name")?.as_str());
        variant.map_or_else(|| index.to_string(), str::to_owned)
    };
    let mut shown = BTreeMap::new();
    for mapping in value.get("mappings").and_then(Value::as_array).into_iter().flatten() {
        let material = Property::Material(mapping.get("material").and_then(unsigned));
        for variant in mapping.get("variants").and_then(Value::as_array).into_iter().flatten() {
            shown.insert(name(variant), material.clone());
        }
    }
    Property::Object(shown)
}

/// Returns an extension object with the references of its row in the table followed: accessors stand as their numbers,
/// buffer views as their bytes. Meshes keep their number, as a bake leaves those numbers alone.
fn referred_data(doc: &Document, name: &str, value: &Value) -> Property {
    let mut followed: HashMap<*const Value, Property> = HashMap::new();
    references::of_object(name, value, &mut |list, reference| {
        let property = match list {
            List::Nodes => unsigned(reference).map(Property::Node),
            List::Accessors => numbers(doc, reference).map(Property::Numbers),
            List::Views => view_bytes(doc, reference).map(Property::Bytes),
            List::Meshes => None,
        };
        followed.extend(property.map(|property| (std::ptr::from_ref(reference), property)));
    });
    textures(doc, value, &mut followed)
}

/// Returns the bytes of a buffer view.
fn view_bytes(doc: &Document, view: &Value) -> Option<Bytes> {
    let (buffer, range) = view_range(doc, &element(doc, "bufferViews", unsigned(view)?)?).ok()?;
    Some(doc.buffers[buffer].slice(range))
}

/// Returns a value in which each `texture` stands as what it samples, and each value of `followed` as its property.
fn textures(doc: &Document, value: &Value, followed: &mut HashMap<*const Value, Property>) -> Property {
    if let Some(property) = followed.remove(&std::ptr::from_ref(value)) {
        return property;
    }
    match value {
        Value::Object(map) => {
            let mut properties = BTreeMap::new();
            for (key, value) in map {
                let index = (key == "texture").then(|| unsigned(value.get("index")?)).flatten();
                let property = match index.and_then(|index| element(doc, "textures", index)) {
                    Some(at) => materials::texture(doc, &at),
                    None => textures(doc, value, followed),
                };
                properties.insert(key.clone(), property);
            }
            Property::Object(properties)
        }
        Value::Array(list) => Property::List(list.iter().map(|value| textures(doc, value, followed)).collect()),
        other => plain(other),
    }
}
