//! Lists of the extensions that a file uses and requires. What is known of each extension: `references/table.rs`.

use std::collections::BTreeSet;

use serde_json::Value;

use super::edit::remove_key;
use super::json::At;
use super::references::{self, table::is_readable};
use crate::Error;
use crate::extension_names::*;

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
    let gone: Vec<String> = names(input).into_iter().filter(|name| !now.contains(name)).collect();
    gone.iter().for_each(|name| forget(json, name));
}

/// Returns the names of all extension objects, except those in extras.
fn names(json: &Value) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    references::each_name(json, &mut |name| {
        if !names.contains(name) {
            names.insert(name.to_owned());
        }
    });
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
