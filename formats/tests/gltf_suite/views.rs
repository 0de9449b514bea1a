//! The rest of the view: animations, skins, materials, cameras, names.

use raykiln_formats::contents::{Camera, Hold, Look, Opacity};
use raykiln_formats::{Contents, Document};
use serde_json::{Value, json};

use crate::support::{contents, refusal, triangle};

/// Three nodes, the last two with the triangle, and an animation channel with the given target.
fn animated(target: Value) -> Document {
    let mut doc = triangle();
    doc.json["nodes"] = json!([{}, { "mesh": 0 }, { "mesh": 0 }]);
    doc.json["animations"] = json!([{
        "samplers": [{ "input": 0, "output": 0 }], "channels": [{ "sampler": 0, "target": target }]
    }]);
    doc
}

fn flags(c: &Contents) -> Vec<bool> {
    c.nodes.iter().map(|n| n.animated).collect()
}

fn pointer(pointer: &str) -> Value {
    json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } })
}

#[test]
fn animated_nodes_are_marked_and_no_others() {
    for path in ["translation", "rotation", "scale", "weights"] {
        assert_eq!(flags(&contents(&animated(json!({ "node": 1, "path": path })))), [false, true, false]);
    }
    assert_eq!(flags(&contents(&animated(json!({ "path": "scale" })))), [false; 3]);
}

#[test]
fn animation_pointers_mark_nodes_and_the_users_of_meshes() {
    assert_eq!(flags(&contents(&animated(pointer("/nodes/2/translation")))), [false, false, true]);
    assert_eq!(flags(&contents(&animated(pointer("/meshes/0/weights/1")))), [false, true, true]);
    assert_eq!(flags(&contents(&animated(pointer("/materials/0/emissiveFactor")))), [false; 3]);
    let error = refusal(&animated(pointer("/nodes/3/scale")));
    assert_eq!(error.cause, "points to nothing");
    assert_eq!(error.place, "animations[0].channels[0].target.extensions.KHR_animation_pointer.pointer");
}

#[test]
fn animations_are_checked() {
    let change = |path: &str, value: Value| {
        let mut doc = animated(json!({ "node": 1, "path": "scale" }));
        *doc.json.pointer_mut(path).unwrap() = value;
        refusal(&doc).place
    };
    assert_eq!(change("/animations/0/channels/0/target/node", 3.into()), "animations[0].channels[0].target.node");
    assert_eq!(change("/animations/0/channels/0/sampler", 1.into()), "animations[0].channels[0].sampler");
    assert_eq!(change("/animations/0/samplers/0/input", 1.into()), "animations[0].samplers[0].input");
    assert_eq!(change("/animations/0/samplers/0/output", 1.into()), "animations[0].samplers[0].output");
}

#[test]
fn skinned_nodes_are_marked_and_skins_checked() {
    let mut doc = triangle();
    doc.json["nodes"][0]["skin"] = 0.into();
    doc.json["skins"] = json!([{ "joints": [0] }]);
    assert!(contents(&doc).nodes[0].skin.is_some());
    for (key, value) in [("joints", json!([1])), ("skeleton", json!(1)), ("inverseBindMatrices", json!(1))] {
        doc.json["skins"] = json!([{ "joints": [0] }]);
        doc.json["skins"][0][key] = value;
        assert!(refusal(&doc).place.starts_with(&format!("skins[0].{key}")));
    }
}

#[test]
fn nodes_are_held_by_their_extensions() {
    for (extensions, hold) in [
        (json!({ "ACME_switch": {} }), Some(Hold::Extension)),
        (json!({ "MSFT_lod": { "ids": [] } }), Some(Hold::Extension)),
        (json!({ "KHR_lights_punctual": { "light": 0 } }), Some(Hold::Attached)),
        (json!({ "KHR_xmp_json_ld": { "packet": 0 } }), None),
    ] {
        let mut doc = triangle();
        doc.json["nodes"][0]["extensions"] = extensions;
        assert_eq!(contents(&doc).nodes[0].hold, hold);
    }
}

#[test]
fn materials_tell_how_rays_pass() {
    let mut doc = triangle();
    doc.json["materials"] = json!([
        {}, { "name": "leaf", "alphaMode": "MASK", "doubleSided": true }, { "alphaMode": "MASK", "alphaCutoff": 0.1 },
        { "alphaMode": "BLEND" }, { "alphaMode": "ODD" }
    ]);
    let c = contents(&doc);
    let opacities: Vec<Opacity> = c.materials.iter().map(|m| m.opacity).collect();
    let mask = |cutoff| Opacity::Mask { cutoff };
    assert_eq!(opacities, [Opacity::Opaque, mask(0.5), mask(0.1), Opacity::Blend, Opacity::Opaque]);
    assert_eq!((c.materials[1].name.as_deref(), c.materials[1].double_sided), (Some("leaf"), true));
    assert!(c.warnings[0].to_string().contains("materials[4]: the alphaMode \"ODD\" is unknown"));
}

#[test]
fn malformed_materials_are_refused() {
    for material in [json!({ "alphaMode": 1 }), json!({ "doubleSided": 1 }), json!([])] {
        let mut doc = triangle();
        doc.json["materials"] = json!([material]);
        assert!(refusal(&doc).place.starts_with("materials[0]"));
    }
}

#[test]
fn cameras_are_read() {
    let mut doc = triangle();
    doc.json["cameras"] = json!([
        { "type": "perspective", "perspective": { "yfov": 0.5, "znear": 1, "aspectRatio": 2 } },
        { "type": "orthographic", "orthographic": { "xmag": 2, "ymag": 3, "znear": 0, "zfar": 1 } }
    ]);
    doc.json["nodes"][0]["camera"] = 1.into();
    let c = contents(&doc);
    assert_eq!(c.nodes[0].camera, Some(1));
    assert_eq!(c.cameras[0], Camera::Perspective { yfov: 0.5, aspect_ratio: Some(2.0) });
    assert_eq!(c.cameras[1], Camera::Orthographic { xmag: 2.0, ymag: 3.0 });
}

#[test]
fn malformed_cameras_are_refused() {
    for (camera, place) in [
        (json!({}), "cameras[0].type"),
        (json!({ "type": "fisheye" }), "cameras[0].type"),
        (json!({ "type": "perspective" }), "cameras[0].perspective"),
        (json!({ "type": "perspective", "perspective": { "yfov": 0 } }), "cameras[0].perspective.yfov"),
    ] {
        let mut doc = triangle();
        doc.json["cameras"] = json!([camera]);
        assert_eq!(refusal(&doc).place, place);
    }
}

#[test]
fn names_are_kept() {
    let mut doc = triangle();
    doc.json["nodes"][0]["name"] = "Knoten ❤".into();
    doc.json["meshes"][0]["name"] = "Netz".into();
    let c = contents(&doc);
    assert_eq!((c.nodes[0].name.as_deref(), c.meshes[0].name.as_deref()), (Some("Knoten ❤"), Some("Netz")));
}

#[test]
fn a_document_without_anything_has_empty_contents() {
    let doc = crate::support::document(json!({ "asset": { "version": "2.0" } }), &[]);
    let c = contents(&doc);
    assert!(c.nodes.is_empty() && c.roots.is_empty() && c.meshes.is_empty() && c.warnings.is_empty());
}

#[test]
fn required_extensions_are_checked_here_too() {
    let mut doc = triangle();
    doc.json["extensionsRequired"] = json!(["ACME_curves"]);
    assert!(refusal(&doc).cause.contains("ACME_curves"));
}

#[test]
fn the_look_of_a_material_is_read_to_six_digits() {
    let mut doc = triangle();
    doc.json["materials"] = json!([
        {},
        {
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1_f32, 0.123_456_789, -0.0, 1],
                "metallicFactor": 0,
                "roughnessFactor": 0.25,
                "metallicRoughnessTexture": {"index": 0}
            },
            "emissiveFactor": [1, 2, 3],
            "normalTexture": {"index": 0}
        },
        {"pbrMetallicRoughness": {"baseColorFactor": ["red"], "metallicFactor": null}, "emissiveFactor": [1]},
    ]);
    let look = |i: usize| contents(&doc).materials[i].look;
    assert_eq!(look(0), Look::default());
    let said = Look {
        base_color: [0.1, 0.123_457, 0.0, 1.0],
        metallic: 0.0,
        roughness: 0.25,
        emissive: [1.0, 2.0, 3.0],
        textures: [false, true, true, false, false],
    };
    assert_eq!(look(1), said);
    assert_eq!(look(2), Look::default(), "what is not as it should be is as if it were not there");
}

#[test]
fn materials_that_differ_in_name_alone_are_told() {
    let mut doc = triangle();
    let textured = json!({ "index": 0, "texCoord": 1 });
    doc.json["materials"] = json!([
        { "name": "a", "doubleSided": true, "pbrMetallicRoughness": { "baseColorTexture": textured } },
        { "name": "b" },
        { "pbrMetallicRoughness": { "baseColorTexture": textured }, "extras": 1, "doubleSided": true },
        { "extras": 2 },
        { "extensions": { "KHR_materials_unlit": {} } },
    ]);
    let same_as: Vec<Option<usize>> = contents(&doc).materials.iter().map(|m| m.same_as).collect();
    assert_eq!(same_as, [None, None, Some(0), Some(1), None]);
}
