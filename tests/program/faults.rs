//! Damaged outputs: `raykiln verify` names each fault, on the CPU and on a device.

mod everything;
mod geometry;
mod library;
mod matrix;
mod planting;

use crate::common::{Opened, Ran, bake, raykiln, samples, with_record};
use raykiln_formats::record::{Origins, Record};
use serde_json::json;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Diagonal of the sample's scene in its units, as accurate as the faults need.
const SIZE: f64 = 31.0;

/// A name, the damage, and words that the failure contains.
type Fault = (&'static str, fn(&mut Opened), &'static [&'static str]);

const FAULTS: [Fault; 5] = [
    ("vertex moved", move_a_vertex, &["moved, by up to ", "the farthest triangle "]),
    ("triangle flipped", flip_a_triangle, &["1 triangle flipped: triangle 0 of primitive 0"]),
    ("triangle dropped", drop_a_triangle, &["1 triangle missing: triangle "]),
    ("material changed", |o| o.primitive()["material"] = json!(1), &["96 triangles of another material"]),
    ("instance moved", |o| o.move_instance(1e-3 * SIZE), &["144 triangles moved"]),
];

fn move_a_vertex(opened: &mut Opened) {
    let positions = opened.positions();
    opened.move_vertex(positions, 1e-3 * SIZE as f32);
}

fn flip_a_triangle(opened: &mut Opened) {
    let accessor = opened.indices();
    let mut indices = opened.numbers(accessor);
    indices.swap(1, 2);
    opened.set_numbers(accessor, &indices);
}

/// Drops the last triangle.
fn drop_a_triangle(opened: &mut Opened) {
    let indices = opened.indices();
    let kept = opened.numbers(indices);
    opened.set_numbers(indices, &kept[..kept.len() - 3]);
}

/// Swaps the recorded sources of two equal crates' triangles.
fn swap_provenance(record: &mut Record) {
    let Origins::Each { sources, .. } = &mut record.lists[0][0] else { panic!("{record:?}") };
    sources.swap(0, 1);
}

fn input() -> PathBuf {
    samples().into_iter().find(|s| s.name == "overlapping").expect("the sample is there").scene
}

/// A bake's output, damaged.
fn damaged(folder: &Path, damage: impl FnOnce(&mut Opened)) -> PathBuf {
    let output = folder.join("out.gltf");
    bake(&input(), &output, &["--method", "single"]);
    let mut opened = Opened::read(&output);
    damage(&mut opened);
    opened.write(folder)
}

fn verify(after: &Path, device: &str, more: &[&str]) -> Ran {
    let (before, after) = (input(), after.to_str().expect("UTF-8"));
    let fixed = ["verify", before.to_str().expect("UTF-8"), after, "--device", device, "--rays", "2000"];
    raykiln(fixed.iter().chain(&["--repeats", "1"]).chain(more))
}

fn assert_each_fault_is_named(device: &str) {
    let folder = TempDir::new().unwrap();
    let sound = verify(&damaged(folder.path(), |_| {}), device, &[]);
    assert_eq!((sound.status, sound.stderr.as_str()), (0, ""), "{}", sound.stdout);
    for (name, damage, words) in FAULTS {
        let ran = verify(&damaged(folder.path(), damage), device, &[]);
        assert_eq!(ran.status, 1, "{name}: {}{}", ran.stdout, ran.stderr);
        for word in words {
            assert!(ran.stderr.contains(word), "{name}: {word} is missing in {}", ran.stderr);
        }
    }
}

#[test]
fn a_wrong_record_is_a_note_and_by_identity_a_fault() {
    let folder = TempDir::new().unwrap();
    let (output, swapped) = (damaged(folder.path(), |_| {}), folder.path().join("swapped.glb"));
    with_record(&output, &swapped, swap_provenance);
    let ran = verify(&swapped, "cpu", &["--verbose"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(ran.stdout.contains("24 triangles are not the one that the output records"), "{}", ran.stdout);
    let ran = verify(&swapped, "cpu", &["--match", "identity"]);
    assert!(ran.status == 1 && ran.stderr.contains("24 triangles recorded as another one"), "{}", ran.stderr);
}

#[test]
fn each_fault_is_named_on_the_cpu() {
    assert_each_fault_is_named("cpu");
}

#[test]
fn each_fault_is_named_on_a_device() {
    assert_each_fault_is_named("llvmpipe");
}

#[test]
fn rays_alone_see_what_is_moved_or_painted() {
    let folder = TempDir::new().unwrap();
    for (name, damage, _) in [FAULTS[3], FAULTS[4]] {
        for device in ["cpu", "llvmpipe"] {
            let ran = verify(&damaged(folder.path(), damage), device, &["--match", "surface"]);
            assert_eq!(ran.status, 1, "{name} on {device}: {}{}", ran.stdout, ran.stderr);
            assert!(ran.stderr.contains("rays see something else"), "{name} on {device}: {}", ran.stderr);
        }
    }
}
