//! OBJ files as users have them: what is right for a kind of file is in the output of each method.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::raykiln;

/// A file of one kind, and what is right for it.
struct Case {
    name: &'static str,
    /// The first one is the scene.
    files: Vec<(&'static str, Vec<u8>)>,
    /// Triangles of the output.
    triangles: u64,
    /// Part of a warning; none if empty.
    warning: &'static str,
    /// Asserts on the JSON of the output.
    right: fn(&Value),
}

const QUAD: &str = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

/// A textured quad of the material `m` of this MTL text.
fn quad(mtl: &str) -> Vec<(&'static str, Vec<u8>)> {
    let obj = format!("mtllib s.mtl\n{QUAD}usemtl m\nf 1/1 2/2 3/3 4/4\n");
    vec![("s.obj", obj.into()), ("s.mtl", format!("newmtl m\n{mtl}").into())]
}

/// A quad, and files beside it.
fn quad_with(mtl: &str, files: &[(&'static str, Vec<u8>)]) -> Vec<(&'static str, Vec<u8>)> {
    let mut all = quad(mtl);
    all.extend_from_slice(files);
    all
}

/// An OBJ file that stands alone.
fn bare(text: impl Into<Vec<u8>>) -> Vec<(&'static str, Vec<u8>)> {
    vec![("s.obj", text.into())]
}

/// A TGA file of one row of grey pixels.
fn grey(pixels: &[u8]) -> Vec<u8> {
    let head = [0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, pixels.len() as u8, 0, 1, 0, 8, 0];
    [&head, pixels].concat()
}

fn material<'v>(json: &'v Value, name: &str) -> &'v Value {
    let materials = json["materials"].as_array().expect("materials");
    materials.iter().find(|material| material["name"] == name).expect("the material")
}

fn pbr<'v>(json: &'v Value, name: &str) -> &'v Value {
    &material(json, name)["pbrMetallicRoughness"]
}

/// Attributes of all primitives.
fn attributes(json: &Value) -> impl Iterator<Item = &Value> {
    let meshes = json["meshes"].as_array().expect("meshes").iter();
    meshes.flat_map(|mesh| mesh["primitives"].as_array().expect("primitives")).map(|primitive| &primitive["attributes"])
}

fn nothing(_: &Value) {}

fn text_cases() -> Vec<Case> {
    let case = |name, files, triangles, warning, right| Case { name, files, triangles, warning, right };
    let two = format!("{QUAD}f 1 2 3\nf 1 3 4\n");
    let utf16: Vec<u8> = two.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let old = format!("# made\n{}", two.replace('\n', "\r"));
    // A texture that exists in one of the code pages decides.
    let gbk = b"mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl \xC4\xBE\xCE\xC6\nf 1/1 2/1 3/1\n".to_vec();
    let mtl = b"newmtl \xC4\xBE\xCE\xC6\nmap_Kd \xC4\xBE\xCE\xC6.tga\n".to_vec();
    let gbk = vec![("s.obj", gbk), ("s.mtl", mtl), ("木纹.tga", grey(&[7]))];
    vec![
        case("carriage returns after a line feed", bare(old), 2, "", nothing),
        case("UTF-16 without a mark", bare(utf16), 2, "", nothing),
        case("capitals", bare(two.to_uppercase()), 2, "", nothing),
        case("continued lines", bare(format!("{QUAD}f 1\\\r\n\t2  3\t\r\nf 1 3\\\n 4\n")), 2, "", nothing),
        case("a name that ends in a backslash", bare(format!("{QUAD}g a\\b\\\nf 1 2 3\n")), 1, "", nothing),
        case("numbers", bare("v 1.e-5 +0. -0\nv 1E+00 .0D0 0\nv +1 0,5 -.0\nf +1 2.0 +3\n"), 1, "", nothing),
        case("GBK", gbk, 1, "GBK", |json| assert!(pbr(json, "木纹")["baseColorTexture"].is_object())),
    ]
}

fn damage_cases() -> Vec<Case> {
    let case = |name, files, triangles, warning, right| Case { name, files, triangles, warning, right };
    vec![
        case("a bad face", bare(format!("{QUAD}f 1 2 99\nf 1 2 3\n")), 1, "line 9", nothing),
        case(
            "texture indices without coordinates",
            bare("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/7 2/8 3/9\n"),
            1,
            "line 4",
            nothing,
        ),
        case("normal 0", bare("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//0 2//0 3//0\n"), 1, "normal 0", nothing),
        case("lines and curves", bare(format!("{QUAD}l 1 2 3\ncurv 0 1 1 2\nf 1 2 3 4\n")), 2, "curves", |json| {
            assert!(json["meshes"].to_string().contains(r#""mode":1"#), "{json}");
        }),
        case("objects of one name", bare(format!("{QUAD}o a\nf 1 2 3\no b\nf 1 2 3\no a\nf 1 3 4\n")), 3, "", nothing),
        case(
            "forms of faces",
            bare(format!("{QUAD}vn 0 0 1\nf 1 2 3\nf 1/1 2/2 3/3\nf 1//1 2//1 3//1\nf 1/1/1 2/2/1 3/3/1\n")),
            4,
            "",
            nothing,
        ),
        case(
            "a bridge to a hole",
            bare("v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 1 1 0\nv 1 3 0\nv 3 3 0\nv 3 1 0\nf 1 2 3 4 1 5 6 7 8 5\n"),
            8,
            "",
            nothing,
        ),
        case(
            "faces front to back",
            bare(format!("{QUAD}usemtl a\nf 1 2 3 4\nusemtl b\nf 4 3 2 1\n")),
            4,
            "not defined",
            nothing,
        ),
    ]
}

fn material_cases() -> Vec<Case> {
    let case = |name, files, triangles, warning, right| Case { name, files, triangles, warning, right };
    let cut = quad_with("map_d d.tga\n", &[("d.tga", grey(&[0, 255]))]);
    let packed = quad_with("Pr 1\nPm 1\nmap_Pr r.tga\nmap_Pm m.tga\n", &[("r.tga", grey(&[9])), ("m.tga", grey(&[8]))]);
    let empty = vec![
        ("s.obj", format!("mtllib s.mtl\n{QUAD}usemtl m\nf 1 2 3\nusemtl\nf 1 3 4\n").into()),
        ("s.mtl", b"newmtl m\n".to_vec()),
    ];
    let goes_on = format!("mtllib s.mtl\n{QUAD}usemtl m # front\no a\nf 1 2 3\no b\nf 1 3 4\n");
    let goes_on = vec![("s.obj", goes_on.into()), ("s.mtl", b"newmtl m\nKd 1 0 0\n".to_vec())];
    vec![
        case("a mirror", quad("Kd 0 0 0\nKs 0.9\nNs 900\nillum 5\n"), 2, "", |json| {
            assert_eq!(
                (&pbr(json, "m")["metallicFactor"], &pbr(json, "m")["roughnessFactor"]),
                (&1.0.into(), &0.0.into())
            );
        }),
        case("glass", quad("Kd 0 0 0\nTf 0.9 0.8 0.9\nNi 1.5\nillum 7\n"), 2, "", |json| {
            let glass = &material(json, "m")["extensions"];
            assert!(glass["KHR_materials_transmission"]["transmissionFactor"].as_f64().is_some_and(|x| x > 0.8));
        }),
        case("Tr 1", quad("Tr 1\n"), 2, "opacity", |json| assert!(material(json, "m")["alphaMode"].is_null())),
        case("a cut-out of its own", cut, 2, "", |json| {
            assert_eq!(
                (&material(json, "m")["alphaMode"], &json["images"][0]["mimeType"]),
                (&"MASK".into(), &"image/png".into())
            );
        }),
        case("maps apart", packed, 2, "", |json| {
            assert_eq!(pbr(json, "m")["metallicRoughnessTexture"]["index"], 0);
            assert_eq!(json["images"].as_array().map(Vec::len), Some(1));
        }),
        case("a missing texture", quad("map_Kd C:\\gone.png\n"), 2, "gone.png", |json| {
            assert!(json["images"].is_null())
        }),
        case(
            "the end of a foreign path",
            quad_with("map_Kd C:\\a\\tex\\w.tga\n", &[("tex/W.tga", grey(&[7]))]),
            2,
            "",
            |json| {
                assert_eq!(json["images"][0]["mimeType"], "image/png");
            },
        ),
        case("both sides", quad("Kd 1 1 1\n"), 2, "", |json| assert_eq!(material(json, "m")["doubleSided"], true)),
        case("an empty usemtl", empty, 2, "", |json| {
            assert_eq!(json["meshes"].to_string().matches(r#""material":"#).count(), 1);
        }),
        case("a material that goes on", goes_on, 2, "", |json| assert_eq!(pbr(json, "m")["baseColorFactor"][1], 0.0)),
        case("sRGB colours", bare("v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n"), 1, "", |json| {
            assert!(attributes(json).all(|attributes| attributes["COLOR_0"].is_u64()));
        }),
        case("#MRGB", bare("v 0 0 0\nv 1 0 0\nv 0 1 0\n#MRGB ffff0000ff00ff00ff0000ff\nf 1 2 3\n"), 1, "", |json| {
            assert!(attributes(json).all(|attributes| attributes["COLOR_0"].is_u64()));
        }),
        case("smoothing groups", bare(format!("{QUAD}s 1\nf 1 2 3\nf 1 3 4\n")), 2, "", |json| {
            assert!(attributes(json).all(|attributes| attributes["NORMAL"].is_u64()));
        }),
    ]
}

/// Bakes a case by a method and judges the output.
fn judge(case: &Case, method: &str) {
    let folder = TempDir::new().expect("a temporary folder");
    for (name, bytes) in &case.files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        fs::write(path, bytes).expect("writable");
    }
    let [input, output] = [case.files[0].0, "out.glb"].map(|name| folder.path().join(name));
    let text = |path: &Path| path.to_str().expect("UTF-8").to_owned();
    let bake = ["bake", &text(&input), "-o", &text(&output), "--method", method, "--json", "-v"].map(str::to_owned);
    let ran = raykiln(bake.iter().map(String::as_str).chain(["--rays", "200", "--repeats", "1", "--device", "cpu"]));
    let place = format!("{} by {method}", case.name);
    assert_eq!(ran.status, 0, "{place}: {}", ran.stderr);
    let report = ran.json();
    let warnings = report["warnings"].to_string();
    assert_eq!(warnings == "[]", case.warning.is_empty(), "{place}: {warnings}");
    assert!(warnings.contains(case.warning), "{place}: {warnings}");
    assert_eq!(report["after"]["triangles_placed"], case.triangles, "{place}");
    (case.right)(&raykiln_formats::read(&output).expect("sound").json);
}

#[test]
fn text_of_any_kind_is_read_right_by_each_method() {
    for case in text_cases() {
        ["keep", "single", "auto"].iter().for_each(|method| judge(&case, method));
    }
}

#[test]
fn damage_is_left_out_by_each_method() {
    for case in damage_cases() {
        ["keep", "single", "auto"].iter().for_each(|method| judge(&case, method));
    }
}

#[test]
fn materials_mean_the_same_by_each_method() {
    for case in material_cases() {
        ["keep", "single", "auto"].iter().for_each(|method| judge(&case, method));
    }
}
