//! Each extension of the table, baked with content as its specification has it: where does it end up?

use std::collections::BTreeSet;

use raykiln_formats::known_extensions;
use raykiln_formats::properties::Property;
use serde_json::{Value, json};

use super::tests::{document, load, surface};
use super::*;
use crate::methods::{Method, run};

/// Number of nodes in [`quads`].
const COUNT: usize = 6;

/// The accessor of one number per triangle in [`quads`], and its buffer view. Those before it are unused.
const DATA: usize = 5;

/// Nodes with a quad each; the last two are never held.
fn quads() -> Document {
    let node = |i: usize| json!({"name": format!("n{i}"), "mesh": i, "translation": [i, 0, 0]});
    let mesh = |i: usize| json!({"name": format!("m{i}"), "primitives": [surface(0)]});
    let mut doc = document((0..COUNT).map(node).collect(), Value::Null);
    doc.json["meshes"] = (0..COUNT).map(mesh).collect();
    doc.add_scalars(&[9, 9, 9]);
    assert_eq!(doc.add_scalars(&[7, 5]), DATA);
    doc
}

/// Where an extension is put in [`quads`].
#[derive(Clone, Copy, Debug, PartialEq)]
enum At {
    Root,
    Node,
    Mesh,
    Primitive,
    Material,
    Other(&'static str),
}

impl At {
    fn pointer(self) -> &'static str {
        match self {
            At::Root => "",
            At::Node => "/nodes/0",
            At::Mesh => "/meshes/0",
            At::Primitive => "/meshes/0/primitives/0",
            At::Material => "/materials/0",
            At::Other(pointer) => pointer,
        }
    }
}

/// What the object says that carries an extension, with its references followed.
fn said(doc: &Document, at: At, name: &str) -> Option<Property> {
    let mesh = doc.json["nodes"][0]["mesh"].as_u64().map(|mesh| mesh as usize);
    match at {
        At::Root => doc.root_content().remove(name),
        At::Node => doc.node_content(0).extensions.remove(name),
        At::Mesh => doc.mesh_content(mesh?).extensions.remove(name),
        At::Primitive => doc.primitive_content(mesh?, 0).extensions.remove(name),
        At::Material => doc.material_content(Some(0)).properties.get("extensions")?.get(name).cloned(),
        At::Other(_) => None,
    }
}

/// Bakes [`quads`] with an extension on an object by `single`; returns the nodes that keep their mesh. What the extension
/// says must be what it said.
fn bake(name: &str, at: At, object: &Value) -> Vec<usize> {
    let mut doc = quads();
    doc.json["extensionsUsed"] = json!([name]);
    let mut extensions = doc.json.pointer(at.pointer()).and_then(|owner| owner.get("extensions")).cloned();
    extensions.get_or_insert_with(|| json!({}))[name] = object.clone();
    doc.json.pointer_mut(at.pointer()).expect("there is such an object")["extensions"] = extensions.into();
    let scene = load(&doc);
    let emitted = emit(&doc, &scene, &run(Method::Single, &scene, &Default::default()), &Options::default());
    let kept: Vec<usize> = (0..COUNT).filter(|&i| emitted.document.json["nodes"][i].get("mesh").is_some()).collect();
    if !matches!(at, At::Mesh | At::Primitive) || kept.contains(&0) {
        assert_eq!(said(&emitted.document, at, name), said(&doc, at, name), "{name} at {at:?}");
    }
    let (before, after) = (load(&doc).triangles_placed(), load(&emitted.document).triangles_placed());
    assert_eq!(before, after, "{name}");
    kept
}

const NONE: &[usize] = &[];
const OWN: &[usize] = &[0];

/// Content of each extension of the table, and which of the nodes keep their mesh.
#[rustfmt::skip] // one extension per entry reads as a table
fn examples() -> Vec<(&'static str, At, Value, &'static [usize])> {
    vec![
        ("KHR_materials_volume", At::Material, json!({"thicknessFactor": 2.5, "attenuationDistance": 4}), NONE),
        ("KHR_materials_clearcoat", At::Material, json!({"clearcoatFactor": 0.5}), NONE),
        ("ADOBE_materials_clearcoat_specular", At::Material, json!({"clearcoatIor": 1.6}), NONE),
        ("ADOBE_materials_thin_transparency", At::Material, json!({"transmissionFactor": 0.5}), NONE),
        ("ADOBE_materials_clearcoat_tint", At::Material, json!({"clearcoatTintFactor": [1, 0, 0]}), NONE),
        ("EXT_materials_bump", At::Material, json!({"bumpFactor": 2}), NONE),
        ("MSFT_packing_normalRoughnessMetallic", At::Material, json!({}), NONE),
        ("MSFT_packing_occlusionRoughnessMetallic", At::Material, json!({}), NONE),
        ("NV_materials_mdl", At::Root, json!({"modules": [{"bufferView": DATA, "mimeType": "application/vnd.mdl"}]}), NONE),
        ("VRMC_materials_mtoon", At::Material, json!({"specVersion": "1.0", "outlineWidthFactor": 0.01}), NONE),
        ("KHR_texture_transform", At::Material, json!({}), NONE),
        ("EXT_texture_webp", At::Material, json!({}), NONE),
        ("MSFT_texture_dds", At::Material, json!({}), NONE),
        ("MPEG_texture_video", At::Material, json!({}), NONE),
        ("KHR_materials_variants", At::Primitive, json!({"mappings": [{"material": 1, "variants": [0]}]}), NONE),
        ("KHR_mesh_quantization", At::Root, json!({}), NONE),
        ("EXT_instance_features", At::Node, json!({"featureIds": [{"featureCount": 1}]}), OWN),
        ("EXT_mesh_features", At::Primitive, json!({"featureIds": [{"featureCount": 4}]}), OWN),
        ("EXT_mesh_features", At::Primitive, json!({"featureIds": [{"featureCount": 4, "attribute": 0}]}), OWN),
        ("EXT_mesh_features", At::Primitive,
            json!({"featureIds": [{"featureCount": 4, "attribute": 0, "propertyTable": 0}]}), NONE),
        ("EXT_structural_metadata", At::Root, json!({"propertyTables": [{"properties": {"height": {"values": DATA}}}]}), NONE),
        ("EXT_mesh_manifold", At::Mesh, json!({"manifoldPrimitive": {"indices": 3, "mode": 4}, "mergeIndices": DATA}), OWN),
        ("EXT_mesh_primitive_edge_visibility", At::Primitive, json!({"visibility": DATA}), OWN),
        ("EXT_mesh_primitive_restart", At::Mesh, json!({"primitiveGroups": [{"primitives": [0], "indices": DATA}]}), OWN),
        ("CESIUM_primitive_outline", At::Primitive, json!({"indices": DATA}), OWN),
        ("EXT_mesh_polygon", At::Primitive, json!({"loopIndices": 3}), OWN),
        ("FB_ngon_encoding", At::Primitive, json!({}), OWN),
        ("FB_geometry_metadata", At::Other("/scenes/0"), json!({"vertexCount": 4, "primitiveCount": 2}), NONE),
        ("NV_opacity_micromap", At::Primitive, json!({"micromap": 0, "groupIndex": 0, "mapIndices": DATA}), OWN),
        ("NV_displacement_micromap", At::Primitive, json!({"micromap": 0, "mapIndices": DATA}), OWN),
        ("NV_micromaps", At::Root, json!({"micromaps": [{"bufferView": DATA, "mimeType": "model/vnd.bary"}]}), NONE),
        ("EXT_mesh_opacity_micromap", At::Primitive, json!({"indices": 3}), OWN),
        ("KHR_gaussian_splatting", At::Root, json!({}), NONE),
        ("MPEG_mesh_linking", At::Mesh, json!({"mesh": 2, "correspondence": DATA}), &[0, 2]),
        ("MPEG_accessor_timed", At::Root, json!({"bufferView": DATA}), NONE),
        ("MPEG_buffer_circular", At::Root, json!({"count": 2}), NONE),
        ("MPEG_media", At::Root, json!({"media": [{"name": "film", "alternatives": []}]}), NONE),
        ("MPEG_animation_timing", At::Root, json!({"accessor": DATA}), NONE),
        ("MPEG_scene_dynamic", At::Root, json!({"media": 0}), NONE),
        ("MPEG_viewport_recommended", At::Root, json!({"viewports": [{"translation": DATA}]}), NONE),
        ("MPEG_audio_spatial", At::Node, json!({"sources": [{"id": 0, "accessors": [DATA]}]}), NONE),
        ("MSFT_lod", At::Node, json!({"ids": []}), OWN),
        ("MSFT_screencoverage", At::Node, json!([0.5, 0.2]), OWN),
        ("KHR_node_visibility", At::Node, json!({"visible": true}), OWN),
        ("KHR_node_selectability", At::Node, json!({"selectable": false}), OWN),
        ("KHR_node_hoverability", At::Node, json!({"hoverable": false}), OWN),
        ("KHR_lights_punctual", At::Node, json!({"light": 0}), OWN),
        ("EXT_lights_ies", At::Root, json!({"lights": [{"bufferView": DATA, "mimeType": "application/x-ies-lm-63"}]}), NONE),
        ("EXT_lights_image_based", At::Other("/scenes/0"), json!({"light": 0}), NONE),
        ("GODOT_single_root", At::Root, json!({}), NONE),
        ("AGI_articulations", At::Node, json!({"articulationName": "dish"}), OWN),
        ("AGI_stk_metadata", At::Node, json!({"solarPanelGroupName": "wing"}), OWN),
        ("GRIFFEL_bim_data", At::Node, json!({"properties": [0], "bufferView": DATA}), OWN),
        ("KHR_audio_emitter", At::Root, json!({"audio": [{"bufferView": DATA, "mimeType": "audio/mpeg"}]}), NONE),
        ("KHR_audio", At::Root, json!({"audio": [{"bufferView": DATA, "mimeType": "audio/mpeg"}]}), NONE),
        ("KHR_implicit_shapes", At::Root, json!({"shapes": [{"type": "sphere", "sphere": {"radius": 1}}]}), NONE),
        ("KHR_collision_shapes", At::Root, json!({"shapes": [{"type": "trimesh", "trimesh": {"mesh": 2}}]}), &[2]),
        ("KHR_physics_rigid_bodies", At::Node, json!({"collider": {"geometry": {"node": 1, "convexHull": true}}}), &[0, 1]),
        ("KHR_physics_rigid_bodies", At::Node, json!({"trigger": {"nodes": [2]}, "joint": {"connectedNode": 1}}), &[0, 1, 2]),
        ("MSFT_audio_emitter", At::Node, json!({"emitters": [0]}), OWN),
        ("OMI_seat", At::Node, json!({"back": [0, 0, 0]}), OWN),
        ("OMI_vehicle_body", At::Node, json!({"pilotSeatNode": 3}), &[0, 3]),
        ("KHR_xmp", At::Mesh, json!({"packet": 0}), OWN),
        ("KHR_xmp_json_ld", At::Mesh, json!({"packet": 0}), OWN),
        ("KHR_xmp_json_ld", At::Node, json!({"packet": 0}), NONE),
        ("KHR_animation_pointer", At::Root, json!({"pointer": "/nodes/2/translation"}), &[2]),
        ("KHR_interactivity", At::Root, json!({"graphs": [{"nodes": [
            {"declaration": 0, "configuration": {"nodeIndex": {"value": [1]}}},
            {"declaration": 1, "configuration": {"pointer": {"value": ["/nodes/3/translation"]}}}]}]}), &[1, 3]),
        ("KHR_interactivity", At::Root, json!({"graphs": [{"nodes": [
            {"declaration": 1, "configuration": {"pointer": {"value": ["/nodes/{i}/translation"]}}}]}]}), &[0, 1, 2, 3, 4, 5]),
        ("VRM", At::Root, json!({"humanoid": {"humanBones": [{"bone": "hips", "node": 1}]},
            "firstPerson": {"firstPersonBone": -1, "meshAnnotations": [{"mesh": 0}]},
            "secondaryAnimation": {"boneGroups": [{"bones": [3], "center": -1}]}}), &[0, 1, 3]),
        ("VRMC_vrm", At::Root, json!({"humanoid": {"humanBones": {"hips": {"node": 1}}},
            "firstPerson": {"meshAnnotations": [{"node": 0, "type": "both"}]},
            "expressions": {"preset": {"happy": {"morphTargetBinds": [{"node": 2, "index": 3}]}}}}), &[0, 1, 2]),
        ("VRMC_vrm_animation", At::Root, json!({"humanoid": {"humanBones": {"hips": {"node": 1}}}, "lookAt": {"node": 2}}), &[1, 2]),
        ("VRMC_springBone", At::Root, json!({"springs": [{"joints": [{"node": 3}], "center": 1}]}), &[1, 3]),
        ("VRMC_node_constraint", At::Node, json!({"constraint": {"roll": {"source": 2, "rollAxis": "X"}}}), &[0, 2]),
        ("VRMC_springBone_extended_collider", At::Node, json!({"shape": {}}), OWN),
        // Not in the table.
        ("ACME_switch", At::Node, json!({"lamp": 2, "targetNode": 3}), &[0, 3]),
        ("ACME_label", At::Primitive, json!({"text": "a"}), OWN),
        ("ACME_label", At::Mesh, json!({"text": "a"}), OWN),
        ("ACME_paint", At::Material, json!({"coats": 2}), NONE),
        ("ACME_doors", At::Root, json!({"doors": [{"hinge": "/nodes/2"}, {"meshIndices": [1]}], "version": 3}), &[1, 2]),
        ("ACME_doors", At::Root, json!({"opens": [3]}), &[3]),
    ]
}

/// Compressed forms of data go with the data; what happens to them is tested where they are read.
const COMPRESSED: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

#[test]
fn every_known_extension_keeps_its_meaning() {
    let mut tried = BTreeSet::new();
    for (name, at, object, stays) in examples() {
        assert_eq!(bake(name, at, &object), stays, "{name} at {at:?}");
        tried.insert(name);
    }
    let is_tried = |row: &&str| match row.strip_suffix('*') {
        Some(start) => tried.iter().any(|name| name.starts_with(start)),
        None => tried.contains(row) || COMPRESSED.contains(row) || *row == "EXT_mesh_gpu_instancing",
    };
    let untried: Vec<&str> = known_extensions().filter(|row| !is_tried(row)).collect();
    assert!(untried.is_empty(), "extensions without an example: {untried:?}");
}

#[test]
fn copies_with_attributes_of_their_own_stay_copies() {
    let mut doc = quads();
    let places = doc.json["accessors"].as_array().map_or(0, Vec::len);
    let view = doc.json["accessors"][0]["bufferView"].clone();
    doc.json["accessors"]
        .as_array_mut()
        .expect("a list")
        .push(json!({"bufferView": view, "componentType": 5126, "count": 2, "type": "VEC3"}));
    for (attributes, stays) in [
        (json!({"TRANSLATION": places}), NONE),
        (json!({"TRANSLATION": places, "_COLOR_0": places}), OWN),
        (json!({"TRANSLATION": places, "_ID": DATA}), OWN),
    ] {
        doc.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
        let scene = load(&doc);
        let emitted = emit(&doc, &scene, &run(Method::Single, &scene, &Default::default()), &Options::default());
        let kept: Vec<usize> =
            (0..COUNT).filter(|&i| emitted.document.json["nodes"][i].get("mesh").is_some()).collect();
        assert_eq!(kept, stays);
        assert_eq!(emitted.document.node_content(0).extensions.is_empty(), stays.is_empty());
    }
}

#[test]
fn what_is_hidden_is_no_part_of_the_scene_and_stays() {
    for (node, extension) in
        [(1, json!({"KHR_node_visibility": {"visible": false}})), (0, json!({"MSFT_lod": {"ids": [1]}}))]
    {
        let mut doc = quads();
        doc.json["nodes"][node]["extensions"] = extension;
        let scene = load(&doc);
        assert!(scene.instances.iter().all(|i| i.node != 1), "neither traced nor measured");
        let emitted = emit(&doc, &scene, &run(Method::Single, &scene, &Default::default()), &Options::default());
        let after = &emitted.document.json;
        let mesh = after["nodes"][1]["mesh"].as_u64().expect("it keeps its mesh") as usize;
        assert_eq!(after["meshes"][mesh]["name"], "m1");
    }
}

#[test]
fn what_hangs_on_a_joint_a_camera_or_a_light_stays() {
    let mut doc = quads();
    doc.json["scenes"][0]["nodes"] = json!([0, 2, 3, 4, 5, COUNT]);
    doc.json["nodes"].as_array_mut().expect("a list").push(json!({"name": "hand", "children": [1]}));
    let single = |doc: &Document| {
        let scene = load(doc);
        let emitted = emit(doc, &scene, &run(Method::Single, &scene, &Default::default()), &Options::default());
        emitted.document.json["nodes"][1].get("mesh").is_some()
    };
    assert!(!single(&doc));
    let mut skinned = doc.clone();
    skinned.json["skins"] = json!([{"joints": [COUNT]}]);
    assert!(single(&skinned), "below a joint");
    let mut filmed = doc.clone();
    filmed.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]);
    filmed.json["nodes"][COUNT]["camera"] = 0.into();
    assert!(single(&filmed), "below a camera");
}

#[test]
fn scaled_meshes_with_a_thickness_stay() {
    for (scale, stays) in [(1.0, NONE), (-1.0, NONE), (0.01, OWN)] {
        let mut doc = quads();
        doc.json["materials"][0]["extensions"] = json!({"KHR_materials_volume": {"thicknessFactor": 50}});
        doc.json["nodes"][0]["scale"] = json!([scale, scale, scale]);
        let scene = load(&doc);
        let emitted = emit(&doc, &scene, &run(Method::Single, &scene, &Default::default()), &Options::default());
        let kept: Vec<usize> =
            (0..COUNT).filter(|&i| emitted.document.json["nodes"][i].get("mesh").is_some()).collect();
        assert_eq!(kept, stays);
    }
}

#[test]
fn nodes_without_room_for_a_record_stay_and_extras_of_any_type_survive() {
    for extras in [json!("text"), json!([1]), json!(true), json!(3), Value::Null] {
        let mut doc = quads();
        doc.json["meshes"][2]["primitives"][0]["extras"] = extras.clone();
        doc.json["nodes"][0]["extras"] = extras.clone();
        let scene = load(&doc);
        let emitted = emit(&doc, &scene, &run(Method::Single, &scene, &Default::default()), &Options::default());
        let json = &emitted.document.json;
        assert_eq!((&json["nodes"][0]["mesh"], &json["nodes"][0]["extras"]), (&json!(0), &extras));
        assert!([1, 2].iter().all(|&node| json["nodes"][node].get("mesh").is_none()));
        let meshes = json["meshes"].as_array().expect("a list").iter();
        let mut primitives = meshes.flat_map(|mesh| mesh["primitives"].as_array().expect("a list"));
        assert!(primitives.any(|primitive| primitive.get("extras") == Some(&extras)), "{extras}");
    }
}
