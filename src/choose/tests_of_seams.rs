//! No layout parts corners that the input stores alike.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DVec3, EulerRot, Vec3};
use proptest::prelude::*;

use super::candidate::lay_out;
use super::plans::Plan;
use crate::layout::store::Store;
use crate::layout::test_scenes::*;
use crate::layout::{Content, Layout};
use crate::methods::{Cache, ClusterOptions, InstanceOptions, Instances, Method, Options, PartOptions, SingleOptions};
use crate::scene::{InstanceId, Pinned, Scene, TriangleRef, position_key};

/// How a corner is stored: the bits of the instance's transform and of the position in the group.
type Stored = ([u32; 12], [u32; 3]);

/// The number of places where a layout stores corners unlike that the input stores alike: at one place of the world,
/// placed by one transform; or that it bakes.
fn parted(scene: &Scene, layout: &Layout) -> usize {
    let mut stored: BTreeMap<(u64, Option<[u64; 12]>), Vec<Stored>> = BTreeMap::new();
    let bits = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    for placement in &layout.placements {
        let content = &layout.groups[placement.group as usize].content;
        let transform = (placement.transform.to_cols_array()).map(|c| (c as f32 + 0.0).to_bits());
        let store = Store::new(scene, content);
        let triangles: Vec<TriangleRef> = match content {
            Content::Kept(mesh) => (0..scene.meshes[mesh.0 as usize].triangle_count() as u32)
                .map(|triangle| TriangleRef { instance: 0, triangle })
                .collect(),
            Content::Piece { geometries, .. } | Content::Baked { geometries, .. } => {
                geometries.iter().flat_map(|g| g.triangles.clone()).collect()
            }
        };
        for (at, corners) in triangles.iter().zip((0..).map(|t| store.corners(t))) {
            let instance = placement.instance.map_or(at.instance, |i| i.0);
            let placed = scene.instances[instance as usize].transform;
            let mesh = scene.mesh_of(InstanceId(instance));
            for (corner, source) in corners.into_iter().zip(mesh.corners(at.triangle)) {
                let place = position_key(placed.transform_point3(source.as_dvec3()));
                let how = (transform, bits(corner.as_vec3()));
                stored.entry((place, Some(placed.to_cols_array().map(f64::to_bits)))).or_default().push(how);
                if placement.instance.is_none() {
                    stored.entry((place, None)).or_default().push(how);
                }
            }
        }
    }
    stored.values().filter(|all| all.iter().any(|one| one != &all[0])).count()
}

fn laid(scene: &Scene, method: Method, options: Options) -> (Layout, Scene) {
    let plan = Plan { id: method.into(), method, options };
    let laid = lay_out(&mut Cache::default(), scene, &plan, 1e-6);
    let scene = scene.overlaid(&laid.overlay).into_owned();
    assert_eq!(laid.layout.check(&scene), Ok(()));
    ((*laid.layout).clone(), scene)
}

/// All options under which frames of their own are tried.
fn turning(entry_cost: f64) -> Vec<(Method, Options)> {
    let instances = |shared| InstanceOptions { entry_cost, shared, ..InstanceOptions::default() };
    let base = |shared| Options { instances: instances(shared), ..Options::default() };
    let apart = PartOptions { isolate: true, split_opacity: true, one_geometry_per_group: false };
    let mut all: Vec<(Method, Options)> = Vec::new();
    for shared in [Instances::BakeOrKeep, Instances::Choose] {
        all.extend(Method::ALL.map(|method| (method, base(shared))));
        let whole = SingleOptions { turned: true, ..SingleOptions::default() };
        all.push((Method::Single, Options { single: whole, ..base(shared) }));
        all.push((Method::Single, Options { single: whole, parts: apart, ..base(shared) }));
        all.push((Method::Cluster, Options { parts: apart, ..base(shared) }));
        let bounded = ClusterOptions { max_group_triangles: Some(40), ..ClusterOptions::default() };
        all.push((Method::Cluster, Options { cluster: bounded, ..base(shared) }));
    }
    all
}

/// A torus of 2 n x n triangles about the z axis, turned and moved.
fn torus(n: usize, place: DAffine3) -> Vec<[Vec3; 3]> {
    let corner = |u: usize, v: usize| {
        let [a, b] = [u % n, v % n].map(|i| i as f64 * std::f64::consts::TAU / n as f64);
        let radius = 3.0 + b.cos();
        place.transform_point3(DVec3::new(radius * a.cos(), radius * a.sin(), b.sin())).as_vec3()
    };
    let square = |i: usize| {
        let (u, v) = (i / n, i % n);
        let [a, b, c, d] = [corner(u, v), corner(u + 1, v), corner(u + 1, v + 1), corner(u, v + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..n * n).flat_map(square).collect()
}

fn place(at: DVec3) -> DAffine3 {
    DAffine3 { matrix3: DMat3::from_euler(EulerRot::XYZ, 0.4, 0.5, 0.7), translation: at }
}

#[test]
fn a_torus_of_many_objects_stays_closed_near_and_far() {
    for at in [DVec3::ZERO, DVec3::new(12_000.0, -7_000.0, 300.0)] {
        let mut builder = SceneBuilder::default();
        for (i, sector) in torus(16, place(at)).chunks(64).enumerate() {
            builder.object("sector", i as u32 % 2, sector.to_vec());
        }
        builder.object("rod", 0, torus(8, place(at + DVec3::Z * 20.0)));
        let scene = builder.scene();
        for (method, options) in turning(0.1) {
            let (layout, scene) = laid(&scene, method, options.clone());
            assert_eq!(parted(&scene, &layout), 0, "{method:?} {options:?} at {at}");
        }
    }
}

#[test]
fn what_is_baked_stays_closed_with_what_stays() {
    let moved = DAffine3::from_translation(DVec3::new(4000.5, 5.0, 6.25));
    for placed in [DAffine3::IDENTITY, moved, DAffine3::from_rotation_x(1.0), place(DVec3::new(4000.0, 5.0, 6.0))] {
        let mut builder = SceneBuilder::default();
        for (i, sector) in torus(16, place(DVec3::ZERO)).chunks(64).enumerate() {
            let mesh = builder.mesh("sector", vec![(0, sector.to_vec())]);
            builder.place(mesh, "sector", placed).pinned = (i == 3).then_some(Pinned::Animated);
        }
        let scene = builder.scene();
        for (method, options) in turning(0.1) {
            let (layout, scene) = laid(&scene, method, options.clone());
            assert_eq!(parted(&scene, &layout), 0, "{method:?} {options:?} by {placed:?}");
            if method == Method::Single && placed.matrix3 == DMat3::IDENTITY {
                assert_eq!(layout.placements.iter().filter(|p| p.instance.is_some()).count(), 1, "one stays");
            }
        }
    }
}

#[test]
fn whole_components_may_turn() {
    let mut builder = SceneBuilder::default();
    for i in 0..6 {
        let thin = DAffine3::from_scale(DVec3::new(20.0, 0.05, 0.05));
        let turned = place(DVec3::new(3.0 * f64::from(i), f64::from(i % 2), 0.0));
        builder.object("rod", 0, torus(12, turned * thin));
    }
    let scene = builder.scene();
    let options =
        Options { instances: InstanceOptions { entry_cost: 0.1, ..InstanceOptions::default() }, ..Options::default() };
    let (layout, scene) = laid(&scene, Method::Cluster, options);
    assert!(layout.groups.iter().any(|g| g.content.baked_frame().matrix3 != DMat3::IDENTITY));
    assert_eq!(parted(&scene, &layout), 0);
}

proptest! {
    #[test]
    fn no_layout_parts_corners(scene in any_scene(), which in 0..20usize, entry_cost in 0.0..4.0) {
        let (method, options) = turning(entry_cost)[which].clone();
        let (layout, scene) = laid(&scene, method, options.clone());
        prop_assert_eq!(parted(&scene, &layout), 0, "{:?} {:?}", method, options);
    }
}
