//! Buffers that hold nothing but the uncompressed form of compressed buffer views.

use super::meshopt;
use crate::gltf::json::{At, unsigned};

/// Whether a buffer is only there for readers that cannot decompress: by its flag, or because all buffer views that refer
/// to it are compressed.
pub(in crate::gltf) fn is_fallback(root: &At<'_>, buffer: usize) -> bool {
    let flagged = |at: &At<'_>| meshopt::extension(at).is_some_and(|e| e.value["fallback"] == true);
    let at = root.get("buffers").and_then(|list| list.element(buffer));
    at.as_ref().is_some_and(flagged) || holds_compressed_views_only(root, buffer)
}

fn holds_compressed_views_only(root: &At<'_>, buffer: usize) -> bool {
    let Ok(views) = root.list("bufferViews") else { return false };
    let of_buffer = |at: &At<'_>| unsigned(&at.value["buffer"]) == Some(buffer);
    let mut views = views.filter(of_buffer).peekable();
    views.peek().is_some() && views.all(|view| meshopt::extension(&view).is_some())
}
