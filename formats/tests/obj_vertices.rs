//! Vertices of OBJ files: shared corners, normals, texture coordinates, colours.

mod obj_support;

use obj_support::{attribute, list, primitive, read, triangles, warnings};

const POINTS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n";

/// The linear value of an sRGB component above 0.04045, as stored.
fn linear(srgb: f32) -> f64 {
    f64::from(((f64::from(srgb) + 0.055) / 1.055).powf(2.4) as f32)
}

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
    assert_eq!(attribute(&document, 0, 0, "COLOR_0"), [[1.0, 1.0, 1.0], [0.0, linear(0.5), 1.0], [1.0, 1.0, 1.0]]);
    assert!(primitive(&document, 1, 0)["attributes"]["COLOR_0"].is_null());
    assert_eq!(warnings(&document), "");
}

#[test]
fn whole_vertex_colors_up_to_255_are_bytes() {
    let document = read("v 0 0 0 255 0 51\nv 1 0 0 0 0 0\nv 0 1 0 255 255 255\nf 1 2 3\n");
    assert_eq!(attribute(&document, 0, 0, "COLOR_0")[0], [1.0, 0.0, linear(0.2)]);
}

#[test]
fn vertex_colors_out_of_range_are_cut_with_a_warning() {
    let document = read("v 0 0 0 1.5 -1 0.5\nv 1 0 0 0 0 nan\nv 0 1 0 1 1 1\nf 1 2 3\n");
    assert_eq!(attribute(&document, 0, 0, "COLOR_0")[..2], [[1.0, 0.0, linear(0.5)], [1.0, 1.0, 1.0]]);
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

/// The positions of a node's mesh in the coordinates of the file, stored and with the residuals added.
fn placed(document: &raykiln_formats::Document, node: usize) -> Vec<[[f64; 3]; 2]> {
    let contents = document.contents(raykiln_formats::ReadOptions::default()).expect("sound contents");
    let node = &contents.nodes[node];
    let triangles = contents.meshes[node.mesh.expect("a mesh")].primitives[0].triangles.as_ref().expect("triangles");
    let residual = |i: usize| triangles.residuals.as_ref().map_or([0.0; 3], |r| r[i].to_array());
    let place = |(i, p): (usize, &[f32; 3])| {
        let stored = glam::DVec3::from_array(p.map(f64::from));
        let exact = stored + glam::DVec3::from_array(residual(i).map(f64::from));
        assert_eq!(exact.as_vec3().to_array(), *p, "the sum rounds to what is stored");
        [stored, exact].map(|p| node.local.transform_point3(p).to_array())
    };
    triangles.positions.iter().enumerate().map(place).collect()
}

fn largest_difference(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn far_from_the_origin_positions_are_stored_around_the_middle() {
    let points =
        [[448731.257, 5411264.803, 287.41], [448733.057, 5411264.803, 287.46], [448731.257, 5411267.203, 288.1]];
    let line = |[x, y, z]: &[f64; 3]| format!("v {x} {y} {z}\n");
    let document = read(&format!("o kerb\n{}f 1 2 3\n", points.iter().map(line).collect::<String>()));
    let translation = list(&document.json["nodes"][0], "translation");
    assert!(translation.iter().all(|x| x.as_f64().is_some_and(|x| f64::from(x as f32) == x)), "{translation:?}");
    for ([stored, exact], point) in placed(&document, 0).into_iter().zip(points) {
        assert!(largest_difference(stored, point) < 2e-7, "{stored:?} {point:?}");
        assert!(largest_difference(exact, point) < 2e-9, "{exact:?} {point:?}");
    }
}

#[test]
fn two_materials_of_one_surface_share_a_translation_and_the_bits_of_their_seam() {
    let points = "v 500000.1 33.3 7.7\nv 500000.3 33.3 7.7\nv 500000.1 33.9 7.8\nv 500000.7 33.9 7.9\n";
    let apart = "v 500100.1 33.3 7.7\nv 500100.2 33.3 7.7\nv 500100.1 33.4 7.8\n";
    // The seam is written out twice: positions weld by their value.
    let again = "v 500000.3 33.3 7.7\nv 500000.1 33.9 7.80\n";
    let faces = "usemtl a\nf 1 2 3\nusemtl b\nf 8 4 9\nusemtl c\nf 5 6 7\n";
    let document = read(&format!("o wall\n{points}{apart}{again}{faces}"));
    let nodes = list(&document.json, "nodes");
    let translation = |material: &str| {
        let node = nodes.iter().find(|n| n["name"] == format!("wall/{material}")).expect("a node of the material");
        node["translation"].clone()
    };
    assert_eq!(translation("a"), translation("b"));
    assert_ne!(translation("a"), translation("c"));
    assert!(translation("a").is_array() && translation("c").is_array());
    let [a, b] = [0, 1].map(|mesh| attribute(&document, mesh, 0, "POSITION"));
    assert_eq!((&a[1], &a[2]), (&b[0], &b[2]));
}

#[test]
fn around_the_origin_nodes_have_no_translation() {
    let document = read("v -0.1 0.2 0.3\nv 1.1 -0.7 0.9\nv 0.3 1.3 0.1\nf 1 2 3\n");
    assert!(document.json["nodes"][0]["translation"].is_null());
    assert_eq!(placed(&document, 0)[0][0], [-0.1f32, 0.2, 0.3].map(f64::from));
    assert!(largest_difference(placed(&document, 0)[0][1], [-0.1, 0.2, 0.3]) < 1e-15);
}

#[test]
fn decimals_that_floats_hold_leave_no_residual() {
    let document = read(&format!("{POINTS}f 1 2 3\n"));
    assert_eq!(document.residuals, Default::default());
}

#[test]
fn positions_beyond_single_precision_are_left_out_with_a_warning() {
    let document = read(&format!("{POINTS}v 1e39 0 0\nv 0 -1e300 0.1\nf 1 2 3\nf 2 3 5\nf 3 4 6\n"));
    let message = "positions beyond 3.4e38, the largest 32-bit float: their triangles are left out (2 in all)\n";
    assert_eq!(warnings(&document), message);
    assert!(document.json["nodes"][0]["translation"].is_null());
    let contents = document.contents(raykiln_formats::ReadOptions::default()).expect("sound contents");
    let triangles = contents.meshes[0].primitives[0].triangles.as_ref().expect("triangles");
    assert_eq!(triangles.corners, [[0, 1, 2]]);
    assert!(
        contents.warnings[0].message.contains("2 triangles with a corner that is not finite"),
        "{:?}",
        contents.warnings
    );
    let strict = raykiln_formats::ReadOptions::default().with_strict(true);
    assert!(document.contents(strict).is_err());
}

#[test]
fn weights_divide_in_double_precision() {
    let document = read("v 1500000.3 3 3 3\nv 500000.3 1 1\nv 500000.1 1 2\nf 1 2 3\n");
    let [_, exact] = placed(&document, 0)[0];
    assert!(largest_difference(exact, [1500000.3 / 3.0, 1.0, 1.0]) < 1e-10, "{exact:?}");
}
