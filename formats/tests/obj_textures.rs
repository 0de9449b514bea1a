//! Textures of MTL files: options, paths, sharing, and what glTF does not allow.

mod obj_support;

use obj_support::{list, primitive, read_files, read_with_mtl, textured, warnings};
use serde_json::{Value, json};

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
const OBJ: &[u8] = b"mtllib scene.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";

/// The URI of the only image, for a `map_Kd` of these words and a file of this name.
fn uri(words: &str, file: &str) -> (Value, String) {
    let mtl = format!("newmtl m\nmap_Kd {words}\n");
    let document = read_files(&[("scene.obj", OBJ), ("scene.mtl", mtl.as_bytes()), (file, PNG)]);
    (document.json["images"][0]["uri"].clone(), warnings(&document))
}

#[test]
fn options_are_told_from_the_file_name() {
    let cases = [
        "a b.png",
        "-s 1 1 1 a b.png",
        "-blendu on -blendv off -cc off -clamp off -texres 512 -type sphere -colorspace sRGB -boost 2 a b.png",
        "-mm 0 1 -imfchan r -t 1 a b.png",
        "a b.png -bm 1.5",
        "a b.png -o 0 0 0 -s 1 1",
        "\"a b.png\"",
    ];
    for words in cases {
        assert_eq!(uri(words, "a b.png"), ("a%20b.png".into(), String::new()), "{words}");
    }
    assert_eq!(uri("-s 1 1 1 2.png", "2.png").0, "2.png");
    assert_eq!(uri("x -s.png", "x -s.png").0, "x%20-s.png");
}

#[test]
fn paths_become_relative_uris() {
    assert_eq!(uri("textures\\Wood.PNG", "textures/wood.png").0, "textures/wood.png");
    assert_eq!(uri(".\\wood.png", "wood.png").0, "wood.png");
    assert_eq!(uri("C:\\art\\wood.png", "wood.png").0, "wood.png");
    assert_eq!(uri("/art/gone/wood.png", "wood.png").0, "wood.png");
    assert_eq!(uri("ho\u{308}he #1?.png", "ho\u{308}he #1?.png").0, "ho%CC%88he%20%231%3F.png");
    assert_eq!(uri("a/../wood.png", "wood.png").0, "wood.png");
}

#[test]
fn textures_are_sought_beside_the_library() {
    let obj = String::from_utf8_lossy(OBJ).replace("scene.mtl", "lib/scene.mtl");
    for (words, file, expected) in [
        ("a.png", "lib/a.png", "lib/a.png"),
        ("../tex/a.png", "tex/a.png", "tex/a.png"),
        ("a.png", "a.png", "a.png"),
        ("a.png", "other.png", "lib/a.png"),
    ] {
        let mtl = format!("newmtl m\nmap_Kd {words}\n");
        let document = read_files(&[("scene.obj", obj.as_bytes()), ("lib/scene.mtl", mtl.as_bytes()), (file, PNG)]);
        assert_eq!(document.json["images"][0]["uri"], expected);
    }
}

#[test]
fn missing_texture_is_a_warning_and_stays() {
    let (uri, warnings) = uri("Gone.jpg", "other.png");
    assert_eq!((uri, warnings.as_str()), ("Gone.jpg".into(), "texture `Gone.jpg` not found\n"));
}

#[test]
fn image_gltf_does_not_allow_stays_in_extras() {
    let mtl = "newmtl m\nmap_Kd a.tga\nnorm b.bmp\n";
    let document = read_files(&[("scene.obj", OBJ), ("scene.mtl", mtl.as_bytes()), ("a.tga", b"\0\0\x02\0\0\0")]);
    assert!(list(&document.json, "images").is_empty() && list(&document.json, "textures").is_empty());
    assert_eq!(document.json["materials"][0]["extras"], json!({"mtl": {"map_Kd": "a.tga", "norm": "b.bmp"}}));
    assert_eq!(document.warnings.len(), 2);
}

#[test]
fn content_counts_more_than_the_extension() {
    let mtl = "newmtl m\nmap_Kd a.tex\nmap_Ke b.png\n";
    let files: [(&str, &[u8]); 4] =
        [("scene.obj", OBJ), ("scene.mtl", mtl.as_bytes()), ("a.tex", b"\xff\xd8\xff\xe0"), ("b.png", b"GIF89a")];
    let document = read_files(&files);
    assert_eq!(document.json["images"], json!([{"uri": "a.tex"}]));
}

#[test]
fn materials_share_images_and_textures() {
    let mtl = "newmtl m\nmap_Kd a.png\nmap_Ke a.png\nnewmtl n\nmap_Kd a.png\n";
    let obj = format!("{}g x\nusemtl n\nf 1/1 2/1 3/1\n", String::from_utf8_lossy(OBJ));
    let document = read_files(&[("scene.obj", obj.as_bytes()), ("scene.mtl", mtl.as_bytes()), ("a.png", PNG)]);
    assert_eq!(document.json["images"], json!([{"uri": "a.png"}]));
    assert_eq!(document.json["textures"], json!([{"source": 0}]));
    assert!(document.json["samplers"].is_null());
}

#[test]
fn scale_offset_and_clamp_are_carried_over() {
    let document = textured("newmtl m\nmap_Kd -s 2 4 1 -o 0.25 0.5 a.png\nmap_Ke -clamp on a.png\n");
    let material = &document.json["materials"][0];
    let transform = json!({"KHR_texture_transform": {"offset": [0.25, -3.5], "scale": [2.0, 4.0]}});
    assert_eq!(material["pbrMetallicRoughness"]["baseColorTexture"]["extensions"], transform);
    assert_eq!(document.json["extensionsUsed"], json!(["KHR_texture_transform"]));
    assert_eq!(document.json["textures"], json!([{"source": 0}, {"source": 0, "sampler": 0}]));
    assert_eq!(document.json["samplers"], json!([{"wrapS": 33071, "wrapT": 33071}]));
}

#[test]
fn normal_map_has_a_scale_and_bump_map_is_no_normal_map() {
    let document = textured("newmtl m\nnorm -bm 3 n.png\nmap_Bump b.png\n");
    let material = &document.json["materials"][0];
    assert_eq!(material["normalTexture"], json!({"index": 0, "scale": 3.0}));
    assert_eq!(material["extras"], json!({"mtl": {"map_Bump": "b.png"}}));
    assert!(textured("newmtl m\nmap_Kn n.png\n").json["materials"][0]["normalTexture"].is_object());
}

#[test]
fn roughness_and_metalness_maps_are_taken_where_one_image_serves() {
    let of = |mtl: &str| textured(&format!("newmtl m\n{mtl}")).json["materials"][0].clone();
    let both = of("map_Pr orm.png\nmap_Pm orm.png\nPr 0.5\n");
    assert_eq!(
        both["pbrMetallicRoughness"],
        json!({"metallicFactor": 1.0, "roughnessFactor": 0.5, "metallicRoughnessTexture": {"index": 0}})
    );
    let rough = of("map_Pr r.png\n");
    assert_eq!(rough["pbrMetallicRoughness"]["metallicFactor"], 0.0);
    assert!(rough["pbrMetallicRoughness"]["metallicRoughnessTexture"].is_object());
    for mtl in ["map_Pr r.png\nmap_Pm m.png\n", "map_Pm m.png\n", "map_Pr r.png\nPm 1\n"] {
        let apart = of(mtl);
        assert!(apart["pbrMetallicRoughness"]["metallicRoughnessTexture"].is_null(), "{mtl}");
        assert!(apart["extras"]["mtl"].is_object(), "{mtl}");
    }
}

#[test]
fn color_that_would_hide_its_map_is_white() {
    let black = |mtl: &str| textured(mtl).json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"].clone();
    assert_eq!(black("newmtl m\nKd 0 0 0\nmap_Kd a.png\n"), Value::Null);
    assert_eq!(black("newmtl m\nKd 0 0 0\n"), json!([0.0, 0.0, 0.0, 1.0]));
}

#[test]
fn faces_without_texture_coordinates_get_the_material_without_textures() {
    let mtl = "newmtl m\nKd 0.5 0.5 0.5\nmap_Kd a.png\nmap_d a.png\nnewmtl plain\n";
    let faces = "usemtl m\nf 1 2 3\nf 1/1 2/1 3/1\nusemtl plain\nf 1 2 3\nf 1/1 2/1 3/1\n";
    let document = read_with_mtl(&format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n{faces}"), mtl);
    let of = |mesh: usize, at: usize| primitive(&document, mesh, at)["material"].as_u64();
    assert_eq!([of(0, 0), of(0, 1), of(1, 0), of(1, 1)], [Some(0), Some(1), Some(2), Some(2)]);
    let materials = list(&document.json, "materials");
    assert_eq!((&materials[0]["name"], &materials[1]["name"]), (&"m".into(), &"m".into()));
    assert_eq!(materials[0]["extras"], json!({"mtl": {"map_Kd": "a.png", "map_d": "a.png"}}));
    assert!(materials[0]["alphaMode"].is_null() && materials[1]["alphaMode"] == "MASK");
    assert!(materials[1]["extras"].is_null());
}
