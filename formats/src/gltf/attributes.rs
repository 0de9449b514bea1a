//! Random access to accessor data.

use super::accessor::Accessor;
use super::json::At;
use crate::Error;
use crate::document::{Attribute, Document};

pub(crate) fn attributes(doc: &Document, mesh: usize, primitive: usize) -> Vec<Attribute<'_>> {
    let primitives = At::root(doc).get("meshes").and_then(|meshes| meshes.element(mesh)?.get("primitives"));
    let Some(primitive) = primitives.and_then(|list| list.element(primitive)) else { return Vec::new() };
    let accessors = attribute_accessors(doc, &primitive).unwrap_or_default();
    accessors.into_iter().map(|(name, accessor)| attribute(name, &accessor)).collect()
}

pub(crate) fn targets(doc: &Document, mesh: usize, primitive: usize) -> Vec<Vec<Attribute<'_>>> {
    let primitives = At::root(doc).get("meshes").and_then(|meshes| meshes.element(mesh)?.get("primitives"));
    let targets = primitives.and_then(|list| list.element(primitive)?.get("targets")?.elements().ok());
    let read = |(name, index): (&str, At<'_>)| {
        let accessor = Accessor::read(doc, super::json::unsigned(index.value)?).ok()?;
        Some(attribute(name, &accessor))
    };
    targets.into_iter().flatten().map(|at| at.entries().into_iter().flatten().filter_map(read).collect()).collect()
}

pub(crate) fn scalars(doc: &Document, accessor: usize) -> Option<Vec<u32>> {
    Accessor::read(doc, accessor).ok()?.scalars()
}

/// Returns the accessors of a primitive's vertex attributes, in file order, all of the same length.
pub(super) fn attribute_accessors<'d>(
    doc: &'d Document,
    primitive: &At<'d>,
) -> Result<Vec<(&'d str, Accessor<'d>)>, Error> {
    let mut all: Vec<(&str, Accessor<'_>)> = Vec::new();
    for (name, index) in primitive.need("attributes")?.entries()? {
        let accessor = Accessor::referred(doc, &index)?;
        if let Some((first, other)) = all.first().filter(|(_, other)| other.count != accessor.count) {
            let cause = format!("{} vertices, but {first} has {}", accessor.count, other.count);
            return Err(index.error(cause));
        }
        all.push((name, accessor));
    }
    Ok(all)
}

fn attribute<'d>(name: &str, accessor: &Accessor<'d>) -> Attribute<'d> {
    let (data, stride) = accessor.bytes();
    Attribute { name: name.to_owned(), element: accessor.element, count: accessor.count, stride, data }
}
