//! Time and memory of a bake relative to its scene, as a Markdown table: `cargo bench --bench budget -- [--threads N]
//! FILE...`.
//!
//! "trees" is the time of `auto --effort 2` without a device over the time of one tree over the same placed triangles,
//! which `obvhs` builds at medium quality in one thread; both are the minimum of several runs, in turns. "CPU trees" is
//! the same ratio for the CPU time of all threads of the bake (Linux; `-` elsewhere). "memory" is the peak resident set
//! size of the bake over the bytes of the geometry: all vertex attributes and indices of the input as glTF, without
//! images. "tree memory" is the same ratio for a process that reads the file and builds that one tree.

mod program;

use std::path::Path;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use glam::DVec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};
use raykiln::scene::{self, Bounds, LoadOptions, Scene, TriangleRef};
use serde_json::Value;

/// Number of bakes and of trees, in turns.
const RUNS: usize = 3;

fn main() -> ExitCode {
    if let Some(file) = std::env::args().skip(1).skip_while(|a| a != TREE_ONLY).nth(1) {
        return only_a_tree(Path::new(&file));
    }
    let head = ["scene", "triangles", "tree s", "bake s", "trees", "CPU trees", "peak MB", "geometry MB", "memory"];
    program::print_rows("budget", &[&head[..], &["tree memory"]].concat(), row)
}

/// Argument that makes this program only build a tree.
const TREE_ONLY: &str = "--only-a-tree";

/// Builds the tree of a file and prints the peak resident set size in KiB, if the system reports it (proc(5)).
fn only_a_tree(file: &Path) -> ExitCode {
    match geometry(file) {
        Ok((boxes, _)) => {
            tree_seconds(&boxes);
            let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
            let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
            println!("{}", peak.map_or("", |kilobytes| kilobytes.trim().trim_end_matches(" kB")));
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

/// The peak resident set size for reading a file and building its tree, in bytes, in a process that returns freed
/// memory to the system as the program does.
fn tree_bytes(file: &Path) -> Result<f64, String> {
    let mut command = Command::new(std::env::current_exe().map_err(|e| e.to_string())?);
    let output = command.arg(TREE_ONLY).arg(file).env("MALLOC_MMAP_THRESHOLD_", "1048576").output();
    let printed = String::from_utf8(output.map_err(|e| e.to_string())?.stdout).map_err(|e| e.to_string())?;
    Ok(printed.trim().parse().map_or(f64::NAN, |kilobytes: f64| 1024.0 * kilobytes))
}

fn row(file: &Path, threads: &str) -> Result<String, String> {
    let (boxes, geometry) = geometry(file)?;
    let (mut tree, mut bake, mut cpu, mut peak) = (f64::INFINITY, f64::INFINITY, f64::INFINITY, f64::INFINITY);
    for _ in 0..RUNS {
        tree = tree.min(tree_seconds(&boxes));
        let taken = bake_once(file, threads)?;
        bake = bake.min(taken.seconds);
        cpu = cpu.min(taken.cpu_seconds.unwrap_or(f64::NAN));
        peak = peak.min(taken.peak_bytes);
    }
    let cpu_trees = if cpu.is_finite() { format!("{:.1}", cpu / tree) } else { "-".to_owned() };
    Ok(format!(
        "| {} | {} | {tree:.2} | {bake:.2} | {:.1} | {cpu_trees} | {:.0} | {:.1} | {:.1} | {:.1} |",
        file.file_name().unwrap_or_default().to_string_lossy(),
        boxes.len(),
        bake / tree,
        peak / 1e6,
        geometry / 1e6,
        peak / geometry,
        tree_bytes(file)? / geometry,
    ))
}

/// A box in the form that the builder expects.
struct Boxed(Aabb);

impl Boundable for Boxed {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

/// The boxes of all placed triangles, scaled to the unit cube, and the bytes of the geometry as stored.
fn geometry(file: &Path) -> Result<(Vec<Boxed>, f64), String> {
    let doc = raykiln_formats::read(file).map_err(|e| e.to_string())?;
    let (scene, _) = scene::load(&doc, &LoadOptions::default()).map_err(|e| e.to_string())?;
    Ok((boxes(&scene), stored_bytes(&doc.json)))
}

fn boxes(scene: &Scene) -> Vec<Boxed> {
    let all = scene.bounds();
    let seen = |p: DVec3| ((p - all.center()) / all.size().max_element()).as_vec3a();
    let boxed = |instance: u32, triangle: u32| {
        let bounds = Bounds::of(scene.world_corners(TriangleRef { instance, triangle }));
        Boxed(Aabb::new(seen(bounds.min), seen(bounds.max)))
    };
    let of_instance = |(i, instance): (u32, &scene::Instance)| {
        let count = scene.meshes[instance.mesh.0 as usize].triangle_count() as u32;
        (0..count).map(move |triangle| (i, triangle))
    };
    (0u32..).zip(&scene.instances).flat_map(of_instance).map(|(i, triangle)| boxed(i, triangle)).collect()
}

/// Bytes of the accessors that primitives use, each counted once.
fn stored_bytes(json: &Value) -> f64 {
    let mut used = std::collections::BTreeSet::new();
    for primitive in json["meshes"].as_array().into_iter().flatten().flat_map(|m| m["primitives"].as_array()).flatten()
    {
        let attributes = primitive["attributes"].as_object().into_iter().flat_map(|a| a.values());
        used.extend(attributes.chain(primitive.get("indices")).filter_map(Value::as_u64));
    }
    used.into_iter().map(|accessor| accessor_bytes(&json["accessors"][accessor as usize])).sum()
}

fn accessor_bytes(accessor: &Value) -> f64 {
    let components = match accessor["type"].as_str() {
        Some("SCALAR") => 1.0,
        Some("VEC2") => 2.0,
        Some("VEC3") => 3.0,
        _ => 4.0,
    };
    let size = match accessor["componentType"].as_u64() {
        Some(5120 | 5121) => 1.0,
        Some(5122 | 5123) => 2.0,
        _ => 4.0,
    };
    accessor["count"].as_f64().unwrap_or(0.0) * components * size
}

fn tree_seconds(boxes: &[Boxed]) -> f64 {
    let start = Instant::now();
    let tree = build_bvh2(boxes, BvhBuildParams::medium_build(), &mut Duration::default());
    std::hint::black_box(tree);
    start.elapsed().as_secs_f64()
}

/// The resources used by a bake.
struct Taken {
    seconds: f64,
    cpu_seconds: Option<f64>,
    peak_bytes: f64,
}

/// Bakes in a separate process.
fn bake_once(input: &Path, threads: &str) -> Result<Taken, String> {
    let before = children_seconds();
    let report = program::bake(input, &["--effort", "2", "--threads", threads])?;
    Ok(Taken {
        seconds: report["seconds"]["total"].as_f64().unwrap_or(f64::NAN),
        cpu_seconds: children_seconds().zip(before).map(|(after, before)| after - before),
        peak_bytes: report["peak_memory_bytes"].as_f64().unwrap_or(f64::NAN),
    })
}

/// CPU seconds of this process's children, over all threads, if the system reports them (proc(5): numbers 16 and 17 of
/// `stat`, in hundredths of a second).
fn children_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let after_name = stat.rsplit_once(')')?.1;
    let ticks = after_name.split_whitespace().skip(13).take(2).map(|n| n.parse::<f64>().ok());
    Some(ticks.sum::<Option<f64>>()? / 100.0)
}
