//! Converts MTL materials to glTF's metallic-roughness materials.
//!
//! | MTL | glTF |
//! | --- | --- |
//! | `Kd` | `baseColorFactor`, clamped to 0..1; 1 if it is zero under a `map_Kd`, which would be invisible |
//! | `d`, else 1 - `Tr` | its alpha; `alphaMode` BLEND below 1. `Tr 1` alone hides all: such a library means opacity |
//! | `map_Kd` | `baseColorTexture`; TGA, BMP, TIFF and DDS become PNG |
//! | `map_d` | the alpha of `baseColorTexture`, merged if it is another file; `alphaMode` MASK, BLEND if it is soft |
//! | `Ks` | base colour of a metal if `illum` is 3 or 5 or `Kd` is black, else `KHR_materials_specular` |
//! | `illum` 4, 6, 7, 9 with `Tf`, `d` or `Ni` | `KHR_materials_transmission`, see `look.rs` |
//! | `Ke`, `map_Ke` | `emissiveFactor`, `emissiveTexture`; above 1 `KHR_materials_emissive_strength` |
//! | `Pr`, else `Ns` | `roughnessFactor`, see [`roughness`] |
//! | `Pm` | `metallicFactor`, else 0 |
//! | `map_Pr`, else `map_Ns`; `map_Pm` | `metallicRoughnessTexture`, packed if one image cannot serve |
//! | `norm`, `map_Kn` | `normalTexture` (`-bm`: its scale), also `bump` if it has the colours of one |
//! | `Ni` above 1 | `KHR_materials_ior` |
//! | `Pc`, `Pcr`; `Ps`; `aniso`, `anisor` | `KHR_materials_clearcoat`; `_sheen`; `_anisotropy` |
//!
//! What glTF cannot express stays as written in `extras.mtl`, keyed by keyword.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::files::Files;
use super::library::{Definition, Libraries};
use super::look::{Look, roughness, single};
use super::notes::Notes;
use super::picture::{self, Channel, Grey};
use super::text::words;
use super::texture::{self, Statement, Textures};
use crate::extension_names::{
    KHR_MATERIALS_ANISOTROPY, KHR_MATERIALS_CLEARCOAT, KHR_MATERIALS_EMISSIVE_STRENGTH, KHR_MATERIALS_IOR,
    KHR_MATERIALS_SHEEN, KHR_MATERIALS_SPECULAR, KHR_MATERIALS_TRANSMISSION,
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
    /// Names of those that are seen from both sides.
    double_sided: HashSet<String>,
    /// Whether faces without a material are seen from both sides, too.
    bare_is_double_sided: bool,
    /// The material of faces without one, if it was made.
    bare: Option<usize>,
    /// Names that no library defines, in order of first use.
    undefined: Vec<String>,
    /// Keywords and options that glTF cannot express.
    unsaid: BTreeSet<String>,
    /// The materials made so far, by name and by whether faces have texture coordinates.
    made: HashMap<(String, bool), usize>,
}

impl Materials {
    /// Creates an empty list of materials from these libraries; `bare_is_double_sided` says whether faces without a
    /// material get one to be seen from both sides.
    pub(super) fn of(
        libraries: Libraries,
        files: Files,
        double_sided: HashSet<String>,
        bare_is_double_sided: bool,
    ) -> Self {
        let (list, textures, extensions) = Default::default();
        Materials {
            list,
            textures,
            extensions,
            libraries,
            files,
            double_sided,
            bare_is_double_sided,
            bare: None,
            undefined: Vec::new(),
            unsaid: BTreeSet::new(),
            made: HashMap::new(),
        }
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
        let defined = self.libraries.get(name).map(|(name, definition)| (name, definition.clone()));
        let mut material = match (defined, twin) {
            (Some((name, definition)), _) => Conversion::new(definition, textured, self, notes).material(name),
            (None, Some(twin)) => return Some(twin),
            (None, None) if name.is_empty() => return None,
            (None, None) => {
                self.undefined.push(name.to_owned());
                json!({"name": name})
            }
        };
        if self.double_sided.contains(name) {
            material["doubleSided"] = true.into();
        }
        let index = twin.filter(|&twin| self.list[twin] == material).unwrap_or(self.list.len());
        if index == self.list.len() {
            self.list.push(material);
        }
        self.made.insert(key(textured), index);
        Some(index)
    }

    /// Returns the material of faces without one: none unless they are to be seen from both sides.
    pub(super) fn bare(&mut self) -> Option<usize> {
        if self.bare.is_none() && self.bare_is_double_sided {
            self.bare = Some(self.list.len());
            self.list.push(json!({"doubleSided": true}));
        }
        self.bare
    }
}

impl Materials {
    /// Names materials that are not defined, and what glTF cannot express.
    pub(super) fn note_lacks(&self, notes: &mut Notes) {
        const MOST_NAMES: usize = 8;
        let names: Vec<String> = self.undefined.iter().take(MOST_NAMES).map(|name| format!("`{name}`")).collect();
        let names = names.join(", ");
        let message = match self.undefined.len() {
            0 => None,
            1 => Some(format!("material {names} is not defined: a default one takes its place")),
            2..=MOST_NAMES => Some(format!("materials {names} are not defined: default ones take their places")),
            n => {
                let more = n - MOST_NAMES;
                Some(format!("materials {names} and {more} more are not defined: default ones take their places"))
            }
        };
        if let Some(message) = message {
            notes.add(String::new, &message);
        }
        if !self.unsaid.is_empty() {
            let keys: Vec<String> = self.unsaid.iter().map(|key| format!("`{key}`")).collect();
            notes.add(String::new, &format!("glTF cannot express {}: kept in extras only", keys.join(", ")));
        }
    }

    /// Whether a material takes its colour from a texture.
    pub(super) fn has_color_texture(&self, material: usize) -> bool {
        self.list[material]["pbrMetallicRoughness"]["baseColorTexture"].is_object()
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
        let look = Look::of(&self.definition, self.textured);
        let opacity = if look.transmission.is_some() { 1.0 } else { self.opacity() };
        let mask = self.mask();
        out.insert("pbrMetallicRoughness".to_owned(), self.metallic_roughness(&look, opacity, mask.as_ref()));
        self.normal(&mut out);
        self.emission(&mut out);
        self.alpha_mode(opacity, mask.as_ref(), &mut out);
        self.index_of_refraction();
        self.reflection(&look);
        self.layers();
        if !self.extensions.is_empty() {
            out.insert("extensions".to_owned(), self.extensions.clone().into());
        }
        self.collect_unsaid();
        let rest = self.unsaid();
        if !rest.is_empty() {
            out.insert("extras".to_owned(), json!({"mtl": rest}));
        }
        out.into()
    }

    /// Returns `d`, or else 1 - `Tr` (`Tr` if the library has the opposite convention), in 0..1.
    fn opacity(&mut self) -> f32 {
        let convention = self.definition.opacity;
        let opacity = match (self.definition.values.dissolve, self.scalar("Tr")) {
            (Some(_), _) if convention.d_is_ignored => {
                let message = "`d 0` in all materials of a library would hide all: they are opaque";
                self.notes.add(String::new, message);
                1.0
            }
            (Some(d), _) => d as f32,
            (None, Some(tr)) if convention.tr_is_opacity => {
                let message = "`Tr 1` without `d` would hide the surface: `Tr` of this library is read as opacity";
                self.notes.add(String::new, message);
                tr
            }
            (None, Some(tr)) => 1.0 - tr,
            (None, None) => return 1.0,
        };
        self.said.extend(["d", "Tr"]);
        opacity.clamp(0.0, 1.0)
    }

    fn metallic_roughness(&mut self, look: &Look, opacity: f32, mask: Option<&Mask>) -> Value {
        let mut out = Map::new();
        let texture = self.base_texture(mask);
        let base = look.base.or(self.definition.values.diffuse.map(single));
        let unseen = base == Some([0.0; 3]) && self.said.contains("map_Kd");
        let [r, g, b] = base.filter(|_| !unseen).unwrap_or([1.0; 3]).map(|c| c.clamp(0.0, 1.0));
        if !unseen {
            self.said.insert("Kd");
        }
        if look.metallic.is_some() {
            self.said.insert("Ks");
        }
        if [r, g, b, opacity] != [1.0; 4] {
            out.insert("baseColorFactor".to_owned(), [r, g, b, opacity].map(decimal).to_vec().into());
        }
        if let Some(texture) = texture {
            out.insert("baseColorTexture".to_owned(), texture);
        }
        self.roughness_maps(look, &mut out);
        out.into()
    }

    /// Returns `map_Kd`, with the alpha of a `map_d` of another file.
    fn base_texture(&mut self, mask: Option<&Mask>) -> Option<Value> {
        let text = self.definition.values.diffuse_texture.clone();
        let Some(Mask { statement, alpha: Some((file, alpha)), .. }) = mask else {
            return self.texture("map_Kd", text);
        };
        let color = text.as_deref().map(Statement::parse);
        if color.as_ref().is_some_and(|color| !color.lies_as(statement)) {
            let message = "`map_d` lies otherwise on the surface than `map_Kd`: kept by name in extras only";
            self.notes.add(String::new, message);
            return self.texture("map_Kd", text);
        }
        let found = color.as_ref().and_then(|color| self.find(color));
        let placed = color.as_ref().unwrap_or(statement);
        let key = format!("{:?} with alpha {}", found.as_deref().map(|file| placed.key(file)), statement.key(file));
        let make = || {
            let color = found.as_deref().map(|file| placed.picture(file)).transpose()?;
            Ok(picture::with_alpha(color.as_ref(), alpha))
        };
        match self.materials.textures.made(&key, file, placed, make) {
            Ok(info) => {
                self.said.insert("map_d");
                self.said.extend(found.is_some().then_some("map_Kd"));
                Some(info)
            }
            Err(cause) => {
                self.notes.add(String::new, &format!("`map_d` cannot be merged into `map_Kd`: {cause}"));
                self.texture("map_Kd", text)
            }
        }
    }

    /// Returns `map_d`, if there is one; its alpha if it is in a file of its own.
    fn mask(&mut self) -> Option<Mask> {
        let text = self.definition.values.dissolve_texture.clone().filter(|_| self.textured)?;
        let statement = Statement::parse(&text);
        let color = self.definition.values.diffuse_texture.as_deref().map(|text| Statement::parse(text).file);
        if color.as_ref() == Some(&statement.file) && statement.is_alpha() {
            return Some(Mask { statement, alpha: None, same_file: true });
        }
        let file = self.find(&statement)?;
        let alpha = match statement.picture(&file) {
            Ok(image) => Some((file, Grey::of(&image, statement.channel))),
            Err(cause) => {
                self.notes.add(String::new, &format!("`map_d` `{}` cannot be read: {cause}", statement.file));
                None
            }
        };
        Some(Mask { statement, alpha, same_file: false })
    }

    /// Roughness and metalness. glTF stores them in the green and blue channel of one image: a grey `map_Pr` can be used
    /// as it is if nothing is metallic, and a single file for both if it has that layout; other maps are packed.
    fn roughness_maps(&mut self, look: &Look, out: &mut Map<String, Value>) {
        let (pr, pm) = (self.scalar("Pr"), self.scalar("Pm").or(look.metallic));
        let [map_pr, map_pm] = ["map_Pr", "map_Pm"].map(|key| self.unknown(key).filter(|_| self.textured));
        let [rough, metal] = [&map_pr, &map_pm].map(|text| text.as_deref().map(Statement::parse));
        let lies = |of: &Option<Statement>, channel| of.as_ref().is_some_and(|of| of.may_be_read_from(channel));
        let file = |of: &Option<Statement>| of.as_ref().map(|of| of.file.clone());
        let is_rough = lies(&rough, Channel::Green);
        let both = is_rough && lies(&metal, Channel::Blue) && file(&rough) == file(&metal);
        let rough_only = is_rough && metal.is_none() && pm.unwrap_or(0.0) <= 0.0;
        let texture = match both || rough_only {
            true => self.texture("map_Pr", map_pr.clone()).map(|info| (info, true, both)),
            false => self.packed_maps(map_pr.as_deref(), map_pm.as_deref()),
        };
        let shininess = self.definition.values.shininess.map(|exponent| exponent as f32);
        let [rough_map, metal_map] = texture.as_ref().map_or([false; 2], |(_, rough, metal)| [*rough, *metal]);
        let scalar = |value: Option<f32>, is_mapped: bool| value.filter(|value| !is_mapped || *value > 0.0);
        let metallic = scalar(pm, metal_map).unwrap_or(if metal_map { 1.0 } else { 0.0 });
        let by_shininess = look.roughness.unwrap_or_else(|| shininess.map_or(1.0, roughness));
        let rough = scalar(pr, rough_map).unwrap_or(if rough_map { 1.0 } else { by_shininess });
        self.said.extend(["Pr", "Pm"]);
        out.insert("metallicFactor".to_owned(), decimal(metallic.clamp(0.0, 1.0)));
        out.insert("roughnessFactor".to_owned(), decimal(rough.clamp(0.0, 1.0)));
        if let Some((texture, rough, metal)) = texture {
            self.said.extend(rough.then_some("map_Pr").into_iter().chain(metal.then_some("map_Pm")));
            out.insert("metallicRoughnessTexture".to_owned(), texture);
        }
    }

    /// Packs `map_Pr` (or else `map_Ns`) and `map_Pm` into one image. Also returns whether it has roughness and metalness.
    fn packed_maps(&mut self, map_pr: Option<&str>, map_pm: Option<&str>) -> Option<(Value, bool, bool)> {
        let map_ns = self.definition.values.shininess_texture.clone().filter(|_| self.textured && map_pr.is_none());
        let statements = [map_pr.or(map_ns.as_deref()), map_pm].map(|text| text.map(Statement::parse));
        let first = statements.iter().flatten().next()?.clone();
        if statements.iter().flatten().any(|other| !other.lies_as(&first)) {
            let message = "`map_Pr` and `map_Pm` lie differently on the surface: kept by name in extras only";
            self.notes.add(String::new, message);
            return None;
        }
        let [rough, metal] = statements.each_ref().map(|statement| {
            let statement = statement.as_ref()?;
            Some((self.find(statement)?, statement.clone()))
        });
        if rough.is_none() && metal.is_none() {
            return None;
        }
        let exponent = self.definition.values.shininess.map_or(1000.0, |exponent| exponent as f32);
        let read = |of: &Option<(PathBuf, Statement)>| {
            let grey = |(file, of): &(PathBuf, Statement)| of.picture(file).map(|image| Grey::of(&image, of.channel));
            of.as_ref().map(grey).transpose()
        };
        let as_roughness = |value: u8| (255.0 * roughness(exponent * f32::from(value) / 255.0)).round() as u8;
        let shiny = map_ns.is_some();
        let make = || -> Result<_, String> {
            let rough_map = read(&rough)?.map(|grey| if shiny { grey.map(as_roughness) } else { grey });
            Ok(picture::packed(rough_map.as_ref(), read(&metal)?.as_ref()))
        };
        let key_of = |of: &Option<(PathBuf, Statement)>| of.as_ref().map(|(file, of)| of.key(file));
        let key = format!("{:?} {:?} {shiny} {exponent}", key_of(&rough), key_of(&metal));
        let name = rough.as_ref().or(metal.as_ref()).map_or(Path::new(""), |(file, _)| file);
        match self.materials.textures.made(&key, name, &first, make) {
            Ok(info) => {
                self.said.extend((shiny && rough.is_some()).then_some("map_Ns"));
                Some((info, rough.is_some(), metal.is_some()))
            }
            Err(cause) => {
                self.notes.add(String::new, &format!("maps of roughness and metalness cannot be packed: {cause}"));
                None
            }
        }
    }

    /// `norm` and `map_Kn` are normal maps; bump maps are if they look so.
    fn normal(&mut self, out: &mut Map<String, Value>) {
        for key in ["norm", "map_Kn", "map_Bump", "bump"] {
            let text = self.definition.statements.iter().rev().find(|(of, _)| of == key).map(|(_, rest)| rest.clone());
            let Some(statement) = text.as_deref().map(Statement::parse).filter(|_| self.textured) else { continue };
            if key.ends_with("ump") && !self.is_normal_map(&statement) {
                continue;
            }
            if let Some(mut texture) = self.texture(key, text) {
                if statement.strength != 1.0 {
                    texture["scale"] = statement.strength.into();
                }
                out.insert("normalTexture".to_owned(), texture);
                return;
            }
        }
    }

    fn is_normal_map(&mut self, statement: &Statement) -> bool {
        self.find(statement)
            .and_then(|file| picture::read(&file).ok())
            .is_some_and(|image| picture::is_normal_map(&image))
    }

    /// Finds the image of a statement.
    fn find(&mut self, statement: &Statement) -> Option<PathBuf> {
        texture::find(&self.definition.folder, &statement.file, &mut self.materials.files, self.notes)
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

    fn alpha_mode(&mut self, opacity: f32, mask: Option<&Mask>, out: &mut Map<String, Value>) {
        let is_merged = mask.is_some_and(|mask| mask.alpha.is_some()) && self.said.contains("map_d");
        let is_same = mask.is_some_and(|mask| mask.same_file) && self.said.contains("map_Kd");
        self.said.extend(is_same.then_some("map_d"));
        let soft = mask.and_then(|mask| mask.alpha.as_ref()).is_some_and(|(_, alpha)| !alpha.is_cut_out());
        if opacity < 1.0 || is_merged && soft {
            out.insert("alphaMode".to_owned(), "BLEND".into());
        } else if is_merged || is_same {
            // glTF's default cutoff is 0.5.
            out.insert("alphaMode".to_owned(), "MASK".into());
        }
    }

    /// Glass and coloured reflections.
    fn reflection(&mut self, look: &Look) {
        if let Some(transmission) = look.transmission {
            self.said.extend(["Tf", "d", "Tr", "Ks", "illum"]);
            self.extend(KHR_MATERIALS_TRANSMISSION, json!({"transmissionFactor": decimal(transmission)}));
        }
        if look.metallic.is_some() || look.transmission.is_some() {
            return;
        }
        let Some(color) = self.definition.values.specular.map(single) else { return };
        let most = color.into_iter().fold(0.0, f32::max);
        let is_grey = color.iter().all(|c| (most - c).abs() <= 0.01);
        // Exporters write 0.5 for the reflection of common surfaces, which glTF has at 1.
        let factor = (2.0 * most).min(1.0);
        if most > 0.0 && !(is_grey && factor == 1.0) {
            let mut value = json!({"specularFactor": decimal(factor)});
            if !is_grey {
                value["specularColorFactor"] = color.map(|c| decimal((c / most).clamp(0.0, 1.0))).to_vec().into();
            }
            self.said.insert("Ks");
            self.extend(KHR_MATERIALS_SPECULAR, value);
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

    /// Records the keywords of what would change the look but that glTF cannot express.
    fn collect_unsaid(&mut self) {
        let is_white = |rest: &str| words(rest).all(|word| word.parse() == Ok(1.0f32) || word.parse() == Ok(0.0f32));
        for (key, rest) in &self.definition.statements {
            let counts = match key.as_str() {
                // What was tried has warnings of its own.
                "map_Ka" | "map_Kd" | "map_Ke" | "map_d" | "map_Pr" | "map_Pm" | "map_Ns" | "map_Kn" => false,
                "Tf" => !is_white(rest),
                "disp" | "decal" | "refl" | "bump" => true,
                _ => key.starts_with("map_"),
            };
            if counts && self.textured && !self.said.contains(key.as_str()) {
                self.materials.unsaid.insert(key.clone());
            }
            self.materials.unsaid.extend(unsaid_options(key, rest).into_iter().map(str::to_owned));
        }
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
        let is_said = |key: &str, rest: &str| self.said.contains(key) && unsaid_options(key, rest).is_empty();
        let unsaid = statements.filter(|(key, rest)| !is_said(key, rest));
        unsaid.map(|(key, rest)| (key.clone(), rest.clone().into())).collect()
    }
}

/// Returns the options of a map that glTF cannot express.
fn unsaid_options(key: &str, rest: &str) -> Vec<&'static str> {
    let is_map = key == "norm" || key == "bump" || key.starts_with("map_");
    if is_map { Statement::parse(rest).unsaid } else { Vec::new() }
}

/// `map_d`.
struct Mask {
    statement: Statement,
    /// The file and its alpha, unless it is that of `map_Kd` or cannot be read.
    alpha: Option<(PathBuf, Grey)>,
    /// Whether it is the file of `map_Kd`.
    same_file: bool,
}

/// Returns the JSON number with the decimals of the `f32`, without those of its `f64`.
fn decimal(value: f32) -> Value {
    value.to_string().parse::<f64>().unwrap_or_default().into()
}
