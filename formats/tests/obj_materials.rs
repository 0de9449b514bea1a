//! MTL materials as glTF materials.

mod obj_support;

use obj_support::{list, material, read, read_bytes, read_files, read_with_mtl, textured, warnings};
use serde_json::{Value, json};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn pbr(mtl: &str) -> Value {
    material(&format!("newmtl m\n{mtl}"))["pbrMetallicRoughness"].clone()
}

fn of(mtl: &str) -> Value {
    material(&format!("newmtl m\n{mtl}"))
}

#[test]
fn bare_material_is_rough_and_not_metallic() {
    let pbr = json!({"metallicFactor": 0.0, "roughnessFactor": 1.0});
    let bare = json!({"name": "m", "pbrMetallicRoughness": pbr, "doubleSided": true});
    assert_eq!(material("newmtl m\n"), bare);
}

#[test]
fn diffuse_color_and_opacity_make_the_base_color() {
    assert_eq!(pbr("Kd 0.8 2 -1\n")["baseColorFactor"], json!([0.8, 1.0, 0.0, 1.0]));
    assert_eq!(pbr("Kd 0.5\n")["baseColorFactor"], json!([0.5, 0.5, 0.5, 1.0]));
    assert_eq!(pbr("kd 1 1 1\n")["baseColorFactor"], Value::Null);
    assert_eq!(pbr("\td  0.25\n")["baseColorFactor"], json!([1.0, 1.0, 1.0, 0.25]));
    assert_eq!(pbr("Tr 0.25\n")["baseColorFactor"], json!([1.0, 1.0, 1.0, 0.75]));
    assert_eq!(pbr("Tr 0.5\nd 0.75\n")["baseColorFactor"], json!([1.0, 1.0, 1.0, 0.75]));
    assert_eq!(pbr("d 0.75\nTr 0.5\n")["baseColorFactor"], json!([1.0, 1.0, 1.0, 0.75]));
    assert_eq!(pbr("d -halo 0.5\n")["baseColorFactor"], json!([1.0, 1.0, 1.0, 0.5]));
}

#[test]
fn opacity_below_one_blends() {
    assert_eq!(of("d 0.5\n")["alphaMode"], "BLEND");
    assert!(of("d 1\nTr 0\n")["alphaMode"].is_null());
}

#[test]
fn alpha_map_masks() {
    let same = of("map_Kd leaf.png\nmap_d leaf.png\n");
    assert_eq!(
        (&same["alphaMode"], &same["alphaCutoff"], &same["extras"]),
        (&"MASK".into(), &Value::Null, &Value::Null)
    );
    assert_eq!(of("d 0.5\nmap_Kd leaf.png\nmap_d leaf.png\n")["alphaMode"], "BLEND");
}

#[test]
fn libraries_that_would_hide_everything_mean_opaque() {
    let opaque = textured("newmtl m\nTr 1.000000\nnewmtl n\nTr 0.5\n");
    assert!(opaque.json["materials"][0]["alphaMode"].is_null());
    assert!(warnings(&opaque).contains("`Tr` of this library is read as opacity"));
    assert_eq!(
        textured("newmtl n\nTr 1\nnewmtl m\nTr 0.25\n").json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"]
            [3],
        0.25
    );
    assert!(of("d 0\n")["alphaMode"].is_null());
    assert_eq!(textured("newmtl m\nd 0\nnewmtl n\nd 1\n").json["materials"][0]["alphaMode"], "BLEND");
    assert_eq!(of("d 0.5\nTr 1\n")["alphaMode"], "BLEND");
}

#[test]
fn mirrors_are_metals_of_their_specular_color() {
    for mtl in ["Kd 0 0 0\nKs .95 .95 .95\nNs 1000\nillum 5\n", "Kd 0.1\nKs 0.95\nNs 1000\nillum 3\n"] {
        let expected =
            json!({"baseColorFactor": [0.95, 0.95, 0.95, 1.0], "metallicFactor": 1.0, "roughnessFactor": 0.0});
        assert_eq!(pbr(mtl), expected);
    }
    let chrome = pbr("Kd 0 0 0\nKs 0.8 0.7 0.6\nNs 30\nillum 2\n");
    assert_eq!((&chrome["metallicFactor"], &chrome["baseColorFactor"][1]), (&1.0.into(), &0.7.into()));
    assert_eq!(pbr("Kd 0.8\nKs 0.5\nKa 0.75\nNs 250\nillum 3\n")["metallicFactor"], 0.75);
    assert_eq!(pbr("Kd 0.8\nKs 0.5\nKa 1\nNs 250\nillum 3\n")["metallicFactor"], 1.0);
    assert_eq!(pbr("Kd 0.8\nKs 0.25\nKa 1\nNs 250\nillum 3\n")["metallicFactor"], 0.0);
    assert_eq!(pbr("Kd 0 0 0\nKs 0 0 0\nillum 5\n")["metallicFactor"], 0.0);
    assert_eq!(pbr("Kd 0 0 0\nKs 0.95\nNs 20\nillum 5\n")["roughnessFactor"], 0.0);
    assert_eq!(pbr("Kd 0 0 0\nKs 0.95\nNs 250\nillum 3\n")["roughnessFactor"], 0.5);
}

#[test]
fn colored_reflection_is_a_specular_extension() {
    let specular = |mtl: &str| of(mtl)["extensions"]["KHR_materials_specular"].clone();
    assert_eq!(specular("Ks 0.4 0.2 0\n"), json!({"specularFactor": 0.8, "specularColorFactor": [1.0, 0.5, 0.0]}));
    assert_eq!(specular("Ks 0.25\n"), json!({"specularFactor": 0.5}));
    assert_eq!((specular("Ks 0.5\n"), specular("Ks 0 0 0\n")), (Value::Null, Value::Null));
}

#[test]
fn glass_transmits_its_filter() {
    let glass = of("Kd 0.02\nKs 0.9\nTf 0.95 0.98 0.95\nNi 1.52\nNs 1000\nd 1\nillum 7\n");
    assert_eq!(glass["extensions"]["KHR_materials_transmission"], json!({"transmissionFactor": 0.98}));
    assert_eq!(glass["extensions"]["KHR_materials_ior"], json!({"ior": 1.52}));
    assert!(glass["alphaMode"].is_null());
    assert_eq!(glass["pbrMetallicRoughness"]["baseColorFactor"][1], 1.0);
    assert_eq!(glass["pbrMetallicRoughness"]["roughnessFactor"], 0.0);
    let sphere = of("Kd 0.01\nKs 0.3\nTf 0.1 0.1 0.1\nNs 200\nNi 2.5\nillum 7\n");
    assert_eq!(sphere["extensions"]["KHR_materials_transmission"], json!({"transmissionFactor": 0.9}));
    assert_eq!(sphere["pbrMetallicRoughness"], json!({"metallicFactor": 0.0, "roughnessFactor": 0.0}));
    let dyed = of("Kd 0.5\nTf 0.2 0.4 0.1\nNs 250\nillum 6\n");
    assert_eq!(dyed["extensions"]["KHR_materials_transmission"], json!({"transmissionFactor": 0.4}));
    assert_eq!(dyed["pbrMetallicRoughness"]["roughnessFactor"], 0.5);
    assert_eq!(of("d 0.25\nillum 4\n")["extensions"]["KHR_materials_transmission"]["transmissionFactor"], 0.75);
    assert!(of("d 1\nTf 1 1 1\nillum 9\n")["extensions"].is_null());
    assert!(of("d 1\nTf 0.5 0.5 0.5\nillum 2\n")["extensions"].is_null());
}

#[test]
fn comments_behind_names_are_left_out_where_only_the_name_is_defined() {
    let text = format!("usemtl red # front\n{TRIANGLE}usemtl mat #1\nf 1 2 3\nusemtl green\nf 1 2 3\n");
    let document =
        read_with_mtl(&text, "newmtl red\nKd 1 0 0\nnewmtl mat #1\nKd 0 0 1\nnewmtl green # leaf\nKd 0 1 0\n");
    let names: Vec<_> = list(&document.json, "materials").iter().map(|material| &material["name"]).collect();
    assert_eq!(names, ["red", "mat #1", "green"]);
    assert_eq!(warnings(&document), "");
}

#[test]
fn library_named_like_the_model_is_taken_for_a_missing_one() {
    for statement in ["mtllib chair.mtl\n", ""] {
        let obj = format!("{statement}usemtl m\n{TRIANGLE}");
        let document = read_files(&[("scene.obj", obj.as_bytes()), ("scene.mtl", b"newmtl m\nKd 1 0 0\n")]);
        assert!(document.json["materials"][0]["pbrMetallicRoughness"].is_object());
        assert!(warnings(&document).contains("`scene.mtl`, named like the model, is taken"));
    }
}

#[test]
fn emission_above_one_becomes_a_strength() {
    assert_eq!(of("Ke 0.5 0.25 0\n")["emissiveFactor"], json!([0.5, 0.25, 0.0]));
    assert!(of("Ke 0 0 0\n")["emissiveFactor"].is_null());
    let lamp = textured("newmtl m\nKe 20 10 0\n");
    let material = &lamp.json["materials"][0];
    assert_eq!(material["emissiveFactor"], json!([1.0, 0.5, 0.0]));
    assert_eq!(material["extensions"]["KHR_materials_emissive_strength"], json!({"emissiveStrength": 20.0}));
    assert_eq!(lamp.json["extensionsUsed"], json!(["KHR_materials_emissive_strength"]));
}

#[test]
fn emissive_map_glows_by_itself() {
    let material = of("Ke 0 0 0\nmap_Ke glow.png\n");
    assert_eq!(material["emissiveFactor"], json!([1.0, 1.0, 1.0]));
    assert_eq!(material["emissiveTexture"], json!({"index": 0}));
}

#[test]
fn shininess_becomes_roughness_unless_roughness_is_given() {
    let roughness = |mtl: &str| pbr(mtl)["roughnessFactor"].as_f64().expect("a number");
    assert_eq!(roughness("Ns 0\n"), 1.0);
    assert!((roughness("Ns 30\n") - 0.5).abs() < 1e-6);
    assert!(roughness("Ns 1000\n") < 0.22 && roughness("Ns -5\n") == 1.0);
    assert_eq!(roughness("Ns 30\nPr 0.75\n"), 0.75);
    assert_eq!(of("Ns 30\n")["extras"]["mtl"]["Ns"], "30");
}

#[test]
fn physical_keys_become_extensions() {
    let all = textured("newmtl m\nPm 0.3\nPs 0.4\nPc 0.5\nPcr 0.6\naniso 0.7\nanisor 0.25\nNi 1.45\n");
    let material = &all.json["materials"][0];
    assert_eq!(material["pbrMetallicRoughness"]["metallicFactor"], 0.3);
    let extensions = json!({
        "KHR_materials_ior": {"ior": 1.45},
        "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.6},
        "KHR_materials_sheen": {"sheenColorFactor": [0.4, 0.4, 0.4]},
        "KHR_materials_anisotropy": {"anisotropyStrength": 0.7, "anisotropyRotation": 1.5707964}
    });
    assert_eq!(material["extensions"], extensions);
    assert_eq!(list(&all.json, "extensionsUsed").len(), 4);
    assert!(material["extras"].is_null());
}

#[test]
fn index_of_refraction_of_vacuum_stays_in_extras() {
    let material = of("Ni 1.0\n");
    assert!(material["extensions"].is_null());
    assert_eq!(material["extras"]["mtl"]["Ni"], "1.0");
}

#[test]
fn what_gltf_cannot_say_stays_as_written() {
    let mtl = "Ka 0 0 0\nKs .5 .5 .5\nillum 2\nTf 1 1 1\nbump -bm 2 b.png\nrefl -type sphere r.png\nfoo bar  baz\n";
    let expected = json!({"Ka": "0 0 0", "Ks": ".5 .5 .5", "illum": "2", "Tf": "1 1 1", "bump": "-bm 2 b.png",
        "refl": "-type sphere r.png", "foo": "bar  baz"});
    assert_eq!(of(mtl)["extras"], json!({"mtl": expected}));
}

#[test]
fn malformed_values_are_kept_with_a_warning_and_harm_nothing_else() {
    let mtl = "newmtl m\nKd 0.5 x\nKs 1 2\nKa spectral a.rfl 1\nNs high\nd\nillum 999\nKe nan 0 0\nmap_Kd\nPr 0.5\n";
    let document = textured(mtl);
    let material = &document.json["materials"][0];
    assert_eq!(material["pbrMetallicRoughness"]["roughnessFactor"], 0.5);
    assert_eq!(material["extras"]["mtl"]["Ka"], "spectral a.rfl 1");
    assert_eq!(material["extras"]["mtl"]["Ns"], "high");
    assert_eq!(document.warnings.len(), 8, "{}", warnings(&document));
    assert!(warnings(&document).starts_with("scene.mtl, line 2: `Kd` cannot be read: kept in extras only\n"));
}

#[test]
fn statements_outside_a_material_and_second_definitions_are_warnings() {
    let document = textured("Kd 1 0 0\nnewmtl m\nKd 0 1 0\nnewmtl m\nKd 0 0 1\n");
    assert_eq!(document.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"], json!([0.0, 1.0, 0.0, 1.0]));
    let expected = "scene.mtl, line 1: material statements before the first `newmtl` ignored\n\
        scene.mtl: material `m` defined again: the first definition counts\n";
    assert_eq!(warnings(&document), expected);
}

#[test]
fn undefined_material_is_a_default_one_of_its_name() {
    let document = read(&format!("mtllib none.mtl\nusemtl a b\n{TRIANGLE}"));
    assert_eq!(document.json["materials"], json!([{"name": "a b", "doubleSided": true}]));
    let expected =
        "line 1: material library `none.mtl` not found\nmaterial `a b` is not defined: a default one takes its place\n";
    assert_eq!(warnings(&document), expected);
}

#[test]
fn many_undefined_materials_are_one_warning() {
    let faces = |count: usize| (0..count).map(|at| format!("usemtl m{at}\nf 1 2 3\n")).collect::<String>();
    let document = read(&format!("{TRIANGLE}{}", faces(2)));
    assert_eq!(warnings(&document), "materials `m0`, `m1` are not defined: default ones take their places\n");
    let document = read(&format!("{TRIANGLE}{}", faces(1000)));
    assert!(warnings(&document).ends_with("`m7` and 992 more are not defined: default ones take their places\n"));
    assert_eq!(list(&document.json, "materials").len(), 1000);
}

#[test]
fn names_of_another_case_are_taken_if_none_is_the_same() {
    let text = format!("usemtl RED\n{TRIANGLE}usemtl Blue\nf 1 2 3\n");
    let document = read_with_mtl(&text, "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\nnewmtl Blue\nKd 0 0 0.5\n");
    let color = |at: usize| document.json["materials"][at]["pbrMetallicRoughness"]["baseColorFactor"].clone();
    assert_eq!([color(0), color(1)], [json!([1.0, 0.0, 0.0, 1.0]), json!([0.0, 0.0, 0.5, 1.0])]);
    assert_eq!(warnings(&document), "");
}

#[test]
fn nameless_material_is_none_unless_defined() {
    assert!(list(&read(&format!("usemtl\n{TRIANGLE}")).json, "materials").is_empty());
    let document = read_with_mtl(&format!("usemtl \n{TRIANGLE}"), "newmtl \nKd 1 0 0\n");
    assert_eq!(document.json["materials"][0]["name"], "(none)");
    let before = read_with_mtl(TRIANGLE, "newmtl \nKd 1 0 0\n");
    assert!(list(&before.json, "materials").is_empty());
}

#[test]
fn materials_no_face_uses_are_left_out_and_the_rest_stand_in_order_of_use() {
    let text = format!("usemtl unseen\nusemtl b\n{TRIANGLE}g x\nusemtl a\nf 1 2 3\ng y\nusemtl b\nf 1 2 3\n");
    let document = read_with_mtl(&text, "newmtl a\nnewmtl b\nnewmtl c\n");
    let names: Vec<_> = list(&document.json, "materials").iter().map(|material| &material["name"]).collect();
    assert_eq!(names, ["b", "a"]);
    assert_eq!(warnings(&document), "");
}

#[test]
fn libraries_are_found_by_any_spelling() {
    let red: &[u8] = b"newmtl m\nKd 1 0 0\n";
    let cases: [(&str, &str); 9] = [
        ("mtllib my scene.mtl", "my scene.mtl"),
        ("mtllib my\\ scene.mtl", "my scene.mtl"),
        ("mtllib \"my scene.mtl\"", "my scene.mtl"),
        ("mtllib\tMy Scene.MTL", "my scene.mtl"),
        ("mtllib gone.mtl also gone.mtl my scene.mtl", "my scene.mtl"),
        ("mtllib .\\Folder\\scene.mtl", "folder/scene.mtl"),
        ("mtllib C:\\work\\scene.mtl", "scene.mtl"),
        ("mtllib gone/scene.mtl", "scene.mtl"),
        ("mtllib gone.mtl\nmtllib scene.mtl", "scene.mtl"),
    ];
    for (statement, file) in cases {
        let obj = format!("{statement}\nusemtl m\n{TRIANGLE}");
        let document = read_files(&[("scene.obj", obj.as_bytes()), (file, red)]);
        let color = &document.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"];
        assert_eq!(*color, json!([1.0, 0.0, 0.0, 1.0]), "{statement}");
    }
}

#[test]
fn several_libraries_each_give_their_materials_and_the_first_wins() {
    let obj = format!("mtllib a.mtl b.mtl\nmtllib c.mtl\nmtllib a.mtl\nusemtl x\n{TRIANGLE}usemtl y\nf 1 2 3\n");
    let document = read_files(&[
        ("scene.obj", obj.as_bytes()),
        ("a.mtl", b"newmtl x\nPr 0.25\n"),
        ("b.mtl", b"newmtl x\nPr 0.5\nnewmtl y\nPr 0.75\n"),
        ("c.mtl", b"newmtl y\nPr 1\n"),
    ]);
    let roughness = |i: usize| &document.json["materials"][i]["pbrMetallicRoughness"]["roughnessFactor"];
    assert_eq!((roughness(0), roughness(1)), (&0.25.into(), &0.75.into()));
    assert_eq!(document.warnings.len(), 2);
}

#[test]
fn latin_1_material_names_match_across_files() {
    let document = read_files(&[
        ("scene.obj", b"mtllib scene.mtl\nusemtl gr\xfcn\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("scene.mtl", b"newmtl gr\xfcn\r\nKd 0 1 0\r\n"),
    ]);
    assert_eq!(document.json["materials"][0]["name"], "grün");
    assert!(document.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"].is_array());
}

#[test]
fn folder_instead_of_a_library_is_not_read() {
    let document = read_files(&[("scene.obj", b"mtllib lib\nmtllib /dev/zero\nmtllib ..\n"), ("lib/x", b"")]);
    assert_eq!(document.warnings.len(), 4, "{}", warnings(&document));
    read_bytes(b"mtllib \0\nmtllib \n");
}
