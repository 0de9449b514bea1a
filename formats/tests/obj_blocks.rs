//! Long OBJ files, which are read in blocks: a statement means the same wherever the blocks end.

mod obj_support;

use obj_support::{attribute, read, read_bytes, refusal, warnings};

/// Longer than a block.
const COMMENTS: usize = 12_000;

/// Comments that fill more than a block.
fn filler() -> String {
    format!("# {}\n", "=".repeat(100)).repeat(COMMENTS)
}

/// Holds a text against the same with comments of more than a block in place of each line `~`.
fn assert_same_when_long(text: &[u8]) {
    let with = |filling: &[u8]| text.split(|&byte| byte == b'~').collect::<Vec<_>>().join(filling);
    let (short, long) = (read_bytes(&with(b"\n")), read_bytes(&with(filler().as_bytes())));
    assert_eq!(short.json, long.json);
    assert_eq!(short.buffers, long.buffers);
    assert_eq!(warnings(&short), warnings(&long));
}

#[test]
fn indices_count_back_over_blocks() {
    assert_same_when_long(b"v 0 0 0\nv 1 0 0\n~v 0 1 0\nf -1 -2 -3\n~v 1 1 0\nf -1 -2 -3\nf 1 2 -1\n");
}

#[test]
fn faces_may_stand_blocks_before_their_vertices() {
    assert_same_when_long(b"f 1/1 2/1 3/1\n~v 0 0 0\nv 1 0 0\nv 0 1 0\n~vt 0 0\n");
}

#[test]
fn colours_of_one_block_leave_the_others_white() {
    assert_same_when_long(b"v 0 0 0\nv 1 0 0\nf 1 2 3\n~v 0 1 0 1 0 0\n~v 1 1 0\nf 2 3 4\n");
    assert_same_when_long(b"v 0 0 0 255 0 0\nv 1 0 0\nf 1 2 3\n~v 0 1 0 1 0 0\n~v 1 1 0\nf 2 3 4\n");
}

#[test]
fn objects_groups_and_materials_go_on_over_blocks() {
    let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\no a\ng b\nusemtl c\nf 1 2 3\n~f 3 2 1\ng d\n~f 1 2 3\no e\n~f 1 2 3\ng b\nf 1 2 3\no a\ng b\n~f 1 2 3\n";
    assert_same_when_long(text);
}

#[test]
fn one_byte_of_a_code_page_decides_for_all_blocks() {
    assert_same_when_long("g é\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n~g ".as_bytes());
    assert_same_when_long(b"g \xc3\xa9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n~g \xe9\nf 1 2 3\n");
}

#[test]
fn continued_lines_stay_whole() {
    let (vertex, count) = ("v 1 0 0\n", 200_000);
    let head = "v 0 0 0\nv 0 1 0\n";
    let text = |vertex: &str| read(&format!("{head}{}f 1 2 -1\n", vertex.repeat(count)));
    let plain = text(vertex);
    for continued in
        ["v 1 \\\n0 0\n", "v 1 0 \\\r\n\t0\r\n", "v 1 \\\n0 \\\n0\n", "v 1 0 0 \\\n\n", "v 1 0 0 \\\u{a0}\n\n\n"]
    {
        let document = text(continued);
        assert_eq!(document.json, plain.json, "{continued:?}");
        assert_eq!(document.buffers, plain.buffers, "{continued:?}");
    }
    assert_eq!(attribute(&plain, 0, 0, "POSITION").len(), 3);
}

#[test]
fn faults_name_their_line_in_later_blocks() {
    let head = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}", filler());
    let line = COMMENTS + 4;
    let cases = [
        ("v 1 2", "a vertex has three coordinates, this one 2"),
        ("v 1 2 x", "`x` is not a number"),
        ("f 1 2 0", "a face refers to vertex 0; indices start at 1"),
        ("f 1 2 9", "a face refers to vertex 9, the file has 3"),
        ("f 1 2 -4", "a face refers to vertex -4, with 3 before it"),
    ];
    for (statement, cause) in cases {
        let message = refusal(&format!("{head}{statement}\nf 1 2 3\n{}", filler()));
        assert_eq!(message, format!("line {line}: {cause}"), "{statement}");
    }
}

#[test]
fn first_fault_is_named_though_later_blocks_have_others() {
    let text = format!("{}f -1 -1 -1\n{}f 1 2 0\nv 1\n", filler(), filler());
    assert_eq!(refusal(&text), format!("line {}: a face refers to vertex -1, with 0 before it", COMMENTS + 1));
}

#[test]
fn warnings_name_their_line_in_later_blocks() {
    let document = read(&format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}foo\n{}bar\nf 1 2 3\n", filler(), filler()));
    assert!(document.warnings[0].place.ends_with(&format!("line {}", COMMENTS + 4)), "{:?}", document.warnings);
    assert!(warnings(&document).contains("(2 in all)"));
}
