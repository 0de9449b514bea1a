//! Reads nodes, scenes, meshes and the root by what they say.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use serde_json::Value;

use super::super::contents::scenes;
use super::super::json::{At, unsigned};
use super::super::node::nodes;
use super::follow::Numbers;
use super::{element, extras, follow};
use crate::contents::Node;
use crate::extension_names::*;
use crate::properties::{Hierarchy, MeshContent, NodeContent, Property, RestPose, SceneContent, Skin};
use crate::{Document, Error};

/// Extensions of the root whose contents are compared where objects refer to them.
const REFERRED: [&str; 2] = [KHR_LIGHTS_PUNCTUAL, EXT_LIGHTS_IMAGE_BASED];

pub(crate) fn hierarchy(doc: &Document) -> Result<Hierarchy, Error> {
    let root = At::root(doc);
    let mut nodes = nodes(doc, &mut Vec::new())?;
    let shown = scenes(&root, &mut nodes)?;
    let default = root.get("scene").and_then(|scene| unsigned(scene.value)).unwrap_or(0);
    let mut all: Vec<SceneContent> = root.list("scenes")?.map(|at| scene(doc, &at)).collect();
    if all.is_empty() {
        all.push(SceneContent { roots: shown, ..SceneContent::default() });
    }
    Ok(Hierarchy { nodes, scenes: all, default })
}

pub(crate) fn rest_poses(doc: &Document) -> Result<Vec<RestPose>, Error> {
    let nodes = nodes(doc, &mut Vec::new())?;
    let root = At::root(doc);
    let pose = |(at, node): (At<'_>, Node)| {
        let (scale, rotation, translation) = node.local.to_scale_rotation_translation();
        if at.get("matrix").is_some() {
            return Ok(RestPose { translation, rotation, scale });
        }
        // Taken apart again, a mirroring scale would not be the one that an animation of the rotation leaves as it is.
        let vector = |key, default: DVec3| at.get(key).map_or(Ok(default), |at| at.numbers().map(DVec3::from_array));
        let quaternion = at.get("rotation").map_or(Ok(DQuat::IDENTITY.to_array()), |at| at.numbers())?;
        let largest = quaternion.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let rotation = match largest > 0.0 {
            true => DQuat::from_array(quaternion.map(|x| x / largest)).normalize(),
            false => DQuat::IDENTITY,
        };
        Ok(RestPose { translation, rotation, scale: vector("scale", DVec3::ONE)? })
    };
    root.list("nodes")?.zip(nodes).map(pose).collect()
}

fn scene(doc: &Document, at: &At<'_>) -> SceneContent {
    let roots = at.list("nodes").into_iter().flatten().filter_map(|node| unsigned(node.value)).collect();
    SceneContent { name: at.name(), roots, more: extras_and_extensions(doc, at) }
}

fn extras_and_extensions(doc: &Document, at: &At<'_>) -> BTreeMap<String, Property> {
    let extras = extras(at).map(|extras| ("extras".to_owned(), extras));
    follow::extensions(doc, at).into_iter().chain(extras).collect()
}

pub(crate) fn node(doc: &Document, node: usize) -> NodeContent {
    let Some(at) = element(doc, "nodes", node) else { return NodeContent::default() };
    let number = |key| at.get(key).and_then(|value| unsigned(value.value));
    let record = at.get("extras").and_then(|extras| extras.get("raykiln"));
    let mesh = number("mesh").and_then(|mesh| element(doc, "meshes", mesh));
    let weights = at.get("weights").or_else(|| mesh?.get("weights"));
    NodeContent {
        extras: extras(&at),
        extensions: follow::extensions(doc, &at),
        camera: number("camera").and_then(|camera| element(doc, "cameras", camera)).map(|at| unnamed(&at)),
        weights: weights.and_then(|w| w.value.as_array()).map(|list| list.iter().filter_map(Value::as_f64).collect()),
        placed_mesh: record.and_then(|record| record.get("mesh")).map(|mesh| follow::plain(mesh.value)),
    }
}

/// Returns an object without its name.
fn unnamed(at: &At<'_>) -> Property {
    let mut read = follow::plain(at.value);
    if let Property::Object(map) = &mut read {
        map.remove("name");
    }
    read
}

pub(crate) fn skins(doc: &Document) -> Vec<Skin> {
    let mut numbers = Numbers::of(doc);
    At::root(doc).list("skins").into_iter().flatten().map(|at| skin(&at, &mut numbers)).collect()
}

fn skin(at: &At<'_>, numbers: &mut Numbers<'_>) -> Skin {
    let matrices = at.get("inverseBindMatrices").map(|accessor| numbers.get(accessor.value)).unwrap_or_default();
    let identity = |matrix: &[f64]| (0..16).all(|i| matrix[i] == if i % 5 == 0 { 1.0 } else { 0.0 });
    let are_identities = matrices.chunks_exact(16).all(identity);
    Skin {
        joints: at.get("joints").map_or_else(Vec::new, |list| indices(list.value)),
        skeleton: at.get("skeleton").and_then(|node| unsigned(node.value)),
        inverse_bind_matrices: if are_identities { Arc::default() } else { matrices },
    }
}

fn indices(list: &Value) -> Vec<usize> {
    list.as_array().into_iter().flatten().filter_map(unsigned).collect()
}

pub(crate) fn mesh(doc: &Document, mesh: usize) -> MeshContent {
    element(doc, "meshes", mesh).map_or_else(MeshContent::default, |at| mesh_content(doc, &at))
}

pub(crate) fn primitive(doc: &Document, mesh: usize, primitive: usize) -> MeshContent {
    let at = element(doc, "meshes", mesh).and_then(|mesh| mesh.get("primitives")?.element(primitive));
    at.map_or_else(MeshContent::default, |at| mesh_content(doc, &at))
}

fn mesh_content(doc: &Document, at: &At<'_>) -> MeshContent {
    MeshContent { name: at.name(), extras: extras(at), extensions: follow::extensions(doc, at) }
}

pub(crate) fn root(doc: &Document) -> BTreeMap<String, Property> {
    let root = At::root(doc);
    let mut told: BTreeMap<String, Property> = BTreeMap::new();
    for (key, value) in extras_and_extensions(doc, &root) {
        if !REFERRED.contains(&key.as_str()) {
            told.insert(key, value);
        }
    }
    let variants = root.extension(KHR_MATERIALS_VARIANTS).map(|at| names(&at));
    told.extend(variants.map(|names| (KHR_MATERIALS_VARIANTS.to_owned(), names)));
    if let Some(asset) = root.get("asset") {
        let copyright = asset.get("copyright").map(|c| ("copyright".to_owned(), follow::plain(c.value)));
        let more = extras_and_extensions(doc, &asset).into_iter().chain(copyright);
        told.extend(more.map(|(key, value)| (format!("asset.{key}"), value)));
    }
    told
}

/// Returns the names of all variants, sorted.
fn names(variants: &At<'_>) -> Property {
    let list = variants.list("variants").into_iter().flatten();
    let mut names: Vec<String> = list.filter_map(|variant| variant.name()).collect();
    names.sort_unstable();
    Property::List(names.into_iter().map(Property::Text).collect())
}
