//! Reads the scenes of all experiments.

use std::path::Path;

use raykiln_formats::Document;

use crate::commands::verify;
use crate::scene::{Bounds, Scene};

/// A scene with its document.
pub(super) struct ReadScene {
    pub(super) doc: Document,
    pub(super) scene: Scene,
    /// What its reader repaired or omitted.
    pub(super) warnings: Vec<String>,
}

/// Reads a scene.
///
/// # Errors
/// Which file cannot be read or has no triangles, and why, in words.
pub(super) fn read(path: &Path) -> Result<ReadScene, String> {
    let (doc, scene, warnings) = verify::read_document(path).map_err(|e| e.to_string())?;
    Ok(ReadScene { doc, scene, warnings })
}

/// Returns the box of a scene without sky domes and far objects.
pub(super) fn core_bounds(scene: &Scene) -> Bounds {
    let core = scene.core().bounds();
    if core.is_empty() { scene.bounds() } else { core }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_without_triangles_is_refused_by_name() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).expect("writable");
            read(&path).err().unwrap_or_default()
        };
        let empty = at("empty.obj", "v 0 0 0\n");
        assert!(empty.ends_with("empty.obj: the default scene holds no triangles"), "{empty}");
        assert!(at("broken.glb", "no scene").contains("broken.glb"));
        assert_eq!(at("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "");
    }
}
