//! Turns placements into nodes.

use std::collections::{BTreeMap, BTreeSet};

use glam::DAffine3;
use raykiln_formats::Document;
use raykiln_formats::edit::NewNode;

use super::hierarchy::Hierarchy;
use super::instancing::Batches;
use super::origins::ShownBy;
use crate::layout::{Content, Layout};
use crate::scene::{InstanceId, Scene, StandIn};

/// Changes to an input node whose mesh does not stay.
#[derive(Default)]
struct Change<'a> {
    /// The document mesh that it placed.
    mesh: u32,
    /// Groups that hold its mesh in pieces, or a mesh that stands in for it, whole or in pieces.
    pieces: Vec<u32>,
    /// The stand-in for its mesh.
    stand_in: Option<&'a StandIn>,
    /// Whether other nodes, which are not below it, show its triangles.
    moved: bool,
}

/// Makes the nodes of `document` place `meshes`, one per group of the layout; placements in `batches` become copies of
/// one node. Returns the node that shows each placement.
pub(super) fn place(
    document: &mut Document,
    scene: &Scene,
    layout: &Layout,
    meshes: &[usize],
    batches: &Batches,
    hierarchy: &Hierarchy,
) -> Vec<ShownBy> {
    let mut changes: BTreeMap<u32, Change> = BTreeMap::new();
    let mut shown_by = batches.write(document, scene, layout, meshes, hierarchy);
    for (placement, shown_by) in layout.placements.iter().zip(&mut shown_by) {
        let group = &layout.groups[placement.group as usize];
        let stand_in = placement.instance.and_then(|i| scene.stand_in(i));
        match (&group.content, placement.instance) {
            (_, Some(instance)) if shown_by.is_some() => change_of(scene, instance, &mut changes).moved = true,
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
                let sources = instances_of(content);
                let nodes = sources.iter().map(|i| scene.instances[i.0 as usize].node as usize);
                let below = hierarchy.below_common_ancestor(nodes, &placement.transform);
                let mesh = meshes[placement.group as usize];
                let new = NewNode { name: &group.name, mesh, transform: below.local };
                *shown_by = Some(ShownBy { node: document.add_node(below.parent, &new), copy: 0 });
                sources.into_iter().for_each(|instance| change_of(scene, instance, &mut changes).moved = true);
            }
        }
    }
    let mut remainders = BTreeMap::new();
    let mut of_pieces = BTreeMap::new();
    for (node, change) in changes {
        rewrite(document, layout, meshes, node, change, &mut remainders, &mut of_pieces);
    }
    let placements = layout.placements.iter().zip(shown_by);
    let in_place = |(placement, shown_by): (&crate::layout::Placement, Option<ShownBy>)| {
        let at_node = || {
            let instance = &scene.instances[placement.instance.expect("only baked groups have no instance").0 as usize];
            let node = of_pieces.get(&(instance.node, placement.group)).copied();
            ShownBy { node: node.unwrap_or(instance.node as usize), copy: instance.copy }
        };
        shown_by.unwrap_or_else(at_node)
    };
    placements.map(in_place).collect()
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

/// Returns the instances whose triangles a baked group has.
fn instances_of(content: &Content) -> BTreeSet<InstanceId> {
    let Content::Baked { geometries, .. } = content else { return BTreeSet::new() };
    geometries.iter().flat_map(|g| g.triangles.iter().map(|t| InstanceId(t.instance))).collect()
}

/// Removes the mesh of a node, adds its pieces or its stand-in as children, and records which mesh it was. Adds the new
/// nodes to `of_pieces`, by the node that they are below and their group; `remainders` has, by document mesh, the mesh of
/// its points and lines, if it has any.
fn rewrite(
    document: &mut Document,
    layout: &Layout,
    meshes: &[usize],
    number: u32,
    change: Change,
    remainders: &mut BTreeMap<u32, Option<usize>>,
    of_pieces: &mut BTreeMap<(u32, u32), usize>,
) {
    let node = number as usize;
    let remainder =
        *remainders.entry(change.mesh).or_insert_with(|| document.add_points_and_lines_of(change.mesh as usize));
    let replaced = match (change.pieces.as_slice(), remainder) {
        (_, Some(points_and_lines)) => Some(points_and_lines),
        ([piece], None) if !change.moved && fits_in_place(layout, &change) => Some(meshes[*piece as usize]),
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
            of_pieces.insert((number, piece), child);
        }
    }
    document.set_placed_mesh(node, change.mesh as usize);
    document.set_mesh(node, replaced);
}

/// Whether a node can itself place the replacement of its mesh: nothing moves.
fn fits_in_place(layout: &Layout, change: &Change) -> bool {
    let turns = |&piece: &u32| layout.groups[piece as usize].content.piece_frame() != DAffine3::IDENTITY;
    !change.pieces.iter().any(turns) && change.stand_in.is_none_or(|s| s.motion == DAffine3::IDENTITY)
}
