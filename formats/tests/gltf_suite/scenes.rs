//! Every glTF scene of `target/scenes`, where that folder exists.

use std::path::{Path, PathBuf};

use raykiln_formats::{Contents, Document, ReadOptions, read};

use crate::support::folder;

fn scenes() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut todo = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/scenes")];
    while let Some(folder) = todo.pop() {
        for path in std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
            match path.extension().and_then(|e| e.to_str()) {
                _ if path.is_dir() => todo.push(path),
                Some("gltf" | "glb") => found.push(path),
                _ => {}
            }
        }
    }
    found.sort();
    found
}

/// Everything that an untouched copy must agree in.
fn assert_equal(a: (&Document, &Contents), b: (&Document, &Contents)) {
    let name = a.0.path.display();
    assert_eq!(format!("{:?}", a.1.nodes), format!("{:?}", b.1.nodes), "{name}");
    for (m, (mesh, other)) in a.1.meshes.iter().zip(&b.1.meshes).enumerate() {
        for (p, (primitive, other)) in mesh.primitives.iter().zip(&other.primitives).enumerate() {
            assert!(primitive.triangles == other.triangles, "{name} {m} {p}");
            assert_eq!(primitive.merge_key, other.merge_key);
            for (x, y) in a.0.attributes(m, p).iter().zip(b.0.attributes(m, p)) {
                assert!((&x.name, x.element, x.count, &x.data) == (&y.name, y.element, y.count, &y.data), "{name}");
            }
        }
    }
    for list in ["nodes", "meshes", "materials", "accessors", "animations", "skins", "extensions", "extras", "asset"] {
        assert_eq!(a.0.json.get(list), b.0.json.get(list), "{name}");
    }
}

#[test]
fn scenes_survive_writing_or_are_refused_for_their_compression() {
    for path in scenes() {
        let doc = match read(&path) {
            Ok(doc) => doc,
            Err(e) => {
                assert!(e.cause.contains("compressed geometry is not read yet"), "{e}");
                continue;
            }
        };
        let contents = doc.contents(ReadOptions::default()).unwrap();
        for name in ["out.glb", "out.gltf"] {
            let folder = folder(&[]);
            let staged = doc.stage(&folder.path().join(name)).unwrap();
            let back = read(staged.path()).unwrap();
            assert_equal((&doc, &contents), (&back, &back.contents(ReadOptions::default()).unwrap()));
        }
    }
}
