use super::*;
use crate::motion::{MovingScene, PlacedCopies};
use crate::scene::{LoadOptions, Scene, load};

/// Puts arrays of floats into accessors of the given types, and returns the JSON of accessors, views and buffer.
fn accessors(arrays: &[(&str, &[f32])]) -> String {
    let (mut bytes, mut accessors, mut views) = (Vec::<u8>::new(), Vec::new(), Vec::new());
    for (i, (kind, numbers)) in arrays.iter().enumerate() {
        let size =
            [("SCALAR", 1), ("VEC3", 3), ("VEC4", 4), ("MAT4", 16)].iter().find(|k| k.0 == *kind).expect("a type").1;
        let bounds = if i == 0 { r#", "min": [0, 0, 0], "max": [1, 1, 0]"# } else { "" };
        let count = numbers.len() / size;
        accessors.push(format!(
            r#"{{"bufferView": {i}, "componentType": 5126, "count": {count}, "type": "{kind}"{bounds}}}"#
        ));
        views.push(format!(r#"{{"buffer": 0, "byteOffset": {}, "byteLength": {}}}"#, bytes.len(), 4 * numbers.len()));
        bytes.extend_from_slice(bytemuck::cast_slice(numbers));
    }
    let data: String = bytes.iter().map(|byte| format!("%{byte:02X}")).collect();
    format!(
        r#""accessors": [{}], "bufferViews": [{}],
        "buffers": [{{"byteLength": {}, "uri": "data:application/octet-stream,{data}"}}]"#,
        accessors.join(","),
        views.join(","),
        bytes.len()
    )
}

fn document(nodes: &str, mesh: &str, more: &str, animations: &str, arrays: &[(&str, &[f32])]) -> Document {
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": {nodes},
        "meshes": [{{"primitives": [{mesh}]}}], {more} "animations": {animations}, {}}}"#,
        accessors(arrays)
    );
    raykiln_formats::read_bytes("rig.gltf", json.into_bytes()).expect("valid glTF")
}

fn scene_of(doc: &Document) -> Scene {
    load(doc, &LoadOptions::default()).expect("a scene").0
}

/// The scene of a document at times.
fn played(doc: &Document, times: &[f64]) -> Vec<Scene> {
    let scene = scene_of(doc);
    let rig = Rig::read(doc, &scene, 0).expect("sound").expect("something moves");
    let mut moving = MovingScene::new(&scene, &Scene::default(), 1.0, PlacedCopies::default());
    moving.play(rig, Some);
    let at = |time: &f64| {
        moving.advance(*time);
        moving.scene().clone()
    };
    times.iter().map(at).collect()
}

fn corner(scene: &Scene, instance: u32, corner: usize) -> DVec3 {
    scene.world_corners(crate::scene::TriangleRef { instance, triangle: 0 })[corner]
}

const TRIANGLE: &[f32] = &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;

#[test]
fn nodes_move_with_their_ancestors_and_the_animation_begins_again() {
    let doc = document(
        r#"[{"children": [1], "translation": [0, 0, 5]}, {"mesh": 0, "translation": [2, 0, 0]}]"#,
        r#"{"attributes": {"POSITION": 0}}"#,
        "",
        r#"[{"channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}},
                          {"sampler": 1, "target": {"node": 1, "path": "scale"}},
                          {"sampler": 2, "target": {"node": 1, "path": "translation"}}],
            "samplers": [{"input": 1, "output": 2}, {"input": 1, "output": 3, "interpolation": "STEP"},
                         {"input": 1, "output": 4, "interpolation": "CUBICSPLINE"}]}]"#,
        &[
            ("VEC3", TRIANGLE),
            ("SCALAR", &[0.0, 2.0]),
            ("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, HALF, 0.0, HALF]),
            ("VEC3", &[1.0, 1.0, 1.0, 3.0, 3.0, 3.0]),
            ("VEC3", &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ],
    );
    let scenes = played(&doc, &[0.0, 1.0, 1.999_999, 2.0, 3.0]);
    assert!(corner(&scenes[0], 0, 1).distance(DVec3::new(3.0, 0.0, 5.0)) < 1e-6);
    let eighth = std::f64::consts::FRAC_1_SQRT_2;
    let expected = DVec3::new(4.0 * eighth, 0.0, 5.0 - 4.0 * eighth);
    assert!(corner(&scenes[1], 0, 1).distance(expected) < 1e-6, "{}", corner(&scenes[1], 0, 1));
    assert!(corner(&scenes[2], 0, 1).distance(DVec3::new(0.0, 0.0, 0.0)) < 1e-4, "{}", corner(&scenes[2], 0, 1));
    assert_eq!(corner(&scenes[3], 0, 1), corner(&scenes[0], 0, 1));
    assert_eq!(corner(&scenes[4], 0, 1), corner(&scenes[1], 0, 1));
}

#[test]
fn a_mirrored_node_keeps_its_scale_while_it_turns() {
    let doc = document(
        r#"[{"mesh": 0, "scale": [1, -1, 1]}]"#,
        r#"{"attributes": {"POSITION": 0}}"#,
        "",
        r#"[{"channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
            "samplers": [{"input": 1, "output": 2}]}]"#,
        &[("VEC3", TRIANGLE), ("SCALAR", &[0.0, 1.0]), ("VEC4", &[0.0, 0.0, HALF, HALF, 0.0, 0.0, HALF, HALF])],
    );
    let scene = &played(&doc, &[0.5])[0];
    // The corner at (0, 1, 0) is mirrored to (0, -1, 0) and turned to (1, 0, 0); mirrored corners are swapped.
    assert!(corner(scene, 0, 1).distance(DVec3::X) < 1e-6, "{}", corner(scene, 0, 1));
}

#[test]
fn morph_targets_move_vertices_by_their_weights() {
    let doc = document(
        r#"[{"mesh": 0, "translation": [0, 0, 7], "weights": [0.5, 1]}]"#,
        r#"{"attributes": {"POSITION": 0}, "targets": [{"POSITION": 1}, {"POSITION": 2}]}"#,
        "",
        r#"[{"channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
            "samplers": [{"input": 3, "output": 4}]}]"#,
        &[
            ("VEC3", TRIANGLE),
            ("VEC3", &[0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            ("VEC3", &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            ("SCALAR", &[0.0, 1.0]),
            ("SCALAR", &[0.0, 0.0, 1.0, 4.0]),
        ],
    );
    let scenes = played(&doc, &[0.0, 0.5]);
    assert_eq!(corner(&scenes[0], 0, 0), DVec3::new(0.0, 0.0, 7.0));
    assert_eq!(corner(&scenes[1], 0, 0), DVec3::new(2.0, 0.0, 8.0));
    assert_eq!(corner(&scenes[1], 0, 1), DVec3::new(1.0, 0.0, 7.0));
    assert!(scenes[1].meshes[1].bounds().max.z == 1.0 && scenes[1].instance_boxes()[0].max.z == 8.0);
    scenes[1].check().expect("a sound scene");
}

#[test]
fn a_skin_moves_vertices_with_their_joints_and_ignores_the_node_that_places_it() {
    let bind = |z: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -z, 1.0];
    let matrices = [bind(5.0), bind(0.0)].concat();
    let doc = document(
        r#"[{"mesh": 0, "skin": 0, "translation": [100, 0, 0], "children": [1, 2]}, {"translation": [0, 0, 5]}, {}]"#,
        r#"{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}"#,
        r#""skins": [{"joints": [1, 2], "inverseBindMatrices": 3}],"#,
        r#"[{"channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}],
            "samplers": [{"input": 4, "output": 5}]}]"#,
        &[
            ("VEC3", TRIANGLE),
            ("VEC4", &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
            ("VEC4", &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.25, 0.25, 0.0, 0.0]),
            ("MAT4", &matrices),
            ("SCALAR", &[0.0, 1.0]),
            ("VEC3", &[0.0, 0.0, 5.0, 0.0, 8.0, 5.0]),
        ],
    );
    let scene = &played(&doc, &[0.5])[0];
    let corners = [0, 1, 2].map(|i| corner(scene, 0, i));
    assert_eq!(corners, [DVec3::new(100.0, 4.0, 0.0), DVec3::new(101.0, 0.0, 0.0), DVec3::new(100.0, 3.0, 0.0)]);
}

#[test]
fn what_stands_still_has_no_rig() {
    let doc = document(
        r#"[{"mesh": 0}]"#,
        r#"{"attributes": {"POSITION": 0}}"#,
        "",
        r#"[{"channels": [], "samplers": []}]"#,
        &[("VEC3", TRIANGLE)],
    );
    let scene = scene_of(&doc);
    assert!(
        Rig::read(&doc, &scene, 0).expect("sound").is_none() && Rig::read(&doc, &scene, 1).expect("sound").is_none()
    );
}
