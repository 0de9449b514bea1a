//! Objects, groups and materials of OBJ files as nodes.

mod obj_support;

use obj_support::{list, objects, read, read_with_mtl, tree, triangle_count, triangles, warnings};

/// An OBJ text of these statements, where `f` alone is a triangle.
fn scene(statements: &str) -> String {
    let lines =
        statements.split(" | ").map(|line| if line == "f" { "f 1 2 3\n".to_owned() } else { format!("{line}\n") });
    format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}", lines.collect::<String>())
}

#[test]
fn groups_become_nodes_in_order_of_first_face() {
    let document = read(&scene("g b | f | g empty | g a | f"));
    assert_eq!(tree(&document), "b a");
    assert_eq!(objects(&document), ["b", "a"]);
    assert_eq!(document.json["meshes"][1]["name"], "a");
}

#[test]
fn group_opened_again_is_the_same_group() {
    let document = read(&scene("g a | f | g b | f | g a | f"));
    assert_eq!(tree(&document), "a b");
    assert_eq!(triangles(&document, 0, 0), [[0, 1, 2], [0, 1, 2]]);
}

#[test]
fn group_of_several_materials_is_a_node_above_them() {
    let document = read_with_mtl(&scene("g a | usemtl x | f | usemtl y | f | usemtl x | f"), "newmtl x\nnewmtl y\n");
    assert_eq!(tree(&document), "a(a/x a/y)");
    assert_eq!(triangle_count(&document), 3);
    assert_eq!(objects(&document), ["a/x", "a/y"]);
    let of = |mesh: usize| &document.json["meshes"][mesh]["primitives"][0]["material"];
    assert_eq!((of(0), of(1)), (&0.into(), &1.into()));
}

#[test]
fn material_without_a_group_is_split_all_the_same() {
    let document = read_with_mtl(&scene("f | usemtl y | f"), "newmtl y\n");
    assert_eq!(tree(&document), "default(default/(none) default/y)");
    assert!(document.json["meshes"][0]["primitives"][0]["material"].is_null());
}

#[test]
fn object_is_a_node_above_its_groups_where_both_say_something() {
    assert_eq!(tree(&read(&scene("o car | g wheel | f | g door | f"))), "car(wheel door)");
    assert_eq!(tree(&read(&scene("o car | g wheel | f"))), "car(wheel)");
    assert_eq!(tree(&read(&scene("o car | f"))), "car");
    assert_eq!(tree(&read(&scene("o car | g car | f"))), "car");
    assert_eq!(tree(&read(&scene("o car | f | g wheel | f"))), "car(car wheel)");
}

#[test]
fn equal_group_names_in_two_objects_are_two_groups() {
    assert_eq!(tree(&read(&scene("o a | g x | f | o b | g x | f"))), "a(x) b(x)");
}

#[test]
fn object_ends_the_group_before_it() {
    assert_eq!(tree(&read(&scene("g x | f | o b | f"))), "x b");
    assert_eq!(tree(&read(&scene("o b | g x | f | g | f | o | f"))), "b(x b) default");
}

#[test]
fn names_keep_spaces_and_signs() {
    let text = scene("g front  cube | usemtl my/mat # 1 | f | g\tback | f");
    assert_eq!(tree(&read(&text)), "front  cube back");
    assert!(warnings(&read(&text)).contains("material `my/mat # 1` is not defined"));
}

#[test]
fn undefined_materials_stay_apart_by_name() {
    let document = read(&scene("usemtl a | f | usemtl b | f | usemtl a | f"));
    let names: Vec<_> = list(&document.json, "materials").iter().map(|material| &material["name"]).collect();
    assert_eq!(names, ["a", "b"]);
    assert_eq!(warnings(&document), "materials `a`, `b` are not defined: default ones take their places\n");
}

#[test]
fn usemtl_before_mtllib_finds_its_material() {
    let document = obj_support::read_files(&[
        ("scene.obj", b"usemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nmtllib scene.mtl\n"),
        ("scene.mtl", b"newmtl a\nKd 1 0 0\n"),
    ]);
    assert_eq!(document.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][1], 0.0);
}

#[test]
fn thousand_groups_make_a_thousand_nodes_and_six_views_at_most() {
    let faces: String = (0..1000).map(|i| format!("g part {i}\nf 1 2 3\n")).collect();
    let document = read(&format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}"));
    assert_eq!(list(&document.json, "nodes").len(), 1000);
    assert!(list(&document.json, "bufferViews").len() <= 6);
}
