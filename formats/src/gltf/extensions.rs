//! Known glTF extensions: which can be read, and which refer to elements that the bake renumbers.

use std::collections::BTreeSet;

use serde_json::Value;

use super::edit::remove_key;
use super::json::At;
use crate::Error;
use crate::extension_names::*;

/// Extensions whose geometry semantics are supported or that do not affect geometry, besides `KHR_materials_*`. They
/// may be required, and they refer to meshes, accessors or buffer views only in places that `compact` knows.
const READABLE: &[&str] = &[
    ADOBE_MATERIALS_CLEARCOAT_SPECULAR,
    ADOBE_MATERIALS_THIN_TRANSPARENCY,
    EXT_LIGHTS_IMAGE_BASED,
    EXT_MATERIALS_BUMP,
    EXT_MESH_FEATURES,
    EXT_MESH_GPU_INSTANCING,
    EXT_TEXTURE_AVIF,
    EXT_TEXTURE_WEBP,
    FB_GEOMETRY_METADATA,
    GODOT_SINGLE_ROOT,
    KHR_ANIMATION_POINTER,
    KHR_LIGHTS_PUNCTUAL,
    KHR_MESH_QUANTIZATION,
    KHR_TEXTURE_BASISU,
    KHR_TEXTURE_TRANSFORM,
    KHR_XMP,
    KHR_XMP_JSON_LD,
    MSFT_PACKING_NORMAL_ROUGHNESS_METALLIC,
    MSFT_PACKING_OCCLUSION_ROUGHNESS_METALLIC,
    MSFT_TEXTURE_DDS,
];

/// Extensions that must not be required, but whose references are known, so that they do not prevent renumbering.
const RENUMBERABLE: &[&str] = &[
    KHR_DRACO_MESH_COMPRESSION,
    KHR_NODE_HOVERABILITY,
    KHR_NODE_SELECTABILITY,
    KHR_NODE_VISIBILITY,
    MSFT_LOD,
    MSFT_SCREENCOVERAGE,
];

/// Extensions of a node that do not affect its mesh.
const HARMLESS_ON_NODES: &[&str] = &[EXT_MESH_GPU_INSTANCING, KHR_LIGHTS_PUNCTUAL, KHR_XMP, KHR_XMP_JSON_LD];

/// Compression of buffer views by meshoptimizer, under its vendor and Khronos names.
pub(super) const MESHOPT: [&str; 2] = [EXT_MESHOPT_COMPRESSION, KHR_MESHOPT_COMPRESSION];

/// Rejects a file that requires an unsupported extension.
pub(super) fn check_required_of_file(root: &At<'_>) -> Result<(), Error> {
    check(root, |name| is_readable(name) || name == KHR_DRACO_MESH_COMPRESSION || MESHOPT.contains(&name))
}

/// Rejects a document, decompressed as it is after reading, that requires an unsupported extension.
pub(super) fn check_required(root: &At<'_>) -> Result<(), Error> {
    check(root, is_readable)
}

fn check(root: &At<'_>, is_supported: impl Fn(&str) -> bool) -> Result<(), Error> {
    for at in root.list("extensionsRequired")? {
        let name = at.string()?;
        if !is_supported(name) {
            return Err(at.error(format_args!("the required extension {name} is not supported")).unsupported());
        }
    }
    Ok(())
}

fn is_readable(name: &str) -> bool {
    name.starts_with(KHR_MATERIALS) || READABLE.contains(&name)
}

/// Whether an extension of a node does not affect its mesh.
pub(super) fn is_harmless_on_nodes(name: &str) -> bool {
    HARMLESS_ON_NODES.contains(&name)
}

/// Returns the first extension object of the document that may refer to meshes, accessors or buffer views in unknown
/// ways.
pub(super) fn first_unknown(json: &Value) -> Option<String> {
    let mut todo = vec![json];
    while let Some(value) = todo.pop() {
        match value {
            Value::Array(list) => todo.extend(list.iter().rev()),
            Value::Object(map) => {
                let extensions = map.get("extensions").and_then(Value::as_object);
                let names = extensions.into_iter().flat_map(|e| e.keys());
                if let Some(name) = names.into_iter().find(|name| !is_renumberable(name)) {
                    return Some(name.clone());
                }
                if map.get("pointer").is_some_and(points_to_renumbered) {
                    return Some(KHR_ANIMATION_POINTER.to_owned());
                }
                todo.extend(map.iter().rev().filter(|(key, _)| *key != "extras").map(|(_, value)| value));
            }
            _ => {}
        }
    }
    None
}

fn is_renumberable(name: &str) -> bool {
    is_readable(name) || RENUMBERABLE.contains(&name)
}

fn points_to_renumbered(pointer: &Value) -> bool {
    let lists = ["/meshes/", "/accessors/", "/bufferViews/"];
    pointer.as_str().is_some_and(|p| lists.iter().any(|list| p.starts_with(list)))
}

/// Removes an extension of an object, and `extensions` itself when nothing is left in it.
pub(super) fn remove(object: &mut Value, name: &str) -> Option<Value> {
    remove_key(object.as_object_mut()?, "extensions", name)
}

/// Removes the names of extensions that have objects in `input` but none left in `json`.
pub(crate) fn forget_unused(json: &mut Value, input: &Value) {
    if json.get("extensionsUsed").is_none() && json.get("extensionsRequired").is_none() {
        return;
    }
    let now = names(json);
    let gone: Vec<&String> = names(input).into_iter().filter(|name| !now.contains(name)).collect();
    gone.into_iter().for_each(|name| forget(json, name));
}

/// Returns the names of all extension objects, except those in extras.
fn names(json: &Value) -> BTreeSet<&String> {
    let mut names = BTreeSet::new();
    let mut todo = vec![json];
    while let Some(value) = todo.pop() {
        match value {
            Value::Array(list) => todo.extend(list),
            Value::Object(map) => {
                let extensions = map.get("extensions").and_then(Value::as_object);
                names.extend(extensions.into_iter().flat_map(|e| e.keys()));
                todo.extend(map.iter().filter(|(key, _)| *key != "extras").map(|(_, value)| value));
            }
            _ => {}
        }
    }
    names
}

/// Removes a name from `extensionsUsed` and `extensionsRequired`.
pub(super) fn forget(json: &mut Value, name: &str) {
    for key in ["extensionsUsed", "extensionsRequired"] {
        let Some(list) = json.get_mut(key).and_then(Value::as_array_mut) else { continue };
        list.retain(|v| v != name);
        if list.is_empty()
            && let Some(root) = json.as_object_mut()
        {
            root.shift_remove(key);
        }
    }
}
