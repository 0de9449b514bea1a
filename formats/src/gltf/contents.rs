//! Converts JSON to [`Contents`], with all checks.

use std::collections::HashMap;

use rayon::prelude::*;
use serde_json::Value;

use super::accessor::Accessor;
use super::animation::mark_animated;
use super::json::At;
use super::positions::Positions;
use super::{extensions, limits, node, primitive, provenance, references};
use crate::contents::{Camera, Look, Material, Mesh, Node, Opacity};
use crate::{Contents, Document, Error, ReadOptions, Warning};

pub(crate) fn contents(doc: &Document, options: ReadOptions) -> Result<Contents, Error> {
    let root = At::root(doc);
    root.object()?;
    extensions::check_required(&root)?;
    let mut warnings = Vec::new();
    let mut nodes = node::nodes(doc, &mut warnings)?;
    check_skins(doc, nodes.len())?;
    let roots = scenes(&root, &mut nodes)?;
    mark_animated(doc, &mut nodes)?;
    let holds = references::holds(doc);
    for ((node, hold), hidden) in nodes.iter_mut().zip(holds.nodes).zip(holds.hidden) {
        (node.hold, node.hidden) = (hold, hidden);
    }
    warnings.extend(holds.warnings);
    let materials = materials(&root, &mut warnings)?;
    let cameras = root.list("cameras")?.map(|at| camera(&at)).collect::<Result<_, _>>()?;
    let mut meshes = meshes(doc, options, &mut warnings)?;
    meshes.iter_mut().zip(holds.meshes).for_each(|(mesh, hold)| mesh.hold = hold);
    let (provenance, geometry) = provenance::provenance(doc);
    Ok(Contents { nodes, roots, meshes, materials, cameras, provenance, geometry, warnings })
}

/// Reads all meshes in parallel; reports the first error in file order.
fn meshes(doc: &Document, options: ReadOptions, warnings: &mut Vec<Warning>) -> Result<Vec<Mesh>, Error> {
    limits::check_meshes(doc)?;
    let places: Vec<At<'_>> = At::root(doc).list("meshes")?.collect();
    let positions = Positions::new(doc);
    let read: Vec<_> = places.par_iter().map(|at| primitive::mesh(doc, at, &positions, options)).collect();
    let mut meshes = Vec::with_capacity(read.len());
    for result in read {
        let (mesh, found) = result?;
        meshes.push(mesh);
        warnings.extend(found);
    }
    Ok(meshes)
}

fn check_skins(doc: &Document, nodes: usize) -> Result<(), Error> {
    for skin in At::root(doc).list("skins")? {
        for joint in skin.list("joints")? {
            joint.index_into("nodes", nodes)?;
        }
        skin.index("skeleton", "nodes", nodes)?;
        if let Some(index) = skin.get("inverseBindMatrices") {
            Accessor::referred(doc, &index)?;
        }
    }
    Ok(())
}

/// Returns the roots of the default scene, and marks the nodes shown by other scenes.
pub(super) fn scenes(root: &At<'_>, nodes: &mut [Node]) -> Result<Vec<usize>, Error> {
    let count = root.count("scenes");
    let default = root.index("scene", "scenes", count)?.unwrap_or(0);
    let mut roots = Vec::new();
    let mut others = Vec::new();
    let mut last_shown_by = vec![None; nodes.len()];
    for (i, scene) in root.list("scenes")?.enumerate() {
        for at in scene.list("nodes")? {
            let node = at.index_into("nodes", nodes.len())?;
            if let Some(parent) = nodes[node].parent {
                return Err(at.error(format_args!("nodes[{node}] is not a root; it is a child of nodes[{parent}]")));
            }
            if last_shown_by[node].replace(i) == Some(i) {
                return Err(at.error(format_args!("nodes[{node}] is listed twice")));
            }
            if i == default { roots.push(node) } else { others.push(node) }
        }
    }
    let mut shown = vec![false; nodes.len()];
    node::mark_below(nodes, others, &mut shown);
    for (node, shown) in nodes.iter_mut().zip(shown) {
        node.in_other_scene = shown;
    }
    if count == 0 {
        roots = (0..nodes.len()).filter(|i| nodes[*i].parent.is_none()).collect();
    }
    Ok(roots)
}

fn materials(root: &At<'_>, warnings: &mut Vec<Warning>) -> Result<Vec<Material>, Error> {
    let mut first = HashMap::new();
    let with_twin = |(i, at): (usize, At<'_>)| {
        let material = material(&at, warnings)?;
        let same_as = Some(*first.entry(content(at.value)).or_insert(i)).filter(|&first| first < i);
        Ok(Material { same_as, ..material })
    };
    root.list("materials")?.enumerate().map(with_twin).collect()
}

/// Returns the content of a material except for name and extras, independent of order.
fn content(material: &Value) -> String {
    let mut content = material.clone();
    if let Some(all) = content.as_object_mut() {
        all.retain(|key, _| !["name", "extras"].contains(&key.as_str()));
    }
    content.sort_all_objects();
    content.to_string()
}

fn material(at: &At<'_>, warnings: &mut Vec<Warning>) -> Result<Material, Error> {
    at.object()?;
    let opacity = match at.get("alphaMode").map_or(Ok("OPAQUE"), |mode| mode.string())? {
        "OPAQUE" => Opacity::Opaque,
        "MASK" => Opacity::Mask { cutoff: at.get("alphaCutoff").map_or(Ok(0.5), |cutoff| cutoff.number())? },
        "BLEND" => Opacity::Blend,
        other => {
            warnings.push(at.warning(format_args!("the alphaMode \"{other}\" is unknown; OPAQUE is assumed")));
            Opacity::Opaque
        }
    };
    let double_sided = at.get("doubleSided").map_or(Ok(false), |sided| sided.boolean())?;
    Ok(Material { name: at.name(), opacity, double_sided, look: look(at), same_as: None })
}

/// Returns the look of a material. Invalid properties are ignored, because no ray depends on them.
fn look(at: &At<'_>) -> Look {
    let default = Look::default();
    let pbr = at.get("pbrMetallicRoughness");
    let number = |key| pbr.as_ref().and_then(|pbr| pbr.get(key)?.number().ok()).map(six_digits);
    let base_color = pbr.as_ref().and_then(|pbr| pbr.get("baseColorFactor")?.numbers().ok());
    let emissive = at.get("emissiveFactor").and_then(|color| color.numbers().ok());
    let has = |place: Option<&At<'_>>, key| place.is_some_and(|place| place.get(key).is_some());
    let [color, metal] = ["baseColorTexture", "metallicRoughnessTexture"].map(|key| has(pbr.as_ref(), key));
    let [normal, occlusion, emission] =
        ["normalTexture", "occlusionTexture", "emissiveTexture"].map(|key| has(Some(at), key));
    Look {
        base_color: base_color.map_or(default.base_color, |color| color.map(six_digits)),
        metallic: number("metallicFactor").unwrap_or(default.metallic),
        roughness: number("roughnessFactor").unwrap_or(default.roughness),
        emissive: emissive.map_or(default.emissive, |color| color.map(six_digits)),
        textures: [color, metal, normal, occlusion, emission],
    }
}

/// Rounds a finite number to six significant digits, which both `%g` and rounding to a 32-bit float preserve.
fn six_digits(x: f64) -> f64 {
    // The text of a number always parses; -0 becomes 0.
    format!("{x:.5e}").parse().unwrap_or(x) + 0.0
}

fn camera(at: &At<'_>) -> Result<Camera, Error> {
    match at.need("type")?.string()? {
        "perspective" => {
            let lens = at.need("perspective")?;
            let aspect_ratio = lens.get("aspectRatio").map(|_| positive(&lens, "aspectRatio")).transpose()?;
            Ok(Camera::Perspective { yfov: positive(&lens, "yfov")?, aspect_ratio })
        }
        "orthographic" => {
            let lens = at.need("orthographic")?;
            Ok(Camera::Orthographic { xmag: lens.need("xmag")?.number()?, ymag: lens.need("ymag")?.number()? })
        }
        other => Err(at.error_at("type", format_args!("there is no camera type \"{other}\""))),
    }
}

fn positive<'v>(at: &At<'v>, key: &'v str) -> Result<f64, Error> {
    let value = at.need(key)?;
    match value.number()? {
        x if x > 0.0 => Ok(x),
        x => Err(value.error(format_args!("{x} is not positive"))),
    }
}
