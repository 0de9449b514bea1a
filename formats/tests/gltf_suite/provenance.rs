//! Merge keys, and what an earlier bake recorded.

use raykiln_formats::Document;
use raykiln_formats::contents::{CopyOf, NodeSource, Provenance, Source, TriangleOrder};
use raykiln_formats::document::{Component, Element};
use raykiln_formats::edit::{NewAccessor, Target};
use serde_json::{Value, json};

use crate::support::{contents, primitive, square, triangle, words};

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

/// A triangle whose primitive records `raykiln`; accessor 1 holds the runs.
fn recorded(raykiln: Value, runs: &[u32]) -> Document {
    let mut doc = triangle();
    let element = Element { component: Component::U32, components: 1, normalized: false };
    doc.add_accessor(NewAccessor { data: words(runs), element, target: Target::Other, bounds: false });
    doc.json["meshes"][0]["primitives"][0]["extras"] = json!({ "raykiln": raykiln });
    doc
}

fn provenance(doc: &Document) -> (Option<Provenance>, usize) {
    let c = contents(doc);
    (c.meshes[0].primitives[0].provenance.clone(), c.warnings.len())
}

#[test]
fn provenance_of_an_unchanged_primitive_is_read() {
    let doc = recorded(json!({ "source": { "mesh": 3, "primitive": 1 } }), &[0]);
    assert_eq!(provenance(&doc), (Some(Provenance::Same { mesh: 3, primitive: 1 }), 0));
}

#[test]
fn provenance_in_runs_is_read() {
    let record = json!({ "provenance": { "sources": [[null, 0, 1, 2], [7, 5, 0, 0]], "runs": 1 } });
    let expected = Provenance::Runs {
        sources: vec![
            Source { node: None, copy: 0, mesh: 1, primitive: 2 },
            Source { node: Some(7), copy: 5, mesh: 0, primitive: 0 },
        ],
        runs: vec![[1, 40, 1]],
    };
    assert_eq!(provenance(&recorded(record, &[1, 40, 1])), (Some(expected), 0));
}

#[test]
fn records_of_something_else_are_no_provenance() {
    for record in [json!({}), json!({ "moved": 3 }), json!(5)] {
        assert_eq!(provenance(&recorded(record, &[0])), (None, 0));
    }
}

#[test]
fn malformed_provenance_is_ignored_with_a_warning() {
    let sources = json!([[null, 0, 1, 2]]);
    for (record, runs) in [
        (json!({ "source": 3 }), vec![0, 0, 1]),
        (json!({ "source": { "mesh": -1, "primitive": 0 } }), vec![0, 0, 1]),
        (json!({ "source": { "mesh": 1_u64 << 32, "primitive": 0 } }), vec![0, 0, 1]),
        (json!({ "provenance": 7 }), vec![0, 0, 1]),
        (json!({ "provenance": { "sources": sources } }), vec![0, 0, 1]),
        (json!({ "provenance": { "sources": sources, "runs": 9 } }), vec![0, 0, 1]),
        (json!({ "provenance": { "sources": sources, "runs": 0 } }), vec![0, 0, 1]),
        (json!({ "provenance": { "sources": [[0, 1, 2]], "runs": 1 } }), vec![0, 0, 1]),
        (json!({ "provenance": { "sources": [[0, 1, 2, "x"]], "runs": 1 } }), vec![0, 0, 1]),
        (json!({ "provenance": { "sources": sources, "runs": 1 } }), vec![0, 0]),
        (json!({ "provenance": { "sources": sources, "runs": 1 } }), vec![1, 0, 1]),
        (json!({ "provenance": { "sources": sources, "runs": 1 } }), vec![0, 0, 2]),
        (json!({ "provenance": { "sources": sources, "runs": 1 } }), vec![0, u32::MAX, 1]),
    ] {
        assert_eq!(provenance(&recorded(record.clone(), &runs)), (None, 1), "{record}");
    }
}

/// What the node of a document with two runs in accessor 1 stands for.
fn node_source(record: Value) -> (Option<NodeSource>, usize) {
    let runs = json!({ "componentType": 5125, "count": 4, "type": "SCALAR" });
    let mut doc = primitive(
        json!({ "attributes": { "POSITION": 0 }, "mode": 5 }),
        &[(accessor(5126, "VEC3"), square()), (runs, words(&[4, 2, 0, 3]))],
    );
    doc.json["nodes"][0]["extras"] = json!({ "raykiln": { "source": record } });
    let found = contents(&doc);
    (found.nodes[0].source.clone(), found.warnings.len())
}

#[test]
fn a_node_says_of_which_mesh_it_places_a_copy() {
    assert_eq!(node_source(json!({ "node": 7 })), (Some(NodeSource { node: 7, copy_of: None }), 0));
    let same = CopyOf { mesh: 3, order: None };
    assert_eq!(node_source(json!({ "node": 7, "mesh": 3 })), (Some(NodeSource { node: 7, copy_of: Some(same) }), 0));
    let (found, warnings) = node_source(json!({ "node": 7, "mesh": 3, "runs": 1 }));
    let order = found.and_then(|s| s.copy_of).and_then(|c| c.order).expect("an order");
    assert_eq!(
        (0..6).map(|t| order.triangle(t)).collect::<Vec<_>>(),
        [4, 5, 0, 1, 2].map(Some).into_iter().chain([None]).collect::<Vec<_>>()
    );
    assert_eq!(warnings, 0);
}

#[test]
fn a_damaged_record_of_a_copy_is_a_warning() {
    for record in [
        json!({ "node": 7, "mesh": -1 }),
        json!({ "node": 7, "mesh": 3, "runs": 0 }),
        json!({ "node": 7, "mesh": 3, "runs": 99 }),
        json!({ "node": 7, "mesh": 3, "runs": null }),
    ] {
        assert_eq!(node_source(record), (Some(NodeSource { node: 7, copy_of: None }), 1));
    }
    assert_eq!(node_source(json!({ "node": 5_000_000_000_u64 })), (None, 0));
    assert_eq!(node_source(json!([])), (None, 0));
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
