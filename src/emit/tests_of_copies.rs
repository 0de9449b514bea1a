//! Instances written as copies of one node and read back.

use glam::{DAffine3, DMat3, DVec3};
use serde_json::{Value, json};

use super::tests::{document, load, opened, pruned, shown, surface};
use super::*;
use crate::methods::{Method, run};
use crate::scene::TriangleRef;
use crate::verify::identity::Identity;

const RATIO: f64 = 1e-6;

fn as_copies() -> Options {
    let instancing = Instancing::Extension { max_position_error_ratio: RATIO };
    Options { instancing, ..Options::default() }
}

fn quads(nodes: Value) -> Document {
    document(nodes, json!({"name": "quad", "primitives": [surface(1)], "extras": {"owner": "me"}}))
}

/// Writes a layout as copies of nodes; returns the document, and the scene read back from it.
fn copied(doc: &Document, layout: impl Fn(&Scene) -> Layout) -> (Emitted, Scene) {
    let scene = load(doc);
    let emitted = emit(doc, &scene, &layout(&scene), &as_copies());
    let after = load(&emitted.document);
    let identity = Identity::new(&scene, &after);
    assert_eq!(identity.known(), scene.triangles_placed(), "every triangle leads back");
    let refs = (0u32..).zip(&after.instances).flat_map(|(instance, at)| {
        let count = after.meshes[at.mesh.0 as usize].triangle_count() as u32;
        (0..count).map(move |triangle| TriangleRef { instance, triangle })
    });
    for at in refs {
        let exact = scene.world_corners(identity.source(at).expect("it leads back"));
        let moved = after.world_corners(at).into_iter().zip(exact).map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
        assert!(moved <= emitted.position_error + 1e-12, "{at:?} moved by {moved}");
    }
    assert!(emitted.position_error <= RATIO * scene.bounds().diagonal());
    (emitted, after)
}

fn kept(scene: &Scene) -> Layout {
    run(Method::Keep, scene, &Default::default())
}

/// Returns the attributes of the copies of a node.
fn attributes(document: &Document, node: usize) -> &Value {
    &document.json["nodes"][node]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]
}

#[test]
fn instances_become_copies_of_a_node_and_their_nodes_stay() {
    let doc = quads(json!([
        {"name": "left", "mesh": 0, "translation": [3, 0, 0], "extras": {"user": 1}},
        {"name": "mirrored", "mesh": 0, "scale": [-2, 1, 1], "rotation": [0, 0, 0.6, 0.8], "children": [3]},
        {"name": "turned", "mesh": 0, "rotation": [0.5, -0.5, 0.5, -0.5], "scale": [1, 2, 3]},
        {"name": "child", "mesh": 0, "translation": [0, 0, 5]}
    ]));
    let mut doc = doc;
    doc.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let (emitted, after) = copied(&doc, kept);
    assert_eq!(emitted.copied, Copied { nodes: 2, copies: 4, stay: 0 }, "mirrored ones have a node of their own");
    let json = &emitted.document.json;
    assert_eq!(json["nodes"].as_array().map(Vec::len), Some(6));
    let id = |node: usize| json["nodes"][node]["extras"]["raykiln"]["id"].clone();
    for (i, (name, copies)) in [("left", 4), ("mirrored", 5), ("turned", 4), ("child", 5)].into_iter().enumerate() {
        let node = &json["nodes"][i];
        assert_eq!((node["name"].as_str(), node.get("mesh")), (Some(name), None));
        assert_eq!(node["extras"]["raykiln"]["moved_to"], json!([id(copies)]));
        assert_eq!(node["extras"]["raykiln"]["mesh"], json!({"name": "quad", "extras": {"owner": "me"}}));
    }
    assert_eq!(json["nodes"][0]["extras"]["user"], 1);
    assert_eq!(json["nodes"][1]["children"], json!([3]));
    for list in ["extensionsUsed", "extensionsRequired"] {
        assert_eq!(json[list], json!(["EXT_mesh_gpu_instancing"]));
    }
    assert_eq!((after.instances.len(), after.meshes.len()), (4, 1));
    assert_eq!(after.instances.iter().filter(|i| i.mirrored()).count(), 2, "a mirrored node and the one below it");
}

#[test]
fn what_is_sheared_animated_or_has_no_room_for_a_record_stays_a_node() {
    let mut doc = quads(json!([
        {"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]},
        {"name": "stretched", "scale": [1, 4, 1], "children": [3]},
        {"name": "sheared", "mesh": 0, "rotation": [0, 0, 0.6, 0.8]},
        {"name": "animated", "mesh": 0},
        {"name": "text", "mesh": 0, "extras": "no object"}
    ]));
    doc.json["scenes"][0]["nodes"] = json!([0, 1, 2, 4, 5]);
    doc.json["accessors"].as_array_mut().expect("a list").extend([
        json!({"componentType": 5126, "count": 1, "type": "SCALAR", "min": [0], "max": [0]}),
        json!({"componentType": 5126, "count": 1, "type": "VEC3"}),
    ]);
    doc.json["animations"] = json!([{
        "samplers": [{"input": 4, "output": 5}],
        "channels": [{"sampler": 0, "target": {"node": 4, "path": "translation"}}]
    }]);
    let (emitted, after) = copied(&doc, kept);
    assert_eq!(emitted.copied, Copied { nodes: 1, copies: 2, stay: 1 });
    let places = |i: usize| emitted.document.json["nodes"][i].get("mesh").is_some();
    assert_eq!([0, 1, 3, 4, 5, 6].map(places), [false, false, true, true, true, true]);
    assert_eq!(after.instances.len(), 5);
}

#[test]
fn one_instance_and_none_alike_stay_nodes() {
    let sheared =
        json!([{"mesh": 0}, {"scale": [1, 4, 1], "children": [2]}, {"mesh": 0, "rotation": [0, 0, 0.6, 0.8]}]);
    for (nodes, roots, stay) in [(json!([{"mesh": 0}]), json!([0]), 0), (sheared, json!([0, 1]), 2)] {
        let mut doc = quads(nodes);
        doc.json["scenes"][0]["nodes"] = roots;
        let (emitted, _) = copied(&doc, kept);
        assert_eq!(emitted.copied, Copied { nodes: 0, copies: 0, stay });
        assert!(emitted.document.json.get("extensionsUsed").is_none());
    }
}

#[test]
fn pieces_of_opened_instances_share_the_lists_of_copies() {
    let nodes: Vec<Value> = (0..40).map(|i| json!({"mesh": 0, "translation": [3 * i, 0, 0]})).collect();
    let (emitted, after) = copied(&quads(nodes.into()), opened);
    assert_eq!(emitted.copied, Copied { nodes: 2, copies: 80, stay: 0 });
    let document = &emitted.document;
    assert_eq!(document.json["nodes"].as_array().map(Vec::len), Some(42));
    assert_eq!(attributes(document, 40), attributes(document, 41));
    let names: Vec<&String> = attributes(document, 40).as_object().expect("attributes").keys().collect();
    assert_eq!(names, ["TRANSLATION"], "nothing turns or grows");
    assert_eq!(document.json["nodes"][7]["extras"]["raykiln"]["moved_to"], json!([0, 1]));
    assert_eq!(after.instances.len(), 80);
}

#[test]
fn far_from_the_origin_the_node_stands_among_its_copies() {
    let nodes: Vec<Value> =
        (0..5).map(|i| json!({"mesh": 0, "translation": [1e6, 1e6 + 3.1 * i as f64, 0.3]})).collect();
    let (emitted, after) = copied(&quads(nodes.into()), kept);
    assert_eq!(emitted.copied, Copied { nodes: 1, copies: 5, stay: 0 });
    assert_eq!(emitted.document.json["nodes"][5]["translation"][0], 1e6);
    assert!(emitted.position_error < 1e-6 && after.bounds().min.distance(DVec3::new(1e6, 1e6, 0.3)) < 1e-6);
}

#[test]
fn copies_of_the_input_stay_with_all_their_attributes() {
    let mut doc = quads(json!([
        {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1, "_ID": 2}}}},
        {"mesh": 0, "translation": [9, 0, 0]}, {"mesh": 0, "translation": [9, 9, 0]}
    ]));
    doc.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    let (emitted, after) = copied(&doc, kept);
    assert_eq!(emitted.copied, Copied { nodes: 1, copies: 2, stay: 0 });
    assert_eq!(*attributes(&emitted.document, 0), json!({"TRANSLATION": 1, "_ID": 2}));
    assert_eq!(emitted.document.json["extensionsUsed"], json!(["EXT_mesh_gpu_instancing"]));
    assert_eq!(after.instances.len(), 6);
}

#[test]
fn points_and_lines_beside_triangles_keep_a_mesh_where_it_is() {
    let lines = json!({"attributes": {"POSITION": 0}, "mode": 1});
    let both = json!({"primitives": [surface(0), lines]});
    let doc = document(json!([{"mesh": 0}, {"mesh": 0, "translation": [4, 0, 0]}]), both);
    assert_eq!(copied(&doc, kept).0.copied, Copied::default());
}

#[test]
fn emptied_nodes_can_be_pruned_and_the_output_baked_again() {
    let nodes: Vec<Value> =
        (0..9).map(|i| json!({"name": format!("n{i}"), "mesh": 0, "translation": [2 * i, i, 0]})).collect();
    let doc = quads(nodes.into());
    let scene = load(&doc);
    let options = Options { prune: true, ..as_copies() };
    let emitted = emit(&doc, &scene, &kept(&scene), &options);
    assert_eq!(emitted.document.json["nodes"].as_array().map(Vec::len), Some(1));
    let after = load(&emitted.document);
    assert_eq!(Identity::new(&scene, &after).known(), 18);
    for options in [as_copies(), pruned()] {
        let again = emit(&emitted.document, &after, &opened(&after), &options);
        let last = load(&again.document);
        assert_eq!(Identity::new(&after, &last).known(), 18);
        assert_eq!(Identity::new(&scene, &last).known(), 18, "it leads to the first input");
        assert_eq!(shown(&after), shown(&last));
    }
}

#[test]
fn twenty_thousand_instances_are_one_node() {
    let node = |i: usize| {
        let (x, y) = ((i % 150) as f64, (i / 150) as f64);
        json!({"mesh": 0, "translation": [2.1 * x, 2.1 * y, 0], "rotation": [0, 0, 0.6, 0.8], "scale": [1, 1, -1]})
    };
    let (emitted, after) = copied(&quads((0..20_000).map(node).collect()), kept);
    assert_eq!(emitted.copied, Copied { nodes: 1, copies: 20_000, stay: 0 });
    assert!(after.instances.iter().all(|i| i.mirrored() && i.node == 20_000));
}

/// Puts the mesh of all instances in one piece with a rotated frame.
fn turned(scene: &Scene) -> Layout {
    let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.3, 0.4, 0.5).to_cols_array().map(|c| f64::from(c as f32));
    let frame = DAffine3 { matrix3: DMat3::from_cols_array(&turn), translation: DVec3::new(0.5, 0.25, 0.0) };
    let mut layout = opened(scene);
    for group in &mut layout.groups {
        let Content::Piece { frame: of_group, .. } = &mut group.content else { panic!("a piece") };
        *of_group = frame;
    }
    layout.placements.iter_mut().for_each(|p| p.transform *= frame);
    assert_eq!(layout.check(scene), Ok(()));
    layout
}

#[test]
fn pieces_in_frames_are_nodes_that_undo_them_or_copies() {
    let doc = quads(json!([
        {"mesh": 0, "translation": [3, 0, 0]}, {"mesh": 0, "scale": [-2, 1, 1]},
        {"mesh": 0, "scale": [2, 2, 2], "translation": [0, 0, 9]}
    ]));
    let scene = load(&doc);
    let nodes = emit(&doc, &scene, &turned(&scene), &Options::default());
    let after = load(&nodes.document);
    assert_eq!(Identity::new(&scene, &after).known(), 6);
    assert!(nodes.document.json["nodes"][3]["matrix"].is_array(), "the node below undoes the frame");
    assert!(nodes.position_error > 0.0 && nodes.position_error < 1e-6);
    let (emitted, after) = copied(&doc, turned);
    // The mirrored instance stays a node: none other is mirrored, and a frame shears what is stretched along one axis.
    assert_eq!(emitted.copied, Copied { nodes: 2, copies: 4, stay: 0 });
    assert_eq!(after.instances.len(), 6);
    for (a, b) in shown(&scene).iter().zip(shown(&after)) {
        assert!(a.0 == b.0 && a.1.iter().all(|p| b.1.iter().any(|q| p.distance(*q) < 1e-5)));
    }
}
