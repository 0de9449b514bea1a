//! The HTML page: complete in one small file, and sound in a browser whatever the names in a scene hold.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Opened, bake, raykiln, samples};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Names that are dangerous if they are shown as they are.
fn hostile_names() -> Vec<String> {
    let long = "long name ".repeat(1000);
    let names = [
        "<img src=x onerror=alert(1)>",
        "</script><script>hacked = 1; alert(2)</script>",
        "\"><svg onload=alert(3)>",
        "' onmouseover='alert(4)",
        "<!-- {{ 7 * 7 }} {% raw %} -->",
        "right \u{202e}tfel ot\u{202c} \u{2066}isolate",
        "bell \u{7} null \u{0} escape \u{1b}[31m line\u{2028}end\r\n",
        "&lt;b&gt; &amp;amp; %3Cscript%3E",
        long.as_str(),
    ];
    names.map(String::from).to_vec()
}

/// A sample with hostile names of nodes, meshes and materials.
fn hostile_scene(folder: &Path) -> PathBuf {
    let sample = samples().into_iter().find(|s| s.name == "woven").expect("the sample is there");
    let plain = folder.join("plain.gltf");
    bake(&sample.scene, &plain, &["--method", "keep"]);
    let mut opened = Opened::read(&plain);
    let names = hostile_names();
    for list in ["nodes", "meshes", "materials"] {
        let named = opened.json[list].as_array_mut().into_iter().flatten();
        named.zip(names.iter().cycle()).for_each(|(object, name)| object["name"] = name.as_str().into());
    }
    opened.write(folder)
}

/// Runs a command that writes `NAME.html` and `NAME.json` of its report; returns the page.
fn page(folder: &Path, name: &str, arguments: &[&str]) -> String {
    let [html, json] = ["html", "json"].map(|end| folder.join(name).with_extension(end));
    let reports = ["--report", html.to_str().expect("UTF-8"), "--report", json.to_str().expect("UTF-8")];
    let ran = raykiln([name].iter().chain(arguments).chain(&reports));
    assert_eq!(ran.status, 0, "{name}: {}", ran.stderr);
    fs::read_to_string(html).expect("the page is written")
}

/// Makes a page with a slider through the rounds of `overlap`.
fn page_with_rounds(folder: &Path) {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/overlapping/scene.glb");
    let [output, html] = ["rounds.glb", "rounds.html"].map(|name| folder.join(name));
    let [scene, output, html] = [&scene, &output, &html].map(|path| path.to_str().expect("UTF-8"));
    let ran = raykiln(["bake", scene, "-o", output, "--method", "overlap", "--device", "cpu", "--report", html]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
}

/// Makes the page of a quick run of the thesis's experiments on the samples.
fn page_of_experiments(folder: &Path) {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples");
    let out = folder.join("experiments");
    let [scenes, made] = [&samples, &out].map(|path| path.to_str().expect("UTF-8"));
    let ran = raykiln(["lab", "thesis", "--quick", "--device", "cpu", "--scenes", scenes, "--out", made]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    fs::rename(out.join("thesis.html"), folder.join("thesis.html")).expect("the page is written");
}

/// Makes the pages of all commands for a scene with hostile names.
fn pages(folder: &Path) -> [(&'static str, String); 3] {
    let scene = hostile_scene(folder);
    let (scene, output) = (scene.to_str().expect("UTF-8"), folder.join("out.glb"));
    let output = output.to_str().expect("UTF-8");
    let traced = ["--device", "cpu", "--rays", "2000", "--repeats", "2"];
    [
        ("bake", page(folder, "bake", &[&[scene, "-o", output][..], &traced].concat())),
        ("verify", page(folder, "verify", &[&[scene, output][..], &traced].concat())),
        ("inspect", page(folder, "inspect", &[scene])),
    ]
}

/// The JSON in a `script` element of a page.
fn embedded(page: &str, id: &str) -> Value {
    let start = format!("<script type=\"application/json\" id=\"{id}\">");
    let text = page.split(&start).nth(1).and_then(|rest| rest.split("</script>").next());
    serde_json::from_str(text.expect("the element is there")).expect("JSON")
}

#[test]
fn pages_are_small_hold_their_report_and_work_in_a_browser_whatever_the_names() {
    let folder = TempDir::new().expect("a temporary folder");
    for (name, page) in pages(folder.path()) {
        assert!(page.len() < 5_000_000, "{name}: {} bytes", page.len());
        let json = fs::read_to_string(folder.path().join(name).with_extension("json")).expect("the report is written");
        assert_eq!(embedded(&page, "report"), serde_json::from_str::<Value>(&json).expect("JSON"), "{name}");
        let scripts = page.matches("<script").count();
        assert_eq!((scripts, page.matches("</script>").count()), (4, 4), "{name}");
        let forbidden = ["<img src=x", "<svg onload", "\u{202e}", "\u{2028}", "\u{0}"];
        assert!(forbidden.iter().all(|text| !page.contains(text)), "{name}");
        assert_ne!(embedded(&page, "scene-data")["objects"]["names"], json!([]), "{name}");
    }
    page_with_rounds(folder.path());
    page_of_experiments(folder.path());
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let ran =
        Command::new("node").arg(root.join("tests/page.mjs")).arg(root.join("target/npm")).arg(folder.path()).output();
    let ran = ran.expect("node is installed; tests/all.sh does that");
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
}

#[test]
fn the_pictures_of_the_readme_are_current() {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pictures.sh");
    let ran = Command::new("bash").arg(script).arg("--check").env("RAYKILN", env!("CARGO_BIN_EXE_raykiln")).output();
    let ran = ran.expect("bash is installed");
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
}

#[test]
fn a_scene_that_is_left_alone_has_a_page_of_one_scene() {
    let folder = TempDir::new().expect("a temporary folder");
    let sample = samples().into_iter().find(|s| s.name == "clean").expect("the sample is there").scene;
    let output = folder.path().join("out.glb");
    let arguments = [sample.to_str().expect("UTF-8"), "-o", output.to_str().expect("UTF-8"), "--device", "cpu"];
    let page = page(folder.path(), "bake", &arguments);
    let data = embedded(&page, "scene-data");
    assert!(page.contains("The scene stays as it is") && data["after"].is_null() && !data["before"].is_null());
}
