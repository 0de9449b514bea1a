//! Attributes are compared at every corner.

use serde_json::{Value, json};

use super::DifferenceKind as Kind;
use super::test_files::{changed, kinds, report, square};

const NORMALS: [f32; 12] = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.8];
const TANGENTS: [f32; 16] = [1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0];
const TEXCOORDS: [f32; 8] = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0];
const COLORS: [f32; 12] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.5, 0.5];
const CUSTOM: [f32; 4] = [1.0, 2.0, 3.0, f32::NAN];

/// The same values but for one.
fn with<const N: usize>(mut values: [f32; N], index: usize, value: f32) -> [f32; N] {
    values[index] = value;
    values
}

#[test]
fn every_attribute_is_compared() {
    let all = |n: &[f32; 12], t: &[f32; 16], uv: &[f32; 8], c: &[f32; 12], x: &[f32; 4]| {
        square(&[("NORMAL", 3, n), ("TANGENT", 4, t), ("TEXCOORD_0", 2, uv), ("COLOR_0", 3, c), ("_X", 1, x)])
    };
    let before = all(&NORMALS, &TANGENTS, &TEXCOORDS, &COLORS, &CUSTOM);
    let sound = report(&before, &before);
    assert_eq!(kinds(&sound), []);
    let names: Vec<&str> = sound.compared.corners.keys().map(String::as_str).collect();
    assert_eq!(names, ["COLOR_0", "NORMAL", "TANGENT", "TEXCOORD_0", "_X"]);
    assert!(sound.compared.corners.values().all(|corners| *corners == 6));
    let cases = [
        (Kind::Normal, all(&with(NORMALS, 9, 0.6), &TANGENTS, &TEXCOORDS, &COLORS, &CUSTOM)),
        (Kind::Tangent, all(&NORMALS, &with(TANGENTS, 3, -1.0), &TEXCOORDS, &COLORS, &CUSTOM)),
        (Kind::Tangent, all(&NORMALS, &with(TANGENTS, 1, 0.5), &TEXCOORDS, &COLORS, &CUSTOM)),
        (Kind::TextureCoordinates, all(&NORMALS, &TANGENTS, &with(TEXCOORDS, 7, 0.9), &COLORS, &CUSTOM)),
        (Kind::Color, all(&NORMALS, &TANGENTS, &TEXCOORDS, &with(COLORS, 5, 0.1), &CUSTOM)),
        (Kind::CustomAttribute, all(&NORMALS, &TANGENTS, &TEXCOORDS, &COLORS, &with(CUSTOM, 3, 4.0))),
    ];
    for (kind, after) in cases {
        let found = report(&before, &after);
        assert_eq!(kinds(&found), [kind]);
        assert_eq!(found.differences[0].object.as_deref(), Some("square"));
        assert!((1..=2).contains(&found.differences[0].count), "{found:?}");
    }
}

#[test]
fn what_is_missing_is_an_error_only_if_it_is_used() {
    let before = square(&[("NORMAL", 3, &NORMALS), ("TEXCOORD_0", 2, &TEXCOORDS), ("TANGENT", 4, &TANGENTS)]);
    let without = |name: &str| {
        changed(&before, |json| {
            json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove(name);
        })
    };
    assert_eq!(kinds(&report(&before, &without("NORMAL"))), [Kind::AttributeMissing]);
    assert_eq!(kinds(&report(&without("NORMAL"), &before)), [Kind::AttributeAdded]);
    assert_eq!(kinds(&report(&before, &without("TANGENT"))), [Kind::UnusedAttribute]);
    assert_eq!(kinds(&report(&before, &without("TEXCOORD_0"))), [Kind::UnusedAttribute]);
    let textured = |json: &mut Value| json["materials"][0] = json!({"normalTexture": {"index": 0}});
    for name in ["TANGENT", "TEXCOORD_0"] {
        let found = report(&changed(&before, textured), &changed(&without(name), textured));
        assert_eq!(kinds(&found), [Kind::AttributeMissing], "{name}");
    }
}

#[test]
fn white_is_the_color_of_what_has_none() {
    let bare = square(&[]);
    assert_eq!(kinds(&report(&bare, &square(&[("COLOR_0", 4, &[1.0; 16])]))), []);
    assert_eq!(kinds(&report(&bare, &square(&[("COLOR_0", 3, &COLORS)]))), [Kind::Color]);
}

#[test]
fn directions_are_compared_in_the_world() {
    let before = square(&[("NORMAL", 3, &NORMALS), ("TANGENT", 4, &TANGENTS)]);
    // Half the size in a node twice as large, turned by a half turn about z and back.
    let turned = changed(&before, |json| {
        json["nodes"][0]["rotation"] = json!([0, 0, 1, 0]);
        json["nodes"][0]["name"] = "above".into();
        json["nodes"][0].as_object_mut().unwrap().remove("mesh");
        json["nodes"][0]["children"] = json!([1]);
        json["nodes"].as_array_mut().unwrap().push(json!({"name": "square", "mesh": 0, "rotation": [0, 0, 1, 0]}));
    });
    assert!(!report(&before, &turned).differences.iter().any(|d| [Kind::Normal, Kind::Tangent].contains(&d.kind)));
}

#[test]
fn texture_coordinates_are_compared_as_the_texture_transforms_them() {
    let textured = |scale: [f64; 2], set: usize| {
        json!([{"normalTexture": {"index": 0, "texCoord": set,
            "extensions": {"KHR_texture_transform": {"scale": scale}}}}])
    };
    let of = |set: &str, values: &[f32; 8], materials: Value| {
        changed(&square(&[(set, 2, values)]), |json| json["materials"] = materials)
    };
    let before = of("TEXCOORD_0", &TEXCOORDS, textured([1.0, 1.0], 0));
    let scaled = of("TEXCOORD_1", &TEXCOORDS.map(|x| x / 2.0), textured([2.0, 2.0], 1));
    assert!(!report(&before, &scaled).has_errors());
    let off = of("TEXCOORD_0", &TEXCOORDS, textured([2.0, 1.0], 0));
    assert_eq!(kinds(&report(&before, &off)), [Kind::TextureTransform]);
}

#[test]
fn morph_targets_are_compared_as_displacements() {
    let moved = |x: f32| {
        let values = with([0.0; 12], 3, x);
        let mut doc = square(&[("_TARGET", 3, &values)]);
        let primitive = &mut doc.json["meshes"][0]["primitives"][0];
        let accessor = primitive["attributes"].as_object_mut().unwrap().remove("_TARGET").unwrap();
        primitive["targets"] = json!([{ "POSITION": accessor }]);
        doc
    };
    assert_eq!(kinds(&report(&moved(0.5), &moved(0.5))), []);
    assert_eq!(kinds(&report(&moved(0.5), &moved(0.501))), [Kind::MorphTarget]);
    assert_eq!(kinds(&report(&moved(0.0), &square(&[]))), [], "no displacement is none");
    assert_eq!(kinds(&report(&moved(0.5), &square(&[]))), [Kind::MorphTarget]);
}
