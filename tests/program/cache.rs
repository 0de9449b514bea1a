//! `bake --cache`, `--depfile` and streams: results that are found again, what they depend on, and pipes.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::common::{Ran, folder_names, gltf, raykiln, samples, write};
use serde_json::{Value, json};
use tempfile::TempDir;

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
const FEW_RAYS: [&str; 8] = ["--device", "cpu", "--rays", "100", "--repeats", "1", "--views", "2"];

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// Bakes with a cache in the folder; returns what was printed.
fn bake(folder: &Path, input: &Path, output: &str, more: &[&str]) -> Ran {
    let (output, cache) = (folder.join(output), folder.join("cache"));
    let files = ["bake", text(input), "-o", text(&output), "--cache", text(&cache)];
    let ran = raykiln(files.iter().chain(&FEW_RAYS).chain(more));
    assert_eq!(ran.status, 0, "{input:?} {more:?}: {}", ran.stderr);
    ran
}

fn is_hit(ran: &Ran) -> bool {
    ran.stderr.contains("from the cache")
}

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

/// A glTF file with a buffer and an image in files of their own.
fn in_files(folder: &Path) -> PathBuf {
    let glb = gltf(CORNERS, [0, 1, 2], |json| {
        json["buffers"][0]["uri"] = "shape.bin".into();
        json["images"] = json!([{"uri": "missing.png"}, {"uri": "texture.png"}]);
    });
    let json_length = u32::from_le_bytes(glb[12..16].try_into().expect("four bytes")) as usize;
    write(folder, "shape.bin", &glb[28 + json_length..]);
    write(folder, "texture.png", b"not read");
    write(folder, "scene.gltf", &glb[20..20 + json_length])
}

#[test]
fn a_result_is_found_again_by_content_and_has_the_same_bytes() {
    let folder = TempDir::new().expect("a folder");
    let (scene, other) = (sample("overlapping"), folder.path().join("other name.glb"));
    fs::copy(&scene, &other).expect("copied");
    assert!(!is_hit(&bake(folder.path(), &scene, "a.glb", &[])));
    let ran = bake(folder.path(), &other, "b.glb", &["--json", "--threads", "1"]);
    assert!(is_hit(&ran), "{}", ran.stderr);
    let bytes = |name: &str| fs::read(folder.path().join(name)).expect("written");
    assert!(bytes("a.glb") == bytes("b.glb"));
    let report = ran.json();
    assert_eq!(report["input"]["path"], text(&other));
    assert_eq!(report["output"], text(&folder.path().join("b.glb")));
    assert!(ran.stderr.contains(report["verdict"].as_str().expect("a verdict")));
    assert_eq!(folder_names(folder.path()), ["a.glb", "b.glb", "cache", "other name.glb"]);
}

#[test]
fn another_option_another_file_or_another_report_is_another_result() {
    let folder = TempDir::new().expect("a folder");
    let scene = in_files(folder.path());
    let baked = |more: &[&str]| is_hit(&bake(folder.path(), &scene, "out.glb", more));
    assert!(!baked(&[]));
    assert!(baked(&["--threads", "2"]));
    assert!(!baked(&["--method", "single"]));
    assert!(!baked(&["--seed", "7"]));
    let findings = folder.path().join("findings.sarif");
    assert!(!baked(&["--report", text(&findings)]));
    fs::remove_file(&findings).expect("written");
    assert!(baked(&["--report", text(&findings)]));
    assert!(fs::read_to_string(&findings).expect("written").contains("2.1.0"));
    write(folder.path(), "texture.png", b"another picture");
    assert!(!baked(&[]));
    assert!(baked(&[]));
    write(folder.path(), "missing.png", b"found");
    assert!(!baked(&[]));
    let mut buffer = fs::read(folder.path().join("shape.bin")).expect("readable");
    buffer[12..16].copy_from_slice(&2_f32.to_le_bytes());
    write(folder.path(), "shape.bin", buffer);
    assert!(!baked(&[]));
    assert!(baked(&[]));
}

#[test]
fn a_material_library_decides_too() {
    let folder = TempDir::new().expect("a folder");
    let obj = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    let scene = write(folder.path(), "scene.obj", obj);
    write(folder.path(), "m.mtl", "newmtl a\nKd 1 0 0\n");
    let baked = || is_hit(&bake(folder.path(), &scene, "out.gltf", &[]));
    assert!(!baked());
    assert!(baked());
    write(folder.path(), "m.mtl", "newmtl a\nKd 0 1 0\n");
    assert!(!baked());
}

#[test]
fn all_files_of_an_output_come_back() {
    let folder = TempDir::new().expect("a folder");
    let scene = in_files(folder.path());
    fs::create_dir(folder.path().join("out")).expect("created");
    bake(folder.path(), &scene, "out/baked.gltf", &[]);
    let out = folder.path().join("out");
    let names = folder_names(&out);
    assert!(names.len() > 2, "{names:?}");
    let files: Vec<Vec<u8>> = names.iter().map(|name| fs::read(out.join(name)).expect("readable")).collect();
    fs::remove_dir_all(&out).expect("removed");
    fs::create_dir(&out).expect("created");
    assert!(is_hit(&bake(folder.path(), &scene, "out/baked.gltf", &[])));
    assert_eq!(folder_names(&out), names);
    assert!(names.iter().zip(files).all(|(name, bytes)| fs::read(out.join(name)).expect("readable") == bytes));
    // A buffer of something else is not replaced.
    fs::remove_file(out.join("baked.gltf")).expect("removed");
    write(&out, "baked.bin", b"of something else");
    assert!(!is_hit(&bake(folder.path(), &scene, "out/baked.gltf", &[])));
    assert_eq!(fs::read(out.join("baked.bin")).expect("there"), b"of something else");
}

#[test]
fn a_damaged_result_is_made_again() {
    let folder = TempDir::new().expect("a folder");
    let scene = write(folder.path(), "scene.glb", gltf(CORNERS, [0, 1, 2], |_| ()));
    bake(folder.path(), &scene, "out.glb", &[]);
    let cache = folder.path().join("cache");
    let of_keys = folder_names(&cache).into_iter().find(|name| name.len() == 2).expect("a result");
    let result = cache.join(&of_keys).join(&folder_names(&cache.join(&of_keys))[0]);
    let mut bytes = fs::read(&result).expect("readable");
    *bytes.last_mut().expect("a byte") ^= 1;
    fs::write(&result, &bytes).expect("writable");
    assert!(!is_hit(&bake(folder.path(), &scene, "out.glb", &[])));
    assert!(is_hit(&bake(folder.path(), &scene, "out.glb", &[])));
    let ran = raykiln(["cache", "verify", text(&cache)]);
    assert_eq!((ran.status, ran.stdout.starts_with("1 result")), (0, true), "{}", ran.stdout);
    fs::write(&result, &bytes[..bytes.len() - 1]).expect("writable");
    let ran = raykiln(["cache", "verify", text(&cache)]);
    assert_eq!((ran.status, ran.stdout.contains("damaged")), (1, true), "{}", ran.stdout);
    bake(folder.path(), &scene, "out.glb", &[]);
    let ran = raykiln(["cache", "clean", text(&cache), "--cache-size", "1GiB"]);
    assert!(ran.stdout.starts_with("removed 0 results"), "{}", ran.stdout);
    assert!(raykiln(["cache", "clean", text(&cache)]).stdout.starts_with("removed 1 result"));
    assert_eq!(raykiln(["cache", "clean", text(folder.path())]).status, 2);
}

#[test]
fn a_cache_stays_below_its_size() {
    let folder = TempDir::new().expect("a folder");
    let scene = write(folder.path(), "scene.glb", gltf(CORNERS, [0, 1, 2], |_| ()));
    bake(folder.path(), &scene, "out.glb", &["--cache-size", "10B"]);
    assert!(!is_hit(&bake(folder.path(), &scene, "out.glb", &[])));
    assert!(is_hit(&bake(folder.path(), &scene, "out.glb", &[])));
}

#[test]
fn a_cache_that_cannot_be_written_to_does_not_stop_a_bake() {
    let folder = TempDir::new().expect("a folder");
    let scene = write(folder.path(), "scene.glb", gltf(CORNERS, [0, 1, 2], |_| ()));
    let cache = folder.path().join("cache");
    fs::create_dir(&cache).expect("created");
    bake(folder.path(), &scene, "out.glb", &[]);
    let of_keys = folder_names(&cache).into_iter().find(|name| name.len() == 2).expect("a result");
    fs::remove_dir_all(cache.join(&of_keys)).expect("removed");
    write(&cache, &of_keys, b"a file in the way");
    let ran = bake(folder.path(), &scene, "out.glb", &[]);
    assert!(ran.stderr.contains("warning: the result is not kept"), "{}", ran.stderr);
}

#[test]
fn a_depfile_names_every_file_that_exists() {
    let folder = TempDir::new().expect("a folder");
    let within = folder.path().join("with space");
    fs::create_dir(&within).expect("created");
    let scene = in_files(&within);
    let (output, depfile) = (within.join("out.glb"), folder.path().join("out.d"));
    let files = ["bake", text(&scene), "-o", text(&output), "--depfile", text(&depfile)];
    assert_eq!(raykiln(files.iter().chain(&FEW_RAYS)).status, 0);
    let within = text(&within).replace(' ', "\\ ");
    let lines = ["out.glb: \\\n", "  scene.gltf \\\n", "  shape.bin \\\n", "  texture.png\n"];
    let expected = lines.map(|line| match line.strip_prefix("  ") {
        Some(name) => format!("  {within}/{name}"),
        None => format!("{within}/{line}"),
    });
    assert_eq!(fs::read_to_string(&depfile).expect("written"), expected.concat());
}

/// Runs a bake from standard input to standard output.
fn stream(bytes: &[u8], more: &[&str]) -> (i32, Vec<u8>, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_raykiln"))
        .args(["bake", "-", "-o", "-", "--quiet"].iter().chain(&FEW_RAYS).chain(more))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    child.stdin.take().expect("piped").write_all(bytes).expect("it reads");
    let output = child.wait_with_output().expect("it ends");
    (output.status.code().unwrap_or(-1), output.stdout, String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_scene_passes_through_pipes() {
    let folder = TempDir::new().expect("a folder");
    let scene = sample("overlapping");
    bake(folder.path(), &scene, "out.glb", &[]);
    let (status, glb, stderr) = stream(&fs::read(&scene).expect("readable"), &[]);
    assert_eq!((status, stderr.as_str()), (0, ""));
    assert!(glb == fs::read(folder.path().join("out.glb")).expect("written"));
    let (status, glb, _) = stream(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", &[]);
    assert_eq!((status, glb.starts_with(b"glTF")), (0, true));
}

#[test]
fn a_stream_that_cannot_be_baked_prints_nothing() {
    let refers = gltf(CORNERS, [0, 1, 2], |json| json["images"] = json!([{"uri": "a.png"}]));
    for (bytes, more, words) in [
        (&b"glTF"[..], &[][..], "stdin.glb"),
        (b"", &[], "standard input is empty"),
        (&refers, &[], "refers to a file"),
        (&refers, &["--json"], "standard output"),
        (&refers, &["--cache", "unused"], "--cache"),
    ] {
        let (status, stdout, stderr) = stream(bytes, more);
        assert_eq!((status, stdout.len()), (2, 0), "{words}");
        assert!(stderr.contains(words), "{words} is missing in {stderr}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn the_report_goes_to_a_file_descriptor() {
    let folder = TempDir::new().expect("a folder");
    let scene = write(folder.path(), "scene.glb", gltf(CORNERS, [0, 1, 2], |_| ()));
    let script =
        r#"exec 3>&1 >"$2"; "$0" bake - -o - --emit-report-fd 3 --quiet --device cpu --rays 100 --repeats 1 <"$1""#;
    let output = folder.path().join("out.glb");
    let arguments = ["-c", script, env!("CARGO_BIN_EXE_raykiln"), text(&scene), text(&output)];
    let ran = Command::new("sh").args(arguments).output().expect("a shell");
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let report: Value = serde_json::from_slice(&ran.stdout).expect("JSON");
    crate::common::schema::assert_conforms(&report);
    assert_eq!((report["input"]["path"].as_str(), report["output"].as_str()), (Some("stdin.glb"), Some("-")));
    assert!(fs::read(&output).expect("written").starts_with(b"glTF"));
    let bad = ["bake", text(&scene), "-o", text(&output), "--emit-report-fd", "77"];
    let ran = raykiln(bad.iter().chain(&FEW_RAYS));
    assert_eq!((ran.status, ran.stderr.contains("--emit-report-fd 77")), (2, true), "{}", ran.stderr);
}
