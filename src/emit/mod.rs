//! Writes a layout to a document: groups become meshes, geometries primitives, placements nodes.
//!
//! What a layout leaves unchanged stays unchanged in the document. Each node keeps its name and its place in the hierarchy,
//! and its index unless nodes are dropped. A record of provenance says for the whole file where each triangle comes from
//! ([`raykiln_formats::record`]); besides, `extras.raykiln` of nodes has, for people:
//!
//! | where | key | meaning |
//! | --- | --- | --- |
//! | new node | `id` | a number by which other nodes refer to it |
//! | node whose triangles other nodes show | `moved_to` | the `id`s of those |
//! | node whose mesh was replaced | `mesh` | name and extras of the mesh |

mod gather;
mod hierarchy;
mod instancing;
mod nodes;
mod origins;
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
use raykiln_formats::edit::{CannotPrune, RecordPlace};
use raykiln_formats::record::Record;

use crate::layout::{Content, Group, Layout, Placement};
use crate::parallel;
use crate::scene::{Scene, most_stretch};
use gather::{Gathered, Sources};
use hierarchy::Hierarchy;
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
    /// Number of nodes dropped: by `--prune`, and those that an earlier bake added and that are empty now.
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
    /// The extras of the file leave no room for the record of provenance.
    NoRoomForRecord,
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
    /// Where the record of provenance is written.
    pub record: RecordPlace,
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
    document.forget_node_records(scene.provenance.record().is_some());
    let (meshes, lists): (Vec<usize>, Vec<_>) = layout
        .groups
        .iter()
        .zip(gathered)
        .map(|(group, gathered)| match (gathered, &group.content) {
            (Some(gathered), _) => (document.add_mesh(&group.name, gathered.primitives), gathered.origins),
            (None, Content::Kept(mesh)) => {
                let mesh = &scene.meshes[mesh.0 as usize];
                let source = mesh.source as usize;
                (source, origins::of_kept(mesh, doc.primitive_count(source)))
            }
            (None, _) => unreachable!("only kept meshes are not gathered"),
        })
        .unzip();
    let shown_by = nodes::place(&mut document, scene, layout, &meshes, &batches, &Hierarchy::of(doc));
    let mut record = origins::record(scene, layout, lists, &shown_by, document.node_count());
    note_moves(&mut document, &record);
    let mut notes = Vec::new();
    let pruned_nodes = drop_nodes(&mut document, &mut record, options, &mut notes);
    if let Some(extension) = document.compact().held_by {
        notes.push(Note::MayReferToData(extension));
    }
    document.forget_extensions_gone_since(doc);
    if !document.set_record(&record, options.record) {
        notes.push(Note::NoRoomForRecord);
    }
    Emitted { document, position_error, copied: batches.copied, pruned_nodes, notes }
}

/// Records, of each node whose triangles others show, which do.
fn note_moves(document: &mut Document, record: &Record) {
    let moves = origins::moves(record);
    document.identify_nodes(&moves.values().flatten().copied().collect());
    for (node, shown_by) in moves {
        document.set_moved_to(node, &shown_by);
    }
}

/// Drops the empty nodes that nothing refers to: those that an earlier bake added and, with `--prune`, all. Returns how many
/// were dropped, and adds a note if none could be.
fn drop_nodes(document: &mut Document, record: &mut Record, options: &Options, notes: &mut Vec<Note>) -> usize {
    let may_go = |node: usize| options.prune || record.nodes.get(node).is_some_and(Option::is_none);
    match document.drop_empty_nodes(may_go) {
        Ok(numbers) => {
            origins::renumber(record, &numbers);
            numbers.iter().filter(|number| number.is_none()).count()
        }
        Err(cause) => {
            notes.extend(options.prune.then_some(Note::NothingPruned(cause)));
            0
        }
    }
}
