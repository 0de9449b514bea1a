//! `EXT_mesh_gpu_instancing`.

use glam::{DAffine3, DQuat, DVec3};
use raykiln_formats::Document;
use raykiln_formats::document::{Component, Element};
use raykiln_formats::edit::{NewAccessor, Target};
use serde_json::json;

use crate::support::{contents, floats, refusal, triangle};

const F32: Component = Component::F32;

/// A triangle with copies; each attribute is a name, a component type, a length of vectors and their bytes.
fn copies(attributes: &[(&str, Component, usize, Vec<u8>)]) -> Document {
    let mut doc = triangle();
    doc.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": {} } });
    for (name, component, components, data) in attributes {
        let element = Element { component: *component, components: *components, normalized: *component != F32 };
        let new = NewAccessor { data: data.clone(), element, target: Target::Vertices, bounds: false };
        let index = doc.add_accessor(new);
        doc.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"][*name] = index.into();
    }
    doc
}

fn placed(doc: &Document) -> Vec<DAffine3> {
    contents(doc).nodes[0].copies.clone().unwrap()
}

#[test]
fn copies_have_translation_rotation_and_scale() {
    let doc = copies(&[
        ("TRANSLATION", F32, 3, floats(&[1.0, 2.0, 3.0, 0.0, 0.0, 0.0])),
        ("ROTATION", F32, 4, floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 2.0])),
        ("SCALE", F32, 3, floats(&[2.0, 2.0, 2.0, 1.0, 1.0, 1.0])),
    ]);
    let all = placed(&doc);
    let turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
    let expected =
        DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), DQuat::IDENTITY, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(all[0], expected);
    assert!(all[1].abs_diff_eq(DAffine3::from_quat(turn), 1e-15));
}

#[test]
fn quantised_rotations_are_read() {
    let eighth = |c: [i16; 4]| c.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let wide = copies(&[("ROTATION", Component::I16, 4, eighth([32767, 0, 0, 0]))]);
    let narrow = copies(&[("ROTATION", Component::I8, 4, vec![127, 0, 0, 0])]);
    let half_turn = DAffine3::from_quat(DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0));
    assert_eq!(placed(&wide), [half_turn]);
    assert_eq!(placed(&narrow), [half_turn]);
}

#[test]
fn a_zero_rotation_is_none_with_one_warning() {
    let doc = copies(&[("ROTATION", F32, 4, floats(&[0.0; 8]))]);
    assert_eq!(placed(&doc), [DAffine3::IDENTITY; 2]);
    let warnings = contents(&doc).warnings;
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].message.starts_with("2 quaternions are zero"));
}

#[test]
fn custom_attributes_count_copies_too() {
    assert_eq!(placed(&copies(&[("_ID", F32, 1, floats(&[1.0, 2.0, 3.0]))])), [DAffine3::IDENTITY; 3]);
}

#[test]
fn nodes_without_the_extension_have_no_copies() {
    assert_eq!(contents(&triangle()).nodes[0].copies, None);
}

#[test]
fn broken_copies_are_refused() {
    let one = floats(&[0.0; 3]);
    let cause = |attributes: &[_]| refusal(&copies(attributes)).cause;
    assert!(cause(&[]).contains("there are none"));
    let two = floats(&[0.0; 6]);
    assert!(cause(&[("TRANSLATION", F32, 3, one), ("SCALE", F32, 3, two)]).contains("2 copies, but others have 1"));
    assert!(cause(&[("SCALE", F32, 2, floats(&[1.0; 2]))]).contains("of a type that the extension does not allow"));
    assert!(cause(&[("ROTATION", Component::U8, 4, vec![1; 4])]).contains("of a type"));
    assert!(cause(&[("SCALE", F32, 3, floats(&[1.0, f32::NAN, 1.0]))]).contains("copy 0 is not finite"));
}
