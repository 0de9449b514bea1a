//! Randomly modified files never make the program panic: it reads or rejects them.

use crate::common::{Sample, folder_names, methods, raykiln, samples};
use crate::compressed;
use fastrand::Rng;
use raykiln::methods::{self, Method};
use raykiln::scene::{self, LoadOptions};
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const READS_A_FILE: u64 = 300;
const READS_A_COMPRESSED_FILE: u64 = 40;
const BAKES_A_FILE: u64 = 5;

/// Modifies some bytes: bits, digits (which keep JSON and OBJ well-formed), whole numbers, the length, the order.
fn mutate(bytes: &mut Vec<u8>, random: &mut Rng) {
    for _ in 0..random.usize(1..=4) {
        if bytes.is_empty() {
            return;
        }
        let [at, other] = [(); 2].map(|()| random.usize(..bytes.len()));
        match random.u8(..8) {
            0 => bytes[at] ^= 1 << random.u8(..8),
            1 => bytes.truncate(at),
            2..=4 => change_digit(bytes, at, random),
            5 => change_number(bytes, at, random),
            6 => drop(bytes.drain(at..bytes.len().min(at + random.usize(1..=16)))),
            _ => bytes.swap(at, other),
        }
    }
}

/// Changes the first digit at or after a position, if there is one.
fn change_digit(bytes: &mut [u8], at: usize, random: &mut Rng) {
    if let Some(digit) = bytes[at..].iter_mut().find(|b| b.is_ascii_digit()) {
        *digit = b'0' + random.u8(..10);
    }
}

/// Replaces the first run of digits at or after a position by a number that is likely to cause faults.
fn change_number(bytes: &mut Vec<u8>, at: usize, random: &mut Rng) {
    const NUMBERS: [&str; 10] = [
        "0",
        "-1",
        "1e39",
        "-1e308",
        "1e-320",
        "65535",
        "4294967295",
        "9007199254740993",
        "18446744073709551615",
        "null",
    ];
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit).map(|i| at + i) else { return };
    let length = bytes[start..].iter().take_while(|b| b.is_ascii_digit()).count();
    let number = random.choice(NUMBERS).expect("there are some");
    bytes.splice(start..start + length, number.bytes());
}

/// A sample copied to a folder of its own, with the paths of the copies.
fn copied(sample: &Sample) -> (TempDir, PathBuf, Vec<PathBuf>) {
    let folder = TempDir::new().expect("a temporary folder");
    let from = sample.scene.parent().expect("a folder");
    let mut files = Vec::new();
    for entry in fs::read_dir(from).expect("readable").map(|e| e.expect("readable").path()) {
        if entry.extension().is_some_and(|e| e != "toml") {
            let to = folder.path().join(entry.file_name().expect("a name"));
            fs::copy(&entry, &to).expect("writable");
            files.push(to);
        }
    }
    files.sort();
    let scene = folder.path().join(sample.scene.file_name().expect("a name"));
    (folder, scene, files)
}

/// Calls `check` with each sample's scene after each of `count` modifications to each of its files.
fn for_each_mutation(count: u64, check: impl Fn(&Path, &Path, u64)) {
    for sample in samples() {
        let (_folder, scene, files) = copied(&sample);
        for file in &files {
            let original = fs::read(file).expect("readable");
            for seed in 0..count {
                let mut bytes = original.clone();
                mutate(&mut bytes, &mut Rng::with_seed(seed));
                fs::write(file, &bytes).expect("writable");
                check(&scene, file, seed);
            }
            fs::write(file, &original).expect("writable");
        }
    }
}

/// Reads a file and applies every method to its scene; rejecting the file is allowed.
fn read_and_lay_out(path: &Path) {
    let Ok(document) = raykiln_formats::read(path) else { return };
    let Ok((scene, _)) = scene::load(&document, &LoadOptions::default()) else { return };
    assert_eq!(scene.check(), Ok(()));
    for method in Method::ALL {
        methods::run(method, &scene, &methods::Options::default());
    }
}

#[test]
fn changed_files_are_read_or_refused() {
    for_each_mutation(READS_A_FILE, |scene, file, seed| {
        let outcome = catch_unwind(AssertUnwindSafe(|| read_and_lay_out(scene)));
        assert!(outcome.is_ok(), "{} changed with seed {seed}", file.display());
    });
}

#[test]
fn changed_compressed_files_are_read_or_refused() {
    for name in compressed::SAMPLES {
        let original = fs::read(compressed::sample(name)).expect("readable");
        let folder = TempDir::new().expect("a temporary folder");
        let scene = folder.path().join(name);
        for seed in 0..READS_A_COMPRESSED_FILE {
            let mut bytes = original.clone();
            mutate(&mut bytes, &mut Rng::with_seed(seed));
            fs::write(&scene, &bytes).expect("writable");
            let outcome = catch_unwind(AssertUnwindSafe(|| read_and_lay_out(&scene)));
            assert!(outcome.is_ok(), "{name} changed with seed {seed}");
        }
    }
}

#[test]
fn changed_files_are_baked_or_refused_by_the_program() {
    for_each_mutation(BAKES_A_FILE, |scene, file, seed| {
        let out = TempDir::new().expect("a temporary folder");
        let method = methods()[seed as usize % Method::ALL.len()];
        let output = out.path().join("out.glb");
        let (input, output) = (scene.to_str().expect("UTF-8"), output.to_str().expect("UTF-8"));
        let ran =
            raykiln(["bake", input, "-o", output, "--method", method, "--rays", "200", "--repeats", "1", "--quiet"]);
        assert!([0, 2].contains(&ran.status), "{} changed with seed {seed}: {}", file.display(), ran.stderr);
        let left = folder_names(out.path());
        assert_eq!(left.iter().any(|name| name == "out.glb"), ran.status == 0, "{left:?}");
        assert!(ran.status == 0 || left.is_empty(), "{left:?}");
        assert!(!left.iter().any(|name| name.starts_with('.')), "{left:?}");
    });
}
