//! Experiments: tables, fits and rejected configurations.

use crate::common::schema::assert_conforms;
use crate::common::{bake, folder_names, raykiln, samples, write};
use raykiln::Weights;
use raykiln::verify::PerKind;
use raykiln::verify::rays::RayKind;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder with two samples, each in a folder of its own.
fn two_samples() -> TempDir {
    let folder = TempDir::new().unwrap();
    for sample in samples().into_iter().filter(|s| ["overlapping", "staggered"].contains(&s.name.as_str())) {
        fs::create_dir(folder.path().join(&sample.name)).unwrap();
        fs::copy(&sample.scene, folder.path().join(&sample.name).join("scene.glb")).unwrap();
    }
    folder
}

/// Runs a configuration in a folder.
fn lab(folder: &Path, config: &str, more: &[&str]) -> crate::common::Ran {
    let path = folder.join("lab.toml");
    fs::write(&path, config).unwrap();
    raykiln(["lab", path.to_str().unwrap()].iter().chain(more))
}

const CONFIG: &str =
    "scenes = ['*/*.glb']\nout = 'tables'\ndevice = 'cpu'\nrays = 64\ncounted_rays = 256\nrepeats = 3\n";
const FIT: &str = "[fit]\nclass = 'no-rt-cores'\n";

/// Whether a column holds measured times.
fn is_time(name: &str) -> bool {
    let measured = ["_picoseconds", "_speedup_ratio", "_spread_ratio"].iter().any(|end| name.ends_with(end));
    measured && !name.ends_with("_predicted_picoseconds")
}

/// The table in a folder: column names, and rows without measured times.
fn table(folder: &Path) -> (Vec<String>, Vec<Vec<String>>) {
    let mut reader = csv::Reader::from_path(folder.join("tables/layouts.csv")).expect("a table");
    let names: Vec<String> = reader.headers().expect("a header").iter().map(str::to_owned).collect();
    let timeless = |record: csv::StringRecord| {
        record.iter().zip(&names).filter(|(_, name)| !is_time(name)).map(|(value, _)| value.to_owned()).collect()
    };
    let rows = reader.records().map(|record| timeless(record.expect("sound"))).collect();
    (names, rows)
}

#[test]
fn two_scenes_give_tables_and_prices() {
    let folder = two_samples();
    let ran = lab(folder.path(), &format!("{CONFIG}{FIT}"), &[]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let tables = folder.path().join("tables");
    assert_eq!(folder_names(&tables), ["fit.json", "fit.md", "layouts.csv", "layouts.jsonl"]);
    assert_eq!(folder_names(folder.path()), ["lab.toml", "overlapping", "staggered", "tables"]);

    let (names, rows) = table(folder.path());
    for name in ["scene", "layout", "device_kind", "two_level_cost", "predicted_bytes", "shadow_blas_nodes"] {
        assert!(names.iter().any(|n| n == name), "{name} is not a column of {names:?}");
    }
    let lines = fs::read_to_string(tables.join("layouts.jsonl")).unwrap();
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(lines.len(), rows.len());
    for (line, row) in lines.iter().zip(&rows) {
        assert_eq!((line["scene"].as_str(), line["layout"].as_str()), (Some(row[0].as_str()), Some(row[1].as_str())));
        assert_eq!(line["device_kind"], "cpu");
        assert!(line["groups"].as_u64().unwrap() > 0 && line["failure"].is_null(), "{line}");
        assert!(line["predicted_bytes"].as_u64().unwrap() > 0 && line["two_level_cost"].as_f64().unwrap() > 0.0);
        for kind in RayKind::ALL.map(RayKind::name) {
            let of = &line["kinds"][kind];
            assert!(of["picoseconds"].as_f64().is_some_and(|t| t > 0.0), "{line}");
            assert!(
                ["tlas_nodes", "entries", "blas_nodes", "spread_ratio"].iter().all(|key| of[key].is_number()),
                "{line}"
            );
        }
    }
    let fit: Value = serde_json::from_slice(&fs::read(tables.join("fit.json")).unwrap()).expect("JSON");
    assert_eq!((&fit["schema"], &fit["class"]), (&"raykiln.fit/1".into(), &"no-rt-cores".into()));
    assert_conforms(&fit);
    assert_eq!(fit["layouts"], rows.len());
    for kind in fit["kinds"].as_array().expect("kinds") {
        let prices = kind["prices"].as_object().expect("prices");
        assert!(prices.len() == 4 && prices.values().all(|p| p.as_f64().is_some_and(|p| p >= 0.0)), "{kind}");
        assert!(kind["rms_relative_error"].is_number() && kind["left_out"]["picked_mean_ratio"].is_number(), "{kind}");
    }
    let text = fs::read_to_string(tables.join("fit.md")).unwrap();
    assert_eq!(text, ran.stdout);
    assert!(text.contains("Class::NoRtCores => [\n    prices(") && text.contains("say nothing of one"), "{text}");
}

#[test]
fn all_but_times_is_equal_in_every_run_and_for_any_number_of_threads() {
    let folder = two_samples();
    let runs: Vec<_> = ["1", "2", "5"]
        .map(|threads| {
            let ran = lab(folder.path(), CONFIG, &["--threads", threads, "--quiet"]);
            assert_eq!((ran.status, ran.stdout.as_str(), ran.stderr.as_str()), (0, "", ""));
            table(folder.path())
        })
        .into();
    assert_eq!(runs[0].0.iter().filter(|name| is_time(name)).count(), 12);
    assert!(runs[0].1.len() > 8 && runs.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn bad_configurations_and_scenes_leave_nothing() {
    let folder = two_samples();
    fs::write(folder.path().join("staggered/scene.glb"), "no scene").unwrap();
    for (config, words) in [
        (CONFIG.to_owned(), "staggered/scene.glb"),
        (format!("{CONFIG}effrt = 3\n"), "lab.toml:7: unknown field `effrt`"),
        (CONFIG.replace("'tables'", "'no/tables'"), "there is no folder"),
        (CONFIG.replace("'cpu'", "'no such device'"), "`device`: "),
        (CONFIG.replace("*/*.glb", "missing.glb"), "missing.glb"),
    ] {
        let ran = lab(folder.path(), &config, &[]);
        assert_eq!((ran.status, ran.stdout.as_str()), (2, ""), "{config}");
        assert!(ran.stderr.starts_with("error: ") && ran.stderr.contains(words), "{words}: {}", ran.stderr);
        assert_eq!(folder_names(folder.path()), ["lab.toml", "overlapping", "staggered"], "{config}");
    }
    let ran = raykiln(["lab", folder.path().join("missing.toml").to_str().unwrap()]);
    assert!(ran.status == 2 && ran.stderr.contains("missing.toml"), "{}", ran.stderr);
}

#[test]
fn broken_scenes_can_be_left_out_and_a_fit_to_too_little_says_so() {
    let folder = two_samples();
    fs::write(folder.path().join("staggered/scene.glb"), "no scene").unwrap();
    let ran = lab(folder.path(), &format!("{CONFIG}skip_broken = true\n"), &[]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(ran.stderr.contains("note: left out: ") && ran.stderr.contains("staggered/scene.glb"), "{}", ran.stderr);
    assert!(table(folder.path()).1.iter().all(|row| row[0] == "overlapping/scene.glb"));

    let ran = lab(folder.path(), &format!("{CONFIG}skip_broken = true\n{FIT}"), &[]);
    assert_eq!(ran.status, 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("prices cannot be fitted"), "{}", ran.stderr);
    assert_eq!(folder_names(&folder.path().join("tables")), ["layouts.csv", "layouts.jsonl"]);
}

/// The rows of the lab for a scene, by the names of all plans that come to each.
fn rows_by_plan(folder: &Path, scene: &Path) -> BTreeMap<String, Value> {
    let scenes = format!("scenes = ['{}']\n", scene.display());
    let config = "out = 'tables'\neffort = 3\ndevice = 'cpu'\nrays = 64\nrepeats = 1\n";
    let ran = lab(folder, &(scenes + config), &["--quiet"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let lines = fs::read_to_string(folder.join("tables/layouts.jsonl")).expect("a table");
    let rows = lines.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    let names = |row: &Value| {
        let more = row["same_as"].as_array().cloned().unwrap_or_default();
        let all = [row["layout"].clone()].into_iter().chain(more);
        all.map(|name| name.as_str().expect("a name").to_owned()).collect::<Vec<_>>()
    };
    rows.flat_map(|row| names(&row).into_iter().map(|name| (name, row.clone())).collect::<Vec<_>>()).collect()
}

/// Every candidate of a bake has the numbers of its row, bit for bit. The report has for the candidate that was written
/// the cost and the position error of what was read back; the others have those that were predicted.
fn assert_predictions_agree(scene: &Path, at_least: usize) {
    let folder = TempDir::new().expect("a temporary folder");
    let rows = rows_by_plan(folder.path(), scene);
    // The lab has no limit on bytes and does not look for copies.
    let options = ["--method", "auto", "--effort", "3", "--max-bytes-ratio", "1000", "--copies", "off"];
    let report = bake(scene, &folder.path().join("out.glb"), &options);
    let candidates = report["method"]["candidates"].as_array().expect("candidates");
    assert!(candidates.len() >= at_least, "{}: only {} candidates", scene.display(), candidates.len());
    for candidate in candidates {
        let name = candidate["name"].as_str().expect("a name");
        let row = rows.get(name).unwrap_or_else(|| panic!("{}: no row for `{name}`", scene.display()));
        let what = format!("{} `{name}`:\n{candidate}\n{row}", scene.display());
        let of_kind = |kind: RayKind| row["kinds"][kind.name()]["predicted_picoseconds"].as_f64().expect("a time");
        assert_eq!(candidate["sampled_cost"], Weights::default().mean(&PerKind::of(of_kind)), "{what}");
        assert_eq!(candidate["as_bytes"], row["predicted_bytes"], "{what}");
        if candidate["name"] != report["method"]["chosen_candidate"] {
            assert_eq!(candidate["predicted_cost"], row["two_level_cost"], "{what}");
            assert_eq!(candidate["position_error_ratio"], row["position_error_ratio"], "{what}");
        }
    }
}

#[test]
fn the_lab_predicts_what_a_bake_ranks_by() {
    for (name, at_least) in [("overlapping", 4), ("instanced", 3), ("scattered", 2)] {
        let sample = samples().into_iter().find(|sample| sample.name == name).expect("the sample is there");
        assert_predictions_agree(&sample.scene, at_least);
    }
}

/// Four heaps of three boxes each, ten thousand times as far from the origin as they are large: rays in single precision
/// miss them unless they are traced as seen from their middle.
fn heaps_far_away(folder: &Path) -> PathBuf {
    let faces = [[1, 2, 4, 3], [5, 7, 8, 6], [1, 5, 6, 2], [3, 4, 8, 7], [1, 3, 7, 5], [2, 6, 8, 4]];
    let mut text = String::new();
    for i in 0..12 {
        let low = [200_000 + 10 * (i / 3 % 2) + i % 3, i % 3, 10 * (i / 6) + i % 3];
        text += &format!("o box {i}\n");
        for corner in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|axis| low[axis] + 4 * (corner >> axis & 1));
            text += &format!("v {x} {y} {z}\n");
        }
        for face in faces {
            let [a, b, c, d] = face.map(|corner| 8 * i + corner);
            text += &format!("f {a} {b} {c} {d}\n");
        }
    }
    write(folder, "far.obj", text)
}

#[test]
fn scenes_far_from_the_origin_are_predicted_as_a_bake_does() {
    let folder = TempDir::new().expect("a temporary folder");
    let scene = heaps_far_away(folder.path());
    assert_predictions_agree(&scene, 3);
    let single = &rows_by_plan(folder.path(), &scene)["single"];
    assert!(single["kinds"]["primary"]["blas_nodes"].as_f64().is_some_and(|met| met > 1.0), "{single}");
}

/// The JSON lines and the CSV records of errors against time, which are the same rows.
fn error_rows(folder: &Path) -> Vec<Value> {
    let lines = fs::read_to_string(folder.join("tables/error-vs-time.jsonl")).expect("a table");
    let rows: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let mut reader = csv::Reader::from_path(folder.join("tables/error-vs-time.csv")).expect("a table");
    let names: Vec<String> = reader.headers().expect("a header").iter().map(str::to_owned).collect();
    let records: Vec<csv::StringRecord> = reader.records().map(|record| record.expect("sound")).collect();
    assert_eq!(records.len(), rows.len());
    for (record, row) in records.iter().zip(&rows) {
        for (value, name) in record.iter().zip(&names) {
            match &row[name] {
                Value::Number(number) => assert_eq!(value.parse().ok(), number.as_f64(), "{name}"),
                Value::String(word) => assert_eq!(value, word, "{name}"),
                other => assert!(other.is_null(), "{name}: {other}"),
            }
        }
    }
    rows
}

const ERRORS: &str = "scenes = ['*/*.glb']\nout = 'tables'\ndevice = 'cpu'\nrays = 64\nrepeats = 1\neffort = 0\n\
                      methods = ['keep', 'cluster', 'auto']\n[error-vs-time]\nerror_rays = 128\n";

#[test]
fn errors_are_set_against_time_for_each_method_setting_place_and_tracer() {
    let folder = two_samples();
    fs::remove_dir_all(folder.path().join("staggered")).unwrap();
    let sweep = "generated = ['torus']\nplacements = ['as-is', 'far', 'stretched']\nentry_cost = [2, 80.5]\n\
                 tracers = ['f32-fast', 'f32-watertight', 'f32-recentred', 'f64']\n";
    let ran = lab(folder.path(), &format!("{ERRORS}{sweep}"), &[]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let rows = error_rows(folder.path());
    // Two scenes, three places, four tracers; `cluster` with two entry costs, the others with none.
    assert_eq!(rows.len(), 2 * 3 * 4 * (1 + 2 + 1));
    for row in &rows {
        let number = |name: &str| row[name].as_f64().unwrap_or_else(|| panic!("{name}: {row}"));
        assert_eq!(row["settings"]["entry_cost"].is_null(), row["method"] != "cluster", "{row}");
        assert!(number("nanoseconds_per_ray") > 0.0 && number("two_level_cost") > 0.0, "{row}");
        assert!(number("cost_over_best_ratio") >= 1.0 && number("layout_seconds") > 0.0, "{row}");
        assert!(number("largest_distance_error") >= number("p999_distance_error"), "{row}");
        assert!(number("position_error_ratio") <= 1e-6 && number("rms_distance_error") >= 0.0, "{row}");
        let is_near = row["placement"] == "as-is";
        assert!(!is_near || number("p999_distance_error") < 1e-3, "{row}");
    }
    let exact = rows.iter().filter(|row| row["tracer"] == "f64" && row["scene"] == "torus" && row["method"] == "keep");
    assert!(exact.clone().count() == 3 && exact.into_iter().all(|row| row["lost_per_million"] == 0.0));
    let names = folder_names(&folder.path().join("tables"));
    for name in ["torus-far", "overlapping-scene.glb-stretched", "precision-torus", "precision-overlapping-scene.glb"] {
        for end in ["svg", "png"] {
            assert!(names.contains(&format!("{name}.{end}")), "{name}.{end}: {names:?}");
        }
    }
}

#[test]
fn rows_written_before_a_failure_stay() {
    let folder = two_samples();
    fs::write(folder.path().join("staggered/scene.glb"), "no scene").unwrap();
    let ran = lab(folder.path(), ERRORS, &[]);
    assert_eq!(ran.status, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("staggered/scene.glb"), "{}", ran.stderr);
    let rows = error_rows(folder.path());
    assert!(rows.len() == 3 && rows.iter().all(|row| row["scene"] == "overlapping/scene.glb"), "{rows:?}");
}
