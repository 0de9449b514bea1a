//! `--prune`: drops nodes that show nothing and that nothing refers to.

use raykiln_formats::Document;
use serde_json::{Value, json};

use super::primitive::raykiln_extras;

/// Extensions of a document that refer to no node from outside the nodes.
const NODE_FREE: [&str; 4] = ["KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_mesh_quantization"];

/// Drops nodes without mesh, camera, skin, extension or remaining child that no animation and no skin refers to, and
/// renumbers the rest; of the first `input_nodes`, those that place a mesh then say which node of the input they are.
/// Returns how many went; none where an extension may refer to nodes in ways unknown here.
pub(super) fn drop_empty_nodes(document: &mut Document, input_nodes: usize, notes: &mut Vec<String>) -> usize {
    if let Some(extension) = node_referring_extension(&document.json) {
        notes.push(format!("no node was pruned: the extension {extension} may refer to it"));
        return 0;
    }
    if !elements(&mut document.json, "nodes").all(|node| can_be_recorded(node)) {
        notes.push("no node was pruned: the extras of a node leave no room to record its old number".into());
        return 0;
    }
    let needed = needed(&document.json);
    let mut next = 0;
    let mut number = || {
        next += 1;
        next - 1
    };
    let renumbered: Vec<Option<usize>> = needed.iter().map(|&keep| keep.then(&mut number)).collect();
    let pruned = needed.len() - next;
    if pruned > 0 {
        record_numbers(&mut document.json, &renumbered[..input_nodes.min(renumbered.len())]);
        renumber(&mut document.json, &renumbered);
    }
    pruned
}

/// Whether a node's extras have room for what the program says of it.
fn can_be_recorded(node: &Value) -> bool {
    let is_free = |value: Option<&Value>| value.is_none_or(Value::is_object);
    let extras = node.get("extras");
    is_free(extras) && is_free(extras.and_then(|extras| extras.get("raykiln")))
}

fn node_referring_extension(json: &Value) -> Option<String> {
    let known = ["KHR_lights_punctual", "EXT_mesh_gpu_instancing", "KHR_draco_mesh_compression"];
    let used = json["extensionsUsed"].as_array()?.iter().filter_map(Value::as_str);
    used.filter(|e| !known.contains(e) && !NODE_FREE.iter().any(|prefix| e.starts_with(prefix)))
        .map(str::to_owned)
        .next()
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
    for (old, (node, new)) in elements(json, "nodes").zip(renumbered).enumerate() {
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

/// The elements of an array property, if it is there.
fn elements<'a>(owner: &'a mut Value, key: &str) -> impl Iterator<Item = &'a mut Value> {
    owner.get_mut(key).and_then(Value::as_array_mut).into_iter().flatten()
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
    for node in elements(json, "nodes") {
        renumber_list(node, "children");
        if let Some(raykiln) = node.get_mut("extras").and_then(|e| e.get_mut("raykiln")) {
            renumber_list(raykiln, "moved_to");
        }
    }
    for scene in elements(json, "scenes") {
        renumber_list(scene, "nodes");
    }
    for skin in elements(json, "skins") {
        renumber_list(skin, "joints");
        renumber_one(skin, "skeleton");
    }
    for animation in elements(json, "animations") {
        for channel in elements(animation, "channels") {
            if let Some(target) = channel.get_mut("target") {
                renumber_one(target, "node");
            }
        }
    }
}
