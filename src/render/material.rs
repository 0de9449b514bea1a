//! Materials as they are drawn: the metallic-roughness model of glTF 2.0 in a few strokes.

use std::collections::HashMap;

use glam::{DAffine2, Vec3};
use raykiln_formats::Document;
use raykiln_formats::alpha::Wrap;
use raykiln_formats::properties::{MaterialContent, Property};

use super::texture::Sampler;
use crate::scene::Opacity;

/// A material.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Material {
    pub(super) opacity: Opacity,
    /// Linear base colour and alpha.
    pub(super) base: [f32; 4],
    pub(super) base_texture: Option<Texture>,
    pub(super) metallic: f32,
    pub(super) roughness: f32,
    /// Roughness in green, metalness in blue.
    pub(super) surface_texture: Option<Texture>,
    pub(super) emission: Vec3,
    pub(super) emission_texture: Option<Texture>,
    /// Share of the light that passes through, before the base colour tints it.
    pub(super) transmission: f32,
    /// Whether the base colour is drawn as it is.
    pub(super) is_unlit: bool,
}

/// A texture on a material.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Texture {
    /// Index into the document's images.
    pub(super) image: usize,
    /// The `n` of the attribute `TEXCOORD_n` that places it.
    pub(super) set: usize,
    pub(super) transform: DAffine2,
    pub(super) sampler: Sampler,
}

impl Material {
    /// Returns a material of a document; `None` is glTF's default material.
    pub(super) fn of(doc: &Document, material: Option<usize>, opacity: Opacity) -> Material {
        let content = doc.material_content(material);
        let all = &content.properties;
        let core = Reader { content: &content, place: "pbrMetallicRoughness" };
        let glossy = Reader { content: &content, place: "extensions.KHR_materials_pbrSpecularGlossiness" };
        let base = Material {
            opacity,
            base: core.numbers("baseColorFactor", [1.0; 4]),
            base_texture: core.texture("baseColorTexture"),
            metallic: core.numbers("metallicFactor", [1.0])[0],
            roughness: core.numbers("roughnessFactor", [1.0])[0],
            surface_texture: core.texture("metallicRoughnessTexture"),
            emission: emission(&content),
            emission_texture: Reader { content: &content, place: "" }.texture("emissiveTexture"),
            transmission: number(all, "extensions.KHR_materials_transmission.transmissionFactor").unwrap_or(0.0) as f32,
            is_unlit: at(all, "extensions.KHR_materials_unlit").is_some(),
        };
        if at(all, glossy.place).is_none() {
            return base;
        }
        Material {
            base: glossy.numbers("diffuseFactor", [1.0; 4]),
            base_texture: glossy.texture("diffuseTexture"),
            metallic: 0.0,
            roughness: 1.0 - glossy.numbers("glossinessFactor", [1.0])[0],
            surface_texture: None,
            ..base
        }
    }

    /// Returns the textures.
    pub(super) fn textures(&self) -> impl Iterator<Item = &Texture> {
        [&self.base_texture, &self.surface_texture, &self.emission_texture].into_iter().flatten()
    }
}

/// Reads properties below a place, whose parts are separated by dots.
struct Reader<'a> {
    content: &'a MaterialContent,
    place: &'a str,
}

impl Reader<'_> {
    fn path(&self, key: &str) -> String {
        if self.place.is_empty() { key.to_owned() } else { format!("{}.{key}", self.place) }
    }

    /// Returns a number or a list of numbers.
    fn numbers<const N: usize>(&self, key: &str, default: [f32; N]) -> [f32; N] {
        let read = at(&self.content.properties, &self.path(key)).map(numbers);
        let sound = |list: &Vec<f32>| list.len() == N && list.iter().all(|x| x.is_finite());
        read.filter(sound).and_then(|list| list.try_into().ok()).unwrap_or(default)
    }

    fn texture(&self, key: &str) -> Option<Texture> {
        let path = self.path(key);
        let sampled = at(&self.content.properties, &path)?.get("texture")?;
        let Property::Object(map) = sampled else { return None };
        let image = match map.get("image") {
            Some(Property::Image(image)) => *image,
            _ => map.values().find_map(|p| if let Property::Image(image) = p { Some(*image) } else { None })?,
        };
        let used = self.content.textures.iter().find(|texture| texture.place == path)?;
        let wrap = |key: &str| match sampled.get(key) {
            Some(Property::Number(33071.0)) => Wrap::Clamp,
            Some(Property::Number(33648.0)) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let nearest = sampled.get("magFilter") == Some(&Property::Number(9728.0));
        let sampler = Sampler { wrap: [wrap("wrapS"), wrap("wrapT")], nearest };
        Some(Texture { image, set: used.texcoord, transform: used.transform, sampler })
    }
}

fn emission(content: &MaterialContent) -> Vec3 {
    let factor = Reader { content, place: "" }.numbers("emissiveFactor", [0.0; 3]);
    let strength = number(&content.properties, "extensions.KHR_materials_emissive_strength.emissiveStrength");
    Vec3::from_array(factor) * strength.unwrap_or(1.0) as f32
}

/// Returns the property at a path, whose parts are separated by dots.
fn at<'p>(property: &'p Property, path: &str) -> Option<&'p Property> {
    path.split('.').try_fold(property, |property, key| property.get(key))
}

fn number(property: &Property, path: &str) -> Option<f64> {
    match at(property, path) {
        Some(Property::Number(number)) if number.is_finite() => Some(*number),
        _ => None,
    }
}

fn numbers(property: &Property) -> Vec<f32> {
    match property {
        Property::Number(number) => vec![*number as f32],
        Property::List(list) => list.iter().flat_map(numbers).collect(),
        _ => Vec::new(),
    }
}

/// Returns the materials of a document that some geometries have, by their index.
pub(super) fn of_geometries<'g>(
    doc: &Document,
    geometries: impl Iterator<Item = (Option<u32>, &'g Opacity)>,
) -> HashMap<Option<u32>, Material> {
    let mut read = HashMap::new();
    for (material, opacity) in geometries {
        read.entry(material).or_insert_with(|| Material::of(doc, material.map(|m| m as usize), *opacity));
    }
    read
}
