//! The glTF scenes of `samples/`; each shows one fault that a method repairs. Sizes and places are chosen so that the
//! counts and ratios in the `expect.toml` files can be derived by hand.

use crate::shapes::{Shape, cube, cuboid, floor, needles, octahedron, sphere};
use crate::writer::Writer;
use glam::{DAffine3, DVec3, dvec3};
use serde_json::json;
use std::io;
use std::path::Path;

const RED: [f64; 3] = [0.8, 0.1, 0.1];
const BLUE: [f64; 3] = [0.1, 0.2, 0.8];
const GREY: [f64; 3] = [0.6, 0.6, 0.6];

/// A scene of `samples/`: its file and the function that writes it.
type Sample = (&'static str, fn(Writer) -> io::Result<()>);

/// Writes every scene below `folder`.
pub(crate) fn all(folder: &Path) -> io::Result<()> {
    let scenes: [Sample; 13] = [
        ("clean/scene.glb", clean),
        ("overlapping/scene.glb", overlapping),
        ("scattered/scene.glb", scattered),
        ("instanced/scene.gltf", instanced),
        ("animated/scene.glb", animated),
        ("staggered/scene.glb", staggered),
        ("plus/scene.glb", plus),
        ("woven/scene.glb", woven),
        ("hierarchy/scene.gltf", hierarchy),
        ("transparent/scene.glb", transparent),
        ("textured/scene.gltf", textured),
        ("copies/scene.gltf", copies),
        ("findings/scene.glb", findings),
    ];
    for (file, write) in scenes {
        let path = folder.join(file);
        std::fs::create_dir_all(path.parent().expect("a folder"))?;
        write(Writer::create(&path)?)?;
    }
    Ok(())
}

/// Five spheres of 128 triangles, far apart.
fn clean(mut writer: Writer) -> io::Result<()> {
    let (red, grey) = (writer.material("red", RED), writer.material("grey", GREY));
    for i in 0..5 {
        let material = if i % 2 == 0 { red } else { grey };
        let name = format!("ball {i}");
        let mesh = writer.mesh(&name, &[(&sphere(1.0, 2), Some(material))])?;
        writer.push("nodes", json!({"name": name, "mesh": mesh, "translation": [4.0 * i as f64, 0.0, 0.0]}));
    }
    writer.finish(None)
}

/// At each of the four corners of a square of 20 units, three cubes of 2 units, each 0.1 above and beside the previous;
/// two of the three share a material.
fn overlapping(mut writer: Writer) -> io::Result<()> {
    let (red, blue) = (writer.material("red", RED), writer.material("blue", BLUE));
    for (corner, (x, z)) in [(0.0, 0.0), (20.0, 0.0), (0.0, 20.0), (20.0, 20.0)].into_iter().enumerate() {
        for (i, material) in [red, blue, red].into_iter().enumerate() {
            let name = format!("crate {corner}.{i}");
            let mesh = writer.mesh(&name, &[(&cube(2.0), Some(material))])?;
            let aside = 0.1 * i as f64;
            let at = [x + aside, 1.0 + aside, z + aside];
            writer.push("nodes", json!({"name": name, "mesh": mesh, "translation": at}));
        }
    }
    writer.finish(None)
}

/// One mesh of sixteen octahedra of 8 triangles, 10 units apart along a zigzag.
fn scattered(mut writer: Writer) -> io::Result<()> {
    let grey = writer.material("grey", GREY);
    let islands = (0..16).fold(Shape::default(), |so_far, i| {
        so_far.and(&octahedron(1.0).at(10.0 * f64::from(i), 5.0 * f64::from(i % 2), 0.0))
    });
    writer.object("archipelago", &islands, Some(grey))?;
    writer.finish(None)
}

/// Six nodes that share a mesh of two materials; one is mirrored, one is stretched, two are children of a rotated node.
fn instanced(mut writer: Writer) -> io::Result<()> {
    let (red, grey) = (writer.material("shade", RED), writer.material("stand", GREY));
    let (shade, stand) = (sphere(0.5, 2).at(0.3, 2.5, 0.0), cuboid(dvec3(0.2, 2.5, 0.2)).at(0.0, 1.25, 0.0));
    let lamp = writer.mesh("lamp", &[(&shade, Some(red)), (&stand, Some(grey))])?;
    for i in 0..2 {
        writer.push(
            "nodes",
            json!({"name": format!("lamp {i}"), "mesh": lamp, "translation": [2.0 * i as f64, 0.0, 0.0]}),
        );
    }
    let mirrored =
        json!({"name": "mirrored lamp", "mesh": lamp, "translation": [5.0, 0.0, 0.0], "scale": [-1.0, 1.0, 1.0]});
    let stretched =
        json!({"name": "stretched lamp", "mesh": lamp, "translation": [7.0, 0.0, 0.0], "scale": [1.0, 1.5, 1.0]});
    writer.push("nodes", mirrored);
    writer.push("nodes", stretched);
    let turn = [0.0, std::f64::consts::FRAC_1_SQRT_2, 0.0, std::f64::consts::FRAC_1_SQRT_2];
    writer.push("nodes", json!({"name": "row", "rotation": turn, "translation": [10.0, 0.0, 0.0], "children": [5, 6]}));
    for i in 0..2 {
        let at = [3.0 * i as f64, 0.0, 0.0];
        writer.push("nodes", json!({"name": format!("lamp of the row {i}"), "mesh": lamp, "translation": at}));
    }
    writer.finish(Some((0..5).collect()))
}

/// Three overlapping static cubes, and two more below a node with an animated rotation.
fn animated(mut writer: Writer) -> io::Result<()> {
    let grey = writer.material("grey", GREY);
    for i in 0..3 {
        let aside = 0.1 * f64::from(i);
        writer.object(&format!("static {i}"), &cube(2.0).at(aside, 1.0 + aside, aside), Some(grey))?;
    }
    let carousel = json!({"name": "carousel", "translation": [8.0, 0.0, 0.0], "children": [4, 5]});
    let carousel = writer.push("nodes", carousel);
    let horse = writer.mesh("horse", &[(&cube(1.0), Some(grey))])?;
    for i in 0..2 {
        let at = [if i == 0 { -2.0 } else { 2.0 }, 0.5, 0.0];
        writer.push("nodes", json!({"name": format!("horse {i}"), "mesh": horse, "translation": at}));
    }
    let times = writer.floats([0.0, 1.0], 1, None)?;
    writer.bound(times, 0.0, 1.0);
    let turns = writer.floats([0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0], 4, None)?;
    let target = json!({"node": carousel, "path": "rotation"});
    let channels = json!([{"sampler": 0, "target": target}]);
    let samplers = json!([{"input": times, "output": turns, "interpolation": "LINEAR"}]);
    writer.push("animations", json!({"name": "round and round", "channels": channels, "samplers": samplers}));
    writer.finish(Some(vec![0, 1, 2, carousel]))
}

/// A row of octahedra, one at each of the given places along an axis.
fn row(axis: DVec3, radius: f64, places: impl Iterator<Item = f64>) -> Shape {
    places.fold(Shape::default(), |so_far, place| {
        let center = place * axis;
        so_far.and(&octahedron(radius).at(center.x, center.y, center.z))
    })
}

/// Two rows of twelve and eight octahedra; the last four of the first surround the first four of the second.
fn staggered(mut writer: Writer) -> io::Result<()> {
    let (red, blue) = (writer.material("red", RED), writer.material("blue", BLUE));
    writer.object("long row", &row(DVec3::X, 0.45, (0..12).map(f64::from)), Some(red))?;
    writer.object("short row", &row(DVec3::X, 0.4, (8..16).map(f64::from)), Some(blue))?;
    writer.finish(None)
}

/// Two rows of sixteen octahedra that cross at the tenth of each.
fn plus(mut writer: Writer) -> io::Result<()> {
    let (red, blue) = (writer.material("red", RED), writer.material("blue", BLUE));
    let places = || (0..16).map(|i| f64::from(i) - 9.0);
    writer.object("beam", &row(DVec3::X, 0.45, places()), Some(red))?;
    writer.object("post", &row(DVec3::Y, 0.4, places()), Some(blue))?;
    writer.finish(None)
}

/// Eight rows of eight octahedra along x and as many along y, which cross at half their height: each box overlaps nine
/// others.
fn woven(mut writer: Writer) -> io::Result<()> {
    let (red, blue) = (writer.material("red", RED), writer.material("blue", BLUE));
    let places = || (0..8).map(f64::from);
    for i in 0..8 {
        let (across, above) = (f64::from(i), 0.3);
        writer.object(&format!("warp {i}"), &row(DVec3::X, 0.6, places()).at(0.0, across, above), Some(red))?;
        writer.object(&format!("weft {i}"), &row(DVec3::Y, 0.6, places()).at(across, 0.0, -above), Some(blue))?;
    }
    writer.finish(None)
}

/// Nested nodes with names, extras, a camera, a light, and an unknown extension.
fn hierarchy(mut writer: Writer) -> io::Result<()> {
    let grey = writer.material("grey", GREY);
    let wall = writer.mesh("wall", &[(&cuboid(dvec3(4.0, 2.0, 0.2)), Some(grey))])?;
    let gadget = writer.mesh("gadget", &[(&octahedron(0.5), None)])?;
    writer.push(
        "cameras",
        json!({"name": "eye", "type": "perspective",
        "perspective": {"yfov": 0.8, "aspectRatio": 1.5, "znear": 0.1}}),
    );
    let nodes = [
        json!({"name": "house", "extras": {"architect": "nobody", "floors": 1}, "children": [1, 4, 5]}),
        json!({"name": "storey", "translation": [0.0, 1.0, 0.0], "children": [2, 3]}),
        json!({"name": "front wall", "mesh": wall, "extras": {"bearing": true}}),
        json!({"name": "back wall", "mesh": wall, "translation": [0.0, 0.0, -3.0], "extras": {"bearing": false}}),
        json!({"name": "gadget", "mesh": gadget, "translation": [0.0, 3.0, 0.0],
            "extensions": {"ACME_spin": {"speed": 3.5}}}),
        json!({"name": "lamp", "translation": [0.0, 4.0, 2.0], "extensions": {"KHR_lights_punctual": {"light": 0}}}),
        json!({"name": "viewpoint", "camera": 0, "translation": [0.0, 1.0, 9.0], "extras": {"shot": "first"}}),
    ];
    for node in nodes {
        writer.push("nodes", node);
    }
    writer.set("extensionsUsed", json!(["KHR_lights_punctual", "ACME_spin"]));
    let light = json!({"type": "point", "color": [1.0, 0.9, 0.8], "intensity": 40.0});
    writer.set("extensions", json!({"KHR_lights_punctual": {"lights": [light]}, "ACME_spin": {"unit": "turns"}}));
    writer.set("extras", json!({"revision": 7}));
    writer.finish(Some(vec![0, 6]))
}

/// An opaque trunk among cards that are alpha-tested or blended.
fn transparent(mut writer: Writer) -> io::Result<()> {
    let bark = writer.material("bark", GREY);
    let leaves = writer.push(
        "materials",
        json!({"name": "leaves", "alphaMode": "MASK", "alphaCutoff": 0.3,
        "doubleSided": true, "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.6, 0.2, 0.5]}}),
    );
    let haze = writer.push(
        "materials",
        json!({"name": "haze", "alphaMode": "BLEND",
        "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.8, 0.9, 0.2]}}),
    );
    writer.object("trunk", &cuboid(dvec3(0.5, 4.0, 0.5)).at(0.0, 2.0, 0.0), Some(bark))?;
    for i in 0..4 {
        let card = floor(3.0).at(0.1 * f64::from(i), 2.0 + 0.4 * f64::from(i), 0.0);
        writer.object(&format!("leaves {i}"), &card, Some(leaves))?;
    }
    writer.object("haze", &cube(3.5).at(0.0, 2.5, 0.0), Some(haze))?;
    writer.finish(None)
}

/// A textured wall of two overlapping slabs; the image file is beside the scene file and has a space in its name.
fn textured(mut writer: Writer) -> io::Result<()> {
    writer.push("images", json!({"name": "bricks", "uri": "brick%20wall.png"}));
    writer.push("samplers", json!({"wrapS": 10497, "wrapT": 10497}));
    writer.push("textures", json!({"source": 0, "sampler": 0}));
    let brick =
        json!({"name": "brick", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0}});
    let brick = writer.push("materials", brick);
    writer.object("inner slab", &cuboid(dvec3(6.0, 3.0, 0.5)), Some(brick))?;
    writer.object("outer slab", &cuboid(dvec3(6.0, 3.0, 0.5)).at(0.2, 0.0, 0.1), Some(brick))?;
    writer.finish(None)
}

/// Twenty-seven copies of a cube placed by `EXT_mesh_gpu_instancing`, and one more instance of the same mesh.
fn copies(mut writer: Writer) -> io::Result<()> {
    let grey = writer.material("grey", GREY);
    let mesh = writer.mesh("pebble", &[(&cube(1.0), Some(grey))])?;
    let grid = (0..27).flat_map(|i| [i % 3, i / 3 % 3, i / 9].map(|along| 3.0 * along as f32));
    let translations = writer.floats(grid, 3, None)?;
    let copies = json!({"attributes": {"TRANSLATION": translations}});
    writer.push("nodes", json!({"name": "pile", "mesh": mesh, "extensions": {"EXT_mesh_gpu_instancing": copies}}));
    writer.push("nodes", json!({"name": "stray", "mesh": mesh, "translation": [12.0, 0.0, 0.0]}));
    writer.set("extensionsUsed", json!(["EXT_mesh_gpu_instancing"]));
    writer.set("extensionsRequired", json!(["EXT_mesh_gpu_instancing"]));
    writer.finish(None)
}

/// Forty equal rocks, each a mesh of its own, on a ground of 60 units, with what `inspect` finds: islands in one mesh, long
/// thin diagonal triangles, a sky dome, and a mark far away.
fn findings(mut writer: Writer) -> io::Result<()> {
    let (red, blue, grey) = (writer.material("red", RED), writer.material("blue", BLUE), writer.material("grey", GREY));
    writer.object("ground", &floor(60.0), Some(grey))?;
    let rock = sphere(1.0, 2).placed(DAffine3::from_scale(dvec3(1.0, 0.7, 0.85)));
    for i in 0..40 {
        let at = dvec3(4.0 * f64::from(i % 8) - 28.0, 1.5, 4.0 * f64::from(i / 8) - 8.0);
        writer.object(&format!("rock {i}"), &rock.clone().at(at.x, at.y, at.z), Some(grey))?;
    }
    let island = |i: i32| octahedron(1.0).at(8.0 * f64::from(i) - 28.0, 2.0, 22.0 - 44.0 * f64::from(i % 2));
    let islands = (0..8).fold(Shape::default(), |so_far, i| so_far.and(&island(i)));
    writer.object("islands", &islands, Some(red))?;
    let starts = (0..300).map(|i| dvec3(10.0 + 0.2 * f64::from(i % 20), 2.0, 0.2 * f64::from(i / 20) - 8.0));
    writer.object("cables", &needles(DVec3::splat(15.0), 0.02, starts), Some(red))?;
    writer.object("sky", &octahedron(1200.0), Some(blue))?;
    writer.object("forgotten mark", &floor(10.0).at(20_000.0, 0.0, 0.0), Some(red))?;
    writer.finish(None)
}
