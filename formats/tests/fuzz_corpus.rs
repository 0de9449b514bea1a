//! The inputs of `fuzz/corpus`, each read by the target of its folder: an error or a document, and no panic.

#[expect(unreachable_pub, reason = "in fuzz/ it is a library")]
#[path = "../../fuzz/src/lib.rs"]
mod targets;

use std::fs;
use std::path::Path;

/// Replays the corpus of a target; a corpus that is missing proves nothing.
fn replay(name: &str, target: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(name);
    let mut replayed = 0;
    for entry in fs::read_dir(&folder).expect("the corpus is there") {
        let file = entry.expect("a file").path();
        println!("{}", file.display());
        target(&fs::read(&file).expect("a readable file"));
        replayed += 1;
    }
    assert!(replayed >= 3, "{replayed} inputs in {}", folder.display());
}

#[test]
fn no_glb_of_the_corpus_panics() {
    replay("glb", targets::glb);
}

#[test]
fn no_gltf_of_the_corpus_panics() {
    replay("gltf", targets::gltf);
}

#[test]
fn no_obj_of_the_corpus_panics() {
    replay("obj", targets::obj);
}

#[test]
fn no_mtl_of_the_corpus_panics() {
    replay("mtl", targets::mtl);
}

#[test]
fn no_meshopt_stream_of_the_corpus_panics() {
    replay("meshopt", targets::meshopt);
}

#[test]
fn no_draco_stream_of_the_corpus_panics() {
    replay("draco", targets::draco);
}
