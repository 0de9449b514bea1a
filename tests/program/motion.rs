//! The lab's experiment `motion`: tables of frames, their columns, and rejected configurations.

use crate::common::{folder_names, raykiln, samples};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const CONFIG: &str = "scenes = ['overlapping.glb']\nmethods = ['single']\nout = 'out'\ndevice = 'cpu'\nrays = 48\n\
                      counted_rays = 24\n[motion]\nmodel = 'scattered.glb'\ninstances = [3, 20]\nsize_ratio = 0.2\n\
                      frames = 5\ncounted_every = 3\nrebuild_every = [1, 2, 'never']\n";

/// A folder with two samples.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    for sample in samples().into_iter().filter(|s| ["overlapping", "scattered", "animated"].contains(&s.name.as_str()))
    {
        fs::copy(&sample.scene, folder.path().join(format!("{}.glb", sample.name))).unwrap();
    }
    folder
}

fn lab(folder: &Path, config: &str, more: &[&str]) -> crate::common::Ran {
    let path = folder.join("lab.toml");
    fs::write(&path, config).unwrap();
    raykiln(["lab", path.to_str().unwrap()].iter().chain(more))
}

/// The rows of `frames.jsonl`.
fn rows(folder: &Path) -> Vec<Value> {
    let text = fs::read_to_string(folder.join("out/frames.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

/// A row without what is measured.
fn counted(row: &Value) -> Value {
    let mut row = row.clone();
    let measured = |key: &str| key.ends_with("_ms") || key.starts_with("mrays") || key.starts_with("speed");
    row["kinds"].as_object_mut().unwrap().values_mut().for_each(|kind| {
        kind.as_object_mut().unwrap().retain(|key, _| !measured(key));
    });
    row.as_object_mut().unwrap().retain(|key, _| !measured(key));
    row
}

#[test]
fn each_frame_of_each_policy_has_a_row_and_each_policy_a_summary() {
    let folder = folder();
    let ran = lab(folder.path(), &CONFIG.replace("size_ratio", "alone = true\nsize_ratio"), &[]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let out = folder.path().join("out");
    assert_eq!(folder_names(&out), ["frames.csv", "frames.jsonl", "motion.jsonl", "motion.md"]);
    let rows = rows(folder.path());
    assert_eq!(rows.len(), 2 * 2 * 5 * 3, "layouts, numbers of instances, frames, policies");
    for row in &rows {
        let (frame, every) = (row["frame"].as_u64().unwrap(), &row["rebuild_every"]);
        let is_rebuilt = frame == 0 || every == 1 || every == 2 && frame % 2 == 0;
        assert_eq!((row["refit_ms"].is_null(), row["rebuild_ms"].is_null()), (is_rebuilt, !is_rebuilt), "{row}");
        assert_eq!(row["work_over_fresh_ratio"].is_number(), [0, 3, 4].contains(&frame), "{row}");
        assert!(every != 1 || !row["work_over_fresh_ratio"].is_number() || row["work_over_fresh_ratio"] == 1.0);
        assert!(row["tlas_bytes"].as_u64() > Some(0) && row["device_bytes"].is_null());
    }
    let mut csv = csv::Reader::from_path(out.join("frames.csv")).expect("a table");
    let names: Vec<String> = csv.headers().expect("a header").iter().map(str::to_owned).collect();
    assert_eq!(
        csv.records().filter(|record| record.as_ref().is_ok_and(|r| r.len() == names.len())).count(),
        rows.len()
    );
    for name in ["matrices_ms", "upload_ms", "refit_ms", "rebuild_ms", "shadow_trace_ms", "random_fresh_entries"] {
        assert!(names.iter().any(|n| n == name), "{name} is not a column of {names:?}");
    }
    let docs = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/lab.md")).unwrap();
    let undocumented = names.iter().filter(|name| !name.contains("fresh_")).filter(|name| {
        let of_kind = name.split_once('_').map_or(String::new(), |(_, rest)| format!("`KIND_{rest}`"));
        !docs.contains(&format!("`{name}`")) && !docs.contains(&of_kind)
    });
    assert_eq!(undocumented.collect::<Vec<_>>(), Vec::<&String>::new());
    let summary = fs::read_to_string(out.join("motion.jsonl")).unwrap();
    let summary: Vec<Value> = summary.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(summary.len(), 2 * 2 * 3);
    for of_policy in &summary {
        assert_eq!((&of_policy["hits"]["rays"], &of_policy["hits"]["wrong"]), (&192.into(), &0.into()), "{of_policy}");
    }
    assert!(summary.iter().any(|s| s["layout"] == "instances only" && s["hits"]["hits"].as_u64() > Some(0)));
    assert_eq!(fs::read_to_string(out.join("motion.md")).unwrap(), ran.stdout);
    assert!(ran.stdout.contains("say nothing of one"), "{}", ran.stdout);
}

#[test]
fn counts_are_equal_in_every_run_and_for_any_number_of_threads() {
    let folder = folder();
    let run = |threads: &str| {
        let ran = lab(folder.path(), CONFIG, &["--threads", threads, "--quiet"]);
        assert_eq!((ran.status, ran.stdout.as_str(), ran.stderr.as_str()), (0, "", ""));
        rows(folder.path()).iter().map(counted).collect::<Vec<_>>()
    };
    let one = run("1");
    assert_eq!(one.len(), 30);
    assert_eq!(run("3"), one);
    let other = lab(folder.path(), &CONFIG.replace("[motion]", "seed = 2\n[motion]"), &["--quiet"]);
    assert_eq!(other.status, 0, "{}", other.stderr);
    assert_ne!(rows(folder.path()).iter().map(counted).collect::<Vec<_>>(), one);
}

#[test]
#[cfg(feature = "vulkan")]
fn a_device_traces_the_same_frames_within_constant_memory() {
    let folder = folder();
    let config = CONFIG.replace("'cpu'", "'llvmpipe'").replace("[3, 20]", "[20]");
    let ran = lab(folder.path(), &config, &["--quiet"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let rows = rows(folder.path());
    assert_eq!(rows.len(), 15);
    assert!(rows.iter().all(|row| row["device_kind"] == "software driver" && row["trace_ms"].as_f64() > Some(0.0)));
    assert!(rows[0]["device_bytes"].as_u64() > Some(0));
    assert!(rows.iter().all(|row| row["device_bytes"] == rows[0]["device_bytes"]));
}

#[test]
fn the_animation_of_a_file_plays_in_each_layout() {
    let folder = folder();
    let config = "scenes = ['animated.glb']\nout = 'out'\ndevice = 'cpu'\nrays = 200\ncounted_rays = 200\nmethods = ['keep', \
                  'single', 'cluster']\n[motion]\nframes = 9\nframes_per_second = 3\ncounted_every = 1\n\
                  rebuild_every = [1, 'never']\n";
    let ran = lab(folder.path(), config, &["--quiet"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let rows = rows(folder.path());
    let layouts: std::collections::BTreeSet<&str> = rows.iter().filter_map(|row| row["layout"].as_str()).collect();
    assert!(layouts.contains("keep") && rows.len() == layouts.len() * 9 * 2, "{layouts:?}, {} rows", rows.len());
    let work = |row: &Value| row["kinds"]["random"]["steps"]["tlas_nodes"].as_f64();
    for layout in layouts {
        let of_layout: Vec<&Value> =
            rows.iter().filter(|row| row["layout"] == layout && row["rebuild_every"] == "never").collect();
        assert!(of_layout.iter().any(|row| work(row) != work(of_layout[0])), "{layout}: nothing moves");
    }
}

#[test]
#[cfg(feature = "vulkan")]
fn each_layout_is_built_with_each_set_of_flags() {
    let folder = folder();
    let config = "scenes = ['overlapping.glb']\nout = 'out'\ndevice = 'llvmpipe'\nrays = 64\nrepeats = 1\n[flags]\n";
    let ran = lab(folder.path(), config, &[]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let text = fs::read_to_string(folder.path().join("out/flags.jsonl")).unwrap();
    let rows: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(rows.len(), 2 * 3 * 2 * 2);
    let sets: std::collections::BTreeSet<String> = rows
        .iter()
        .map(|row| {
            assert!(
                row["blas_build_ms"].as_f64() > Some(0.0)
                    && row["kinds"]["primary"]["mrays_per_s"].as_f64() > Some(0.0)
            );
            assert_eq!(row["blas_bytes_compacted"].is_number(), row["compact"] == true, "{row}");
            ["layout", "prefer", "allow_update", "compact"].map(|key| row[key].to_string()).join(" ")
        })
        .collect();
    assert_eq!(sets.len(), 24);
    assert_eq!(csv::Reader::from_path(folder.path().join("out/flags.csv")).expect("a table").records().count(), 24);
    assert!(ran.stdout.starts_with("# Layouts against build flags on llvmpipe"), "{}", ran.stdout);
    let on_cpu = lab(folder.path(), &config.replace("llvmpipe", "cpu"), &[]);
    assert!(on_cpu.status == 2 && on_cpu.stderr.contains("no Vulkan device"), "{}", on_cpu.stderr);
    let wrong = lab(folder.path(), &format!("{config}prefer = ['fast']\n"), &[]);
    assert!(wrong.stderr.contains("lab.toml:7: `prefer`: there is no `fast`"), "{}", wrong.stderr);
}

#[test]
fn bad_configurations_are_refused_with_their_line_and_leave_nothing() {
    let folder = folder();
    for (from, to, words) in [
        ("[3, 20]", "[]", "lab.toml:9: `instances` lists no number"),
        ("[3, 20]", "[99999999]", "lab.toml:9: `instances` is 99999999, not between 0 and 16777216"),
        ("size_ratio = 0.2", "size_ratio = -1", "lab.toml:10: `size_ratio` is a number of at least 0"),
        ("size_ratio = 0.2", "speed = 1", "lab.toml:10: unknown field `speed`"),
        ("'never'", "'seldom'", "lab.toml:13: `rebuild_every` lists numbers of frames of at least 1, and \"never\""),
        ("[1, 2, 'never']", "[]", "lab.toml:13: `rebuild_every` lists none"),
        ("frames = 5", "frames = 0", "lab.toml:11: `frames` is 0, not between 1 and"),
        ("frames = 5", "frames_per_second = 0", "lab.toml:11: `frames_per_second` is a number above 0"),
        ("frames = 5", "camera = { position = [1, 1, 1], interest = [1, 1, 1] }", "lab.toml:11: `camera`: "),
        ("scattered.glb", "missing.glb", "missing.glb"),
        ("model = 'scattered.glb'\n", "", "lab.toml:8: `instances` of what? There is no `model`"),
        ("frames = 5", "blas = 'other'", "lab.toml:11: `blas` is \"refit\" or \"rebuild\""),
        ("[motion]", "[fit]\nclass = 'no-rt-cores'\n[motion]", "`motion` cannot be given with"),
    ] {
        assert!(CONFIG.contains(from), "{from}");
        let ran = lab(folder.path(), &CONFIG.replace(from, to), &[]);
        assert_eq!((ran.status, ran.stdout.as_str()), (2, ""), "{to}");
        assert!(ran.stderr.contains(words), "{words}: {}", ran.stderr);
        assert_eq!(
            folder_names(folder.path()),
            ["animated.glb", "lab.toml", "overlapping.glb", "scattered.glb"],
            "{to}"
        );
    }
}
