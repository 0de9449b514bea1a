//! Colours, normals, sides, axes and units of OBJ files.

mod obj_support;

use obj_support::{attribute, primitive, read, read_files, read_with_mtl, warnings};
use raykiln_formats::{DoubleSided, ObjNormals, ObjOptions};
use serde_json::{Value, json};

const ARCH: &str = "v -1 0 0\nv 0 0 1\nv 1 0 0\nv -1 2 0\nv 0 2 1\nv 1 2 0\n";

fn with(text: &str, change: impl FnOnce(&mut ObjOptions)) -> raykiln_formats::Document {
    let mut options = ObjOptions::default();
    change(&mut options);
    raykiln_formats::read_bytes_with("scene.obj", text.as_bytes().to_vec(), &options).expect("sound")
}

#[test]
fn smoothing_groups_share_normals_within() {
    let document = read(&format!("{ARCH}s 1\nf 1 2 5 4\nf 2 3 6 5\n"));
    let (positions, normals) = (attribute(&document, 0, 0, "POSITION"), attribute(&document, 0, 0, "NORMAL"));
    assert_eq!(positions.len(), 6);
    for (position, normal) in positions.iter().zip(&normals) {
        let expected = [position[0] * 0.5f64.sqrt(), 0.0, if position[0] == 0.0 { 1.0 } else { 0.5f64.sqrt() }];
        assert!(normal.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{position:?} {normal:?}");
    }
    assert_eq!(warnings(&document), "");
}

#[test]
fn faces_outside_smoothing_groups_are_flat() {
    let document = read(&format!("{ARCH}s 1\nf 1 2 5 4\ns off\nf 2 3 6 5\n"));
    let normals = attribute(&document, 0, 0, "NORMAL");
    assert_eq!(normals.len(), 8);
    assert!(normals.iter().all(|n| (n[2] - 0.5f64.sqrt()).abs() < 1e-6));
    let on = read(&format!("{ARCH}s on\nf 1 2 5 4\nf 2 3 6 5\n"));
    assert_eq!(attribute(&on, 0, 0, "NORMAL").len(), 6);
    let flat = read(&format!("{ARCH}f 1 2 5 4\nf 2 3 6 5\n"));
    assert!(primitive(&flat, 0, 0)["attributes"]["NORMAL"].is_null());
}

#[test]
fn normals_of_the_file_count_more_than_groups_unless_told_otherwise() {
    let text = format!("{ARCH}vn 0 1 0\ns 1\nf 1//1 2//1 5//1 4//1\nf 2//1 3//1 6//1 5//1\n");
    let ridge = |which: ObjNormals| {
        let document = with(&text, |options| options.normals = which);
        let at = &primitive(&document, 0, 0)["attributes"]["NORMAL"];
        (!at.is_null()).then(|| obj_support::numbers(&document, at)[1].clone())
    };
    assert_eq!(ridge(ObjNormals::Keep), Some(vec![0.0, 1.0, 0.0]));
    assert_eq!(ridge(ObjNormals::Generate), Some(vec![0.0, 0.0, 1.0]));
    assert_eq!(ridge(ObjNormals::None), None);
}

#[test]
fn vertex_colours_become_linear() {
    let document = read("v 0 0 0 0.501961 0 1\nv 1 0 0 0.04 0 0\nv 0 1 0 1 1 1\nf 1 2 3\n");
    let colors = attribute(&document, 0, 0, "COLOR_0");
    assert!((colors[0][0] - 0.2159).abs() < 1e-4 && colors[0][2] == 1.0);
    assert!((colors[1][0] - 0.04 / 12.92).abs() < 1e-8);
}

#[test]
fn vertex_colours_under_a_texture_are_left_out() {
    let obj = "mtllib scene.mtl\nv 0 0 0 .5 .5 .5\nv 1 0 0 .5 .5 .5\nv 0 1 0 .5 .5 .5\nvt 0 0\nusemtl m\n\
        f 1/1 2/1 3/1\nf 1 2 3\n";
    let mtl = b"newmtl m\nmap_Kd a.png\n";
    let document = read_files(&[("scene.obj", obj.as_bytes()), ("scene.mtl", mtl), ("a.png", obj_support::PIXEL)]);
    assert!(primitive(&document, 0, 0)["attributes"]["COLOR_0"].is_null());
    assert!(primitive(&document, 0, 1)["attributes"]["COLOR_0"].is_u64());
    assert!(warnings(&document).contains("vertex colours under a texture"));
}

#[test]
fn colours_of_polypaint_comments_are_read() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n#MRGB ffba8f4dff808080\n#MRGB ff405c96\nf 1 2 3\n";
    let colors = attribute(&read(text), 0, 0, "COLOR_0");
    assert!((colors[1][0] - 0.2159).abs() < 1e-4, "{colors:?}");
    assert!(colors[0][0] > colors[0][1] && colors[0][1] > colors[0][2]);
    let short = read(&text.replace("#MRGB ff405c96\n", ""));
    assert!(warnings(&short).contains("#MRGB"), "{}", warnings(&short));
}

#[test]
fn alpha_of_vertex_colours_is_left_out_with_a_warning() {
    let document = read("v 0 0 0 .5 .5 .5 .5\nv 1 0 0 .5 .5 .5 1\nv 0 1 0 .5 .5 .5 1\nf 1 2 3\n");
    assert_eq!(warnings(&document), "line 1: alpha of vertex colours left out\n");
}

/// Whether the material of a text is double-sided.
fn double_sided(faces: &str) -> Value {
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl m\n";
    read_with_mtl(&format!("{corners}{faces}"), "newmtl m\nnewmtl n\n").json["materials"][0]["doubleSided"].clone()
}

#[test]
fn materials_of_open_surfaces_are_double_sided() {
    assert_eq!(double_sided("f 1 2 3\n"), true);
    assert_eq!(double_sided("f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"), Value::Null);
    assert_eq!(double_sided("f 1 3 2\nf 1 2 4\nusemtl n\nf 2 3 4\nf 3 1 4\n"), Value::Null);
    assert_eq!(double_sided("f 1 3 2\nf 1 2 4\nf 2 3 4\n"), true);
    let of = |which: DoubleSided| {
        with("v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n", |options| options.double_sided = which).json["materials"]
            [0]["doubleSided"]
            .clone()
    };
    assert_eq!((of(DoubleSided::Never), of(DoubleSided::Always)), (Value::Null, true.into()));
}

#[test]
fn faces_without_a_material_get_one_if_all_are_double_sided() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\no a\nf 1 2 3\no b\nf 1 2 3\nl 1 2\n";
    let document = with(text, |options| options.double_sided = DoubleSided::Always);
    assert_eq!(document.json["materials"], json!([{"doubleSided": true}]));
    let materials: Vec<_> = (0..3).map(|mesh| primitive(&document, mesh, 0)["material"].clone()).collect();
    assert_eq!(materials, [0.into(), 0.into(), Value::Null]);
    assert!(read(text).json["materials"].is_null());
}

#[test]
fn axes_and_unit_become_a_matrix_above_all_nodes() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\no a\nf 1 2 3\no b\nf 1 2 3\n";
    let document = with(text, |options| (options.z_up, options.unit) = (true, Some(0.5)));
    let root = &document.json["nodes"][2];
    let matrix = json!([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!((&root["matrix"], &root["children"]), (&matrix, &json!([0, 1])));
    assert_eq!(document.json["scenes"][0]["nodes"], json!([2]));
}
