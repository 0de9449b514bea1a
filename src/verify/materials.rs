//! Matches the materials of two files that have no provenance.

use std::collections::HashMap;

use super::compare::material;
use super::{Side, Sides};
use crate::scene::{Material, Opacity, Scene, TriangleRef};

/// The materials of two scenes, grouped by name or by look.
pub(super) struct Materials {
    by_name: bool,
    /// The kind of each material of each scene; the default material comes last.
    kinds: Sides<Vec<u32>>,
    /// The name of each kind.
    words: Vec<String>,
}

impl Materials {
    /// Names count if every material in use has one, in both scenes; the default material is then separate, and
    /// materials of the first scene that differ only in name are one, since tools join them. Otherwise
    /// [`Material::look`], alpha mode and sides count, as a tool that drops names, or writes only some, cannot be
    /// expected to keep them.
    pub(super) fn of(scenes: Sides<&Scene>) -> Materials {
        let are_named = |scene| shown(scene).all(|m| m.name.is_some());
        Materials::grouped(scenes, are_named(scenes.before) && are_named(scenes.after))
    }

    fn grouped(scenes: Sides<&Scene>, by_name: bool) -> Materials {
        let (mut found, mut words) = (HashMap::new(), Vec::new());
        let mut kind = |key: String| {
            *found.entry(key).or_insert_with_key(|key| {
                words.push(key.clone());
                words.len() as u32 - 1
            })
        };
        let default = Material::default();
        let twins = twins(scenes.before);
        let mut key = |material: &Material| match &material.name {
            _ if !by_name => kind(look(material)),
            None => kind("(none)".into()),
            Some(name) => kind(format!("`{}`", twins.get(name.as_str()).unwrap_or(&name.as_str()))),
        };
        let kinds = scenes.map(|scene| scene.materials.iter().chain([&default]).map(&mut key).collect());
        Materials { by_name, kinds, words }
    }

    /// Like [`Materials::of`]; but where both files have the same list of materials, each material is a kind of its own,
    /// and elsewhere names do not count.
    pub(super) fn in_place(scenes: Sides<&Scene>) -> Materials {
        if scenes.before.materials != scenes.after.materials {
            return Materials::grouped(scenes, false);
        }
        let count = scenes.before.materials.len() as u32 + 1;
        let words = (0..count).map(|i| format!("number {i}")).collect();
        Materials { by_name: false, kinds: scenes.map(|_| (0..count).collect()), words }
    }

    /// Whether materials are grouped by name.
    pub(super) fn are_named(&self) -> bool {
        self.by_name
    }

    /// Returns the kind of material of a triangle of either scene.
    pub(super) fn kind(&self, side: Side, scene: &Scene, at: TriangleRef) -> u32 {
        let kinds = &self.kinds[side];
        kinds[material(scene, at).map_or(kinds.len() - 1, |m| m as usize)]
    }

    /// Returns the name of a kind.
    pub(super) fn name(&self, kind: u32) -> &str {
        &self.words[kind as usize]
    }
}

/// Returns the materials used by a scene's geometries.
fn shown(scene: &Scene) -> impl Iterator<Item = &Material> {
    let geometries = scene.meshes.iter().flat_map(|mesh| &mesh.geometries);
    geometries.filter_map(|geometry| geometry.material).map(|m| &scene.materials[m as usize])
}

/// Maps each material name of a scene to that of the first material that equals it in all else.
fn twins(scene: &Scene) -> HashMap<&str, &str> {
    let mut twins = HashMap::new();
    for material in &scene.materials {
        let twin = material.same_as.map_or(material, |first| &scene.materials[first]);
        if let (Some(name), Some(of)) = (&material.name, &twin.name) {
            twins.entry(name.as_str()).or_insert(of.as_str());
        }
    }
    twins
}

fn look(material: &Material) -> String {
    let Material { opacity, double_sided, look, .. } = material;
    let sides = if *double_sided { ", double-sided" } else { "" };
    let textures: Vec<&str> = ["base color", "metallic and roughness", "normal", "occlusion", "emissive"]
        .into_iter()
        .zip(look.textures)
        .filter_map(|(name, has)| has.then_some(name))
        .collect();
    // As tools write it.
    let opacity = match opacity {
        Opacity::Mask { cutoff } => format!("Mask {{ cutoff: {:?} }}", *cutoff as f32),
        other => format!("{other:?}"),
    };
    let textured = if textures.is_empty() { String::new() } else { format!(", textures: {}", textures.join(", ")) };
    format!(
        "of base color {:?}, metallic {}, roughness {}, emissive {:?}, {opacity}{sides}{textured}",
        look.base_color, look.metallic, look.roughness, look.emissive
    )
}

#[cfg(test)]
mod tests {
    use super::super::test_scenes::{cube, scene};
    use super::*;
    use glam::DAffine3;

    /// Returns a scene with a cube for each material, and one for the default material.
    fn of(materials: Vec<Material>) -> Scene {
        let meshes = (0..=materials.len()).map(|i| cube(i as u32, (i < materials.len()).then_some(i as u32)));
        let places: Vec<_> = (0..=materials.len()).map(|i| (i as u32, DAffine3::IDENTITY)).collect();
        let mut scene = scene(meshes.collect(), &places);
        scene.materials = materials;
        scene
    }

    fn colored(name: Option<&str>, red: f64) -> Material {
        let mut material = Material { name: name.map(Into::into), ..Material::default() };
        material.look.base_color[0] = red;
        material
    }

    fn kinds(materials: &Materials, side: Side, scene: &Scene) -> Vec<u32> {
        let of = |instance| materials.kind(side, scene, TriangleRef { instance, triangle: 0 });
        (0..scene.instances.len() as u32).map(of).collect()
    }

    #[test]
    fn names_count_where_all_have_them() {
        let scenes = [of(vec![colored(Some("a"), 0.1), colored(Some("b"), 0.2)]), of(vec![colored(Some("b"), 0.9)])];
        let found = Materials::of([&scenes[0], &scenes[1]].into());
        assert!(found.are_named());
        assert_eq!(kinds(&found, Side::Before, &scenes[0]), [0, 1, 2]);
        assert_eq!(kinds(&found, Side::After, &scenes[1]), [1, 2]);
        assert_eq!([found.name(0), found.name(2)], ["`a`", "(none)"]);
    }

    #[test]
    fn materials_of_the_input_that_differ_in_name_alone_may_be_joined() {
        let twin = Material { same_as: Some(1), ..colored(Some("c"), 0.2) };
        let scenes =
            [of(vec![colored(Some("a"), 0.1), colored(Some("b"), 0.2), twin]), of(vec![colored(Some("c"), 0.2)])];
        let found = Materials::of([&scenes[0], &scenes[1]].into());
        assert_eq!(kinds(&found, Side::Before, &scenes[0]), [0, 1, 1, 2]);
        assert_eq!(kinds(&found, Side::After, &scenes[1]), [1, 2]);
    }

    #[test]
    fn looks_count_where_one_has_no_name() {
        let scenes = [of(vec![colored(Some("a"), 0.1), colored(Some("b"), 0.2)]), of(vec![colored(None, 0.2)])];
        let found = Materials::of([&scenes[0], &scenes[1]].into());
        assert!(!found.are_named());
        assert_eq!(kinds(&found, Side::After, &scenes[1]), kinds(&found, Side::Before, &scenes[0])[1..]);
        assert!(found.name(0).starts_with("of base color [0.1, 1.0, 1.0, 1.0]"), "{}", found.name(0));
    }

    #[test]
    fn all_that_makes_a_look_tells_materials_apart() {
        let changes: [fn(&mut Material); 7] = [
            |m| m.look.metallic = 0.0,
            |m| m.look.roughness = 0.5,
            |m| m.look.emissive[2] = 1.0,
            |m| m.look.textures[0] = true,
            |m| m.look.textures[4] = true,
            |m| m.double_sided = true,
            |m| m.opacity = Opacity::Mask { cutoff: 0.5 },
        ];
        let changed = changes.map(|change| {
            let mut material = Material::default();
            change(&mut material);
            material
        });
        let scene = of(changed.to_vec());
        assert_eq!(kinds(&Materials::of([&scene, &scene].into()), Side::Before, &scene), (0..8).collect::<Vec<_>>());
    }

    #[test]
    fn a_material_that_nothing_shows_needs_no_name() {
        let mut scene = of(vec![colored(Some("a"), 0.1), Material::default()]);
        scene.instances.remove(1);
        scene.meshes[1].geometries.iter_mut().for_each(|g| g.material = None);
        assert!(Materials::of([&scene, &scene].into()).are_named());
    }
}
