//! Changes to a document.
use crate::document::{Compacted, Document, NewAccessor};

pub(crate) fn push_accessor(_doc: &mut Document, _new: NewAccessor) -> usize {
    todo!()
}

pub(crate) fn compact(_doc: &mut Document) -> Compacted {
    todo!()
}
