//! Small scenes whose best groups are obvious.

use glam::{DMat3, DVec3, EulerRot, Vec3};

use super::*;
use crate::layout::Content;
use crate::layout::test_scenes::*;
use crate::methods::{Method, SingleOptions, run};

fn options() -> Options {
    entering(2.0)
}

fn entering(entry_cost: f64) -> Options {
    Options { instances: InstanceOptions { entry_cost, ..InstanceOptions::default() }, ..Options::default() }
}

fn bounded(cluster: ClusterOptions, entry_cost: f64) -> Options {
    Options { cluster, ..entering(entry_cost) }
}

fn checked(scene: &Scene, options: &Options) -> Layout {
    let layout = run(Method::Cluster, scene, options);
    assert_eq!(layout.check(scene), Ok(()));
    layout
}

fn turned(angles: [f64; 3]) -> DMat3 {
    DMat3::from_euler(EulerRot::XYZ, angles[0], angles[1], angles[2])
}

/// A slab of 2 n x n triangles perpendicular to z, centred, with edges along x and y.
fn slab(at: DVec3, half: DVec3, n: usize, rotation: DMat3) -> Vec<[Vec3; 3]> {
    let corner = |x: usize, y: usize| {
        let unit = DVec3::new(x as f64, y as f64, 0.0) * (2.0 / n as f64) - DVec3::new(1.0, 1.0, 0.0);
        (at + rotation * (unit * half)).as_vec3()
    };
    let square = |i: usize| {
        let (x, y) = (i % n, i / n);
        let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..n * n).flat_map(square).collect()
}

/// Two crossed walls of triangles.
fn walls(rotation: DMat3) -> Vec<[Vec3; 3]> {
    let across = DMat3::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let half = DVec3::new(10.0, 8.0, 1.0);
    [slab(DVec3::ZERO, half, 16, rotation), slab(DVec3::ZERO, half, 16, rotation * across)].concat()
}

/// Slabs that fill a cube, so that dividing it adds area.
fn stack() -> Scene {
    let mut builder = SceneBuilder::default();
    for i in 0..9 {
        let at = DVec3::Z * (2.0 * f64::from(i) - 8.0);
        builder.object("slab", 0, slab(at, DVec3::splat(8.0), 8, DMat3::IDENTITY));
    }
    builder.scene()
}

fn one_object(triangles: Vec<[Vec3; 3]>) -> Scene {
    let mut builder = SceneBuilder::default();
    builder.object("a", 0, triangles.clone());
    builder.object("b", 0, slab(DVec3::splat(30.0), DVec3::ONE, 1, DMat3::IDENTITY));
    builder.scene()
}

fn frames(layout: &Layout) -> Vec<DMat3> {
    let frame = |content: &Content| match content {
        Content::Baked { frame, .. } => Some(frame.matrix3),
        _ => None,
    };
    layout.groups.iter().filter_map(|g| frame(&g.content)).collect()
}

fn is_turned(frame: &DMat3) -> bool {
    *frame != DMat3::IDENTITY
}

#[test]
fn nothing_gives_nothing() {
    assert!(checked(&Scene::default(), &options()).groups.is_empty());
}

#[test]
fn what_lies_along_the_axes_becomes_what_single_makes_of_it() {
    let scene = stack();
    let single = run(Method::Single, &scene, &options());
    let layout = checked(&scene, &entering(15.0));
    assert_eq!(group_names(&layout), group_names(&single));
    assert!(!frames(&layout).iter().any(is_turned));
}

#[test]
fn a_turned_scene_is_stored_in_its_own_frame() {
    let rotation = turned([0.5, 0.3, 0.8]);
    let scene = one_object(walls(rotation));
    let turned = SingleOptions { turned: true };
    let layout = run(Method::Single, &scene, &Options { single: turned, ..Options::default() });
    assert_eq!(layout.groups.len(), 1);
    let between = frames(&layout)[0].transpose() * rotation;
    let along_axes = between.to_cols_array().iter().all(|c| c.abs() < 1e-5 || c.abs() > 1.0 - 1e-5);
    assert!(along_axes, "{between}");
}

#[test]
fn frames_can_be_forbidden() {
    let scene = one_object(walls(turned([0.5, 0.3, 0.8])));
    let layout =
        checked(&scene, &Options { instances: InstanceOptions { frames: false, ..options().instances }, ..options() });
    assert!(!frames(&layout).iter().any(is_turned));
}

#[test]
fn turned_furniture_leaves_an_aligned_room() {
    let mut builder = SceneBuilder::default();
    builder.object("room", 0, walls(DMat3::IDENTITY));
    builder.object("board", 1, slab(DVec3::new(5.0, 4.0, 4.0), DVec3::new(3.0, 2.0, 1.0), 20, turned([0.6, 0.4, 0.2])));
    let scene = builder.scene();
    let layout = checked(&scene, &options());
    let turned: Vec<usize> = (0..layout.groups.len()).filter(|&g| is_turned(&frames(&layout)[g])).collect();
    let sizes = group_sizes(&scene, &layout);
    assert_eq!(turned.iter().map(|&g| sizes[g]).sum::<usize>(), 800, "{:?}", group_names(&layout));
    let dear = checked(&scene, &entering(1e5));
    assert!(!frames(&dear).iter().any(is_turned), "an entry that dear pays for nothing");
}

#[test]
fn pinned_instances_stay_as_they_are() {
    let mut builder = SceneBuilder::default();
    builder.object("few", 0, slab(DVec3::ZERO, DVec3::ONE, 2, DMat3::IDENTITY));
    let mesh = builder.mesh("moving", vec![(0, walls(turned([0.1, 0.7, 0.4])))]);
    builder.place(mesh, "moving", at(50.0, 0.0, 0.0)).pinned = Some(crate::scene::Pinned::Animated);
    let layout = checked(&builder.scene(), &options());
    assert!(group_names(&layout).contains(&"kept moving".to_owned()));
    assert!(group_names(&layout).contains(&"kept few".to_owned()));
}

#[test]
fn bounds_on_groups_hold() {
    let scene = one_object(walls(DMat3::IDENTITY));
    for most in [1, 7, 100, 511, 1025, 5000] {
        let layout = checked(
            &scene,
            &bounded(ClusterOptions { max_group_triangles: Some(most), ..ClusterOptions::default() }, 2.0),
        );
        let largest = group_sizes(&scene, &layout).into_iter().max().unwrap_or(0);
        assert!(largest <= most as usize, "{largest} of {most}");
    }
    let layout = checked(
        &scene,
        &bounded(ClusterOptions { max_group_extent_ratio: Some(0.2), ..ClusterOptions::default() }, 2.0),
    );
    let extent = scene.bounds().size().max_element();
    assert!(layout.groups.len() > 4);
    for bounds in placed_bounds(&scene, &layout) {
        assert!(bounds.size().max_element() <= 0.2 * extent + 1e-6);
    }
}

#[test]
fn one_triangle_too_many_costs_one_small_group() {
    let scene = stack();
    let all = scene.triangles_placed() as u32;
    let layout = checked(
        &scene,
        &bounded(ClusterOptions { max_group_triangles: Some(all - 1), ..ClusterOptions::default() }, 15.0),
    );
    let mut sizes = group_sizes(&scene, &layout);
    sizes.sort_unstable();
    assert!(sizes.len() == 2 && sizes[0] <= 8, "{sizes:?}");
}

#[test]
fn crossing_strands_leave_one_by_one() {
    let mut builder = SceneBuilder::default();
    for i in 0..40 {
        let angle = 0.15 + 0.07 * f64::from(i);
        let strand = slab(
            DVec3::Z * 1e-3 * f64::from(i),
            DVec3::new(40.0, 0.02, 1.0),
            8,
            turned([0.3 * angle, 0.9 * angle, angle]),
        );
        builder.object("strand", 0, strand);
    }
    let scene = builder.scene();
    let layout = checked(&scene, &options());
    // Neighbours, which differ by four degrees, may share a frame; long strands are divided along their length.
    assert!(layout.groups.len() >= 20, "{}", layout.groups.len());
    assert!(frames(&layout).iter().all(is_turned));
}

#[test]
fn size_and_threads_do_not_matter() {
    let groups = |scale: f32| {
        let scaled: Vec<_> = walls(turned([0.5, 0.3, 0.8])).iter().map(|t| t.map(|p| p * scale)).collect();
        let mut builder = SceneBuilder::default();
        builder.object("a", 0, scaled.clone());
        builder.object("b", 0, scaled.iter().map(|t| t.map(|p| p + Vec3::X * 40.0 * scale)).collect());
        let scene = builder.scene();
        group_sizes(&scene, &checked(&scene, &options()))
    };
    let expected = groups(1.0);
    for power in [-90, -60, 60, 90] {
        assert_eq!(groups(2f32.powi(power)), expected, "2^{power}");
    }
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        assert_eq!(pool.install(|| groups(1.0)), expected);
    }
}

#[test]
fn a_cache_changes_nothing() {
    let scene = one_object(walls(turned([0.5, 0.3, 0.8])));
    let turned = Options { single: SingleOptions { turned: true }, ..Options::default() };
    let runs = [(Method::Single, turned), (Method::Cluster, entering(15.0)), (Method::Cluster, entering(4.0))];
    let mut cache = Cache::serving(runs.iter().map(|run| &run.1));
    for (method, told) in runs {
        let cached = super::super::run_with(&mut cache, method, &scene, &told);
        let fresh = run(method, &scene, &told);
        assert!(cached.groups.iter().zip(&fresh.groups).all(|(a, b)| a.content == b.content));
        assert_eq!(cached.placements, fresh.placements);
    }
}

#[test]
fn equal_and_degenerate_triangles_are_grouped_too() {
    let same = [Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0), Vec3::new(-2.0, 1.0, 0.5)];
    let line = [Vec3::ZERO, Vec3::ONE, Vec3::ONE * 2.0];
    let mut builder = SceneBuilder::default();
    builder.object("pile", 0, vec![same; 5000]);
    builder.object("line", 1, vec![line; 100]);
    let scene = builder.scene();
    let layout = checked(&scene, &options());
    assert_eq!(group_sizes(&scene, &layout).iter().sum::<usize>(), 5100);
}

/// A rod of four lengths with six sides, along a diagonal.
fn rod(at: DVec3, rotation: DMat3) -> Vec<[Vec3; 3]> {
    let corner = |length: usize, side: usize| {
        let (sin, cos) = (side as f64 * std::f64::consts::TAU / 6.0).sin_cos();
        (at + rotation * DVec3::new(10.0 * length as f64, 0.1 * cos, 0.1 * sin)).as_vec3()
    };
    let square = |i: usize| {
        let (length, side) = (i / 6, i % 6);
        let [a, b] = [length, length + 1].map(|l| corner(l, side));
        let [d, c] = [length, length + 1].map(|l| corner(l, (side + 1) % 6));
        [[a, b, c], [a, c, d]]
    };
    (0..24).flat_map(square).collect()
}

#[test]
fn long_rods_are_divided_within_one_frame() {
    let mut builder = SceneBuilder::default();
    for i in 0..12 {
        let i = f64::from(i);
        let at = DVec3::new(7.0 * i.sin(), 5.0 * (2.0 * i).cos(), i);
        builder.object("rod", 0, rod(at, turned([1.3 * i, 0.7 * i, 2.1 * i + 0.5])));
    }
    let scene = builder.scene();
    let layout =
        checked(&scene, &bounded(ClusterOptions { min_turned_triangles: 6, ..ClusterOptions::default() }, 5.0));
    let sizes = group_sizes(&scene, &layout);
    assert!(frames(&layout).iter().all(is_turned), "{sizes:?}");
    assert!(sizes.len() >= 40, "{sizes:?}");
}
