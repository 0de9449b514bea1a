//! The text of OBJ files: encodings, line ends, comments, indices, and what is refused.

mod obj_support;

use obj_support::{
    attribute, list, objects, read, read_bytes, read_files, refusal, triangle_count, triangles, try_read, warnings,
};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

#[test]
fn triangle_becomes_one_node_one_mesh_and_one_primitive() {
    let document = read(TRIANGLE);
    assert_eq!(objects(&document), ["default"]);
    assert_eq!(attribute(&document, 0, 0, "POSITION"), [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(triangles(&document, 0, 0), [[0, 1, 2]]);
    assert_eq!(warnings(&document), "");
    assert_eq!(document.kind, raykiln_formats::document::Kind::Obj);
}

#[test]
fn empty_text_has_an_empty_scene_and_a_warning() {
    for text in ["", "\n", "# nothing\n", "v 0 0 0\n"] {
        let document = read(text);
        assert!(list(&document.json, "nodes").is_empty() && document.buffers.is_empty());
        assert_eq!(warnings(&document), "no faces\n");
    }
}

#[test]
fn line_ends_tabs_and_indents_do_not_matter() {
    let plain = read(TRIANGLE);
    let variants = [
        TRIANGLE.replace('\n', "\r\n"),
        TRIANGLE.replace('\n', "\r"),
        TRIANGLE.replace(' ', "\t"),
        TRIANGLE.replace(' ', "  "),
        TRIANGLE.replace('\n', " \n\n   "),
        TRIANGLE.trim_end().to_owned(),
        format!("\u{feff}{TRIANGLE}"),
        TRIANGLE.replace("1 2 3", "1 2 \\\n3").replace("1 0 0", "1 \\\r\n 0 0"),
        TRIANGLE.replace("\nf", " # a comment\nf").replace("2 3", "2 3 #4"),
        format!("{TRIANGLE}# C:\\last\\\n"),
        TRIANGLE.replace("v 0 0 0", "# path C:\\scenes\\\nv 0 0 0"),
        TRIANGLE.replace("f 1 2 3", "f -3 -2 -1"),
        TRIANGLE.replace("f 1 2 3", "fo 1// 2/ 3"),
        TRIANGLE.replace("v 1 0 0", "v 2 0 0 2"),
        TRIANGLE.replace("v 1 0 0", "v +1. .0 0e5"),
        // A single line feed among carriage returns, and the other way round.
        format!("# head\n{}", TRIANGLE.replace('\n', "\r")),
        TRIANGLE.replacen('\n', "\r", 1),
        TRIANGLE.to_uppercase(),
        TRIANGLE.replace("1 2 3", "1\\\n2 3\\ \n"),
        // A comma before another or at the end of a word only separates.
        TRIANGLE.replace("v 1 0 0", "v 1,0,0"),
        TRIANGLE.replace("v 1 0 0", "v 1, 0, 0"),
        TRIANGLE.replace("v 1 0 0", "v 1,0 0,0 0,0e0"),
        TRIANGLE.replace("v 1 0 0", "v 1.0D+00 0.d-1 0"),
        TRIANGLE.replace("f 1 2 3", "f 1.0 +2 3.0"),
    ];
    for text in variants {
        let document = read(&text);
        assert_eq!(document.json, plain.json, "{text:?}");
        assert_eq!(document.buffers, plain.buffers, "{text:?}");
        assert_eq!(warnings(&document), "", "{text:?}");
    }
}

#[test]
fn face_may_stand_before_its_vertices() {
    let document = read("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n");
    assert_eq!(triangle_count(&document), 1);
}

#[test]
fn negative_indices_count_from_where_the_face_stands() {
    let document = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -3\nv 5 5 5\nv 6 5 5\nv 5 6 5\nf -3 -2 1\n");
    assert_eq!(attribute(&document, 0, 0, "POSITION")[0], [0.0, 1.0, 0.0]);
    assert_eq!(attribute(&document, 0, 0, "POSITION")[3..], [[5.0, 5.0, 5.0], [6.0, 5.0, 5.0]]);
    assert_eq!(triangles(&document, 0, 0), [[0, 1, 2], [3, 4, 2]]);
}

#[test]
fn western_names_become_unicode_with_a_warning() {
    let document = read_bytes(b"g Terraind\xe6k\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_eq!(objects(&document), ["Terraindæk"]);
    assert!(warnings(&document).contains("windows-1252"));
}

#[test]
fn utf_16_with_a_byte_order_mark_is_read() {
    let units: Vec<u16> = TRIANGLE.encode_utf16().collect();
    let big: Vec<u8> = [0xFE, 0xFF].into_iter().chain(units.iter().flat_map(|unit| unit.to_be_bytes())).collect();
    let little: Vec<u8> = [0xFF, 0xFE].into_iter().chain(units.iter().flat_map(|unit| unit.to_le_bytes())).collect();
    assert_eq!(triangle_count(&read_bytes(&big)), 1);
    assert_eq!(triangle_count(&read_bytes(&little)), 1);
}

#[test]
fn utf_16_without_a_mark_is_told_by_its_zeros() {
    let units: Vec<u16> = TRIANGLE.encode_utf16().collect();
    let big: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
    let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
    assert_eq!(triangle_count(&read_bytes(&big)), 1);
    assert_eq!(triangle_count(&read_bytes(&little)), 1);
}

#[test]
fn code_pages_are_told_by_the_files_that_names_spell() {
    let cases: [(&[u8], &str); 3] =
        [(b"\xb5\xd8\xd0\xce", "地形"), (b"\x96\xd8\x96\xda", "木目"), (b"\xe4\xe5\xf0\xe5\xe2\xee", "дерево")];
    for (bytes, name) in cases {
        let obj = [b"mtllib ", bytes, b".mtl\nusemtl ", bytes, b"\n", TRIANGLE.as_bytes()].concat();
        let mtl = [b"newmtl ", bytes, b"\nKd 1 0 0\n"].concat();
        let document = read_files(&[("scene.obj", &obj), (&format!("{name}.mtl"), &mtl)]);
        assert_eq!(document.json["materials"][0]["name"], name);
        assert!(document.json["materials"][0]["pbrMetallicRoughness"].is_object(), "{name}");
    }
}

#[test]
fn names_may_end_in_a_backslash() {
    let document = read("v 0 0 0\nv 1 0 0\nv 0 1 0\ng C:\\roof\\\nf 1 2 3\n");
    assert_eq!(objects(&document), ["C:\\roof\\"]);
}

#[test]
fn files_compressed_by_gzip_are_read() {
    use std::io::Write;
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(TRIANGLE.as_bytes()).expect("memory");
    let packed = packed.finish().expect("memory");
    let document = raykiln_formats::read_bytes("scene.obj.gz", packed).expect("sound");
    assert_eq!(triangle_count(&document), 1);
}

#[test]
fn files_of_other_formats_are_named() {
    for (text, expected) in [
        ("version https://git-lfs.github.com/spec/v1\noid sha256:0f3c\nsize 48211093\n", "git lfs pull"),
        ("<!DOCTYPE html>\n<html></html>\n", "HTML"),
        ("ply\nformat ascii 1.0\n", "PLY"),
        ("{\"asset\": {\"version\": \"2.0\"}}", "rename it to end in .gltf"),
        ("this is no model\n", "no OBJ statement"),
    ] {
        let error = try_read(&[("scene.obj", text.as_bytes())]).expect_err("no OBJ");
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[test]
fn numbers_c_prints_for_nan_and_infinity_stay_in_the_data() {
    let document = read("v nan -nan nan(ind)\nv inf -inf 1e999\nv 1.#IND -1.#INF 1.#QNAN\nv 1 2 3\nf 1 2 3 4\n");
    let positions = attribute(&document, 0, 0, "POSITION");
    assert!(positions[0].iter().all(|x| x.is_nan()));
    assert_eq!(positions[1], [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY]);
    assert!(positions[2][0].is_nan() && positions[2][1] == f64::NEG_INFINITY && positions[2][2].is_nan());
    assert_eq!(triangle_count(&document), 2);
    assert_eq!(warnings(&document), "");
}

#[test]
fn what_makes_no_surface_is_left_out_and_counted() {
    let document = read(&format!("{TRIANGLE}curv 0 1 1 2\nbevel on\nvw 1 2\nf 1 2\nf\n"));
    assert_eq!(triangle_count(&document), 1);
    let expected = "line 5: free-form curves and surfaces left out\n\
        line 6: display attributes ignored\n\
        line 7: statements of unknown keyword ignored\n\
        line 8: faces of fewer than three corners left out (2 in all)\n";
    assert_eq!(warnings(&document), expected);
}

#[test]
fn malformed_statements_are_refused_with_their_line() {
    let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let cases = [
        ("f 1 2 4", "line 4: a face refers to vertex 4, the file has 3"),
        ("f 1 2 0", "line 4: a face refers to vertex 0; indices start at 1"),
        ("f 1 2 -4", "line 4: a face refers to vertex -4, with 3 before it"),
        ("f 1/1 2/2 3/3", "line 4: a face refers to texture coordinate 3, the file has 0"),
        ("f 1//7 2//7 3//7", "line 4: a face refers to normal 7, the file has 0"),
        ("f 1 2 x", "line 4: face corner `x` is not of the form v, v/vt, v//vn or v/vt/vn"),
        ("f 1 2 3/1/1/1", "line 4: face corner `3/1/1/1` is not of the form v, v/vt, v//vn or v/vt/vn"),
        ("f /1 2 3", "line 4: face corner `/1` is not of the form v, v/vt, v//vn or v/vt/vn"),
        ("f 1 2 99999999999999999999", "line 4: face corner `99999999999999999999` is not of the form"),
        ("f 1 2 -9223372036854775808", "line 4: a face refers to vertex -9223372036854775808, with 3 before it"),
        ("f 1 2 9223372036854775807", "line 4: a face refers to vertex 9223372036854775807, the file has 3"),
        ("v 1 2", "line 4: a vertex has three coordinates, this one 2"),
        ("\n\nv 1 2 z", "line 6: `z` is not a number"),
        ("v 1 2 3.1+e2", "line 4: `3.1+e2` is not a number"),
        ("v 1 2 3 0", "line 4: the weight of a vertex is zero"),
        ("v 1 2 3 w", "line 4: `w` is not a number"),
        ("v 1 2 3 1 1 r", "line 4: `r` is not a number"),
        ("vt", "line 4: a texture coordinate has at least one number, this one none"),
        ("vt 1 q", "line 4: `q` is not a number"),
        ("vn 1 2", "line 4: a normal has three coordinates, this one 2"),
        ("vn 1 2 n", "line 4: `n` is not a number"),
    ];
    for (line, expected) in cases {
        let message = refusal(&format!("{head}{line}\nf 1 2 3\n"));
        assert!(message.starts_with(expected), "{line:?}: {message}");
    }
}

#[test]
fn long_words_are_cut_in_messages() {
    assert!(refusal(&format!("v 1 2 {}\n", "é".repeat(5000))).len() < 200);
}

#[test]
fn missing_file_is_refused_by_name() {
    let error = try_read(&[]).expect_err("there is no file");
    assert!(error.to_string().contains("scene.obj"), "{error}");
}

#[test]
fn texture_coordinate_of_one_number_lies_at_the_bottom() {
    let document = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.25\nvt 0.5 0.25 9\nf 1/1 2/2 3/2\n");
    assert_eq!(attribute(&document, 0, 0, "TEXCOORD_0")[..2], [[0.25, 1.0], [0.5, 0.75]]);
}
