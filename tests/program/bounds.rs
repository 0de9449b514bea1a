//! Which files a scene may name, which files an output may replace, how much memory a bake may use, and what is left behind.

use crate::common::{Ran, folder_names, gltf, raykiln, samples, write};
use serde_json::json;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// A triangle whose buffer is a file of this name.
fn scene(folder: &Path, uri: &str) -> std::path::PathBuf {
    let embedded = raykiln_formats::read_bytes("scene.glb", gltf(CORNERS, [0, 1, 2], |_| {})).unwrap();
    let (mut json, bytes) = (embedded.json, &embedded.buffers[0]);
    json["buffers"][0]["uri"] = uri.into();
    fs::create_dir_all(folder.join("in")).unwrap();
    fs::write(folder.join("in/beside.bin"), bytes).unwrap();
    fs::write(folder.join("secret.bin"), bytes).unwrap();
    write(&folder.join("in"), "scene.gltf", serde_json::to_vec(&json).unwrap())
}

fn inspect(scene: &Path, more: &[&str]) -> Ran {
    raykiln(["inspect", scene.to_str().unwrap(), "--json"].iter().chain(more))
}

#[test]
fn files_outside_of_the_folder_are_named_and_of_the_root_refused() {
    let folder = TempDir::new().unwrap();
    let root = folder.path().join("in");
    let (root, all) = (root.to_str().unwrap(), folder.path().to_str().unwrap());
    let beside = scene(folder.path(), "beside.bin");
    assert_eq!(inspect(&beside, &[]).json()["warnings"], json!([]));
    assert_eq!(inspect(&beside, &["--root", root]).status, 0);
    let outside = scene(folder.path(), "../secret.bin");
    let warned = inspect(&outside, &[]);
    assert_eq!(warned.status, 0);
    assert!(warned.json()["warnings"][0].as_str().is_some_and(|w| w.contains("secret.bin")), "{}", warned.stdout);
    assert_eq!(inspect(&outside, &["--root", all]).status, 0);
    let refused = inspect(&outside, &["--root", root]);
    assert_eq!((refused.status, refused.stdout.as_str()), (2, ""));
    for part in ["scene.gltf", "buffers[0].uri", "secret.bin", "outside of"] {
        assert!(refused.stderr.contains(part), "{part} is missing in {}", refused.stderr);
    }
    let absolute = scene(folder.path(), folder.path().join("secret.bin").to_str().unwrap());
    let refused = inspect(&absolute, &[]);
    assert!(refused.status == 2 && refused.stderr.contains("absolute path"), "{}", refused.stderr);
    assert_eq!(inspect(&absolute, &["--root", all]).status, 0);
    assert_eq!(inspect(&absolute, &["--root", root]).status, 2);
}

#[cfg(unix)]
#[test]
fn links_that_lead_out_of_the_root_are_refused() {
    let folder = TempDir::new().unwrap();
    let linked = scene(folder.path(), "link.bin");
    std::os::unix::fs::symlink("../secret.bin", folder.path().join("in/link.bin")).unwrap();
    let refused = inspect(&linked, &["--root", folder.path().join("in").to_str().unwrap()]);
    assert!(refused.status == 2 && refused.stderr.contains("secret.bin"), "{}", refused.stderr);
}

#[test]
fn textures_of_an_obj_file_outside_of_the_root_are_refused() {
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join("in")).unwrap();
    write(folder.path(), "m.mtl", "newmtl m\n");
    let scene = write(&folder.path().join("in"), "a.obj", "mtllib ../m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_eq!(inspect(&scene, &["--root", folder.path().to_str().unwrap()]).status, 0);
    let refused = inspect(&scene, &["--root", folder.path().join("in").to_str().unwrap()]);
    assert!(refused.status == 2 && refused.stderr.contains("m.mtl"), "{}", refused.stderr);
}

#[test]
fn an_output_replaces_its_input_only_if_that_is_allowed() {
    let folder = TempDir::new().unwrap();
    let sample = samples().into_iter().find(|sample| sample.name == "overlapping").unwrap().scene;
    let scene = write(folder.path(), "scene.glb", fs::read(sample).unwrap());
    let path = scene.to_str().unwrap();
    let bake = ["bake", path, "-o", path, "--method", "single", "--device", "cpu", "--rays", "200", "--repeats", "1"];
    let before = fs::read(&scene).unwrap();
    let refused = raykiln(bake);
    assert!(refused.status == 2 && refused.stderr.contains("--in-place"), "{}", refused.stderr);
    assert_eq!(fs::read(&scene).unwrap(), before);
    assert_eq!(raykiln(bake.iter().chain(&["--in-place"])).status, 0);
    assert_ne!(fs::read(&scene).unwrap(), before);
    assert_eq!(folder_names(folder.path()), ["scene.glb"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_bake_ends_before_it_uses_more_memory_than_allowed() {
    let folder = TempDir::new().unwrap();
    let sample = samples().into_iter().find(|sample| sample.name == "overlapping").unwrap().scene;
    let output = folder.path().join("out.glb");
    let bake =
        ["bake", sample.to_str().unwrap(), "-o", output.to_str().unwrap(), "--device", "cpu", "--rays", "400000"];
    let refused = raykiln(bake.iter().chain(&["--max-memory", "8MiB"]));
    assert_eq!(refused.status, 2, "{}", refused.stderr);
    assert!(refused.stderr.contains("--max-memory") && !output.exists(), "{}", refused.stderr);
    assert!(folder_names(folder.path()).is_empty());
}
