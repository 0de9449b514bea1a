//! Placements become nodes; nodes that lose their triangles say where they went.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3};
use raykiln_formats::Document;
use serde_json::{Map, Value, json};

use super::primitive::{push, raykiln_extras, remove_key};
use crate::layout::{Content, Layout};
use crate::scene::{Mesh, MeshId, Scene};

const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// What becomes of a node of the input whose mesh does not stay.
#[derive(Default)]
struct Change {
    /// The mesh it placed.
    mesh: u32,
    /// Groups that hold pieces of its mesh.
    pieces: Vec<u32>,
    /// New nodes with triangles of its instances.
    moved_to: Vec<usize>,
}

/// Makes the nodes of `document` place `meshes`, one for each group of the layout.
pub(super) fn place(document: &mut Document, scene: &Scene, layout: &Layout, meshes: &[usize]) {
    let mut changes: BTreeMap<u32, Change> = BTreeMap::new();
    for placement in &layout.placements {
        let group = &layout.groups[placement.group as usize];
        let mesh = meshes[placement.group as usize];
        match (&group.content, placement.instance) {
            (Content::Kept(_), _) => {}
            (Content::Piece(of, _), Some(instance)) => {
                let node = scene.instances[instance.0 as usize].node;
                let change = changes.entry(node).or_insert_with(|| Change { mesh: of.0, ..Change::default() });
                // Copies of one node share its pieces.
                if !change.pieces.contains(&placement.group) {
                    change.pieces.push(placement.group);
                }
            }
            (content, _) => {
                let node = push_root(document, &group.name, mesh, &placement.transform);
                note_moves(scene, content, node, &mut changes);
            }
        }
    }
    let mut remainders = BTreeMap::new();
    for (node, change) in changes {
        rewrite(document, scene, layout, meshes, node as usize, change, &mut remainders);
    }
}

/// Adds a root node to the default scene; returns its index.
fn push_root(document: &mut Document, name: &str, mesh: usize, transform: &DAffine3) -> usize {
    let mut node = Map::new();
    if !name.is_empty() {
        node.insert("name".into(), name.into());
    }
    node.insert("mesh".into(), mesh.into());
    if transform.matrix3 != DMat3::IDENTITY {
        let m = glam::DMat4::from(*transform);
        node.insert("matrix".into(), json!(m.to_cols_array()));
    } else if transform.translation != glam::DVec3::ZERO {
        node.insert("translation".into(), json!(transform.translation.to_array()));
    }
    let index = push(&mut document.json, "nodes", node.into());
    let shown = document.json["scene"].as_u64().unwrap_or(0) as usize;
    // Without scenes every node without a parent is shown.
    if let Some(scene) = document.json.get_mut("scenes").and_then(|s| s.get_mut(shown)) {
        push(scene, "nodes", index.into());
    }
    index
}

/// Records for every node with triangles in a baked group that `node` shows them now.
fn note_moves(scene: &Scene, content: &Content, node: usize, changes: &mut BTreeMap<u32, Change>) {
    let Content::Baked { geometries, .. } = content else { return };
    let mut instances: Vec<u32> = geometries.iter().flat_map(|g| g.triangles.iter().map(|t| t.instance)).collect();
    instances.sort_unstable();
    instances.dedup();
    for instance in instances.into_iter().map(|i| &scene.instances[i as usize]) {
        let change =
            changes.entry(instance.node).or_insert_with(|| Change { mesh: instance.mesh.0, ..Change::default() });
        if change.moved_to.last() != Some(&node) {
            change.moved_to.push(node);
        }
    }
}

/// Takes the mesh off a node, hangs its pieces under it and records what happened.
fn rewrite(
    document: &mut Document,
    scene: &Scene,
    layout: &Layout,
    meshes: &[usize],
    node: usize,
    mut change: Change,
    remainders: &mut BTreeMap<u32, Option<usize>>,
) {
    let remainder = *remainders
        .entry(change.mesh)
        .or_insert_with(|| push_remainder(document, &scene.meshes[MeshId(change.mesh).0 as usize]));
    let copies = document.json["nodes"][node]["extensions"].get(INSTANCING).cloned();
    let replaced = match (change.pieces.as_slice(), remainder) {
        (_, Some(points_and_lines)) => Some(points_and_lines),
        ([piece], None) if change.moved_to.is_empty() => Some(meshes[*piece as usize]),
        _ => None,
    };
    if remainder.is_some() || replaced.is_none() {
        for &piece in &change.pieces {
            let name = &layout.groups[piece as usize].name;
            change.moved_to.push(push_child(document, node, name, meshes[piece as usize], copies.as_ref()));
        }
    }
    set_mesh(&mut document.json["nodes"][node], replaced);
    let placed = describe(&document.json["meshes"][scene.meshes[change.mesh as usize].source as usize]);
    if let Some(extras) = raykiln_extras(&mut document.json["nodes"][node]) {
        extras.clear();
        if !change.moved_to.is_empty() {
            extras.insert("moved_to".into(), json!(change.moved_to));
        }
        extras.insert("mesh".into(), placed);
    }
}

/// A mesh of the primitives that are no triangles, if there are any.
fn push_remainder(document: &mut Document, mesh: &Mesh) -> Option<usize> {
    let mut rest = document.json["meshes"][mesh.source as usize].clone();
    let is_surface = |p: &Value| matches!(p["mode"].as_u64(), None | Some(4..=6));
    rest["primitives"].as_array_mut()?.retain(|p| !is_surface(p));
    let empty = rest["primitives"].as_array()?.is_empty();
    (!empty).then(|| push(&mut document.json, "meshes", rest))
}

/// Hangs a node that places a piece under the node it is a piece of; returns its index.
fn push_child(document: &mut Document, of: usize, name: &str, mesh: usize, copies: Option<&Value>) -> usize {
    let mut child = Map::new();
    if !name.is_empty() {
        child.insert("name".into(), name.into());
    }
    child.insert("mesh".into(), mesh.into());
    if let Some(copies) = copies {
        child.insert("extensions".into(), json!({ INSTANCING: copies }));
    }
    child.insert("extras".into(), json!({ "raykiln": { "source": { "node": of } } }));
    let index = push(&mut document.json, "nodes", child.into());
    push(&mut document.json["nodes"][of], "children", index.into());
    index
}

/// Sets or takes off the mesh of a node; without a mesh it needs no copies either.
fn set_mesh(node: &mut Value, mesh: Option<usize>) {
    let Some(node) = node.as_object_mut() else { return };
    match mesh {
        Some(mesh) => {
            node.insert("mesh".into(), mesh.into());
        }
        None => {
            node.shift_remove("mesh");
            remove_key(node, "extensions", INSTANCING);
        }
    }
}

/// Name and extras of a mesh that its nodes no longer place.
fn describe(mesh: &Value) -> Value {
    let kept = ["name", "extras"].into_iter().filter_map(|key| Some((key.to_owned(), mesh.get(key)?.clone())));
    Value::from(Map::from_iter(kept))
}
