//! Nodes, scenes and their order.

use glam::{DAffine3, DVec3};
use raykiln_formats::{Contents, Document};
use serde_json::{Value, json};

use crate::support::{contents, document, refusal};

fn nodes(nodes: Value) -> Document {
    document(json!({ "asset": { "version": "2.0" }, "nodes": nodes }), &[])
}

fn local(node: Value) -> DAffine3 {
    contents(&nodes(json!([node]))).nodes[0].local
}

fn warning(node: Value) -> String {
    contents(&nodes(json!([node]))).warnings[0].to_string()
}

#[test]
fn a_chain_of_100_000_nodes_is_read() {
    let count = 100_000;
    let chain: Vec<Value> =
        (0..count).map(|i| if i + 1 < count { json!({ "children": [i + 1] }) } else { json!({}) }).collect();
    let mut doc = nodes(chain.into());
    doc.json["scenes"] = json!([{}, { "nodes": [0] }]);
    let c = contents(&doc);
    assert_eq!(c.nodes[count - 1].parent, Some(count - 2));
    assert!(c.nodes[count - 1].in_other_scene);
}

#[test]
fn a_cycle_of_100_000_nodes_is_refused() {
    let chain: Vec<Value> = (0..100_000).map(|i| json!({ "children": [(i + 1) % 100_000] })).collect();
    assert!(refusal(&nodes(chain.into())).cause.contains("is its own ancestor"));
}

#[test]
fn cycles_are_refused_at_a_node_of_the_cycle() {
    let error =
        refusal(&nodes(json!([{ "children": [1] }, { "children": [2] }, { "children": [3] }, { "children": [2] }])));
    assert!(error.cause.contains("is a child of"), "{error}");
    let error = refusal(&nodes(json!([{ "children": [0] }])));
    assert_eq!((error.place.as_str(), error.cause.as_str()), ("nodes[0]", "is its own ancestor"));
    let error = refusal(&nodes(json!([{}, { "children": [2, 3] }, { "children": [1] }, {}])));
    assert!(error.place == "nodes[1]" || error.place == "nodes[2]", "{error}");
}

#[test]
fn two_parents_are_refused() {
    let error = refusal(&nodes(json!([{ "children": [2] }, { "children": [2] }, {}])));
    assert_eq!(error.place, "nodes[2]");
    assert_eq!(error.cause, "is a child of nodes[0] and of nodes[1]");
    let error = refusal(&nodes(json!([{ "children": [1, 1] }, {}])));
    assert_eq!(error.cause, "is a child of nodes[0] and of nodes[0]");
}

#[test]
fn indices_of_nodes_are_checked() {
    let place = |node| refusal(&nodes(json!([node]))).place;
    assert_eq!(place(json!({ "children": [1] })), "nodes[0].children[0]");
    assert_eq!(place(json!({ "mesh": 0 })), "nodes[0].mesh");
    assert_eq!(place(json!({ "skin": 0 })), "nodes[0].skin");
    assert_eq!(place(json!({ "camera": 0 })), "nodes[0].camera");
    assert_eq!(place(json!({ "children": 3 })), "nodes[0].children");
    assert_eq!(place(json!(3)), "nodes[0]");
}

fn roots(scene: Value, scenes: Value) -> Contents {
    let mut doc = nodes(json!([{}, { "children": [2] }, {}, {}]));
    doc.json["scene"] = scene;
    doc.json["scenes"] = scenes;
    for key in ["scene", "scenes"] {
        if doc.json[key].is_null() {
            doc.json.as_object_mut().unwrap().remove(key);
        }
    }
    contents(&doc)
}

#[test]
fn the_default_scene_is_the_named_one_or_the_first_or_all() {
    let scenes = json!([{ "nodes": [3] }, { "nodes": [1, 0] }]);
    assert_eq!(roots(json!(1), scenes.clone()).roots, [1, 0]);
    assert_eq!(roots(Value::Null, scenes).roots, [3]);
    assert_eq!(roots(Value::Null, Value::Null).roots, [0, 1, 3]);
    assert!(roots(json!(0), json!([{}])).roots.is_empty());
}

#[test]
fn nodes_that_other_scenes_show_are_marked_with_all_below() {
    let c = roots(json!(0), json!([{ "nodes": [0, 1] }, { "nodes": [1] }, { "nodes": [3] }, { "nodes": [1, 3] }]));
    let marked: Vec<bool> = c.nodes.iter().map(|n| n.in_other_scene).collect();
    assert_eq!(marked, [false, true, true, true]);
}

#[test]
fn scenes_are_checked() {
    let refused = |scene: Value, scenes: Value| {
        let mut doc = nodes(json!([{ "children": [1] }, {}]));
        doc.json["scene"] = scene;
        doc.json["scenes"] = scenes;
        refusal(&doc).to_string()
    };
    assert!(refused(json!(1), json!([{}])).contains("scene: scenes[1] does not exist"));
    assert!(refused(json!(0), json!([{ "nodes": [2] }])).contains("scenes[0].nodes[0]: nodes[2] does not exist"));
    assert!(refused(json!(0), json!([{ "nodes": [0, 0] }])).contains("is listed twice"));
    assert!(refused(json!(0), json!([{ "nodes": [1] }])).contains("is not a root"));
}

#[test]
fn matrices_keep_double_precision() {
    let x = 0.123_456_789_012_345_68;
    let m = local(json!({ "matrix": [1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0, x, 11, 12, 1] }));
    assert_eq!(m.to_cols_array(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, x, 11.0, 12.0]);
}

#[test]
fn translation_rotation_and_scale_apply_in_that_order() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let m = local(json!({ "translation": [1, 2, 3], "rotation": [0, 0, half, half], "scale": [2, 1, -1] }));
    assert!((m.transform_point3(DVec3::X) - DVec3::new(1.0, 4.0, 3.0)).length() < 1e-15);
    assert!((m.transform_point3(DVec3::Z) - DVec3::new(1.0, 2.0, 2.0)).length() < 1e-15);
    assert_eq!(local(json!({})), DAffine3::IDENTITY);
}

#[test]
fn rotations_are_normalised() {
    let quarter = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
    for length in [1.0, 3.0, 1e-30, 1e30, 1e-300] {
        let m = local(json!({ "rotation": [0, 0, length, length] }));
        assert!(m.abs_diff_eq(quarter, 1e-15), "{length}");
    }
}

#[test]
fn doubtful_transforms_are_mended_with_a_warning() {
    assert!(warning(json!({ "rotation": [0, 0, 0, 0] })).contains("nodes[0].rotation: the quaternion is zero"));
    assert_eq!(local(json!({ "rotation": [0, 0, 0, 0] })), DAffine3::IDENTITY);
    let projective = json!({ "matrix": [1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] });
    assert!(warning(projective.clone()).contains("nodes[0].matrix: the last row is not 0 0 0 1"));
    assert_eq!(local(projective), DAffine3::IDENTITY);
    let both = json!({ "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], "scale": [2, 2, 2] });
    assert!(warning(both.clone()).contains("the matrix counts"));
    assert_eq!(local(both), DAffine3::IDENTITY);
}

#[test]
fn transforms_that_are_no_numbers_are_refused() {
    let refused = |node| refusal(&nodes(json!([node]))).to_string();
    assert!(
        refused(json!({ "translation": [1, 2] })).contains("nodes[0].translation: 3 numbers are expected, there are 2")
    );
    assert!(
        refused(json!({ "translation": [1, 2, null] }))
            .contains("nodes[0].translation[2]: expected a number, found null")
    );
    assert!(refused(json!({ "scale": [1, 1, 1e39] })).contains("beyond the range of 32-bit floats"));
    assert!(refused(json!({ "matrix": [1] })).contains("16 numbers are expected"));
}

#[test]
fn singular_and_mirrored_transforms_are_read() {
    assert_eq!(local(json!({ "scale": [0, 1, 1] })).matrix3.determinant(), 0.0);
    assert_eq!(local(json!({ "scale": [-1, 1, 1] })).matrix3.determinant(), -1.0);
}
