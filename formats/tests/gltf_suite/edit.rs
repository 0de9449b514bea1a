//! Changes to documents: what is written, read back.

use std::collections::BTreeSet;

use glam::{DAffine3, DVec3};
use raykiln_formats::document::{Component, Element};
use raykiln_formats::edit::{CannotPrune, CopyAttributes, NewAccessor, NewNode, NewPrimitive, Target};
use serde_json::json;

use crate::support::{contents, floats, shorts, triangle, triangle_bytes};

const VEC3: Element = Element { component: Component::F32, components: 3, normalized: false };
const U16: Element = Element { component: Component::U16, components: 1, normalized: false };

fn vectors(data: Vec<u8>) -> NewAccessor {
    NewAccessor { data, element: VEC3, target: Target::Vertices, bounds: true }
}

fn new_primitive() -> NewPrimitive {
    NewPrimitive {
        attributes: vec![("POSITION".into(), vectors(triangle_bytes()))],
        indices: NewAccessor { data: shorts(&[0, 1, 2]), element: U16, target: Target::Indices, bounds: false },
        material: None,
        like: (0, 0),
    }
}

#[test]
fn an_added_mesh_inherits_extras_but_no_record() {
    let mut doc = triangle();
    doc.json["meshes"][0]["primitives"][0]["extras"] = json!({ "owner": "me", "raykiln": { "source": {} } });
    let mesh = doc.add_mesh("piece", vec![new_primitive()]);
    assert_eq!((doc.mesh_name(mesh), doc.mesh_name(0), doc.primitive_count(mesh)), ("piece", "", 1));
    assert_eq!(doc.json["meshes"][mesh]["primitives"][0]["extras"], json!({ "owner": "me" }));
}

#[test]
fn only_bytes_that_no_other_mesh_uses_are_counted() {
    let mut doc = triangle();
    let mesh = doc.add_mesh("", vec![new_primitive()]);
    let only = |meshes: &[usize]| doc.bytes_used_only_by(&BTreeSet::from_iter(meshes.iter().copied()));
    assert_eq!((only(&[]), only(&[0]), only(&[mesh]), only(&[0, mesh])), (0, 36, 36 + 6, 36 + 36 + 6));
    doc.json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"] = 0.into();
    let only = |meshes: &[usize]| doc.bytes_used_only_by(&BTreeSet::from_iter(meshes.iter().copied()));
    assert_eq!((only(&[0]), only(&[mesh])), (0, 6));
}

#[test]
fn points_and_lines_become_a_mesh_of_their_own() {
    let mut doc = triangle();
    assert_eq!(doc.add_points_and_lines_of(0), None);
    let points = json!({ "attributes": { "POSITION": 0 }, "mode": 0 });
    doc.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(points.clone());
    let rest = doc.add_points_and_lines_of(0).unwrap();
    assert_eq!(doc.json["meshes"][rest]["primitives"], json!([points]));
    assert_eq!((doc.primitive_count(0), doc.is_morphed(0)), (2, false));
}

#[test]
fn a_root_is_shown_and_a_child_has_the_copies_of_its_parent() {
    let mut doc = triangle();
    let translation = doc.add_accessor(vectors(floats(&[1.0, 0.0, 0.0, 2.0, 0.0, 0.0])));
    let up = DAffine3::from_translation(DVec3::Z);
    let root = doc.add_node(None, &NewNode { name: "root", mesh: 0, transform: up });
    doc.set_copies(root, &CopyAttributes { translation, rotation: None, scale: None });
    let child = doc.add_child(root, &NewNode { name: "", mesh: 0, transform: DAffine3::IDENTITY });
    let read = contents(&doc);
    assert_eq!((read.roots.as_slice(), read.nodes[root].children.as_slice()), (&[0, root][..], &[child][..]));
    assert_eq!((read.nodes[root].name.as_deref(), read.nodes[root].local), (Some("root"), up));
    assert_eq!(read.nodes[child].name, None);
    let copies = [1.0, 2.0].map(|x| DAffine3::from_translation(DVec3::X * x));
    assert_eq!(
        (read.nodes[root].copies.as_deref(), read.nodes[child].copies.as_deref()),
        (Some(&copies[..]), Some(&copies[..]))
    );
    assert_eq!(doc.json["extensionsRequired"], json!(["EXT_mesh_gpu_instancing"]));
    doc.set_mesh(root, None);
    assert_eq!((contents(&doc).nodes[root].mesh, &contents(&doc).nodes[root].copies), (None, &None));
}

#[test]
fn nodes_refer_to_others_by_identifiers_that_stay() {
    let mut doc = triangle();
    doc.json["meshes"][0]["name"] = "tri".into();
    for _ in 0..2 {
        doc.add_node(Some(0), &NewNode { name: "", mesh: 0, transform: DAffine3::IDENTITY });
    }
    doc.set_placed_mesh(0, 0);
    doc.identify_nodes(&BTreeSet::from([1, 2]));
    doc.set_moved_to(0, &BTreeSet::from([1, 2]));
    let record = json!({ "raykiln": { "mesh": { "name": "tri" }, "moved_to": [0, 1] } });
    assert_eq!(doc.json["nodes"][0]["extras"], record);
    doc.forget_node_records(true);
    assert_eq!(doc.json["nodes"][0]["extras"], json!({ "raykiln": { "mesh": { "name": "tri" } } }));
    let third = doc.add_node(None, &NewNode { name: "", mesh: 0, transform: DAffine3::IDENTITY });
    doc.identify_nodes(&BTreeSet::from([1, third]));
    let id = |node: usize| doc.json["nodes"][node]["extras"]["raykiln"]["id"].as_u64();
    assert_eq!([1, 2, third].map(id), [Some(0), Some(1), Some(2)]);
    doc.forget_node_records(false);
    assert_eq!(doc.json["nodes"][third], json!({ "mesh": 0 }));
}

#[test]
fn nothing_is_recorded_where_extras_leave_no_room() {
    for extras in [json!("text"), json!({ "raykiln": 3 })] {
        let mut doc = triangle();
        doc.json["nodes"][0]["extras"] = extras.clone();
        doc.set_placed_mesh(0, 0);
        doc.identify_nodes(&BTreeSet::from([0]));
        doc.set_moved_to(0, &BTreeSet::from([0]));
        doc.forget_node_records(false);
        assert_eq!(doc.json["nodes"][0]["extras"], extras);
    }
}

#[test]
fn pruning_stops_at_extensions_that_may_refer_to_nodes() {
    let mut doc = triangle();
    doc.json["nodes"].as_array_mut().unwrap().insert(0, json!({ "name": "empty" }));
    doc.json["scenes"][0]["nodes"] = json!([0, 1]);
    for extension in
        [json!({ "ACME_links": { "from": 1 } }), json!({ "KHR_interactivity": { "to": "/nodes/1/scale" } })]
    {
        doc.json["extensions"] = extension.clone();
        let name = extension.as_object().unwrap().keys().next().unwrap().clone();
        assert_eq!(doc.drop_empty_nodes(|_| true), Err(CannotPrune(name)));
    }
    doc.json["extensions"] = json!({ "VRMC_springBone": { "colliders": [{ "node": 1 }] } });
    assert_eq!(doc.clone().drop_empty_nodes(|node| node == 1), Ok(vec![Some(0), Some(1)]));
    assert_eq!(doc.drop_empty_nodes(|_| true), Ok(vec![None, Some(0)]));
    assert_eq!(doc.json["extensions"]["VRMC_springBone"]["colliders"][0]["node"], 0);
    assert_eq!(doc.json["scenes"][0]["nodes"], json!([0]));
}
