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

/// Reads a GLB file with one buffer view, compressed by meshopt: the first byte chooses the mode and the filter, the next
/// two the number of elements and their size, and the rest is the stream.
pub fn meshopt(bytes: &[u8]) {
    let [choice, count, stride, stream @ ..] = bytes else { return };
    let mode = ["ATTRIBUTES", "TRIANGLES", "INDICES"][usize::from(choice % 3)];
    let filter = ["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"][usize::from(choice / 3 % 5)];
    let (count, stride) = (u64::from(*count) * 9, u64::from(*stride));
    let length = count * stride;
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["KHR_meshopt_compression"],
        "buffers":[{{"byteLength":{packed}}},{{"byteLength":{length}}}],
        "bufferViews":[{{"buffer":1,"byteLength":{length},"extensions":{{"KHR_meshopt_compression":{{
        "buffer":0,"byteLength":{packed},"byteStride":{stride},"count":{count},"mode":"{mode}","filter":"{filter}"}}}}}}]}}"#,
        packed = stream.len()
    );
    glb(&joined(json, stream));
}

/// Reads a GLB file with one primitive, compressed by Draco to these bytes.
pub fn draco(bytes: &[u8]) {
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["KHR_draco_mesh_compression"],
        "buffers":[{{"byteLength":{length}}}],"bufferViews":[{{"buffer":0,"byteLength":{length}}}],
        "accessors":[{{"componentType":5126,"count":3,"type":"VEC3"}},{{"componentType":5125,"count":3,"type":"SCALAR"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"extensions":{{"KHR_draco_mesh_compression":
        {{"bufferView":0,"attributes":{{"POSITION":0}}}}}}}}]}}],"nodes":[{{"mesh":0}}]}}"#,
        length = bytes.len()
    );
    glb(&joined(json, bytes));
}

/// A GLB file of its two chunks.
fn joined(mut json: String, bin: &[u8]) -> Vec<u8> {
    json.extend(std::iter::repeat_n(' ', json.len().next_multiple_of(4) - json.len()));
    let length = |bytes: usize| u32::try_from(bytes).expect("a small file").to_le_bytes();
    let total = 28 + json.len() + bin.len();
    let head = [&b"glTF\x02\0\0\0"[..], &length(total), &length(json.len()), b"JSON"].concat();
    [&head, json.as_bytes(), &length(bin.len()), b"BIN\0", bin].concat()
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
