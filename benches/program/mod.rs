//! What benchmarks of the whole program share.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// The number of threads, two by default, and the files. Cargo adds an argument `--bench`.
pub(crate) fn parse(arguments: impl Iterator<Item = String>) -> (String, Vec<String>) {
    let (mut threads, mut files) = ("2".to_owned(), Vec::new());
    let mut arguments = arguments.filter(|a| a != "--bench");
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--threads" => threads = arguments.next().unwrap_or(threads),
            _ => files.push(argument),
        }
    }
    (threads, files)
}

/// Bakes without a device and gives the report.
pub(crate) fn bake(input: &Path, options: &[&str]) -> Result<Value, String> {
    let folder = tempfile::TempDir::new().map_err(|e| e.to_string())?;
    let mut command = raykiln();
    command.arg("bake").arg(input).arg("-o").arg(folder.path().join("out.glb"));
    command.args(["--device", "cpu", "--json", "--quiet"]).args(options);
    let output = command.output().map_err(|e| e.to_string())?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    serde_json::from_slice(&output.stdout).map_err(|e| e.to_string())
}

/// The program.
pub(crate) fn raykiln() -> Command {
    Command::new(env!("CARGO_BIN_EXE_raykiln"))
}
