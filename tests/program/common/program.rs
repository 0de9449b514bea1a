//! Running the program.

use super::schema::assert_conforms;
use raykiln::methods::Method;
use serde_json::Value;
use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

/// The names of all methods on the command line.
pub(crate) fn methods() -> [&'static str; Method::ALL.len()] {
    Method::ALL.map(Method::name)
}

/// The result of a run of the program.
pub(crate) struct Ran {
    pub(crate) status: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Ran {
    /// Parses standard output as a report.
    pub(crate) fn json(&self) -> Value {
        let report = serde_json::from_str(&self.stdout);
        let report = report.unwrap_or_else(|e| panic!("stdout is not JSON: {e}\n{}", self.stdout));
        assert_conforms(&report);
        report
    }
}

/// Runs the program to its end.
pub(crate) fn raykiln<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Ran {
    let output = Command::new(env!("CARGO_BIN_EXE_raykiln")).args(arguments).output().expect("the program starts");
    let text = |bytes| String::from_utf8(bytes).expect("the program prints UTF-8");
    // A run ended by a signal has no status; no expected status is negative.
    let status = output.status.code().unwrap_or(-1);
    Ran { status, stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// Bakes with few rays, without text output; panics unless it succeeds. Returns the JSON report.
pub(crate) fn bake(input: &Path, output: &Path, more: &[&str]) -> Value {
    let (input, output) = (input.to_str().expect("UTF-8"), output.to_str().expect("UTF-8"));
    let fixed =
        ["bake", input, "-o", output, "--json", "--quiet", "--device", "cpu", "--rays", "2000", "--repeats", "1"];
    let ran = raykiln(fixed.iter().chain(more));
    assert_eq!(ran.status, 0, "bake {input} {more:?}: {}", ran.stderr);
    ran.json()
}
