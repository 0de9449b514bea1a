//! Removal of what nothing refers to.

use raykiln_formats::Document;
use raykiln_formats::edit::Compacted;
use serde_json::{Value, json};

use crate::support::{contents, document, floats, triangle_bytes, triangle_json};

/// Five accessors, each with a view of its own; three meshes of which only the second is used.
fn cluttered() -> Document {
    let mut json = triangle_json();
    json["nodes"] = json!([{ "mesh": 1 }, { "mesh": 1 }]);
    json["meshes"] = json!([
        { "primitives": [{ "attributes": { "POSITION": 0 } }] },
        { "primitives": [{ "attributes": { "NORMAL": 3, "POSITION": 1 } }] },
        { "primitives": [{ "attributes": { "POSITION": 2 } }] }
    ]);
    let accessor = |view: usize| {
        let mut accessor = triangle_json()["accessors"][0].clone();
        accessor["bufferView"] = view.into();
        accessor
    };
    json["accessors"] = (0..5).map(accessor).collect();
    json["bufferViews"] = vec![triangle_json()["bufferViews"][0].clone(); 6].into();
    document(json, &[triangle_bytes()])
}

fn removed(meshes: usize, accessors: usize, buffer_views: usize) -> Compacted {
    Compacted { meshes, accessors, buffer_views, held_by: None }
}

#[test]
fn unused_meshes_accessors_and_views_go_and_the_rest_is_renumbered() {
    let mut doc = cluttered();
    assert_eq!(doc.compact(), removed(2, 3, 4));
    assert_eq!(doc.json["nodes"], json!([{ "mesh": 0 }, { "mesh": 0 }]));
    assert_eq!(doc.json["meshes"], json!([{ "primitives": [{ "attributes": { "NORMAL": 1, "POSITION": 0 } }] }]));
    assert_eq!(doc.json["accessors"][1]["bufferView"], 1);
    assert_eq!(doc.json["bufferViews"].as_array().unwrap().len(), 2);
    assert_eq!(contents(&doc).meshes.len(), 1);
    assert_eq!(doc.compact(), removed(0, 0, 0));
}

#[test]
fn everything_referred_to_anywhere_stays() {
    let mut doc = cluttered();
    doc.json["meshes"][1]["primitives"][0]["targets"] = json!([{ "POSITION": 4 }]);
    doc.json["meshes"][1]["primitives"][0]["indices"] = 2.into();
    doc.json["nodes"][1]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "SCALE": 0 } } });
    doc.json["images"] = json!([{ "bufferView": 5, "mimeType": "image/png" }]);
    assert_eq!(doc.compact(), removed(2, 0, 0));
}

/// What becomes of a reference to accessor 4 when accessors 0 and 2 go.
fn renumbered(change: impl FnOnce(&mut Value), path: &str) -> Value {
    let mut doc = cluttered();
    change(&mut doc.json);
    doc.compact();
    doc.json.pointer(path).unwrap().clone()
}

#[test]
fn skins_animations_and_copies_are_renumbered() {
    let skin = |json: &mut Value| json["skins"] = json!([{ "joints": [0], "inverseBindMatrices": 4 }]);
    assert_eq!(renumbered(skin, "/skins/0/inverseBindMatrices"), 2);
    let animation = |json: &mut Value| json["animations"] = json!([{ "samplers": [{ "input": 4, "output": 3 }] }]);
    assert_eq!(renumbered(animation, "/animations/0/samplers/0"), json!({ "input": 2, "output": 1 }));
    let copies = |json: &mut Value| {
        json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "SCALE": 4 } } });
    };
    assert_eq!(renumbered(copies, "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes/SCALE"), 2);
}

#[test]
fn sparse_views_and_images_are_renumbered() {
    let mut doc = cluttered();
    doc.json["accessors"][1]["sparse"] =
        json!({ "count": 1, "indices": { "bufferView": 4, "componentType": 5121 }, "values": { "bufferView": 5 } });
    doc.json["images"] = json!([{ "bufferView": 2, "mimeType": "image/png" }]);
    assert_eq!(doc.compact(), removed(2, 3, 1));
    assert_eq!(doc.json["accessors"][0]["sparse"]["indices"]["bufferView"], 3);
    assert_eq!(doc.json["accessors"][0]["sparse"]["values"]["bufferView"], 4);
    assert_eq!(doc.json["images"][0]["bufferView"], 1);
}

#[test]
fn an_unknown_extension_holds_everything_in_place() {
    for path in ["/nodes/0", "/materials/0", "/meshes/1/primitives/0", ""] {
        let mut doc = cluttered();
        doc.json["materials"] = json!([{ "name": "m" }]);
        let object = doc.json.pointer_mut(path).unwrap();
        object["extensions"] = json!({ "KHR_lights_punctual": {}, "ACME_physics": { "mesh": 2 } });
        let before = doc.json.clone();
        assert_eq!(doc.compact(), Compacted { held_by: Some("ACME_physics".into()), ..Compacted::default() }, "{path}");
        assert_eq!(doc.json, before);
    }
}

#[test]
fn an_animation_pointer_into_meshes_holds_everything_in_place() {
    for (pointer, held_by) in
        [("/meshes/1/weights/0", Some("KHR_animation_pointer".to_owned())), ("/nodes/0/scale", None)]
    {
        let mut doc = cluttered();
        let target = json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } });
        doc.json["animations"] = json!([{ "samplers": [], "channels": [{ "sampler": 0, "target": target }] }]);
        assert_eq!(doc.compact().held_by, held_by);
    }
}

#[test]
fn extensions_within_extras_do_not_count() {
    let mut doc = cluttered();
    doc.json["extras"] = json!({ "extensions": { "ACME_physics": 1 } });
    assert_eq!(doc.compact().held_by, None);
}

#[test]
fn empty_lists_are_removed() {
    let mut json = json!({ "asset": { "version": "2.0" }, "meshes": [], "extensionsUsed": [], "extras": [] });
    json["accessors"] = json!([{ "componentType": 5126, "count": 1, "type": "SCALAR" }]);
    let mut doc = document(json, &[]);
    assert_eq!(doc.compact(), removed(0, 1, 0));
    assert_eq!(doc.json, json!({ "asset": { "version": "2.0" }, "extras": [] }));
}

#[test]
fn references_to_nothing_are_left_alone() {
    let mut doc = cluttered();
    doc.json["nodes"][1]["mesh"] = 99.into();
    doc.json["accessors"][1]["bufferView"] = json!("x");
    doc.compact();
    assert_eq!(doc.json["nodes"][1]["mesh"], 99);
}

#[test]
fn documents_that_are_no_objects_are_left_alone() {
    for json in [json!(null), json!([1]), json!({ "meshes": 3, "nodes": { "mesh": 1 } })] {
        let mut doc = document(json.clone(), &[]);
        doc.compact();
        assert_eq!(doc.json, json);
    }
}

#[test]
fn a_view_is_cut_down_to_what_accessors_still_read() {
    let view = json!({"buffer": 0, "byteOffset": 4, "byteLength": 4 * 480, "target": 34962});
    let accessor =
        |i: usize| json!({"bufferView": 0, "byteOffset": 480 * i, "componentType": 5126, "count": 40, "type": "VEC3"});
    let primitive = |i: usize| json!({"primitives": [{"attributes": {"POSITION": i}, "mode": 0}]});
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}], "nodes": [{"mesh": 1}, {"mesh": 3}],
        "meshes": (0..4).map(primitive).collect::<Vec<_>>(), "accessors": (0..4).map(accessor).collect::<Vec<_>>(),
        "bufferViews": [view], "buffers": [{"byteLength": 1924}]
    });
    let mut doc = document(json, &[floats(&(0..481).map(|i| i as f32).collect::<Vec<_>>())]);
    let read = |doc: &Document, mesh: usize| doc.attributes(mesh, 0)[0].numbers(0);
    let before = [1, 3].map(|mesh| read(&doc, mesh));
    let removed = doc.compact();
    assert_eq!((removed.meshes, removed.accessors), (2, 2));
    assert_eq!([0, 1].map(|mesh| read(&doc, mesh)), before);
    let views = doc.json["bufferViews"].as_array().expect("views");
    let lengths: Vec<_> = views.iter().map(|v| (v["byteOffset"].clone(), v["byteLength"].clone())).collect();
    assert_eq!(lengths, [(json!(484), json!(480)), (json!(1444), json!(480))]);
}
