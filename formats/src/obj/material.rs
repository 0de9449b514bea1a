//! Converts MTL materials to glTF's metallic-roughness materials.
//!
//! | MTL | glTF |
//! | --- | --- |
//! | `Kd` | `baseColorFactor`, clamped to 0..1; 1 if it is zero under a `map_Kd`, which would be invisible |
//! | `d`, else 1 - `Tr` | its alpha; `alphaMode` BLEND below 1 |
//! | `map_Kd` | `baseColorTexture` |
//! | `map_d` | `alphaMode` MASK, unless `d` blends; uses its alpha only if it names the file of `map_Kd` |
//! | `Ke`, `map_Ke` | `emissiveFactor`, `emissiveTexture`; above 1 `KHR_materials_emissive_strength` |
//! | `Pr`, else `Ns` | `roughnessFactor`, see [`roughness`] |
//! | `Pm` | `metallicFactor`, else 0 |
//! | `map_Pr`, `map_Pm` | `metallicRoughnessTexture` if one image can serve, see [`Conversion::roughness_maps`] |
//! | `norm`, `map_Kn` | `normalTexture` (`-bm`: its scale); `bump` is a height and stays in extras |
//! | `Ni` above 1 | `KHR_materials_ior` |
//! | `Pc`, `Pcr`; `Ps`; `aniso`, `anisor` | `KHR_materials_clearcoat`; `_sheen`; `_anisotropy` |
//!
//! What glTF cannot express stays as written in `extras.mtl`, keyed by keyword.

use std::collections::{BTreeSet, HashMap};

use serde_json::{Map, Value, json};

use super::files::Files;
use super::library::{Definition, Libraries};
use super::notes::Notes;
use super::texture::{Statement, Textures};
use crate::extension_names::{
    KHR_MATERIALS_ANISOTROPY, KHR_MATERIALS_CLEARCOAT, KHR_MATERIALS_EMISSIVE_STRENGTH, KHR_MATERIALS_IOR,
    KHR_MATERIALS_SHEEN,
};

/// The glTF materials of a document, in order of first use.
#[derive(Debug)]
pub(super) struct Materials {
    /// `materials`.
    pub(super) list: Vec<Value>,
    /// The textures they refer to.
    pub(super) textures: Textures,
    /// The extensions they use.
    pub(super) extensions: BTreeSet<&'static str>,
    libraries: Libraries,
    files: Files,
    /// The materials made so far, by name and by whether faces have texture coordinates.
    made: HashMap<(String, bool), usize>,
}

impl Materials {
    /// Creates an empty list of materials from these libraries.
    pub(super) fn of(libraries: Libraries, files: Files) -> Self {
        let (list, textures, extensions) = Default::default();
        Materials { list, textures, extensions, libraries, files, made: HashMap::new() }
    }

    /// Returns the material of a `usemtl` name, for faces with texture coordinates (`textured`) or without; `None` for
    /// an empty name that no library defines. Any other undefined name gives glTF's default material with that name,
    /// and a warning. glTF forbids textures on faces without texture coordinates: these get a material of the same name
    /// without textures, if that differs.
    pub(super) fn index(&mut self, name: &str, textured: bool, notes: &mut Notes) -> Option<usize> {
        let key = |textured: bool| (name.to_owned(), textured);
        if let Some(&made) = self.made.get(&key(textured)) {
            return Some(made);
        }
        let twin = self.made.get(&key(!textured)).copied();
        let material = match (self.libraries.get(name).cloned(), twin) {
            (Some(definition), _) => Conversion::new(definition, textured, self, notes).material(name),
            (None, Some(twin)) => return Some(twin),
            (None, None) if name.is_empty() => return None,
            (None, None) => {
                notes.add(String::new, &format!("material `{name}` is not defined: a default one takes its place"));
                json!({"name": name})
            }
        };
        let index = twin.filter(|&twin| self.list[twin] == material).unwrap_or(self.list.len());
        if index == self.list.len() {
            self.list.push(material);
        }
        self.made.insert(key(textured), index);
        Some(index)
    }
}

/// The conversion of one material to glTF.
struct Conversion<'a> {
    definition: Definition,
    /// Whether it may have textures.
    textured: bool,
    materials: &'a mut Materials,
    notes: &'a mut Notes,
    /// Keywords that the glTF material expresses as well as MTL does.
    said: BTreeSet<&'static str>,
    extensions: Map<String, Value>,
}

impl<'a> Conversion<'a> {
    fn new(definition: Definition, textured: bool, materials: &'a mut Materials, notes: &'a mut Notes) -> Self {
        Conversion { definition, textured, materials, notes, said: BTreeSet::new(), extensions: Map::new() }
    }

    fn material(mut self, name: &str) -> Value {
        let mut out = Map::new();
        // Exporters write a material with an empty name if there is none.
        out.insert("name".to_owned(), if name.is_empty() { "(none)".into() } else { name.into() });
        let opacity = self.opacity();
        out.insert("pbrMetallicRoughness".to_owned(), self.metallic_roughness(opacity));
        self.normal(&mut out);
        self.emission(&mut out);
        self.alpha_mode(opacity, &mut out);
        self.index_of_refraction();
        self.layers();
        if !self.extensions.is_empty() {
            out.insert("extensions".to_owned(), self.extensions.clone().into());
        }
        let rest = self.unsaid();
        if !rest.is_empty() {
            out.insert("extras".to_owned(), json!({"mtl": rest}));
        }
        out.into()
    }

    /// Returns `d`, or else 1 - `Tr`, in 0..1.
    fn opacity(&mut self) -> f32 {
        let opacity = match (self.definition.values.dissolve, self.scalar("Tr")) {
            (Some(d), _) => d as f32,
            (None, Some(tr)) => 1.0 - tr,
            (None, None) => return 1.0,
        };
        self.said.extend(["d", "Tr"]);
        opacity.clamp(0.0, 1.0)
    }

    fn metallic_roughness(&mut self, opacity: f32) -> Value {
        let mut out = Map::new();
        let texture = self.texture("map_Kd", self.definition.values.diffuse_texture.clone());
        let unseen = self.definition.values.diffuse == Some([0.0; 3]) && texture.is_some();
        let [r, g, b] =
            self.definition.values.diffuse.filter(|_| !unseen).unwrap_or([1.0; 3]).map(|c| (c as f32).clamp(0.0, 1.0));
        if !unseen {
            self.said.insert("Kd");
        }
        if [r, g, b, opacity] != [1.0; 4] {
            out.insert("baseColorFactor".to_owned(), [r, g, b, opacity].map(decimal).to_vec().into());
        }
        if let Some(texture) = texture {
            out.insert("baseColorTexture".to_owned(), texture);
        }
        self.roughness_maps(&mut out);
        out.into()
    }

    /// glTF stores roughness in the green and metalness in the blue channel of one image. A grey `map_Pr` can be used
    /// if nothing is metallic, and a single file for both if it has that layout; otherwise the maps stay in extras.
    fn roughness_maps(&mut self, out: &mut Map<String, Value>) {
        let (map_pr, map_pm) = (self.unknown("map_Pr"), self.unknown("map_Pm"));
        let file = |text: &Option<String>| text.as_deref().map(|text| Statement::parse(text).file);
        let (pr, pm) = (self.scalar("Pr"), self.scalar("Pm"));
        let both = map_pr.is_some() && file(&map_pr) == file(&map_pm);
        let rough_only = map_pr.is_some() && map_pm.is_none() && pm.unwrap_or(0.0) <= 0.0;
        let texture = (both || rough_only).then(|| self.texture("map_Pr", map_pr.clone())).flatten();
        if self.textured && texture.is_none() && (map_pr.is_some() || map_pm.is_some()) {
            let message = "glTF cannot take these `map_Pr` and `map_Pm`: kept by name in extras only";
            self.notes.add(String::new, message);
        }
        let textured = texture.is_some();
        let shininess = self.definition.values.shininess.map(|exponent| roughness(exponent as f32));
        let metallic = pm.unwrap_or(if textured && both { 1.0 } else { 0.0 });
        let rough = pr.or(if textured { None } else { shininess }).unwrap_or(1.0);
        self.said.extend(["Pr", "Pm"]);
        out.insert("metallicFactor".to_owned(), decimal(metallic.clamp(0.0, 1.0)));
        out.insert("roughnessFactor".to_owned(), decimal(rough.clamp(0.0, 1.0)));
        if let Some(texture) = texture {
            self.said.extend(both.then_some("map_Pm"));
            out.insert("metallicRoughnessTexture".to_owned(), texture);
        }
    }

    fn normal(&mut self, out: &mut Map<String, Value>) {
        for key in ["norm", "map_Kn"] {
            let text = self.unknown(key);
            let scale = text.as_deref().map_or(1.0, |text| Statement::parse(text).strength);
            if let Some(mut texture) = self.texture(key, text) {
                if scale != 1.0 {
                    texture["scale"] = scale.into();
                }
                out.insert("normalTexture".to_owned(), texture);
                return;
            }
        }
    }

    fn emission(&mut self, out: &mut Map<String, Value>) {
        let texture = self.texture("map_Ke", self.unknown("map_Ke"));
        let color = self.definition.values.emissive.map(|color| color.map(|c| (c as f32).max(0.0)));
        self.said.insert("Ke");
        let color = match color.filter(|color| *color != [0.0; 3]) {
            Some(color) => color,
            None if texture.is_some() => [1.0; 3],
            None => return,
        };
        let strength = color.into_iter().fold(1.0, f32::max);
        out.insert("emissiveFactor".to_owned(), color.map(|c| decimal(c / strength)).to_vec().into());
        if let Some(texture) = texture {
            out.insert("emissiveTexture".to_owned(), texture);
        }
        if strength > 1.0 {
            self.extend(KHR_MATERIALS_EMISSIVE_STRENGTH, json!({"emissiveStrength": decimal(strength)}));
        }
    }

    fn alpha_mode(&mut self, opacity: f32, out: &mut Map<String, Value>) {
        let file = |text: &Option<String>| text.as_deref().map(|text| Statement::parse(text).file);
        let mask = file(&self.definition.values.dissolve_texture).filter(|_| self.textured);
        if opacity < 1.0 {
            out.insert("alphaMode".to_owned(), "BLEND".into());
        } else if mask.is_some() {
            // glTF's default cutoff is 0.5.
            out.insert("alphaMode".to_owned(), "MASK".into());
        }
        if mask.is_none() {
            return;
        }
        if mask == file(&self.definition.values.diffuse_texture) && self.said.contains("map_Kd") {
            self.said.insert("map_d");
        } else {
            let message = "`map_d` is another file than `map_Kd`, which glTF cannot say: kept by name in extras only";
            self.notes.add(String::new, message);
        }
    }

    fn index_of_refraction(&mut self) {
        if let Some(ior) = self.definition.values.optical_density.map(|ior| ior as f32).filter(|ior| *ior > 1.0) {
            self.said.insert("Ni");
            self.extend(KHR_MATERIALS_IOR, json!({"ior": decimal(ior)}));
        }
    }

    /// Adds clearcoat, sheen and anisotropy of the PBR extension of MTL (Exocortex, 2014).
    fn layers(&mut self) {
        let unit = |x: f32| decimal(x.clamp(0.0, 1.0));
        if let Some(coat) = self.scalar("Pc").filter(|x| *x > 0.0) {
            let roughness = self.scalar("Pcr").unwrap_or(0.0);
            let value = json!({"clearcoatFactor": unit(coat), "clearcoatRoughnessFactor": unit(roughness)});
            self.said.extend(["Pc", "Pcr"]);
            self.extend(KHR_MATERIALS_CLEARCOAT, value);
        }
        if let Some(sheen) = self.scalar("Ps").filter(|x| *x > 0.0) {
            self.said.insert("Ps");
            self.extend(KHR_MATERIALS_SHEEN, json!({"sheenColorFactor": [unit(sheen), unit(sheen), unit(sheen)]}));
        }
        if let Some(strength) = self.scalar("aniso").filter(|x| *x > 0.0) {
            let turn = self.scalar("anisor").unwrap_or(0.0);
            let radians = decimal(turn * std::f32::consts::TAU);
            self.said.extend(["aniso", "anisor"]);
            let value = json!({"anisotropyStrength": unit(strength), "anisotropyRotation": radians});
            self.extend(KHR_MATERIALS_ANISOTROPY, value);
        }
    }

    fn extend(&mut self, name: &'static str, value: Value) {
        self.materials.extensions.insert(name);
        self.extensions.insert(name.to_owned(), value);
    }

    /// Returns the texture info of a statement, if there is one that glTF supports.
    fn texture(&mut self, key: &'static str, text: Option<String>) -> Option<Value> {
        let statement = Statement::parse(&text.filter(|_| self.textured)?);
        let Materials { textures, files, .. } = &mut *self.materials;
        let info = textures.info(&statement, &self.definition.folder, files, self.notes)?;
        self.said.insert(key);
        Some(info)
    }

    fn unknown(&self, key: &str) -> Option<String> {
        self.definition.values.unknown_param.get(key).cloned()
    }

    /// Returns the value of a keyword that `tobj` leaves as text.
    fn scalar(&self, key: &str) -> Option<f32> {
        self.definition.values.unknown_param.get(key)?.parse().ok()
    }

    /// Returns the statements that the glTF material does not express, the last of each keyword.
    fn unsaid(&self) -> Map<String, Value> {
        let statements = self.definition.statements.iter();
        let unsaid = statements.filter(|(key, _)| !self.said.contains(key.as_str()));
        unsaid.map(|(key, rest)| (key.clone(), rest.clone().into())).collect()
    }
}

/// Converts a Phong exponent to perceptual roughness.
///
/// The Beckmann width of a Phong lobe of exponent n is `sqrt(2 / (n + 2))` (B. Walter, S. Marschner, H. Li,
/// K. Torrance, "Microfacet Models for Refraction through Rough Surfaces", 2007); glTF's roughness is its square root.
fn roughness(exponent: f32) -> f32 {
    (2.0 / (exponent.max(0.0) + 2.0)).sqrt().sqrt()
}

/// Returns the JSON number with the decimals of the `f32`, without those of its `f64`.
fn decimal(value: f32) -> Value {
    value.to_string().parse::<f64>().unwrap_or_default().into()
}
