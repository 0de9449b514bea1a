//! Triangles of primitives: modes, index types, layouts of positions.

use raykiln_formats::{Document, ReadOptions};
use serde_json::{Value, json};

use crate::support::{contents, floats, primitive, refusal, shorts, square, triangle, triangles, words};

fn positions(count: usize) -> Value {
    json!({ "componentType": 5126, "count": count, "type": "VEC3" })
}

fn indices(component: u32, count: usize) -> Value {
    json!({ "componentType": component, "count": count, "type": "SCALAR" })
}

/// A primitive of the unit square's corners with some indices.
fn indexed(mode: u32, component: u32, count: usize, data: Vec<u8>) -> Document {
    let json = json!({ "attributes": { "POSITION": 0 }, "indices": 1, "mode": mode });
    primitive(json, &[(positions(4), square()), (indices(component, count), data)])
}

fn unindexed(mode: u32, count: usize) -> Document {
    let line: Vec<f32> = (0..3 * count).map(|i| i as f32).collect();
    primitive(json!({ "attributes": { "POSITION": 0 }, "mode": mode }), &[(positions(count), floats(&line))])
}

fn first_warning(doc: &Document) -> String {
    contents(doc).warnings[0].to_string()
}

#[test]
fn every_index_type_is_read() {
    let order = [0_u16, 1, 2, 2, 1, 3];
    let bytes = order.iter().map(|i| *i as u8).collect();
    let wide: Vec<u32> = order.iter().map(|i| u32::from(*i)).collect();
    for (component, data) in [(5121, bytes), (5123, shorts(&order)), (5125, words(&wide))] {
        assert_eq!(triangles(&indexed(4, component, 6, data)).corners, [[0, 1, 2], [2, 1, 3]]);
    }
}

#[test]
fn without_indices_vertices_count_in_order() {
    assert_eq!(triangles(&unindexed(4, 6)).corners, [[0, 1, 2], [3, 4, 5]]);
}

#[test]
fn strips_alternate_their_winding() {
    assert_eq!(triangles(&unindexed(5, 5)).corners, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
    let doc = indexed(5, 5123, 4, shorts(&[3, 2, 1, 0]));
    assert_eq!(triangles(&doc).corners, [[3, 2, 1], [2, 0, 1]]);
}

#[test]
fn degenerate_strip_triangles_stay() {
    let doc = indexed(5, 5123, 5, shorts(&[0, 1, 1, 2, 3]));
    assert_eq!(triangles(&doc).corners, [[0, 1, 1], [1, 2, 1], [1, 2, 3]]);
}

#[test]
fn fans_turn_around_their_first_vertex() {
    assert_eq!(triangles(&unindexed(6, 5)).corners, [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
}

#[test]
fn strips_and_fans_of_two_vertices_have_no_triangle() {
    for mode in [5, 6] {
        assert!(triangles(&unindexed(mode, 2)).corners.is_empty());
    }
}

#[test]
fn points_and_lines_have_no_triangles() {
    for mode in 0..4 {
        let c = contents(&unindexed(mode, 4));
        assert_eq!(c.meshes[0].primitives[0].triangles, None);
        assert!(c.warnings.is_empty());
    }
}

#[test]
fn an_unknown_mode_is_refused() {
    let error = refusal(&unindexed(7, 4));
    assert_eq!((error.place.as_str(), error.cause.as_str()), ("meshes[0].primitives[0].mode", "there is no mode 7"));
}

#[test]
fn corners_beyond_the_last_whole_triangle_are_ignored_with_a_warning() {
    let doc = unindexed(4, 5);
    assert_eq!(triangles(&doc).corners, [[0, 1, 2]]);
    assert!(first_warning(&doc).contains("5 corners do not make whole triangles"));
}

#[test]
fn indices_past_the_vertices_are_refused() {
    let error = refusal(&indexed(4, 5125, 3, words(&[0, 4, 1])));
    assert_eq!((error.place.as_str(), error.cause.as_str()), ("accessors[1]", "index 4 is past the 4 vertices"));
    let error = refusal(&indexed(1, 5121, 2, vec![0, 9]));
    assert_eq!(error.cause, "index 9 is past the 4 vertices");
}

#[test]
fn the_primitive_restart_index_is_refused() {
    let json = json!({ "attributes": { "POSITION": 0 }, "indices": 1, "mode": 5 });
    let many = floats(&vec![0.5; 3 * 256]);
    let doc = primitive(json, &[(positions(256), many), (indices(5121, 4), vec![0, 1, 255, 3])]);
    assert!(refusal(&doc).cause.contains("index 255 means primitive restart"));
}

#[test]
fn signed_or_vector_indices_are_refused() {
    assert!(refusal(&indexed(4, 5122, 3, shorts(&[0, 1, 2]))).cause.contains("must be SCALAR"));
    let mut doc = indexed(4, 5123, 3, shorts(&[0, 1, 2, 0, 1, 2, 0, 1, 2]));
    doc.json["accessors"][1]["type"] = "VEC3".into();
    assert!(refusal(&doc).cause.contains("must be SCALAR"));
}

#[test]
fn a_primitive_without_positions_has_no_triangles_and_a_warning() {
    let doc = primitive(json!({ "attributes": { "_WEIGHT": 0 } }), &[(positions(3), floats(&[0.0; 9]))]);
    assert_eq!(contents(&doc).meshes[0].primitives[0].triangles, None);
    assert!(first_warning(&doc).contains("has no POSITION attribute"));
}

#[test]
fn attributes_of_different_length_are_refused() {
    let json = json!({ "attributes": { "POSITION": 0, "NORMAL": 1 } });
    let doc = primitive(json, &[(positions(3), floats(&[0.0; 9])), (positions(4), square())]);
    let error = refusal(&doc);
    assert_eq!(error.place, "meshes[0].primitives[0].attributes.NORMAL");
    assert_eq!(error.cause, "4 vertices, but POSITION has 3");
}

#[test]
fn positions_of_another_shape_are_refused() {
    for (key, value) in [("type", json!("VEC2")), ("componentType", json!(5125))] {
        let mut doc = triangle();
        doc.json["accessors"][0][key] = value;
        let error = refusal(&doc);
        assert_eq!(error.place, "accessors[0]");
        assert!(error.cause.contains("positions must be VEC3"));
    }
}

#[test]
fn interleaved_positions_are_read() {
    let rows = [[0.0, 0.0, 0.0, 9.0], [1.0, 2.0, 3.0, 9.0], [4.0, 5.0, 6.0, 9.0]].concat();
    let mut doc =
        primitive(json!({ "attributes": { "POSITION": 0 } }), &[(positions(3), floats(&rows)[..44].to_vec())]);
    doc.json["bufferViews"][0]["byteStride"] = 16.into();
    assert_eq!(*triangles(&doc).positions, [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
}

#[test]
fn quantised_positions_are_dequantised() {
    let read = |component: u32, normalized: bool, data: Vec<u8>| {
        let accessor = json!({ "componentType": component, "count": 3, "type": "VEC3", "normalized": normalized });
        triangles(&primitive(json!({ "attributes": { "POSITION": 0 } }), &[(accessor, data)])).positions[0]
    };
    let bytes = |first: [i8; 3]| first.iter().chain(&[0; 6]).map(|b| b.to_le_bytes()[0]).collect::<Vec<u8>>();
    let wide = |first: [i16; 3]| first.iter().chain(&[0; 6]).flat_map(|b| b.to_le_bytes()).collect::<Vec<u8>>();
    assert_eq!(read(5120, false, bytes([-128, 127, 3])), [-128.0, 127.0, 3.0]);
    assert_eq!(read(5120, true, bytes([-128, 127, -127])), [-1.0, 1.0, -1.0]);
    assert_eq!(read(5121, false, bytes([-1, 0, 7])), [255.0, 0.0, 7.0]);
    assert_eq!(read(5121, true, bytes([-1, 0, 51])), [1.0, 0.0, 0.2]);
    assert_eq!(read(5122, false, wide([-32768, 32767, 5])), [-32768.0, 32767.0, 5.0]);
    assert_eq!(read(5122, true, wide([-32768, 32767, 0])), [-1.0, 1.0, 0.0]);
    assert_eq!(read(5123, false, wide([-1, 0, 9])), [65535.0, 0.0, 9.0]);
    assert_eq!(read(5123, true, wide([-1, 0, 13107])), [1.0, 0.0, 0.2]);
}

fn with_nan() -> Document {
    let mut points = vec![0.0; 27];
    (points[9], points[26]) = (f32::NAN, f32::INFINITY);
    primitive(json!({ "attributes": { "POSITION": 0 } }), &[(positions(9), floats(&points))])
}

#[test]
fn triangles_with_a_corner_that_is_not_finite_are_dropped_and_counted() {
    let doc = with_nan();
    let t = triangles(&doc);
    assert_eq!((t.corners, t.kept), (vec![[0, 1, 2]], Some(vec![0])));
    assert_eq!(
        first_warning(&doc),
        "meshes[0].primitives[0]: 2 triangles with a corner that is not finite are left out"
    );
}

#[test]
fn strict_reading_refuses_corners_that_are_not_finite() {
    let error = with_nan().contents(ReadOptions::default().with_strict(true)).unwrap_err();
    assert_eq!(error.place, "accessors[0]");
    assert!(error.cause.contains("not finite"));
}

#[test]
fn vertices_that_no_triangle_uses_may_be_anything() {
    let json = json!({ "attributes": { "POSITION": 0 }, "indices": 1 });
    let mut data = square();
    data[36..40].copy_from_slice(&f32::NAN.to_le_bytes());
    let doc = primitive(json, &[(positions(4), data), (indices(5123, 3), shorts(&[0, 1, 2]))]);
    let c = doc.contents(ReadOptions::default().with_strict(true)).unwrap();
    assert_eq!(c.meshes[0].primitives[0].triangles.as_ref().unwrap().kept, None);
}

#[test]
fn morph_targets_are_noticed_and_checked() {
    let mut doc = triangle();
    doc.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 0 }]);
    assert!(contents(&doc).meshes[0].primitives[0].morphed);
    doc.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 5 }]);
    let error = refusal(&doc);
    assert_eq!(error.place, "meshes[0].primitives[0].targets[0].POSITION");
    assert_eq!(error.cause, "accessors[5] does not exist; there are 1 accessors");
}

#[test]
fn a_primitive_of_no_vertices_has_no_triangles() {
    let doc = primitive(json!({ "attributes": { "POSITION": 0 } }), &[(positions(0), Vec::new())]);
    assert!(triangles(&doc).corners.is_empty());
}

#[test]
fn materials_of_primitives_exist() {
    let mut doc = triangle();
    doc.json["meshes"][0]["primitives"][0]["material"] = 0.into();
    assert_eq!(refusal(&doc).cause, "materials[0] does not exist; there are 0 materials");
    doc.json["materials"] = json!([{}]);
    assert_eq!(contents(&doc).meshes[0].primitives[0].material, Some(0));
}

#[test]
fn vertices_shared_too_widely_are_refused_before_any_is_read() {
    let mut doc = triangle();
    doc.json["accessors"][0]["count"] = 2_000_000.into();
    let primitive = doc.json["meshes"][0]["primitives"][0].clone();
    doc.json["meshes"][0]["primitives"] = vec![primitive; 1000].into();
    let error = refusal(&doc);
    assert_eq!(error.place, "meshes");
    assert!(error.cause.contains("666666000 triangles in all"), "{}", error.cause);
}
