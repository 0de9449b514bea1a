//! The command line: which output goes to which stream, which files are written, which status is returned.

use crate::common::schema::assert_conforms;
use crate::common::{folder_names, json_of, methods, raykiln, samples, write};
use raykiln::verify::rays::RayKind;
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

/// Bakes the overlapping heaps into a new folder, with further arguments.
fn bake_heaps(more: &[&str]) -> (crate::common::Ran, TempDir) {
    let folder = TempDir::new().unwrap();
    let (input, output) = (sample("overlapping"), folder.path().join("out.glb"));
    let fixed = ["bake", input.to_str().unwrap(), "-o", output.to_str().unwrap(), "--rays", "500", "--repeats", "1"];
    let ran = raykiln(fixed.iter().chain(more));
    (ran, folder)
}

#[test]
fn help_names_every_command_method_and_option() {
    let ran = raykiln(["--help"]);
    assert_eq!((ran.status, ran.stderr.as_str()), (0, ""));
    for command in ["bake", "batch", "verify", "inspect", "render", "lab", "devices", "cache", "completions", "man"] {
        assert!(ran.stdout.contains(command), "{command}");
    }
    let ran = raykiln(["bake", "--help"]);
    assert_eq!((ran.status, ran.stderr.as_str()), (0, ""));
    let options =
        ["--output", "--method", "--device", "--report", "--json", "--keep", "--strict", "--threads", "--quiet"];
    for word in options.iter().chain(&methods()).chain(&["auto", "--skip-overlap-ratio", "--split-or-merge-ratio"]) {
        assert!(ran.stdout.contains(word), "{word}");
    }
}

#[test]
fn an_option_that_does_not_apply_to_the_method_is_refused() {
    let (ran, folder) = bake_heaps(&["--method", "single", "--entry-cost", "3"]);
    assert_eq!((ran.status, folder_names(folder.path()).len()), (2, 0));
    for word in ["--entry-cost", "--method single", "cluster; auto; single, bvh, overlap with --instances choose"] {
        assert!(ran.stderr.contains(word), "{word} is missing in {}", ran.stderr);
    }
}

#[test]
fn version_is_that_of_the_package() {
    assert_eq!(raykiln(["--version"]).stdout, format!("raykiln {}\n", env!("CARGO_PKG_VERSION")));
    for words in [["--version", "--json"], ["--json", "-V"]] {
        let ran = raykiln(words);
        assert_eq!((ran.status, ran.stderr.as_str()), (0, ""));
        assert_conforms(&ran.json());
        assert_eq!(ran.json()["raykiln_version"], env!("CARGO_PKG_VERSION"));
    }
}

#[test]
fn outputs_say_which_version_and_options_made_them() {
    let record = |more: &[&str]| {
        let (ran, folder) = bake_heaps(&[&["--device", "cpu"], more].concat());
        assert_eq!(ran.status, 0, "{}", ran.stderr);
        json_of(&folder.path().join("out.glb"))["asset"]["extras"]["raykiln"].clone()
    };
    let version = env!("CARGO_PKG_VERSION");
    let options = json!({"method": "single", "keep": ["a*", "b"], "rays": "500", "repeats": "1", "prune": "true"});
    let given = ["--method", "single", "--keep", "a*", "--keep", "b", "--prune", "--threads", "1", "--seed", "1"];
    let found = record(&given);
    assert_eq!((&found["version"], &found["options"]), (&json!(version), &options));
    // What is left alone byte for byte has no record.
    assert_eq!(record(&["--method", "keep"]), Value::Null);
}

#[test]
fn bad_usage_ends_with_status_2() {
    for arguments in [
        &[][..],
        &["grill"],
        &["bake"],
        &["bake", "in.glb"],
        &["bake", "in.glb", "-o", "out.glb", "--method", "magic"],
        &["bake", "in.glb", "-o", "out.glb", "--skip-overlap-ratio", "much"],
        &["bake", "in.glb", "-o", "out.glb", "--skip-overlap-ratio", "-1"],
        &["bake", "in.glb", "-o", "out.glb", "--threads", "0"],
        &["bake", "in.glb", "-o", "out.glb", "--keep", "["],
    ] {
        let ran = raykiln(arguments);
        assert_eq!(ran.status, 2, "{arguments:?}: {}", ran.stderr);
        assert_eq!(ran.stdout, "", "{arguments:?}");
        assert!(!ran.stderr.is_empty(), "{arguments:?}");
    }
}

#[test]
fn text_for_people_goes_to_stderr() {
    let (ran, folder) = bake_heaps(&["--method", "overlap"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert_eq!(ran.stdout, "");
    for word in ["before", "after", "overlap", "instances", "triangles"] {
        assert!(ran.stderr.contains(word), "{word} is missing in:\n{}", ran.stderr);
    }
    assert!(!ran.stderr.contains('\u{1b}'), "no colours or progress bars if stderr is not a terminal");
    assert_eq!(folder_names(folder.path()), ["out.glb"]);
}

#[test]
fn quiet_prints_nothing() {
    let (ran, _folder) = bake_heaps(&["--quiet"]);
    assert_eq!((ran.status, ran.stdout.as_str(), ran.stderr.as_str()), (0, "", ""));
}

#[test]
fn the_json_report_has_the_promised_keys() {
    let (ran, _folder) = bake_heaps(&["--json", "--method", "overlap"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let report = ran.json();
    assert_eq!(report["schema"], "raykiln.bake/1");
    assert_eq!(report["raykiln_version"], env!("CARGO_PKG_VERSION"));
    assert_keys(&report, "input", "path triangles vertices objects materials nodes instances pinned_instances");
    for side in ["before", "after"] {
        let metrics = "mesh_groups geometries instances triangles_stored triangles_placed overlap_ratio core_overlap_ratio \
                       sah_cost two_level_cost boxes_per_point_mean";
        assert_keys(&report, side, metrics);
    }
    assert_keys(&report, "method", "requested chosen reason candidates");
    let candidate = "name predicted_cost measured_mrays_per_s as_bytes position_error_ratio seconds";
    assert_keys(&report["method"]["candidates"], "0", candidate);
    assert_keys(&report["passes"], "0", "name applied reason seconds");
    let verify = "device rays hits mismatches far_hits max_relative_distance_error rms_relative_distance_error \
                  position_error_ratio kinds seams";
    assert_keys(&report, "verify", verify);
    let seams = "rays before_lost after_lost before_lost_per_million after_lost_per_million opened closed";
    assert_keys(&report["verify"], "seams", seams);
    for kind in RayKind::ALL.map(RayKind::name) {
        let rates = "before_mrays_per_s after_mrays_per_s speedup_ratio spread_ratio";
        assert_keys(&report["verify"]["kinds"], kind, rates);
    }
    assert_keys(&report, "seconds", "read analyse optimise write verify total");
    assert_eq!(report["method"]["chosen"], "overlap");
}

/// Asserts that the object at `at` has each of the keys.
fn assert_keys(parent: &Value, at: &str, keys: &str) {
    let object = at.parse::<usize>().map_or(&parent[at], |index| &parent[index]);
    for key in keys.split_whitespace() {
        assert!(object.get(key).is_some(), "{at}.{key} is missing in {object}");
    }
}

#[test]
fn reports_are_written_to_every_file_named() {
    let reports = TempDir::new().unwrap();
    let files = ["a.json", "b.json"].map(|name| reports.path().join(name));
    let [a, b] = files.each_ref().map(|file| file.to_str().unwrap());
    let (ran, _folder) = bake_heaps(&["--json", "--report", a, "--report", b]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    for file in &files {
        assert_eq!(fs::read_to_string(file).unwrap(), ran.stdout);
    }
}

#[test]
fn inspect_prints_text_or_json() {
    let scene = sample("overlapping");
    let text = raykiln(["inspect", scene.to_str().unwrap()]);
    assert_eq!((text.status, text.stderr.as_str()), (0, ""));
    assert!(text.stdout.contains("crate 0.0"), "the worst pairs are named:\n{}", text.stdout);
    let json = raykiln(["inspect", scene.to_str().unwrap(), "--json"]).json();
    assert_eq!(json["input"]["triangles"], 144);
    assert_eq!(json["before"]["instances"], 12);
    let pairs = json["worst_pairs"].as_array().expect("pairs");
    assert_eq!(pairs.len(), 10, "ten of the twelve overlapping pairs");
    let ratios: Vec<f64> = pairs.iter().map(|p| p["overlap_ratio"].as_f64().unwrap()).collect();
    assert!(ratios.is_sorted_by(|a, b| a >= b), "worst first: {ratios:?}");
    assert!((ratios[0] - 21.66 / 1181.04).abs() < 1e-6, "{ratios:?}");
}

#[test]
fn kept_names_are_pinned() {
    let (ran, _folder) = bake_heaps(&["--json", "--method", "single", "--keep", "crate 0.*", "--keep", "crate 1.0"]);
    let report = ran.json();
    assert_eq!(report["input"]["pinned_instances"], 4);
    assert_eq!(report["after"]["mesh_groups"], 5);
}

#[test]
fn auto_gives_its_reason_and_never_does_worse_than_the_input() {
    for sample in samples() {
        let folder = TempDir::new().unwrap();
        let report = crate::common::bake(&sample.scene, &folder.path().join("out.glb"), &[]);
        assert_eq!(report["method"]["requested"], "auto");
        assert!(!report["method"]["reason"].as_str().unwrap().is_empty());
        let candidates = report["method"]["candidates"].as_array().unwrap();
        let cost = |name: &Value| {
            let candidate = candidates.iter().find(|c| &c["name"] == name).expect("the candidate is listed");
            candidate["sampled_cost"].as_f64().unwrap()
        };
        let [after, before] = [&report["method"]["chosen_candidate"], &Value::from("keep")].map(cost);
        assert!(after <= before, "{}: {after} after {before}", sample.name);
    }
}

#[test]
fn an_existing_output_is_replaced_whole() {
    let (ran, folder) = bake_heaps(&["--method", "overlap"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let output = folder.path().join("out.glb");
    let first = fs::read(&output).unwrap();
    fs::write(&output, vec![0; 10 * first.len()]).unwrap();
    // With the same options, which the output records.
    let (input, to) = (sample("overlapping"), output.to_str().unwrap());
    let again = ["bake", input.to_str().unwrap(), "-o", to, "--rays", "500", "--repeats", "1", "--method", "overlap"];
    assert_eq!(raykiln(again).status, 0);
    assert_eq!(fs::read(&output).unwrap(), first);
    assert_eq!(folder_names(folder.path()), ["out.glb"]);
}

#[test]
fn a_buffer_file_of_something_else_is_not_replaced() {
    let folder = TempDir::new().unwrap();
    let [input, output] = [sample("overlapping"), folder.path().join("out.gltf")];
    let bake = |method| crate::common::bake(&input, &output, &["--method", method]);
    let uri = || crate::common::json_of(&output)["buffers"][0]["uri"].clone();
    let foreign = write(folder.path(), "out.bin", "of something else");

    // It makes no difference if a scene file is replaced that does not refer to the buffer file.
    for (there, method) in [(None, "single"), (None, "per-object"), (Some("no JSON"), "single"), (Some("{}"), "single")]
    {
        if let Some(text) = there {
            write(folder.path(), "out.gltf", text);
            fs::remove_file(folder.path().join("out_1.bin")).unwrap();
        }
        let warnings = bake(method)["warnings"].to_string();
        assert!(
            warnings.contains("out.bin is a file of something else; the buffer is written as out_1.bin"),
            "{warnings}"
        );
        assert_eq!(uri(), "out_1.bin");
        assert_eq!(fs::read_to_string(&foreign).unwrap(), "of something else");
        assert_eq!(folder_names(folder.path()), ["out.bin", "out.gltf", "out_1.bin"]);
    }
}

#[test]
fn the_buffer_file_of_the_scene_file_replaced_is_replaced() {
    let folder = TempDir::new().unwrap();
    let [input, output] = [sample("overlapping"), folder.path().join("out.gltf")];
    for method in ["single", "per-object"] {
        let report = crate::common::bake(&input, &output, &["--method", method]);
        assert_eq!(report["warnings"].as_array().map(Vec::len), Some(0), "{}", report["warnings"]);
        assert_eq!(folder_names(folder.path()), ["out.bin", "out.gltf"]);
    }
}

#[test]
fn completions_and_the_manual_page_are_printed() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let ran = raykiln(["completions", shell]);
        assert_eq!(ran.status, 0, "{}", ran.stderr);
        assert!(ran.stdout.contains("raykiln") && ran.stdout.contains("inspect"), "{shell}");
    }
    let page = raykiln(["man"]);
    assert_eq!(page.status, 0, "{}", page.stderr);
    assert!(page.stdout.starts_with(".ie") && page.stdout.contains(".TH raykiln 1"), "{}", page.stdout);
    for command in ["bake", "verify", "inspect", "lab", "devices"] {
        assert!(page.stdout.contains(&format!(".TH raykiln-{command} 1")), "{command}");
    }
}

#[test]
fn a_report_that_cannot_be_written_is_refused_before_any_output() {
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join("folder.json")).unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    let mut cases = vec![
        ("nowhere/report.json", "there is no folder"),
        ("folder.json", "is a folder"),
        ("file/report.json", "there is no folder"),
        ("report.txt", "only files with the extension .json or .html"),
    ];
    if cfg!(target_os = "linux") {
        cases.push(("/proc/report.json", "the folder /proc cannot be written to"));
    }
    for (name, words) in cases {
        let [good, bad] = ["good.json", name].map(|name| folder.path().join(name));
        let (ran, outputs) = bake_heaps(&["--report", good.to_str().unwrap(), "--report", bad.to_str().unwrap()]);
        assert_eq!((ran.status, ran.stdout.as_str()), (2, ""), "{name}");
        assert!(ran.stderr.contains(words) && ran.stderr.contains(name), "{}", ran.stderr);
        assert!(folder_names(outputs.path()).is_empty(), "{name}");
        assert_eq!(folder_names(folder.path()), ["file", "folder.json"], "{name}");
    }
}

#[cfg(unix)]
#[test]
fn a_report_replaces_no_scene() {
    let folder = TempDir::new().unwrap();
    let scene = sample("overlapping");
    let [link, output] = ["link.json", "out.glb"].map(|name| folder.path().join(name));
    std::os::unix::fs::symlink(&scene, &link).unwrap();
    let before = fs::read(&scene).unwrap();
    let [scene_text, link, output] = [&scene, &link, &output].map(|path| path.to_str().unwrap());
    for arguments in
        [&["bake", scene_text, "-o", output][..], &["inspect", scene_text], &["verify", output, scene_text]]
    {
        let ran = raykiln(arguments.iter().chain(&["--report", link]));
        assert_eq!(ran.status, 2, "{arguments:?}: {}", ran.stderr);
        assert!(ran.stderr.contains("is the scene itself"), "{}", ran.stderr);
        assert!(fs::read(&scene).unwrap() == before);
        assert_eq!(folder_names(folder.path()), ["link.json"]);
    }
}

#[test]
fn an_output_that_cannot_be_written_is_refused_in_plain_words() {
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join("folder.glb")).unwrap();
    let cases = [("nowhere/out.glb", "the folder does not exist"), ("folder.glb", "is a folder"), ("out.obj", "glb")];
    for (name, words) in cases {
        let output = folder.path().join(name);
        let ran = raykiln(["bake", sample("overlapping").to_str().unwrap(), "-o", output.to_str().unwrap()]);
        assert_eq!(ran.status, 2, "{name}");
        assert!(ran.stderr.contains(words), "{name}: {}", ran.stderr);
        assert_eq!(folder_names(folder.path()), ["folder.glb"]);
    }
}

#[test]
fn numbers_that_mean_nothing_are_refused_in_plain_words() {
    for (option, value, words) in [
        ("--threads", "0", "0 is not in 1..=512"),
        ("--threads", "-1", "-1 is not in 1..=512"),
        ("--threads", "513", "513 is not in 1..=512"),
        ("--threads", "99999999999999999999", "invalid"),
        ("--rays", "16777217", "16777217 is not in 0..=16777216"),
        ("--rays", "4294967295", "4294967295 is not in 0..=16777216"),
        ("--repeats", "1001", "1001 is not in 0..=1000"),
        ("--weights", "diffuse=1,diffuse=3", "`diffuse` is given twice"),
        ("--max-group-extent-ratio", "0", "must be a finite number above 0"),
        ("--max-group-extent-ratio", "NaN", "must be a finite number above 0"),
        ("--max-group-extent-ratio", "inf", "must be a finite number above 0"),
        ("--max-bytes-ratio", "0", "must be a finite number above 0"),
        ("--max-bytes-ratio", "inf", "must be a finite number above 0"),
        ("--entry-cost", "inf", "must be a finite number of at least 0"),
        ("--max-position-error-ratio", "nan", "must be a finite number of at least 0"),
    ] {
        let ran = raykiln(["bake", "in.glb", "-o", "out.glb", &format!("{option}={value}")]);
        assert_eq!(ran.status, 2, "{option} {value}");
        assert!(ran.stderr.contains(words), "{option} {value}: {}", ran.stderr);
    }
}

#[test]
fn patterns_that_match_nothing_are_told() {
    let keep = ["--method", "single", "--keep", "crate 0.*", "--keep", "crat 0.*", "--keep", "nomatch*"];
    let (ran, _folder) = bake_heaps(&keep);
    assert_eq!(ran.status, 0);
    for glob in ["crat 0.*", "nomatch*"] {
        let words = format!("warning: --keep: `{glob}` matches no node and no mesh of the default scene");
        assert!(ran.stderr.contains(&words), "{}", ran.stderr);
    }
    assert!(!ran.stderr.contains("`crate 0.*`"), "{}", ran.stderr);
    let (ran, _folder) = bake_heaps(&[&keep[..], &["--json"]].concat());
    assert_eq!(ran.json()["warnings"].as_array().map(Vec::len), Some(2));
}
