//! What the program records in `extras.raykiln` of nodes and primitives.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use crate::Document;
use crate::gltf::edit::{array, remove_key};

/// What became of a node, see [`Document::set_record`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NodeRecord {
    /// The nodes that show its triangles now; left out if there are none.
    pub moved_to: Vec<usize>,
    /// The mesh that it placed: its name and extras are recorded.
    pub placed_mesh: Option<usize>,
    /// What it stands for in the input.
    pub source: Option<SourceRecord>,
}

/// What a node stands for in the input. [`NodeSource`](crate::contents::NodeSource) is the same as read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceRecord {
    /// One node.
    Node {
        /// Node of the input.
        node: usize,
        /// Mesh of the input of which a copy is placed.
        mesh: Option<usize>,
        /// Accessor of the order of its triangles, two numbers per run: first triangle of `mesh`, number of triangles.
        runs: Option<usize>,
    },
    /// A node for each copy.
    Copies {
        /// Accessor of nodes of the input, one number per copy.
        nodes: usize,
        /// Accessor of meshes of the input, one number per copy.
        meshes: Option<usize>,
        /// As in [`SourceRecord::Node`], for all copies.
        runs: Option<usize>,
    },
}

impl Document {
    /// Whether [`Document::set_record`] can record something of a node: neither `extras` nor `extras.raykiln` holds
    /// anything but an object.
    pub fn has_room_for_record(&self, node: usize) -> bool {
        has_room(&self.json["nodes"][node])
    }

    /// Records which version of the program made this document with which options, in `asset.extras.raykiln`, in place of what
    /// was recorded before. An option has one value or a list. Does nothing if the extras leave no room.
    pub fn record_bake(&mut self, version: &str, options: &BTreeMap<String, Vec<String>>) {
        let Some(record) = raykiln_extras(&mut self.json["asset"]) else { return };
        record.clear();
        record.insert("version".into(), version.into());
        if !options.is_empty() {
            let value = |values: &Vec<String>| match values.as_slice() {
                [value] => json!(value),
                values => json!(values),
            };
            let options = options.iter().map(|(option, values)| (option.clone(), value(values)));
            record.insert("options".into(), options.collect::<Map<String, Value>>().into());
        }
    }

    /// Records what became of a node, in place of what was recorded before. Does nothing if the extras of the node leave no
    /// room ([`Document::has_room_for_record`]).
    pub fn set_record(&mut self, node: usize, record: &NodeRecord) {
        let placed = record.placed_mesh.map(|mesh| name_and_extras(&self.json["meshes"][mesh]));
        let Some(extras) = raykiln_extras(&mut self.json["nodes"][node]) else { return };
        extras.clear();
        if !record.moved_to.is_empty() {
            extras.insert("moved_to".into(), json!(record.moved_to));
        }
        extras.extend(placed.map(|mesh| ("mesh".to_owned(), mesh)));
        extras.extend(record.source.map(|source| ("source".to_owned(), source.to_json())));
    }

    /// Removes what an earlier bake recorded of the nodes that those of this document were made from.
    pub fn forget_node_sources(&mut self) {
        for node in array(&mut self.json, "nodes").filter_map(Value::as_object_mut) {
            if let Some(extras) = node.get_mut("extras").and_then(Value::as_object_mut) {
                remove_key(extras, "raykiln", "source");
                if extras.is_empty() {
                    node.shift_remove("extras");
                }
            }
        }
    }

    /// Records of a primitive that it is, triangle for triangle, the input's primitive of the same number; the record stays
    /// true when meshes are renumbered. Does nothing if the extras of the primitive leave no room.
    pub fn set_primitive_source(&mut self, mesh: usize, primitive: usize) {
        if let Some(extras) = raykiln_extras(&mut self.json["meshes"][mesh]["primitives"][primitive]) {
            let source = json!({ "mesh": mesh, "primitive": primitive });
            *extras = Map::from_iter([("source".to_owned(), source)]);
        }
    }
}

impl SourceRecord {
    fn to_json(self) -> Value {
        let entries = match self {
            SourceRecord::Node { node, mesh, runs } => [("node", Some(node)), ("mesh", mesh), ("runs", runs)],
            SourceRecord::Copies { nodes, meshes, runs } => {
                [("nodes", Some(nodes)), ("meshes", meshes), ("runs", runs)]
            }
        };
        let given = entries.into_iter().filter_map(|(key, number)| Some((key.to_owned(), Value::from(number?))));
        Map::from_iter(given).into()
    }
}

/// Whether the extras of a node or primitive have room for what the program records of it.
pub(crate) fn has_room(node: &Value) -> bool {
    let is_free = |value: Option<&Value>| value.is_none_or(Value::is_object);
    let extras = node.get("extras");
    is_free(extras) && is_free(extras.and_then(|extras| extras.get("raykiln")))
}

/// `extras.raykiln` of a glTF object, made if it is missing; `None` if the file's own extras leave no room for it.
pub(super) fn raykiln_extras(object: &mut Value) -> Option<&mut Map<String, Value>> {
    let extras = object.as_object_mut()?.entry("extras").or_insert_with(|| json!({}));
    extras.as_object_mut()?.entry("raykiln").or_insert_with(|| json!({})).as_object_mut()
}

fn name_and_extras(mesh: &Value) -> Value {
    let kept = ["name", "extras"].into_iter().filter_map(|key| Some((key.to_owned(), mesh.get(key)?.clone())));
    Value::from(Map::from_iter(kept))
}
