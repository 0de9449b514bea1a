//! Materials are compared by content.

use raykiln_formats::Document;
use serde_json::{Value, json};

use super::DifferenceKind as Kind;
use super::test_files::{changed, kinds, report, sample};
use super::{Detail, Severity};

/// The textured sample with more properties.
fn textured() -> Document {
    changed(&sample("textured"), |json| {
        let material = &mut json["materials"][0];
        material["extensions"] = json!({"KHR_materials_ior": {"ior": 1.4}});
        material["alphaMode"] = "MASK".into();
    })
}

type Change = fn(&mut Value);

#[test]
fn every_property_of_a_material_is_compared() {
    let cases: [(Kind, Change); 9] = [
        (Kind::MaterialFactor, |m| m["emissiveFactor"] = json!([0.0, 0.5, 0.0])),
        (Kind::MaterialFactor, |m| m["pbrMetallicRoughness"]["roughnessFactor"] = 0.123.into()),
        (Kind::AlphaMode, |m| m["alphaMode"] = "BLEND".into()),
        (Kind::AlphaMode, |m| m["alphaCutoff"] = 0.4.into()),
        (Kind::DoubleSided, |m| m["doubleSided"] = (m["doubleSided"] != true).into()),
        (Kind::MaterialExtension, |m| m["extensions"]["KHR_materials_ior"]["ior"] = 1.5.into()),
        (Kind::MaterialExtension, |m| m["extensions"]["KHR_materials_unlit"] = json!({})),
        (Kind::MaterialExtras, |m| m["extras"] = json!({"a": 1})),
        (Kind::TextureMissing, |m| {
            m["pbrMetallicRoughness"].as_object_mut().unwrap().remove("baseColorTexture");
        }),
    ];
    let before = textured();
    assert_eq!(kinds(&report(&before, &before)), []);
    for (kind, change) in cases {
        let found = report(&before, &changed(&before, |json| change(&mut json["materials"][0])));
        assert!(kinds(&found).contains(&kind) && found.has_errors(), "{kind:?}: {found:?}");
        assert!(found.differences[0].object.is_some() && found.differences[0].count > 0, "{found:?}");
    }
}

#[test]
fn defaults_and_names_do_not_matter() {
    let before = textured();
    let after = changed(&before, |json| {
        let material = &mut json["materials"][0];
        material["emissiveFactor"] = json!([0, 0, 0]);
        material["alphaCutoff"] = 0.5.into();
        material["extensions"]["KHR_materials_clearcoat"] = json!({"clearcoatFactor": 0.0});
        material["extensions"]["KHR_materials_ior"]["ior"] = 1.399_999_976_158_142.into();
    });
    assert_eq!(kinds(&report(&before, &after)), []);
    let renamed = report(&before, &changed(&before, |json| json["materials"][0]["name"] = "brick.001".into()));
    assert_eq!(kinds(&renamed), [Kind::MaterialName]);
    assert_eq!(renamed.differences[0].severity, Severity::Note);
}

#[test]
fn the_same_image_under_another_index_is_the_same_and_another_is_not() {
    let before = textured();
    let twin = changed(&before, |json| {
        let image = json["images"][0].clone();
        json["images"].as_array_mut().unwrap().push(image);
        json["textures"][0]["source"] = 1.into();
    });
    assert_eq!(kinds(&report(&before, &twin)), []);
    let png = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";
    let other = changed(&before, |json| json["images"][0]["uri"] = png.into());
    let found = report(&before, &other);
    assert_eq!(kinds(&found), [Kind::TextureImage]);
    let Some(Detail::Property { property, .. }) = &found.differences[0].detail else { panic!("{found:?}") };
    assert_eq!(property, "pbrMetallicRoughness.baseColorTexture.texture.image");
}

#[test]
fn the_sampler_of_a_texture_is_compared() {
    let before = textured();
    let clamped = changed(&before, |json| {
        json["samplers"] = json!([{"wrapS": 33071}]);
        json["textures"][0]["sampler"] = 0.into();
    });
    let found = report(&before, &clamped);
    assert!(kinds(&found).contains(&Kind::TextureSampler), "{found:?}");
}

#[test]
fn images_that_cannot_be_read_are_compared_by_name() {
    let before = changed(&textured(), |json| json["images"][0]["uri"] = "lost.png".into());
    assert_eq!(kinds(&report(&before, &before)), [Kind::ImageUnreadable]);
    let other = changed(&before, |json| json["images"][0]["uri"] = "other.png".into());
    assert_eq!(kinds(&report(&before, &other)), [Kind::TextureImage]);
}

#[test]
fn exchanged_and_dropped_materials_are_found_by_the_objects_that_show_them() {
    let before = sample("overlapping");
    let count = before.material_count();
    assert!(count > 1);
    let exchanged = report(&before, &changed(&before, |json| json["materials"].as_array_mut().unwrap().swap(0, 1)));
    assert!(exchanged.has_errors() && exchanged.differences[0].object.is_some(), "{exchanged:?}");
    let dropped = report(
        &before,
        &changed(&before, |json| {
            json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
        }),
    );
    assert!(dropped.has_errors(), "{dropped:?}");
}

#[test]
fn an_image_that_neither_file_has_is_a_note() {
    let with = |source: u32| {
        changed(&sample("textured"), |json| {
            json["textures"][0]["extensions"] = json!({"KHR_texture_basisu": {"source": source}});
        })
    };
    let before = with(99);
    assert_eq!(kinds(&report(&before, &before)), [Kind::ImageUnreadable]);
    assert!(report(&before, &with(98)).has_errors());
}
