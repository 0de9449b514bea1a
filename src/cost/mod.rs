//! Trees over triangles and instances, and their cost.

pub mod boxes;
pub mod bytes;
pub mod core_overlap;
pub mod mesh_trees;
pub mod overlap;
pub mod sah;
pub mod segments;
pub mod structure;
pub mod surface;
pub mod two_level;

use boxes::BoxesPerPoint;
use mesh_trees::MeshTrees;
use structure::Structure;
use two_level::TwoLevelCost;

use crate::layout::Layout;
use crate::layout::store::Store;
use crate::scene::Scene;

/// The metrics of a layout.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Metrics {
    /// Mesh groups (BLASes).
    pub mesh_groups: u64,
    /// Geometries in them.
    pub geometries: u64,
    /// Instances (TLAS entries).
    pub instances: u64,
    /// Triangles stored; each group counts once.
    pub triangles_stored: u64,
    /// Triangles placed; each instance counts.
    pub triangles_placed: u64,
    /// Overlap ratio of the instances' world boxes, relative to the scene's box; best 0. See [`overlap`].
    pub overlap_ratio: f64,
    /// Overlap ratio of the instances in the core of the scene, relative to the core's box; best 0; equal to
    /// `overlap_ratio` if the core is the whole scene. See [`core_overlap`].
    pub core_overlap_ratio: f64,
    /// SAH cost of the two-level tree taken as one tree; lower is better. See [`TwoLevelCost::flat_cost`].
    pub sah_cost: f64,
    /// Two-level cost; lower is better. See [`TwoLevelCost::cost`].
    pub two_level_cost: f64,
    /// Mean number of instance boxes around a random surface point; best 1. See [`BoxesPerPoint`].
    pub boxes_per_point_mean: f64,
    /// 95th percentile.
    pub boxes_per_point_p95: f64,
    /// Maximum.
    pub boxes_per_point_max: f64,
    /// Predicted size of all compacted BLASes in bytes. See [`bytes`].
    pub blas_bytes: u64,
    /// Predicted size of the TLAS in bytes.
    pub tlas_bytes: u64,
}

impl Metrics {
    /// Returns the predicted size of all acceleration structures in bytes.
    pub fn as_bytes(&self) -> u64 {
        self.blas_bytes.saturating_add(self.tlas_bytes)
    }
}

/// Measures a layout of a scene. All metrics are finite; those relative to an area of 0 are 0.
pub fn measure(scene: &Scene, layout: &Layout) -> Metrics {
    measure_with(scene, layout, &MeshTrees::default())
}

/// Like [`measure`], with known trees of the scene's meshes.
pub fn measure_with(scene: &Scene, layout: &Layout, trees: &MeshTrees) -> Metrics {
    let structure = Structure::build_with(scene, layout, trees);
    let scene_area = scene.bounds().area();
    let costs = TwoLevelCost::of(&structure, layout);
    let boxes = BoxesPerPoint::of(&structure, &surface::points(scene, boxes::POINTS));
    let overlap_ratio = share(overlap::shared_area(&structure.boxes), scene_area);
    Metrics {
        overlap_ratio,
        core_overlap_ratio: match scene.core().is_whole() {
            true => overlap_ratio,
            false => core_overlap::ratio(scene, layout, &structure.boxes),
        },
        sah_cost: costs.flat_cost(scene_area),
        two_level_cost: costs.cost(scene_area),
        boxes_per_point_mean: boxes.mean,
        boxes_per_point_p95: boxes.p95,
        boxes_per_point_max: boxes.max,
        ..count(scene, layout)
    }
}

/// Fills in what can be counted without a tree: everything before the overlap ratio, and the bytes.
fn count(scene: &Scene, layout: &Layout) -> Metrics {
    let mut metrics = Metrics {
        mesh_groups: layout.groups.len() as u64,
        instances: layout.placements.len() as u64,
        tlas_bytes: bytes::tlas(layout.placements.len() as u64),
        ..Metrics::default()
    };
    let mut triangles = Vec::with_capacity(layout.groups.len());
    for group in &layout.groups {
        let held = Store::new(scene, &group.content);
        triangles.push(held.len() as u64);
        metrics.geometries += held.geometries() as u64;
        metrics.triangles_stored += held.len() as u64;
        metrics.blas_bytes = metrics.blas_bytes.saturating_add(bytes::blas(held.len() as u64));
    }
    metrics.triangles_placed = layout.placements.iter().map(|p| triangles[p.group as usize]).sum();
    metrics
}

/// Returns `part / of`; 0 if `of` is 0 or either is too large to divide.
fn share(part: f64, of: f64) -> f64 {
    let share = part / of;
    if of.is_finite() && share.is_finite() { share } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{Content, Group, GroupGeometry, Placement};
    use crate::scene::{Geometry, Instance, InstanceId, Mesh, MeshId, TriangleRef};
    use glam::{DAffine3, DVec3, Vec3, dvec3};

    pub(super) fn mesh(triangles: &[[Vec3; 3]]) -> Mesh {
        let indices = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let geometry = Geometry { positions: triangles.concat().into(), triangles: indices, ..Geometry::default() };
        Mesh { geometries: vec![geometry], ..Mesh::default() }
    }

    /// A square in the plane z = 0 of `n` by `n` unit squares of two triangles each.
    pub(super) fn grid_mesh(n: u32) -> Mesh {
        let square = |i: u32| {
            let at = |x: u32, y: u32| Vec3::new((i % n + x) as f32, (i / n + y) as f32, 0.0);
            [[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]
        };
        mesh(&(0..n * n).flat_map(square).collect::<Vec<_>>())
    }

    pub(super) fn instance(mesh: u32, transform: DAffine3) -> Instance {
        let name = String::new();
        Instance { name, node: 0, copy: 0, mesh: MeshId(mesh), transform, pinned: None }
    }

    pub(super) fn scene(meshes: Vec<Mesh>, instances: Vec<Instance>) -> Scene {
        Scene { meshes: meshes.into(), instances, ..Scene::default() }
    }

    /// Keeps each mesh and instance.
    pub(super) fn kept(scene: &Scene) -> Layout {
        let group = |m: usize| Group { name: String::new(), content: Content::Kept(MeshId(m as u32)) };
        let place = |(i, instance): (usize, &Instance)| Placement {
            group: instance.mesh.0,
            instance: Some(InstanceId(i as u32)),
            transform: instance.transform,
        };
        Layout {
            groups: (0..scene.meshes.len()).map(group).collect(),
            placements: scene.instances.iter().enumerate().map(place).collect(),
            ..Layout::default()
        }
    }

    /// Puts all triangles of all instances in one group.
    fn baked(scene: &Scene) -> Layout {
        let of_instance = |i: u32| {
            let count = scene.mesh_of(InstanceId(i)).triangle_count() as u32;
            (0..count).map(move |triangle| TriangleRef { instance: i, triangle })
        };
        let triangles = (0..scene.instances.len() as u32).flat_map(of_instance).collect();
        let geometries = vec![GroupGeometry { triangles, ..GroupGeometry::default() }];
        let content = Content::Baked { frame: DAffine3::IDENTITY, geometries };
        Layout {
            groups: vec![Group { name: String::new(), content }],
            placements: vec![Placement { group: 0, instance: None, transform: DAffine3::IDENTITY }],
            ..Layout::default()
        }
    }

    fn all_finite(m: &Metrics) -> bool {
        [
            m.overlap_ratio,
            m.core_overlap_ratio,
            m.sah_cost,
            m.two_level_cost,
            m.boxes_per_point_mean,
            m.boxes_per_point_p95,
        ]
        .iter()
        .all(|v| v.is_finite() && *v >= 0.0)
    }

    #[test]
    fn stacked_squares_measure_as_counted_by_hand() {
        let stacked = |z| instance(0, DAffine3::from_translation(dvec3(0.0, 0.0, z)));
        let scene = scene(vec![grid_mesh(2)], vec![stacked(0.0), stacked(0.0), stacked(1.0)]);
        let metrics = measure(&scene, &kept(&scene));
        assert_eq!((metrics.mesh_groups, metrics.geometries, metrics.instances), (1, 1, 3));
        assert_eq!((metrics.triangles_stored, metrics.triangles_placed), (8, 24));
        assert_eq!((metrics.blas_bytes, metrics.tlas_bytes), (bytes::blas(8), bytes::tlas(3)));
        assert_eq!(metrics.overlap_ratio, 8.0 / 16.0);
        assert!((metrics.boxes_per_point_mean - 5.0 / 3.0).abs() < 0.02);
        assert_eq!((metrics.boxes_per_point_p95, metrics.boxes_per_point_max), (2.0, 2.0));
        assert!(metrics.two_level_cost > metrics.sah_cost + two_level::INSTANCE_ENTRY);
    }

    #[test]
    fn baking_overlapping_instances_removes_overlap_and_entries() {
        let turned = |i: u32| DAffine3::from_rotation_z(0.3 * f64::from(i));
        let scene = scene(vec![grid_mesh(8)], (0..10).map(|i| instance(0, turned(i))).collect());
        let (before, after) = (measure(&scene, &kept(&scene)), measure(&scene, &baked(&scene)));
        assert!(before.overlap_ratio > 1.0 && after.overlap_ratio == 0.0);
        assert!(before.boxes_per_point_mean > 2.0 && after.boxes_per_point_max == 1.0);
        assert!(after.two_level_cost < before.two_level_cost);
        assert_eq!(after.triangles_stored, before.triangles_placed);
    }

    #[test]
    fn metrics_are_the_same_for_any_number_of_threads() {
        let turned = |i: u32| DAffine3::from_rotation_z(0.3 * f64::from(i));
        let scene = scene(vec![grid_mesh(8), grid_mesh(9)], (0..40).map(|i| instance(i % 2, turned(i))).collect());
        let with = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let [one, three] = [1, 3].map(|n| with(n).install(|| measure(&scene, &kept(&scene))));
        assert_eq!(one, three);
    }

    #[test]
    fn nothing_measures_zero() {
        assert_eq!(measure(&Scene::default(), &Layout::default()), Metrics::default());
    }

    #[test]
    fn singular_placements_measure_as_numbers() {
        let flat = [DVec3::ZERO, dvec3(1.0, 0.0, 1.0), dvec3(1.0, 0.0, 0.0)];
        for scale in flat {
            let singular = instance(0, DAffine3::from_scale(scale));
            let alone = scene(vec![grid_mesh(3)], vec![singular.clone()]);
            assert!(all_finite(&measure(&alone, &kept(&alone))));
            let beside = scene(vec![grid_mesh(3)], vec![instance(0, DAffine3::IDENTITY), singular]);
            let metrics = measure(&beside, &kept(&beside));
            assert!(all_finite(&metrics) && metrics.sah_cost > 0.0 && metrics.boxes_per_point_mean >= 1.0);
        }
    }

    #[test]
    fn extreme_scales_measure_as_any_other() {
        let at = |scale: f64| {
            let place = |x: f64| {
                instance(0, DAffine3::from_scale(DVec3::splat(scale)) * DAffine3::from_translation(dvec3(x, 0.0, x)))
            };
            let scene = scene(vec![grid_mesh(4)], vec![place(0.0), place(1.0), place(2.5)]);
            measure(&scene, &kept(&scene))
        };
        let expected = at(1.0);
        for scale in [1e-30, 1e30] {
            let actual = at(scale);
            for (a, e) in [
                (actual.overlap_ratio, expected.overlap_ratio),
                (actual.sah_cost, expected.sah_cost),
                (actual.two_level_cost, expected.two_level_cost),
            ] {
                assert!((a - e).abs() <= 1e-9 * e, "{a} for {e}");
            }
        }
        assert!(all_finite(&at(1e250)));
        assert!(all_finite(&at(1e-250)));
    }
}
