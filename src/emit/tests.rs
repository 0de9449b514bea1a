//! Tests with hand-written layouts, written to documents and read back.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::{DAffine3, DVec3, dvec3};
use raykiln_formats::Document;
use raykiln_formats::document::Kind;
use raykiln_formats::record::Origins;
use serde_json::{Value, json};

use super::*;
use crate::layout::{Group, GroupGeometry, Placement};
use crate::scene::{self, InstanceId, LoadOptions, MeshId, Opacity, TriangleRef};

/// A document with one buffer that holds positions, normals and tangents (4 vertices each) and two triangles, not
/// interleaved.
pub(super) fn document(nodes: Value, mesh: Value) -> Document {
    let positions: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.5]];
    let normals = [[0.0_f32, 0.0, 1.0]; 4];
    let tangents = [[1.0_f32, 0.0, 0.0, 1.0]; 4];
    let corners: [u16; 6] = [0, 1, 2, 0, 2, 3];
    let mut bytes = bytemuck::cast_slice::<_, u8>(&positions).to_vec();
    bytes.extend(bytemuck::cast_slice::<_, u8>(&normals));
    bytes.extend(bytemuck::cast_slice::<_, u8>(&tangents));
    bytes.extend(bytemuck::cast_slice::<_, u8>(&corners));
    let view = |offset: usize, length: usize| json!({"buffer": 0, "byteOffset": offset, "byteLength": length});
    let accessor = |view: usize, component: u32, count: usize, kind: &str| json!({"bufferView": view, "componentType": component, "count": count, "type": kind});
    let roots: Vec<usize> = nodes.as_array().map_or(0..0, |n| 0..n.len()).collect();
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes,
        "meshes": [mesh], "materials": [{"name": "red"}, {"name": "blue"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0.5]},
            accessor(1, 5126, 4, "VEC3"), accessor(2, 5126, 4, "VEC4"), accessor(3, 5123, 6, "SCALAR")],
        "bufferViews": [view(0, 48), view(48, 48), view(96, 64), view(160, 12)],
        "buffers": [{"byteLength": bytes.len()}]
    });
    Document {
        json,
        buffers: vec![bytes.into()],
        path: "test.gltf".into(),
        kind: Kind::Gltf,
        warnings: Vec::new(),
        in_memory: None,
        residuals: Default::default(),
        sidecar: None,
    }
}

pub(super) fn surface(material: u32) -> Value {
    json!({"attributes": {"POSITION": 0, "NORMAL": 1, "TANGENT": 2}, "indices": 3, "material": material})
}

pub(super) fn pruned() -> Options {
    Options { prune: true, ..Options::default() }
}

pub(super) fn load(doc: &Document) -> Scene {
    let (scene, _) = scene::load(doc, &LoadOptions::default()).expect("the document is sound");
    scene.check().expect("the scene is sound");
    scene
}

/// Returns the material and world corners of each placed triangle, sorted.
pub(super) fn shown(scene: &Scene) -> Vec<(Option<u32>, [DVec3; 3])> {
    let mut all = Vec::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        for triangle in 0..mesh.triangle_count() as u32 {
            let (g, _) = mesh.locate(triangle);
            let corners = scene.world_corners(TriangleRef { instance: i as u32, triangle });
            all.push((mesh.geometries[g].material, corners));
        }
    }
    all.sort_by_key(|(m, c)| (*m, c.map(|p| p.to_array().map(|x| (x * 1024.0).round() as i64))));
    all
}

fn geometry(scene: &Scene, triangles: &[(u32, u32)]) -> GroupGeometry {
    let (instance, triangle) = triangles[0];
    let mesh = scene.mesh_of(InstanceId(instance));
    let source = &mesh.geometries[mesh.locate(triangle).0];
    GroupGeometry {
        material: source.material,
        merge_class: source.merge_class,
        opacity: Opacity::Opaque,
        triangles: triangles.iter().map(|&(instance, triangle)| TriangleRef { instance, triangle }).collect(),
    }
}

/// Bakes all triangles of all instances into one group.
fn baked(scene: &Scene) -> Layout {
    let all: Vec<(u32, u32)> = (0..scene.instances.len() as u32)
        .flat_map(|i| (0..scene.mesh_of(InstanceId(i)).triangle_count() as u32).map(move |t| (i, t)))
        .collect();
    let content = Content::Baked { frame: DAffine3::IDENTITY, geometries: vec![geometry(scene, &all)] };
    Layout {
        groups: vec![Group { name: "all".into(), content }],
        placements: vec![Placement { group: 0, instance: None, transform: DAffine3::IDENTITY }],
        ..Layout::default()
    }
}

fn two_nodes() -> Document {
    document(
        json!([
            {"name": "left", "mesh": 0, "translation": [3, 0, 0], "extras": {"user": 1}},
            {"name": "mirrored", "mesh": 0, "scale": [-2, 1, 1], "rotation": [0, 0, 0.6, 0.8]}
        ]),
        json!({"name": "quad", "primitives": [surface(1)], "extras": {"owner": "me"}}),
    )
}

fn floats(doc: &Document, name: &str) -> Vec<[f32; 3]> {
    let mesh = doc.json["meshes"].as_array().map_or(0, Vec::len) - 1;
    let attributes = doc.attributes(mesh, 0);
    let found = attributes.iter().find(|a| a.name == name).expect("the attribute is there");
    (0..found.count).map(|i| bytemuck::pod_read_unaligned(&found.data[i * found.stride..][..12])).collect()
}

#[test]
fn layouts_along_other_axes_show_the_same_triangles_rounded_no_more() {
    let doc = two_nodes();
    let scene = load(&doc);
    for mut layout in [baked(&scene), opened(&scene)] {
        let straight = emit(&doc, &scene, &layout, &Options::default());
        crate::layout::turn_axes(&mut layout, 13);
        let turned = emit(&doc, &scene, &layout, &Options::default());
        let [expected, after] = [&straight, &turned].map(|emitted| load(&emitted.document));
        assert_eq!(shown(&after), shown(&expected));
        assert_eq!(turned.position_error, straight.position_error);
        assert_ne!(after.instances[0].transform.matrix3, expected.instances[0].transform.matrix3);
    }
}

#[test]
fn a_baked_group_shows_the_same_triangles_with_the_same_facing() {
    let doc = two_nodes();
    let scene = load(&doc);
    let emitted = emit(&doc, &scene, &baked(&scene), &Options::default());
    let after = load(&emitted.document);
    assert_eq!(after.instances.len(), 1);
    let (before, after) = (shown(&scene), shown(&after));
    assert_eq!(before.len(), after.len());
    for ((m, x), (n, y)) in before.iter().zip(&after) {
        assert_eq!(m, n);
        let normal = |c: &[DVec3; 3]| (c[1] - c[0]).cross(c[2] - c[0]);
        assert!(normal(x).dot(normal(y)) > 0.0, "the face is turned over");
        assert!(x.iter().all(|p| y.iter().any(|q| p.distance(*q) < 1e-6)), "{x:?} {y:?}");
    }
    assert!(emitted.position_error < 1e-6);
}

#[test]
fn emptied_nodes_keep_name_and_extras_and_say_where_their_triangles_went() {
    let doc = two_nodes();
    let scene = load(&doc);
    let json = emit(&doc, &scene, &baked(&scene), &Options::default()).document.json;
    assert_eq!(json["nodes"][0]["name"], "left");
    assert_eq!(json["nodes"][0]["extras"]["user"], 1);
    assert!(json["nodes"][0].get("mesh").is_none());
    assert_eq!(json["nodes"][0]["extras"]["raykiln"]["moved_to"], json!([0]));
    assert_eq!(json["nodes"][2]["extras"]["raykiln"]["id"], 0);
    let mesh = &json["nodes"][1]["extras"]["raykiln"]["mesh"];
    assert_eq!(*mesh, json!({"name": "quad", "extras": {"owner": "me"}}));
    assert_eq!(json["scenes"][0]["nodes"], json!([0, 1, 2]));
    assert_eq!(json["meshes"].as_array().map(Vec::len), Some(1), "the unused mesh is gone");
    assert!(json["nodes"][2].get("matrix").is_none(), "an identity needs no transform");
}

#[test]
fn provenance_names_node_mesh_primitive_and_triangles() {
    let doc = two_nodes();
    let scene = load(&doc);
    let after = load(&emit(&doc, &scene, &baked(&scene), &Options::default()).document);
    let record = after.provenance.record().expect("a record");
    let [Origins::Each { sources, triangles }] = record.lists[0].as_slice() else { panic!("{record:?}") };
    assert_eq!(sources.iter().map(|s| s.node).collect::<Vec<_>>(), [Some(0), Some(1)]);
    assert_eq!(*triangles, [[0, 0], [0, 1], [1, 0], [1, 1]]);
    assert_eq!((record.input, record.nodes.as_slice()), (scene.geometry, &[Some(0), Some(1), None][..]));
}

#[test]
fn normals_and_tangents_turn_with_their_instance() {
    let doc = document(
        json!([{"mesh": 0, "rotation": [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2], "scale": [1, 1, 5]}]),
        json!({"primitives": [surface(0)]}),
    );
    let scene = load(&doc);
    let emitted = emit(&doc, &scene, &baked(&scene), &Options::default());
    for normal in floats(&emitted.document, "NORMAL") {
        assert!((glam::Vec3::from(normal) - glam::Vec3::X).length() < 1e-6, "{normal:?}");
    }
    for tangent in floats(&emitted.document, "TANGENT") {
        assert!((glam::Vec3::from(tangent) + glam::Vec3::Z).length() < 1e-6, "{tangent:?}");
    }
}

#[test]
fn pieces_hang_under_every_node_that_placed_the_mesh() {
    let mesh = json!({"primitives": [surface(0), surface(1)]});
    let doc = document(json!([{"mesh": 0}, {"mesh": 0, "translation": [0, 5, 0]}]), mesh);
    let scene = load(&doc);
    let piece = |name: &str, triangles: &[(u32, u32)]| Group {
        name: name.into(),
        content: Content::Piece {
            mesh: MeshId(0),
            frame: DAffine3::IDENTITY,
            geometries: vec![geometry(&scene, triangles)],
        },
    };
    let placement = |group: u32, instance: u32| Placement {
        group,
        instance: Some(InstanceId(instance)),
        transform: scene.instances[instance as usize].transform,
    };
    let layout = Layout {
        groups: vec![piece("red", &[(0, 0), (0, 1)]), piece("blue", &[(0, 2), (0, 3)])],
        placements: vec![placement(0, 0), placement(1, 0), placement(0, 1), placement(1, 1)],
        ..Layout::default()
    };
    let document = emit(&doc, &scene, &layout, &Options::default()).document;
    let after = load(&document);
    assert_eq!(shown(&scene), shown(&after));
    assert_eq!(after.meshes.len(), 2);
    assert_eq!(document.json["nodes"][1]["children"].as_array().map(Vec::len), Some(2));
    assert_eq!(stands_for(&after, 3), Some(1));
}

/// The node of the input that an instance stands for.
fn stands_for(after: &Scene, instance: usize) -> Option<u32> {
    let instance = &after.instances[instance];
    Some(after.provenance.record()?.placed(instance.node, instance.copy)?.input?.0)
}

/// Puts the first triangle of the mesh in one piece and the second in another, for all instances.
pub(super) fn opened(scene: &Scene) -> Layout {
    let piece = |triangle: u32| Group {
        name: format!("quad.{triangle}"),
        content: Content::Piece {
            mesh: MeshId(0),
            frame: DAffine3::IDENTITY,
            geometries: vec![geometry(scene, &[(0, triangle)])],
        },
    };
    let instances = (0u32..).zip(&scene.instances).flat_map(|(i, at)| [(0, i, at.transform), (1, i, at.transform)]);
    let placement = |(group, i, transform)| Placement { group, instance: Some(InstanceId(i)), transform };
    let layout = Layout {
        groups: vec![piece(0), piece(1)],
        placements: instances.map(placement).collect(),
        ..Layout::default()
    };
    layout.check(scene).expect("the layout is sound");
    layout
}

#[test]
fn opened_instances_below_a_shared_parent_stay_in_their_place() {
    let mut doc = document(
        json!([
            {"name": "street", "children": [1, 2], "translation": [0, 0, 7], "scale": [2, 2, 2]},
            {"name": "house", "children": [3, 4], "rotation": [0, 0, 0.6, 0.8]},
            {"name": "second house", "children": [5], "translation": [9, 0, 0]},
            {"name": "left", "mesh": 0}, {"name": "right", "mesh": 0, "translation": [3, 0, 0]},
            {"name": "alone", "mesh": 0, "scale": [-1, 1, 1], "children": [6]},
            {"name": "below", "mesh": 0, "translation": [0, 5, 0]}
        ]),
        json!({"name": "quad", "primitives": [surface(1)]}),
    );
    doc.json["scenes"][0]["nodes"] = json!([0]);
    let scene = load(&doc);
    assert_eq!(scene.instances.len(), 4);
    let document = emit(&doc, &scene, &opened(&scene), &Options::default()).document;
    let after = load(&document);
    assert_eq!(shown(&scene), shown(&after));
    assert_eq!((after.meshes.len(), after.instances.len()), (2, 8));
    assert_eq!(document.json["nodes"][5]["children"], json!([6, 11, 12]), "pieces hang beside the node's own child");
    let of = |i: usize| (stands_for(&after, i).expect("it stands for a node"), after.instances[i].node);
    assert!((0..8).map(of).all(|(input, node)| input != node && input >= 3));
}

#[test]
fn pieces_of_instanced_copies_are_children_with_the_copies() {
    let mut doc = document(
        json!([{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 4}}}}]),
        json!({"primitives": [surface(0)]}),
    );
    let translations: [[f32; 3]; 3] = [[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 2.0]];
    doc.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    doc.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    doc.json["accessors"]
        .as_array_mut()
        .expect("accessors")
        .push(json!({"bufferView": 4, "componentType": 5126, "count": 3, "type": "VEC3"}));
    let mut bytes = doc.buffers[0].to_vec();
    let view = json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": 36});
    doc.json["bufferViews"].as_array_mut().expect("views").push(view);
    bytes.extend(bytemuck::cast_slice::<_, u8>(&translations));
    doc.json["buffers"][0]["byteLength"] = json!(bytes.len());
    doc.buffers = vec![bytes.into()];
    let scene = load(&doc);
    assert_eq!(scene.instances.len(), 3);
    let document = emit(&doc, &scene, &opened(&scene), &Options::default()).document;
    let after = load(&document);
    assert_eq!(shown(&scene), shown(&after));
    assert!(document.json["nodes"][0].get("extensions").is_none());
    let copies = |i: usize| &document.json["nodes"][i]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
    assert!(copies(1)["TRANSLATION"].is_u64() && copies(1) == copies(2));
    let identity = crate::verify::identity::Identity::new(&scene, &after);
    assert_eq!(identity.known(), 6, "every triangle of every copy leads back");
    assert_eq!(document.json["extensionsUsed"], json!(["EXT_mesh_gpu_instancing"]));

    let document = emit(&doc, &scene, &baked(&scene), &Options::default()).document;
    assert_eq!(shown(&scene), shown(&load(&document)));
    for list in ["extensionsUsed", "extensionsRequired"] {
        assert!(document.json.get(list).is_none(), "no node has copies any more");
    }
}

#[test]
fn extensions_are_forgotten_only_where_the_last_use_went() {
    let mut doc = document(
        json!([{"mesh": 0}]),
        json!({"primitives": [surface(0)], "extensions": {"KHR_xmp_json_ld": {"packet": 0}}}),
    );
    doc.json["extensionsUsed"] = json!(["KHR_mesh_quantization", "KHR_xmp_json_ld", "KHR_texture_transform"]);
    doc.json["extensionsRequired"] = json!(["KHR_mesh_quantization", "KHR_xmp_json_ld"]);
    doc.json["materials"] = json!([{"extras": {"extensions": {"KHR_xmp_json_ld": {}}}}]);
    let scene = load(&doc);
    let kept = crate::methods::run(crate::methods::Method::Keep, &scene, &Default::default());
    let kept = emit(&doc, &scene, &kept, &Options::default()).document.json;
    assert_eq!(kept["extensionsUsed"], doc.json["extensionsUsed"]);
    let json = emit(&doc, &scene, &baked(&scene), &Options::default()).document.json;
    assert_eq!(json["extensionsUsed"], json!(["KHR_mesh_quantization", "KHR_texture_transform"]));
    assert_eq!(json["extensionsRequired"], json!(["KHR_mesh_quantization"]));
}

#[test]
fn points_and_lines_beside_triangles_stay_where_they_are() {
    let lines = json!({"attributes": {"POSITION": 0}, "mode": 1});
    let doc = document(json!([{"mesh": 0, "name": "both"}]), json!({"primitives": [surface(0), lines]}));
    let scene = load(&doc);
    assert!(!scene.meshes[0].dropped);
    let json = emit(&doc, &scene, &baked(&scene), &Options::default()).document.json;
    let kept = &json["meshes"][json["nodes"][0]["mesh"].as_u64().expect("the node keeps a mesh") as usize];
    assert_eq!(kept["primitives"].as_array().map(Vec::len), Some(1));
    assert_eq!(kept["primitives"][0]["mode"], 1);
}

#[test]
fn pruning_drops_emptied_nodes_but_none_that_something_refers_to() {
    let mut doc = two_nodes();
    doc.json["nodes"][1]["camera"] = json!(0);
    doc.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    let scene = load(&doc);
    let emitted = emit(&doc, &scene, &baked(&scene), &pruned());
    assert_eq!(emitted.pruned_nodes, 1);
    let nodes = emitted.document.json["nodes"].as_array().expect("nodes remain");
    assert_eq!(nodes.iter().map(|n| n["name"].as_str()).collect::<Vec<_>>(), [Some("mirrored"), Some("all")]);
    assert_eq!(
        nodes[0]["extras"]["raykiln"]["moved_to"],
        nodes[1]["extras"]["raykiln"].get("id").map(|id| json!([id])).unwrap()
    );
    assert_eq!(shown(&load(&emitted.document)).len(), 4);
}

#[test]
fn renumbered_nodes_say_which_node_of_the_input_they_are() {
    let mut doc = two_nodes();
    doc.json["nodes"][0] = json!({"name": "empty"});
    let scene = load(&doc);
    let kept = Layout {
        groups: vec![Group { name: "quad".into(), content: Content::Kept(MeshId(0)) }],
        placements: vec![Placement {
            group: 0,
            instance: Some(InstanceId(0)),
            transform: scene.instances[0].transform,
        }],
        ..Layout::default()
    };
    let emitted = emit(&doc, &scene, &kept, &pruned());
    assert_eq!(emitted.pruned_nodes, 1);
    let after = load(&emitted.document);
    assert_eq!((after.instances[0].node, stands_for(&after, 0)), (0, Some(1)));
    let again = load(&emit(&emitted.document, &after, &kept, &Options::default()).document);
    assert_eq!(stands_for(&again, 0), Some(1), "it leads to the first input");
}

#[test]
fn far_groups_are_stored_around_their_centre() {
    let doc = document(json!([{"mesh": 0, "translation": [10000000.5, 0.25, 0]}]), json!({"primitives": [surface(0)]}));
    let scene = load(&doc);
    let mut layout = baked(&scene);
    let limit = 1e-6 * scene.bounds().diagonal();
    let settled = settle(&scene, &mut layout, 1e-6, Refuse::Instances);
    assert_eq!((settled.centred, settled.refused.len()), (1, 0));
    let emitted = emit(&doc, &scene, &layout, &Options::default());
    assert!(emitted.position_error <= limit, "{}", emitted.position_error);
    let after = load(&emitted.document);
    assert!(after.bounds().center().distance(dvec3(1e7 + 1.0, 0.75, 0.25)) < 1e-6);
}

#[test]
fn a_small_object_in_a_large_scene_keeps_its_shape() {
    let doc = document(
        json!([
            {"mesh": 0, "scale": [1e3, 1e3, 1e3]},
            {"mesh": 0, "translation": [700.3, 0.0, 0.0], "scale": [0.5, 0.5, 0.5]}
        ]),
        json!({"primitives": [surface(0)]}),
    );
    let scene = load(&doc);
    let mut layout = baked(&scene);
    let settled = settle(&scene, &mut layout, 1e-6, Refuse::Instances);
    assert_eq!((settled.centred, settled.refused.len()), (0, 0));
    let Content::Baked { geometries, .. } = &mut layout.groups[0].content else { unreachable!() };
    geometries[0].triangles.retain(|t| t.instance == 1);
    let settled = settle(&scene, &mut layout, 1e-6, Refuse::Instances);
    assert_eq!((settled.centred, settled.refused.len()), (1, 0));
}

#[test]
fn an_object_too_small_for_a_group_over_a_wide_scene_is_refused() {
    let doc = document(
        json!([
            {"mesh": 0, "scale": [1e3, 1e3, 1e3]},
            {"mesh": 0, "translation": [700.3, 0.0, 0.0], "scale": [1e-3, 1e-3, 1e-3]}
        ]),
        json!({"primitives": [surface(0)]}),
    );
    let scene = load(&doc);
    let mut layout = baked(&scene);
    let settled = settle(&scene, &mut layout, 1e-6, Refuse::Instances);
    assert_eq!(settled.refused, [InstanceId(1)]);
    assert_eq!(settle(&scene, &mut layout, 1e-6, Refuse::Groups).refused, [0, 1].map(InstanceId));
    assert!(settled.error < 1e-6 * scene.bounds().diagonal());
    let Content::Baked { geometries, .. } = &mut layout.groups[0].content else { unreachable!() };
    geometries[0].triangles.retain(|t| t.instance == 1);
    assert_eq!(settle(&scene, &mut layout, 1e-6, Refuse::Instances).refused, []);
}

#[test]
fn what_cannot_be_written_out_exactly_is_refused_under_a_limit_of_zero() {
    let doc = document(json!([{"mesh": 0, "rotation": [0.1, 0.2, 0.3, 0.9]}]), json!({"primitives": [surface(0)]}));
    let scene = load(&doc);
    let settled = settle(&scene, &mut baked(&scene), 0.0, Refuse::Instances);
    assert_eq!(settled.refused, [InstanceId(0)]);
}
