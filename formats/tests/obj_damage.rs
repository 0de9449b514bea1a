//! Damaged OBJ files: what is left out, counted and named, and what is refused.

mod obj_support;

use obj_support::{attribute, list, primitive, read, refusal, triangle_count, try_read, warnings};

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn bad_faces_are_left_out_and_the_first_is_named() {
    for (bad, cause) in [
        ("f 1 2 999", "a face refers to vertex 999, the file has 3"),
        ("f 1 2 0", "a face refers to vertex 0; indices start at 1"),
        ("f 1 2 -9", "a face refers to vertex -9, with 3 before it"),
        ("f 1 2 x", "face corner `x` is not of the form v, v/vt, v//vn or v/vt/vn"),
    ] {
        let text = format!("{CORNERS}f 1 2 3\n{bad}\n{bad}\n");
        let document = read(&text);
        assert_eq!(triangle_count(&document), 1);
        assert_eq!(warnings(&document), format!("line 5: {cause}: the face is left out (2 in all)\n"));
        assert_eq!(refusal(&text), format!("line 5: {cause}"));
    }
}

#[test]
fn nothing_but_bad_faces_is_refused() {
    for (faces, message) in [
        ("f 1 2 4\nf 1 2 0\n", "line 4: a face refers to vertex 4, the file has 3"),
        ("l 1 2\nf 0 1 2\n", "line 5: a face refers to vertex 0; indices start at 1"),
    ] {
        let error = try_read(&[("scene.obj", format!("{CORNERS}{faces}").as_bytes())]);
        assert!(error.expect_err("no face").to_string().ends_with(message), "{faces}");
    }
}

#[test]
fn faces_before_their_vertices_are_no_damage() {
    let document = read(&format!("f 1 2 3\n{CORNERS}f 1 2 4\nf 1 2 5\nv 1 1 0\n"));
    assert_eq!(triangle_count(&document), 2);
    assert_eq!(document.warnings.len(), 1);
}

#[test]
fn normals_and_texture_coordinates_that_are_not_there_count_as_missing() {
    for (faces, kind) in [
        ("f 1/1 2/2 3/3\n", "texture coordinate 3"),
        ("vt 0 0\nf 1/1 2/2 3/2\n", "texture coordinate 2"),
        ("vn 0 0 1\nf 1//1 2//1 3//0\n", "normal 0"),
        ("vn 0 0 1\nf 1//1 2//1 3//-5\n", "normal -5"),
        ("vn 0 0 1\nf 1//9 2//9 3//9\n", "normal 9"),
    ] {
        let text = format!("{CORNERS}{faces}");
        let document = read(&text);
        assert_eq!(triangle_count(&document), 1);
        let attributes = primitive(&document, 0, 0)["attributes"].as_object().expect("attributes");
        assert_eq!(attributes.len(), 1, "{faces}");
        assert!(warnings(&document).contains(": it counts as missing"), "{faces}");
        assert!(refusal(&text).contains(kind), "{faces}");
    }
}

#[test]
fn malformed_normals_and_texture_coordinates_count_as_missing() {
    let document = read(&format!("{CORNERS}vt 1 q\nvn 1 2\nvn 1 2 n\nf 1/1/1 2/1/2 3/1/1\n"));
    assert_eq!(primitive(&document, 0, 0)["attributes"].as_object().map(serde_json::Map::len), Some(1));
    assert_eq!(warnings(&document), "line 4: malformed texture coordinates and normals count as missing (3 in all)\n");
}

#[test]
fn malformed_positions_are_refused() {
    let error = try_read(&[("scene.obj", format!("{CORNERS}v 1 2 x\nf 1 2 3\n").as_bytes())]);
    assert!(error.expect_err("no position").to_string().ends_with("line 4: `x` is not a number"));
}

#[test]
fn lines_and_points_are_kept_and_counted() {
    let document = read(&format!("{CORNERS}f 1 2 3\nl 1 2 3\np 1 2\nl 1 9\nl -1/4 -2/4\n"));
    let modes: Vec<_> = (0..3).map(|mesh| primitive(&document, mesh, 0)["mode"].as_u64()).collect();
    assert_eq!(modes, [None, Some(1), Some(0)]);
    assert_eq!(attribute(&document, 1, 0, "POSITION").len(), 3);
    let indices = |mesh: usize| obj_support::numbers(&document, &primitive(&document, mesh, 0)["indices"]).len();
    assert_eq!((indices(1), indices(2)), (6, 2));
    let expected = "line 5: lines (l) are kept as lines, which rays do not hit (2 in all)\n\
        line 6: points (p) are kept as points, which rays do not hit\n\
        line 7: lines and points that refer to no vertex left out\n";
    assert_eq!(warnings(&document), expected);
}

#[test]
fn objects_of_one_name_are_as_many_objects() {
    let document = read(&format!("{CORNERS}o a\nf 1 2 3\no b\nf 1 2 3\no a\nf 3 2 1\n"));
    let names: Vec<_> = list(&document.json, "nodes").iter().map(|node| node["name"].as_str()).collect();
    assert_eq!(names, [Some("a"), Some("b"), Some("a")]);
}
