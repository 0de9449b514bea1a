//! What alpha-tested materials test.

use glam::{DAffine2, DVec2};
use raykiln_formats::Document;
use raykiln_formats::alpha::{AlphaTest, Texture, Wrap};
use serde_json::{Value, json};

use crate::support::triangle;

/// The triangle with one material and what it may refer to.
fn material(material: Value) -> Document {
    let mut doc = triangle();
    doc.json["materials"] = json!([material]);
    doc.json["samplers"] = json!([{}, {"wrapS": 33071, "wrapT": 33648}]);
    doc.json["textures"] = json!([
        {"source": 1},
        {"source": 0, "sampler": 1},
        {"sampler": 0, "extensions": {"KHR_texture_basisu": {"source": 2}}},
        {}
    ]);
    doc.json["images"] = json!([
        {"uri": "data:image/png;base64,AAEC"}, {"bufferView": 0, "mimeType": "image/png"}, {"uri": "a%20b.ktx2"}
    ]);
    doc
}

fn textured(info: Value) -> Result<Texture, String> {
    let doc = material(json!({"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": info}}));
    let test = doc.alpha_test(0).map_err(|e| e.to_string())?;
    Ok(test.texture.expect("it has a texture"))
}

#[test]
fn factor_and_cutoff_have_the_defaults_of_gltf() {
    let test = |json| material(json).alpha_test(0).expect("it is sound");
    let plain = AlphaTest { cutoff: 0.5, factor: 1.0, texture: None };
    assert_eq!(test(json!({"alphaMode": "MASK"})), plain);
    let color = json!({"baseColorFactor": [1, 1, 1, 0.25]});
    let said = test(json!({"alphaMode": "MASK", "alphaCutoff": 0.75, "pbrMetallicRoughness": color}));
    assert_eq!(said, AlphaTest { cutoff: 0.75, factor: 0.25, texture: None });
}

#[test]
fn textures_say_image_set_and_wrapping() {
    let plain = Texture { image: 1, texcoord: 0, wrap: [Wrap::Repeat; 2], transform: DAffine2::IDENTITY };
    assert_eq!(textured(json!({"index": 0})), Ok(plain.clone()));
    let wrapped = Texture { image: 0, texcoord: 3, wrap: [Wrap::Clamp, Wrap::Mirror], ..plain.clone() };
    assert_eq!(textured(json!({"index": 1, "texCoord": 3})), Ok(wrapped));
    assert_eq!(textured(json!({"index": 2})), Ok(Texture { image: 2, ..plain }));
}

#[test]
fn a_transform_scales_turns_and_moves_in_that_order_and_may_name_another_set() {
    let transform =
        json!({"offset": [10, 20], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2, 3], "texCoord": 1});
    let info = json!({"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": transform}});
    let found = textured(info).expect("it is sound");
    assert_eq!(found.texcoord, 1);
    let moved = found.transform.transform_point2(DVec2::new(1.0, 1.0));
    // Counter-clockwise where v points down.
    assert!((moved - DVec2::new(13.0, 18.0)).length() < 1e-12, "{moved}");
}

#[test]
fn what_breaks_a_rule_is_an_error_that_names_the_place() {
    for (info, place) in [
        (json!({"index": 9}), "textures[9] does not exist"),
        (json!({"index": 3}), "textures[3]"),
        (json!({}), "index"),
        (json!({"index": 0, "texCoord": -1}), "texCoord"),
        (json!({"index": 0, "extensions": {"KHR_texture_transform": {"scale": [1]}}}), "scale"),
    ] {
        let error = textured(info.clone()).expect_err("it is broken");
        assert!(error.contains(place), "{info}: {error}");
    }
    assert!(material(json!({})).alpha_test(1).is_err());
}

#[test]
fn images_are_read_from_views_and_data_uris_and_named() {
    let doc = material(json!({}));
    assert_eq!(doc.image(0).read().as_deref(), Ok(&[0, 1, 2][..]));
    assert_eq!(doc.image(1).read().map(|bytes| bytes.len()), Ok(36));
    assert_eq!(doc.image(2).name, "images[2] `a b.ktx2`");
    assert!(doc.image(2).read().is_err_and(|e| e.contains("a b.ktx2 cannot be read")));
    assert!(doc.image(7).read().is_err());
}

#[test]
fn texture_coordinates_are_dequantised_or_refused() {
    let mut doc = triangle();
    doc.buffers.push(vec![0, 255, 51, 0, 0, 0, 255, 102].into());
    let push = |list: &mut Value, item| list.as_array_mut().expect("a list").push(item);
    push(&mut doc.json["buffers"], json!({"byteLength": 8}));
    push(&mut doc.json["bufferViews"], json!({"buffer": 1, "byteLength": 8}));
    let accessor = json!({"bufferView": 1, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC2"});
    push(&mut doc.json["accessors"], accessor);
    doc.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = 1.into();
    let found = doc.texcoords(0, 0, 1).expect("it is sound");
    assert_eq!(found, [[0.0, 1.0], [0.2, 0.0], [0.0, 0.0]]);
    assert!(doc.texcoords(0, 0, 0).is_err() && doc.texcoords(0, 1, 1).is_err() && doc.texcoords(1, 0, 1).is_err());
    doc.json["accessors"][1]["type"] = "VEC3".into();
    assert!(doc.texcoords(0, 0, 1).is_err());
}
