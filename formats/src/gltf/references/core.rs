//! References of glTF 2.0 itself (its specification, chapter 5).

use super::List::{self, Accessors, Meshes, Nodes, Views};

/// Each place with a reference, and what it refers to. References to nodes are those that use a node; the lists that
/// place nodes are [`NODE_LISTS`].
pub(super) const REFERENCES: &[(&str, List)] = &[
    ("skins.*.joints.*", Nodes),
    ("skins.*.skeleton", Nodes),
    ("animations.*.channels.*.target.node", Nodes),
    ("nodes.*.mesh", Meshes),
    ("meshes.*.primitives.*.attributes.*", Accessors),
    ("meshes.*.primitives.*.indices", Accessors),
    ("meshes.*.primitives.*.targets.*.*", Accessors),
    ("skins.*.inverseBindMatrices", Accessors),
    ("animations.*.samplers.*.input", Accessors),
    ("animations.*.samplers.*.output", Accessors),
    ("accessors.*.bufferView", Views),
    ("accessors.*.sparse.indices.bufferView", Views),
    ("accessors.*.sparse.values.bufferView", Views),
    ("images.*.bufferView", Views),
    // glTF 2.1
    ("files.*.bufferView", Views),
];

/// Lists of nodes from which a node that is dropped goes as well: where the list is, and its key.
pub(crate) const NODE_LISTS: &[(&str, &str)] = &[("nodes.*", "children"), ("scenes.*", "nodes")];

/// Accessors of the vertices and indices of a primitive, relative to it.
pub(super) const OF_PRIMITIVE: &[(&str, List)] =
    &[("attributes.*", Accessors), ("indices", Accessors), ("targets.*.*", Accessors)];
