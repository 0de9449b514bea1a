//! Nodes, animations, scenes and the rest are compared by what they mean.

use raykiln_formats::Document;
use serde_json::{Value, json};

use super::DifferenceKind as Kind;
use super::test_files::{changed, kinds, report, sample, square};

type Change = fn(&mut Value);

/// Whether each change is found as the kind beside it, and nothing else is.
fn assert_each_is_found(before: &Document, cases: &[(Kind, Change)]) {
    assert_eq!(kinds(&report(before, before)), []);
    for (kind, change) in cases {
        let found = report(before, &changed(before, change));
        assert_eq!(kinds(&found), [*kind], "{found:?}");
    }
}

#[test]
fn what_nodes_say_and_where_they_are_is_compared() {
    assert_each_is_found(
        &sample("hierarchy"),
        &[
            (Kind::NodeRenamed, |json| json["nodes"][1]["name"] = "floor".into()),
            (Kind::NodeExtras, |json| json["nodes"][2]["extras"]["bearing"] = false.into()),
            (Kind::NodeExtras, |json| json["nodes"][6]["extras"] = json!({})),
            (Kind::NodeExtension, |json| json["nodes"][4]["extensions"]["ACME_spin"]["speed"] = 3.6.into()),
            (Kind::Light, |json| json["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = 41.into()),
            (Kind::Light, |json| json["nodes"][5]["extensions"] = json!({})),
            (Kind::Camera, |json| json["cameras"][0]["perspective"]["yfov"] = 0.5.into()),
            (Kind::CameraAdded, |json| json["nodes"][0]["camera"] = 0.into()),
            (Kind::FileData, |json| json["extras"]["revision"] = 8.into()),
            (Kind::FileData, |json| json["extensions"]["ACME_spin"]["unit"] = "degrees".into()),
            (Kind::FileData, |json| json["asset"]["copyright"] = "somebody".into()),
            (Kind::SceneData, |json| json["scenes"][0]["extras"] = json!({"a": 1})),
        ],
    );
    let before = sample("hierarchy");
    let moved = changed(&before, |json| json["nodes"][5]["translation"] = json!([0, 4, 2.5]));
    assert_eq!(kinds(&report(&before, &moved)), [Kind::NodeMoved]);
}

#[test]
fn what_animations_move_and_how_is_compared() {
    let before = sample("animated");
    let output = before.json["animations"][0]["samplers"][0]["output"].as_u64().expect("an accessor") as usize;
    assert!(output > 0);
    assert_each_is_found(
        &before,
        &[
            (Kind::AnimationMissing, |json| drop(json.as_object_mut().unwrap().remove("animations"))),
            (Kind::AnimationKeys, |json| json["animations"][0]["samplers"][0]["interpolation"] = "STEP".into()),
            (Kind::AnimationData, |json| json["animations"][0]["extras"] = json!({"loop": true})),
            (Kind::AnimationAdded, |json| {
                let copy = json["animations"][0].clone();
                json["animations"].as_array_mut().unwrap().push(copy);
            }),
        ],
    );
    let other = changed(&before, |json| json["animations"][0]["channels"][0]["target"]["node"] = 0.into());
    assert_eq!(kinds(&report(&before, &other)), [Kind::ChannelMissing, Kind::ChannelAdded]);
}

#[test]
fn scenes_are_compared_by_the_nodes_that_they_show() {
    let mut before = square(&[]);
    before.json["nodes"] = json!([{"name": "square", "mesh": 0}, {"name": "empty"}, {"name": "other"}]);
    before.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1, 2]}]);
    assert_each_is_found(
        &before,
        &[
            (Kind::SceneNodes, |json| json["scenes"][1]["nodes"] = json!([1])),
            (Kind::SceneMissing, |json| drop(json["scenes"].as_array_mut().unwrap().pop())),
            (Kind::SceneNodes, |json| json["scenes"][0]["nodes"] = json!([0, 2])),
        ],
    );
}

#[test]
fn nodes_are_found_by_name_if_numbers_changed() {
    let before = sample("instanced");
    // The nodes in reverse.
    let after = changed(&before, |json| {
        json["nodes"].as_array_mut().unwrap().reverse();
        json["nodes"][2]["children"] = json!([1, 0]);
        json["scenes"][0]["nodes"] = json!([6, 5, 4, 3, 2]);
    });
    assert_eq!(kinds(&report(&before, &after)), []);
    let numbered = changed(&after, |json| json["nodes"][0]["name"] = "lamp of the row 1.001".into());
    assert_eq!(kinds(&report(&before, &numbered)), [Kind::NameNumbered]);
    let flat = changed(&after, |json| {
        json["nodes"][2].as_object_mut().unwrap().remove("children");
        let turn = json["nodes"][2]["rotation"].clone();
        for (node, z) in [(1, 0.0), (0, -3.0)] {
            json["nodes"][node]["rotation"] = turn.clone();
            json["nodes"][node]["translation"] = json!([10.0, 0.0, z]);
        }
        json["scenes"][0]["nodes"] = json!([6, 5, 4, 3, 2, 1, 0]);
    });
    let found = report(&before, &flat);
    assert_eq!(kinds(&found), [Kind::NodeRegrouped]);
    assert_eq!(found.differences[0].count, 2);
}

#[test]
fn variants_are_compared_by_the_materials_that_they_show() {
    let mut before = square(&[]);
    before.json["materials"] = json!([{}, {"doubleSided": true}, {"doubleSided": true}]);
    before.json["extensions"] = json!({"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}});
    let mappings = json!([{"material": 1, "variants": [1]}]);
    before.json["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_materials_variants": {"mappings": mappings}});
    let mapping = |json: &mut Value, key: &str, value: Value| {
        json["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"]["mappings"][0][key] = value;
    };
    assert_eq!(kinds(&report(&before, &changed(&before, |json| mapping(json, "material", json!(2))))), []);
    let found = report(&before, &changed(&before, |json| mapping(json, "material", json!(0))));
    assert_eq!(kinds(&found), [Kind::Variant]);
    let both = report(&before, &changed(&before, |json| mapping(json, "variants", json!([0]))));
    assert_eq!(kinds(&both), [Kind::Variant; 2]);
}

#[test]
fn skins_are_compared_by_their_joints() {
    let mut before = square(&[]);
    before.json["nodes"] = json!([{"name": "square", "mesh": 0, "skin": 0}, {"name": "hip"}, {"name": "knee"}]);
    before.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    before.json["skins"] = json!([{"joints": [1, 2]}]);
    assert_eq!(kinds(&report(&before, &before)), []);
    let swapped = changed(&before, |json| json["skins"][0]["joints"] = json!([2, 1]));
    assert_eq!(kinds(&report(&before, &swapped)), [], "their order does not matter, as no vertex refers to them");
    for change in [
        (|json: &mut Value| json["skins"][0]["joints"] = json!([1])) as Change,
        |json| json["skins"][0]["skeleton"] = 1.into(),
        |json| drop(json["nodes"][0].as_object_mut().unwrap().remove("skin")),
    ] {
        assert_eq!(kinds(&report(&before, &changed(&before, change))), [Kind::Skin]);
    }
}

#[test]
fn points_and_lines_are_compared_by_place() {
    let mut before = square(&[]);
    before.json["materials"] = json!([{}, {"doubleSided": true}]);
    let position = before.json["meshes"][0]["primitives"][0]["attributes"].clone();
    let strokes = json!([
        {"mode": 0, "attributes": position}, {"mode": 2, "attributes": position, "material": 1},
        {"mode": 3, "attributes": position}
    ]);
    before.json["meshes"].as_array_mut().unwrap().push(json!({"primitives": strokes}));
    before.json["nodes"].as_array_mut().unwrap().push(json!({"name": "strokes", "mesh": 1}));
    before.json["scenes"][0]["nodes"] = json!([0, 1]);
    assert_eq!(report(&before, &before).compared.points_and_lines, 4 + 4 + 3);
    assert_each_is_found(
        &before,
        &[
            (Kind::StrokeMaterial, |json| json["meshes"][1]["primitives"][0]["material"] = 1.into()),
            (Kind::StrokeMissing, |json| json["meshes"][1]["primitives"][1]["mode"] = 3.into()),
            (Kind::StrokeAdded, |json| {
                let copy = json["meshes"][1]["primitives"][2].clone();
                json["meshes"][1]["primitives"].as_array_mut().unwrap().push(copy);
            }),
        ],
    );
    let moved = changed(&before, |json| json["nodes"][1]["translation"] = json!([0, 0, 0.1]));
    let found = report(&before, &moved);
    assert_eq!(
        kinds(&found),
        [Kind::StrokeMissing, Kind::StrokeMissing, Kind::StrokeAdded, Kind::StrokeAdded, Kind::NodeRescaled]
    );
    let turned = changed(&before, |json| json["meshes"][1]["primitives"].as_array_mut().unwrap().reverse());
    assert_eq!(kinds(&report(&before, &turned)), []);
}
