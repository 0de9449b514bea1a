//! Turns placements into nodes; nodes that lose their triangles record where they went.

use std::collections::BTreeMap;

use glam::DAffine3;
use raykiln_formats::Document;
use raykiln_formats::edit::{NewNode, NodeRecord, SourceRecord};

use super::instancing::Batches;
use crate::layout::{Content, Layout};
use crate::scene::{InstanceId, Scene, StandIn, TriangleOrder};

/// Changes to an input node whose mesh does not stay.
#[derive(Default)]
struct Change<'a> {
    /// The document mesh that it placed.
    mesh: u32,
    /// Groups that hold its mesh in pieces, or a mesh that stands in for it, whole or in pieces.
    pieces: Vec<u32>,
    /// The stand-in for its mesh.
    stand_in: Option<&'a StandIn>,
    /// New nodes that hold triangles of its instances.
    moved_to: Vec<usize>,
}

/// Data shared by all nodes that placed one mesh.
#[derive(Default)]
pub(super) struct Shared {
    /// By document mesh, the mesh of its points and lines, if it has any.
    remainders: BTreeMap<u32, Option<usize>>,
    /// By document mesh, the accessor that maps triangles of its stand-in to its own.
    orders: BTreeMap<u32, usize>,
}

impl Shared {
    /// Returns the accessor that maps triangles of a document mesh's stand-in to its own.
    pub(super) fn order(&mut self, document: &mut Document, mesh: u32, order: &TriangleOrder) -> usize {
        *self.orders.entry(mesh).or_insert_with(|| document.add_scalars(order.runs().as_flattened()))
    }
}

/// Makes the nodes of `document` place `meshes`, one per group of the layout; placements in `batches` become copies of
/// one node.
pub(super) fn place(document: &mut Document, scene: &Scene, layout: &Layout, meshes: &[usize], batches: &Batches) {
    let mut changes: BTreeMap<u32, Change> = BTreeMap::new();
    let mut shared = Shared::default();
    let copied = batches.write(document, scene, layout, meshes, &mut shared);
    for (placement, copied) in layout.placements.iter().zip(copied) {
        let group = &layout.groups[placement.group as usize];
        let mesh = meshes[placement.group as usize];
        let stand_in = placement.instance.and_then(|i| scene.stand_in(i));
        match (&group.content, placement.instance) {
            (_, Some(instance)) if copied.is_some() => {
                change_of(scene, instance, &mut changes).moved_to.extend(copied);
            }
            (Content::Kept(_), _) if stand_in.is_none() => {}
            (Content::Kept(_) | Content::Piece { .. }, Some(instance)) => {
                let change = change_of(scene, instance, &mut changes);
                change.stand_in = stand_in;
                // Copies by one node share its pieces.
                if !change.pieces.contains(&placement.group) {
                    change.pieces.push(placement.group);
                }
            }
            (content, _) => {
                let new = NewNode { name: &group.name, mesh, transform: placement.transform };
                let node = document.add_root(&new);
                note_moves(scene, content, node, &mut changes);
            }
        }
    }
    for (node, change) in changes {
        rewrite(document, layout, meshes, node as usize, change, &mut shared);
    }
}

/// Returns the change of the node of an instance.
fn change_of<'a, 'c>(
    scene: &Scene,
    instance: InstanceId,
    changes: &'c mut BTreeMap<u32, Change<'a>>,
) -> &'c mut Change<'a> {
    let node = scene.instances[instance.0 as usize].node;
    changes.entry(node).or_insert_with(|| Change { mesh: scene.document_mesh(instance), ..Change::default() })
}

/// Records for each node with triangles in a baked group that `node` now shows them.
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

/// Removes the mesh of a node, adds its pieces or its stand-in as children, and records the change.
fn rewrite(
    document: &mut Document,
    layout: &Layout,
    meshes: &[usize],
    node: usize,
    mut change: Change,
    shared: &mut Shared,
) {
    let remainder =
        *shared.remainders.entry(change.mesh).or_insert_with(|| document.add_points_and_lines_of(change.mesh as usize));
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
        let name_of_copy = change.stand_in.map(|_| document.mesh_name(change.mesh as usize).to_owned());
        for &piece in &change.pieces {
            let group = &layout.groups[piece as usize];
            let frame = group.content.piece_frame();
            let child = document.add_child(
                node,
                &NewNode {
                    name: name_of_copy.as_ref().unwrap_or(&group.name),
                    mesh: meshes[piece as usize],
                    transform: change.stand_in.map_or(frame, |s| s.motion * frame),
                },
            );
            document.set_record(child, &NodeRecord { source: Some(source), ..NodeRecord::default() });
            change.moved_to.push(child);
        }
    }
    document.set_mesh(node, replaced);
    let source = (in_place && change.stand_in.is_some()).then_some(source);
    let record = NodeRecord { moved_to: change.moved_to, placed_mesh: Some(change.mesh as usize), source };
    document.set_record(node, &record);
}

/// Returns what nodes that show the triangles of a node represent.
fn source(document: &mut Document, node: usize, change: &Change, shared: &mut Shared) -> SourceRecord {
    let Some(stand_in) = change.stand_in else { return SourceRecord::Node { node, mesh: None, runs: None } };
    let runs = stand_in.order.as_ref().map(|order| shared.order(document, change.mesh, order));
    SourceRecord::Node { node, mesh: Some(change.mesh as usize), runs }
}

/// Whether a node can itself place the replacement of its mesh: nothing moves, and there is room to record it.
fn fits_in_place(document: &Document, layout: &Layout, node: usize, change: &Change) -> bool {
    let turns = |&piece: &u32| layout.groups[piece as usize].content.piece_frame() != DAffine3::IDENTITY;
    !change.pieces.iter().any(turns)
        && change.stand_in.is_none_or(|s| s.motion == DAffine3::IDENTITY && document.has_room_for_record(node))
}
