//! [`Outline`]: which files a scene consists of and how large it is, found without reading its geometry.

use std::fs;
use std::path::{Path, PathBuf};

use crate::{Error, ObjOptions, gltf, obj};

/// The files of a scene, and how large it is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Outline {
    /// The files that the scene's file refers to, each once: buffers and images of glTF, material libraries and textures of
    /// OBJ. Files that do not exist are among them as far as their place is known.
    pub files: Vec<PathBuf>,
    /// Size of the scene's file and of the files that exist, in bytes.
    pub bytes: u64,
    /// Number of triangles stored, estimated from counts in the file; 0 if they cannot be read.
    pub triangles_stored: u64,
    /// Number of triangles placed by nodes, estimated likewise. 0 if nothing is placed.
    pub triangles_placed: u64,
}

/// Returns the files of a scene and its size. What is wrong in the file is ignored as far as possible, because whoever
/// reads the scene finds it.
///
/// # Errors
/// Fails if the scene's file cannot be read, or is not JSON.
pub fn outline(path: &Path) -> Result<Outline, Error> {
    outline_with(path, &ObjOptions::default())
}

/// Like [`outline`], with options for OBJ files.
///
/// # Errors
/// See [`outline`].
pub fn outline_with(path: &Path, options: &ObjOptions) -> Result<Outline, Error> {
    let mut outline = if obj::is_obj(path) { obj::outline(path, options)? } else { gltf::outline::outline(path)? };
    let mut seen = std::collections::BTreeSet::new();
    outline.files.retain(|file| seen.insert(file.clone()));
    let all = [path].into_iter().chain(outline.files.iter().map(PathBuf::as_path));
    outline.bytes = all.filter_map(|file| fs::metadata(file).ok()).map(|metadata| metadata.len()).sum();
    Ok(outline)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn write(folder: &Path, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        fs::write(&path, text).expect("writable");
        path
    }

    #[test]
    fn files_and_triangles_of_gltf_are_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let json = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"uri": "a%20b.bin", "byteLength": 4}, {"uri": "data:,xx", "byteLength": 2}],
            "images": [{"uri": "missing.png"}, {"uri": "a%20b.bin"}],
            "accessors": [{"count": 30}, {"count": 12}, {"count": 5}],
            "meshes": [
                {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]},
                {"primitives": [{"attributes": {"POSITION": 0}}]}
            ],
            "nodes": [
                {"mesh": 0}, {"mesh": 0},
                {"mesh": 1, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}}
            ]
        });
        let scene = write(folder.path(), "scene.gltf", json.to_string());
        let buffer = write(folder.path(), "a b.bin", "1234");
        let outline = outline(&scene).expect("it is read");
        assert_eq!(outline.files, [buffer, folder.path().join("missing.png")]);
        assert_eq!((outline.triangles_stored, outline.triangles_placed), (14, 2 * 4 + 5 * 10));
        assert_eq!(outline.bytes, json.to_string().len() as u64 + 4);
    }

    #[test]
    fn only_the_json_of_a_binary_file_is_needed() {
        let folder = tempfile::tempdir().expect("a folder");
        let text = br#"{"asset": {"version": "2.0"}, "images": [{"uri": "i.png"}]}"#;
        let word = |n: usize| (n as u32).to_le_bytes();
        let glb = [&b"glTF"[..], &word(2), &word(99), &word(text.len()), b"JSON", text, b"no chunk"].concat();
        let outline = outline(&write(folder.path(), "scene.glb", glb)).expect("it is read");
        assert_eq!(outline.files, [folder.path().join("i.png")]);
    }

    #[test]
    fn files_and_triangles_of_obj_are_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let text = "mtllib mine.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\n  f 1 2 4 3 # quad\n";
        let scene = write(folder.path(), "scene.obj", text);
        let library = write(folder.path(), "Mine.mtl", "newmtl a\nmap_Kd -s 1 1 1 t/Image.png\nmap_d t/none.png\n");
        let image = write(folder.path(), "t/image.png", "");
        let outline = outline(&scene).expect("it is read");
        assert_eq!(outline.files, [library, image]);
        assert_eq!((outline.triangles_stored, outline.triangles_placed), (3, 3));
    }

    #[test]
    fn a_file_that_is_not_json_is_an_error() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(outline(&write(folder.path(), "scene.gltf", "{")).is_err());
        assert!(outline(&write(folder.path(), "scene.glb", "glTF")).is_err());
        assert!(outline(&folder.path().join("absent.obj")).is_err());
    }
}
