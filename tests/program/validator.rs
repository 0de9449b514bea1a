//! The Khronos glTF validator finds no error in any output.

use crate::common::{bake, methods, samples};
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// Asserts that the validator finds no error; panics if Node.js or the validator is missing.
fn assert_valid(files: &[PathBuf]) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let modules = root.join("target/npm");
    assert!(
        modules.join("node_modules/gltf-validator").is_dir(),
        "the Khronos validator is not installed: run tests/all.sh once"
    );
    let output = Command::new("node")
        .arg(root.join("tests/validate.mjs"))
        .arg(modules)
        .args(files)
        .output()
        .expect("node is installed; tests/all.sh does that");
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(output.status.success(), "{text}");
    assert_eq!(text.lines().count(), files.len(), "a line for each file:\n{text}");
}

#[test]
fn the_samples_are_valid() {
    let gltf = samples().into_iter().map(|s| s.scene).filter(|s| s.extension().is_some_and(|e| e != "obj"));
    assert_valid(&gltf.collect::<Vec<_>>());
}

#[test]
fn every_output_is_valid() {
    for kind in ["glb", "gltf"] {
        let folder = TempDir::new().expect("a temporary folder");
        let mut outputs = Vec::new();
        for sample in samples() {
            for (method, instancing) in methods().into_iter().flat_map(|m| [(m, "nodes"), (m, "extension")]) {
                let name = format!("{}-{method}-{instancing}", sample.name);
                let output = folder.path().join(name).join("out").with_extension(kind);
                std::fs::create_dir(output.parent().expect("a folder")).expect("a new folder");
                bake(&sample.scene, &output, &["--method", method, "--instancing", instancing]);
                outputs.push(output);
            }
        }
        assert_valid(&outputs);
    }
}

#[test]
fn the_test_would_notice_an_error() {
    let folder = TempDir::new().expect("a temporary folder");
    let file = folder.path().join("bad.gltf");
    std::fs::write(&file, r#"{"asset": {"version": "2.0"}, "scene": 3}"#).expect("writable");
    assert!(std::panic::catch_unwind(|| assert_valid(&[file])).is_err());
}
