//! Writes a layout to a document: groups become meshes, geometries primitives, placements nodes.
//!
//! What a layout leaves unchanged stays unchanged in the document. Each node keeps its name, its place in the hierarchy
//! and its index; emptied nodes and rewritten primitives have `extras.raykiln`:
//!
//! | where | key | meaning |
//! | --- | --- | --- |
//! | emptied node | `moved_to` | nodes that now show its triangles |
//! | emptied node | `mesh` | name and extras of the mesh it placed |
//! | new child node, renumbered node | `source.node` | the input node it represents |
//! | node with a copy | `source.node`, `source.mesh` | the input node and mesh it represents |
//! | node with many copies | `source.nodes`, `source.meshes` | the same for each copy |
//! | node with a copy | `source.runs` | see [`TriangleOrder`](crate::scene::TriangleOrder); absent if same order |
//! | unchanged primitive | `source` | mesh and primitive of the input |
//! | rewritten primitive | `provenance` | see [`Provenance`](raykiln_formats::contents::Provenance) |

mod gather;
mod instancing;
mod nodes;
mod precision;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_of_copies;
#[cfg(test)]
mod tests_of_extensions;

pub use instancing::{Copied, Instancing};
pub use precision::{Refuse, Settled, settle};

use raykiln_formats::Document;
use raykiln_formats::edit::CannotPrune;

use crate::layout::{Content, Group, Layout, Placement};
use crate::parallel;
use crate::scene::{Scene, most_stretch};
use gather::{Gathered, Sources};
use instancing::Batches;

/// A document written from a layout.
#[derive(Clone, Debug)]
pub struct Emitted {
    /// The new document.
    pub document: Document,
    /// Upper bound on the distance between a stored position and the exact one, in world units.
    pub position_error: f64,
    /// Statistics on instances that became copies of one node.
    pub copied: Copied,
    /// Number of nodes dropped by `--prune`.
    pub pruned_nodes: usize,
    /// Notes on what could not be done.
    pub notes: Vec<Note>,
}

/// Something that could not be done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Note {
    /// No node was pruned.
    NothingPruned(CannotPrune),
    /// Unused data stays in the file, because this extension may refer to it.
    MayReferToData(String),
}

/// Whether a layout leaves each mesh and instance of its scene unchanged.
pub fn is_unchanged(layout: &Layout) -> bool {
    layout.groups.iter().all(|g| g.content.is_kept())
}

/// Whether a layout shows the document unchanged: the layout is unchanged, and no mesh of the scene stands in for
/// another.
pub fn is_input(scene: &Scene, layout: &Layout) -> bool {
    is_unchanged(layout) && scene.stand_ins.iter().all(Option::is_none)
}

/// Options for writing documents.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// Drop empty nodes that nothing refers to.
    pub prune: bool,
    /// How several instances of a mesh are written.
    pub instancing: Instancing,
}

/// Writes the document that shows `layout`, based on the document that the scene was loaded from.
pub fn emit(doc: &Document, scene: &Scene, layout: &Layout, options: &Options) -> Emitted {
    let sources = Sources::new(doc, scene);
    let gathered: Vec<Option<Gathered>> =
        parallel::map_each(&layout.groups, &|group| gather::gather(&sources, &group.content));
    let error_of = |(group, gathered): (&Group, &Option<Gathered>)| match (gathered, &group.content) {
        (None, Content::Kept(mesh)) => scene.meshes[mesh.0 as usize].reading_error(),
        (gathered, _) => gathered.as_ref().map_or(0.0, |g| g.position_error),
    };
    let errors: Vec<f64> = layout.groups.iter().zip(&gathered).map(error_of).collect();
    let batches = Batches::of(doc, scene, layout, &errors, options.instancing);
    let stretch = |p: &Placement| if p.instance.is_some() { most_stretch(&p.transform) } else { 1.0 };
    let stored = layout.placements.iter().map(|p| errors[p.group as usize] * stretch(p));
    let position_error = stored.fold(batches.error, f64::max);

    let mut document = doc.clone();
    let mut notes = Vec::new();
    document.forget_node_sources();
    mark_untouched(&mut document, scene);
    let meshes: Vec<usize> = layout
        .groups
        .iter()
        .zip(gathered)
        .map(|(group, gathered)| match (gathered, &group.content) {
            (Some(gathered), _) => document.add_mesh(&group.name, gathered.primitives),
            (None, Content::Kept(mesh)) => scene.meshes[mesh.0 as usize].source as usize,
            (None, _) => unreachable!("only kept meshes are not gathered"),
        })
        .collect();
    nodes::place(&mut document, scene, layout, &meshes, &batches);
    let pruned_nodes = if options.prune { prune(&mut document, scene, &mut notes) } else { 0 };
    if let Some(extension) = document.compact().held_by {
        notes.push(Note::MayReferToData(extension));
    }
    document.forget_extensions_gone_since(doc);
    Emitted { document, position_error, copied: batches.copied, pruned_nodes, notes }
}

/// Records on each primitive of the scene that it is the input's primitive. The records of primitives that a layout
/// rewrites vanish with their mesh; the others keep theirs when meshes are renumbered.
fn mark_untouched(document: &mut Document, scene: &Scene) {
    for mesh in &scene.meshes {
        for geometry in &mesh.geometries {
            document.set_primitive_source(mesh.source as usize, geometry.primitive as usize);
        }
    }
}

/// Drops empty nodes; returns how many were dropped, and adds a note if none could be.
fn prune(document: &mut Document, scene: &Scene, notes: &mut Vec<Note>) -> usize {
    document.drop_empty_nodes(scene.nodes).unwrap_or_else(|cause| {
        notes.push(Note::NothingPruned(cause));
        0
    })
}
