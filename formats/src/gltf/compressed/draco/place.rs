//! Puts decoded values into a document.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::Document;
use crate::edit::NewAccessor;
use crate::gltf::compact::used_views;
use crate::gltf::edit::add_accessor;

/// Properties of an accessor that describe its values.
const DESCRIBES: [&str; 6] = ["bufferView", "componentType", "count", "type", "min", "max"];

/// New contents of an accessor.
pub(super) struct Filled {
    pub(super) place: Place,
    pub(super) accessor: NewAccessor,
}

/// Where values go.
pub(super) enum Place {
    /// Into an accessor of the file.
    Accessor(usize),
    /// Into a new one of a primitive, for the attribute or, without one, the indices.
    Own {
        mesh: usize,
        primitive: usize,
        attribute: Option<String>,
        /// The accessor whose other properties it has.
        like: Option<usize>,
    },
}

/// Puts values into their accessors. The buffer views of the streams are reused, so that none is left without a reader.
pub(super) fn place(doc: &mut Document, filled: Vec<Filled>, streams: Vec<usize>) {
    let used = used_views(&mut doc.json);
    let free: BTreeSet<usize> = streams.into_iter().filter(|view| used.get(*view) == Some(&false)).collect();
    let mut free = free.into_iter();
    for Filled { place, accessor } in filled {
        let new = add_accessor(doc, accessor);
        if let Some(view) = free.next() {
            reuse_view(&mut doc.json, new, view);
        }
        match place {
            Place::Accessor(accessor) => {
                let described = doc.json["accessors"].as_array_mut().and_then(Vec::pop).unwrap_or_default();
                describe(&mut doc.json["accessors"][accessor], &described);
            }
            Place::Own { mesh, primitive, attribute, like } => {
                if let Some(like) = like {
                    let described = doc.json["accessors"][new].take();
                    doc.json["accessors"][new] = doc.json["accessors"][like].clone();
                    describe(&mut doc.json["accessors"][new], &described);
                }
                let primitive = &mut doc.json["meshes"][mesh]["primitives"][primitive];
                match attribute {
                    Some(name) => primitive["attributes"][name] = new.into(),
                    None => primitive["indices"] = new.into(),
                }
            }
        }
    }
}

/// Moves the last buffer view, which an accessor reads, to the place of one that nothing reads.
fn reuse_view(json: &mut Value, accessor: usize, view: usize) {
    if let Some(last) = json["bufferViews"].as_array_mut().and_then(Vec::pop) {
        json["bufferViews"][view] = last;
        json["accessors"][accessor]["bufferView"] = view.into();
    }
}

/// Gives an accessor the values that another describes.
fn describe(accessor: &mut Value, described: &Value) {
    let Some(properties) = accessor.as_object_mut() else { return };
    properties.shift_remove("byteOffset");
    for key in DESCRIBES {
        match described.get(key) {
            Some(value) => drop(properties.insert(key.to_owned(), value.clone())),
            None => drop(properties.shift_remove(key)),
        }
    }
}
