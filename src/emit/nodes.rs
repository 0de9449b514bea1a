//! Placements become nodes; nodes that lose their triangles say where they went.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DMat4, DVec3};
use raykiln_formats::Document;
use serde_json::{Map, Value, json};

use super::instancing::Batches;
use super::primitive::{push, push_runs, raykiln_extras, remove_key};
use crate::layout::{Content, Layout};
use crate::scene::{InstanceId, Scene, StandIn, TriangleOrder};

pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// What becomes of a node of the input whose mesh does not stay.
#[derive(Default)]
struct Change<'a> {
    /// The mesh of the document that it placed.
    mesh: u32,
    /// Groups that hold its mesh in pieces, or a mesh that stands in for it, whole or in pieces.
    pieces: Vec<u32>,
    /// How the mesh that stands in for its mesh does so.
    stand_in: Option<&'a StandIn>,
    /// New nodes with triangles of its instances.
    moved_to: Vec<usize>,
}

/// What all nodes that placed one mesh share.
#[derive(Default)]
pub(super) struct Shared {
    /// By mesh of the document: the mesh of its points and lines, if it has any.
    remainders: BTreeMap<u32, Option<usize>>,
    /// By mesh of the document: the accessor that tells which of its triangles those of its stand-in are.
    orders: BTreeMap<u32, usize>,
}

impl Shared {
    /// The accessor that tells which triangles of a mesh of the document those of its stand-in are.
    pub(super) fn order(&mut self, document: &mut Document, mesh: u32, order: &TriangleOrder) -> usize {
        *self.orders.entry(mesh).or_insert_with(|| push_runs(document, order.runs().as_flattened()))
    }
}

/// Makes the nodes of `document` place `meshes`, one for each group of the layout; those of `batches` as copies of one
/// node.
pub(super) fn place(document: &mut Document, scene: &Scene, layout: &Layout, meshes: &[usize], batches: &Batches) {
    let mut changes: BTreeMap<u32, Change> = BTreeMap::new();
    let mut shared = Shared::default();
    let copied = batches.write(document, scene, layout, meshes, &mut shared);
    for (placement, copied) in layout.placements.iter().zip(copied) {
        let group = &layout.groups[placement.group as usize];
        let mesh = meshes[placement.group as usize];
        let stand_in = placement.instance.and_then(|i| scene.instances[i.0 as usize].stand_in.as_ref());
        match (&group.content, placement.instance) {
            (_, Some(instance)) if copied.is_some() => {
                change_of(scene, instance, &mut changes).moved_to.extend(copied);
            }
            (Content::Kept(_), _) if stand_in.is_none() => {}
            (Content::Kept(_) | Content::Piece { .. }, Some(instance)) => {
                let change = change_of(scene, instance, &mut changes);
                change.stand_in = stand_in;
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
    for (node, change) in changes {
        rewrite(document, layout, meshes, node as usize, change, &mut shared);
    }
}

/// What becomes of the node of an instance.
fn change_of<'a, 'c>(
    scene: &Scene,
    instance: InstanceId,
    changes: &'c mut BTreeMap<u32, Change<'a>>,
) -> &'c mut Change<'a> {
    let node = scene.instances[instance.0 as usize].node;
    changes.entry(node).or_insert_with(|| Change { mesh: scene.document_mesh(instance), ..Change::default() })
}

/// Adds a root node to the default scene; returns its index.
pub(super) fn push_root(document: &mut Document, name: &str, mesh: usize, transform: &DAffine3) -> usize {
    let mut node = Map::new();
    if !name.is_empty() {
        node.insert("name".into(), name.into());
    }
    node.insert("mesh".into(), mesh.into());
    insert_transform(&mut node, transform);
    let index = push(&mut document.json, "nodes", node.into());
    let shown = document.json["scene"].as_u64().unwrap_or(0) as usize;
    // Without scenes every node without a parent is shown.
    if let Some(scene) = document.json.get_mut("scenes").and_then(|s| s.get_mut(shown)) {
        push(scene, "nodes", index.into());
    }
    index
}

/// Gives a node its transform; the identity needs none.
fn insert_transform(node: &mut Map<String, Value>, transform: &DAffine3) {
    if transform.matrix3 != DMat3::IDENTITY {
        node.insert("matrix".into(), json!(DMat4::from(*transform).to_cols_array()));
    } else if transform.translation != DVec3::ZERO {
        node.insert("translation".into(), json!(transform.translation.to_array()));
    }
}

/// Records for every node with triangles in a baked group that `node` shows them now.
fn note_moves(scene: &Scene, content: &Content, node: usize, changes: &mut BTreeMap<u32, Change>) {
    let Content::Baked { geometries, .. } = content else { return };
    let mut instances: Vec<u32> = geometries.iter().flat_map(|g| g.triangles.iter().map(|t| t.instance)).collect();
    instances.sort_unstable();
    instances.dedup();
    for instance in instances {
        let change = change_of(scene, InstanceId(instance), changes);
        if change.moved_to.last() != Some(&node) {
            change.moved_to.push(node);
        }
    }
}

/// Takes the mesh off a node, hangs its pieces or what stands in for it under it and records what happened.
fn rewrite(
    document: &mut Document,
    layout: &Layout,
    meshes: &[usize],
    node: usize,
    mut change: Change,
    shared: &mut Shared,
) {
    let remainder =
        *shared.remainders.entry(change.mesh).or_insert_with(|| push_remainder(document, change.mesh as usize));
    let source = source(document, node, &change, shared);
    let replaced = match (change.pieces.as_slice(), remainder) {
        (_, Some(points_and_lines)) => Some(points_and_lines),
        ([piece], None) if change.moved_to.is_empty() && fits_in_place(document, layout, node, &change) => {
            Some(meshes[*piece as usize])
        }
        _ => None,
    };
    let in_place = remainder.is_none() && replaced.is_some();
    if !in_place {
        for &piece in &change.pieces {
            let name = match change.stand_in {
                Some(_) => document.json["meshes"][change.mesh as usize]["name"].as_str().unwrap_or("").to_owned(),
                None => layout.groups[piece as usize].name.clone(),
            };
            let frame = layout.groups[piece as usize].content.piece_frame();
            let transform = change.stand_in.map_or(frame, |s| s.motion * frame);
            let child = child(document, node, &name, meshes[piece as usize], &transform, &source);
            change.moved_to.push(push_child(document, node, child));
        }
    }
    set_mesh(&mut document.json["nodes"][node], replaced);
    let placed = describe(&document.json["meshes"][change.mesh as usize]);
    if let Some(extras) = raykiln_extras(&mut document.json["nodes"][node]) {
        extras.clear();
        if !change.moved_to.is_empty() {
            extras.insert("moved_to".into(), json!(change.moved_to));
        }
        extras.insert("mesh".into(), placed);
        if in_place && change.stand_in.is_some() {
            extras.insert("source".into(), source);
        }
    }
}

/// What nodes that show the triangles of a node stand for.
fn source(document: &mut Document, node: usize, change: &Change, shared: &mut Shared) -> Value {
    let mut source = json!({ "node": node });
    if let Some(stand_in) = change.stand_in {
        source["mesh"] = change.mesh.into();
        if let Some(order) = &stand_in.order {
            source["runs"] = shared.order(document, change.mesh, order).into();
        }
    }
    source
}

/// Whether a node can place what stands in for its mesh itself: nothing moves, and there is room to record it.
fn fits_in_place(document: &Document, layout: &Layout, node: usize, change: &Change) -> bool {
    let extras = document.json["nodes"][node].get("extras");
    let turns = |&piece: &u32| layout.groups[piece as usize].content.piece_frame() != DAffine3::IDENTITY;
    !change.pieces.iter().any(turns)
        && change.stand_in.is_none_or(|s| s.motion == DAffine3::IDENTITY && extras.is_none_or(Value::is_object))
}

/// A mesh of the primitives that are no triangles, if there are any.
fn push_remainder(document: &mut Document, mesh: usize) -> Option<usize> {
    let mut rest = document.json["meshes"][mesh].clone();
    let is_surface = |p: &Value| matches!(p["mode"].as_u64(), None | Some(4..=6));
    rest["primitives"].as_array_mut()?.retain(|p| !is_surface(p));
    let empty = rest["primitives"].as_array()?.is_empty();
    (!empty).then(|| push(&mut document.json, "meshes", rest))
}

/// A node that places a piece of the mesh of a node, or what stands in for it.
fn child(document: &Document, of: usize, name: &str, mesh: usize, transform: &DAffine3, source: &Value) -> Value {
    let mut child = Map::new();
    if !name.is_empty() {
        child.insert("name".into(), name.into());
    }
    child.insert("mesh".into(), mesh.into());
    insert_transform(&mut child, transform);
    if let Some(copies) = document.json["nodes"][of]["extensions"].get(INSTANCING) {
        child.insert("extensions".into(), json!({ INSTANCING: copies }));
    }
    child.insert("extras".into(), json!({ "raykiln": { "source": source } }));
    child.into()
}

/// Hangs a node under another; returns its index.
fn push_child(document: &mut Document, of: usize, child: Value) -> usize {
    let index = push(&mut document.json, "nodes", child);
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
