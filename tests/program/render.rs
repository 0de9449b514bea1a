//! The command `render`: the same bytes for any number of threads, and nothing left behind by bad input.

use crate::common::{bake, folder_names, gltf, raykiln, samples, write};
use raykiln::render::View;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

fn render(input: &Path, output: &Path, more: &[&str]) -> crate::common::Ran {
    let (input, output) = (input.to_str().expect("UTF-8"), output.to_str().expect("UTF-8"));
    raykiln(["render", input, "-o", output].iter().chain(more))
}

#[test]
fn pictures_have_the_same_bytes_for_any_number_of_threads() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = sample("transparent");
    for view in View::ALL {
        let pictures = ["1", "2", "5"].map(|threads| {
            let output = folder.path().join("out.png");
            let more = ["--view", view.name(), "--size", "40x22", "--samples", "2", "--json", "--threads", threads];
            let ran = render(&input, &output, &more);
            assert_eq!(ran.status, 0, "{}", ran.stderr);
            let seen = ran.json()["statistics"]["seen_ratio"].as_f64().expect("a number");
            assert!(seen > 0.01, "{} shows nothing", view.name());
            fs::read(&output).expect("written")
        });
        assert!(pictures[0].starts_with(b"\x89PNG"));
        assert!(pictures[0] == pictures[1] && pictures[0] == pictures[2], "{}", view.name());
    }
}

#[test]
fn bad_input_is_one_error_and_leaves_nothing_behind() {
    let folder = TempDir::new().expect("a temporary folder");
    let scene = write(folder.path(), "scene.glb", gltf(CORNERS, [0, 1, 2], |_| ()));
    let empty = write(
        folder.path(),
        "empty.glb",
        gltf(CORNERS, [0, 1, 2], |json| json["scenes"][0]["nodes"] = serde_json::json!([])),
    );
    let png = folder.path().join("out.png");
    let cases: [(&Path, &Path, &[&str], &str); 19] = [
        (&scene, &png, &["--view", "difference"], "takes two scenes"),
        (&scene, &png, &[scene.to_str().expect("UTF-8")], "difference only"),
        (&scene, &png, &["--depth", "3"], "boxes only"),
        (&scene, &png, &["--colours", "jet", "--view", "groups"], "heatmap, overlap only"),
        (&scene, &png, &["--size", "0x9"], "each side must be from 1"),
        (&scene, &png, &["--size", "16384x16384"], "at most"),
        (&scene, &png, &["--size", "9"], "--size"),
        (&scene, &png, &["--samples", "0"], "0 samples per pixel"),
        (&scene, &png, &["--scale", "-1", "--view", "heatmap"], "-1"),
        (&scene, &png, &["--camera", "1,1,1,1,1,1,60"], "the same point"),
        (&scene, &png, &["--camera", "nan,1,1,0,0,0,60"], "seven finite numbers"),
        (&scene, &png, &["--camera", "1,1,1,0,0,0,180"], "below 180"),
        (&scene, &png, &["--camera", "front"], "it has none at all"),
        (&scene, &png, &["--view", "sideways"], "sideways"),
        (&scene, &png, &["--device", "no such device"], "no such device"),
        (&scene, &folder.path().join("out.jpg"), &[], ".png"),
        (&scene, &folder.path().join("absent/out.png"), &[], "there is no folder"),
        (&empty, &png, &[], "no triangles"),
        (&folder.path().join("absent.glb"), &png, &[], "absent.glb"),
    ];
    for (input, output, more, words) in cases {
        let ran = render(input, output, more);
        assert_eq!((ran.status, ran.stdout.as_str()), (2, ""), "{more:?}: {}", ran.stderr);
        assert!(ran.stderr.contains(words) && ran.stderr.contains("error"), "{words}: {}", ran.stderr);
        assert_eq!(folder_names(folder.path()), ["empty.glb", "scene.glb"], "{more:?}");
    }
}

#[test]
fn a_camera_that_sees_nothing_is_said() {
    let folder = TempDir::new().expect("a temporary folder");
    let scene = write(folder.path(), "scene.glb", gltf(CORNERS, [0, 1, 2], |_| ()));
    let away = ["--camera", "0,0,5,0,0,9,40", "--size", "8x8"];
    let ran = render(&scene, &folder.path().join("out.png"), &away);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(ran.stderr.contains("the camera sees nothing"), "{}", ran.stderr);
}

#[test]
fn a_camera_of_the_file_is_found_by_number_and_name() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = sample("hierarchy");
    let named = |camera: &str| {
        let ran = render(&input, &folder.path().join("out.png"), &["--camera", camera, "--size", "8x8", "--json"]);
        (ran.status, ran.stderr.clone(), if ran.status == 0 { ran.json()["camera"].clone() } else { ran.stderr.into() })
    };
    let (status, _, name) = named("0");
    assert_eq!(status, 0);
    let name = name.as_str().and_then(|name| name.split('`').nth(1)).expect("a name in quotes").to_owned();
    assert_eq!(named(&name).2, named("0").2);
    let (status, error, _) = named("7");
    assert!(status == 2 && error.contains(&name), "{error}");
}

/// Draws the difference of two scenes; returns the mean absolute difference and the pixels by cause.
fn difference(before: &Path, after: &Path, more: &[&str]) -> (f64, [u64; 4]) {
    let folder = TempDir::new().expect("a temporary folder");
    let picture = folder.path().join("out.png");
    let fixed = [after.to_str().expect("UTF-8"), "--view", "difference", "--size", "48x32", "--samples", "2", "--json"];
    let ran = render(before, &picture, &[&fixed, more].concat());
    assert!(ran.status == 0 && picture.is_file(), "{}", ran.stderr);
    let differences = ran.json()["statistics"]["differences"].clone();
    let pixels =
        ["surface", "normal", "material", "light"].map(|cause| differences[format!("{cause}_pixels")].as_u64());
    (differences["mean_absolute"].as_f64().expect("a number"), pixels.map(|count| count.expect("a number")))
}

#[test]
fn a_bake_changes_no_pixel_and_a_wrong_texture_shows() {
    let folder = TempDir::new().expect("a temporary folder");
    let input = sample("textured");
    let baked = folder.path().join("baked.glb");
    bake(&input, &baked, &["--method", "single"]);
    let (mean, pixels) = difference(&input, &baked, &[]);
    assert!(mean < 0.05 && pixels.iter().sum::<u64>() <= 4, "{mean} {pixels:?}");

    let wrong = folder.path().join("wrong");
    fs::create_dir(&wrong).expect("writable");
    for entry in fs::read_dir(input.parent().expect("a folder")).expect("readable") {
        let file = entry.expect("readable").path();
        fs::copy(&file, wrong.join(file.file_name().expect("a name"))).expect("copied");
    }
    let images: Vec<PathBuf> =
        folder_names(&wrong).iter().filter(|n| n.ends_with(".png")).map(|n| wrong.join(n)).collect();
    assert_eq!(images.len(), 1);
    // Any other picture will do.
    assert_eq!(render(&input, &images[0], &["--view", "groups", "--size", "8x8"]).status, 0);
    let (mean, [surface, normal, material, _]) = difference(&input, &wrong.join("scene.gltf"), &[]);
    assert!(material > 20 && mean > 0.5 && surface + normal == 0, "{mean} {surface} {normal} {material}");
}
