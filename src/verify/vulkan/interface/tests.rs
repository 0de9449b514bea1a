//! Checks the committed SPIR-V against its sources and against the host's structures.

use std::collections::BTreeMap;
use std::mem::offset_of;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::{AlphaGeometry, Clocked, Hit, Ray, Work};

/// Version of the compiler that made the committed files, as printed by `glslangValidator --version`.
const COMPILER: &str = "Glslang Version: 11:12.0.0";

fn shaders() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders")
}

fn compiled_in(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).expect("the folder is there").map(|e| e.expect("readable").path());
    entries
        .filter(|path| path.extension().is_some_and(|e| e == "spv"))
        .map(|path| {
            let name = path.file_name().expect("a file").to_string_lossy().into_owned();
            (name, std::fs::read(&path).expect("readable"))
        })
        .collect()
}

/// Maps (structure, member) to its offset in a module.
type Offsets = BTreeMap<(String, String), u32>;

/// Returns the member offsets that a SPIR-V module declares, by name (J. Kessenich, B. Ouriel, R. Krisch, "SPIR-V
/// Specification", 2.3 and 3.49: a header of five words, then instructions that state their length).
fn offsets(module: &[u8]) -> Offsets {
    const OP_NAME: u32 = 5;
    const OP_MEMBER_NAME: u32 = 6;
    const OP_MEMBER_DECORATE: u32 = 72;
    const OFFSET: u32 = 35;
    let words: Vec<u32> =
        module.chunks_exact(4).map(|w| u32::from_le_bytes(w.try_into().expect("four bytes"))).collect();
    assert_eq!(words[0], 0x0723_0203, "a SPIR-V module");
    let (mut names, mut members, mut found) = (BTreeMap::new(), BTreeMap::new(), Vec::new());
    let mut rest = &words[5..];
    while let Some(&head) = rest.first() {
        let (instruction, later) = rest.split_at((head >> 16) as usize);
        match head & 0xffff {
            OP_NAME => drop(names.insert(instruction[1], text(&instruction[2..]))),
            OP_MEMBER_NAME => drop(members.insert((instruction[1], instruction[2]), text(&instruction[3..]))),
            OP_MEMBER_DECORATE if instruction[3] == OFFSET => {
                found.push((instruction[1], instruction[2], instruction[4]));
            }
            _ => {}
        }
        rest = later;
    }
    let named = |(of, member, offset): (u32, u32, u32)| ((names[&of].clone(), members[&(of, member)].clone()), offset);
    found.into_iter().map(named).collect()
}

fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).take_while(|b| *b != 0).collect();
    String::from_utf8(bytes).expect("names are UTF-8")
}

/// Returns the members of a structure in one module, with their offsets.
fn members(of: &str, all: &Offsets) -> Vec<(String, usize)> {
    let mut members: Vec<(String, usize)> =
        all.iter().filter(|((s, _), _)| s == of).map(|((_, m), o)| (m.clone(), *o as usize)).collect();
    members.sort_by_key(|m| m.1);
    members
}

fn assert_members(module: &str, of: &str, expected: &[(&str, usize)]) {
    let module = std::fs::read(shaders().join(module)).expect("the module is committed");
    let expected: Vec<(String, usize)> = expected.iter().map(|(m, o)| (m.to_string(), *o)).collect();
    assert_eq!(members(of, &offsets(&module)), expected, "{of}");
}

#[test]
fn offsets_agree_with_the_shaders() {
    for module in ["hits.rgen.spv", "timing.rgen.spv", "all.rgen.spv", "clock.rgen.spv"] {
        assert_members(
            module,
            "Ray",
            &[
                ("origin", offset_of!(Ray, origin)),
                ("t_min", offset_of!(Ray, t_min)),
                ("direction", offset_of!(Ray, direction)),
                ("t_max", offset_of!(Ray, t_max)),
            ],
        );
        assert_members(
            module,
            "Work",
            &[
                ("scene", offset_of!(Work, scene)),
                ("rays", offset_of!(Work, rays)),
                ("results", offset_of!(Work, results)),
                ("first", offset_of!(Work, first)),
                ("ray_flags", offset_of!(Work, ray_flags)),
                ("scale", offset_of!(Work, scale)),
                ("kept_hits", offset_of!(Work, kept_hits)),
                ("alpha", offset_of!(Work, alpha)),
                ("first_geometries", offset_of!(Work, first_geometries)),
            ],
        );
    }
    assert_members(
        "timing.rahit.spv",
        "AlphaGeometry",
        &[
            ("triangles", offset_of!(AlphaGeometry, triangles)),
            ("texcoords", offset_of!(AlphaGeometry, texcoords)),
            ("texels", offset_of!(AlphaGeometry, texels)),
            ("size", offset_of!(AlphaGeometry, size)),
            ("wrap", offset_of!(AlphaGeometry, wrap)),
            ("factor", offset_of!(AlphaGeometry, factor)),
            ("cutoff", offset_of!(AlphaGeometry, cutoff)),
        ],
    );
    let clocked = [("ticks", offset_of!(Clocked, ticks)), ("is_hit", offset_of!(Clocked, is_hit))];
    assert_members("clock.rgen.spv", "Clocked", &clocked);
    for module in ["hits.rgen.spv", "all.rgen.spv", "all.rahit.spv"] {
        assert_members(
            module,
            "Hit",
            &[
                ("t", offset_of!(Hit, t)),
                ("entry", offset_of!(Hit, entry)),
                ("geometry", offset_of!(Hit, geometry)),
                ("primitive", offset_of!(Hit, primitive)),
                ("front", offset_of!(Hit, front)),
                ("any_hits", offset_of!(Hit, any_hits)),
            ],
        );
    }
}

/// Returns the array strides in a module.
fn strides(module: &str) -> Vec<usize> {
    const OP_DECORATE: u32 = 71;
    const ARRAY_STRIDE: u32 = 6;
    let module = std::fs::read(shaders().join(module)).expect("the module is committed");
    let words: Vec<u32> =
        module.chunks_exact(4).map(|w| u32::from_le_bytes(w.try_into().expect("four bytes"))).collect();
    let mut rest = &words[5..];
    let mut strides = Vec::new();
    while let Some(&head) = rest.first() {
        let (instruction, later) = rest.split_at((head >> 16) as usize);
        if head & 0xffff == OP_DECORATE && instruction[2] == ARRAY_STRIDE {
            strides.push(instruction[3] as usize);
        }
        rest = later;
    }
    strides.sort_unstable();
    strides
}

#[test]
fn arrays_have_the_hosts_strides() {
    let words = size_of::<u32>();
    let alpha = [size_of::<[f32; 2]>(), size_of::<Ray>(), size_of::<AlphaGeometry>()];
    assert_eq!(strides("hits.rgen.spv"), [words, alpha[0], size_of::<Hit>(), alpha[1], alpha[2]]);
    assert_eq!(strides("timing.rgen.spv"), [words, words, alpha[0], alpha[1], alpha[2]]);
}

/// Another compiler version may emit different words for the same source; then only the interface is compared.
#[test]
fn the_committed_spirv_is_what_the_sources_give() {
    let version = Command::new("glslangValidator").arg("--version").output().expect("glslang-tools are installed");
    let version = String::from_utf8_lossy(&version.stdout).into_owned();
    let built = tempfile::tempdir().expect("a folder");
    let status = Command::new(shaders().join("build.sh")).arg(built.path()).status().expect("build.sh runs");
    assert!(status.success());
    let (committed, rebuilt) = (compiled_in(&shaders()), compiled_in(built.path()));
    assert_eq!(committed.keys().collect::<Vec<_>>(), rebuilt.keys().collect::<Vec<_>>());
    assert_eq!(committed.len(), 11);
    for (name, module) in &committed {
        assert_eq!(offsets(module), offsets(&rebuilt[name]), "{name}");
        if version.lines().next() == Some(COMPILER) {
            assert!(*module == rebuilt[name], "shaders/{name} is stale: run shaders/build.sh");
        }
    }
}
