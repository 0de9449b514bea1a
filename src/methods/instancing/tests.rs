//! The choices for generated instances.

use std::f32::consts::TAU;

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use proptest::prelude::*;

use super::Known;
use super::choose::Candidates;
use super::input_bytes;
use crate::layout::builder::Builder;
use crate::layout::test_scenes::*;
use crate::layout::{Content, Layout};
use crate::methods::single::{join_all, single};
use crate::methods::{InstanceOptions, Instances, Method, Options, PartOptions, run};
use crate::scene::{Pinned, Scene};

fn choose(max_bytes_ratio: Option<f64>) -> InstanceOptions {
    InstanceOptions { max_bytes_ratio, shared: Instances::Choose, ..InstanceOptions::default() }
}

/// Runs `single` with these instance options.
fn single_with(scene: &Scene, instances: &InstanceOptions) -> Layout {
    single(scene, instances, &PartOptions::default(), &Known::default())
}

fn chosen(scene: &Scene, max_bytes_ratio: Option<f64>) -> Layout {
    let layout = single_with(scene, &choose(max_bytes_ratio));
    assert_eq!(layout.check(scene), Ok(()));
    layout
}

/// A tube around a trefoil knot of about unit size: most of its box is empty.
fn knot(rings: usize, sides: usize) -> Vec<[Vec3; 3]> {
    let center =
        |u: f32| Vec3::new(u.sin() + 2.0 * (2.0 * u).sin(), u.cos() - 2.0 * (2.0 * u).cos(), -(3.0 * u).sin()) / 3.0;
    let point = |ring: usize, side: usize| {
        let u = TAU * (ring % rings) as f32 / rings as f32;
        let (along, v) = (center(u + 1e-2) - center(u - 1e-2), TAU * (side % sides) as f32 / sides as f32);
        let (x, y) = along.normalize().any_orthonormal_pair();
        center(u) + 0.1 * (v.cos() * x + v.sin() * y)
    };
    let quad = |i: usize| {
        let (r, s) = (i / sides, i % sides);
        let [a, b, c, d] = [point(r, s), point(r + 1, s), point(r + 1, s + 1), point(r, s + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..rings * sides).flat_map(quad).collect()
}

/// Returns evenly distributed numbers in [0, 1): the additive recurrence of the plastic constant's powers.
fn spread(i: usize) -> DVec3 {
    (DVec3::new(0.819_172_513, 0.671_043_607, 0.549_700_478) * i as f64).fract()
}

/// Places `count` rotated knots in a cube, each scaled by `size`.
fn knots(count: usize, size: f64) -> SceneBuilder {
    placed(knot(60, 8), count, size)
}

/// Like [`knots`], of any mesh.
fn placed(triangles: Vec<[Vec3; 3]>, count: usize, size: f64) -> SceneBuilder {
    let mut builder = SceneBuilder::default();
    let mesh = builder.mesh("knot", vec![(0, triangles)]);
    for i in 0..count {
        let turn = DQuat::from_axis_angle((spread(i + 7) - 0.5).normalize(), 6.0 * spread(i).x);
        let place = DAffine3::from_scale_rotation_translation(DVec3::splat(0.5 * size), turn, spread(i));
        builder.place(mesh, "node", place);
    }
    builder
}

#[test]
fn overlapping_instances_are_opened_into_pieces_that_all_share() {
    let scene = knots(200, 0.6).scene();
    let layout = chosen(&scene, Some(15.0));
    let names = group_names(&layout);
    assert!(names.len() >= 8 && names.iter().all(|n| n.starts_with("piece knot.")), "{names:?}");
    assert_eq!(layout.placements.len(), 200 * names.len());
    assert!(layout.notes[0].to_string().contains("`knot`: 200 instances opened into"), "{:?}", layout.notes);
}

#[test]
fn overlapping_instances_are_baked_where_bytes_do_not_count() {
    let scene = knots(200, 0.6).scene();
    assert_eq!(group_names(&chosen(&scene, None)), ["baked scene"]);
}

#[test]
fn nothing_is_changed_where_no_bytes_are_allowed() {
    let scene = knots(200, 0.6).scene();
    for ratio in [1.0, 0.0, -1.0, f64::NAN] {
        let layout = chosen(&scene, Some(ratio));
        assert_eq!(group_names(&layout), ["kept knot"], "{ratio}");
        assert!(
            layout.notes[0].to_string().contains("200 instances stay: more than the 0 bytes"),
            "{:?}",
            layout.notes
        );
    }
}

#[test]
fn a_lattice_of_separate_instances_is_left_alone() {
    let mut builder = SceneBuilder::default();
    let mesh = builder.mesh("knot", vec![(0, knot(60, 8))]);
    for i in 0..125u32 {
        builder.place(mesh, "node", at(f64::from(i % 5) * 3.0, f64::from(i / 5 % 5) * 3.0, f64::from(i / 25) * 3.0));
    }
    let layout = chosen(&builder.scene(), None);
    assert_eq!(group_names(&layout), ["kept knot"]);
    assert_eq!(layout.notes[0].to_string(), "125 instances stay: no two instance boxes overlap");
}

#[test]
fn pieces_keep_every_material() {
    let mut builder = SceneBuilder::default();
    let triangles = knot(60, 8);
    let (red, blue): (Vec<_>, Vec<_>) = triangles.into_iter().enumerate().partition(|(i, _)| i % 3 == 0);
    let strip = |list: Vec<(usize, [Vec3; 3])>| list.into_iter().map(|(_, t)| t).collect::<Vec<_>>();
    let mesh = builder.mesh("knot", vec![(0, strip(red)), (1, strip(blue))]);
    for i in 0..200 {
        let turn = DQuat::from_rotation_x(6.0 * spread(i).x) * DQuat::from_rotation_y(6.0 * spread(i).y);
        builder.place(mesh, "node", DAffine3::from_scale_rotation_translation(DVec3::splat(0.3), turn, spread(i)));
    }
    let scene = builder.scene();
    let layout = chosen(&scene, Some(15.0));
    let materials = |content: &Content| match content {
        Content::Piece { geometries, .. } => geometries.iter().map(|g| g.material).collect(),
        _ => vec![],
    };
    assert!(layout.groups.len() > 1);
    assert!(layout.groups.iter().all(|g| materials(&g.content) == [Some(0), Some(1)]));
}

#[test]
fn pinned_instances_keep_the_mesh_beside_its_pieces() {
    let mut builder = knots(200, 0.6);
    let mesh = crate::scene::MeshId(0);
    builder.place(mesh, "pinned", DAffine3::IDENTITY).pinned = Some(Pinned::Animated);
    let scene = builder.scene();
    let layout = chosen(&scene, Some(15.0));
    let kept = group_names(&layout).iter().filter(|n| n.starts_with("kept")).count();
    assert_eq!((kept, layout.groups.len() > 8), (1, true));
}

#[test]
fn copies_of_a_node_share_their_fate() {
    let mut builder = knots(120, 0.6);
    for i in 0..120 {
        let place = DAffine3::from_scale_rotation_translation(DVec3::splat(0.3), DQuat::IDENTITY, spread(i));
        let instance = builder.place(crate::scene::MeshId(0), "copies", place);
        (instance.node, instance.copy) = (120, i as u32);
    }
    let scene = builder.scene();
    for ratio in [None, Some(1.5), Some(5.0), Some(15.0), Some(40.0)] {
        chosen(&scene, ratio);
    }
}

#[test]
fn the_bytes_allowed_are_never_exceeded() {
    let mut builder = knots(60, 0.9);
    let small = builder.mesh("small", vec![(0, knot(20, 4))]);
    (0..40).for_each(|i| drop(builder.place(small, "small", DAffine3::from_translation(spread(i))).name.clone()));
    builder.object("floor", 1, row(Vec3::ZERO, 50));
    let scene = builder.scene();
    for ratio in [1.0, 1.1, 1.25, 1.5, 2.0, 4.0, 8.0, 16.0, 30.0] {
        let bytes = chosen(&scene, Some(ratio)).as_bytes(&scene) as f64;
        assert!(bytes <= ratio * input_bytes(&scene) as f64, "{bytes} at {ratio}");
    }
}

#[test]
fn equal_and_degenerate_instances_are_weighed_in_time() {
    let mut builder = SceneBuilder::default();
    let mesh = builder.mesh("flat", vec![(0, vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 100])]);
    (0..5_000).for_each(|_| drop(builder.place(mesh, "copy", DAffine3::IDENTITY).name.clone()));
    let line = builder.mesh("line", vec![(0, vec![[Vec3::ZERO, Vec3::X, Vec3::X]; 100])]);
    (0..3).for_each(|_| drop(builder.place(line, "line", DAffine3::IDENTITY).name.clone()));
    let scene = builder.scene();
    for ratio in [None, Some(1.25)] {
        chosen(&scene, ratio);
    }
}

#[test]
fn extreme_sizes_do_no_harm() {
    for scale in [1e-30f32, 1e-20, 1e18, 1e30] {
        let mut builder = SceneBuilder::default();
        let scaled = knot(20, 8).into_iter().map(|t| t.map(|p| p * scale)).collect();
        let mesh = builder.mesh("knot", vec![(0, scaled)]);
        for i in 0..20 {
            let by = DAffine3 { matrix3: DMat3::from_rotation_z(i as f64), translation: spread(i) * f64::from(scale) };
            builder.place(mesh, "node", by);
        }
        let layout = chosen(&builder.scene(), None);
        assert!(!layout.groups.is_empty() && layout.notes.len() == 1, "{scale}: {:?}", layout.notes);
    }
}

#[test]
fn the_choice_is_the_same_for_any_number_of_threads() {
    let scene = knots(100, 0.6).scene();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| format!("{:?}", chosen(&scene, Some(6.0))))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn baked_and_opened_instances_of_one_mesh_are_together_all_there() {
    let scene = knots(100, 0.7).scene();
    let candidates = Candidates::of(&scene, &InstanceOptions::default(), &Known::default());
    let mixed = candidates.meshes[0]
        .plans
        .iter()
        .find(|p| p.baked > 0 && p.level > 0 && p.baked + p.opened == 100)
        .expect("there is such a plan");
    let selection = candidates.select(&scene, &[*mixed]);
    let mut builder = Builder::new(&scene);
    selection.place_left(&mut builder);
    join_all(&scene, &selection.baked().collect::<Vec<_>>(), &mut builder);
    let layout = builder.finish();
    assert_eq!(layout.check(&scene), Ok(()));
    let names = group_names(&layout);
    assert!(names.contains(&"baked scene".to_owned()) && names.contains(&"piece knot.0".to_owned()), "{names:?}");
    assert_eq!(selection.left_bounds(&scene).len(), layout.placements.len() - 1);
    let bytes = layout.as_bytes(&scene) as f64;
    assert!((mixed.bytes / bytes - 1.0).abs() < 0.01, "{} were predicted, {bytes} it takes", mixed.bytes);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]
    #[test]
    fn every_choice_of_every_scene_is_whole(scene in any_scene(), ratio in prop_oneof![Just(None), (0.5..4.0).prop_map(Some)]) {
        for method in [Method::Single, Method::Bvh, Method::Overlap, Method::Cluster] {
            let layout = run(method, &scene, &Options { instances: choose(ratio), ..Options::default() });
            prop_assert_eq!(layout.check(&scene), Ok(()));
        }
    }
}

#[test]
fn pieces_are_stored_in_frames_that_their_instances_undo() {
    // Triangles that share no corner: only whole components may turn.
    let apart = |t: [Vec3; 3]| t.map(|p| p.lerp((t[0] + t[1] + t[2]) / 3.0, 0.01));
    let mut builder = placed(knot(60, 8).into_iter().map(apart).collect(), 200, 0.6);
    let at = DAffine3::from_scale_rotation_translation(DVec3::new(-0.3, 0.3, 0.3), DQuat::IDENTITY, spread(3));
    builder.place(crate::scene::MeshId(0), "mirrored", at);
    let scene = builder.scene();
    let layout = chosen(&scene, Some(15.0));
    let turned = layout.groups.iter().filter(|g| g.content.piece_frame() != DAffine3::IDENTITY).count();
    assert!(turned > layout.groups.len() / 2, "{turned} of {} are turned", layout.groups.len());
    let error = crate::emit::settle(&scene, &mut layout.clone(), 1e-6, crate::emit::Refuse::Instances);
    assert!(error.refused.is_empty() && error.error > 0.0 && error.error < 1e-6 * scene.bounds().diagonal());
    let refused = crate::emit::settle(&scene, &mut layout.clone(), 0.0, crate::emit::Refuse::Instances).refused;
    assert_eq!(refused.len(), 201, "without any error allowed no instance may be stored in frames");
    let unturned = single_with(&scene, &InstanceOptions { frames: false, ..choose(Some(15.0)) });
    assert!(unturned.groups.iter().all(|g| g.content.piece_frame() == DAffine3::IDENTITY));
}

#[test]
fn pieces_of_copied_nodes_are_not_turned() {
    let mut scene = knots(200, 0.6).scene();
    scene.copied_nodes = vec![7];
    let layout = chosen(&scene, Some(15.0));
    assert!(layout.groups.len() > 1);
    assert!(layout.groups.iter().all(|g| g.content.piece_frame() == DAffine3::IDENTITY));
}

#[test]
fn a_turned_mesh_is_stored_in_the_frame_that_fits_it_for_all_its_instances() {
    let mut builder = SceneBuilder::default();
    let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.5, 0.6, 0.7);
    let plank = |t: [Vec3; 3]| t.map(|p| (turn * (p.as_dvec3() * DVec3::new(1.0, 0.05, 0.02))).as_vec3());
    let mesh = builder.mesh("plank", vec![(0, knot(60, 8).into_iter().map(plank).collect())]);
    for i in 0..300 {
        let by = DAffine3 { matrix3: turn.transpose(), translation: 0.5 * spread(i) };
        builder.place(mesh, "node", by);
    }
    let scene = builder.scene();
    let layout = chosen(&scene, Some(1.0));
    assert_eq!(group_names(&layout), ["piece plank.0"], "no bytes are needed for it");
    assert!(
        layout.notes[0].to_string().contains("300 instances stored in a frame that fits the mesh"),
        "{:?}",
        layout.notes
    );
}

#[test]
fn a_given_number_of_pieces_is_for_all_instances_or_none() {
    let scene = knots(200, 0.6).scene();
    let options = |ratio| InstanceOptions { pieces: Some(16), ..choose(Some(ratio)) };
    let count = |ratio, kind: &str| {
        let names = group_names(&single_with(&scene, &options(ratio)));
        names.iter().filter(|name| name.starts_with(kind)).count()
    };
    assert_eq!((count(30.0, "piece"), count(30.0, "kept")), (16, 0));
    assert_eq!((count(1.5, "piece"), count(1.5, "kept")), (0, 1));
}

#[test]
fn some_instances_are_opened_where_bytes_do_not_last_for_all() {
    let scene = knots(200, 0.6).scene();
    let candidates = Candidates::of(&scene, &choose(None), &Known::default());
    let plans = &candidates.meshes[0].plans;
    let of_fifty = plans.iter().filter(|p| p.baked == 0 && p.opened == 50);
    let some = of_fifty.max_by_key(|p| p.level).expect("there is such a plan");
    let selection = candidates.select(&scene, &[*some]);
    let mut builder = Builder::new(&scene);
    selection.place_left(&mut builder);
    let layout = builder.finish();
    assert_eq!(layout.check(&scene), Ok(()));
    let pieces = layout.groups.len() - 1;
    assert_eq!(layout.placements.len(), 150 + 50 * pieces);
    assert_eq!(selection.left_bounds(&scene).len(), layout.placements.len());
    let bytes = layout.as_bytes(&scene) as f64;
    assert!((some.bytes / bytes - 1.0).abs() < 0.02, "{} were predicted, {bytes} it takes", some.bytes);
    let all = plans.iter().find(|p| p.baked == 0 && p.opened == 200 && p.level == some.level).expect("all of them");
    assert!(plans[0].cost > some.cost && some.cost > all.cost && some.bytes < all.bytes);
}

#[test]
fn pieces_of_one_component_are_not_turned() {
    let layout = chosen(&knots(200, 0.6).scene(), Some(15.0));
    assert!(layout.groups.len() > 1);
    assert!(layout.groups.iter().all(|g| g.content.piece_frame() == DAffine3::IDENTITY));
}
