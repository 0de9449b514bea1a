//! Random access to accessor data.
use crate::document::{Attribute, Document};

pub(crate) fn attributes(_doc: &Document, _mesh: usize, _primitive: usize) -> Vec<Attribute<'_>> {
    todo!()
}

pub(crate) fn scalars(_doc: &Document, _accessor: usize) -> Option<Vec<u32>> {
    todo!()
}
