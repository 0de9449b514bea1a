use super::*;
use crate::layout::test_scenes::*;
use crate::layout::{Content, GroupGeometry};
use crate::scene::Pinned;
use glam::{DAffine3, Vec3};
use proptest::prelude::*;

fn checked(scene: &Scene, options: &OverlapOptions) -> Layout {
    let layout = overlap(scene, &InstanceOptions::default(), options);
    assert_eq!(layout.check(scene), Ok(()));
    layout
}

fn with_ratios(skip: f64, split: f64, split_or_merge: f64) -> OverlapOptions {
    OverlapOptions {
        skip_overlap_ratio: skip,
        split_ratio: split,
        split_or_merge_ratio: split_or_merge,
        ..OverlapOptions::default()
    }
}

fn overlap_ratio(scene: &Scene, layout: &Layout) -> f64 {
    crate::cost::core_overlap::ratio(scene, layout, &placed_bounds(scene, layout))
}

/// The overlap ratio before any change.
fn ratio_before(scene: &Scene) -> f64 {
    overlap_ratio(
        scene,
        &checked(scene, &OverlapOptions { skip_overlap_ratio: f64::INFINITY, ..OverlapOptions::default() }),
    )
}

fn moved(triangles: Vec<[Vec3; 3]>, by: Vec3) -> Vec<[Vec3; 3]> {
    triangles.into_iter().map(|t| t.map(|p| p + by)).collect()
}

/// A square of `n` by `n` small triangles, one unit apart.
fn field(corner: Vec3, n: usize) -> Vec<[Vec3; 3]> {
    (0..n).flat_map(|y| row(corner + Vec3::Y * y as f32, n)).collect()
}

#[test]
fn an_empty_scene_gives_an_empty_layout() {
    assert!(checked(&Scene::default(), &OverlapOptions::default()).groups.is_empty());
}

#[test]
fn objects_apart_stay_as_they_are() {
    let mut builder = SceneBuilder::default();
    builder.object("a", 0, row(Vec3::ZERO, 20));
    let lamp = builder.mesh("lamp", vec![(0, row(Vec3::Y, 9)), (1, row(Vec3::Y * 5.0, 9))]);
    builder.place(lamp, "lamp", DAffine3::IDENTITY);
    let layout = checked(&builder.scene(), &with_ratios(0.0, 0.25, 0.5));
    assert_eq!(group_names(&layout), ["kept a", "kept lamp"]);
    assert!(layout.notes[0].to_string().contains("no round lowers the overlap ratio"), "{:?}", layout.notes);
}

#[test]
fn a_pair_that_overlaps_mostly_becomes_a_mesh_group_that_keeps_both_materials() {
    let mut builder = SceneBuilder::default();
    builder.object("leaves", 0, field(Vec3::ZERO, 10));
    builder.object("twigs", 1, field(Vec3::splat(0.1), 9));
    let scene = builder.scene();
    let layout = checked(&scene, &OverlapOptions::default());
    assert_eq!(group_names(&layout), ["baked leaves + 1"]);
    let Content::Baked { geometries, .. } = &layout.groups[0].content else { panic!("not baked") };
    let parts: Vec<_> = geometries.iter().map(|g: &GroupGeometry| (g.material, g.triangles.len())).collect();
    assert_eq!(parts, [(Some(0), 100), (Some(1), 81)]);
}

#[test]
fn a_pair_that_overlaps_little_is_split_in_the_middle() {
    // Two L shapes whose boxes share the empty corner of each.
    let mut builder = SceneBuilder::default();
    builder.object("a", 0, [row(Vec3::ZERO, 40), row(Vec3::new(0.0, 20.0, 0.0), 4)].concat());
    builder.object("b", 0, [row(Vec3::new(25.0, 22.0, 0.0), 40), row(Vec3::new(61.0, 3.0, 0.0), 4)].concat());
    let scene = builder.scene();
    let before = ratio_before(&scene);
    let layout = checked(&scene, &with_ratios(0.0, 0.5, 0.5));
    let after = overlap_ratio(&scene, &layout);
    assert!(before > 0.1 && after < 0.5 * before, "{before} to {after}");
    let names = group_names(&layout);
    assert!(names.len() >= 4 && names.iter().all(|n| !n.contains('+')), "{names:?}");
}

#[test]
fn a_pair_in_between_is_split_at_the_overlap_and_the_parts_inside_merge() {
    let mut builder = SceneBuilder::default();
    builder.object("left", 0, field(Vec3::ZERO, 20));
    builder.object("right", 1, field(Vec3::new(10.05, 0.0, 0.0), 20));
    let scene = builder.scene();
    let layout = checked(&scene, &with_ratios(0.05, 0.1, 0.9));
    assert_eq!(group_names(&layout), ["baked left + 1", "baked left.0", "baked right.0"]);
    assert_eq!(group_sizes(&scene, &layout), [400, 200, 200]);
    assert!(overlap_ratio(&scene, &layout) < 0.1 * ratio_before(&scene));
}

#[test]
fn an_object_that_cannot_be_divided_joins_what_overlaps_it() {
    let mut builder = SceneBuilder::default();
    builder.object("small", 0, vec![[Vec3::ZERO, Vec3::new(10.0, 0.0, 1.0), Vec3::new(0.0, 10.0, 1.0)]; 3]);
    builder.object("field", 1, field(Vec3::ZERO, 16));
    let scene = builder.scene();
    let layout = checked(&scene, &with_ratios(0.05, 0.1, 0.9));
    let names = group_names(&layout);
    assert!(names.iter().any(|n| n.contains("+ 1")), "{names:?}");
    assert!(overlap_ratio(&scene, &layout) < ratio_before(&scene));
}

#[test]
fn pairs_below_the_skip_ratio_are_left() {
    let mut builder = SceneBuilder::default();
    builder.object("left", 0, field(Vec3::ZERO, 20));
    builder.object("right", 1, field(Vec3::new(18.0, 0.0, 0.0), 20));
    let scene = builder.scene();
    assert_eq!(group_names(&checked(&scene, &with_ratios(0.2, 0.5, 0.5))), ["kept left", "kept right"]);
    assert_ne!(group_names(&checked(&scene, &with_ratios(0.01, 0.01, 0.5))), ["kept left", "kept right"]);
}

#[test]
fn nothing_is_done_below_the_termination_ratio() {
    let mut builder = SceneBuilder::default();
    builder.object("a", 0, field(Vec3::ZERO, 10));
    builder.object("b", 1, field(Vec3::splat(0.1), 10));
    let options = OverlapOptions { termination_overlap_ratio: 2.0, ..OverlapOptions::default() };
    assert_eq!(group_names(&checked(&builder.scene(), &options)), ["kept a", "kept b"]);
}

#[test]
fn objects_of_few_triangles_are_not_split() {
    let mut builder = SceneBuilder::default();
    builder.object("a", 0, field(Vec3::ZERO, 3));
    builder.object("b", 1, field(Vec3::new(2.0, 2.0, 0.0), 3));
    let options = OverlapOptions { min_triangles: 9, ..with_ratios(0.0, 0.9, 0.9) };
    assert_eq!(group_names(&checked(&builder.scene(), &options)), ["kept a", "kept b"]);
}

#[test]
fn equal_triangles_end_the_rounds() {
    let mut builder = SceneBuilder::default();
    for i in 0..4 {
        builder.object("pile", i, vec![small_triangle(Vec3::X * 0.01 * i as f32); 5000]);
    }
    let scene = builder.scene();
    let improved = [with_ratios(0.0, 2.0, 2.0), with_ratios(0.0, 0.0, 2.0), with_ratios(0.0, 0.0, 0.0)];
    let all = improved.into_iter().flat_map(|options| {
        [OverlapRule::Improved, OverlapRule::Thesis].map(|rule| OverlapOptions { rule, ..options })
    });
    for options in all {
        assert_eq!(group_sizes(&scene, &checked(&scene, &options)).iter().sum::<usize>(), 20_000);
    }
}

fn literal(skip: f64, split: f64, split_or_merge: f64) -> OverlapOptions {
    OverlapOptions { rule: OverlapRule::Thesis, ..with_ratios(skip, split, split_or_merge) }
}

fn rounds_of(layout: &Layout) -> &Rounds {
    layout.rounds.as_ref().expect("overlap has rounds")
}

/// Two fields in one place, and one whose box they share a little of.
fn merged_then_split() -> Scene {
    let mut builder = SceneBuilder::default();
    builder.object("leaves", 0, field(Vec3::ZERO, 20));
    builder.object("twigs", 1, field(Vec3::splat(0.01), 20));
    builder.object("corner", 2, field(Vec3::new(17.0, 17.0, 0.0), 20));
    builder.scene()
}

#[test]
fn by_the_thesis_what_merged_is_divided_again() {
    let scene = merged_then_split();
    let sizes = |options: &OverlapOptions| group_sizes(&scene, &checked(&scene, options));
    let options = with_ratios(0.001, 0.4, 0.5);
    assert!(sizes(&options).contains(&800), "{:?}", sizes(&options));
    let layout = checked(&scene, &literal(0.001, 0.4, 0.5));
    assert!(group_sizes(&scene, &layout).iter().all(|&size| size < 800), "{:?}", group_sizes(&scene, &layout));
    assert!(group_names(&layout).iter().any(|name| name.contains("+ 1")), "{:?}", group_names(&layout));
    assert!(rounds_of(&layout).merges >= 1 && rounds_of(&layout).splits >= 2, "{:?}", rounds_of(&layout));
}

#[test]
fn by_the_thesis_the_last_round_is_taken_and_rounds_end_when_a_state_returns() {
    // Halves of long diagonal triangles overlap more than the whole, and merge again.
    let mut builder = SceneBuilder::default();
    let needle = |x: f32| [Vec3::new(x, 0.0, 0.0), Vec3::new(x + 40.0, 40.0, 1.0), Vec3::new(x + 1.0, 0.0, 0.0)];
    builder.object("a", 0, (0..30).map(|i| needle(0.1 * i as f32)).collect());
    builder.object("b", 1, (0..30).map(|i| needle(38.0 + 0.1 * i as f32)).collect());
    let scene = builder.scene();
    let layout = checked(&scene, &literal(0.0, 0.9, 0.9));
    let meshes: Vec<u64> = rounds_of(&layout).list.iter().map(|round| round.meshes).collect();
    assert_eq!((meshes.as_slice(), rounds_of(&layout).taken), (&[2, 4, 2][..], Some(2)));
    // With merging off, they stay divided.
    let layout = checked(&scene, &OverlapOptions { min_triangles: 20, ..literal(0.0, 2.0, 2.0) });
    let Rounds { taken, list, .. } = rounds_of(&layout);
    assert_eq!(*taken, Some(list.len() - 1));
    assert!(list[list.len() - 1].overlap_ratio > list[0].overlap_ratio, "{list:?}");
    let improved = checked(&scene, &with_ratios(0.0, 0.9, 0.9));
    assert_eq!(group_names(&improved), ["kept a", "kept b"]);
    assert_eq!(rounds_of(&improved).taken, None);
}

#[test]
fn rounds_are_counted_and_cost_what_their_layout_costs() {
    let mut builder = SceneBuilder::default();
    builder.object("left", 0, field(Vec3::ZERO, 20));
    builder.object("right", 1, field(Vec3::new(10.05, 0.0, 0.0), 20));
    let scene = builder.scene();
    let layout = checked(&scene, &OverlapOptions { series: true, ..with_ratios(0.05, 0.1, 0.9) });
    let rounds = rounds_of(&layout);
    let taken = rounds.list[rounds.taken.unwrap()];
    assert_eq!((rounds.list[0].meshes, rounds.list[0].splits, rounds.list[0].merges), (2, 0, 0));
    assert_eq!((taken.meshes, taken.splits, taken.merges), (3, 2, 1));
    let structure = crate::cost::structure::Structure::build(&scene, &layout);
    let sum = crate::cost::two_level::TwoLevelCost::of(&structure, &layout);
    let area = scene.bounds().area();
    let (sah, two_level) = (sum.flat_cost(area), sum.cost(area));
    assert!((taken.sah_cost.unwrap() / sah - 1.0).abs() < 0.1, "{:?} {sah}", taken.sah_cost);
    assert!((taken.two_level_cost.unwrap() / two_level - 1.0).abs() < 0.1, "{:?} {two_level}", taken.two_level_cost);
    assert!(taken.two_level_cost < rounds.list[0].two_level_cost);
}

#[test]
fn pinned_instances_stay() {
    let mut builder = SceneBuilder::default();
    let mesh = builder.mesh("mesh", vec![(0, field(Vec3::ZERO, 10))]);
    builder.place(mesh, "pinned", DAffine3::IDENTITY).pinned = Some(Pinned::Animated);
    builder.place(mesh, "first", at(0.1, 0.0, 0.0));
    builder.place(mesh, "second", at(0.0, 0.1, 0.0));
    let layout = checked(&builder.scene(), &OverlapOptions::default());
    assert_eq!(group_names(&layout), ["kept mesh", "baked first + 1"]);
}

#[test]
fn thousands_of_objects_in_one_place_merge_round_by_round() {
    let mut builder = SceneBuilder::default();
    let mesh = builder.mesh("mesh", vec![(0, row(Vec3::ZERO, 1))]);
    for i in 0..2 * FEW_OBJECTS {
        builder.place(mesh, "node", at(1e-6 * i as f64, 0.0, 0.0));
    }
    let scene = builder.scene();
    let layout = checked(&scene, &OverlapOptions::default());
    assert!(layout.groups.len() < 100, "{} groups", layout.groups.len());
}

#[test]
fn a_crowd_in_one_place_merges_at_once() {
    let mut builder = SceneBuilder::default();
    let mesh = builder.mesh("mesh", vec![(0, row(Vec3::ZERO, 1))]);
    for _ in 0..3 * FEW_OBJECTS {
        builder.place(mesh, "node", DAffine3::IDENTITY);
    }
    builder.place(mesh, "beside", at(5.0, 0.0, 0.0));
    let scene = builder.scene();
    let layout = checked(&scene, &OverlapOptions::default());
    assert_eq!(group_sizes(&scene, &layout), [1, 3 * FEW_OBJECTS]);
}

#[test]
fn a_dome_and_a_far_object_leave_the_groups_of_the_rest_alone() {
    let groups = |exceptions| group_names(&checked(&heaps(exceptions), &OverlapOptions::default()));
    let plain = groups(0);
    assert!(plain.iter().any(|name| name.contains('+')) && plain.iter().any(|name| name.contains('.')), "{plain:?}");
    for exceptions in [1, 2] {
        let mut with = groups(exceptions);
        with.retain(|name| !["kept sky", "kept moon"].contains(&name.as_str()));
        assert_eq!(with, plain);
    }
}

#[test]
fn the_layout_is_the_same_for_any_number_of_threads() {
    let mut builder = SceneBuilder::default();
    for i in 0..30 {
        let corner = Vec3::new((i * 7 % 20) as f32, (i * 3 % 25) as f32, 0.0);
        builder.object("object", i % 3, moved(field(Vec3::ZERO, 12), corner));
    }
    let scene = builder.scene();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| format!("{:?}", checked(&scene, &OverlapOptions::default())))
    };
    assert_eq!(with(1), with(3));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]
    #[test]
    fn no_scene_ends_with_more_overlap_than_it_began_with(
        scene in any_scene(),
        skip in 0.0..0.1,
        split in 0.0..1.0,
        split_or_merge in 0.0..1.2,
    ) {
        let layout = checked(&scene, &OverlapOptions { min_triangles: 2, ..with_ratios(skip, split, split_or_merge) });
        let (before, after) = (ratio_before(&scene), overlap_ratio(&scene, &layout));
        prop_assert!(after <= before * (1.0 + 1e-12), "{} to {}", before, after);
    }
}
