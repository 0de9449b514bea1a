use std::collections::BTreeSet;
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
use raykiln_formats::record::{Placed, Provenance};

use super::places::{Core, find};
use super::*;
use crate::scene::Mesh;
use crate::verify::identity::Identity;
use crate::verify::test_scenes::{cube, instance, mesh, room, scene};
use crate::verify::tests::{baked, tilted};
use crate::verify::{Failure, Matching, Verification, surface, verify};

fn options() -> VerifyOptions {
    VerifyOptions { rays_per_kind: 2048, repeats: 1, ..VerifyOptions::default() }
}

fn aimed_at(scene: &Scene) -> Aimed {
    Aimed::new(scene, None, 0.0, &options())
}

/// Returns a torus with a tube of radius 1 around a circle of radius 3, its corners on multiples of 2^-12.
pub(in crate::verify) fn torus() -> Mesh {
    let (around, across) = (48, 24);
    let turn = |i: u32, n: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
    let corner = |i: u32, j: u32| {
        let ((sin, cos), (up, out)) = (turn(i, around).sin_cos(), turn(j, across).sin_cos());
        let exact = DVec3::new((3.0 + out) * cos, up, (3.0 + out) * sin);
        ((exact * 4096.0).round() / 4096.0).as_vec3()
    };
    let positions = (0..around).flat_map(|i| (0..across).map(move |j| corner(i, j))).collect();
    let at = |i: u32, j: u32| (i % around) * across + j % across;
    let quad = |i, j| [[at(i, j), at(i, j + 1), at(i + 1, j)], [at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]];
    let triangles = (0..around).flat_map(|i| (0..across).flat_map(move |j| quad(i, j))).collect();
    mesh(0, vec![(None, positions, triangles)])
}

pub(in crate::verify) fn one(mesh: Mesh) -> Scene {
    scene(vec![mesh], &[(0, DAffine3::IDENTITY)])
}

/// Returns a scene as a bake writes it with every second run of `run` triangles in the second of two frames.
pub(in crate::verify) fn cut(before: &Scene, frames: [DAffine3; 2], run: u32) -> Scene {
    let half = |(number, frame): (u32, DAffine3)| {
        let mut group = baked(before, frame);
        let geometry = &mut group.meshes[0].geometries[0];
        let kept: Vec<u32> = (0..geometry.triangles.len() as u32).filter(|t| t / run % 2 == number).collect();
        geometry.triangles = kept.iter().map(|&t| geometry.triangles[t as usize]).collect();
        geometry.kept = Some(kept);
        group.meshes[0].source += number;
        group
    };
    let [mut all, other] = [half((0, frames[0])), half((1, frames[1]))];
    all.meshes.push(other.meshes[0].clone());
    let node = before.nodes as u32 + 1;
    all.instances.push(instance(node, 1, frames[1]));
    let Provenance::Recorded(record) = &mut all.provenance else { unreachable!() };
    let record = Arc::make_mut(record);
    record.placed.push(Placed { node, ..record.placed[0] });
    all
}

/// Returns a scene without the record of what it was made from.
fn as_input(mut scene: Scene) -> Scene {
    for geometry in scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.geometries) {
        geometry.kept = None;
    }
    scene.provenance = Provenance::Unrecorded;
    scene
}

fn shifted() -> DAffine3 {
    DAffine3::from_translation(DVec3::new(3.0, -5.0, 7.0))
}

fn verified(before: &Scene, after: &Scene) -> Verification {
    verify(before, after, &options())
}

#[test]
fn groups_in_frames_of_their_own_open_cracks_and_fail() {
    let torus = one(torus());
    let found = verified(&torus, &cut(&torus, [tilted(), DAffine3::IDENTITY], 12));
    assert!(matches!(found.failures[..], [Failure::Seams(_)]), "{found}");
    let Seams { before_lost, across_groups, inside, opened, after_lost, .. } = found.seams;
    assert_eq!((before_lost, inside.after_lost, opened), (0, 0, after_lost), "{:?}", found.seams);
    assert!(across_groups.after_lost > across_groups.rays / 100, "{:?}", found.seams);
}

#[test]
fn cracks_are_found_without_knowing_which_triangle_is_which() {
    let torus = one(torus());
    let after = cut(&torus, [tilted(), DAffine3::IDENTITY], 1);
    let found = verify(&torus, &after, &VerifyOptions { matching: Matching::Surface, ..options() });
    assert!(matches!(found.failures[..], [Failure::Seams(_)]), "{found}");
    assert_eq!(found.seams.across_groups.rays, 0);
}

#[test]
fn groups_in_one_frame_lose_nothing() {
    let torus = one(torus());
    for frame in [DAffine3::IDENTITY, shifted(), tilted()] {
        for after in [baked(&torus, frame), cut(&torus, [frame; 2], 12)] {
            let found = verified(&torus, &after);
            assert!(found.passed(), "{found}");
            assert_eq!((found.seams.rays, found.seams.before_lost, found.seams.after_lost), (2048, 0, 0));
        }
    }
}

#[test]
fn separate_objects_may_have_frames_of_their_own() {
    let apart = DAffine3::from_translation(DVec3::X * 10.0);
    let before = scene(vec![torus(), torus()], &[(0, DAffine3::IDENTITY), (1, apart)]);
    let count = before.meshes[0].triangle_count() as u32;
    let found = verified(&before, &cut(&before, [tilted(), shifted()], count));
    assert!(found.passed(), "{found}");
    assert_eq!((found.seams.rays, found.seams.after_lost), (2048, 0));
}

#[test]
fn cracks_of_the_input_are_not_held_against_an_equal_output() {
    let cracked = as_input(cut(&one(torus()), [DAffine3::IDENTITY, shifted()], 12));
    let found = verified(&cracked, &cracked);
    assert!(found.passed(), "{found}");
    let Seams { before_lost, after_lost, opened, closed, across_groups, .. } = found.seams;
    assert!(before_lost > 10 && before_lost == across_groups.before_lost, "{:?}", found.seams);
    assert_eq!((after_lost, opened, closed), (before_lost, 0, 0));
}

#[test]
fn an_output_may_close_cracks() {
    let cracked = as_input(cut(&one(torus()), [DAffine3::IDENTITY, shifted()], 12));
    let found = verified(&cracked, &baked(&cracked, DAffine3::IDENTITY));
    assert!(found.passed(), "{found}");
    assert!(found.seams.closed > 10 && found.seams.after_lost == 0, "{:?}", found.seams);
}

#[test]
fn a_hole_is_a_crack() {
    let before = one(torus());
    let mut after = before.clone();
    after.meshes[0].geometries[0].triangles.truncate(2000);
    let found = verify(&before, &after, &VerifyOptions { matching: Matching::Surface, ..options() });
    assert!(found.failures.iter().any(|failure| matches!(failure, Failure::Seams(_))), "{found}");
}

#[test]
fn rays_do_not_depend_on_the_number_of_threads() {
    let before = room();
    let after = baked(&before, tilted());
    let (_, pairs) = surface::compare(&Identity::new(&before, &after), 1e-6);
    let aimed = || Aimed::new(&before, Some(&pairs), 1e-6, &options());
    let here = aimed();
    assert!(here.rays.len() > 2000, "{} rays", here.rays.len());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    assert_eq!(pool.install(aimed), here);
    let other = Aimed::new(&before, None, 1e-6, &VerifyOptions { seed: 2, ..options() });
    assert_ne!(other.rays[0], here.rays[0]);
}

#[test]
fn rays_end_just_behind_the_place_they_are_aimed_at() {
    let cube = one(cube(0, None));
    for ray in aimed_at(&cube).rays {
        let end = ray.origin + ray.t_max * ray.direction;
        assert!((end.abs().max_element() - 1.0).abs() < 1e-4, "{ray:?} ends at {end}");
        assert!(ray.t_max < 0.41 * 12f32.sqrt(), "{ray:?}");
    }
}

#[test]
fn a_surface_turned_inside_out_in_parts_is_still_closed() {
    let mut turned = torus();
    turned.geometries[0].triangles.iter_mut().step_by(3).for_each(|t| t.swap(0, 1));
    let found = verified(&one(turned.clone()), &one(turned));
    assert_eq!((found.seams.rays, found.seams.before_lost), (2048, 0));
}

#[test]
fn there_is_nothing_to_aim_at_without_closed_edges() {
    let mut soup = torus();
    let geometry = &mut soup.geometries[0];
    geometry.positions = geometry.triangles.iter().flatten().map(|&v| geometry.positions[v as usize]).collect();
    let lifted = |(i, p): (usize, &mut Vec3)| p.y += (i / 3) as f32 * 0.01;
    Arc::make_mut(&mut geometry.positions).iter_mut().enumerate().for_each(lifted);
    geometry.triangles = (0..geometry.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let flat = scene(vec![cube(0, None)], &[(0, DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)))]);
    for nothing in [one(soup), flat, Scene::default()] {
        assert_eq!(aimed_at(&nothing), Aimed::default());
        let found = verified(&nothing, &nothing);
        assert!(found.passed() && found.seams == Seams::default(), "{found}");
    }
}

#[test]
fn many_triangles_in_one_place_are_left_out() {
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let copies = mesh(0, vec![(None, corners.clone(), vec![[0, 1, 2]; 100_000])]);
    assert_eq!(aimed_at(&one(copies)), Aimed::default());
    // A fan of very many triangles about one point, closed but for this.
    let count = 100_000;
    let rim = (0..count).map(|i| (f64::from(i) / f64::from(count) * std::f64::consts::TAU).sin_cos());
    let positions = std::iter::once(Vec3::ZERO).chain(rim.map(|(x, y)| Vec3::new(x as f32, y as f32, -1.0))).collect();
    let fan = mesh(0, vec![(None, positions, (0..count).map(|i| [0, 1 + i, 1 + (i + 1) % count]).collect())]);
    assert!(find(&one(fan), 100, 1).iter().all(|place| matches!(place.core, Core::Edge(_))));
}

/// Returns how many edges and vertices of triangles are places.
fn places_of(triangles: Vec<[u32; 3]>) -> [usize; 2] {
    let point = |i: u32| Vec3::new((i % 3) as f32, (i / 3 % 3) as f32, (i / 9) as f32);
    let places = find(&one(mesh(0, vec![(None, (0..27).map(point).collect(), triangles)])), 1000, 1);
    let edges = places.iter().filter(|place| matches!(place.core, Core::Edge(_))).count();
    [edges, places.len() - edges]
}

#[test]
fn a_place_has_one_triangle_on_either_side_or_one_circle_around() {
    let pyramid = [[0, 2, 10], [2, 8, 10], [8, 6, 10], [6, 0, 10]];
    assert_eq!(places_of(pyramid.to_vec()), [4, 1]);
    assert_eq!(places_of(pyramid[..3].to_vec()), [2, 0]);
    // Twice the same surface, from both sides, is one surface.
    assert_eq!(places_of(pyramid.into_iter().flat_map(|[a, b, c]| [[a, b, c], [c, b, a]]).collect()), [4, 1]);
    // Two pyramids that share only their tip do not close it.
    let other = [[18, 20, 10], [20, 26, 10], [26, 24, 10], [24, 18, 10]];
    assert_eq!(places_of(pyramid.into_iter().chain(other).collect()), [8, 0]);
    // A third triangle at an edge, and a triangle of two equal corners.
    assert_eq!(places_of(pyramid.into_iter().chain([[0, 10, 26]]).collect()), [3, 0]);
    assert_eq!(places_of(pyramid.into_iter().chain([[0, 10, 10]]).collect()), [4, 1]);
}

#[test]
fn corners_are_welded_across_instances_geometries_and_signs_of_zero() {
    let half = |x: f32, order: [u32; 3]| mesh(0, vec![(None, vec![Vec3::ZERO, Vec3::Y, Vec3::X * x], vec![order])]);
    let meshes = vec![half(1.0, [0, 2, 1]), half(-1.0, [0, 1, 2])];
    let turned = DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
    let both = scene(meshes, &[(0, DAffine3::IDENTITY), (1, turned)]);
    let places = find(&both, 100, 1);
    assert_eq!(places.len(), 1);
    assert_eq!(classes(&both, &places, None), [Class::AcrossObjects]);
    assert_eq!(places[0].triangles.iter().map(|at| at.instance).collect::<BTreeSet<u32>>().len(), 2);
}

#[test]
fn the_sign_test_is_exact() {
    assert_eq!([at_least(0, 0), at_least(3, 6), at_least(2, 9)], [1.0; 3]);
    let close = |found: f64, exact: f64| (found - exact).abs() < 1e-9 * exact;
    assert!(close(at_least(10, 10), 1.0 / 1024.0) && close(at_least(9, 10), 11.0 / 1024.0));
    assert!(close(at_least(2, 3), 0.5) && close(at_least(8, 13), 2380.0 / 8192.0), "{}", at_least(8, 13));
    assert!(at_least(1_000_000, 1_000_000) == 0.0 && at_least(600_000, 1_000_000) < 1e-300);
    let seams = |opened| Seams { opened, ..Seams::default() };
    assert!(!seams(9).is_worse() && seams(10).is_worse());
}

#[test]
fn decimals_beyond_single_precision_are_welded_as_they_stand_in_the_file() {
    let mut torus = torus();
    let geometry = &mut torus.geometries[0];
    let beyond = |p: &Vec3| Vec3::new(1e-9 * p.y, -1e-9 * p.z, 1e-9);
    geometry.residuals = Some(geometry.positions.iter().map(beyond).collect());
    let aimed = aimed_at(&one(torus));
    assert_eq!(aimed.rays.len(), 2048);
}
