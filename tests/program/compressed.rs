//! Every command takes compressed files; nothing after reading knows what they were compressed with.

use crate::common::{methods, raykiln};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The samples of the readers' tests; they show the same scene but for rounding.
pub(crate) const SAMPLES: [&str; 4] = ["meshopt.glb", "meshopt_khr.glb", "draco.glb", "draco_sequential.glb"];

pub(crate) fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("formats/tests/compressed").join(name)
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

#[test]
fn every_method_bakes_and_verifies_each_compressed_sample() {
    let folder = TempDir::new().expect("a temporary folder");
    let output = folder.path().join("out.glb");
    let fixed = ["--rays", "200", "--repeats", "1", "--device", "cpu", "--json"];
    for name in SAMPLES {
        for method in methods() {
            let bake = ["bake", text(&sample(name)), "-o", text(&output), "--method", method].map(str::to_owned);
            let ran = raykiln(bake.iter().map(String::as_str).chain(fixed));
            assert_eq!(ran.status, 0, "{name} {method}: {}", ran.stderr);
        }
        let ran = raykiln(["verify", text(&sample(name)), text(&output)].iter().chain(&fixed));
        assert_eq!(ran.status, 0, "{name}: {}", ran.stderr);
        let structure = &ran.json()["verify"]["structure"];
        for fault in ["missing", "unknown", "moved"] {
            assert_eq!(structure[fault]["count"], 0, "{name} {fault}: {}", ran.stdout);
        }
    }
}

#[test]
fn an_output_that_is_left_alone_stays_compressed_byte_for_byte() {
    let folder = TempDir::new().expect("a temporary folder");
    for name in SAMPLES {
        let output = folder.path().join(name);
        let ran = raykiln(["bake", text(&sample(name)), "-o", text(&output), "--method", "keep", "--quiet"]);
        assert_eq!(ran.status, 0, "{name}: {}", ran.stderr);
        assert!(fs::read(sample(name)).expect("readable") == fs::read(&output).expect("written"), "{name}");
    }
}

#[test]
fn inspect_and_render_take_compressed_files() {
    let folder = TempDir::new().expect("a temporary folder");
    let png = folder.path().join("out.png");
    for name in SAMPLES {
        let report = raykiln(["inspect", text(&sample(name)), "--json"]).json();
        let triangles = report["input"]["triangles"].as_u64();
        assert_eq!(triangles, Some(if name.starts_with("draco") { 1536 } else { 2304 }), "{name}");
        let ran = raykiln(["render", text(&sample(name)), "-o", text(&png), "--size", "32x20", "--json"]);
        assert_eq!(ran.status, 0, "{name}: {}", ran.stderr);
        assert!(ran.json()["statistics"]["seen_ratio"].as_f64().expect("a number") > 0.05, "{name}");
    }
}

#[cfg(feature = "lab")]
#[test]
fn the_lab_takes_compressed_files() {
    let folder = TempDir::new().expect("a temporary folder");
    for name in SAMPLES {
        fs::copy(sample(name), folder.path().join(name)).expect("writable");
    }
    let config = "scenes = ['*.glb']\nout = 'tables'\ndevice = 'cpu'\nrays = 64\ncounted_rays = 256\nrepeats = 1\nmethods = ['single']\n";
    let path = folder.path().join("lab.toml");
    fs::write(&path, config).expect("writable");
    let ran = raykiln(["lab", text(&path)]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let table = fs::read_to_string(folder.path().join("tables/layouts.csv")).expect("written");
    assert!(SAMPLES.iter().all(|name| table.contains(name.trim_end_matches(".glb"))), "{table}");
}

/// Bakes a file; returns the report and the output's bytes.
fn baked(input: &Path, output: &Path, more: &[&str]) -> (serde_json::Value, Vec<u8>) {
    let fixed = ["--rays", "200", "--repeats", "1", "--device", "cpu", "--json"];
    let ran = raykiln(["bake", text(input), "-o", text(output)].iter().chain(&fixed).chain(more));
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let report = ran.json();
    crate::common::schema::assert_conforms(&report);
    (report, fs::read(output).expect("written"))
}

#[test]
fn outputs_are_compressed_without_loss_if_asked() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = sample("meshopt.glb");
    for method in methods() {
        let [plain, small] = ["plain.glb", "small.glb"].map(|name| folder.path().join(name));
        let (report, bytes) = baked(&input, &plain, &["--method", method]);
        let (compressed, fewer) = baked(&input, &small, &["--method", method, "--compress", "meshopt"]);
        assert_eq!(compressed["output_bytes"], fewer.len(), "{method}");
        if report["verdict"] == "left alone" {
            assert_eq!((report["output_compression"].as_str(), bytes.len()), (Some("input"), 30_908), "{method}");
            continue;
        }
        assert_eq!(report["output_compression"], "none", "{method}");
        assert_eq!(compressed["output_compression"], "meshopt", "{method}");
        assert!(5 * fewer.len() < 4 * bytes.len(), "{method}: {} of {} bytes", fewer.len(), bytes.len());
        let [plain, small] = [&plain, &small].map(|path| raykiln_formats::read(path).expect("sound"));
        for mesh in 0..plain.json["meshes"].as_array().expect("a list").len() {
            let [plain, small] = [&plain, &small].map(|doc| doc.attributes(mesh, 0));
            assert!(plain.iter().zip(&small).all(|(a, b)| a.data == b.data), "{method}");
        }
    }
}

#[test]
fn an_input_that_is_left_alone_is_compressed_if_that_is_smaller() {
    let folder = TempDir::new().expect("a temporary folder");
    let [plain, small] = ["plain.glb", "small.glb"].map(|name| folder.path().join(name));
    raykiln_formats::read(&sample("meshopt.glb")).and_then(|doc| doc.stage(&plain)?.commit()).expect("written");
    let keep = ["--method", "keep", "--compress", "meshopt"];
    let (report, bytes) = baked(&plain, &small, &keep);
    assert_eq!(
        (report["verdict"].as_str(), report["output_compression"].as_str()),
        (Some("left alone"), Some("meshopt"))
    );
    assert!(bytes.len() < fs::metadata(&plain).expect("there").len() as usize);
    let (report, bytes) = baked(&sample("draco.glb"), &small, &keep);
    assert_eq!(report["output_compression"], "input");
    assert!(bytes == fs::read(sample("draco.glb")).expect("readable"));
}

#[test]
fn the_report_says_whether_the_output_is_compressed() {
    let folder = TempDir::new().expect("a temporary folder");
    let output = folder.path().join("out.glb");
    let fixed = ["--rays", "200", "--repeats", "1", "--device", "cpu"];
    let said = |more: &[&str]| {
        let bake = ["bake", text(&sample("draco.glb")), "-o", text(&output)].map(str::to_owned);
        let ran = raykiln(bake.iter().map(String::as_str).chain(fixed).chain(more.iter().copied()));
        assert_eq!(ran.status, 0, "{}", ran.stderr);
        ran.stderr
    };
    let single = said(&["--method", "single"]);
    assert!(single.contains("uncompressed; the input has 9.5 KiB"), "{single}");
    let small = said(&["--method", "single", "--compress", "meshopt"]);
    assert!(small.contains("compressed without loss; the input has 9.5 KiB"), "{small}");
    let keep = said(&["--method", "keep"]);
    assert!(keep.contains("file: 9.5 KiB, the bytes of the input"), "{keep}");
}

#[test]
fn pictures_in_other_formats_are_carried_through() {
    let formats: [(&str, &[u8], &str); 4] = [
        ("KHR_texture_basisu", b"\xABKTX 20\xBB\r\n\x1A\nrest", "image/ktx2"),
        ("EXT_texture_webp", b"RIFF\0\0\0\0WEBPVP8 rest", "image/webp"),
        ("EXT_texture_avif", b"\0\0\0\x20ftypavif rest", "image/avif"),
        ("MSFT_texture_dds", b"DDS \x7C rest", "image/vnd-ms.dds"),
    ];
    let textured = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/textured");
    for (extension, picture, mime) in formats {
        let folder = TempDir::new().expect("a temporary folder");
        let mut json: serde_json::Value =
            serde_json::from_slice(&fs::read(textured.join("scene.gltf")).expect("readable")).expect("JSON");
        json["textures"][0]["extensions"] = serde_json::json!({ extension: { "source": 0 } });
        json["textures"][0].as_object_mut().expect("an object").remove("source");
        json["extensionsUsed"] = serde_json::json!([extension]);
        json["extensionsRequired"] = serde_json::json!([extension]);
        json["images"] = serde_json::json!([{ "uri": "wall.image" }]);
        fs::copy(textured.join("scene.bin"), folder.path().join("scene.bin")).expect("writable");
        fs::write(folder.path().join("wall.image"), picture).expect("writable");
        let [input, output] = ["in.gltf", "out.glb"].map(|name| folder.path().join(name));
        fs::write(&input, json.to_string()).expect("writable");
        baked(&input, &output, &["--method", "single", "--compress", "meshopt"]);
        let doc = raykiln_formats::read(&output).expect("sound");
        assert_eq!(doc.json["textures"], json["textures"], "{extension}");
        assert!(doc.json["extensionsRequired"].as_array().expect("a list").contains(&extension.into()));
        assert_eq!(doc.json["images"][0]["mimeType"], mime);
        assert_eq!(doc.image(0).read().expect("there"), picture, "{extension}");
    }
}
