//! `KHR_draco_mesh_compression`: compressed primitives. Only those with uncompressed accessors are read.

use crate::extension_names::KHR_DRACO_MESH_COMPRESSION;
use crate::gltf::json::{At, unsigned};
use crate::gltf::{edit, extensions};
use crate::{Document, Error, Warning};

/// Drops optional Draco compression: the uncompressed accessors hold the same data, and the compressed copy would
/// contradict every changed primitive.
pub(super) fn decompress(doc: &mut Document) -> Result<(), Error> {
    let root = At::root(doc);
    let mut dropped = 0;
    for mesh in root.list("meshes")? {
        for primitive in mesh.list("primitives")? {
            if primitive.extension(KHR_DRACO_MESH_COMPRESSION).is_some() {
                check_fallback(&root, &primitive)?;
                dropped += 1;
            }
        }
    }
    if dropped > 0 {
        edit::each_primitive(&mut doc.json, |primitive| {
            extensions::remove(primitive, KHR_DRACO_MESH_COMPRESSION);
        });
        extensions::forget(&mut doc.json, KHR_DRACO_MESH_COMPRESSION);
        let message = format!(
            "{KHR_DRACO_MESH_COMPRESSION} of {dropped} primitives is left out; their uncompressed accessors are used"
        );
        doc.warnings.push(Warning { place: "meshes".into(), message });
    }
    Ok(())
}

/// Rejects a Draco primitive whose accessors have no data of their own.
fn check_fallback(root: &At<'_>, primitive: &At<'_>) -> Result<(), Error> {
    let accessors = root.get("accessors");
    let attributes = primitive.get("attributes").and_then(|at| at.value.as_object());
    let attributes = attributes.into_iter().flat_map(|map| map.values());
    for index in attributes.chain(primitive.value.get("indices")) {
        let accessor = unsigned(index).and_then(|i| accessors?.element(i));
        if accessor.is_some_and(|at| at.get("bufferView").is_none() && at.get("sparse").is_none()) {
            let cause = format_args!(
                "{KHR_DRACO_MESH_COMPRESSION} has no uncompressed fallback here, and it is not decompressed yet"
            );
            return Err(primitive.error(cause).unsupported());
        }
    }
    Ok(())
}
