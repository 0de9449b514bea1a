use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
use proptest::prelude::*;
use raykiln_formats::record::Provenance;

use super::super::random::Random;
use super::super::test_scenes::{Style, cases, cube, mesh, random_scene, room, scene};
use super::super::tests::{baked, tilted};
use super::*;
use crate::scene::Scene;

const STYLE: Style = Style { size: 1.0, offset: 0.0, on_grid: false, thin: false, wild: false };

fn compared(before: &Scene, after: &Scene) -> (Structure, Pairs) {
    compare(&Identity::new(before, after), 1e-6)
}

/// Returns a bake of a scene in one frame that records nothing, with its triangles in another order.
fn shuffled(before: &Scene, frame: DAffine3, seed: u64) -> Scene {
    let mut after = Scene { provenance: Provenance::Unrecorded, ..baked(before, frame) };
    let random = &mut Random::at(seed, 0, 0);
    for geometry in &mut after.meshes[0].geometries {
        for i in (1..geometry.triangles.len()).rev() {
            geometry.triangles.swap(i, random.below(i as u64 + 1) as usize);
            let by = random.below(3) as usize;
            geometry.triangles[i].rotate_left(by);
        }
    }
    after
}

/// Takes a random triangle of a shuffled scene: its geometry and its index there.
fn pick(after: &Scene, random: &mut Random) -> (usize, usize) {
    let geometries = &after.meshes[0].geometries;
    let g = random.below(geometries.len() as u64) as usize;
    (g, random.below(geometries[g].triangles.len() as u64) as usize)
}

/// Gives a triangle corners of its own, and returns the index of the first.
fn detach(after: &mut Scene, g: usize, t: usize) -> usize {
    let geometry = &mut after.meshes[0].geometries[g];
    let corners = geometry.corners(t);
    let first = geometry.positions.len();
    geometry.positions = geometry.positions.iter().copied().chain(corners).collect();
    geometry.triangles[t] = [0, 1, 2].map(|k| (first + k) as u32);
    first
}

fn remove(after: &mut Scene, g: usize, t: usize) {
    let geometries = &mut after.meshes[0].geometries;
    geometries[g].triangles.remove(t);
    geometries[g + 1..].iter_mut().for_each(|later| later.first_triangle -= 1);
}

fn counts(found: &Structure) -> [u64; 6] {
    found.faults().map(|(_, fault)| fault.count)
}

#[test]
fn what_is_in_its_place_is_found_without_a_record() {
    for (seed, frame) in [(1, DAffine3::IDENTITY), (2, tilted())] {
        let before = room();
        let after = shuffled(&before, frame, seed);
        let (found, pairs) = compared(&before, &after);
        assert!(found.is_clean(), "{found:?}");
        assert_eq!((pairs.count(), found.record.confirmed < 72), (72, true));
        for at in all_triangles(&after) {
            let pair = pairs.get(at).expect("paired");
            let (placed, original) = (after.world_corners(at), before.world_corners(pair.at));
            (0..3).for_each(|k| {
                assert!(placed[k].distance(original[(k + pair.turn as usize) % 3]) < 1e-5, "{placed:?} {original:?}");
            });
        }
    }
}

#[test]
fn each_kind_of_fault_is_told_apart_and_named() {
    type Fault = fn(&mut Scene, usize, usize);
    let faults: [(&str, Fault, [u64; 6]); 6] = [
        ("missing", remove, [1, 0, 0, 0, 0, 0]),
        (
            "repeated",
            |s, g, t| s.meshes[0].geometries[g].triangles[t + 1] = s.meshes[0].geometries[g].triangles[t],
            [1, 1, 0, 0, 0, 0],
        ),
        (
            "unknown",
            |s, g, t| {
                let first = detach(s, g, t);
                let far = |p: &mut Vec3| *p += Vec3::splat(1e3);
                Arc::make_mut(&mut s.meshes[0].geometries[g].positions)[first..].iter_mut().for_each(far);
            },
            [1, 0, 1, 0, 0, 0],
        ),
        ("flipped", |s, g, t| s.meshes[0].geometries[g].triangles[t].swap(0, 1), [0, 0, 0, 0, 1, 0]),
        (
            "moved",
            |s, g, t| {
                let first = detach(s, g, t);
                Arc::make_mut(&mut s.meshes[0].geometries[g].positions)[first].y += 0.003;
            },
            [0, 0, 0, 0, 0, 1],
        ),
        ("of another material", |s, _, _| s.meshes[0].geometries[0].material = Some(3), [0, 0, 0, 12, 0, 0]),
    ];
    let before = room();
    for (name, fault, expected) in faults {
        for seed in 0..20 {
            let mut after = shuffled(&before, tilted(), seed);
            let (g, t) = pick(&after, &mut Random::at(seed, 1, 0));
            let last = after.meshes[0].geometries[g].triangles.len() - 2;
            fault(&mut after, g, t.min(last));
            let (found, _) = compared(&before, &after);
            assert_eq!(counts(&found), expected, "{name}: {found:?}");
            let named = found.faults().into_iter().filter(|(_, fault)| fault.count > 0);
            assert!(named.into_iter().all(|(_, fault)| fault.first.is_some()), "{name}: {found:?}");
        }
    }
}

#[test]
fn the_ratio_with_which_moved_triangles_pass_is_suggested() {
    let before = room();
    let mut after = shuffled(&before, DAffine3::IDENTITY, 1);
    for geometry in &mut after.meshes[0].geometries {
        Arc::make_mut(&mut geometry.positions).iter_mut().for_each(|p| p.x += 0.003);
    }
    let (found, _) = compared(&before, &after);
    assert_eq!(found.moved.count, 72, "{found:?}");
    let ratio = found.suggested_max_position_error_ratio.expect("all are there");
    assert!((found.position_error_ratio..1.2 * found.position_error_ratio).contains(&ratio), "{found:?}");
    assert!(compare(&Identity::new(&before, &after), ratio).0.is_clean());
}

#[test]
fn triangles_in_one_place_are_paired_by_their_material() {
    let both = |first, second| {
        let places = [(0, DAffine3::IDENTITY), (1, DAffine3::IDENTITY)];
        scene(vec![cube(0, Some(first)), cube(1, Some(second))], &places)
    };
    let (found, _) = compared(&both(0, 1), &shuffled(&both(1, 0), DAffine3::IDENTITY, 1));
    assert!(found.is_clean(), "{found:?}");
    let (found, _) = compared(&both(0, 1), &shuffled(&both(1, 1), DAffine3::IDENTITY, 1));
    assert_eq!(found.wrong_material.count, 12, "{found:?}");
}

#[test]
fn equal_triangles_count_as_often_as_they_are_there() {
    let stack = |count: u32| {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        scene(vec![mesh(0, vec![(None, corners, vec![[0, 1, 2]; count as usize])])], &[(0, DAffine3::IDENTITY)])
    };
    let moved = |mut scene: Scene| {
        scene.instances[0].node = 7;
        scene
    };
    assert!(compared(&stack(50_000), &moved(stack(50_000))).0.is_clean());
    assert_eq!(counts(&compared(&stack(50_000), &moved(stack(49_999))).0), [1, 0, 0, 0, 0, 0]);
    assert_eq!(counts(&compared(&stack(50_000), &moved(stack(50_002))).0), [0, 2, 0, 0, 0, 0]);
}

#[test]
fn triangles_closer_together_than_they_may_be_off_find_their_own_partners() {
    // Each triangle is off by less than is allowed, and within that of two of the input.
    let row = |shift: f32| {
        let corners =
            (0..12).flat_map(|i| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::Z * (i as f32 + shift) * 1e-3));
        let triangles = (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        scene(vec![mesh(0, vec![(None, corners.collect(), triangles)])], &[(0, DAffine3::IDENTITY)])
    };
    let (before, mut after) = (row(0.0), row(0.7));
    after.instances[0].node = 7;
    after.meshes[0].geometries[0].triangles.reverse();
    let ratio = 1.2e-3 / reference_length(&before);
    let (found, pairs) = compare(&Identity::new(&before, &after), ratio);
    assert!(found.is_clean() && pairs.count() == 12, "{found:?}");
}

#[test]
fn a_triangle_without_area_is_no_fault_if_it_is_gone() {
    let with = |triangles: Vec<[u32; 3]>| {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, 0.5 * Vec3::X];
        scene(vec![mesh(0, vec![(None, corners, triangles)])], &[(0, DAffine3::IDENTITY)])
    };
    let (found, _) = compared(&with(vec![[0, 3, 1], [0, 1, 2]]), &with(vec![[0, 1, 2]]));
    assert!(found.is_clean() && found.degenerate.before.count == 1 && found.degenerate.after.count == 0, "{found:?}");
}

#[test]
fn a_small_object_beside_a_large_one_is_held_to_its_own_size() {
    let place = |scale: f64, by: DVec3| (0, DAffine3::from_translation(by) * DAffine3::from_scale(DVec3::splat(scale)));
    let with = |by: f64| scene(vec![cube(0, None)], &[place(1e6, DVec3::ZERO), place(1.0, DVec3::X * (3e6 + by))]);
    let shift = 1e-2;
    assert!(compared(&with(0.0), &with(1e-4)).0.is_clean());
    let (found, _) = compared(&with(0.0), &with(shift));
    assert!(found.moved.count == 12 && (found.farthest_moved / shift - 1.0).abs() < 1e-6, "{found:?}");
}

#[test]
fn the_power_says_what_would_have_been_seen() {
    let (found, _) = compared(&room(), &room());
    assert!(found.power.area > 0.0 && found.power.object.is_some());
    let seen = found.power.smallest_displacement_seen;
    assert!((seen / reference_length(&room()) / 1e-6 - 1.0).abs() < 1e-3, "{found:?}");
}

proptest! {
    #![proptest_config(cases(48))]

    /// A brute-force comparison is the oracle: which triangles have one of the other file in the same place.
    #[test]
    fn random_scenes_and_random_faults_are_compared_as_by_brute_force(seed: u64, [on_grid, thin, wild] in any::<[bool; 3]>()) {
        let before = random_scene(seed, Style { on_grid, thin, wild, ..STYLE });
        let mut after = shuffled(&before, DAffine3::IDENTITY, seed);
        prop_assert!(compared(&before, &after).0.is_clean());
        let random = &mut Random::at(seed, 2, 0);
        let gone: Vec<(usize, usize)> = (0..3).map(|_| pick(&after, random)).collect();
        for (g, t) in gone {
            if after.meshes[0].geometries[g].triangles.len() > t + 1 {
                remove(&mut after, g, t);
            }
        }
        let limits = Limits::new(&before, 1e-6);
        let all_after: Vec<_> = all_triangles(&after).iter().map(|&at| after.world_corners(at)).collect();
        let mut used = vec![false; all_after.len()];
        let mut missing = 0;
        for at in all_triangles(&before) {
            let original = before.world_corners(at);
            let is_there = |placed: &_| corners::fit(placed, &original).error <= limits.of(at.instance);
            match (0..used.len()).find(|&i| !used[i] && is_there(&all_after[i])) {
                Some(i) => used[i] = true,
                None if corners::is_flat(original) => {}
                None => missing += 1,
            }
        }
        let (found, _) = compared(&before, &after);
        prop_assert_eq!(found.missing.count + found.moved.count, missing, "{:?}", found);
        prop_assert_eq!(found.unknown.count, 0);
    }

    #[test]
    fn the_pairs_do_not_depend_on_the_number_of_threads(seed: u64) {
        let before = random_scene(seed, STYLE);
        let after = shuffled(&before, tilted(), seed);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| compared(&before, &after))
        };
        prop_assert_eq!(with(1), with(3));
    }
}
