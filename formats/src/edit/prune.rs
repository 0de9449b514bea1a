//! Pruning: drops nodes that show nothing and that nothing refers to.

use serde_json::{Value, json};

use super::record::{has_room, raykiln_extras};
use crate::Document;
use crate::gltf::edit::array;
use crate::gltf::references::{self, List, NODE_LISTS};

/// Why no node of a document can be dropped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CannotPrune {
    /// This extension may refer to nodes in ways not known here.
    Extension(String),
    /// The extras of a node leave no room to record its old number.
    NoRoom,
}

impl Document {
    /// Drops nodes without mesh, camera, skin, extension or remaining child that no animation and no skin refers to, and
    /// renumbers the rest; of the first `input_nodes`, those that place a mesh then record which node of the input they
    /// are. Returns the number of nodes dropped.
    ///
    /// # Errors
    /// Why no node can be dropped.
    pub fn drop_empty_nodes(&mut self, input_nodes: usize) -> Result<usize, CannotPrune> {
        if let Some(extension) = references::holder(&self.json, &[List::Nodes]) {
            return Err(CannotPrune::Extension(extension));
        }
        if !array(&mut self.json, "nodes").all(|node| has_room(node)) {
            return Err(CannotPrune::NoRoom);
        }
        let needed = needed(&mut self.json);
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

/// For each node whether it must stay: it shows something, something refers to it, or a node below must stay.
fn needed(json: &mut Value) -> Vec<bool> {
    let mut referred = Vec::new();
    references::each(json, List::Nodes, &mut |node| referred.extend(index(node)));
    let nodes = json["nodes"].as_array().map_or(&[][..], Vec::as_slice);
    let shows = |n: &Value| ["mesh", "camera", "skin", "extensions"].iter().any(|key| n.get(key).is_some());
    let mut needed: Vec<bool> = nodes.iter().map(shows).collect();
    for at in referred {
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
    let mut keep = renumbered.iter().map(Option::is_some);
    if let Some(nodes) = json.get_mut("nodes").and_then(Value::as_array_mut) {
        nodes.retain(|_| keep.next().unwrap_or(true));
    }
    for (owners, key) in NODE_LISTS {
        references::each_at(json, owners, &mut |owner| renumber_list(owner, key));
    }
    references::each(json, List::Nodes, &mut |reference| {
        if let Some(at) = new(reference) {
            *reference = at.into();
        }
    });
}
