//! Nodes: the hierarchy, transforms and copies.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::accessor::Accessor;
use super::json::At;
use super::limits;
use crate::contents::Node;
use crate::document::{Component, Document};
use crate::extension_names::EXT_MESH_GPU_INSTANCING;
use crate::{Error, Warning};

/// Reads all nodes and their parents, and rejects cycles.
pub(super) fn nodes(doc: &Document, warnings: &mut Vec<Warning>) -> Result<Vec<Node>, Error> {
    let root = At::root(doc);
    let mut nodes = Vec::new();
    let mut all_copies = 0;
    for at in root.list("nodes")? {
        let node = node(doc, &at, warnings)?;
        all_copies += node.copies.as_ref().map_or(0, Vec::len) as u64;
        limits::check_copies(doc, all_copies)?;
        nodes.push(node);
    }
    link_parents(&root, &mut nodes)?;
    check_acyclic(&root, &nodes)?;
    Ok(nodes)
}

fn node(doc: &Document, at: &At<'_>, warnings: &mut Vec<Warning>) -> Result<Node, Error> {
    at.object()?;
    let root = At::root(doc);
    let children: Result<_, _> =
        at.list("children")?.map(|child| child.index_into("nodes", root.count("nodes"))).collect();
    at.get("extensions").map(|e| e.object()).transpose()?;
    Ok(Node {
        name: at.name(),
        parent: None,
        children: children?,
        mesh: at.index("mesh", "meshes", root.count("meshes"))?,
        skin: at.index("skin", "skins", root.count("skins"))?,
        camera: at.index("camera", "cameras", root.count("cameras"))?,
        local: local(at, warnings)?,
        copies: at.extension(EXT_MESH_GPU_INSTANCING).map(|e| copies(doc, &e, warnings)).transpose()?,
        animated: false,
        in_other_scene: false,
        hold: None,
        hidden: false,
    })
}

/// Returns the parent-from-node transform.
fn local(at: &At<'_>, warnings: &mut Vec<Warning>) -> Result<DAffine3, Error> {
    let vector = |key, default| at.get(key).map_or(Ok(default), |v| v.numbers().map(DVec3::from_array));
    let Some(matrix) = at.get("matrix") else {
        let translation = vector("translation", DVec3::ZERO)?;
        let scale = vector("scale", DVec3::ONE)?;
        let rotation = match at.get("rotation") {
            None => DQuat::IDENTITY,
            Some(at) => unit(at.numbers()?).unwrap_or_else(|| {
                warnings.push(at.warning("the quaternion is zero; no rotation is applied"));
                DQuat::IDENTITY
            }),
        };
        return Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation));
    };
    if ["translation", "rotation", "scale"].iter().any(|key| at.get(key).is_some()) {
        warnings.push(at.warning("has a matrix as well as translation, rotation or scale; the matrix counts"));
    }
    let m = matrix.numbers::<16>()?;
    if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
        warnings.push(matrix.warning("the last row is not 0 0 0 1; it is ignored"));
    }
    let linear = DMat3::from_cols_array(&[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]]);
    Ok(DAffine3::from_mat3_translation(linear, DVec3::new(m[12], m[13], m[14])))
}

/// Returns the normalised quaternion; `None` for zero.
fn unit(q: [f64; 4]) -> Option<DQuat> {
    let largest = q.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    (largest > 0.0).then(|| DQuat::from_array(q.map(|x| x / largest)).normalize())
}

/// Returns the copies that `EXT_mesh_gpu_instancing` places.
fn copies(doc: &Document, at: &At<'_>, warnings: &mut Vec<Warning>) -> Result<Vec<DAffine3>, Error> {
    let attributes = at.need("attributes")?;
    let mut count = None;
    for (name, index) in attributes.entries()? {
        let accessor = Accessor::referred(doc, &index)?;
        match *count.get_or_insert(accessor.count) {
            first if first == accessor.count => check_copy_attribute(name, &index, &accessor)?,
            first => return Err(index.error(format_args!("{} copies, but others have {first}", accessor.count))),
        }
    }
    let count = count.ok_or_else(|| attributes.error("there are none, so that the number of copies is unknown"))?;
    let translations = vectors::<3>(doc, &attributes, "TRANSLATION")?;
    let rotations = vectors::<4>(doc, &attributes, "ROTATION")?;
    let scales = vectors::<3>(doc, &attributes, "SCALE")?;
    let mut zeros = 0;
    let copies = (0..count).map(|i| {
        let translation = translations.as_ref().map_or(DVec3::ZERO, |t| DVec3::from_array(t[i]));
        let scale = scales.as_ref().map_or(DVec3::ONE, |s| DVec3::from_array(s[i]));
        let rotation = rotations.as_ref().map_or(Some(DQuat::IDENTITY), |r| unit(r[i]));
        zeros += usize::from(rotation.is_none());
        DAffine3::from_scale_rotation_translation(scale, rotation.unwrap_or(DQuat::IDENTITY), translation)
    });
    let copies = copies.collect();
    if zeros > 0 {
        warnings.push(at.warning(format_args!("{zeros} quaternions are zero; no rotation is applied there")));
    }
    Ok(copies)
}

/// Rejects copy attributes of a type that the extension does not allow.
fn check_copy_attribute(name: &str, at: &At<'_>, accessor: &Accessor<'_>) -> Result<(), Error> {
    let float = accessor.element.component == Component::F32;
    let signed = matches!(accessor.element.component, Component::I8 | Component::I16);
    let sound = match name {
        "TRANSLATION" | "SCALE" => accessor.kind == "VEC3" && (float || signed),
        "ROTATION" => accessor.kind == "VEC4" && (float || signed && accessor.element.normalized),
        _ => true,
    };
    if sound { Ok(()) } else { Err(at.error("the accessor is of a type that the extension does not allow")) }
}

fn vectors<const N: usize>(doc: &Document, at: &At<'_>, name: &'static str) -> Result<Option<Vec<[f64; N]>>, Error> {
    let Some(index) = at.get(name) else { return Ok(None) };
    let accessor = Accessor::referred(doc, &index)?;
    let all = accessor.vectors_f64();
    match all.iter().position(|v: &[f64; N]| !v.iter().all(|x| x.is_finite())) {
        Some(i) => Err(index.error(format_args!("the value of copy {i} is not finite"))),
        None => Ok(Some(all)),
    }
}

/// Sets the parent of every node.
fn link_parents(root: &At<'_>, nodes: &mut [Node]) -> Result<(), Error> {
    for parent in 0..nodes.len() {
        for i in 0..nodes[parent].children.len() {
            let child = nodes[parent].children[i];
            if let Some(other) = nodes[child].parent.replace(parent) {
                let place = root.get("nodes").and_then(|list| list.element(child)).unwrap_or(*root);
                return Err(place.error(format_args!("is a child of nodes[{other}] and of nodes[{parent}]")));
            }
        }
    }
    Ok(())
}

/// Rejects cycles. As nodes have at most one parent, those not reachable from a root are on or below a cycle.
fn check_acyclic(root: &At<'_>, nodes: &[Node]) -> Result<(), Error> {
    let mut reached = vec![false; nodes.len()];
    let tops = (0..nodes.len()).filter(|i| nodes[*i].parent.is_none()).collect();
    mark_below(nodes, tops, &mut reached);
    let Some(start) = reached.iter().position(|r| !r) else { return Ok(()) };
    let mut on_cycle = start;
    for _ in 0..nodes.len() {
        on_cycle = nodes[on_cycle].parent.unwrap_or(on_cycle);
    }
    let place = root.get("nodes").and_then(|list| list.element(on_cycle)).unwrap_or(*root);
    Err(place.error("is its own ancestor"))
}

/// Marks nodes and their descendants; already marked nodes are not visited again.
pub(super) fn mark_below(nodes: &[Node], mut todo: Vec<usize>, marked: &mut [bool]) {
    while let Some(node) = todo.pop() {
        if !std::mem::replace(&mut marked[node], true) {
            todo.extend(&nodes[node].children);
        }
    }
}
