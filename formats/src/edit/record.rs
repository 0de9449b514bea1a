//! What the program records in `extras.raykiln`, of nodes and of the whole file.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value, json};

use crate::Document;
use crate::gltf::edit::{array, remove_key};
use crate::gltf::provenance;
use crate::record::Record;

/// Where a record of provenance is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RecordPlace {
    /// Into the file.
    #[default]
    File,
    /// Into a file beside it, see [`sidecar`](crate::record::sidecar).
    Sidecar,
    /// Nowhere.
    None,
}

impl Document {
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

    /// Writes a record of provenance that is bound to the present geometry; any other is removed. Returns whether there is
    /// room for it: the extras of a file may be something else than an object.
    pub fn set_record(&mut self, record: &Record, place: RecordPlace) -> bool {
        self.remove_record();
        match place {
            RecordPlace::None => true,
            RecordPlace::Sidecar => {
                self.sidecar = Some(provenance::to_json(record, self));
                true
            }
            RecordPlace::File => provenance::put(self, provenance::to_json(record, self)),
        }
    }

    fn remove_record(&mut self) {
        self.sidecar = None;
        if let Some(root) = self.json.as_object_mut() {
            remove_key(root, "extras", "raykiln");
        }
    }

    /// Records name and extras of the mesh that a node placed. Does nothing if the extras of the node leave no room.
    pub fn set_placed_mesh(&mut self, node: usize, mesh: usize) {
        let placed = name_and_extras(&self.json["meshes"][mesh]);
        if let Some(extras) = raykiln_extras(&mut self.json["nodes"][node]) {
            extras.insert("mesh".to_owned(), placed);
        }
    }

    /// Gives each of these nodes an identifier within the file, `extras.raykiln.id`, by which others refer to it. Nodes that
    /// have one keep it.
    pub fn identify_nodes(&mut self, nodes: &BTreeSet<usize>) {
        let used = self.json["nodes"].as_array().into_iter().flatten().filter_map(id).max();
        let mut next = used.map_or(0, |id| id + 1);
        for &node in nodes {
            let node = &mut self.json["nodes"][node];
            if id(node).is_none()
                && let Some(extras) = raykiln_extras(node)
            {
                extras.insert("id".to_owned(), next.into());
                next += 1;
            }
        }
    }

    /// Records that these nodes show what a node showed, by their identifiers.
    pub fn set_moved_to(&mut self, node: usize, shown_by: &BTreeSet<usize>) {
        let ids: Vec<u64> = shown_by.iter().filter_map(|&node| id(&self.json["nodes"][node])).collect();
        if let Some(extras) = raykiln_extras(&mut self.json["nodes"][node]).filter(|_| !ids.is_empty()) {
            extras.insert("moved_to".to_owned(), json!(ids));
        }
    }

    /// Removes what an earlier bake recorded of nodes and primitives: where triangles went and come from and, unless
    /// `keep_ids`, which nodes it added.
    pub fn forget_node_records(&mut self, keep_ids: bool) {
        for node in array(&mut self.json, "nodes") {
            forget(node, if keep_ids { &["moved_to", "source"] } else { &["moved_to", "source", "id"] });
        }
        for mesh in array(&mut self.json, "meshes") {
            array(mesh, "primitives").for_each(|primitive| forget(primitive, &["source", "provenance"]));
        }
    }
}

fn id(node: &Value) -> Option<u64> {
    node.get("extras")?.get("raykiln")?.get("id")?.as_u64()
}

/// Removes keys of `extras.raykiln` of a glTF object, and the extras if nothing is left in them.
fn forget(object: &mut Value, keys: &[&str]) {
    let Some(object) = object.as_object_mut() else { return };
    if let Some(extras) = object.get_mut("extras").and_then(Value::as_object_mut) {
        keys.iter().for_each(|key| drop(remove_key(extras, "raykiln", key)));
        if extras.is_empty() {
            object.shift_remove("extras");
        }
    }
}

/// Whether the extras of a node have room for what the program records of it.
pub(crate) fn has_room(node: &Value) -> bool {
    let is_free = |value: Option<&Value>| value.is_none_or(Value::is_object);
    let extras = node.get("extras");
    is_free(extras) && is_free(extras.and_then(|extras| extras.get("raykiln")))
}

/// `extras.raykiln` of a glTF object, made if it is missing; `None` if the file's own extras leave no room for it.
pub(crate) fn raykiln_extras(object: &mut Value) -> Option<&mut Map<String, Value>> {
    let extras = object.as_object_mut()?.entry("extras").or_insert_with(|| json!({}));
    extras.as_object_mut()?.entry("raykiln").or_insert_with(|| json!({})).as_object_mut()
}

fn name_and_extras(mesh: &Value) -> Value {
    let kept = ["name", "extras"].into_iter().filter_map(|key| Some((key.to_owned(), mesh.get(key)?.clone())));
    Value::from(Map::from_iter(kept))
}
