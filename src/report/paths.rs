//! Paths in JSON: what of them is not Unicode becomes replacement characters, as on the terminal.

use std::path::Path;

use serde::Serializer;

/// Serializes a path as a string.
pub(super) fn serialize<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
}

/// Serializes a path as a string, if there is one.
pub(super) fn serialize_some<S: Serializer>(path: &Option<std::path::PathBuf>, to: S) -> Result<S::Ok, S::Error> {
    match path {
        Some(path) => serialize(path, to),
        None => to.serialize_none(),
    }
}
