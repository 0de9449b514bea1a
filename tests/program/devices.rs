//! Vulkan devices: listing, selection, rejection. These tests need the software driver that `tests/install_vulkan.sh`
//! installs.

use crate::common::{Ran, folder_names, methods, raykiln, samples};
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Part of the name of Mesa's software driver.
const SOFTWARE: &str = "llvmpipe";

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

fn bake_on(device: &str, scene: &Path, more: &[&str]) -> (Ran, TempDir) {
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.glb");
    let (scene, output) = (scene.to_str().unwrap(), output.to_str().unwrap());
    let fixed = ["bake", scene, "-o", output, "--json", "--device", device, "--rays", "500", "--repeats", "3"];
    (raykiln(fixed.iter().chain(more)), folder)
}

#[test]
fn devices_are_listed_with_what_they_can_do() {
    let ran = raykiln(["devices", "--json"]);
    assert_eq!((ran.status, ran.stderr.as_str()), (0, ""));
    let report = ran.json();
    let devices = report["devices"].as_array().expect("a list");
    let software = devices.iter().find(|d| d["name"].as_str().is_some_and(|n| n.contains(SOFTWARE)));
    let software = software.expect("tests/install_vulkan.sh was run");
    assert_eq!((&software["can_trace"], &software["is_software"]), (&Value::Bool(true), &Value::Bool(true)));
    assert!(software["limits"]["instances"].as_u64() > Some(1 << 20));
    assert!(software["memory_bytes"].as_u64() > Some(0) && software["driver"].is_string());
    let text = raykiln(["devices"]);
    assert_eq!((text.status, text.stderr.as_str()), (0, ""));
    for word in [SOFTWARE, "traces rays", "VK_KHR_ray_tracing_pipeline", "instances"] {
        assert!(text.stdout.contains(word), "{word} is missing in:\n{}", text.stdout);
    }
}

#[test]
fn every_method_verifies_on_a_device() {
    for scene in ["overlapping", "instanced"] {
        for method in methods() {
            let (ran, _folder) = bake_on(SOFTWARE, &sample(scene), &["--method", method]);
            assert_eq!(ran.status, 0, "{scene} {method}: {}", ran.stderr);
            let verify = &ran.json()["verify"];
            assert!(verify["device"].as_str().is_some_and(|d| d.contains(SOFTWARE)), "{scene} {method}: {verify}");
            assert_eq!(verify["mismatches"], 0, "{scene} {method}");
            assert!(verify["hits"].as_u64() > Some(0), "{scene} {method}");
            for key in ["blas_bytes", "blas_bytes_compacted", "tlas_bytes", "blas_build_ms", "tlas_build_ms"] {
                assert!(verify[key]["before"].as_f64() > Some(0.0), "{scene} {method} {key}");
                assert!(verify[key]["after"].as_f64() > Some(0.0), "{scene} {method} {key}");
            }
        }
    }
}

#[test]
fn auto_times_the_fastest_layout_along_other_axes() {
    let (ran, _folder) = bake_on(SOFTWARE, &sample("overlapping"), &["--method", "auto"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let report = ran.json();
    let candidates = report["method"]["candidates"].as_array().expect("candidates");
    let speed = |c: &Value| c["measured_speedup_ratio"].as_f64();
    let is_along_others = |c: &&Value| c["name"].as_str().is_some_and(|name| name.contains(", axes "));
    let (others, straight): (Vec<&Value>, Vec<&Value>) = candidates.iter().partition(is_along_others);
    assert_eq!(speed(&candidates[0]), Some(1.0), "the input's speedup is 1");
    assert!(straight.iter().all(|c| speed(c).is_none() || c.get("measured_spread_ratio").is_some()));
    let sure = |c: &&Value| Some(speed(c)? - c["measured_spread_ratio"].as_f64()?);
    let fastest = straight.iter().filter(|c| c["name"] != "keep").filter_map(sure).fold(0.0, f64::max);
    // Layouts that may be clearly slower than the input are not tried along other axes.
    assert_eq!(others.len(), usize::from(fastest >= 0.95), "{candidates:?}");
    for other in others {
        let name = other["name"].as_str().and_then(|name| name.split(", axes ").next());
        let same = straight.iter().find(|c| c["name"].as_str() == name).expect("the layout it is made of");
        assert!(speed(other) > Some(0.0));
        for key in ["as_bytes", "predicted_cost"] {
            assert_eq!(other[key], same[key], "{key}");
        }
    }
}

#[test]
fn build_options_reach_the_device() {
    let scene = sample("overlapping");
    let (plain, _folder) = bake_on(SOFTWARE, &scene, &["--method", "single", "--compact", "false"]);
    assert_eq!(plain.json()["verify"]["blas_bytes_compacted"], Value::Null);
    let options = ["--method", "single", "--build-flags", "fast-build", "--allow-update", "--blas-per", "primitive"];
    let (per_primitive, _folder) = bake_on(SOFTWARE, &scene, &options);
    let report = per_primitive.json();
    assert_eq!(report["verify"]["blases"]["after"], report["after"]["geometries"]);
}

#[test]
fn text_shows_what_the_device_built() {
    let (ran, _folder) = bake_on(SOFTWARE, &sample("overlapping"), &[]);
    for words in ["BLAS bytes", "TLAS build", SOFTWARE] {
        assert!(ran.stderr.contains(words), "{words} is missing in:\n{}", ran.stderr);
    }
}

#[test]
fn a_device_that_is_not_there_is_an_error_and_leaves_no_file() {
    for device in ["no such device", "99"] {
        let (ran, folder) = bake_on(device, &sample("overlapping"), &[]);
        assert_eq!((ran.status, ran.stdout.as_str()), (2, ""), "{}", ran.stderr);
        assert!(ran.stderr.contains("--device") && ran.stderr.contains(SOFTWARE), "{}", ran.stderr);
        assert!(folder_names(folder.path()).is_empty());
    }
}

#[test]
fn a_software_driver_is_used_only_when_named() {
    let (ran, _folder) = bake_on("auto", &sample("overlapping"), &[]);
    let report = ran.json();
    let device = report["verify"]["device"].as_str().expect("a device");
    assert!(!device.contains(SOFTWARE), "{device}");
    let noted = report["notes"].as_array().expect("notes").iter().any(|n| n.as_str().unwrap().contains("on the CPU"));
    assert_eq!(noted, device.starts_with("CPU"), "{report}");
}

#[test]
fn textures_of_alpha_tested_materials_are_found_beside_input_and_output_or_named() {
    let folder = TempDir::new().unwrap();
    let textured = sample("textured");
    for name in ["scene.bin", "brick wall.png"] {
        std::fs::copy(textured.with_file_name(name), folder.path().join(name)).unwrap();
    }
    let mut json: Value = serde_json::from_slice(&std::fs::read(&textured).unwrap()).unwrap();
    json["materials"][0]["alphaMode"] = "MASK".into();
    let scene = folder.path().join("scene.gltf");
    std::fs::write(&scene, json.to_string()).unwrap();
    let notes = |output: &str| {
        let output = folder.path().join(output);
        let (scene, output) = (scene.to_str().unwrap(), output.to_str().unwrap());
        let ran = raykiln([
            "bake",
            scene,
            "-o",
            output,
            "--method",
            "single",
            "--json",
            "--device",
            SOFTWARE,
            "--rays",
            "200",
            "--repeats",
            "1",
        ]);
        assert_eq!(ran.status, 0, "{}", ran.stderr);
        let report = ran.json();
        let on_textures = |note: &&Value| note.as_str().is_some_and(|n| n.contains("timed rays take these textures"));
        report["notes"].as_array().expect("a list").iter().filter(on_textures).cloned().collect::<Vec<_>>()
    };
    std::fs::create_dir(folder.path().join("elsewhere")).unwrap();
    for output in ["out.gltf", "out.glb", "elsewhere/out.gltf"] {
        assert_eq!(notes(output), Vec::<Value>::new(), "{output}");
    }
    std::fs::remove_file(folder.path().join("brick wall.png")).unwrap();
    let missing = notes("missing.gltf");
    assert_eq!(missing.len(), 2, "{missing:?}");
    assert!(missing.iter().all(|n| n.as_str().is_some_and(|n| n.contains("brick wall.png"))), "{missing:?}");
}
