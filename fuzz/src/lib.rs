//! Entry points of the fuzz targets: read bytes and examine everything that was read. Errors are expected, panics are
//! not.
//!
//! `formats/tests/fuzz_corpus.rs` includes this file and replays the corpus.

use std::fs;

use raykiln_formats::{Document, Error, ReadOptions, read, read_bytes};

/// Reads a GLB file.
pub fn glb(bytes: &[u8]) {
    examine(read_bytes("scene.glb", bytes.to_vec()));
}

/// Reads a glTF file with its buffers in data URIs.
pub fn gltf(bytes: &[u8]) {
    examine(read_bytes("scene.gltf", bytes.to_vec()));
}

/// Reads an OBJ file.
pub fn obj(bytes: &[u8]) {
    examine(read_bytes("scene.obj", bytes.to_vec()));
}

/// Reads an MTL file through a fixed OBJ file that uses the materials `a` and `b`.
pub fn mtl(bytes: &[u8]) {
    const OBJ: &str = "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 3 2 1\n";
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("scene.mtl"), bytes).expect("the temporary folder can be written to");
    fs::write(folder.path().join("scene.obj"), OBJ).expect("the temporary folder can be written to");
    examine(read(&folder.path().join("scene.obj")));
}

/// Examines everything in a document that a scene is made from.
fn examine(document: Result<Document, Error>) {
    let Ok(document) = document else { return };
    let _ = document.contents(ReadOptions::default().with_strict(true));
    let Ok(contents) = document.contents(ReadOptions::default()) else { return };
    for (mesh, primitives) in contents.meshes.iter().map(|mesh| mesh.primitives.len()).enumerate() {
        for primitive in 0..primitives {
            for attribute in document.attributes(mesh, primitive) {
                assert!((0..attribute.count as u32).all(|i| attribute.bytes(i).len() == attribute.element.size()));
            }
        }
    }
    for material in 0..contents.materials.len() {
        let _ = document.alpha_test(material);
    }
}
