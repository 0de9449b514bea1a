//! Parts of restructured triangles that must not share a group: isolated objects ([`apart`]),
//! triangles that rays can pass through, and, if a consumer builds one BLAS per primitive, triangles that cannot share
//! a geometry.

use std::collections::BTreeMap;

use crate::layout::builder::Builder;
use crate::layout::builder::{Geometries, GeometryKey, Object, key, objects};
use crate::methods::PartOptions;
use crate::scene::{Apart, InstanceId, Opacity, Scene, apart};

/// Objects that may share a group.
pub(super) struct Part {
    /// A name for people to read.
    pub(super) name: String,
    /// The objects, in the order of the scene.
    pub(super) objects: Vec<Object>,
}

/// Divides objects as the options require: first the rest, then shells, then outliers, each on its own; within each,
/// opaque triangles come first. Returns one part, named `scene`, if there is nothing to divide; no part is empty.
pub(super) fn parts(scene: &Scene, instances: &[InstanceId], options: &PartOptions) -> Vec<Part> {
    let all = Part { name: "scene".to_owned(), objects: objects(scene, instances.iter().copied()) };
    let mut parts = if options.isolate { isolated(scene, all) } else { vec![all] };
    if options.split_opacity {
        parts = parts.into_iter().flat_map(|part| by_opacity(scene, part)).collect();
    }
    if options.one_geometry_per_group {
        parts = parts.into_iter().flat_map(|part| by_key(scene, part)).collect();
    }
    parts.retain(|part| !part.objects.is_empty());
    parts
}

/// Adds a part to a layout as one group.
pub(super) fn bake_part(scene: &Scene, part: &Part, layout: &mut Builder) {
    let mut geometries = Geometries::default();
    for object in &part.objects {
        geometries.add(object.geometry(scene), object.triangles(scene));
    }
    layout.bake(part.name.clone(), geometries);
}

/// Whether isolation has any effect.
pub fn isolates(scene: &Scene) -> bool {
    !apart(scene, &free_objects(scene)).is_empty()
}

/// Whether restructurable triangles include both opaque ones and others.
pub fn opacities_differ(scene: &Scene) -> bool {
    let objects = free_objects(scene);
    let opaque = |o: &Object| o.geometry(scene).opacity == Opacity::Opaque;
    objects.iter().any(opaque) && !objects.iter().all(opaque)
}

fn free_objects(scene: &Scene) -> Vec<Object> {
    let all = (0..scene.instances.len() as u32).map(InstanceId);
    objects(scene, all.filter(|i| scene.instances[i.0 as usize].pinned.is_none()))
}

fn isolated(scene: &Scene, all: Part) -> Vec<Part> {
    let Apart { shells, outliers } = apart(scene, &all.objects);
    let is_apart = |i: &usize| shells.binary_search(i).is_ok() || outliers.binary_search(i).is_ok();
    let rest: Vec<Object> = (0..all.objects.len()).filter(|i| !is_apart(i)).map(|i| all.objects[i]).collect();
    let shells = Part { name: "shells".to_owned(), objects: shells.iter().map(|&i| all.objects[i]).collect() };
    let alone = |&i: &usize| Part { name: all.objects[i].name(scene), objects: vec![all.objects[i]] };
    let outliers = outliers.iter().map(alone);
    [Part { name: all.name, objects: rest }, shells].into_iter().chain(outliers).collect()
}

fn by_opacity(scene: &Scene, part: Part) -> [Part; 2] {
    let is_opaque = |o: &Object| o.geometry(scene).opacity == Opacity::Opaque;
    let (opaque, others) = part.objects.into_iter().partition(is_opaque);
    [Part { name: part.name.clone(), objects: opaque }, Part { name: part.name + ", not opaque", objects: others }]
}

/// Divides by what may share a geometry, in material order.
fn by_key(scene: &Scene, part: Part) -> Vec<Part> {
    let mut by_key: BTreeMap<GeometryKey, Vec<Object>> = BTreeMap::new();
    for object in part.objects {
        by_key.entry(key(object.geometry(scene))).or_default().push(object);
    }
    by_key.into_values().map(|objects| Part { name: part.name.clone(), objects }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::layout::{Content, GroupGeometry, Layout};
    use crate::methods::{InstanceOptions, Method, Options, run};
    use glam::{DAffine3, Vec3};
    use proptest::prelude::*;

    /// Makes materials 1 and up not opaque.
    fn with_opacities(mut scene: Scene) -> Scene {
        for geometry in scene.meshes.iter_mut().flat_map(|m| &mut m.geometries) {
            geometry.opacity = match geometry.material {
                Some(1) => Opacity::Mask { cutoff: 0.5 },
                Some(2..) => Opacity::Blend,
                _ => Opacity::Opaque,
            };
        }
        scene
    }

    /// Returns the geometries of each group of placed triangles.
    fn baked(layout: &Layout) -> impl Iterator<Item = &[GroupGeometry]> {
        layout.groups.iter().filter_map(|g| match &g.content {
            Content::Baked { geometries, .. } => Some(geometries.as_slice()),
            _ => None,
        })
    }

    /// A street of houses with windows below a dome of one triangle, and a moon.
    fn street() -> Scene {
        let mut builder = SceneBuilder::default();
        (0..4).for_each(|i| builder.object("house", 0, row(Vec3::new(0.0, i as f32, 0.0), 400)));
        (0..2).for_each(|i| builder.object("window", 1, row(Vec3::new(0.0, i as f32, 0.5), 100)));
        let far = |x: f32, y: f32, z: f32| 1000.0 * Vec3::new(x, y, z);
        builder.object("sky", 2, vec![[far(-1.0, -1.0, -1.0), far(1.0, -1.0, 1.0), far(1.0, 1.0, 1.0)]]);
        builder.object("moon", 0, row(Vec3::Y * 1e5, 1));
        with_opacities(builder.scene())
    }

    /// Everything that the user can separate.
    const APART: PartOptions = PartOptions { isolate: true, split_opacity: true, one_geometry_per_group: false };

    fn told(parts: PartOptions) -> Options {
        Options { parts, ..Options::default() }
    }

    #[test]
    fn shells_and_outliers_become_groups_of_their_own() {
        let scene = street();
        let options = Options {
            parts: PartOptions { isolate: true, ..PartOptions::default() },
            instances: InstanceOptions { frames: false, ..InstanceOptions::default() },
            ..Options::default()
        };
        let layout = run(Method::Single, &scene, &options);
        assert_eq!(group_names(&layout), ["baked scene", "baked shells", "baked moon"]);
        assert_eq!(group_sizes(&scene, &layout), [1800, 1, 1]);
        let names = group_names(&run(Method::Cluster, &scene, &options));
        assert!(["baked shells", "baked moon"].iter().all(|name| names.iter().any(|n| n == name)), "{names:?}");
        assert!(isolates(&scene));
    }

    #[test]
    fn opacities_become_groups_of_their_own() {
        let scene = street();
        let options = told(PartOptions { split_opacity: true, ..PartOptions::default() });
        let layout = run(Method::Single, &scene, &options);
        assert_eq!(group_names(&layout), ["baked scene", "baked scene, not opaque"]);
        assert_eq!(group_sizes(&scene, &layout), [1601, 201]);
        assert!(opacities_differ(&scene));
    }

    #[test]
    fn nothing_to_divide_changes_nothing() {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("all", vec![(0, row(Vec3::ZERO, 30)), (0, row(Vec3::Y, 40))]);
        builder.place(mesh, "turned", DAffine3::from_rotation_x(1.0));
        let scene = builder.scene();
        assert!(!isolates(&scene) && !opacities_differ(&scene));
        for method in [Method::Single, Method::Cluster] {
            let plain = run(method, &scene, &Options::default());
            let divided = run(method, &scene, &told(APART));
            assert_eq!((plain.groups.len(), plain.placements), (divided.groups.len(), divided.placements));
            assert!(plain.groups.iter().zip(&divided.groups).all(|(a, b)| a.content == b.content));
        }
    }

    proptest! {
        #[test]
        fn opaque_triangles_never_share_a_geometry_with_others(scene in any_scene(), method in 0..Method::ALL.len()) {
            let scene = with_opacities(scene);
            let layout = run(Method::ALL[method], &scene, &Options::default());
            for group in &layout.groups {
                let (Content::Piece { geometries, .. } | Content::Baked { geometries, .. }) = &group.content else { continue };
                for geometry in geometries {
                    for at in &geometry.triangles {
                        let mesh = scene.mesh_of(InstanceId(at.instance));
                        let source = &mesh.geometries[mesh.locate(at.triangle).0];
                        prop_assert_eq!(source.opacity, geometry.opacity);
                    }
                }
            }
        }

        #[test]
        fn groups_are_as_pure_as_asked(scene in any_scene(), method in 0..2usize) {
            let scene = with_opacities(scene);
            let method = [Method::Single, Method::Cluster][method];
            let layout = run(method, &scene, &told(APART));
            prop_assert_eq!(layout.check(&scene), Ok(()));
            let pure = |g: &[GroupGeometry]| g.iter().all(|x| (x.opacity == Opacity::Opaque) == (g[0].opacity == Opacity::Opaque));
            prop_assert!(baked(&layout).all(pure));
            let layout = run(Method::Cluster, &scene, &told(PartOptions { one_geometry_per_group: true, ..APART }));
            prop_assert_eq!(layout.check(&scene), Ok(()));
            prop_assert!(baked(&layout).all(|g| g.len() == 1));
        }
    }
}
