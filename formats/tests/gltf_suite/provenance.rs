//! Merge keys, and what an earlier bake recorded.

use raykiln_formats::contents::TriangleOrder;
use raykiln_formats::edit::RecordPlace;
use raykiln_formats::record::{GeometryHash, Origins, Placed, Provenance, Record, Source, sidecar};
use raykiln_formats::{Document, read};
use serde_json::{Value, json};

use crate::support::{contents, primitive, shorts, square, triangle, words};

fn key(json: Value, types: &[Value]) -> String {
    let accessors: Vec<_> = types.iter().map(|accessor| (accessor.clone(), square())).collect();
    contents(&primitive(json, &accessors)).meshes[0].primitives[0].merge_key.clone()
}

fn accessor(component: u32, kind: &str) -> Value {
    json!({ "componentType": component, "count": 4, "type": kind })
}

#[test]
fn merge_keys_ignore_the_order_of_properties() {
    let types = [accessor(5126, "VEC3"), accessor(5126, "VEC2")];
    let a = json!({ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "extras": { "a": 1, "b": { "c": 2, "d": 3 } } });
    let b = json!({ "extras": { "b": { "d": 3, "c": 2 }, "a": 1 }, "attributes": { "TEXCOORD_0": 1, "POSITION": 0 } });
    assert_eq!(key(a, &types), key(b, &types));
}

#[test]
fn merge_keys_take_positions_and_normals_for_floats() {
    let json = json!({ "attributes": { "POSITION": 0, "NORMAL": 1 } });
    let plain = key(json.clone(), &[accessor(5126, "VEC3"), accessor(5126, "VEC3")]);
    assert_eq!(plain, key(json, &[accessor(5122, "VEC3"), accessor(5120, "VEC3")]));
}

#[test]
fn merge_keys_tell_types_extensions_and_extras_apart() {
    let json = json!({ "attributes": { "POSITION": 0, "COLOR_0": 1 } });
    let with = |property: &str| {
        let mut json = json.clone();
        json[property] = json!({ "ACME": 1 });
        json
    };
    let types = [accessor(5126, "VEC3"), accessor(5126, "VEC3")];
    let keys = [
        key(json.clone(), &types),
        key(json.clone(), &[accessor(5126, "VEC3"), accessor(5121, "VEC3")]),
        key(with("extensions"), &types),
        key(with("extras"), &types),
    ];
    for (i, a) in keys.iter().enumerate() {
        assert!(keys[..i].iter().all(|b| a != b), "{a}");
    }
}

#[test]
fn merge_keys_ignore_provenance_and_draco() {
    let types = [accessor(5126, "VEC3")];
    let plain = key(json!({ "attributes": { "POSITION": 0 } }), &types);
    let json = json!({
        "attributes": { "POSITION": 0 },
        "extras": { "raykiln": { "source": { "mesh": 1, "primitive": 2 } } },
        "extensions": { "KHR_draco_mesh_compression": {} }
    });
    assert_eq!(plain, key(json, &types));
}

fn record() -> Record {
    let source = Source { node: None, copy: 0, mesh: 3, primitive: 1 };
    let placed = Placed { node: 0, copy: 0, list: 0, input: Some((7, 0)), stands_in: false };
    Record {
        input: GeometryHash([5; 32]),
        nodes: vec![Some(7)],
        lists: vec![vec![Origins::Each { sources: vec![source], triangles: vec![[0, 40]] }]],
        placed: vec![placed],
    }
}

fn recorded() -> Document {
    let mut doc = triangle();
    assert!(doc.set_record(&record(), RecordPlace::File));
    doc
}

#[test]
fn a_record_in_the_file_is_read_back() {
    let doc = recorded();
    assert_eq!(contents(&doc).provenance, Provenance::Recorded(record().into()));
    assert_eq!(contents(&triangle()).provenance, Provenance::Unrecorded);
    assert_eq!(contents(&triangle()).geometry, contents(&doc).geometry);
}

#[test]
fn a_record_replaces_another_and_leaves_other_extras() {
    let mut doc = recorded();
    doc.json["extras"]["owner"] = "me".into();
    assert!(doc.set_record(&record(), RecordPlace::Sidecar));
    assert_eq!(doc.json["extras"], json!({ "owner": "me" }));
    assert_eq!(contents(&doc).provenance, Provenance::Recorded(record().into()));
    assert!(doc.set_record(&record(), RecordPlace::None));
    assert_eq!((contents(&doc).provenance, doc.sidecar.clone()), (Provenance::Unrecorded, None));
    doc.json["extras"] = json!([1, 2]);
    assert!(!doc.set_record(&record(), RecordPlace::File), "a list has no room");
    assert_eq!(doc.json["extras"], json!([1, 2]));
}

#[test]
fn a_record_beside_the_file_is_written_and_read() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a b.glb");
    let mut doc = triangle();
    assert!(doc.set_record(&record(), RecordPlace::Sidecar));
    let staged = doc.stage(&out).unwrap();
    assert_eq!(contents(&read(staged.path()).unwrap()).provenance, Provenance::Recorded(record().into()));
    staged.commit().unwrap();
    assert_eq!(sidecar(&out), folder.path().join("a b.glb.record.json"));
    let read_back = read(&out).unwrap();
    assert_eq!(contents(&read_back).provenance, Provenance::Recorded(record().into()));
    let copy = folder.path().join("copy.glb");
    read_back.stage_unchanged(&copy).unwrap().commit().unwrap();
    assert!(sidecar(&copy).is_file(), "it goes where the scene goes");
    std::fs::write(sidecar(&out), "no JSON").unwrap();
    assert_eq!(contents(&read(&out).unwrap()).provenance, Provenance::Unrecorded);
}

#[test]
fn a_record_is_stale_once_the_geometry_is_another() {
    let edits: [fn(&mut Document); 5] = [
        |doc| doc.json["meshes"][0]["primitives"][0]["mode"] = 5.into(),
        |doc| doc.json["nodes"].as_array_mut().unwrap().insert(0, json!({})),
        |doc| doc.json["nodes"][0] = json!({}),
        |doc| {
            let mesh = doc.json["meshes"][0].clone();
            doc.json["meshes"].as_array_mut().unwrap().push(mesh);
        },
        |doc| {
            let mut bytes = doc.buffers[0].to_vec();
            bytes[0] ^= 1;
            doc.buffers[0] = bytes.into();
        },
    ];
    for (i, edit) in edits.into_iter().enumerate() {
        let mut doc = recorded();
        edit(&mut doc);
        let found = raykiln_formats::Document::contents(&doc, Default::default()).unwrap();
        assert_eq!(found.provenance, Provenance::Stale, "edit {i}");
    }
    let mut doc = recorded();
    doc.json["nodes"][0]["name"] = "renamed".into();
    doc.json["nodes"][0]["translation"] = json!([1, 2, 3]);
    doc.json["materials"] = json!([{}]);
    assert_eq!(contents(&doc).provenance, Provenance::Recorded(record().into()), "geometry alone counts");
}

#[test]
fn the_hash_of_geometry_does_not_depend_on_how_it_is_stored() {
    let indexed = |component: u32, indices: Vec<u8>| {
        let indices = (json!({ "componentType": component, "count": 6, "type": "SCALAR" }), indices);
        primitive(
            json!({ "attributes": { "POSITION": 0 }, "indices": 1 }),
            &[(accessor(5126, "VEC3"), square()), indices],
        )
    };
    let hash = |doc: &Document| contents(doc).geometry;
    let plain = hash(&indexed(5123, shorts(&[0, 1, 2, 0, 2, 3])));
    assert_eq!(plain, hash(&indexed(5125, words(&[0, 1, 2, 0, 2, 3]))), "another type of integer");
    assert_eq!(plain, hash(&indexed(5123, shorts(&[1, 2, 0, 3, 0, 2]))), "another corner first");
    assert_ne!(plain, hash(&indexed(5123, shorts(&[0, 2, 1, 0, 2, 3]))), "turned over");
    assert_ne!(plain, hash(&indexed(5123, shorts(&[0, 2, 3, 0, 1, 2]))), "another order");
}

#[test]
fn damaged_records_are_told_from_none() {
    for (key, value, cause) in [
        ("schema", json!("raykiln.record/0"), "it is of another version"),
        ("geometry", json!("12"), "a hash is malformed"),
        ("geometry", json!(null), "it lacks the hash of the geometry"),
        ("input", json!(7), "it lacks the hash of the input"),
        ("origins", json!("%"), "its origins are not base64"),
        ("origins", json!("AAAA"), "its origins cannot be decompressed"),
    ] {
        let mut doc = recorded();
        doc.json["extras"]["raykiln"]["record"][key] = value;
        assert_eq!(contents(&doc).provenance, Provenance::Damaged(cause));
    }
}

#[test]
fn an_order_of_triangles_is_a_list_of_runs() {
    assert_eq!(TriangleOrder::of(&[0, 1, 2]), None);
    let order = TriangleOrder::of(&[2, 3, 0, 1, 4]).expect("not in order");
    assert_eq!(order.runs(), [[2, 2], [0, 2], [4, 1]]);
    assert_eq!(order.triangle(4), Some(4));
    assert_eq!(TriangleOrder::new(vec![[u32::MAX, 1]]), None);
    assert_eq!(TriangleOrder::new(vec![[1, 0]]).expect("empty runs do no harm").triangle(0), None);
}
