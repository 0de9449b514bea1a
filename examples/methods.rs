//! Tracing speed of each method's layout relative to one BLAS over the whole scene, as a Markdown table: `methods
//! [--program RAYKILN] [--device DEVICE] FILE...`.
//!
//! Each method is baked separately, with input and output timed in turns. A method's ratio is its gain over the input
//! divided by the gain of `single` over the input; the times of primary, shadow and diffuse rays are summed. A second
//! table lists bytes, build times and how well the hits agree.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use raykiln::methods::Method;
use raykiln::verify::rays::RayKind;
use serde_json::Value;

/// The ray kinds whose times are summed.
const LIGHTING: [&str; 3] = ["primary", "shadow", "diffuse"];

/// The methods compared; the first is the reference. The input represents `keep`.
fn methods() -> Vec<&'static str> {
    let others = Method::ALL.into_iter().filter(|method| !matches!(method, Method::Keep | Method::Single));
    [Method::Single].into_iter().chain(others).map(Method::name).collect()
}

struct Arguments {
    program: PathBuf,
    device: String,
    files: Vec<PathBuf>,
}

fn main() -> ExitCode {
    let arguments = parse(std::env::args().skip(1));
    if arguments.files.is_empty() {
        eprintln!("usage: methods [--program RAYKILN] [--device DEVICE] FILE...");
        return ExitCode::from(2);
    }
    let folder = tempfile::TempDir::new().expect("a temporary folder");
    let mut details = Vec::new();
    let methods = methods();
    let others = methods[1..].join(" | ");
    println!("| scene (triangles, objects) | input | {others} | single, Mrays/s by kind | largest spread |");
    println!("| --- | --- |{} --- | --- |", " --- |".repeat(methods.len() - 1));
    let mut status = ExitCode::SUCCESS;
    for file in &arguments.files {
        match methods.iter().map(|method| bake(&arguments, file, method, folder.path())).collect::<Result<Vec<_>, _>>()
        {
            Ok(reports) => {
                println!("{}", speeds(file, &reports));
                details.extend(methods.iter().zip(&reports).map(|(method, report)| detail(file, method, report)));
            }
            Err(message) => {
                eprintln!("{}: {message}", file.display());
                status = ExitCode::FAILURE;
            }
        }
    }
    println!(
        "\n| scene | method | groups | overlap | BLAS bytes built / compacted | BLAS build ms | hits, mismatches, silhouettes, far | verify s |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    details.iter().for_each(|row| println!("{row}"));
    status
}

fn parse(mut arguments: impl Iterator<Item = String>) -> Arguments {
    let mut parsed = Arguments { program: "raykiln".into(), device: "auto".into(), files: Vec::new() };
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--program" => parsed.program = arguments.next().unwrap_or_default().into(),
            "--device" => parsed.device = arguments.next().unwrap_or_default(),
            _ => parsed.files.push(argument.into()),
        }
    }
    parsed
}

/// Returns the JSON report of a bake, or the program's error message.
fn bake(arguments: &Arguments, input: &Path, method: &str, folder: &Path) -> Result<Value, String> {
    let mut command = Command::new(&arguments.program);
    command.arg("bake").arg(input).arg("-o").arg(folder.join("out.glb"));
    command.args(["--method", method, "--device", &arguments.device, "--json", "--quiet"]);
    let output = command.output().map_err(|e| format!("{}: {e}", arguments.program.display()))?;
    if !output.status.success() {
        return Err(format!("{method}: {}", String::from_utf8_lossy(&output.stderr)));
    }
    serde_json::from_slice(&output.stdout).map_err(|e| e.to_string())
}

/// The gain over the input: the input's time over the output's.
fn gain(report: &Value) -> f64 {
    let time =
        |side: &str| -> f64 { LIGHTING.iter().map(|kind| 1.0 / number(&report["verify"]["kinds"][kind][side])).sum() };
    time("before_mrays_per_s") / time("after_mrays_per_s")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn name(file: &Path) -> String {
    file.parent().and_then(Path::file_name).unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
}

fn speeds(file: &Path, reports: &[Value]) -> String {
    let single = gain(&reports[0]);
    let ratios: String = reports[1..].iter().map(|r| format!("{:.2} | ", gain(r) / single)).collect();
    let kinds = |r: &Value, key: &str| RayKind::ALL.map(|kind| number(&r["verify"]["kinds"][kind.name()][key]));
    let rays = kinds(&reports[0], "after_mrays_per_s").map(|speed| format!("{speed:.0}")).join(" / ");
    let spread = reports.iter().flat_map(|r| kinds(r, "spread_ratio")).fold(0.0, f64::max);
    let input = &reports[0]["input"];
    format!(
        "| {} ({}, {}) | {:.2} | {ratios}{rays} | {:.1} % |",
        name(file),
        input["triangles"],
        input["objects"],
        1.0 / single,
        100.0 * spread
    )
}

fn detail(file: &Path, method: &str, report: &Value) -> String {
    let (v, after) = (&report["verify"], &report["after"]);
    format!(
        "| {} | {method} | {} | {:.3} | {} / {} | {:.2} | {}, {}, {}, {} | {:.1} |",
        name(file),
        after["mesh_groups"],
        number(&after["overlap_ratio"]),
        v["blas_bytes"]["after"],
        v["blas_bytes_compacted"]["after"],
        number(&v["blas_build_ms"]["after"]),
        v["hits"],
        v["mismatches"],
        v["silhouettes"],
        v["far_hits"],
        number(&report["seconds"]["verify"]),
    )
}
