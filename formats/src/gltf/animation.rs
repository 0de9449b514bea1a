//! Finds the nodes that animations move.

use super::accessor::Accessor;
use super::json::At;
use crate::contents::Node;
use crate::extension_names::KHR_ANIMATION_POINTER;
use crate::{Document, Error};

/// Marks the nodes that animations move, or whose meshes' morph weights they change.
pub(super) fn mark_animated(doc: &Document, nodes: &mut [Node]) -> Result<(), Error> {
    let mut meshes = vec![false; At::root(doc).count("meshes")];
    for animation in At::root(doc).list("animations")? {
        let samplers = animation.count("samplers");
        for sampler in animation.list("samplers")? {
            for key in ["input", "output"] {
                Accessor::referred(doc, &sampler.need(key)?)?;
            }
        }
        for channel in animation.list("channels")? {
            channel.need("sampler")?.index_into("samplers", samplers)?;
            let target = channel.need("target")?;
            if let Some(node) = target.index("node", "nodes", nodes.len())? {
                nodes[node].animated = true;
            }
            if let Some(pointer) = target.extension(KHR_ANIMATION_POINTER).and_then(|e| e.get("pointer")) {
                mark_pointer(&pointer, nodes, &mut meshes)?;
            }
        }
    }
    for node in nodes {
        node.animated |= node.mesh.is_some_and(|mesh| meshes[mesh]);
    }
    Ok(())
}

/// Marks the target of a JSON pointer of `KHR_animation_pointer`.
fn mark_pointer(pointer: &At<'_>, nodes: &mut [Node], meshes: &mut [bool]) -> Result<(), Error> {
    let mut parts = pointer.string()?.split('/').skip(1);
    let (list, index) = (parts.next().unwrap_or_default(), parts.next().and_then(|i| i.parse::<usize>().ok()));
    let missing = || pointer.error("points to nothing");
    match list {
        "nodes" => index.and_then(|i| nodes.get_mut(i)).ok_or_else(missing)?.animated = true,
        "meshes" => *index.and_then(|i| meshes.get_mut(i)).ok_or_else(missing)? = true,
        _ => {}
    }
    Ok(())
}
