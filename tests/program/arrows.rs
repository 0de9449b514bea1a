//! The modules of `src/` and what they use of each other: dependencies follow one order, so there is no cycle.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Every folder and file directly below `src/`, in the order of ARCHITECTURE.md: each uses only those after it.
const ROOMS: [&str; 20] = [
    "main", "cli", "lab", "commands", "report", "render", "choose", "emit", "copies", "motion", "verify", "methods",
    "cost", "layout", "tree", "scene", "cache", "words", "parallel", "lib",
];

/// Whether a file is compiled only for tests.
fn is_for_tests(file: &Path) -> bool {
    let name = |part: &std::ffi::OsStr| part.to_string_lossy().into_owned();
    let stem = file.file_stem().map(name).unwrap_or_default();
    stem.starts_with("test") || file.iter().map(name).any(|folder| folder == "tests")
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a readable folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") && !is_for_tests(&path) {
            found.push(path);
        }
    }
}

/// The modules that a file names as `crate::ROOM`, excluding comments and unit tests.
fn rooms_named(text: &str) -> BTreeSet<String> {
    let lines: Vec<&str> = text.lines().collect();
    let opens_tests =
        |pair: &[&str]| pair[0] == "#[cfg(test)]" && pair[1].starts_with("mod ") && pair[1].ends_with('{');
    let end = lines.windows(2).position(opens_tests).unwrap_or(lines.len());
    let code: String =
        lines[..end].iter().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n");
    let after = code.split("crate::").skip(1);
    after.map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()).collect()
}

/// For each pair of modules, the files of the first that use the second.
fn arrows() -> BTreeMap<(String, String), BTreeSet<String>> {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&top, &mut files);
    assert!(files.len() > 100, "{} files", files.len());
    let mut arrows: BTreeMap<(String, String), BTreeSet<String>> = BTreeMap::new();
    for file in files {
        let place = file.strip_prefix(&top).expect("below src").to_owned();
        let first = Path::new(place.iter().next().expect("a name"));
        let room = first.file_stem().expect("a name").to_string_lossy().into_owned();
        assert!(ROOMS.contains(&room.as_str()), "src/{room} is missing in ROOMS");
        for used in rooms_named(&std::fs::read_to_string(&file).expect("text")) {
            if used != room && ROOMS.contains(&used.as_str()) {
                arrows.entry((room.clone(), used)).or_default().insert(place.display().to_string());
            }
        }
    }
    arrows
}

#[test]
fn arrows_between_rooms_run_one_way() {
    let floor = |room: &str| ROOMS.iter().position(|r| *r == room).expect("a room");
    let arrows = arrows();
    for ((room, used), files) in &arrows {
        println!("{room} -> {used}: {} files", files.len());
    }
    let up = arrows.iter().filter(|((room, used), _)| floor(used) < floor(room) && room != "lib");
    let up: Vec<String> = up.map(|((room, used), files)| format!("{room} -> {used}: {files:?}")).collect();
    assert!(up.is_empty(), "dependencies against the order: {up:#?}");
    assert!(arrows.contains_key(&("commands".to_owned(), "choose".to_owned())), "no dependency was found");
}

#[test]
fn a_file_names_the_rooms_that_its_code_uses_and_no_more() {
    let text = "use crate::scene::Scene;\n// crate::cli\nfn f() { crate::tree::x() }\n#[cfg(test)]\nmod tests {\nuse crate::lab;\n}";
    assert_eq!(rooms_named(text), BTreeSet::from(["scene".to_owned(), "tree".to_owned()]));
}
