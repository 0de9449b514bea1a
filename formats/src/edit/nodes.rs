//! Nodes that place meshes.

use glam::{DAffine3, DMat3, DMat4, DVec3};
use serde_json::{Map, Value, json};

use crate::Document;
use crate::extension_names::EXT_MESH_GPU_INSTANCING;
use crate::gltf::edit::{append, push, remove_key};

/// A node to be added.
#[derive(Clone, Debug)]
pub struct NewNode<'a> {
    /// Its name; an empty one is left out.
    pub name: &'a str,
    /// The mesh it places.
    pub mesh: usize,
    /// Parent from node, in the units of the file; the identity is left out.
    pub transform: DAffine3,
}

/// Accessors of the copies that a node places of its mesh (`EXT_mesh_gpu_instancing`), one element per copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CopyAttributes {
    /// Three floats per copy.
    pub translation: usize,
    /// A unit quaternion, x y z w, per copy; `None` if no copy is turned.
    pub rotation: Option<usize>,
    /// Three factors per copy; `None` if all are 1.
    pub scale: Option<usize>,
}

impl Document {
    /// The number of nodes.
    pub fn node_count(&self) -> usize {
        self.json["nodes"].as_array().map_or(0, Vec::len)
    }

    /// Adds a node to the default scene, below `parent` or as a root; returns its index. In a file without scenes every node
    /// without a parent is shown.
    pub fn add_node(&mut self, parent: Option<usize>, new: &NewNode) -> usize {
        let index = push(&mut self.json, "nodes", node(new).into());
        if let Some(parent) = parent {
            append(&mut self.json["nodes"][parent]["children"], index.into());
            return index;
        }
        let shown = self.json["scene"].as_u64().unwrap_or(0) as usize;
        if let Some(scene) = self.json.get_mut("scenes").and_then(|scenes| scenes.get_mut(shown)) {
            append(&mut scene["nodes"], index.into());
        }
        index
    }

    /// Adds a node below another, with the copies of that one (`EXT_mesh_gpu_instancing`), if it has any: they concern the
    /// mesh of a node but not the nodes below it. Returns its index.
    pub fn add_child(&mut self, parent: usize, new: &NewNode) -> usize {
        let mut child = node(new);
        if let Some(copies) = self.json["nodes"][parent]["extensions"].get(EXT_MESH_GPU_INSTANCING) {
            child.insert("extensions".into(), json!({ EXT_MESH_GPU_INSTANCING: copies }));
        }
        let index = push(&mut self.json, "nodes", child.into());
        append(&mut self.json["nodes"][parent]["children"], index.into());
        index
    }

    /// Makes a node place another mesh, or none: then its copies (`EXT_mesh_gpu_instancing`) go as well.
    pub fn set_mesh(&mut self, node: usize, mesh: Option<usize>) {
        let Some(node) = self.json["nodes"][node].as_object_mut() else { return };
        match mesh {
            Some(mesh) => {
                node.insert("mesh".into(), mesh.into());
            }
            None => {
                node.shift_remove("mesh");
                remove_key(node, "extensions", EXT_MESH_GPU_INSTANCING);
            }
        }
    }

    /// Makes a node that has no extensions place copies of its mesh, and lists `EXT_mesh_gpu_instancing` as required.
    pub fn set_copies(&mut self, node: usize, copies: &CopyAttributes) {
        let CopyAttributes { translation, rotation, scale } = *copies;
        let all = [("TRANSLATION", Some(translation)), ("ROTATION", rotation), ("SCALE", scale)];
        let given = all.into_iter().filter_map(|(name, accessor)| Some((name.to_owned(), Value::from(accessor?))));
        let attributes = Map::from_iter(given);
        self.json["nodes"][node]["extensions"] = json!({ EXT_MESH_GPU_INSTANCING: { "attributes": attributes } });
        // "All glTF extensions required to load and/or render an asset MUST be listed in the top-level
        // extensionsRequired array" (glTF 2.0, 3.12): without it one copy of many would be seen.
        for list in ["extensionsUsed", "extensionsRequired"] {
            enlist(&mut self.json[list], EXT_MESH_GPU_INSTANCING);
        }
    }
}

/// Adds a name to a list that lacks it.
fn enlist(names: &mut Value, name: &str) {
    let is_listed = names.as_array().is_some_and(|names| names.iter().any(|listed| listed == name));
    if !is_listed {
        append(names, name.into());
    }
}

fn node(new: &NewNode) -> Map<String, Value> {
    let mut node = Map::new();
    if !new.name.is_empty() {
        node.insert("name".into(), new.name.into());
    }
    node.insert("mesh".into(), new.mesh.into());
    if new.transform.matrix3 != DMat3::IDENTITY {
        node.insert("matrix".into(), json!(DMat4::from(new.transform).to_cols_array()));
    } else if new.transform.translation != DVec3::ZERO {
        node.insert("translation".into(), json!(new.transform.translation.to_array()));
    }
    node
}
