//! Pruning: drops nodes that show nothing and that nothing refers to.

use serde_json::{Value, json};

use crate::Document;
use crate::gltf::references::{self, List, NODE_LISTS};

/// Why no node of a document can be dropped: this extension may refer to nodes in ways not known here.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CannotPrune(pub String);

impl Document {
    /// Drops nodes that `may_go`, without mesh, camera, skin, extension or remaining child, that no animation and no skin
    /// refers to, and renumbers the rest. Returns the new number of each node.
    ///
    /// # Errors
    /// Why no node can be dropped.
    pub fn drop_empty_nodes(&mut self, may_go: impl Fn(usize) -> bool) -> Result<Vec<Option<usize>>, CannotPrune> {
        if let Some(extension) = references::holder(&self.json, &[List::Nodes]) {
            return Err(CannotPrune(extension));
        }
        let mut next = 0;
        let mut number = || {
            next += 1;
            next - 1
        };
        let needed = needed(&mut self.json, may_go);
        let renumbered: Vec<Option<usize>> = needed.iter().map(|&keep| keep.then(&mut number)).collect();
        if next < renumbered.len() {
            renumber(&mut self.json, &renumbered);
        }
        Ok(renumbered)
    }
}

/// For each node whether it must stay: it shows something, something refers to it, or a node below must stay.
fn needed(json: &mut Value, may_go: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut referred = Vec::new();
    references::each(json, List::Nodes, &mut |node| referred.extend(index(node)));
    let nodes = json["nodes"].as_array().map_or(&[][..], Vec::as_slice);
    let shows = |n: &Value| ["mesh", "camera", "skin", "extensions"].iter().any(|key| n.get(key).is_some());
    let mut needed: Vec<bool> = nodes.iter().enumerate().map(|(at, node)| shows(node) || !may_go(at)).collect();
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
