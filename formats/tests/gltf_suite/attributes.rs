//! Accessors: ranges, sparse values, random access, new ones.

use std::borrow::Cow;
use std::sync::Arc;

use raykiln_formats::Document;
use raykiln_formats::contents::Hold;
use raykiln_formats::document::{Component, Element};
use raykiln_formats::edit::{NewAccessor, Target};
use serde_json::{Value, json};

use crate::support::{contents, document, floats, refusal, shorts, triangle, triangle_bytes, triangle_json, triangles};

const VEC3: Element = Element { component: Component::F32, components: 3, normalized: false };
const U16: Element = Element { component: Component::U16, components: 1, normalized: false };

/// The error after a change of the JSON of one triangle, as "place: cause".
fn broken(change: impl FnOnce(&mut Value)) -> String {
    let mut doc = triangle();
    change(&mut doc.json);
    let error = refusal(&doc);
    format!("{}: {}", error.place, error.cause)
}

#[test]
fn accessors_past_their_view_are_refused() {
    let expected =
        "accessors[0]: 4 elements of 12 bytes from byte 0 on pass the end of bufferViews[0], which has 36 bytes";
    assert_eq!(broken(|json| json["accessors"][0]["count"] = 4.into()), expected);
    assert!(broken(|json| json["accessors"][0]["byteOffset"] = 4.into()).contains("from byte 4 on pass the end"));
}

#[test]
fn numbers_that_overflow_are_refused() {
    for key in ["count", "byteOffset"] {
        assert!(broken(|json| json["accessors"][0][key] = u64::MAX.into()).contains("pass the end"));
    }
    assert!(broken(|json| json["bufferViews"][0]["byteStride"] = u64::MAX.into()).contains("pass the end"));
    assert!(broken(|json| json["bufferViews"][0]["byteOffset"] = u64::MAX.into()).contains("pass the end"));
    assert!(
        broken(|json| json["accessors"][0]["count"] = json!(-1)).contains("expected an unsigned integer, found -1")
    );
    assert!(
        broken(|json| json["accessors"][0]["count"] = json!(2.5)).contains("expected an unsigned integer, found 2.5")
    );
}

#[test]
fn views_past_their_buffer_are_refused() {
    let expected = "bufferViews[0]: 37 bytes from byte 0 on pass the end of buffers[0], which has 36 bytes";
    assert_eq!(broken(|json| json["bufferViews"][0]["byteLength"] = 37.into()), expected);
}

#[test]
fn indices_of_accessors_views_and_buffers_are_checked() {
    assert_eq!(
        broken(|json| json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 1.into()),
        "meshes[0].primitives[0].attributes.POSITION: accessors[1] does not exist; there are 1 accessors"
    );
    assert!(broken(|json| json["accessors"][0]["bufferView"] = 1.into()).starts_with("accessors[0].bufferView: "));
    assert!(broken(|json| json["bufferViews"][0]["buffer"] = 1.into()).starts_with("bufferViews[0].buffer: "));
    assert!(broken(|json| json["accessors"] = Value::Null).starts_with("meshes[0].primitives[0].attributes.POSITION"));
}

#[test]
fn unknown_types_are_refused() {
    assert_eq!(
        broken(|json| json["accessors"][0]["componentType"] = 5124.into()),
        "accessors[0].componentType: there is no component type 5124"
    );
    assert_eq!(
        broken(|json| json["accessors"][0]["type"] = "VEC5".into()),
        "accessors[0].type: there is no accessor type VEC5"
    );
}

#[test]
fn a_stride_below_the_element_is_refused() {
    assert!(broken(|json| json["bufferViews"][0]["byteStride"] = 8.into()).contains("is less than the 12 bytes"));
}

#[test]
fn a_mesh_with_matrices_as_attributes_stays_whole() {
    let mut doc = triangle();
    doc.json["accessors"].as_array_mut().unwrap().push(Value::Null);
    for (kind, components) in [("MAT2", 4), ("MAT3", 9), ("MAT4", 16)] {
        doc.json["accessors"][1] = json!({ "componentType": 5126, "count": 3, "type": kind });
        doc.json["meshes"][0]["primitives"][0]["attributes"]["_STRESS"] = 1.into();
        assert_eq!(contents(&doc).meshes[0].hold, Some(Hold::Matrix));
        let attributes = doc.attributes(0, 0);
        let stress = attributes.iter().find(|attribute| attribute.name == "_STRESS").unwrap();
        assert_eq!((stress.element.components, stress.bytes(2).len()), (components, 4 * components));
    }
}

/// A triangle whose accessor has one sparse value for its last vertex.
fn sparse(with_base: bool) -> Document {
    let mut json = triangle_json();
    json["accessors"][0]["sparse"] = json!({
        "count": 1,
        "indices": { "bufferView": 1, "componentType": 5121 },
        "values": { "bufferView": 1, "byteOffset": 4 }
    });
    json["bufferViews"].as_array_mut().unwrap().push(json!({ "buffer": 1, "byteLength": 16 }));
    json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 16 }));
    if !with_base {
        json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    }
    let mut data = vec![2, 0, 0, 0];
    data.extend(floats(&[7.0, 8.0, 9.0]));
    document(json, &[triangle_bytes(), data])
}

#[test]
fn sparse_values_replace_those_of_the_base() {
    assert_eq!(*triangles(&sparse(true)).positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [7.0, 8.0, 9.0]]);
}

#[test]
fn sparse_values_without_a_base_replace_zeros() {
    assert_eq!(*triangles(&sparse(false)).positions, [[0.0; 3], [0.0; 3], [7.0, 8.0, 9.0]]);
}

#[test]
fn sparse_values_over_interleaved_ones_are_read() {
    let mut doc = sparse(true);
    doc.json["bufferViews"][0]["byteStride"] = 12.into();
    let rows = floats(&[1.0, 1.0, 1.0, 0.0, 2.0, 2.0, 2.0, 0.0, 3.0, 3.0, 3.0, 0.0]);
    doc.json["bufferViews"][0] = json!({ "buffer": 0, "byteLength": 48, "byteStride": 16 });
    doc.buffers[0] = rows.into();
    assert_eq!(*triangles(&doc).positions, [[1.0; 3], [2.0; 3], [7.0, 8.0, 9.0]]);
}

#[test]
fn broken_sparse_accessors_are_refused() {
    let change = |path: &str, value: Value| {
        let mut doc = sparse(true);
        *doc.json.pointer_mut(path).unwrap() = value;
        refusal(&doc).to_string()
    };
    let at = "/accessors/0/sparse";
    assert!(change(&format!("{at}/count"), 5.into()).contains("pass the end"));
    assert!(change(&format!("{at}/indices/componentType"), 5122.into()).contains("must be unsigned integers"));
    assert!(change(&format!("{at}/indices/bufferView"), 9.into()).contains("bufferViews[9] does not exist"));
    assert!(change("/accessors/0/count", 2.into()).contains("element 2 does not exist; there are 2 elements"));
}

#[test]
fn zeros_without_bytes_behind_them_are_limited() {
    let message = broken(|json| {
        json["accessors"][0] = json!({ "componentType": 5126, "count": 4_000_000_000_u32, "type": "VEC3" });
    });
    assert!(message.contains("more than the file has bytes"), "{message}");
    let mut doc = triangle();
    doc.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(*triangles(&doc).positions, [[0.0; 3]; 3]);
}

#[test]
fn attributes_are_borrowed_in_file_order() {
    let mut doc = triangle();
    doc.json["meshes"][0]["primitives"][0]["attributes"] = json!({ "_B": 0, "POSITION": 0 });
    let attributes = doc.attributes(0, 0);
    let names: Vec<&str> = attributes.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["_B", "POSITION"]);
    assert!(attributes.iter().all(|a| matches!(a.data, Cow::Borrowed(_))));
    assert_eq!((attributes[1].element, attributes[1].count, attributes[1].stride), (VEC3, 3, 12));
    assert_eq!(attributes[1].data[12..16], 1.0_f32.to_le_bytes());
}

#[test]
fn sparse_attributes_are_resolved() {
    let doc = sparse(true);
    assert_eq!(doc.attributes(0, 0)[0].data[24..], floats(&[7.0, 8.0, 9.0]));
}

#[test]
fn attributes_of_what_is_not_there_are_none() {
    assert!(triangle().attributes(1, 0).is_empty());
    assert!(triangle().attributes(0, 1).is_empty());
    assert!(document(Value::Null, &[]).attributes(0, 0).is_empty());
}

#[test]
fn scalars_are_read_where_sound() {
    let mut doc = triangle();
    let index =
        doc.add_accessor(NewAccessor { data: shorts(&[5, 65535]), element: U16, target: Target::Other, bounds: false });
    assert_eq!(doc.scalars(index), Some(vec![5, 65535]));
    assert_eq!(doc.scalars(0), None);
    assert_eq!(doc.scalars(9), None);
}

#[test]
fn a_new_accessor_carries_exact_bounds() {
    let mut doc = document(json!({ "asset": { "version": "2.0" } }), &[]);
    let data = floats(&[0.1, -0.0, 1e30, -0.3, 1e-30, 16_777_217.0]);
    let index = doc.add_accessor(NewAccessor { data, element: VEC3, target: Target::Vertices, bounds: true });
    let text = doc.json.to_string();
    let json: Value = serde_json::from_str(&text).unwrap();
    let bound = |key: &str| -> Vec<f32> {
        json["accessors"][index][key].as_array().unwrap().iter().map(|x| x.as_f64().unwrap() as f32).collect()
    };
    assert_eq!(bound("min"), [-0.3, 0.0, 16_777_216.0]);
    assert_eq!(bound("max"), [0.1, 1e-30, 1e30]);
    assert_eq!(json["bufferViews"][0], json!({ "buffer": 0, "byteLength": 24, "target": 34962 }));
}

#[test]
fn bounds_of_integers_are_integers() {
    let mut doc = document(json!({}), &[]);
    let element = Element { component: Component::I8, components: 2, normalized: true };
    let data = vec![0x80, 3, 5, 0xFF];
    doc.add_accessor(NewAccessor { data, element, target: Target::Vertices, bounds: true });
    let accessor = &doc.json["accessors"][0];
    assert_eq!(
        accessor.to_string(),
        r#"{"bufferView":0,"componentType":5120,"normalized":true,"count":2,"type":"VEC2","min":[-128,-1],"max":[5,3]}"#
    );
}

#[test]
fn vertices_are_padded_to_four_bytes_and_indices_are_not() {
    let mut doc = triangle();
    let element = Element { component: Component::U8, components: 3, normalized: true };
    let vertices = doc.add_accessor(NewAccessor {
        data: vec![1, 2, 3, 4, 5, 6, 7, 8, 9],
        element,
        target: Target::Vertices,
        bounds: false,
    });
    let indices = doc.add_accessor(NewAccessor {
        data: shorts(&[0, 1, 2]),
        element: U16,
        target: Target::Indices,
        bounds: false,
    });
    assert_eq!((vertices, indices), (1, 2));
    assert_eq!(doc.json["bufferViews"][1], json!({ "buffer": 1, "byteLength": 12, "byteStride": 4, "target": 34962 }));
    assert_eq!(&doc.buffers[1][..], [1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0]);
    assert_eq!(doc.json["bufferViews"][2], json!({ "buffer": 2, "byteLength": 6, "target": 34963 }));
    doc.json["meshes"][0]["primitives"][0] = json!({ "attributes": { "POSITION": 0, "COLOR_0": 1 }, "indices": 2 });
    assert_eq!(contents(&doc).meshes[0].primitives[0].merge_key, "COLOR_0:U8x3n POSITION:F32x3||");
}

#[test]
fn primitives_that_refer_to_the_same_positions_share_them_in_memory() {
    for with_base in [true, false] {
        let mut doc = sparse(with_base);
        let accessor = doc.json["accessors"][0].clone();
        doc.json["accessors"] = json!([accessor, accessor]);
        doc.json["meshes"] = json!([0, 0, 1].map(|accessor| {
            let primitive = json!({ "attributes": { "POSITION": accessor } });
            json!({ "primitives": [primitive, primitive] })
        }));
        let read = contents(&doc);
        let positions: Vec<_> = read.meshes.iter().flat_map(|mesh| &mesh.primitives).collect();
        let positions: Vec<_> = positions.iter().map(|p| &p.triangles.as_ref().unwrap().positions).collect();
        assert!(positions[1..4].iter().all(|p| Arc::ptr_eq(positions[0], p)));
        assert!(Arc::ptr_eq(positions[4], positions[5]));
        assert!(!Arc::ptr_eq(positions[0], positions[4]), "another accessor");
        assert_eq!(positions[0], positions[4]);
    }
}
