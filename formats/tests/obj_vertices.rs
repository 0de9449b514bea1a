//! Vertices of OBJ files: shared corners, normals, texture coordinates, colours.

mod obj_support;

use obj_support::{attribute, list, primitive, read, triangles, warnings};

const POINTS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n";

#[test]
fn equal_triples_share_a_vertex_in_order_of_first_use() {
    let text = format!("{POINTS}vt 0 0\nvt 1 0\nvn 0 0 1\nf 2/1/1 3/1/1 1/1/1\nf 2/1/1 3/2/1 4/1/1\n");
    let document = read(&text);
    assert_eq!(triangles(&document, 0, 0), [[0, 1, 2], [0, 3, 4]]);
    let expected = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    assert_eq!(attribute(&document, 0, 0, "POSITION"), expected);
}

#[test]
fn positions_are_the_nearest_floats_to_the_decimals() {
    let document = read("v 0.1 16777217 1e-45\nv 3.4028235e38 -0.3 1e30\nv 1 1 1\nf 1 2 3\n");
    let expected = [[0.1_f32, 16777216.0, 1e-45], [f32::MAX, -0.3, 1e30]];
    assert_eq!(attribute(&document, 0, 0, "POSITION")[..2], expected.map(|p| p.map(f64::from)));
}

#[test]
fn texture_coordinates_are_counted_from_the_top() {
    let document = read(&format!("{POINTS}vt 0.25 0.75\nf 1/1 2/1 3/1\n"));
    assert_eq!(attribute(&document, 0, 0, "TEXCOORD_0")[0], [0.25, 0.25]);
}

#[test]
fn normals_get_unit_length() {
    let document = read(&format!("{POINTS}vn 0 0 4\nvn 3e30 0 0\nvn 0 -1e-30 0\nf 1//1 2//2 3//3\n"));
    let expected = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]];
    assert_eq!(attribute(&document, 0, 0, "NORMAL"), expected);
}

#[test]
fn faces_that_differ_in_what_they_have_make_primitives_of_one_mesh() {
    let faces = "f 1/1/1 2/1/1 3/1/1\nf 1 2 3\nf 1//1 2//1 3//1\nf 1/1 2/1 3/1\nf 2/1/1 3/1/1 4/1/1\n";
    let document = read(&format!("{POINTS}vt 0.5 0.5\nvn 0 0 1\n{faces}"));
    assert_eq!(list(&document.json, "nodes").len(), 1);
    assert_eq!(list(&document.json["meshes"][0], "primitives").len(), 4);
    let has = |at: usize, name: &str| primitive(&document, 0, at)["attributes"][name].is_u64();
    let have: Vec<_> = (0..4).map(|at| (has(at, "TEXCOORD_0"), has(at, "NORMAL"))).collect();
    assert_eq!(have, [(true, true), (false, false), (false, true), (true, false)]);
    assert_eq!(triangles(&document, 0, 0).len(), 2);
}

#[test]
fn face_lacks_what_one_of_its_corners_lacks() {
    let document = read(&format!("{POINTS}vt 0.5 0.5\nvn 0 0 1\nf 1/1/1 2//1 3/1/1\nf 1/1 2/1/1 4/1/1\n"));
    let names = |at: usize| {
        let attributes = primitive(&document, 0, at)["attributes"].as_object().expect("attributes");
        attributes.keys().cloned().collect::<Vec<_>>()
    };
    assert_eq!(names(0), ["POSITION", "NORMAL"]);
    assert_eq!(names(1), ["POSITION", "TEXCOORD_0"]);
    assert_eq!(attribute(&document, 0, 0, "POSITION").len(), 3);
}

#[test]
fn normal_without_direction_and_texture_coordinate_that_is_no_number_count_as_missing() {
    let document = read(&format!("{POINTS}vt nan 0\nvn 0 0 0\nvn inf 0 0\nf 1/1/1 2/1/1 3/1/1\nf 1//2 2//2 3//2\n"));
    assert_eq!(list(&document.json["meshes"][0], "primitives").len(), 1);
    assert_eq!(primitive(&document, 0, 0)["attributes"].as_object().map(|a| a.len()), Some(1));
}

#[test]
fn vertex_colors_stay_with_their_vertices_and_white_fills_gaps() {
    let text = "v 0 0 0\nv 1 0 0 0 0.5 1\nv 0 1 0\nv 1 1 0 0.25 0.5 0.75 1\nf 1 2 3\ng bare\nf 1 3 1\n";
    let document = read(text);
    assert_eq!(attribute(&document, 0, 0, "COLOR_0"), [[1.0, 1.0, 1.0], [0.0, 0.5, 1.0], [1.0, 1.0, 1.0]]);
    assert!(primitive(&document, 1, 0)["attributes"]["COLOR_0"].is_null());
    assert_eq!(warnings(&document), "line 4: vertices with extra numbers: only coordinates and colour are read\n");
}

#[test]
fn whole_vertex_colors_up_to_255_are_bytes() {
    let document = read("v 0 0 0 255 0 51\nv 1 0 0 0 0 0\nv 0 1 0 255 255 255\nf 1 2 3\n");
    assert_eq!(attribute(&document, 0, 0, "COLOR_0")[0], [1.0, 0.0, f64::from(0.2_f32)]);
}

#[test]
fn vertex_colors_out_of_range_are_cut_with_a_warning() {
    let document = read("v 0 0 0 1.5 -1 0.5\nv 1 0 0 0 0 nan\nv 0 1 0 1 1 1\nf 1 2 3\n");
    assert_eq!(attribute(&document, 0, 0, "COLOR_0")[..2], [[1.0, 0.0, 0.5], [1.0, 1.0, 1.0]]);
    assert_eq!(warnings(&document), "vertex colours above 1 are cut to 1\n");
}

#[test]
fn indices_are_short_up_to_65535_vertices() {
    for (count, component) in [(65535, 5123), (65538, 5125)] {
        let points: String = (0..count).map(|i| format!("v {i} 0 {}\n", i % 7)).collect();
        let faces: String = (0..count / 3).map(|i| format!("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3)).collect();
        let document = read(&format!("{points}{faces}"));
        let accessor = primitive(&document, 0, 0)["indices"].as_u64().expect("an index") as usize;
        assert_eq!(document.json["accessors"][accessor]["componentType"], component);
        assert_eq!(triangles(&document, 0, 0).last(), Some(&[count - 3, count - 2, count - 1]));
    }
}

#[test]
fn many_normals_at_one_vertex_stay_fast() {
    let normals: String = (0..60_000).map(|i| format!("vn 1 {i} 0\n")).collect();
    let faces: String = (1..=60_000).map(|i| format!("f 1//{i} 2//{i} 3//{i}\n")).collect();
    let document = read(&format!("{POINTS}{normals}{faces}"));
    assert_eq!(triangles(&document, 0, 0).len(), 60_000);
}
