//! Reads properties by what they mean, see [`crate::properties`].

mod animations;
mod follow;
mod hierarchy;
mod materials;
mod strokes;

use std::collections::BTreeMap;

pub(crate) use animations::animations;
pub(crate) use hierarchy::{hierarchy, mesh, node, primitive, rest_poses, root, skins};
pub(crate) use materials::material;
pub(crate) use strokes::strokes;

use super::json::At;
use crate::Document;
use crate::properties::Property;

/// Returns the number of elements of a top-level list.
pub(crate) fn count(doc: &Document, list: &str) -> usize {
    At::root(doc).count(list)
}

/// Returns an element of a top-level list.
fn element<'d>(doc: &'d Document, list: &'d str, index: usize) -> Option<At<'d>> {
    At::root(doc).get(list)?.element(index)
}

/// Returns the `extras` of an object without what the program records there.
fn extras(at: &At<'_>) -> Option<Property> {
    let mut extras = follow::plain(at.get("extras")?.value);
    if let Property::Object(map) = &mut extras {
        map.remove("raykiln");
    }
    Some(extras).filter(|extras| *extras != Property::Object(BTreeMap::new()))
}
