//! What benchmarks of the whole program share.

use std::path::Path;
use std::process::{Command, ExitCode};

use serde_json::Value;

/// The number of threads, two by default, and the files. Cargo adds an argument `--bench`.
fn parse(arguments: impl Iterator<Item = String>) -> (String, Vec<String>) {
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

/// Prints a row for each file of the arguments, below `head`; `row` gets the file and the number of threads.
pub(crate) fn print_rows(bench: &str, head: &[&str], row: impl Fn(&Path, &str) -> Result<String, String>) -> ExitCode {
    let (threads, files) = parse(std::env::args().skip(1));
    if files.is_empty() {
        eprintln!("usage: cargo bench --bench {bench} -- [--threads N] FILE...");
        return ExitCode::from(2);
    }
    println!("| {} |", head.join(" | "));
    println!("|{}", " --- |".repeat(head.len()));
    let mut status = ExitCode::SUCCESS;
    for file in &files {
        match row(Path::new(file), &threads) {
            Ok(row) => println!("{row}"),
            Err(message) => {
                eprintln!("{file}: {message}");
                status = ExitCode::FAILURE;
            }
        }
    }
    status
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
