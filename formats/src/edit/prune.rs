//! Pruning: drops nodes that show nothing and that nothing refers to.

use serde_json::{Value, json};

use super::record::{has_room, raykiln_extras};
use crate::Document;
use crate::extension_names::{
    EXT_MESH_GPU_INSTANCING, KHR_DRACO_MESH_COMPRESSION, KHR_LIGHTS_PUNCTUAL, KHR_MATERIALS, KHR_MESH_QUANTIZATION,
};
use crate::gltf::edit::array;

/// Why no node of a document can be dropped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CannotPrune {
    /// This extension may refer to nodes in ways not known here.
    Extension(String),
    /// The extras of a node leave no room to record its old number.
    NoRoom,
}

/// Extensions of a document that refer to no node from outside the nodes.
const NODE_FREE: [&str; 3] = [EXT_MESH_GPU_INSTANCING, KHR_DRACO_MESH_COMPRESSION, KHR_LIGHTS_PUNCTUAL];

/// What the names of further ones begin with.
const NODE_FREE_PREFIXES: [&str; 4] = [KHR_MATERIALS, "KHR_texture_", "EXT_texture_", KHR_MESH_QUANTIZATION];

impl Document {
    /// Drops nodes without mesh, camera, skin, extension or remaining child that no animation and no skin refers to, and
    /// renumbers the rest; of the first `input_nodes`, those that place a mesh then record which node of the input they
    /// are. Returns the number of nodes dropped.
    ///
    /// # Errors
    /// Why no node can be dropped.
    pub fn drop_empty_nodes(&mut self, input_nodes: usize) -> Result<usize, CannotPrune> {
        if let Some(extension) = node_referring_extension(&self.json) {
            return Err(CannotPrune::Extension(extension));
        }
        if !array(&mut self.json, "nodes").all(|node| has_room(node)) {
            return Err(CannotPrune::NoRoom);
        }
        let needed = needed(&self.json);
        let mut next = 0;
        let mut number = || {
            next += 1;
            next - 1
        };
        let renumbered: Vec<Option<usize>> = needed.iter().map(|&keep| keep.then(&mut number)).collect();
        let pruned = needed.len() - next;
        if pruned > 0 {
            record_numbers(&mut self.json, &renumbered[..input_nodes.min(renumbered.len())]);
            renumber(&mut self.json, &renumbered);
        }
        Ok(pruned)
    }
}

fn node_referring_extension(json: &Value) -> Option<String> {
    let used = json["extensionsUsed"].as_array()?.iter().filter_map(Value::as_str);
    let is_node_free =
        |e: &&str| NODE_FREE.contains(e) || NODE_FREE_PREFIXES.iter().any(|prefix| e.starts_with(prefix));
    used.filter(|e| !is_node_free(e)).map(str::to_owned).next()
}

/// For each node whether it must stay: it shows something, something refers to it, or a node below must stay.
fn needed(json: &Value) -> Vec<bool> {
    let nodes = json["nodes"].as_array().map_or(&[][..], Vec::as_slice);
    let shows = |n: &Value| ["mesh", "camera", "skin", "extensions"].iter().any(|key| n.get(key).is_some());
    let mut needed: Vec<bool> = nodes.iter().map(shows).collect();
    for at in referred(json) {
        if let Some(flag) = needed.get_mut(at) {
            *flag = true;
        }
    }
    let mut parent = vec![None; nodes.len()];
    for (at, node) in nodes.iter().enumerate() {
        for child in indices(&node["children"]) {
            parent[child] = Some(at);
        }
    }
    for at in 0..nodes.len() {
        let mut above = parent[at].filter(|_| needed[at]);
        while let Some(p) = above.filter(|&p| !needed[p]) {
            needed[p] = true;
            above = parent[p];
        }
    }
    needed
}

/// Nodes that animations move and skins are made of.
fn referred(json: &Value) -> Vec<usize> {
    let list = |key: &str| json[key].as_array().into_iter().flatten();
    let channels = list("animations").flat_map(|a| a["channels"].as_array().into_iter().flatten());
    let targets = channels.filter_map(|c| index(&c["target"]["node"]));
    let joints = list("skins").flat_map(|s| indices(&s["joints"]).chain(index(&s["skeleton"])));
    targets.chain(joints).collect()
}

fn index(value: &Value) -> Option<usize> {
    value.as_u64().map(|n| n as usize)
}

fn indices(list: &Value) -> impl Iterator<Item = usize> {
    list.as_array().into_iter().flatten().filter_map(index)
}

/// Records the present number of nodes that will have another one and that place a mesh.
fn record_numbers(json: &mut Value, renumbered: &[Option<usize>]) {
    for (old, (node, new)) in array(json, "nodes").zip(renumbered).enumerate() {
        let moves = new.is_some_and(|new| new != old) && node.get("mesh").is_some();
        if let Some(raykiln) = moves.then(|| raykiln_extras(node)).flatten() {
            // A node that places a copy says of which mesh, too.
            match raykiln.get_mut("source").and_then(Value::as_object_mut) {
                Some(source) => drop(source.insert("node".into(), old.into())),
                None => drop(raykiln.insert("source".into(), json!({ "node": old }))),
            }
        }
    }
}

/// Gives every reference to a node its new number and drops those to nodes that went.
fn renumber(json: &mut Value, renumbered: &[Option<usize>]) {
    let new = |old: &Value| index(old).and_then(|at| renumbered.get(at).copied().flatten());
    let renumber_list = |owner: &mut Value, key: &str| {
        if let Some(list) = owner.get(key).and_then(Value::as_array) {
            let list: Vec<usize> = list.iter().filter_map(new).collect();
            if list.is_empty() {
                owner.as_object_mut().map(|o| o.shift_remove(key));
            } else {
                owner[key] = json!(list);
            }
        }
    };
    let renumber_one = |owner: &mut Value, key: &str| {
        if let Some(at) = owner.get(key).and_then(new) {
            owner[key] = at.into();
        }
    };
    let mut keep = renumbered.iter().map(Option::is_some);
    if let Some(nodes) = json.get_mut("nodes").and_then(Value::as_array_mut) {
        nodes.retain(|_| keep.next().unwrap_or(true));
    }
    for node in array(json, "nodes") {
        renumber_list(node, "children");
        if let Some(raykiln) = node.get_mut("extras").and_then(|e| e.get_mut("raykiln")) {
            renumber_list(raykiln, "moved_to");
        }
    }
    for scene in array(json, "scenes") {
        renumber_list(scene, "nodes");
    }
    for skin in array(json, "skins") {
        renumber_list(skin, "joints");
        renumber_one(skin, "skeleton");
    }
    for animation in array(json, "animations") {
        for channel in array(animation, "channels") {
            if let Some(target) = channel.get_mut("target") {
                renumber_one(target, "node");
            }
        }
    }
}
