//! Accessors, and the removal of what nothing refers to.

use crate::Document;
use crate::document::{Component, Element};
use crate::gltf;

/// What a buffer view is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Vertex attributes (`ARRAY_BUFFER`).
    Vertices,
    /// Indices (`ELEMENT_ARRAY_BUFFER`).
    Indices,
    /// Data that no primitive refers to.
    Other,
}

/// A new accessor and its bytes, see [`Document::add_accessor`].
#[derive(Clone, Debug)]
pub struct NewAccessor {
    /// Tightly packed elements; vertex attributes whose element size is not a multiple of 4 are padded on writing.
    pub data: Vec<u8>,
    /// Type of an element.
    pub element: Element,
    /// What the data is for.
    pub target: Target,
    /// Whether to write the `min` and `max` properties (required for POSITION).
    pub bounds: bool,
}

/// What [`Document::compact`] removed, and why it left out the rest.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Compacted {
    /// Number of meshes removed.
    pub meshes: usize,
    /// Number of accessors removed.
    pub accessors: usize,
    /// Number of buffer views removed.
    pub buffer_views: usize,
    /// The unknown extension that may refer to any of them, so that none could be renumbered.
    pub held_by: Option<String>,
}

impl Document {
    /// Adds an accessor with a buffer view and a buffer of its own (writing joins all buffers); returns its index.
    pub fn add_accessor(&mut self, new: NewAccessor) -> usize {
        gltf::edit::add_accessor(self, new)
    }

    /// Adds a SCALAR accessor of unsigned integers; returns its index. [`Document::scalars`] reads it.
    pub fn add_scalars(&mut self, numbers: &[u32]) -> usize {
        self.add_accessor(NewAccessor {
            data: numbers.iter().flat_map(|n| n.to_le_bytes()).collect(),
            element: Element { component: Component::U32, components: 1, normalized: false },
            target: Target::Other,
            bounds: false,
        })
    }

    /// Removes meshes that no node refers to, then accessors and buffer views that nothing refers to, and renumbers the
    /// rest; a view of which accessors read only parts is cut down to these. Nodes, materials and everything else keep
    /// their index.
    pub fn compact(&mut self) -> Compacted {
        gltf::compact::compact(self)
    }

    /// Removes from `extensionsUsed` and `extensionsRequired` each extension of which `input`, the document this one was
    /// made from, has objects and this one has none left. What was listed without an object stays listed.
    pub fn forget_extensions_gone_since(&mut self, input: &Document) {
        gltf::extensions::forget_unused(&mut self.json, &input.json);
    }
}
