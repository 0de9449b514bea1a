//! Complete verifications: correct pairs pass; each planted fault is found by the exact comparison, and by rays alone.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use proptest::prelude::*;
use raykiln_formats::contents::Camera;
use raykiln_formats::record::{GeometryHash, Origins, Placed, Provenance, Record, Source};

use super::compare::Comparison;
use super::cpu::{CpuTracer, Reference, TwoLevel};
use super::identity::Identity;
use super::rays::{RayKind, Rays, Sampling, generate};
use super::structure::Structure;
use super::test_scenes::{Style, cases, cube, instance, mesh, random_scene, room, scene};
use super::{Matching, Sides, Verification, VerifyOptions, surface, verify};
use crate::scene::{Geometry, Mesh, PlacedCamera, Scene, TriangleRef};

fn options() -> VerifyOptions {
    VerifyOptions { rays_per_kind: 2048, repeats: 3, ..VerifyOptions::default() }
}

/// The hash of a scene's geometry for tests, which compute none.
const INPUT: GeometryHash = GeometryHash([1; 32]);

/// Returns a scene that others may be recorded to be made from.
fn input(scene: Scene) -> Scene {
    Scene { geometry: INPUT, ..scene }
}

/// Changes the record of a scene.
fn record(scene: &mut Scene, change: impl FnOnce(&mut Record)) {
    let Provenance::Recorded(record) = &mut scene.provenance else { unreachable!() };
    change(Arc::make_mut(record));
}

/// The triangles of the first primitive, as a record says where they come from.
fn first(record: &mut Record) -> &mut Vec<[u32; 2]> {
    let Origins::Each { triangles, .. } = &mut record.lists[0][0] else { unreachable!() };
    triangles
}

/// Returns one mesh of all triangles of a scene, one geometry per material, stored in a frame, as a bake writes it.
pub(super) fn baked(scene: &Scene, frame: DAffine3) -> Scene {
    let mut geometries: Vec<Geometry> = Vec::new();
    let mut list = Vec::new();
    let to_frame = frame.inverse();
    for material in [None, Some(0), Some(1), Some(2), Some(3)] {
        let mut geometry = Geometry { primitive: geometries.len() as u32, material, ..Geometry::default() };
        let mut positions = Vec::new();
        let (mut sources, mut triangles) = (Vec::new(), Vec::new());
        for (i, placing) in scene.instances.iter().enumerate() {
            let of = &scene.meshes[placing.mesh.0 as usize];
            for part in of.geometries.iter().filter(|g| g.material == material) {
                let (node, copy) = (Some(placing.node), placing.copy);
                sources.push(Source { node, copy, mesh: of.source, primitive: part.primitive });
                for t in 0..part.triangles.len() as u32 {
                    triangles.push([sources.len() as u32 - 1, t]);
                    let at = TriangleRef { instance: i as u32, triangle: part.first_triangle + t };
                    let first = positions.len() as u32;
                    geometry.triangles.push([first + 1, first + 2, first]);
                    let corners = scene.world_corners(at).map(|p| to_frame.transform_point3(p).as_vec3());
                    positions.extend(corners);
                }
            }
        }
        geometry.positions = positions.into();
        if !geometry.triangles.is_empty() {
            list.push(Origins::Each { sources, triangles });
            geometries.push(geometry);
        }
    }
    let mut first_triangle = 0;
    for geometry in &mut geometries {
        geometry.first_triangle = first_triangle;
        first_triangle += geometry.triangles.len() as u32;
    }
    let group = Mesh { geometries, source: 77, ..Default::default() };
    let node = scene.nodes as u32;
    let placed = vec![Placed { node, copy: 0, list: 0, input: None, stands_in: false }];
    let record = Record { input: scene.geometry, nodes: Vec::new(), lists: vec![list], placed };
    Scene {
        provenance: Provenance::Recorded(record.into()),
        geometry: GeometryHash([2; 32]),
        meshes: vec![group].into(),
        instances: vec![instance(node, 0, frame)],
        materials: scene.materials.clone(),
        nodes: scene.nodes + 1,
        ..Scene::default()
    }
}

pub(super) fn tilted() -> DAffine3 {
    DAffine3::from_translation(DVec3::new(1.0, -2.0, 0.5)) * DAffine3::from_axis_angle(DVec3::ONE.normalize(), 0.7)
}

/// Returns the mismatches that rays find if the exact comparison is assumed to be clean.
fn mismatches_seen(before: &Scene, after: &Scene) -> u64 {
    let (trees_before, trees_after) = (TwoLevel::build(before), TwoLevel::build(after));
    let reference = Reference::new(&trees_before);
    let (_, pairs) = surface::compare(&Identity::new(before, after), 1e-6);
    let rays = generate(before, &reference, &Sampling::new(2048, 1));
    let clean = Structure { of_instances: vec![0.0; after.instances.len()], ..Structure::default() };
    let comparison = Comparison::new(Sides { before, after }, &pairs, &reference, &clean, rays.radius, &options());
    let tracers = [CpuTracer::new(&trees_before), CpuTracer::new(&trees_after)];
    let compare = |(kind, rays): (RayKind, &Vec<_>)| {
        comparison
            .compare(kind, rays, Sides { before: &tracers[0].closest(rays), after: &tracers[1].closest(rays) })
            .mismatches
    };
    rays.kinds.iter().map(compare).sum()
}

fn exactly(before: &Scene, after: &Scene) -> Structure {
    surface::compare(&Identity::new(before, after), 1e-6).0
}

fn assert_sound(found: &Verification) {
    assert!(found.passed(), "{found}");
    assert_eq!((found.mismatches, found.tracer_faults), (0, 0), "{found:?}");
}

#[test]
fn a_scene_shows_what_it_shows() {
    let found = verify(&room(), &room(), &options());
    assert_sound(&found);
    assert_eq!((found.rays, found.silhouettes, found.ties, found.far_hits), (8192, 0, 0, 0));
    assert_eq!(found.position_error_ratio, 0.0);
    assert_eq!(found.max_relative_distance_error, found.before_max_relative_distance_error);
    assert!(found.hits > 4096, "all that start inside and do not end at the light: {} hits", found.hits);
    assert!(found.max_relative_distance_error < 1e-4, "{}", found.max_relative_distance_error);
}

#[test]
fn a_bake_in_world_coordinates_and_one_in_a_frame_show_the_same() {
    for frame in [DAffine3::IDENTITY, tilted()] {
        let found = verify(&room(), &baked(&room(), frame), &options());
        assert_sound(&found);
        assert!(found.position_error_ratio < 1e-7 && found.position_error_ratio > 0.0);
        assert_eq!(found.structure.as_ref().map(|s| s.triangles_after), Some(72));
    }
}

#[test]
fn the_report_has_the_keys_others_rely_on() {
    let json = serde_json::to_value(verify(&room(), &room(), &options())).expect("serialises");
    for key in [
        "device",
        "rays",
        "hits",
        "mismatches",
        "far_hits",
        "max_relative_distance_error",
        "rms_relative_distance_error",
        "position_error_ratio",
    ] {
        assert!(!json[key].is_null(), "{key}");
    }
    for kind in RayKind::ALL.map(RayKind::name) {
        for key in ["before_mrays_per_s", "after_mrays_per_s", "speedup_ratio", "spread_ratio"] {
            assert!(json["kinds"][kind][key].is_f64(), "{kind} {key}");
        }
        let repeats = |side: &str| json["seconds"][kind][side].as_array().map_or(0, Vec::len);
        assert!(repeats("before") > 0 && repeats("before") == repeats("after"), "{kind}");
        assert!(json["measured_kinds"][kind]["speedup_ratio"].is_f64(), "{kind}");
        assert!(json["steps"][kind]["after"]["triangle_tests"].is_f64(), "{kind}");
    }
    let histogram = &json["distance_error_histogram"];
    let classes = ["up_to", "before", "after"].map(|key| histogram[key].as_array().map_or(0, Vec::len));
    assert_eq!(classes, [11; 3], "{histogram}");
    let measured: u64 = histogram["after"].as_array().into_iter().flatten().filter_map(|n| n.as_u64()).sum();
    assert!(measured > 0 && measured <= json["hits"].as_u64().unwrap_or(0), "{histogram}");
    assert!(json["device"].as_str().is_some_and(|d| d.starts_with("CPU")));
}

#[test]
fn a_moved_vertex_is_caught() {
    let mut after = room();
    Arc::make_mut(&mut after.meshes[1].geometries[0].positions)[4].x += 0.05;
    let exact = exactly(&room(), &after);
    assert!(exact.moved.count > 0 && exact.position_error_ratio > 1e-4);
    assert!(mismatches_seen(&room(), &after) > 0);
    assert!(!verify(&room(), &after, &options()).passed());
}

#[test]
fn a_lost_triangle_is_caught() {
    let mut after = baked(&room(), DAffine3::IDENTITY);
    let geometry = &mut after.meshes[0].geometries[0];
    geometry.triangles.remove(3);
    geometry.kept = Some((0..12).filter(|&t| t != 3).collect());
    for geometry in &mut after.meshes[0].geometries[1..] {
        geometry.first_triangle -= 1;
    }
    let exact = exactly(&room(), &after);
    assert_eq!((exact.missing.count, exact.triangles_after), (1, 71));
    assert!(exact.missing.first.as_ref().is_some_and(|f| f.contains("triangle 3 of primitive 0")), "{exact:?}");
    assert!(mismatches_seen(&room(), &after) > 0);
}

#[test]
fn a_wrong_material_is_caught() {
    let mut after = room();
    after.meshes[1].geometries[1].material = Some(3);
    assert_eq!(exactly(&room(), &after).wrong_material.count, 30);
    assert!(mismatches_seen(&room(), &after) > 0);
}

#[test]
fn a_mirrored_instance_is_caught() {
    let mut after = room();
    after.instances[2].transform *= DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
    assert!(!exactly(&room(), &after).is_clean());
    assert!(mismatches_seen(&room(), &after) > 0);
}

#[test]
fn swapped_instances_of_one_mesh_show_the_same_but_the_record_is_wrong() {
    let mut after = room();
    let first = after.instances[1].transform;
    after.instances[1].transform = std::mem::replace(&mut after.instances[4].transform, first);
    let exact = exactly(&room(), &after);
    assert!(exact.is_clean() && exact.record.elsewhere.count == 24, "each cube shows the other: {exact:?}");
    assert!(!verify(&room(), &after, &options()).passed());
    let by_place = VerifyOptions { matching: Matching::Place, ..options() };
    assert_sound(&verify(&room(), &after, &by_place));
}

#[test]
fn a_record_that_names_a_triangle_twice_is_caught() {
    let mut after = baked(&room(), DAffine3::IDENTITY);
    // The first triangle replaces the second, which is then also missing.
    record(&mut after, |record| first(record)[1] = [0, 0]);
    let exact = exactly(&room(), &after);
    assert!(exact.is_clean() && exact.record.elsewhere.count == 1, "{exact:?}");
    assert!(exact.record.elsewhere.first.as_ref().is_some_and(|f| f.contains("triangle 1 ")), "{exact:?}");
    assert!(!verify(&room(), &after, &options()).passed());
}

#[test]
fn a_fault_that_no_ray_can_reach_is_caught() {
    let flat = |x| {
        let squashed = DAffine3::from_translation(DVec3::X * x) * DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
        scene(vec![cube(0, None)], &[(0, squashed)])
    };
    assert_eq!(exactly(&flat(0.0), &flat(0.1)).moved.count, 4);
    assert_eq!(mismatches_seen(&flat(0.0), &flat(0.1)), 0);
    assert!(!verify(&flat(0.0), &flat(0.1), &options()).passed());
}

#[test]
fn a_flipped_triangle_is_caught() {
    let mut after = room();
    after.meshes[0].geometries[0].triangles[5].swap(0, 1);
    let exact = exactly(&room(), &after);
    assert_eq!((exact.flipped.count, exact.moved.count), (1, 0));
    assert!(mismatches_seen(&room(), &after) > 0);
}

/// Returns a record in which each instance of `after` stands for a node of [`room`], with all its triangles.
fn standing_for(after: &Scene, nodes: &[u32]) -> Provenance {
    let mesh = |mesh: &Mesh| {
        let source = |primitive| Source { node: None, copy: 0, mesh: mesh.source, primitive };
        mesh.geometries.iter().map(|g| Origins::Same(source(g.primitive))).collect()
    };
    let placed = after.instances.iter().zip(nodes).map(|(instance, &node)| Placed {
        node: instance.node,
        copy: 0,
        list: instance.mesh.0,
        input: Some((node, 0)),
        stands_in: false,
    });
    let lists = after.meshes.iter().map(mesh).collect();
    Provenance::Recorded(Record { input: INPUT, nodes: Vec::new(), lists, placed: placed.collect() }.into())
}

#[test]
fn a_node_that_stands_for_another_is_believed_and_checked() {
    let before = input(room());
    let mut after = room();
    let nodes: Vec<u32> = after.instances.iter().map(|i| i.node).collect();
    for (i, instance) in after.instances.iter_mut().enumerate() {
        instance.node = 100 + i as u32;
    }
    after.provenance = standing_for(&after, &nodes);
    assert_sound(&verify(&before, &after, &options()));
    record(&mut after, |record| record.placed[2].input = Some((nodes[3], 0)));
    let exact = exactly(&before, &after);
    assert!(exact.is_clean() && exact.record.elsewhere.count == 12, "{exact:?}");
}

#[test]
fn pieces_of_a_shared_mesh_belong_to_the_node_that_places_them() {
    let before = input(room());
    let mut after = room();
    // The shared mesh becomes two pieces, each placed by a child of the node that placed the mesh.
    let cubes = before.meshes[1].clone();
    after.meshes = vec![before.meshes[0].clone()].into();
    let same = |mesh, primitive| vec![Origins::Same(Source { node: None, copy: 0, mesh, primitive })];
    let mut lists = vec![same(before.meshes[0].source, 0)];
    for (g, mut geometry) in (0..).zip(cubes.geometries) {
        lists.push(same(1, geometry.primitive));
        (geometry.primitive, geometry.first_triangle) = (0, 0);
        after.meshes.push(Mesh { source: 10 + g, geometries: vec![geometry], ..Mesh::default() });
    }
    after.instances.truncate(1);
    let place = |node, list, of: u32| Placed { node, copy: 0, list, input: Some((of, 0)), stands_in: false };
    let mut placed = vec![place(before.instances[0].node, 0, before.instances[0].node)];
    for placing in &before.instances[1..] {
        for piece in 0..2 {
            let node = 20 + 2 * placing.node + piece;
            after.instances.push(instance(node, 1 + piece, placing.transform));
            placed.push(place(node, 1 + piece, placing.node));
        }
    }
    placed.sort_unstable_by_key(|placed| placed.node);
    after.provenance = Provenance::Recorded(Record { input: INPUT, nodes: Vec::new(), lists, placed }.into());
    let found = verify(&before, &after, &options());
    assert_sound(&found);
    assert_eq!(found.structure.as_ref().map(|s| s.triangles_after), Some(72));
}

#[test]
fn files_with_records_of_one_input_are_matched_through_it() {
    let first = input(room());
    let old = baked(&first, tilted());
    assert_sound(&verify(&old, &old.clone(), &options()));
    let other = baked(&first, DAffine3::IDENTITY);
    assert_sound(&verify(&old, &other, &options()));
    assert_eq!(Identity::new(&old, &other).known(), old.triangles_placed());
}

#[test]
fn a_record_of_another_input_is_not_followed_and_said() {
    let after = baked(&room(), DAffine3::IDENTITY);
    let by_place = VerifyOptions { matching: Matching::Place, ..options() };
    let found = verify(&input(room()), &after, &by_place);
    assert_sound(&found);
    assert!(found.notes.contains(&super::Note::RecordOfAnotherInput));
    let stale = Scene { provenance: Provenance::Stale, ..after };
    let found = verify(&room(), &stale, &by_place);
    assert_sound(&found);
    assert!(found.notes.contains(&super::Note::StaleRecord));
    assert!(!verify(&room(), &stale, &options()).passed(), "where the record must be right");
}

#[test]
fn a_nonsense_record_is_wrong() {
    let sources = vec![
        Source { node: Some(9999), copy: 7, mesh: 1, primitive: 3 },
        Source { node: Some(0), copy: 0, mesh: 5, primitive: 0 },
    ];
    for triangles in [vec![[0, 0]; 12], vec![[1, 0]; 12], vec![[9, 0]; 12], vec![[0, u32::MAX]; 12], vec![]] {
        let mut after = baked(&room(), DAffine3::IDENTITY);
        let nonsense = Origins::Each { sources: sources.clone(), triangles };
        record(&mut after, |record| record.lists[0][0] = nonsense);
        let exact = exactly(&room(), &after);
        assert!(exact.is_clean() && exact.record.elsewhere.count == 12, "{exact:?}");
        assert!(!verify(&room(), &after, &options()).passed());
    }
}

#[test]
fn dropped_triangles_keep_the_numbers_of_the_file() {
    let mut before = room();
    // Triangle 0 of the walls' primitive was dropped on reading, so numbers in the file start at 1.
    before.meshes[0].geometries[0].kept = Some((1..=12).collect());
    let mut after = baked(&before, DAffine3::IDENTITY);
    record(&mut after, |record| first(record).iter_mut().take(12).for_each(|[_, number]| *number += 1));
    assert_sound(&verify(&before, &after, &options()));
}

#[test]
fn coincident_triangles_are_ties() {
    let wall = |material| {
        let positions = vec![Vec3::new(-5.0, -5.0, 0.0), Vec3::new(5.0, -5.0, 0.0), Vec3::new(0.0, 5.0, 0.0)];
        mesh(material, vec![(Some(material), positions, vec![[0, 1, 2]])])
    };
    let turned = DAffine3::from_axis_angle(DVec3::ONE.normalize(), 0.3);
    let before = scene(vec![wall(0), wall(1)], &[(0, turned), (1, turned)]);
    let mut after = before.clone();
    after.instances.swap(0, 1);
    let found = verify(&before, &after, &options());
    assert_sound(&found);
    assert!(found.ties > 100, "{} ties", found.ties);
    // With exchanged materials the place shows the same, but the record is wrong.
    after.meshes = vec![before.meshes[1].clone(), before.meshes[0].clone()].into();
    assert!(!verify(&before, &after, &options()).passed());
}

#[test]
fn degenerate_scenes_verify() {
    let triangle = |scale: f32| {
        let positions = vec![Vec3::ZERO, Vec3::X * scale, Vec3::Y * scale];
        scene(vec![mesh(0, vec![(None, positions, vec![[0, 1, 2]])])], &[(0, DAffine3::IDENTITY)])
    };
    for scale in [0.0, 1e-44, 1e-30, 1.0, 1e30] {
        let found = verify(&triangle(scale), &triangle(scale), &options());
        assert_sound(&found);
        assert_eq!(found.rays, 8192);
        assert!(scale < 1e-40 || found.hits > 300, "{scale}: {} hits", found.hits);
    }
    let flat = scene(vec![cube(0, None)], &[(0, DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)))]);
    assert_sound(&verify(&flat, &flat, &options()));
    let nothing = verify(&Scene::default(), &Scene::default(), &options());
    assert!(nothing.passed());
    assert_eq!((nothing.rays, nothing.kinds[RayKind::Primary].speedup_ratio), (0, 1.0));
    assert!(!verify(&room(), &Scene::default(), &options()).passed());
    assert!(!verify(&Scene::default(), &room(), &options()).passed());
}

fn rays_of(scene: &Scene, count: usize) -> Rays {
    let trees = TwoLevel::build(scene);
    generate(scene, &Reference::new(&trees), &Sampling::new(count, 1))
}

#[test]
fn rays_are_sound_and_do_not_depend_on_the_number_of_threads() {
    let here = rays_of(&room(), 1000);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    assert_eq!(pool.install(|| rays_of(&room(), 1000)), here);
    for rays in here.kinds.values() {
        assert_eq!(rays.len(), 1000);
        for ray in rays {
            assert!(ray.origin.is_finite() && (ray.direction.length() - 1.0).abs() < 1e-6);
            assert!(ray.t_min >= 0.0 && ray.t_max > ray.t_min);
        }
    }
    assert_eq!(here.views[0].name, "automatic, inside");
    assert_ne!(rays_of(&room(), 1000).kinds[RayKind::Random], generate_seeded(2).kinds[RayKind::Random]);
}

fn generate_seeded(seed: u64) -> Rays {
    let trees = TwoLevel::build(&room());
    generate(&room(), &Reference::new(&trees), &Sampling::new(1000, seed))
}

#[test]
fn cameras_of_the_file_are_used_unless_it_sees_nothing() {
    let camera = Camera::Perspective { yfov: 1.0, aspect_ratio: None };
    let mut seen = room();
    seen.cameras = vec![PlacedCamera { name: "eye".into(), camera, transform: DAffine3::IDENTITY }];
    assert_eq!(rays_of(&seen, 100).views[0].name, "camera `eye`");
    seen.cameras[0].transform = DAffine3::from_translation(DVec3::new(0.0, 0.0, -1e4));
    assert_eq!(rays_of(&seen, 100).views[0].name, "automatic, inside");
}

#[test]
fn a_solid_is_seen_from_outside_and_specks_are_aimed_at() {
    let solid = scene(vec![cube(0, None)], &[(0, DAffine3::IDENTITY)]);
    assert_eq!(rays_of(&solid, 1000).views[0].name, "automatic, outside");
    let speck = |x: f64| (0, DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)));
    let specks = scene(vec![cube(0, None)], &[speck(-1e4), speck(1e4)]);
    let rays = rays_of(&specks, 1000);
    assert_eq!(rays.views[0].name, "random points around the scene");
    let trees = TwoLevel::build(&specks);
    let hits = CpuTracer::new(&trees).closest(&rays.kinds[RayKind::Primary]);
    assert!(hits.iter().flatten().count() > 900);
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let after = baked(&room(), tilted());
    let verified = || Verification {
        measured_kinds: None,
        seconds: Default::default(),
        device: String::new(),
        ..verify(&room(), &after, &options())
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    assert_eq!(pool.install(verified), verified());
}

proptest! {
    #![proptest_config(cases(32))]

    #[test]
    fn rounding_is_never_a_mismatch(
        seed: u64,
        size in prop_oneof![Just(1.0), Just(1e-3), Just(1e3)],
        offset in prop_oneof![Just(0.0), Just(10.0)],
        [on_grid, thin, wild] in any::<[bool; 3]>(),
        turn in 0.0..3.0f64,
    ) {
        let before = random_scene(seed, Style { size, offset, on_grid, thin, wild });
        let frame = DAffine3 {
            matrix3: DMat3::from_axis_angle(DVec3::ONE.normalize(), turn),
            translation: before.bounds().center(),
        };
        for after in [before.clone(), baked(&before, DAffine3::IDENTITY), baked(&before, frame)] {
            let found = verify(&before, &after, &options());
            prop_assert_eq!(found.mismatches, 0, "{}", found);
            prop_assert_eq!(found.tracer_faults, 0, "{:?}", found);
            let structure = found.structure.as_ref().expect("by identity");
            prop_assert!(structure.missing.count == 0 && structure.flipped.count == 0, "{}", found);
        }
    }
}
