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
        "-mm 0 1 -imfchan r -t 0 a b.png",
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
        ("D:\\jobs\\tex\\a.png", "lib/tex/a.png", "lib/tex/a.png"),
    ] {
        let mtl = format!("newmtl m\nmap_Kd {words}\n");
        let document = read_files(&[("scene.obj", obj.as_bytes()), ("lib/scene.mtl", mtl.as_bytes()), (file, PNG)]);
        assert_eq!(document.json["images"][0]["uri"], expected);
    }
}

#[test]
fn missing_texture_is_a_warning_and_is_not_referred_to() {
    let document =
        read_with_mtl(&format!("{}f 1/1 2/1 3/1\n", String::from_utf8_lossy(OBJ)), "newmtl m\nmap_Kd Gone.jpg\n");
    assert!(document.json["images"].is_null() && document.json["textures"].is_null());
    assert_eq!(document.json["materials"][0]["extras"], json!({"mtl": {"map_Kd": "Gone.jpg"}}));
    assert_eq!(warnings(&document), "texture `Gone.jpg` not found: kept by name in extras only\n");
}

#[test]
fn names_are_found_in_another_unicode_form_or_escaped() {
    assert_eq!(uri("b\u{e9}ton.png", "be\u{301}ton.png").0, "be%CC%81ton.png");
    assert_eq!(uri("dark%20wood.png", "dark wood.png").0, "dark%20wood.png");
    assert_eq!(uri("wood.png # oak", "wood.png").0, "wood.png");
    assert_eq!(uri("C:\\artist\\barn\\textures\\plank.png", "textures/plank.png").0, "textures/plank.png");
    assert_eq!(uri("\\\\server\\share\\a\\b.png", "a/b.png").0, "a/b.png");
}

#[test]
fn folders_to_search_come_last_and_files_outside_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for inside in ["scene", "more/tex"] {
        std::fs::create_dir_all(folder.path().join(inside)).expect("a folder made");
    }
    std::fs::write(folder.path().join("more/tex/a.png"), PNG).expect("a file written");
    std::fs::write(
        folder.path().join("scene/scene.mtl"),
        "newmtl m\nmap_Kd C:\\x\\tex\\a.png\nmap_Ke ../more/tex/a.png\n",
    )
    .expect("a file written");
    std::fs::write(folder.path().join("scene/scene.obj"), OBJ).expect("a file written");
    let path = folder.path().join("scene/scene.obj");
    let alone = raykiln_formats::read(&path).expect("sound");
    let expected = "texture `C:\\x\\tex\\a.png` not found: kept by name in extras only\n\
        texture `../more/tex/a.png` read from outside the folder of the model\n";
    assert_eq!(warnings(&alone), expected);
    let options = raykiln_formats::ObjOptions::default().with_search(vec![folder.path().join("more")]);
    let found = raykiln_formats::read_with(&path, &options).expect("sound");
    assert_eq!(found.json["images"][0]["uri"], "../more/tex/a.png");
}

#[test]
fn options_that_change_the_picture_are_named() {
    let (found, warnings) = uri("-t 1 a.png", "a.png");
    assert_eq!((found, warnings.as_str()), ("a.png".into(), "glTF cannot express `-t`: kept in extras only\n"));
    assert_eq!(textured("newmtl m\nmap_Kd -t 1 a.png\n").json["materials"][0]["extras"]["mtl"]["map_Kd"], "-t 1 a.png");
}

#[test]
fn base_and_gain_become_part_of_the_picture() {
    let row = encoded(image::RgbImage::from_raw(1, 1, vec![0, 100, 200]).expect("a pixel").into(), "png");
    let mask = grey(&[0, 200]);
    let mtl = b"newmtl m\nmap_Kd -mm 0.2 0.5 c.png\nmap_d -mm 1 -1 d.png\nmap_Ke -mm 0.2 0.5 c.png\n";
    let document = read_files(&[("scene.obj", OBJ), ("scene.mtl", mtl), ("c.png", &row), ("d.png", &mask)]);
    assert_eq!(pixels(&document, 0), [[51, 101, 151, 255], [51, 101, 151, 55]]);
    assert_eq!(pixels(&document, 1), [[51, 101, 151, 255]]);
    assert_eq!(warnings(&document), "");
}

#[test]
fn channel_of_a_map_is_the_one_asked_for() {
    let pixel = image::RgbaImage::from_raw(2, 1, vec![0, 30, 60, 255, 255, 40, 70, 255]).expect("a row");
    let file = encoded(pixel.into(), "png");
    let of = |mtl: &str| {
        let mtl = format!("newmtl m\n{mtl}");
        let document = read_files(&[("scene.obj", OBJ), ("scene.mtl", mtl.as_bytes()), ("a.png", &file)]);
        assert_eq!(warnings(&document), "");
        pixels(&document, 0)
    };
    assert_eq!(of("map_Kd a.png\nmap_d -imfchan r a.png\n"), [[0, 30, 60, 0], [255, 40, 70, 255]]);
    let packed = of("map_Pr -imfchan b a.png\nmap_Pm -imfchan g a.png\n");
    assert_eq!(packed, [[255, 60, 30, 255], [255, 70, 40, 255]]);
    assert_eq!(of("map_Pr -imfchan r a.png\n"), [[255, 0, 255, 255], [255, 255, 255, 255]]);
}

#[test]
fn other_words_for_maps_are_understood() {
    let document = textured("newmtl m\nmap_Kd a.png\nmap_opacity a.png\nmap_emissive e.png\nmap_normal n.png\n");
    let material = &document.json["materials"][0];
    assert_eq!((&material["alphaMode"], &material["extras"]), (&"MASK".into(), &Value::Null));
    assert!(material["emissiveTexture"].is_object() && material["normalTexture"].is_object());
}

#[test]
fn tiles_of_udim_are_named() {
    let (uri, warnings) = uri("skin.<UDIM>.png", "skin.1001.png");
    assert!(uri.is_null() && warnings.contains("UDIM"), "{warnings}");
}

/// The colours of an image in the buffer.
fn pixels(document: &raykiln_formats::Document, image: usize) -> Vec<[u8; 4]> {
    let image = &document.json["images"][image];
    assert_eq!(image["mimeType"], "image/png");
    let view = &document.json["bufferViews"][image["bufferView"].as_u64().expect("a view") as usize];
    let number = |key: &str| view[key].as_u64().expect("a number") as usize;
    let bytes = &document.buffers[0][number("byteOffset")..][..number("byteLength")];
    image::load_from_memory(bytes).expect("a PNG file").to_rgba8().pixels().map(|pixel| pixel.0).collect()
}

/// A PNG file of one row of grey pixels.
fn grey(values: &[u8]) -> Vec<u8> {
    encoded(image::GrayImage::from_raw(values.len() as u32, 1, values.to_vec()).expect("a row").into(), "png")
}

/// A file of an image.
fn encoded(image: image::DynamicImage, extension: &str) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let format = image::ImageFormat::from_extension(extension).expect("a format");
    image.write_to(&mut bytes, format).expect("memory");
    bytes.into_inner()
}

#[test]
fn images_of_other_formats_become_png() {
    let row = image::RgbImage::from_raw(2, 1, vec![1, 2, 3, 250, 251, 252]).expect("a row");
    for extension in ["tga", "bmp", "tiff"] {
        let (name, file) = (format!("a.{extension}"), encoded(row.clone().into(), extension));
        let mtl = format!("newmtl m\nmap_Kd {name}\nmap_Ke {name}\n");
        let document = read_files(&[("scene.obj", OBJ), ("scene.mtl", mtl.as_bytes()), (&name, &file)]);
        assert_eq!(pixels(&document, 0), [[1, 2, 3, 255], [250, 251, 252, 255]]);
        assert_eq!(list(&document.json, "images").len(), 1);
        assert_eq!(warnings(&document), "");
    }
}

#[test]
fn cut_outs_in_a_file_of_their_own_become_alpha() {
    let color = encoded(image::RgbImage::from_raw(1, 1, vec![9, 8, 7]).expect("a pixel").into(), "png");
    let (cut, soft) = (grey(&[0, 255]), grey(&[100, 150]));
    let files: [(&str, &[u8]); 4] = [
        ("scene.obj", OBJ),
        ("c.png", &color),
        ("d.png", &cut),
        ("scene.mtl", b"newmtl m\nmap_Kd c.png\nmap_d d.png\n"),
    ];
    let document = read_files(&files);
    assert_eq!(pixels(&document, 0), [[9, 8, 7, 0], [9, 8, 7, 255]]);
    let material = &document.json["materials"][0];
    assert_eq!((&material["alphaMode"], &material["extras"]), (&"MASK".into(), &Value::Null));
    let files: [(&str, &[u8]); 3] = [("scene.obj", OBJ), ("d.png", &soft), ("scene.mtl", b"newmtl m\nmap_d d.png\n")];
    let document = read_files(&files);
    assert_eq!(pixels(&document, 0), [[255, 255, 255, 100], [255, 255, 255, 150]]);
    assert_eq!(document.json["materials"][0]["alphaMode"], "BLEND");
}

#[test]
fn roughness_and_metalness_maps_are_packed() {
    let (rough, metal) = (grey(&[10, 20]), grey(&[200]));
    let of = |mtl: &str| {
        let mtl = format!("newmtl m\n{mtl}");
        let files: [(&str, &[u8]); 4] =
            [("scene.obj", OBJ), ("r.png", &rough), ("m.png", &metal), ("scene.mtl", mtl.as_bytes())];
        let document = read_files(&files);
        (pixels(&document, 0), document.json["materials"][0].clone())
    };
    let (both, material) = of("Pr 1\nPm 1\nmap_Pr r.png\nmap_Pm m.png\n");
    assert_eq!(both, [[255, 10, 200, 255], [255, 20, 200, 255]]);
    assert_eq!(material["pbrMetallicRoughness"]["roughnessFactor"], 1.0);
    assert_eq!(material["pbrMetallicRoughness"]["metallicFactor"], 1.0);
    assert!(material["extras"].is_null());
    let (metal_only, material) = of("Pr 0.5\nmap_Pm m.png\n");
    assert_eq!(metal_only, [[255, 255, 200, 255]]);
    assert_eq!(material["pbrMetallicRoughness"]["roughnessFactor"], 0.5);
    assert_eq!(of("map_Pr r.png\nPm 0.25\n").1["pbrMetallicRoughness"]["metallicFactor"], 0.25);
    let (shiny, material) = of("Ns 100\nmap_Ns m.png\n");
    assert!(shiny[0][1] > 70 && shiny[0][1] < 120, "{shiny:?}");
    assert_eq!(material["pbrMetallicRoughness"]["metallicFactor"], 0.0);
}

#[test]
fn bump_map_with_the_colours_of_normals_is_a_normal_map() {
    let normals = encoded(image::RgbImage::from_raw(1, 1, vec![128, 128, 255]).expect("a pixel").into(), "png");
    for key in ["map_Bump", "map_bump", "bump"] {
        let mtl = format!("newmtl m\n{key} -bm 0.8 n.png\n");
        let document = read_files(&[("scene.obj", OBJ), ("n.png", &normals), ("scene.mtl", mtl.as_bytes())]);
        assert_eq!(document.json["materials"][0]["normalTexture"], json!({"index": 0, "scale": 0.8}));
        assert_eq!(warnings(&document), "");
    }
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
    assert_eq!(warnings(&document), "glTF cannot express `map_Bump`: kept in extras only\n");
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
}

#[test]
fn color_that_would_hide_its_map_is_white() {
    let black = |mtl: &str| textured(mtl).json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"].clone();
    assert_eq!(black("newmtl m\nKd 0 0 0\nmap_Kd a.png\n"), Value::Null);
    assert_eq!(black("newmtl m\nKd 0 0 0\n"), json!([0.0, 0.0, 0.0, 1.0]));
    assert_eq!(black("newmtl m\nKd 0 0 0\nmap_d a.png\n"), json!([0.0, 0.0, 0.0, 1.0]));
}

#[test]
fn faces_without_texture_coordinates_get_the_material_without_textures() {
    let mtl = "newmtl m\nKd 0.5 0.5 0.5\nmap_Kd a.png\nmap_d a.png\nnewmtl plain\n";
    let faces = "usemtl m\nf 1 2 3\nf 1/1 2/1 3/1\nusemtl plain\nf 1 2 3\nf 1/1 2/1 3/1\n";
    let obj = format!("mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n{faces}");
    let document = read_files(&[("scene.obj", obj.as_bytes()), ("scene.mtl", mtl.as_bytes()), ("a.png", PNG)]);
    let of = |mesh: usize, at: usize| primitive(&document, mesh, at)["material"].as_u64();
    assert_eq!([of(0, 0), of(0, 1), of(1, 0), of(1, 1)], [Some(0), Some(1), Some(2), Some(2)]);
    let materials = list(&document.json, "materials");
    assert_eq!((&materials[0]["name"], &materials[1]["name"]), (&"m".into(), &"m".into()));
    assert_eq!(materials[0]["extras"], json!({"mtl": {"map_Kd": "a.png", "map_d": "a.png"}}));
    assert!(materials[0]["alphaMode"].is_null() && materials[1]["alphaMode"] == "MASK");
    assert!(materials[1]["extras"].is_null());
}
