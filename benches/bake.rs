//! Seconds per stage and peak memory of whole bakes, for scenes too large for a statistical benchmark: `cargo bench
//! --bench bake -- [--method NAME]... FILE...`. Each bake runs in a separate process. The scenes of the project's own
//! measurements:
//!
//! ```text
//! cargo run --release --example generate -- nodes target/nodes.glb     12.8 million triangles in 10,000 nodes
//! cargo bench --bench bake -- target/nodes.glb conference.obj
//! ```

use raykiln::methods::Method;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, ExitCode};

const STAGES: [&str; 6] = ["read", "analyse", "optimise", "write", "verify", "total"];

fn main() -> ExitCode {
    let (methods, files) = parse(std::env::args().skip(1));
    if files.is_empty() {
        eprintln!("usage: cargo bench --bench bake -- [--method NAME]... FILE...");
        return ExitCode::from(2);
    }
    let folder = tempfile::TempDir::new().expect("a temporary folder");
    println!(
        "{:<24} {:<10} {} {:>9}  verdict",
        "scene",
        "method",
        STAGES.map(|s| format!("{s:>8}")).join(" "),
        "peak MiB"
    );
    let mut status = ExitCode::SUCCESS;
    for file in &files {
        for method in &methods {
            match bake(Path::new(file), method, folder.path()) {
                Ok(report) => println!("{}", row(Path::new(file), method, &report)),
                Err(message) => {
                    eprintln!("{file} {method}: {message}");
                    status = ExitCode::FAILURE;
                }
            }
        }
    }
    status
}

/// The requested methods, by default all, and the files. Cargo adds an argument `--bench`.
fn parse(arguments: impl Iterator<Item = String>) -> (Vec<String>, Vec<String>) {
    let (mut methods, mut files) = (Vec::new(), Vec::new());
    let mut arguments = arguments.filter(|a| a != "--bench");
    while let Some(argument) = arguments.next() {
        if argument == "--method" { methods.extend(arguments.next()) } else { files.push(argument) }
    }
    if methods.is_empty() {
        methods = Method::ALL.map(|method| method.name().to_owned()).into();
    }
    (methods, files)
}

/// Returns the JSON report of a bake into `folder`, or the program's error message.
fn bake(input: &Path, method: &str, folder: &Path) -> Result<Value, String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_raykiln"));
    command.arg("bake").arg(input).arg("-o").arg(folder.join("out.glb"));
    let output = command.args(["--method", method, "--json", "--quiet"]).output().map_err(|e| e.to_string())?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    serde_json::from_slice(&output.stdout).map_err(|e| e.to_string())
}

fn row(file: &Path, method: &str, report: &Value) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let seconds =
        STAGES.map(|stage| format!("{:8.2}", report["seconds"][stage].as_f64().unwrap_or(f64::NAN))).join(" ");
    let peak = report["peak_memory_bytes"].as_f64().map_or("-".into(), |b| format!("{:.0}", b / f64::from(1 << 20)));
    format!("{name:<24} {method:<10} {seconds} {peak:>9}  {}", report["verdict"].as_str().unwrap_or("-"))
}
