//! Pictures of tiny scenes whose pixels are known.

use raykiln_formats::Document;

use super::*;
use crate::scene::load;

/// Two triangles of a square from -1 to 1 at a height, with a normal.
fn square(z: f64, first: usize, normal: f64) -> String {
    let corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(|[x, y]| format!("v {x} {y} {z}\n")).concat();
    let [a, b, c, d] = [0, 1, 2, 3].map(|i| first + i);
    let n = first.div_ceil(4);
    format!("o square {first}\n{corners}vn 0 0 {normal}\nf {a}//{n} {b}//{n} {c}//{n}\nf {a}//{n} {c}//{n} {d}//{n}\n")
}

fn read(obj: &str) -> (Document, Scene) {
    let doc = raykiln_formats::read_bytes("scene.obj", obj.to_owned()).expect("sound");
    let (scene, _) = load(&doc, &Default::default()).expect("sound");
    (doc, scene)
}

fn options() -> RenderOptions {
    RenderOptions { size: [16, 16], samples: Some(1), ..RenderOptions::default() }
}

/// Draws a scene from above: the square from -1 to 1 covers the middle half of the picture's sides.
fn drawn(obj: &str, view: View, options: &RenderOptions) -> Picture {
    let (doc, scene) = read(obj);
    let renderer = Renderer::new(&doc, &scene).expect("something to see");
    renderer.picture(view, &from_above(&renderer), options).expect("sound options")
}

fn from_above(renderer: &Renderer) -> Camera {
    let field_degrees = 2.0 * 0.5f64.atan().to_degrees();
    // Slightly off the middle, so that no ray meets the edge that the two triangles of a square share.
    let target = glam::DVec3::new(0.01, 0.004, 0.0);
    let eye = target + 4.0 * glam::DVec3::Z;
    renderer.camera(&CameraChoice::At { eye, target, field_degrees }).expect("it shows something")
}

#[test]
fn a_group_has_one_colour_where_it_is_and_the_ground_shows_elsewhere() {
    let picture = drawn(&square(0.0, 1, 1.0), View::Groups, &options());
    let ground = picture.pixel(0, 0).expect("a pixel");
    let inside = |x: u32, y: u32| (4..12).contains(&x) && (4..12).contains(&y);
    for (x, y) in (0..16).flat_map(|x| (0..16).map(move |y| (x, y))) {
        assert_eq!(picture.pixel(x, y) == Some(ground), !inside(x, y), "{x} {y}");
    }
    assert_eq!(picture.statistics.seen_ratio, 0.25);
}

#[test]
fn a_heat_map_counts_the_steps_of_each_ray() {
    let (doc, scene) = read(&square(0.0, 1, 1.0));
    let renderer = Renderer::new(&doc, &scene).expect("something to see");
    let costs = renderer.costs(&from_above(&renderer), &options()).expect("sound options");
    let values: Vec<f64> = costs.values().collect();
    assert_eq!(values[0], 0.0, "the corner of the picture misses the box");
    // One entry, and two triangles in one leaf or in two below an inner node.
    assert!((2.0..=4.0).contains(&values[8 * 16 + 8]), "{}", values[8 * 16 + 8]);
    assert_eq!(costs.mean().map(|mean| mean.entries), Some(0.25));
    let scale = Costs::scale(&[&costs]);
    assert!((2.0..=5.0).contains(&scale), "{scale}");
    let [one, two] = [1.0, 2.0].map(|more| costs.picture(ColourMap::Jet, scale * more));
    assert_ne!(one.pixel(8, 8), two.pixel(8, 8));
    assert_eq!(one.pixel(0, 0), Some(ColourMap::Jet.at(0.0)));
}

#[test]
fn a_transparent_picture_counts_every_surface() {
    let two = square(0.0, 1, 1.0) + &square(-0.5, 5, 1.0);
    let one = drawn(&square(0.0, 1, 1.0), View::Transparent, &options());
    let both = drawn(&two, View::Transparent, &options());
    let max = |picture: &Picture| picture.statistics.values.expect("surfaces per ray").max;
    assert_eq!([max(&one), max(&both)], [1.0, 2.0]);
    assert_eq!(one.pixel(0, 0), both.pixel(0, 0), "the ground");
    assert_ne!(one.pixel(8, 8), both.pixel(8, 8));
}

#[test]
fn overlap_counts_the_boxes_around_the_first_hit() {
    let high = square(0.0, 1, 1.0);
    // A box around the square: a tilted triangle from corner to corner.
    let around = "o tilted\nv -1 -1 -1\nv 1 -1 -0.9\nv -1 1 1\nf 5 6 7\n";
    let max = |obj: &str| drawn(obj, View::Overlap, &options()).statistics.values.expect("boxes").max;
    assert_eq!([max(&high), max(&(high.clone() + around))], [1.0, 2.0]);
}

#[test]
fn boxes_are_drawn_at_every_depth_and_only_if_their_mask_is_set() {
    let two = square(0.0, 1, 1.0) + &square(-0.5, 5, 1.0);
    let with = |depth, boxes| {
        let masks = Masks { boxes, ..Masks::default() };
        drawn(&two, View::Boxes, &RenderOptions { depth, masks, ..options() })
    };
    let count = |picture: &Picture| picture.statistics.boxes.expect("a number of boxes");
    assert_eq!([None, Some(0), Some(1), Some(60)].map(|depth| count(&with(depth, true))), [2, 1, 2, 4]);
    assert_eq!(count(&with(None, false)), 0);
    assert_ne!(with(None, true).pixels, with(None, false).pixels);
    let masks = Masks { scene: false, boxes: true, instances: true };
    let bare = drawn(&two, View::Boxes, &RenderOptions { masks, ..options() });
    assert_eq!(bare.statistics.seen_ratio, 0.0, "both are placed once");
}

#[test]
fn a_flipped_normal_and_a_missing_surface_show_and_equal_scenes_do_not() {
    let both = square(0.0, 1, 1.0) + &square(-0.5, 5, 1.0);
    let differences = |before: &str, after: &str| {
        let (before, after) = (read(before), read(after));
        let renderers = [&before, &after].map(|(doc, scene)| Renderer::new(doc, scene).expect("something to see"));
        let camera = from_above(&renderers[0]);
        let picture = renderers[0].difference(&renderers[1], &camera, &options()).expect("sound options");
        picture.statistics.differences.expect("two scenes")
    };
    let equal = differences(&both, &both);
    assert_eq!(equal, Differences::default());
    let flipped = differences(&both, &(square(0.0, 1, -1.0) + &square(-0.5, 5, 1.0)));
    assert_eq!((flipped.normal_pixels, flipped.surface_pixels), (64, 0), "{flipped:?}");
    let missing = differences(&both, &square(-0.5, 1, 1.0));
    assert!(missing.surface_pixels == 64 && missing.mean_absolute >= 0.0, "{missing:?}");
}

#[test]
fn a_scene_that_is_grouped_in_another_way_is_lit_as_before() {
    let cube = |first: usize| {
        let corners =
            (0..8).map(|i| format!("v {} {} {}\n", 90 * (i & 1) - 45, 90 * (i >> 1 & 1) - 45, 90 * (i >> 2) - 45));
        let face = |[a, b, c, d]: [usize; 4]| {
            format!("f {}//1 {}//1 {}//1 {}//1\n", first + a, first + b, first + c, first + d)
        };
        let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]].map(face);
        format!("o sky\n{}{}", corners.collect::<String>(), faces.concat())
    };
    // So many that the sky has few of the triangles.
    let squares: String = (0..700).map(|i| square(-1e-3 * i as f64, 4 * i + 1, 1.0)).collect();
    let apart = squares + &cube(4 * 700 + 1);
    let together =
        format!("o all\n{}", apart.lines().filter(|line| !line.starts_with("o ")).collect::<Vec<_>>().join("\n"));
    let (before, after) = (read(&apart), read(&together));
    assert_ne!(before.1.core().bounds(), after.1.core().bounds(), "the sky is no longer apart");
    let [first, second] = [&before, &after].map(|(doc, scene)| Renderer::new(doc, scene).expect("something to see"));
    let camera = from_above(&first);
    let picture = first.difference(&second, &camera, &options()).expect("sound options");
    assert_eq!(picture.statistics.differences, Some(Differences::default()));
    let shaded =
        |renderer: &Renderer| renderer.picture(View::Shaded, &camera, &options()).expect("sound options").pixels;
    assert_eq!(shaded(&second.lit_as(&first)), shaded(&first));
}

#[test]
fn light_falls_on_what_faces_the_lamp() {
    let floor = |y: f64| format!("v -1 {y} -1\nv -1 {y} 1\nv 1 {y} 1\nv 1 {y} -1\nf 1 2 3\nf 1 3 4\n");
    let (doc, scene) = read(&floor(0.0));
    let renderer = Renderer::new(&doc, &scene).expect("something to see");
    let seen_from = |y: f64| {
        let eye = glam::DVec3::new(0.0, y, 0.001);
        let choice = CameraChoice::At { eye, target: glam::DVec3::ZERO, field_degrees: 20.0 };
        let camera = renderer.camera(&choice).expect("it shows something");
        let options = RenderOptions { samples: Some(16), ..options() };
        let picture = renderer.picture(View::Shaded, &camera, &options).expect("sound options");
        picture.pixel(8, 8).map(|[r, g, b]| u32::from(r) + u32::from(g) + u32::from(b)).expect("a pixel")
    };
    let [above, below] = [seen_from(3.0), seen_from(-3.0)];
    assert!(above > below + 60, "{above} {below}");
}

#[test]
fn place_size_and_power_of_the_light_change_the_picture() {
    // A small square above the middle of a larger one casts a shadow.
    let corners = |y: f64, half: f64| {
        [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]].map(|[x, z]| format!("v {} {y} {}\n", half * x, half * z))
    };
    let faces =
        |first: usize| format!("f {first} {} {}\nf {first} {} {}\n", first + 1, first + 2, first + 2, first + 3);
    let text = [corners(0.0, 1.0).concat(), corners(0.5, 0.2).concat(), faces(1), faces(5)].concat();
    let (doc, scene) = read(&text);
    let renderer = Renderer::new(&doc, &scene).expect("something to see");
    let choice =
        CameraChoice::At { eye: glam::DVec3::new(0.0, 3.0, 2.0), target: glam::DVec3::ZERO, field_degrees: 40.0 };
    let camera = renderer.camera(&choice).expect("it shows something");
    let pixels = |corner: [f64; 3], size, light_power| {
        let light = Some(Light { corner: glam::DVec3::from_array(corner), size });
        let options = RenderOptions { samples: Some(8), light, light_power: Some(light_power), ..options() };
        renderer.picture(View::Shaded, &camera, &options).expect("sound options").pixels
    };
    let light = |pixels: &[u8]| pixels.iter().map(|&value| u64::from(value)).sum::<u64>();
    let above = [-0.1, 2.0, -0.1];
    let base = pixels(above, 0.2, 1.0);
    assert_eq!(pixels(above, 0.2, 1.0), base);
    assert_ne!(pixels([1.5, 2.0, -0.1], 0.2, 1.0), base, "the shadow moves");
    assert_ne!(pixels([-1.0, 2.0, -1.0], 2.0, 1.0), base, "the shadow softens");
    let [dark, dim, bright] = [0.0, 0.25, 4.0].map(|power| light(&pixels(above, 0.2, power)));
    assert!(dark < dim && dim < light(&base) && light(&base) < bright, "{dark} {dim} {bright}");
    let bad = RenderOptions { light_power: Some(-1.0), ..options() };
    assert_eq!(renderer.picture(View::Shaded, &camera, &bad).err(), Some(RenderError::LightPower(-1.0)));
}
