//! Results of `--method auto` for scenes, as a Markdown table: `auto [--program RAYKILN] [--device DEVICE] FILE... [--
//! ARGUMENT...]`; arguments after `--` are passed to every bake.
//!
//! "over input" is the input's time over the output's, from verification; "over single" is the speed of the chosen
//! layout over that of a single BLAS, timed in the same race. Times of primary, shadow and diffuse rays are summed for
//! "over input". Geometric means come last.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use serde_json::Value;

/// The ray kinds whose times are summed.
const LIGHTING: [&str; 3] = ["primary", "shadow", "diffuse"];

struct Arguments {
    program: PathBuf,
    device: String,
    files: Vec<PathBuf>,
    further: Vec<String>,
}

/// The ratios to average.
#[derive(Default)]
struct Ratios {
    over_input: Vec<f64>,
    over_single: Vec<f64>,
}

fn main() -> ExitCode {
    let arguments = parse(std::env::args().skip(1));
    if arguments.files.is_empty() {
        eprintln!("usage: auto [--program RAYKILN] [--device DEVICE] FILE... [-- ARGUMENT...]");
        return ExitCode::from(2);
    }
    let folder = tempfile::TempDir::new().expect("a temporary folder");
    println!(
        "| scene | triangles | chosen | over input | over single | groups | bytes over input | position error | mismatches, silhouettes, far of hits | optimise s |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut ratios = Ratios::default();
    let mut status = ExitCode::SUCCESS;
    for file in &arguments.files {
        match bake(&arguments, file, folder.path()) {
            Ok(report) => println!("{}", row(file, &report, &mut ratios)),
            Err(message) => {
                eprintln!("{}: {message}", file.display());
                status = ExitCode::FAILURE;
            }
        }
    }
    println!("\n{}", mean("over input", &ratios.over_input));
    println!("{}", mean("over single", &ratios.over_single));
    status
}

fn parse(mut arguments: impl Iterator<Item = String>) -> Arguments {
    let mut parsed =
        Arguments { program: "raykiln".into(), device: "auto".into(), files: Vec::new(), further: Vec::new() };
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--program" => parsed.program = arguments.next().unwrap_or_default().into(),
            "--device" => parsed.device = arguments.next().unwrap_or_default(),
            "--" => parsed.further = arguments.by_ref().collect(),
            _ => parsed.files.push(argument.into()),
        }
    }
    parsed
}

/// Returns the JSON report of a bake, or the program's error message.
fn bake(arguments: &Arguments, input: &Path, folder: &Path) -> Result<Value, String> {
    let mut command = Command::new(&arguments.program);
    command.arg("bake").arg(input).arg("-o").arg(folder.join("out.glb"));
    command.args(["--method", "auto", "--device", &arguments.device, "--json", "--quiet"]).args(&arguments.further);
    let output = command.output().map_err(|e| format!("{}: {e}", arguments.program.display()))?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    serde_json::from_slice(&output.stdout).map_err(|e| e.to_string())
}

fn row(file: &Path, report: &Value, ratios: &mut Ratios) -> String {
    let (verify, method) = (&report["verify"], &report["method"]);
    let over_input = over_input(verify);
    let over_single = candidate(method, &method["chosen_candidate"]).zip(candidate(method, &"single".into()));
    let over_single = over_single.map(|(chosen, single)| chosen / single);
    ratios.over_input.push(over_input);
    ratios.over_single.extend(over_single);
    let bytes = |side: &str| number(&report[side]["blas_bytes"]) + number(&report[side]["tlas_bytes"]);
    format!(
        "| {} | {} | {} | {over_input:.3} | {} | {} | {:.2} | {:.1e} | {}, {}, {} of {} | {:.1} |",
        name(file),
        report["input"]["triangles"],
        method["chosen_candidate"].as_str().unwrap_or_default(),
        over_single.map_or("-".into(), |ratio| format!("{ratio:.3}")),
        report["after"]["mesh_groups"],
        bytes("after") / bytes("before"),
        number(&verify["position_error_ratio"]),
        verify["mismatches"],
        verify["silhouettes"],
        verify["far_hits"],
        verify["hits"],
        number(&report["seconds"]["optimise"]),
    )
}

/// The input's time over the output's; 1 if the output is the input.
fn over_input(verify: &Value) -> f64 {
    let time = |side: &str| -> f64 { LIGHTING.iter().map(|kind| 1.0 / number(&verify["kinds"][kind][side])).sum() };
    time("before_mrays_per_s") / time("after_mrays_per_s")
}

/// The measured speed of a candidate over the input's; 1 for the input.
fn candidate(method: &Value, name: &Value) -> Option<f64> {
    let mut all = method["candidates"].as_array()?.iter();
    let found = all.find(|c| c["name"] == *name)?;
    found["measured_speedup_ratio"].as_f64().or((name == "keep").then_some(1.0))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// The last folder and the name of a file.
fn name(file: &Path) -> String {
    let folder = file.parent().and_then(Path::file_name).unwrap_or_default();
    Path::new(folder).join(file.file_name().unwrap_or_default()).display().to_string()
}

fn mean(what: &str, ratios: &[f64]) -> String {
    let usable: Vec<f64> = ratios.iter().copied().filter(|r| *r > 0.0 && r.is_finite()).collect();
    let mean = (usable.iter().map(|r| r.ln()).sum::<f64>() / usable.len().max(1) as f64).exp();
    let least = usable.iter().copied().fold(f64::INFINITY, f64::min);
    format!("{what}: geometric mean {mean:.3}, least {least:.3}, of {} scenes", usable.len())
}
