//! From file to document: containers, JSON, buffers, extensions.

use raykiln_formats::document::Kind;
use raykiln_formats::read;
use serde_json::{Value, json};

use crate::support::{
    contents, folder, glb, read_bytes, refused, square, text, triangle_bytes, triangle_json, triangles,
};

fn with_buffer_uri(uri: &str) -> Value {
    let mut json = triangle_json();
    json["buffers"][0]["uri"] = uri.into();
    json
}

#[test]
fn glb_is_told_by_its_magic_whatever_the_extension() {
    for name in ["a.glb", "a.gltf", "a.dat"] {
        let doc = read_bytes(name, &glb(&triangle_json(), &triangle_bytes())).unwrap();
        assert_eq!(doc.kind, Kind::Glb);
        assert_eq!(doc.json, triangle_json());
        assert_eq!(triangles(&doc).corners, [[0, 1, 2]]);
    }
}

#[test]
fn a_buffer_is_cut_to_its_byte_length() {
    let mut bytes = triangle_bytes();
    bytes.extend([7; 3]);
    assert_eq!(read_bytes("a.glb", &glb(&triangle_json(), &bytes)).unwrap().buffers[0].len(), 36);
}

#[test]
fn every_truncation_of_a_glb_is_refused() {
    let file = glb(&triangle_json(), &triangle_bytes());
    for length in 0..file.len() {
        assert!(read_bytes("a.glb", &file[..length]).is_err(), "{length}");
    }
    assert!(refused("a.glb", &file[..7]).contains("truncated: a GLB header has 12 bytes, the file has 7"));
    assert!(refused("a.glb", &file[..40]).contains("header: truncated: the header gives"));
}

#[test]
fn an_empty_file_is_refused() {
    assert!(refused("a.gltf", b"").contains("the file is empty"));
}

#[test]
fn wrong_magic_is_refused() {
    assert!(refused("a.glb", b"GLTF\x02\0\0\0\x0c\0\0\0").contains("wrong magic"));
    assert!(refused("a.gltf", b"\x89PNG").contains("an image"));
}

#[test]
fn glb_version_1_is_refused() {
    let mut file = glb(&triangle_json(), &triangle_bytes());
    file[4] = 1;
    assert!(refused("a.glb", &file).contains("GLB version 1 is not supported"));
}

#[test]
fn a_chunk_past_the_end_is_refused() {
    let mut file = glb(&triangle_json(), &triangle_bytes());
    file[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(refused("a.glb", &file).contains("chunk 0: its 4294967295 bytes pass the end of the file"));
}

#[test]
fn a_total_length_below_the_header_is_refused() {
    let mut file = glb(&triangle_json(), &triangle_bytes());
    file[8..12].copy_from_slice(&8_u32.to_le_bytes());
    assert!(refused("a.glb", &file).contains("less than the header"));
}

#[test]
fn a_glb_without_chunks_or_with_another_first_chunk_is_refused() {
    assert!(refused("a.glb", b"glTF\x02\0\0\0\x0c\0\0\0").contains("the JSON chunk is missing"));
    let mut file = glb(&triangle_json(), &triangle_bytes());
    file[16..20].copy_from_slice(b"NOSJ");
    assert!(refused("a.glb", &file).contains("the first chunk is not JSON"));
}

#[test]
fn unknown_chunks_and_trailing_bytes_are_skipped_with_a_warning() {
    let mut file = glb(&triangle_json(), &triangle_bytes());
    file.extend(b"\x04\0\0\0MINEabcd");
    let total = file.len() as u32;
    file[8..12].copy_from_slice(&total.to_le_bytes());
    file.extend(b"tail");
    let doc = read_bytes("a.glb", &file).unwrap();
    let warnings: Vec<String> = doc.warnings.iter().map(ToString::to_string).collect();
    assert!(warnings[0].contains("4 bytes after the end"), "{warnings:?}");
    assert!(warnings[1].contains("chunk 2: of the unknown type \"MINE\""), "{warnings:?}");
    assert_eq!(triangles(&doc).corners.len(), 1);
}

#[test]
fn json_errors_name_line_and_column() {
    assert_eq!(refused("a.gltf", b"{\n \"asset\": }"), "line 2 column 11: JSON: expected value");
    let mut file = glb(&json!({"asset": 1}), &[]);
    file[20] = b'[';
    assert!(refused("a.glb", &file).starts_with("JSON chunk, line 1 column"));
}

#[test]
fn deeply_nested_json_is_refused() {
    let deep = format!("{{\"extras\":{}{}}}", "[".repeat(1_000_000), "]".repeat(1_000_000));
    assert!(refused("a.gltf", deep.as_bytes()).contains("recursion limit"));
}

#[test]
fn invalid_utf8_is_refused() {
    assert!(refused("a.gltf", b"{\"asset\": \"\xff\"}").contains("JSON"));
}

#[test]
fn a_byte_order_mark_is_skipped() {
    let mut file = b"\xEF\xBB\xBF".to_vec();
    file.extend(text(&json!({"asset": {"version": "2.0"}})));
    assert!(contents(&read_bytes("a.gltf", &file).unwrap()).nodes.is_empty());
}

#[test]
fn other_gltf_versions_are_refused() {
    let version = |asset: Value| refused("a.gltf", &text(&json!({ "asset": asset })));
    assert!(version(json!({"version": "1.0"})).contains("asset.version: glTF version \"1.0\" is not supported"));
    assert!(version(json!({"version": 2})).contains("asset.version: expected a string, found 2"));
    assert!(version(json!({"version": "2.1", "minVersion": "2.1"})).contains("asset.minVersion"));
    assert!(version(json!({})).contains("asset.version: is missing"));
    assert!(refused("a.gltf", b"{}").contains("asset: is missing"));
    assert!(read_bytes("a.gltf", &text(&json!({"asset": {"version": "2.1"}}))).is_ok());
}

#[test]
fn data_uris_are_read_in_base64_and_percent_encoding() {
    let percent: String = triangle_bytes().iter().map(|b| format!("%{b:02X}")).collect();
    let base64 = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    for uri in [
        format!("data:application/octet-stream;base64,{base64}"),
        format!("DATA:;BASE64,{base64}"),
        format!("data:,{percent}"),
    ] {
        let doc = read_bytes("a.gltf", &text(&with_buffer_uri(&uri))).unwrap();
        assert_eq!(&doc.buffers[0][..], triangle_bytes(), "{uri}");
    }
}

#[test]
fn broken_data_uris_are_refused() {
    let uri = |uri| refused("a.gltf", &text(&with_buffer_uri(uri)));
    assert!(uri("data:;base64,@@@@").contains("buffers[0].uri: the data URI is not base64"));
    assert!(uri("data:text").contains("no comma"));
    assert!(uri("data:;base64,AAAA").contains("byteLength is 36, but there are only 3 bytes"));
}

#[test]
fn buffer_files_have_percent_decoded_or_literal_names() {
    let bytes = triangle_bytes();
    for (uri, file) in [
        ("my%20buffer.bin", "my buffer.bin"),
        ("my buffer.bin", "my buffer.bin"),
        ("%E2%9D%A4.bin", "❤.bin"),
        ("❤.bin", "❤.bin"),
        ("sub/./a.bin", "sub/a.bin"),
        ("a%20b.bin", "a%20b.bin"),
    ] {
        let json = text(&with_buffer_uri(uri));
        let folder = folder(&[("a.gltf", &json), (file, &bytes)]);
        let doc = read(&folder.path().join("a.gltf")).unwrap();
        assert_eq!(&doc.buffers[0][..], bytes, "{uri}");
        assert_eq!(doc.json, with_buffer_uri(uri));
    }
}

#[test]
fn buffers_that_cannot_be_had_are_refused() {
    let uri = |uri| refused("a.gltf", &text(&with_buffer_uri(uri)));
    assert!(uri("gone.bin").contains("gone.bin cannot be read"));
    assert!(uri("https://example.org/a.bin").contains("URIs of the scheme https: are not supported"));
    assert!(uri("file:///a.bin").contains("URIs of the scheme file: are not supported"));
    assert!(uri("/dev/zero").contains("absolute path"));
    assert!(uri("../../../../../../../../../dev/zero").contains("not a regular file"));
    assert!(uri("").contains("the URI is empty"));
    assert!(uri("%FF").contains("not UTF-8"));
    assert!(refused("a.gltf", &text(&triangle_json())).contains("neither a uri nor a BIN chunk"));
}

#[test]
fn a_buffer_shorter_than_its_byte_length_is_refused() {
    let json = text(&with_buffer_uri("a.bin"));
    let folder = folder(&[("a.gltf", &json), ("a.bin", &[0; 35])]);
    let error = read(&folder.path().join("a.gltf")).unwrap_err();
    assert_eq!(error.place, "buffers[0]");
    assert_eq!(error.cause, "byteLength is 36, but there are only 35 bytes");
}

#[test]
fn several_buffers_keep_their_order() {
    let mut json = triangle_json();
    json["buffers"] = json!([
        { "byteLength": 36 }, { "byteLength": 48, "uri": "b.bin" }, { "byteLength": 2, "uri": "data:,ab" },
        { "byteLength": 4, "uri": "b.bin" }
    ]);
    let file = glb(&json, &triangle_bytes());
    let folder = folder(&[("a.glb", &file), ("b.bin", &square())]);
    let doc = read(&folder.path().join("a.glb")).unwrap();
    let lengths: Vec<usize> = doc.buffers.iter().map(|b| b.len()).collect();
    assert_eq!(lengths, [36, 48, 2, 4]);
    assert_eq!(&doc.buffers[2][..], b"ab");
}

#[test]
fn a_bin_chunk_without_a_buffer_is_left_out_with_a_warning() {
    let doc = read_bytes("a.glb", &glb(&json!({"asset": {"version": "2.0"}}), &[1; 4])).unwrap();
    assert!(doc.warnings[0].to_string().contains("BIN chunk: no buffer refers to it"));
}

#[test]
fn lists_that_are_no_lists_are_refused() {
    for list in ["buffers", "extensionsRequired", "meshes"] {
        let mut json = triangle_json();
        json[list] = json!(3);
        assert!(refused("a.glb", &glb(&json, &triangle_bytes())).starts_with(list));
    }
}

#[test]
fn unknown_required_extensions_are_refused_by_name() {
    let mut json = triangle_json();
    json["extensionsRequired"] = json!(["KHR_materials_unlit", "ACME_curves"]);
    let message = refused("a.glb", &glb(&json, &triangle_bytes()));
    assert_eq!(message, "extensionsRequired[1]: the required extension ACME_curves is not supported");
}

#[test]
fn required_extensions_that_leave_geometry_alone_are_accepted() {
    let mut json = triangle_json();
    json["extensionsRequired"] = json!([
        "KHR_mesh_quantization",
        "EXT_mesh_gpu_instancing",
        "KHR_texture_transform",
        "KHR_lights_punctual",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_texture_basisu",
        "EXT_texture_webp",
        "EXT_texture_avif",
        "MSFT_texture_dds",
        "KHR_xmp_json_ld",
        "KHR_animation_pointer"
    ]);
    assert!(read_bytes("a.glb", &glb(&json, &triangle_bytes())).is_ok());
}

#[test]
fn a_missing_file_is_an_error_that_names_it() {
    let error = read(std::path::Path::new("no/such/file.glb")).unwrap_err();
    assert!(error.to_string().starts_with("no/such/file.glb: "));
}
