//! Alpha-tested geometries: timed rays pass through transparent texels, compared rays never do.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use raykiln_formats::alpha::Image;

use super::scenes::{geometry, mesh, scene};
use super::*;
use crate::scene::{AlphaTest, AlphaTexture, Geometry, Opacity, Wrap};

/// Returns an RGBA image with the given alpha values, in rows from the top.
fn image(width: u32, alpha: &[u8]) -> Image {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, alpha.len() as u32 / width);
    encoder.set_color(png::ColorType::Rgba);
    let texels: Vec<u8> = alpha.iter().flat_map(|a| [10, 20, 30, *a]).collect();
    encoder.write_header().expect("written").write_image_data(&texels).expect("written");
    Image::from_bytes("leaf".into(), bytes.into())
}

/// A square of 1 x 1 in the plane z = 0, with texture coordinate `from` at its lower left corner and `to` at its upper
/// right one.
fn card(from: [f32; 2], to: [f32; 2], wrap: Wrap) -> Geometry {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let texcoords = vec![from, [to[0], from[1]], to, [from[0], to[1]]];
    let texture = AlphaTexture { image: 0, wrap: [wrap; 2], texcoords };
    Geometry {
        opacity: Opacity::Mask { cutoff: 0.5 },
        alpha: Some(AlphaTest { cutoff: 0.5, factor: 1.0, texture: Some(texture) }),
        ..geometry(&corners, &[[0, 1, 2], [0, 2, 3]])
    }
}

fn shown(geometries: Vec<Geometry>, image: Image) -> Scene {
    Scene { images: vec![image], ..scene(vec![mesh(geometries)], [(0, DAffine3::IDENTITY)]) }
}

/// Rays down onto the cell centres of a square of 1 x 1 divided into `n` x `n` cells, in rows from the top.
fn grid(n: u32, x: f32) -> Vec<Ray> {
    let middle = |i: u32| (i as f32 + 0.5) / n as f32;
    let down = |i: u32| Ray {
        origin: [x + middle(i % n), 1.0 - middle(i / n), 1.0].into(),
        direction: [0.0, 0.0, -1.0].into(),
        t_min: 0.0,
        t_max: 100.0,
    };
    (0..n * n).map(down).collect()
}

/// Draws which timed rays hit, as rows of `#` and `.`; all must hit when they are compared.
fn picture(device: &Device, scene: &Scene, n: u32, blas_per: BlasPer) -> Vec<String> {
    scene.check().expect("a sound scene");
    let pipelines = Pipelines::new(device).expect("made");
    let options = BuildOptions { blas_per, ..BuildOptions::default() };
    let tracer = VulkanTracer::new(&pipelines, scene, options).expect("built");
    let rays = device.upload_rays(&grid(n, 0.0)).expect("uploaded");
    assert!(tracer.trace(&rays, false).expect("traced").hits.iter().all(Option::is_some));
    let hits = tracer.timed_hits(&rays, false).expect("traced");
    assert_eq!(hits, tracer.timed_hits(&rays, true).expect("traced"), "any hit is a hit");
    let row = |row: &[bool]| row.iter().map(|hit| if *hit { '#' } else { '.' }).collect();
    hits.chunks(n as usize).map(row).collect()
}

/// An image of 2 x 2 texels, opaque at the upper left and the lower right.
fn leaf() -> Image {
    image(2, &[255, 0, 0, 255])
}

#[test]
fn rays_that_are_timed_pass_where_the_texture_is_transparent() {
    // The first row of an image is at v = 0, here the upper end of the card.
    let card = card([0.0, 1.0], [1.0, 0.0], Wrap::Repeat);
    on_device(|device| {
        assert_eq!(picture(device, &shown(vec![card], leaf()), 4, BlasPer::Mesh), ["##..", "##..", "..##", "..##"]);
    });
}

#[test]
fn half_a_card_of_16_384_rays_is_passed() {
    let alpha: Vec<u8> = (0..64 * 64).map(|i| if i % 64 < 32 { 255 } else { 127 }).collect();
    let scene = shown(vec![card([0.0, 1.0], [1.0, 0.0], Wrap::Clamp)], image(64, &alpha));
    on_device(|device| {
        let picture = picture(device, &scene, 128, BlasPer::Mesh);
        assert!(picture.iter().all(|row| *row == "#".repeat(64) + &".".repeat(64)));
    });
}

#[test]
fn textures_go_on_beyond_their_ends_as_their_sampler_says() {
    let picture_of = |device: &Device, wrap| {
        picture(device, &shown(vec![card([-1.0, 2.0], [2.0, -1.0], wrap)], leaf()), 6, BlasPer::Mesh)
    };
    on_device(|device| {
        assert_eq!(picture_of(device, Wrap::Repeat), ["#.#.#.", ".#.#.#", "#.#.#.", ".#.#.#", "#.#.#.", ".#.#.#"]);
        assert_eq!(picture_of(device, Wrap::Clamp), ["###...", "###...", "###...", "...###", "...###", "...###"]);
        assert_eq!(picture_of(device, Wrap::Mirror), ["#..##.", ".##..#", ".##..#", "#..##.", "#..##.", ".##..#"]);
    });
}

#[test]
fn the_factor_and_the_cutoff_count() {
    let with = |factor, cutoff, texture: bool| {
        let mut card = card([0.0, 1.0], [1.0, 0.0], Wrap::Repeat);
        let alpha = card.alpha.as_mut().expect("it has one");
        (alpha.factor, alpha.cutoff) = (factor, cutoff);
        alpha.texture = alpha.texture.take().filter(|_| texture);
        shown(vec![card], image(2, &[51, 102, 153, 255]))
    };
    on_device(|device| {
        let of = |scene: &Scene| picture(device, scene, 2, BlasPer::Mesh);
        assert_eq!(of(&with(1.0, 0.4, true)), [".#", "##"]);
        assert_eq!(of(&with(0.5, 0.4, true)), ["..", ".#"]);
        assert_eq!(of(&with(0.5, 0.0, true)), ["##", "##"]);
        assert_eq!(of(&with(1.0, 1.1, true)), ["..", ".."]);
        assert_eq!(of(&with(0.4, 0.5, false)), ["..", ".."]);
        assert_eq!(of(&with(0.6, 0.5, false)), ["##", "##"]);
    });
}

#[test]
fn each_geometry_is_tested_with_its_own_texture_however_blases_are_cut() {
    let behind = |mut g: Geometry, z: f32| {
        Arc::make_mut(&mut g.positions).iter_mut().for_each(|p| p.z = z);
        g
    };
    let top = card([0.0, 1.0], [1.0, 0.0], Wrap::Repeat);
    let left = card([0.0, 1.0], [0.4, 0.6], Wrap::Repeat);
    let blended = Geometry { opacity: Opacity::Blend, alpha: None, ..card([0.0; 2], [1.0; 2], Wrap::Repeat) };
    let opaque = Geometry { opacity: Opacity::Opaque, alpha: None, ..card([0.0; 2], [1.0; 2], Wrap::Repeat) };
    on_device(|device| {
        for per in [BlasPer::Mesh, BlasPer::Primitive] {
            let of = |geometries| picture(device, &shown(geometries, leaf()), 2, per);
            // The whole second card shows the lower left texel, which is transparent.
            assert_eq!(of(vec![left.clone(), behind(top.clone(), -1.0)]), ["#.", ".#"]);
            assert_eq!(of(vec![top.clone(), behind(left.clone(), -1.0)]), ["#.", ".#"]);
            assert_eq!(of(vec![top.clone(), behind(blended.clone(), -1.0)]), ["##", "##"]);
            assert_eq!(of(vec![behind(opaque.clone(), -1.0), left.clone()]), ["##", "##"]);
        }
    });
}

#[test]
fn instances_of_several_meshes_find_their_own_tests() {
    let solid =
        mesh(vec![Geometry { opacity: Opacity::Opaque, alpha: None, ..card([0.0; 2], [1.0; 2], Wrap::Repeat) }]);
    let leafy = mesh(vec![solid.geometries[0].clone(), card([0.0, 1.0], [1.0, 0.0], Wrap::Repeat)]);
    let at = |x: f64, z: f64| DAffine3::from_translation(DVec3::new(x, 0.0, z));
    let mut leafy_only = leafy.clone();
    leafy_only.geometries.remove(0);
    leafy_only.geometries[0].first_triangle = 0;
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let placed = [(0, at(2.0, 0.0)), (1, flat), (1, at(0.0, 0.0)), (0, at(4.0, -1.0)), (1, at(4.0, 0.0))];
    let scene = Scene { images: vec![leaf()], ..scene(vec![solid, leafy_only], placed) };
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("made");
        let tracer = VulkanTracer::new(&pipelines, &scene, BuildOptions::default()).expect("built");
        let rays: Vec<Ray> = [0.0, 2.0, 4.0].into_iter().flat_map(|x| grid(2, x)).collect();
        let rays = device.upload_rays(&rays).expect("uploaded");
        let hits = tracer.timed_hits(&rays, false).expect("traced");
        assert_eq!(hits, [true, false, false, true, true, true, true, true, true, true, true, true]);
    });
}

#[test]
fn a_texture_that_cannot_be_had_is_opaque_and_named() {
    let images = [
        Image::from_bytes("images[3] `leaf.ktx2`".into(), b"\xABKTX 20\xBB\r\n\x1A\n"[..].into()),
        Image::broken("images[5]".into(), "lost".into()),
    ];
    on_device(|device| {
        for (image, reason) in
            images.into_iter().zip(["images[3] `leaf.ktx2`: KTX2 images are not decoded", "images[5]: lost"])
        {
            let scene = shown(vec![card([0.0, 1.0], [1.0, 0.0], Wrap::Repeat)], image);
            assert_eq!(picture(device, &scene, 2, BlasPer::Mesh), ["##", "##"]);
            let pipelines = Pipelines::new(device).expect("made");
            let tracer = VulkanTracer::new(&pipelines, &scene, BuildOptions::default()).expect("built");
            let expected = format!("timed rays take these textures of alpha-tested materials for opaque: {reason}");
            assert_eq!(tracer.opaque_textures().map(ToString::to_string), Some(expected));
        }
    });
}

#[test]
fn a_texture_is_on_the_device_once_for_both_layouts() {
    let alpha: Vec<u8> = (0..512 * 512).map(|i| i as u8).collect();
    let scene = shown(vec![card([0.0, 1.0], [1.0, 0.0], Wrap::Repeat)], image(512, &alpha));
    let twice = Scene { images: vec![scene.images[0].clone(), scene.images[0].clone()], ..scene.clone() };
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("made");
        let build = |scene| VulkanTracer::new(&pipelines, scene, BuildOptions::default()).expect("built");
        let before = device.used_memory();
        let first = build(&scene);
        let one = device.used_memory() - before;
        let second = build(&twice);
        let both = device.used_memory() - before;
        assert!(one > 512 * 512 && both < one + 512 * 512, "{one} and {both} bytes");
        assert_eq!((first.opaque_textures(), second.opaque_textures()), (None, None));
    });
}

#[test]
fn coordinates_far_beyond_the_texture_or_without_end_do_no_harm() {
    let mut wild = card([-1e30, f32::MAX], [f32::MAX, -f32::MAX], Wrap::Mirror);
    on_device(|device| {
        picture(device, &shown(vec![wild.clone()], leaf()), 8, BlasPer::Mesh);
        let texture = wild.alpha.as_mut().and_then(|a| a.texture.as_mut()).expect("it has one");
        texture.texcoords[1] = [f32::NAN, f32::INFINITY];
        picture(device, &shown(vec![wild.clone()], leaf()), 8, BlasPer::Mesh);
    });
}
