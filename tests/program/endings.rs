//! Runs that end by a signal or have no working output stream. No staged files are left behind.

use crate::common::{folder_names, gltf, samples, write};
use std::fs::{self, File};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

const SIGNALS: [(&str, i32); 3] = [("HUP", 1), ("INT", 2), ("TERM", 15)];

fn scene() -> String {
    let sample = samples().into_iter().find(|s| s.name == "overlapping").expect("the sample is there");
    sample.scene.to_str().expect("UTF-8").to_owned()
}

/// `raykiln` with its streams connected to the null device.
fn raykiln(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_raykiln"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// Arguments of a bake that traces this many rays of each kind.
fn bake<'a>(input: &'a str, output: &'a str, rays: &'a str) -> [&'a str; 11] {
    ["bake", input, "-o", output, "--method", "single", "--device", "cpu", "--rays", rays, "--json"]
}

/// So many rays that the bake never ends by itself during a test.
const ENDLESS: &str = "4000000";

/// Waits until the program has staged files in a folder.
fn wait_till_staged(folder: &Path, child: &mut Child) {
    let start = Instant::now();
    let is_staged = || {
        let hidden = folder_names(folder).into_iter().find(|name| name.starts_with(".raykiln-"));
        hidden.is_some_and(|name| folder_names(&folder.join(name)).iter().any(|name| name != ".lock"))
    };
    while !is_staged() {
        assert_eq!(child.try_wait().expect("a child"), None, "the program ended before it staged anything");
        assert!(start.elapsed() < Duration::from_secs(60), "nothing was staged");
        sleep(Duration::from_millis(2));
    }
}

/// Sends a signal; does nothing if the program has ended.
fn send(signal: &str, child: &Child) {
    let kill = format!("kill -{signal} {} 2>/dev/null", child.id());
    Command::new("sh").args(["-c", &kill]).status().expect("a shell");
}

/// Ends a bake by signals, `delay` after it has staged its output; returns its status.
fn interrupted(signals: &[&str], folder: &Path, delay: Duration) -> ExitStatus {
    let output = folder.join("out.gltf");
    let mut child =
        raykiln(&bake(&scene(), output.to_str().expect("UTF-8"), ENDLESS)).spawn().expect("the program starts");
    wait_till_staged(folder, &mut child);
    sleep(delay);
    signals.iter().for_each(|signal| send(signal, &child));
    child.wait().expect("a child")
}

/// The signals that the tests do not ignore. Signals ignored at start, as by `nohup`, are ignored by the program too.
fn heeded() -> impl Iterator<Item = (&'static str, i32)> {
    let status = fs::read_to_string("/proc/self/status").expect("Linux has it");
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).expect("Linux has it").trim().to_owned();
    let ignored = u64::from_str_radix(&ignored, 16).expect("a mask");
    SIGNALS.into_iter().filter(move |(_, number)| ignored >> (number - 1) & 1 == 0)
}

#[test]
fn signals_end_a_bake_and_leave_nothing_behind() {
    for (name, number) in heeded() {
        let folder = TempDir::new().unwrap();
        write(folder.path(), "out.gltf", "of an earlier run");
        let status = interrupted(&[name], folder.path(), Duration::ZERO);
        assert_eq!(status.signal(), Some(number), "{name}: {status}");
        assert_eq!(folder_names(folder.path()), ["out.gltf"], "{name}");
        assert_eq!(fs::read_to_string(folder.path().join("out.gltf")).unwrap(), "of an earlier run", "{name}");
    }
}

#[test]
fn a_second_signal_leaves_nothing_behind_either() {
    let folder = TempDir::new().unwrap();
    let status = interrupted(&["TERM"; 5], folder.path(), Duration::from_millis(50));
    assert_eq!(status.signal(), Some(15), "{status}");
    assert!(folder_names(folder.path()).is_empty());
}

#[test]
fn a_signal_at_any_time_leaves_all_or_nothing() {
    let parent = TempDir::new().unwrap();
    let input = write(parent.path(), "in.glb", gltf([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [0, 1, 2], |_| ()));
    let mut ended = 0;
    for step in 0..24 {
        let folder = TempDir::new_in(parent.path()).unwrap();
        let [output, report] = ["out.gltf", "report.json"].map(|name| folder.path().join(name));
        let fixed = bake(input.to_str().unwrap(), output.to_str().unwrap(), "3000");
        let mut command = raykiln(&fixed);
        let mut child = command.arg("--prune").arg("--report").arg(&report).spawn().expect("the program starts");
        sleep(Duration::from_millis(4 * step));
        send("TERM", &child);
        let status = child.wait().expect("a child");
        assert!(status.signal() == Some(15) || status.success(), "{step}: {status}");
        ended += usize::from(!status.success());
        let names = folder_names(folder.path());
        let whole = ["out.bin", "out.gltf", "report.json"];
        assert!(names == whole || names.is_empty() && !status.success(), "{step}: {status}: {names:?}");
    }
    assert!(ended > 0, "no signal arrived before the bake ended");
}

#[test]
fn a_signal_that_is_to_be_ignored_is_ignored() {
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.glb");
    let scene = scene();
    let bake = bake(&scene, output.to_str().unwrap(), "60000");
    let mut command = Command::new("sh");
    command.args(["-c", r#"trap "" HUP; exec "$@""#, "sh", env!("CARGO_BIN_EXE_raykiln")]).args(bake);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("a shell");
    wait_till_staged(folder.path(), &mut child);
    send("HUP", &child);
    assert!(child.wait().expect("a child").success());
    assert_eq!(folder_names(folder.path()), ["out.glb"]);
}

/// A device that is always full.
fn full() -> File {
    File::options().write(true).open("/dev/full").expect("Linux has it")
}

#[test]
fn a_full_standard_error_changes_nothing() {
    let folder = TempDir::new().unwrap();
    let [output, absent] = ["out.glb", "absent.glb"].map(|name| folder.path().join(name).to_str().unwrap().to_owned());
    let scene = scene();
    for (arguments, expected) in [
        (&bake(&scene, &output, "200")[..], 0),
        (&["bake", &scene, "-o", &output, "-v", "--rays", "200"], 0),
        (&["verify", &scene, &output, "--rays", "200"], 0),
        (&["bake", &absent, "-o", &output], 2),
        (&["grill"], 2),
    ] {
        let status = raykiln(arguments).stderr(full()).status().expect("the program starts");
        assert_eq!(status.code(), Some(expected), "{arguments:?}: {status}");
    }
    assert_eq!(folder_names(folder.path()), ["out.glb"]);
}

#[test]
fn a_full_standard_output_leaves_no_files() {
    let folder = TempDir::new().unwrap();
    let [output, report] = ["out.glb", "report.json"].map(|name| folder.path().join(name).to_str().unwrap().to_owned());
    let scene = scene();
    let more = ["--report", report.as_str()];
    for arguments in [
        &bake(&scene, &output, "200")[..],
        &["verify", &scene, &scene, "--rays", "200", "--match", "surface"],
        &["inspect", &scene],
    ] {
        let ran = raykiln(&[arguments, &more].concat()).stdout(full()).stderr(Stdio::piped()).output();
        let ran = ran.expect("the program starts");
        let words = String::from_utf8_lossy(&ran.stderr);
        assert_eq!(ran.status.code(), Some(2), "{arguments:?}: {words}");
        assert!(words.contains("standard output cannot be written to"), "{arguments:?}: {words}");
        assert!(folder_names(folder.path()).is_empty(), "{arguments:?}");
    }
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.glb");
    let scene = scene();
    let mut child = raykiln(&bake(&scene, output.to_str().unwrap(), "200")).stdout(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    assert!(child.wait().expect("a child").success());
    assert_eq!(folder_names(folder.path()), ["out.glb"]);
}

#[test]
fn a_report_replaces_no_device() {
    let folder = TempDir::new().unwrap();
    let link = folder.path().join("report.json");
    std::os::unix::fs::symlink("/dev/null", &link).unwrap();
    let scene = scene();
    let ran =
        raykiln(&["inspect", &scene, "--report", link.to_str().unwrap()]).stderr(Stdio::piped()).output().unwrap();
    let words = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.code() == Some(2) && words.contains("is not a regular file"), "{words}");
}

/// An OBJ file of a wavy grid of 2 * `n` * `n` triangles.
fn grid(folder: &Path, n: usize) -> String {
    let mut text = String::new();
    for i in 0..(n + 1) * (n + 1) {
        let (x, y) = (i % (n + 1), i / (n + 1));
        text += &format!("v {x} {y} {}\n", (x * 7 + y * 3) % 5);
    }
    for i in 0..n * n {
        let a = i / n * (n + 1) + i % n + 1;
        text += &format!("f {a} {} {} {}\n", a + 1, a + n + 2, a + n + 1);
    }
    let path = folder.join("grid.obj");
    fs::write(&path, text).expect("a temporary folder is writable");
    path.to_str().expect("UTF-8").to_owned()
}

/// Runs a shell command with a limit on the address space; returns the status and what was printed to standard error.
fn with_limit(kilobytes: u64, arguments: &str) -> (Option<i32>, String) {
    let program = env!("CARGO_BIN_EXE_raykiln");
    let command = format!("ulimit -v {kilobytes} && exec {program} {arguments}");
    let ran = Command::new("sh").args(["-c", &command]).output().expect("a shell");
    (ran.status.code(), String::from_utf8_lossy(&ran.stderr).into_owned())
}

#[test]
fn memory_that_is_refused_is_an_error_and_nothing_is_left_behind() {
    let folder = TempDir::new().unwrap();
    let input = grid(folder.path(), 150);
    let mut refused = 0;
    for kilobytes in (0..).map(|step| 60_000 * 5_u64.pow(step) / 4_u64.pow(step)) {
        let output = folder.path().join("out.glb");
        let bake = format!("bake {input} -o {} --device cpu --rays 100 --quiet --threads 2", output.display());
        let (status, words) = with_limit(kilobytes, &bake);
        if status == Some(0) {
            break;
        }
        refused += 1;
        assert_eq!(status, Some(2), "{kilobytes} KiB: {words}");
        assert!(words.starts_with("error: ") && words.lines().count() == 1, "{kilobytes} KiB: {words}");
        assert_eq!(folder_names(folder.path()), ["grid.obj"], "{kilobytes} KiB");
    }
    assert!(refused > 2, "{refused} limits were too small");
    assert_eq!(folder_names(folder.path()), ["grid.obj", "out.glb"]);
}

#[test]
fn threads_that_cannot_be_started_are_an_error() {
    let (status, words) = with_limit(400_000, &format!("inspect {} --threads 512", scene()));
    assert_eq!(status, Some(2), "{words}");
    assert!(words.starts_with("error: the threads cannot be started") && words.lines().count() == 1, "{words}");
}
