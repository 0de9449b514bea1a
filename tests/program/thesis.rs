//! `lab thesis`, actions and conversions, as a user runs them.

use crate::common::{folder_names, raykiln};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

fn samples() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("samples").display().to_string()
}

#[test]
fn the_thesis_is_repeated_quickly_on_the_samples() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out").display().to_string();
    let ran = raykiln(["lab", "thesis", "--quick", "--device", "cpu", "--scenes", &samples(), "--out", &out]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert_eq!(folder_names(Path::new(&out)), ["figures", "runs.csv", "runs.jsonl", "thesis.html", "thesis.md"]);
    let text = fs::read_to_string(Path::new(&out).join("thesis.md")).unwrap();
    for words in [
        "Table 5.1",
        "Table 5.2",
        "Table 5.3",
        "over 3 frames; the TLAS is rebuilt every 2 frames",
        "not at hand",
        "a sample in place of",
        "do not predict GPU speed",
    ] {
        assert!(text.contains(words), "{words}");
    }
    let page = fs::read_to_string(Path::new(&out).join("thesis.html")).unwrap();
    assert!(page.matches("<svg").count() >= 8 && page.matches("<img").count() == 6);
    let rows = fs::read_to_string(Path::new(&out).join("runs.csv")).unwrap().lines().count();
    // Twenty trials without instances; six methods with two numbers of them, and two with most.
    assert_eq!(rows, 1 + 3 * (20 + 6 * 2 + 2));
    for figure in folder_names(&Path::new(&out).join("figures")) {
        assert!(text.contains(&figure) || figure.ends_with(".png"), "{figure} is on the page");
    }
    assert_redrawn(Path::new(&out), folder.path());
}

/// Asserts that the page and the charts of a run come from its rows and pictures alone.
fn assert_redrawn(out: &Path, folder: &Path) {
    let again = folder.join("again");
    fs::create_dir_all(again.join("figures")).unwrap();
    fs::copy(out.join("runs.jsonl"), again.join("runs.jsonl")).unwrap();
    let figures = folder_names(&out.join("figures"));
    for picture in figures.iter().filter(|name| name.starts_with("figure-5-2") || name.starts_with("figure-5-6")) {
        fs::copy(out.join("figures").join(picture), again.join("figures").join(picture)).unwrap();
    }
    let ran = raykiln(["lab", "thesis", "--redraw", "--out", &again.display().to_string()]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert_eq!(folder_names(&again.join("figures")), figures);
    let charts = figures.iter().filter(|name| name.ends_with(".svg")).map(|name| format!("figures/{name}"));
    for file in charts.chain(["thesis.md".into(), "thesis.html".into()]) {
        assert!(fs::read(again.join(&file)).unwrap() == fs::read(out.join(&file)).unwrap(), "{file} is the same");
    }
}

#[test]
fn what_cannot_be_redrawn_is_refused() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().display().to_string();
    let redrawn = || raykiln(["lab", "thesis", "--redraw", "--out", &out]);
    let nothing = redrawn();
    assert!(nothing.status == 2 && nothing.stderr.contains("there are no rows to draw"), "{}", nothing.stderr);
    scene_with_model(folder.path());
    let run = r#"{ "out": ".", "actions": [ { "type": "run", "scenes": ["room.scn"], "envs": ["one.env"], "passes": 1,
        "device": "cpu" } ] }"#;
    fs::write(folder.path().join("a.json"), run).unwrap();
    assert_eq!(raykiln(["lab", &folder.path().join("a.json").display().to_string()]).status, 0);
    let other = redrawn();
    let words = "runs.jsonl: `one` is not a run of the thesis's experiments";
    assert!(other.status == 2 && other.stderr.contains(words), "{}", other.stderr);
    let both = raykiln(["lab", "thesis", "--redraw", "--out", &out, "--scenes", &samples()]);
    assert!(both.status == 2 && both.stderr.contains("--scenes"), "{}", both.stderr);
    assert_eq!(raykiln(["lab", "thesis", "--out", &out]).status, 2);
}

#[test]
fn actions_run_and_plot_and_go_on_where_they_stopped() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::copy(Path::new(&samples()).join("overlapping/scene.glb"), at("scene.glb")).unwrap();
    fs::write(at("a.scn"), "SCENE_NAME=first\nMODEL_FILE_NAME=scene.glb\n").unwrap();
    fs::write(at("single.env"), "ENVIRONMENT_NAME=one\nSINGLE_GAS=1\nWIDTH=8\nHEIGHT=6\nHEATSCALE=20\n").unwrap();
    fs::write(
        at("sweep.toml"),
        "[[env]]\nenvironment_name = 'many'\nwidth = 8\nheight = 6\nsom_threshold = [0.2, 0.8]\n",
    )
    .unwrap();
    let actions = r#"{ "actions": [
        { "type": "run", "scenes": ["a.scn"], "envs": ["single.env", "sweep.toml"], "passes": 1, "device": "cpu",
          "pictures": ["heatmap"] },
        { "type": "plot", "plot_type": "bar", "plot_metadata": { "title": "Speeds", "output": "speeds",
          "value_data": "all_mrays_per_s", "x_data": "environment", "series_data": "som_threshold" } } ] }"#;
    fs::write(at("actions.json"), actions).unwrap();
    let file = at("actions.json").display().to_string();
    let ran = raykiln(["lab", &file]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let out = at("actions-results");
    let pictures = [
        "first-many-som_threshold-0.2-heatmap.png",
        "first-many-som_threshold-0.8-heatmap.png",
        "first-one-heatmap.png",
    ];
    let expected = [&pictures[..], &["runs.csv", "runs.jsonl", "speeds.png", "speeds.svg"]].concat();
    assert_eq!(folder_names(&out), expected);

    let lines = fs::read_to_string(out.join("runs.jsonl")).unwrap();
    let first_two: String = lines.split_inclusive('\n').take(2).collect();
    fs::write(out.join("runs.jsonl"), format!("{first_two}{{\"id\":")).unwrap();
    let ran = raykiln(["lab", &file, "--resume"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let resumed = fs::read_to_string(out.join("runs.jsonl")).unwrap();
    assert!(resumed.starts_with(&first_two) && resumed.lines().count() == 3, "{resumed}");
}

#[test]
#[cfg(unix)]
fn an_interrupted_run_keeps_its_rows_and_goes_on() {
    use std::process::Command;
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    scene_with_model(folder.path());
    let thresholds: Vec<String> = (1..=30).map(|i| (0.03 * f64::from(i)).to_string()).collect();
    fs::write(
        at("sweep.toml"),
        format!("[[env]]\nwidth = 8\nheight = 6\nsom_threshold = [{}]\n", thresholds.join(", ")),
    )
    .unwrap();
    let run = r#"{ "actions": [ { "type": "run", "scenes": ["room.scn"], "envs": ["sweep.toml"], "seconds": 0.1,
        "device": "cpu" } ] }"#;
    fs::write(at("a.json"), run).unwrap();
    let (file, table) = (at("a.json"), at("a-results/runs.jsonl"));
    let rows = || fs::read_to_string(&table).unwrap_or_default();
    let mut child = Command::new(env!("CARGO_BIN_EXE_raykiln")).arg("lab").arg(&file).spawn().unwrap();
    while rows().lines().count() < 2 && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(!child.wait().unwrap().success(), "it is interrupted");
    let kept = rows();
    assert!((2..30).contains(&kept.lines().count()) && kept.ends_with('\n'), "{kept}");
    let ran = raykiln(["lab", &file.display().to_string(), "--resume"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(rows().starts_with(&kept) && rows().lines().count() == 30, "what was measured is not measured again");
}

/// A scene whose model stands in a folder of its own, with a model of instances.
fn scene_with_model(folder: &Path) {
    fs::create_dir(folder.join("models")).unwrap();
    fs::copy(Path::new(&samples()).join("overlapping/scene.glb"), folder.join("models/scene.glb")).unwrap();
    fs::write(folder.join("models/small.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let text = "SCENE_NAME=first\nMODEL_FILE_NAME=models/scene.glb\nINSTANCE_FILE_NAME=models/small.obj\n";
    fs::write(folder.join("room.scn"), text).unwrap();
    fs::write(folder.join("one.env"), "ENVIRONMENT_NAME=one\nSINGLE_GAS=1\nWIDTH=8\nHEIGHT=6\n").unwrap();
}

const GENERATE: &str = r#"{ "type": "generate", "scenes": ["room.scn", "room.scn"], "params": { "model_mask": [1],
    "n_all": [3, 20], "n_anim_all": [3, 5], "v": 1.0, "v_dev": 0.1, "d": 2, "d_dev": 0 } }"#;

#[test]
fn generated_scenes_feed_runs_and_plots() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    scene_with_model(folder.path());
    let actions = format!(
        r#"{{ "actions": [ {GENERATE},
        {{ "type": "run", "scenes": ["room_3.scn", "room_20_5.scn"], "envs": ["one.env"], "passes": 1, "device": "cpu",
          "pictures": ["shaded"] }},
        {{ "type": "plot", "plot_type": "line", "plot_metadata": {{ "title": "Instances", "output": "instances",
          "value_data": "instances", "x_data": "added_instances" }} }} ] }}"#
    );
    fs::write(at("actions.json"), actions).unwrap();
    let ran = raykiln(["lab", &at("actions.json").display().to_string()]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(ran.stdout.starts_with("2 scenes, 2 runs and 4 pictures in "), "{}", ran.stdout);
    let out = at("actions-results");
    let pictures = ["first_20_5-one-shaded.png", "first_3-one-shaded.png"];
    let written = ["instances.png", "instances.svg", "room_20_5.scn", "room_3.scn", "runs.csv", "runs.jsonl"];
    assert_eq!(folder_names(&out), [&pictures[..], &written].concat());
    let rows = fs::read_to_string(out.join("runs.jsonl")).unwrap();
    let rows: Vec<serde_json::Value> = rows.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |row: &serde_json::Value| (row["scene"].clone(), row["added_instances"].clone(), row["failure"].clone());
    let expected = |name: &str, instances: u64| (name.into(), instances.into(), serde_json::Value::Null);
    assert_eq!(rows.iter().map(of).collect::<Vec<_>>(), [expected("first_3", 3), expected("first_20_5", 20)]);
}

#[test]
fn generated_files_are_used_from_where_they_are_and_are_the_same_each_time() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    scene_with_model(folder.path());
    fs::write(at("a.json"), format!(r#"{{ "out": "made", "actions": [ {GENERATE} ] }}"#)).unwrap();
    let toml = "out = 'again'\n[[scene]]\nscene_name = 'first'\nmodel_file_name = 'models/scene.glb'\n\
                instance_file_name = 'models/small.obj'\n[[actions]]\ntype = 'generate'\nscenes = ['first']\n\
                params = { model_mask = [0], n_all = [20], n_anim_all = [5], v = 1, v_dev = 0.1, d = 2, d_dev = 0 }\n";
    fs::write(at("b.toml"), toml).unwrap();
    for file in ["a.json", "b.toml"] {
        let ran = raykiln(["lab", &at(file).display().to_string()]);
        assert_eq!(ran.status, 0, "{}", ran.stderr);
    }
    let text = fs::read_to_string(at("made/room_20_5.scn")).unwrap();
    assert_eq!(text, fs::read_to_string(at("again/first_20_5.scn")).unwrap());
    let numbers = |count| text.lines().filter(|line| line.split(' ').count() == count).count();
    assert_eq!((numbers(3), numbers(7)), (20, 5));
    assert!(text.contains("MODEL_FILE_NAME=../models/scene.glb\n"), "{text}");
    let run = r#"{ "actions": [ { "type": "run", "scenes": ["made/room_3.scn"], "envs": ["one.env"], "passes": 1,
        "device": "cpu" } ] }"#;
    fs::write(at("c.json"), run).unwrap();
    let ran = raykiln(["lab", &at("c.json").display().to_string()]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
}

#[test]
fn wrong_parameters_are_refused_before_anything_is_written() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    scene_with_model(folder.path());
    fs::write(at("bare.scn"), "\nMODEL_FILE_NAME=models/scene.glb\n").unwrap();
    for (text, words) in [
        (GENERATE.replace("\"v\": 1.0, ", ""), "a.json:2: `v` is missing: 3 instances are animated"),
        (GENERATE.replace("[1]", "[2]"), "a.json:2: `model_mask` has 2"),
        (GENERATE.replace("[1]", "[0, 1]"), "a.json:2: `room_3.scn` would be written twice"),
        (GENERATE.replace("\"d_dev\"", "\"d_def\""), "unknown field `d_def`"),
        (
            GENERATE.replace("\"room.scn\", ", "\"bare.scn\", ").replace("[1]", "[0]"),
            "bare.scn:1: `INSTANCE_FILE_NAME` is missing",
        ),
        (GENERATE.replace("room.scn", "no.scn"), "no.scn: "),
    ] {
        fs::write(at("a.json"), format!("{{ \"actions\": [\n{text} ] }}")).unwrap();
        let ran = raykiln(["lab", &at("a.json").display().to_string()]);
        assert!(ran.status == 2 && ran.stderr.contains(words), "{words}: {}", ran.stderr);
        assert!(!at("a-results").exists());
    }
}

#[test]
fn actions_that_are_wrong_are_refused_before_anything_is_measured() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.scn"), "SCENE_NAME=x\nMODEL_FILE=scene.glb\n").unwrap();
    fs::write(at("good.scn"), "MODEL_FILE_NAME=scene.glb\n").unwrap();
    for (name, text, words) in [
        ("a.json", "{ \"actions\": [\n{ \"type\": \"fly\" } ] }", "a.json:2: unknown variant `fly`"),
        (
            "b.json",
            "{ \"actions\": [\n{ \"type\": \"run\", \"scenes\": [], \"envs\": [] } ] }",
            "b.json:2: the list of scenes is empty",
        ),
        (
            "c.json",
            "{ \"actions\": [\n\n{ \"type\": \"run\", \"scenes\": [\"good.scn\"], \"envs\": [\"b.env\"] } ] }",
            "b.env: ",
        ),
        (
            "d.toml",
            "[[env]]\nenvironment_name = 'e'\n[[actions]]\ntype = 'run'\nenvs = ['e']\nscenes = ['a.scn']\n",
            "a.scn:2: there is no key `MODEL_FILE`",
        ),
        ("e.toml", "actions = []\n[[env]]\nsom_treshold = 1\n", "e.toml:3: unknown key `som_treshold` in `env`"),
        (
            "f.toml",
            "[[actions]]\ntype = 'run'\nenvs = ['e']\nscenes = ['s']\nspeed = 3\n",
            "f.toml:1: unknown field `speed`",
        ),
    ] {
        fs::write(at(name), text).unwrap();
        let ran = raykiln(["lab", &at(name).display().to_string()]);
        assert_eq!(ran.status, 2, "{}", ran.stderr);
        assert!(ran.stderr.contains(words), "{name}: {}", ran.stderr);
    }
    let left: Vec<String> = folder_names(folder.path()).into_iter().filter(|name| name.contains("results")).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn files_are_converted_and_lost_comments_are_counted() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    fs::write(at("a.env"), "# fast\nBUILD_FLAGS=6\n").unwrap();
    let ran = raykiln(["lab", "convert", &at("a.env"), "-o", &at("a.toml")]);
    assert!(ran.status == 0 && ran.stderr.contains("1 comment is not carried over"), "{}", ran.stderr);
    let ran = raykiln(["lab", "convert", &at("a.toml"), "-o", &at("b.env")]);
    assert_eq!((ran.status, fs::read_to_string(at("b.env")).unwrap().as_str()), (0, "BUILD_FLAGS=6\n"));
    let ran = raykiln(["lab", "convert", &at("a.env"), "-o", &at("b.scn")]);
    assert_eq!(ran.status, 2, "{}", ran.stderr);
}

#[test]
fn a_scene_that_cannot_be_read_is_a_row_and_the_others_are_measured() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    scene_with_model(folder.path());
    fs::write(at("models/broken.glb"), "no scene").unwrap();
    fs::write(at("broken.scn"), "SCENE_NAME=broken\nMODEL_FILE_NAME=models/broken.glb\n").unwrap();
    let run = r#"{ "actions": [ { "type": "run", "scenes": ["broken.scn", "room.scn"], "envs": ["one.env"], "passes": 1,
        "device": "cpu" } ] }"#;
    fs::write(at("a.json"), run).unwrap();
    let rows = || {
        let text = fs::read_to_string(at("a-results/runs.jsonl")).unwrap();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<serde_json::Value>>()
    };
    let file = at("a.json").display().to_string();
    let ran = raykiln(["lab", &file]);
    assert_eq!(ran.status, 1, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("error: one on broken: ") && ran.stderr.contains("models/broken.glb"),
        "{}",
        ran.stderr
    );
    let [broken, sound] = &rows()[..] else { panic!("two rows") };
    assert!(broken["scene"] == "broken" && broken["environment"] == "one", "{broken}");
    assert!(broken["failure"].as_str().is_some_and(|why| why.contains("models/broken.glb")), "{broken}");
    assert!(sound["scene"] == "first" && sound["failure"].is_null() && sound["all_mrays_per_s"].as_f64() > Some(0.0));

    fs::copy(at("models/scene.glb"), at("models/broken.glb")).unwrap();
    let ran = raykiln(["lab", &file, "--resume"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let again = rows();
    assert!(again.len() == 2 && again[0] == *sound && again[1]["scene"] == "broken", "what failed is tried again");
}

#[test]
fn keys_of_light_and_heat_change_the_pictures() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    scene_with_model(folder.path());
    let light = "LIGHT_ORIGIN=0 9 0\nLIGHT_SIZE=1\nLIGHT_POWER=0.5\n";
    let scene = |name: &str, light: &str| {
        fs::write(at(&format!("{name}.scn")), format!("SCENE_NAME={name}\nMODEL_FILE_NAME=models/scene.glb\n{light}"))
            .unwrap();
    };
    scene("base", light);
    scene("moved", &light.replace("0 9 0", "8 9 8"));
    scene("large", &light.replace("SIZE=1", "SIZE=8"));
    scene("bright", &light.replace("0.5", "2"));
    for scale in [4, 40] {
        let text = format!(
            "ENVIRONMENT_NAME=heat{scale}\nSINGLE_GAS=1\nWIDTH=24\nHEIGHT=16\nPIXEL_SAMPLES=4\nHEATSCALE={scale}\n"
        );
        fs::write(at(&format!("heat{scale}.env")), text).unwrap();
    }
    let run = r#"{ "out": "out", "actions": [ { "type": "run", "scenes": ["base.scn", "moved.scn", "large.scn", "bright.scn"],
        "envs": ["heat4.env", "heat40.env"], "passes": 1, "device": "cpu", "pictures": ["shaded", "heatmap"] } ] }"#;
    fs::write(at("a.json"), run).unwrap();
    let ran = raykiln(["lab", &at("a.json").display().to_string()]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let picture = |name: &str| fs::read(at("out").join(name)).unwrap();
    let base = picture("base-heat4-shaded.png");
    for name in ["moved", "large", "bright"] {
        assert_ne!(picture(&format!("{name}-heat4-shaded.png")), base, "{name}");
    }
    assert_eq!(picture("base-heat40-shaded.png"), base, "the heat scale is that of heat maps only");
    assert_eq!(picture("moved-heat4-heatmap.png"), picture("base-heat4-heatmap.png"), "light costs nothing there");
    assert_ne!(picture("base-heat40-heatmap.png"), picture("base-heat4-heatmap.png"));
}

#[test]
#[cfg(feature = "vulkan")]
fn build_flags_and_the_rebuild_interval_take_effect_on_a_device() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    scene_with_model(folder.path());
    for (flags, interval) in [(0, 1), (2, 2), (5, 0)] {
        let text = format!(
            "ENVIRONMENT_NAME=e{flags}\nWIDTH=8\nHEIGHT=6\nBUILD_FLAGS={flags}\nSCENE_REBUILD_INTERVAL={interval}\n"
        );
        fs::write(at(&format!("{flags}.env")), text).unwrap();
    }
    let run = format!(
        r#"{{ "actions": [ {GENERATE}, {{ "type": "run", "scenes": ["room_3.scn"], "envs": ["0.env", "2.env", "5.env"],
        "passes": 1, "frames": 5, "device": "llvmpipe" }} ] }}"#
    );
    fs::write(at("a.json"), run).unwrap();
    let ran = raykiln(["lab", &at("a.json").display().to_string()]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let text = fs::read_to_string(at("a-results/runs.jsonl")).unwrap();
    let rows: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let motion = |row: &serde_json::Value| ["frames", "rebuilds", "wrong_hits"].map(|key| row["motion"][key].as_u64());
    let expected = [[Some(5), Some(5), Some(0)], [Some(5), Some(3), Some(0)], [Some(5), Some(1), Some(0)]];
    assert_eq!(rows.iter().map(motion).collect::<Vec<_>>(), expected);
    let of = |key: &str| rows.iter().map(|row| row[key].as_u64().expect("a number")).collect::<Vec<_>>();
    assert_eq!(of("build_flags"), [0, 2, 5]);
    let bytes = of("blas_bytes");
    // Software drivers need not have anything to compact.
    assert!(bytes[1] <= bytes[0], "compaction costs no bytes: {bytes:?}");
}
