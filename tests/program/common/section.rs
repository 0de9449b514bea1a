//! Sections of the documentation that are generated.

use std::fs;
use std::path::Path;

/// Asserts that a section of a file, between the comments `<!-- NAME -->` and `<!-- end of NAME -->`, is as expected.
/// With `RAYKILN_WRITE_DOCS=1` it is written instead.
pub(crate) fn assert_section(file: &str, name: &str, expected: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let text = fs::read_to_string(&path).expect("the file is there");
    let marks = [format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->")];
    let (before, rest) = text.split_once(&marks[0]).unwrap_or_else(|| panic!("{file} has no section {name}"));
    let (found, after) = rest.split_once(&marks[1]).unwrap_or_else(|| panic!("the section {name} does not end"));
    if std::env::var_os("RAYKILN_WRITE_DOCS").is_some() {
        let written = format!("{before}{}\n{expected}\n{}{after}", marks[0], marks[1]);
        fs::write(&path, written).expect("the file is writable");
    } else {
        assert_eq!(found.trim(), expected.trim(), "{file}, {name}: RAYKILN_WRITE_DOCS=1 writes it");
    }
}
