//! What a bake takes by stage, beside what reading and inspecting the same file takes, as a Markdown table: `cargo bench
//! --bench stages -- [--threads N] FILE...`.
//!
//! Everything but the input stays at its default, without a device. Bakes and inspections take turns; the row is the
//! fastest bake of [`RUNS`], with its peak memory. "times inspect" is the whole bake over the fastest `inspect`.

mod program;

use std::path::Path;
use std::process::{ExitCode, Stdio};
use std::time::Instant;

use serde_json::Value;

/// Number of bakes and of inspections, in turns.
const RUNS: usize = 3;

/// The stages in the report.
const STAGES: [&str; 6] = ["read", "analyse", "optimise", "write", "verify", "total"];

fn main() -> ExitCode {
    let stages = STAGES.map(|stage| format!("{stage} s"));
    let head = ["scene", "inspect s"].into_iter().chain(stages.iter().map(String::as_str));
    let head: Vec<&str> = head.chain(["times inspect", "peak MB", "chosen"]).collect();
    program::print_rows("stages", &head, row)
}

fn row(file: &Path, threads: &str) -> Result<String, String> {
    let total = |report: &Value| report["seconds"]["total"].as_f64().unwrap_or(f64::INFINITY);
    let (mut inspected, mut fastest) = (f64::INFINITY, Value::Null);
    for _ in 0..RUNS {
        inspected = inspected.min(inspect(file, threads)?);
        let report = program::bake(file, &["--threads", threads])?;
        if total(&report) < total(&fastest) {
            fastest = report;
        }
    }
    let stages: Vec<String> = STAGES.iter().map(|stage| seconds(&fastest["seconds"][stage])).collect();
    Ok(format!(
        "| {} | {inspected:.2} | {} | {:.1} | {:.0} | {} |",
        file.file_name().unwrap_or_default().to_string_lossy(),
        stages.join(" | "),
        total(&fastest) / inspected,
        fastest["peak_memory_bytes"].as_f64().unwrap_or(f64::NAN) / 1e6,
        fastest["method"]["chosen_candidate"].as_str().unwrap_or("-"),
    ))
}

fn seconds(stage: &Value) -> String {
    stage.as_f64().map_or_else(|| "-".to_owned(), |seconds| format!("{seconds:.2}"))
}

/// Seconds that `inspect` takes.
fn inspect(file: &Path, threads: &str) -> Result<f64, String> {
    let start = Instant::now();
    let mut command = program::raykiln();
    let status = command.arg("inspect").arg(file).args(["--threads", threads]).stdout(Stdio::null()).status();
    match status.map_err(|e| e.to_string())?.success() {
        true => Ok(start.elapsed().as_secs_f64()),
        false => Err("`inspect` failed".to_owned()),
    }
}
