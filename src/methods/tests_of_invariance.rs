//! Properties of all methods: what a scene's place, size and order may change of its layouts.
//!
//! Translations by multiples of the scenes' grid and scales by powers of two change no rounding, so all decisions stay.
//! Quarter turns and the order of objects change how ties are broken, so only the methods without ties must give the
//! same groups:
//! - Under quarter turns `bvh` differs if a centroid lies on the border of two bins, which belongs to the bin above it,
//!   `overlap` if one lies in the middle of a box, and `cluster` because its tree follows a space-filling curve.
//! - The order of objects breaks ties between pairs of `overlap` that overlap equally, the node budget of `bvh` is
//!   spent in that order, and the tree of `cluster` breaks ties between equal distances by it.

use std::collections::BTreeSet;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use proptest::prelude::*;

use super::{BvhOptions, Method, Options, run};
use crate::cost::structure::Structure;
use crate::cost::{Metrics, measure};
use crate::layout::store::Store;
use crate::layout::test_scenes::*;
use crate::layout::{Content, GroupGeometry, Layout, Placement};
use crate::scene::{MeshId, Scene};

/// A group where it is placed: the name of the instance and the number of each triangle, in ascending order.
type Placed = Vec<(String, u32)>;

/// Returns what each placement of a layout places.
fn placed(scene: &Scene, layout: &Layout) -> Vec<Placed> {
    let name = |i: u32| scene.instances[i as usize].name.clone();
    let of = |placement: &Placement| {
        let refs =
            |geometries: &[GroupGeometry]| geometries.iter().flat_map(|g| g.triangles.clone()).collect::<Vec<_>>();
        let instance = placement.instance.map_or(0, |i| i.0);
        let mut triangles: Placed = match &layout.groups[placement.group as usize].content {
            Content::Kept(mesh) => {
                let count = scene.meshes[mesh.0 as usize].triangle_count() as u32;
                (0..count).map(|t| (name(instance), t)).collect()
            }
            Content::Piece { geometries, .. } => {
                refs(geometries).into_iter().map(|t| (name(instance), t.triangle)).collect()
            }
            Content::Baked { geometries, .. } => {
                refs(geometries).into_iter().map(|t| (name(t.instance), t.triangle)).collect()
            }
        };
        triangles.sort_unstable();
        triangles
    };
    layout.placements.iter().map(of).collect()
}

fn groups(scene: &Scene, layout: &Layout) -> BTreeSet<Placed> {
    placed(scene, layout).into_iter().collect()
}

/// Options with enough nodes for `bvh` to split whatever it may.
fn ample() -> Options {
    Options { bvh: BvhOptions { nodes_per_triangle_ratio: 4.0, ..BvhOptions::default() }, ..Options::default() }
}

/// World axes turned by quarters: one of the 24 rotations, exactly.
fn quarters(number: usize) -> DMat3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let (first, second) = (number % 3, (number / 3) % 2);
    let sign = |bit: usize| if (number / 6) & bit == 0 { 1.0 } else { -1.0 };
    let x = axes[first] * sign(1);
    let y = axes[(first + 1 + second) % 3] * sign(2);
    DMat3::from_cols(x, y, x.cross(y))
}

/// Generates scenes on a grid of eighths, whose instances are turned by quarters: no computation on them rounds.
fn exact_scene() -> impl Strategy<Value = Scene> {
    let corner = || [-99..99i8, -99..99i8, -40..40i8].prop_map(|c| Vec3::from(c.map(f32::from)) * 0.125);
    let triangles = prop::collection::vec([corner(), corner(), corner()], 1..30);
    let mesh = prop::collection::vec((0..3u32, triangles), 1..3);
    let place = (any::<prop::sample::Index>(), 0..24usize, [-20..20i32, -20..20i32, -20..20i32]);
    (prop::collection::vec(mesh, 1..5), prop::collection::vec(place, 1..9)).prop_map(|(meshes, places)| {
        let mut builder = SceneBuilder::default();
        let meshes: Vec<MeshId> = meshes.into_iter().map(|geometries| builder.mesh("mesh", geometries)).collect();
        for (i, (mesh, turn, by)) in places.into_iter().enumerate() {
            let translation = DVec3::from(by.map(f64::from));
            let transform = DAffine3 { matrix3: quarters(turn), translation };
            builder.place(*mesh.get(&meshes), &format!("node {i}"), transform);
        }
        builder.scene()
    })
}

fn moved(scene: &Scene, by: DAffine3) -> Scene {
    let mut moved = scene.clone();
    moved.instances.iter_mut().for_each(|instance| instance.transform = by * instance.transform);
    moved
}

/// The ratios that no motion and no order may change.
fn ratios(metrics: &Metrics) -> [f64; 2] {
    [metrics.overlap_ratio, metrics.core_overlap_ratio]
}

fn are_close(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-12 * a.abs().max(b.abs()))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    #[test]
    fn translation_and_scale_by_powers_of_two_change_no_decision(
        scene in exact_scene(),
        by in [-500..500i32, -500..500i32, -500..500i32],
        power in -20..20i32,
    ) {
        let scale = DMat3::from_diagonal(DVec3::splat(2f64.powi(power)));
        let by = DAffine3 { matrix3: scale, translation: scale * DVec3::from(by.map(f64::from)) };
        let after = moved(&scene, by);
        for method in Method::ALL {
            let [one, other] = [&scene, &after].map(|scene| run(method, scene, &ample()));
            prop_assert_eq!(groups(&scene, &one), groups(&after, &other), "{:?}", method);
            let [one, other] = [measure(&scene, &one), measure(&after, &other)];
            prop_assert_eq!(ratios(&one), ratios(&other), "{:?}", method);
            let costs = |m: &Metrics| [m.sah_cost, m.two_level_cost];
            prop_assert!(are_close(&costs(&one), &costs(&other)), "{:?}: {:?} {:?}", method, costs(&one), costs(&other));
        }
    }

    #[test]
    fn quarter_turns_change_neither_ratios_nor_groups_without_ties(scene in exact_scene(), turn in 1..24usize) {
        let after = moved(&scene, DAffine3 { matrix3: quarters(turn), translation: DVec3::ZERO });
        for method in [Method::Keep, Method::Single, Method::PerObject] {
            let [one, other] = [&scene, &after].map(|scene| run(method, scene, &Options::default()));
            prop_assert_eq!(groups(&scene, &one), groups(&after, &other), "{:?}", method);
            prop_assert!(are_close(&ratios(&measure(&scene, &one)), &ratios(&measure(&after, &other))), "{:?}", method);
        }
    }

    #[test]
    fn the_order_of_objects_changes_neither_ratios_nor_groups_without_ties(
        scene in exact_scene(),
        first in any::<prop::sample::Index>(),
    ) {
        let mut after = scene.clone();
        after.instances.reverse();
        let first = first.index(after.instances.len());
        after.instances.rotate_left(first);
        prop_assert_eq!(scene.core().bounds(), after.core().bounds());
        for method in [Method::Keep, Method::Single, Method::PerObject, Method::Bvh] {
            let [one, other] = [&scene, &after].map(|scene| run(method, scene, &ample()));
            prop_assert_eq!(groups(&scene, &one), groups(&after, &other), "{:?}", method);
            prop_assert!(are_close(&ratios(&measure(&scene, &one)), &ratios(&measure(&after, &other))), "{:?}", method);
        }
    }

    #[test]
    fn every_layout_is_a_partition_of_the_placed_triangles(scene in any_scene()) {
        let mut named = scene.clone();
        named.instances.iter_mut().enumerate().for_each(|(i, instance)| instance.name = i.to_string());
        let all_of = |(i, instance): (usize, &crate::scene::Instance)| {
            let count = named.meshes[instance.mesh.0 as usize].triangle_count() as u32;
            (0..count).map(move |t| (i.to_string(), t))
        };
        let mut expected: Placed = named.instances.iter().enumerate().flat_map(all_of).collect();
        expected.sort_unstable();
        for method in Method::ALL {
            let mut found = placed(&named, &run(method, &named, &ample())).concat();
            found.sort_unstable();
            prop_assert_eq!(&found, &expected, "{:?}", method);
        }
    }

    #[test]
    fn every_box_holds_its_triangles_as_stored(scene in any_scene()) {
        for method in Method::ALL {
            let layout = run(method, &scene, &ample());
            let structure = Structure::build(&scene, &layout);
            for (placement, world) in layout.placements.iter().zip(&structure.boxes) {
                let store = Store::new(&scene, &layout.groups[placement.group as usize].content);
                let local = &structure.blas[placement.group as usize].bounds;
                // What a transformed corner may round beyond the sum of its parts.
                let slack = 1e-14 * (world.min.abs().max(world.max.abs()).max_element() + local.diagonal());
                for corner in (0..store.len()).flat_map(|t| store.corners(t)) {
                    prop_assert!(corner.cmpge(local.min).all() && corner.cmple(local.max).all(), "{:?}", method);
                    let seen = placement.transform.transform_point3(corner);
                    let inside = seen.cmpge(world.min - slack).all() && seen.cmple(world.max + slack).all();
                    prop_assert!(inside, "{:?}: {} outside {:?}", method, seen, world);
                }
            }
        }
    }
}
