//! Who refers to what: the one place that knows each reference to a node, mesh, accessor or buffer view, and what data
//! goes by the order of triangles or vertices, by copies of an instance, or in units of a mesh.
//!
//! - [`core`] lists the references of glTF itself and those that the program records.
//! - [`table`] lists the extensions that are known, one row each: what they refer to, and what becomes of an object that
//!   carries one. A new extension is a new row.
//! - [`guess`] finds what extensions that are not known may refer to.
//! - [`holds`] concludes which nodes and meshes must stay as they are, and which nodes are not part of the scene.
//!
//! Whatever removes, renumbers, restructures or copies parts of a document asks here.

mod core;
pub(super) mod guess;
mod holds;
mod paths;
pub(crate) mod table;

use serde_json::Value;

pub(crate) use self::core::NODE_LISTS;
pub(super) use holds::holds;

use super::json::unsigned;
use crate::Document;

/// A list of a document whose elements are referred to by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum List {
    /// `nodes`
    Nodes,
    /// `meshes`
    Meshes,
    /// `accessors`
    Accessors,
    /// `bufferViews`
    Views,
}

impl List {
    const ALL: [List; 4] = [List::Nodes, List::Meshes, List::Accessors, List::Views];

    /// Its key in the root object.
    pub(super) fn key(self) -> &'static str {
        match self {
            List::Nodes => "nodes",
            List::Meshes => "meshes",
            List::Accessors => "accessors",
            List::Views => "bufferViews",
        }
    }
}

/// The object that carries an extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    /// The document.
    Root,
    /// `nodes`, `meshes` and so on; a step on the way.
    Lists(&'static str),
    /// A node.
    Node(usize),
    /// A mesh.
    Mesh(usize),
    /// The primitives of a mesh; a step on the way.
    Primitives(usize),
    /// A primitive of a mesh.
    Primitive(usize),
    /// An accessor.
    Accessor(usize),
    /// A buffer view.
    View(usize),
    /// Anything else, such as a material or a scene.
    Other,
}

impl Owner {
    /// Returns the owner of what is in a value that belongs to this one.
    fn below(self, step: paths::Step<'_>) -> Owner {
        use paths::Step::{Index, Key};
        match (self, step) {
            (Owner::Root, Key(key)) => Owner::Lists(match key {
                "nodes" => "nodes",
                "meshes" => "meshes",
                "accessors" => "accessors",
                "bufferViews" => "bufferViews",
                // "Asset" says of the whole file what the root could say.
                "asset" => return Owner::Root,
                _ => return Owner::Other,
            }),
            (Owner::Lists("nodes"), Index(i)) => Owner::Node(i),
            (Owner::Lists("meshes"), Index(i)) => Owner::Mesh(i),
            (Owner::Lists("accessors"), Index(i)) => Owner::Accessor(i),
            (Owner::Lists(_), Index(i)) => Owner::View(i),
            (Owner::Mesh(i), Key("primitives")) => Owner::Primitives(i),
            (Owner::Primitives(mesh), Index(_)) => Owner::Primitive(mesh),
            (owner, _) => owner,
        }
    }

    /// Returns the owner of an extension found here.
    fn of_extension(self) -> Owner {
        match self {
            Owner::Lists(_) | Owner::Primitives(_) => Owner::Other,
            owner => owner,
        }
    }
}

/// Calls a function with each reference to an element of a list: a number, wherever glTF, the program's own records or
/// an extension of the table have one. What [`holder`] returns refers to more.
pub(crate) fn each(json: &mut Value, list: List, visit: &mut dyn FnMut(&mut Value)) {
    for (path, _) in core::REFERENCES.iter().filter(|(_, of)| *of == list) {
        paths::walk(&mut *json, path, visit);
    }
    paths::each_extension(json, &mut |owner, name, object| {
        let refers = table::find(name).filter(|row| row.refers_from(owner)).map_or(&[][..], |row| row.refers);
        for (path, _) in refers.iter().filter(|(_, of)| *of == list) {
            paths::walk(&mut **object, path, visit);
        }
    });
}

/// Calls a function with each value at a path.
pub(crate) fn each_at(json: &mut Value, path: &str, visit: &mut dyn FnMut(&mut Value)) {
    paths::walk(json, path, visit);
}

/// Whether a material of a primitive, its own or one that a variant gives it, has a length in the coordinates of the mesh.
pub(super) fn in_mesh_units(doc: &Document, primitive: &Value) -> bool {
    let has_length = |material: &Value| {
        let extensions = material.get("extensions").and_then(Value::as_object).into_iter().flatten();
        extensions.into_iter().any(|(name, object)| {
            let mut found = false;
            for path in table::find(name).map_or(&[][..], |row| row.mesh_units) {
                paths::walk(object, path, &mut |length| found |= length.as_f64() != Some(0.0));
            }
            found
        })
    };
    let mut materials = Vec::new();
    for path in ["material", "extensions.KHR_materials_variants.mappings.*.material"] {
        paths::walk(primitive, path, &mut |at| materials.extend(unsigned(at)));
    }
    let list = doc.json.get("materials");
    materials.into_iter().filter_map(|material| list?.get(material)).any(has_length)
}

/// Returns the first extension that may refer to elements of these lists in ways that [`each`] does not visit: one that
/// is not known, or one that names them in a JSON pointer.
pub(crate) fn holder(json: &Value, lists: &[List]) -> Option<String> {
    let mut found: Option<String> = None;
    paths::each_extension(json, &mut |_, name, object| {
        if found.is_some() {
            return;
        }
        let is_known = table::find(name).is_some_and(|row| !row.guessed);
        // Numbers of meshes stay what they are where an extension has them: nothing tells whether two meshes are the same.
        let mut named = false;
        of_object(name, object, &mut |list, number| {
            named |= list == List::Meshes && lists.contains(&list) && !number.is_null()
        });
        let pointed = guess::pointers(object).into_iter().any(|(list, _)| lists.contains(&list));
        if !is_known || named || pointed {
            found = Some(name.to_owned());
        }
    });
    found
}

/// Calls a function with the name of each extension object, in file order.
pub(super) fn each_name(json: &Value, visit: &mut dyn FnMut(&str)) {
    paths::each_extension(json, &mut |_, name, _| visit(name));
}

/// Calls a function with each reference of an extension object of the table, by the list it refers to.
pub(super) fn of_object<'v>(name: &str, object: &'v Value, visit: &mut dyn FnMut(List, &'v Value)) {
    let refers = table::find(name).map_or(&[][..], |row| row.refers);
    for (path, list) in refers {
        paths::walk(object, path, &mut |reference| visit(*list, reference));
    }
}
