//! What materials and textures show.

use std::collections::BTreeMap;

use glam::DAffine2;
use serde_json::{Map, Value};

use super::super::alpha::{SOURCES, transformed};
use super::super::json::{At, unsigned};
use super::{element, extras, follow};
use crate::Document;
use crate::extension_names::*;
use crate::properties::{MaterialContent, Property, TextureUse};

/// Defaults of numbers of a material, by the property that they are below ("" for the material itself): sections
/// 5.19 to 5.23 of the glTF 2.0 specification, and the extensions' own.
const DEFAULTS: &[(&str, &str, &[f64])] = &[
    ("", "alphaCutoff", &[0.5]),
    ("", "emissiveFactor", &[0.0; 3]),
    ("pbrMetallicRoughness", "baseColorFactor", &[1.0; 4]),
    ("pbrMetallicRoughness", "metallicFactor", &[1.0]),
    ("pbrMetallicRoughness", "roughnessFactor", &[1.0]),
    ("KHR_materials_anisotropy", "anisotropyRotation", &[0.0]),
    ("KHR_materials_anisotropy", "anisotropyStrength", &[0.0]),
    ("KHR_materials_clearcoat", "clearcoatFactor", &[0.0]),
    ("KHR_materials_clearcoat", "clearcoatRoughnessFactor", &[0.0]),
    ("KHR_materials_diffuse_transmission", "diffuseTransmissionColorFactor", &[1.0; 3]),
    ("KHR_materials_diffuse_transmission", "diffuseTransmissionFactor", &[0.0]),
    ("KHR_materials_dispersion", "dispersion", &[0.0]),
    ("KHR_materials_emissive_strength", "emissiveStrength", &[1.0]),
    ("KHR_materials_ior", "ior", &[1.5]),
    ("KHR_materials_iridescence", "iridescenceFactor", &[0.0]),
    ("KHR_materials_iridescence", "iridescenceIor", &[1.3]),
    ("KHR_materials_iridescence", "iridescenceThicknessMaximum", &[400.0]),
    ("KHR_materials_iridescence", "iridescenceThicknessMinimum", &[100.0]),
    ("KHR_materials_pbrSpecularGlossiness", "diffuseFactor", &[1.0; 4]),
    ("KHR_materials_pbrSpecularGlossiness", "glossinessFactor", &[1.0]),
    ("KHR_materials_pbrSpecularGlossiness", "specularFactor", &[1.0; 3]),
    ("KHR_materials_sheen", "sheenColorFactor", &[0.0; 3]),
    ("KHR_materials_sheen", "sheenRoughnessFactor", &[0.0]),
    ("KHR_materials_specular", "specularColorFactor", &[1.0; 3]),
    ("KHR_materials_specular", "specularFactor", &[1.0]),
    ("KHR_materials_transmission", "transmissionFactor", &[0.0]),
    ("KHR_materials_volume", "attenuationColor", &[1.0; 3]),
    ("KHR_materials_volume", "thicknessFactor", &[0.0]),
];

/// Extensions that show nothing if all their properties have defaults; without properties they may be left out. The
/// workflow of specular and glossiness is not one: it replaces the other.
fn is_void_by_default(name: &str) -> bool {
    name != "KHR_materials_pbrSpecularGlossiness" && DEFAULTS.iter().any(|(owner, ..)| *owner == name)
}

pub(crate) fn material(doc: &Document, material: Option<usize>) -> MaterialContent {
    let at = material.and_then(|material| element(doc, "materials", material));
    let mut reader = Reader { doc, textures: Vec::new() };
    let mut properties = at.and_then(|at| at.value.as_object()).map(|map| reader.object("", map)).unwrap_or_default();
    if properties.get("alphaMode") != Some(&Property::Text("MASK".into())) {
        properties.remove("alphaCutoff");
    }
    reader.textures.sort_by(|a, b| a.place.cmp(&b.place));
    MaterialContent {
        name: at.and_then(|at| at.name()),
        extras: at.and_then(|at| extras(&at)),
        properties: Property::Object(properties),
        textures: reader.textures,
    }
}

struct Reader<'d> {
    doc: &'d Document,
    textures: Vec<TextureUse>,
}

impl Reader<'_> {
    /// Reads the properties of an object at a place, whose parts are separated by dots.
    fn object(&mut self, place: &str, map: &Map<String, Value>) -> BTreeMap<String, Property> {
        let owner = place.rsplit('.').next().unwrap_or_default();
        let mut read = BTreeMap::new();
        for (key, value) in map {
            let is_named = place.is_empty() && ["name", "extras"].contains(&key.as_str());
            if is_named || is_default(owner, key, value) {
                continue;
            }
            let place = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
            let property = self.property(&place, key, value);
            let is_void = property.is_empty() && (is_void_by_default(key) || VOID.contains(&key.as_str()));
            if !is_void {
                read.insert(key.clone(), property);
            }
        }
        read
    }

    fn property(&mut self, place: &str, key: &str, value: &Value) -> Property {
        let Value::Object(map) = value else { return follow::plain(value) };
        match map.get("index").and_then(unsigned).filter(|_| key.ends_with("Texture")) {
            Some(index) => self.info(place, index, map),
            None => Property::Object(self.object(place, map)),
        }
    }

    /// Reads a reference to a texture; what it samples stands under `texture`.
    fn info(&mut self, place: &str, index: usize, map: &Map<String, Value>) -> Property {
        let extension = map.get("extensions").and_then(|e| e.get(KHR_TEXTURE_TRANSFORM));
        let at = extension.map(|value| At::new(&self.doc.path, value));
        let own = map.get("texCoord").and_then(unsigned).unwrap_or(0);
        self.textures.push(TextureUse {
            place: place.to_owned(),
            texcoord: extension.and_then(|e| e.get("texCoord")).and_then(unsigned).unwrap_or(own),
            transform: at.and_then(|at| transformed(&at).ok()).unwrap_or(DAffine2::IDENTITY),
        });
        let mut rest = map.clone();
        rest.retain(|key, _| !["index", "texCoord"].contains(&key.as_str()));
        if let Some(Value::Object(extensions)) = rest.get_mut("extensions") {
            extensions.shift_remove(KHR_TEXTURE_TRANSFORM);
        }
        let mut info = self.object(place, &rest);
        let texture = element(self.doc, "textures", index).map(|at| texture(self.doc, &at));
        info.insert("texture".into(), texture.unwrap_or(Property::Null));
        Property::Object(info)
    }
}

/// Objects of the core that mean nothing without properties.
const VOID: [&str; 2] = ["pbrMetallicRoughness", "extensions"];

fn is_default(owner: &str, key: &str, value: &Value) -> bool {
    match (owner, key) {
        ("", "alphaMode") => value == "OPAQUE",
        ("", "doubleSided") => value == false,
        (owner, "scale" | "strength") if owner.ends_with("Texture") => value.as_f64() == Some(1.0),
        _ => {
            let default = DEFAULTS.iter().find(|(of, name, _)| (*of, *name) == (owner, key));
            default.is_some_and(|(_, _, default)| equals(value, default))
        }
    }
}

fn equals(value: &Value, numbers: &[f64]) -> bool {
    match value {
        Value::Array(list) => {
            list.len() == numbers.len() && list.iter().zip(numbers).all(|(v, n)| v.as_f64() == Some(*n))
        }
        _ => numbers.len() == 1 && value.as_f64() == Some(numbers[0]),
    }
}

/// Returns what a texture samples and how: its images, by the extension that names each, and its sampler.
pub(super) fn texture(doc: &Document, at: &At<'_>) -> Property {
    let mut read = BTreeMap::new();
    let mut image = |key: &str, source: Option<At<'_>>| {
        if let Some(image) = source.and_then(|source| unsigned(source.value)) {
            read.insert(key.to_owned(), Property::Image(image));
        }
    };
    image("image", at.get("source"));
    for name in SOURCES {
        image(name, at.extension(name).and_then(|e| e.get("source")));
    }
    let others = follow::extensions(doc, at);
    read.extend(others.into_iter().filter(|(name, _)| !SOURCES.contains(&name.as_str())));
    let index = at.get("sampler").and_then(|sampler| unsigned(sampler.value));
    if let Some(Property::Object(sampler)) =
        index.and_then(|i| element(doc, "samplers", i)).map(|s| follow::plain(s.value))
    {
        let repeat = Property::Number(10497.0);
        let is_told = |key: &str, value: &Property| {
            !(["name", "extras"].contains(&key) || key.starts_with("wrap") && *value == repeat)
        };
        read.extend(sampler.into_iter().filter(|(key, value)| is_told(key, value)));
    }
    Property::Object(read)
}
