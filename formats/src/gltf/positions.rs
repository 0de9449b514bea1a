//! Vertex positions, read once per accessor: exporters of CAD programs let thousands of primitives share one.

use std::sync::{Arc, OnceLock};

use super::accessor::Accessor;
use super::json::At;
use crate::Document;

/// The positions that were read so far, by accessor.
pub(super) struct Positions(Vec<OnceLock<Arc<[[f32; 3]]>>>);

impl Positions {
    /// Returns room for the positions of all accessors of a document; nothing is read yet.
    pub(super) fn new(doc: &Document) -> Positions {
        Positions((0..At::root(doc).count("accessors")).map(|_| OnceLock::new()).collect())
    }

    /// Returns the positions of accessor `number`, which is `accessor`.
    pub(super) fn of(&self, number: Option<usize>, accessor: &Accessor<'_>) -> Arc<[[f32; 3]]> {
        let read = || accessor.vectors_f32().into();
        number.and_then(|number| self.0.get(number)).map_or_else(read, |known| known.get_or_init(read).clone())
    }
}
