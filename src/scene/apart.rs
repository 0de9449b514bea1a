//! Finds objects that are better kept out of a group of all objects: those that enclose the rest, and those far outside
//! it.
//!
//! In one BLAS, a sky dome or a cube at the horizon makes the boxes of the topmost nodes large and empty, and the grids
//! to which builders quantise positions coarse. If they are separate objects, they are isolated:
//!
//! - **Outliers.** The core of the scene is the smallest cube around the median of all triangles that holds at least
//!   [`CORE`] of them, object by object. Objects outside a cube [`FAR`] times as large are outliers, unless there are
//!   more than [`MOST_OUTLIERS`] of them: then they are not exceptional.
//! - **Shells**: among the others, largest first, an object whose box covers at least [`COVERED`] of the box of all
//!   objects that are not isolated, by surface area, while holding few triangles: all shells together at most [`FEW`]
//!   of the scene's. Examples are sky domes, the walls of a room and large thin objects that overlap everything.
//!
//! Sorting n objects takes O(n log n) time; computing boxes takes time linear in the triangles stored and the objects.

use glam::DAffine3;
use rayon::prelude::*;

use super::object::Object;
use super::{Bounds, Geometry, Mesh, Scene};
use crate::parallel;

/// Share of the triangles in the core of a scene.
const CORE: f64 = 0.999;

/// Outliers start at this many times the distance that the core reaches from the median.
const FAR: f64 = 4.0;

/// Maximum number of outliers.
const MOST_OUTLIERS: usize = 64;

/// Share of the rest's box that a shell's box covers, by surface area.
const COVERED: f64 = 0.9;

/// Maximum share of the triangles in shells.
const FEW: f64 = 0.01;

/// Surface area of a shell's box over that of the rest's box from which on the shell is outside the core. Walls and thin
/// objects that are strewn over the whole scene are shells too, but hardly larger than the rest: they leave shares of
/// the scene's area as they are, and their overlap with the rest is one that a layout can lower.
const DOME: f64 = 4.0;

/// Triangles per task.
const CHUNK: usize = 1 << 14;

/// The objects to isolate, as indices into a list of objects, each list in ascending order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Apart {
    /// Objects that enclose the rest.
    pub(crate) shells: Vec<usize>,
    /// Objects that lie far outside.
    pub(crate) outliers: Vec<usize>,
}

impl Apart {
    /// Whether nothing is isolated.
    pub(crate) fn is_empty(&self) -> bool {
        self.shells.is_empty() && self.outliers.is_empty()
    }
}

/// An object's world box and number of triangles.
#[derive(Clone, Copy)]
struct Extent {
    bounds: Bounds,
    triangles: usize,
}

/// Returns which objects to isolate. Objects without a finite box stay with the others.
pub(crate) fn apart(scene: &Scene, objects: &[Object]) -> Apart {
    apart_by(&extents(scene, objects))
}

/// Returns the objects that blow up the box of all: outliers, and shells whose box is at least [`DOME`] times as large as
/// that of the objects that are not isolated.
pub(super) fn exceptional(scene: &Scene, objects: &[Object]) -> Apart {
    let extents = extents(scene, objects);
    let Apart { mut shells, outliers } = apart_by(&extents);
    let stays = |i: &usize| shells.binary_search(i).is_err() && outliers.binary_search(i).is_err();
    let rest = (0..objects.len()).filter(stays).fold(Bounds::EMPTY, |all, i| all.union(&extents[i].bounds));
    shells.retain(|&i| extents[i].bounds.area() >= DOME * rest.area());
    Apart { shells, outliers }
}

fn apart_by(extents: &[Extent]) -> Apart {
    let usable = |&i: &usize| !extents[i].bounds.is_empty() && extents[i].bounds.area().is_finite();
    let mut rest: Vec<usize> = (0..extents.len()).filter(usable).collect();
    let outliers = outliers(extents, &rest);
    rest.retain(|i| outliers.binary_search(i).is_err());
    Apart { shells: shells(extents, rest), outliers }
}

/// Returns the boxes of objects: for objects whose mesh is placed once, the box of their triangles; for others, the
/// world box of their box, so that the work is not proportional to the triangles placed.
fn extents(scene: &Scene, objects: &[Object]) -> Vec<Extent> {
    let mut uses = vec![0u32; scene.meshes.len()];
    scene.instances.iter().for_each(|i| uses[i.mesh.0 as usize] += 1);
    let boxes_of = |(mesh, &uses): (&Mesh, &u32)| match uses {
        0 | 1 => Vec::new(),
        _ => mesh.geometries.iter().map(Geometry::bounds).collect::<Vec<Bounds>>(),
    };
    let shared: Vec<Vec<Bounds>> = scene.meshes.par_iter().zip(&uses).map(boxes_of).collect();
    let bounds = |object: &Object| {
        let instance = &scene.instances[object.instance as usize];
        match shared[instance.mesh.0 as usize].get(object.geometry as usize) {
            Some(bounds) => bounds.transformed(&instance.transform),
            None => world_bounds(object.geometry(scene), &instance.transform),
        }
    };
    let extent = |o: &Object| Extent { bounds: bounds(o), triangles: o.geometry(scene).triangles.len() };
    parallel::map_each(objects, &extent)
}

/// Returns the box around the placed triangles of a geometry.
fn world_bounds(geometry: &Geometry, transform: &DAffine3) -> Bounds {
    let point = |&vertex: &u32| transform.transform_point3(geometry.positions[vertex as usize].as_dvec3());
    let of_chunk = |chunk: &[[u32; 3]]| Bounds::of(chunk.iter().flatten().map(point));
    geometry.triangles.par_chunks(CHUNK).map(of_chunk).reduce(|| Bounds::EMPTY, |a, b| a.union(&b))
}

/// Returns the outliers among some objects.
fn outliers(extents: &[Extent], among: &[usize]) -> Vec<usize> {
    let total: usize = among.iter().map(|&i| extents[i].triangles).sum();
    let middle = glam::DVec3::from([0, 1, 2].map(|axis| median(extents, among, axis, total)));
    // The largest distance of a coordinate from the median, for the farthest and for the nearest point of a box.
    let reach = |i: usize| (extents[i].bounds.max - middle).max(middle - extents[i].bounds.min).max_element();
    let gap = |i: usize| (extents[i].bounds.min - middle).max(middle - extents[i].bounds.max).max_element();
    let mut by_reach = among.to_vec();
    by_reach.sort_by(|&a, &b| reach(a).total_cmp(&reach(b)).then(a.cmp(&b)));
    let mut held = 0;
    let core = by_reach.iter().position(|&i| {
        held += extents[i].triangles;
        held as f64 >= CORE * total as f64
    });
    let Some(core) = core else { return Vec::new() };
    let far = FAR * reach(by_reach[core]);
    let mut outliers: Vec<usize> = by_reach[core + 1..].iter().copied().filter(|&i| gap(i) > far).collect();
    if outliers.len() > MOST_OUTLIERS {
        return Vec::new();
    }
    outliers.sort_unstable();
    outliers
}

/// Returns the coordinate of the middle triangle when objects are ordered by the centres of their boxes; 0 without
/// triangles.
fn median(extents: &[Extent], among: &[usize], axis: usize, total: usize) -> f64 {
    let mut middles: Vec<(f64, usize)> =
        among.iter().map(|&i| (extents[i].bounds.center()[axis], extents[i].triangles)).collect();
    middles.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut held = 0;
    let middle = middles.iter().find(|(_, triangles)| {
        held += triangles;
        2 * held >= total
    });
    middle.map_or(0.0, |m| m.0)
}

/// Returns the shells among some objects.
fn shells(extents: &[Extent], mut among: Vec<usize>) -> Vec<usize> {
    let area = |i: usize| extents[i].bounds.area();
    among.sort_by(|&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));
    let total: usize = among.iter().map(|&i| extents[i].triangles).sum();
    let mut left = (FEW * total as f64) as usize;
    // The box of all objects from each place in the order on.
    let mut from: Vec<Bounds> = vec![Bounds::EMPTY; among.len() + 1];
    for (place, &i) in among.iter().enumerate().rev() {
        from[place] = from[place + 1].union(&extents[i].bounds);
    }
    let mut larger = Bounds::EMPTY;
    let mut shells = Vec::new();
    for (place, &i) in among.iter().enumerate() {
        let Extent { bounds, triangles } = extents[i];
        let rest = larger.union(&from[place + 1]);
        let covered = bounds.intersection(&rest).area() >= COVERED * rest.area();
        if triangles <= left && covered && !rest.is_empty() {
            left -= triangles;
            shells.push(i);
        } else {
            larger = larger.union(&bounds);
        }
    }
    shells.sort_unstable();
    shells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::scene::InstanceId;
    use crate::scene::object::objects;
    use glam::Vec3;

    fn apart_of(builder: SceneBuilder) -> Apart {
        let scene = builder.scene();
        let instances = (0..scene.instances.len() as u32).map(InstanceId);
        apart(&scene, &objects(&scene, instances))
    }

    /// Two triangles whose box is a cube of the given size around a point.
    fn open_box(center: Vec3, size: f32) -> Vec<[Vec3; 3]> {
        let [low, high] = [center - 0.5 * size, center + 0.5 * size];
        let at = |x, y, z| Vec3::new(x, y, z);
        vec![[low, at(high.x, low.y, low.z), high], [low, at(low.x, high.y, high.z), high]]
    }

    /// Ten rows of a hundred triangles.
    fn town() -> SceneBuilder {
        let mut builder = SceneBuilder::default();
        (0..10).for_each(|i| builder.object("house", 0, row(Vec3::new(0.0, i as f32, 3.0 * i as f32), 100)));
        builder
    }

    #[test]
    fn nothing_is_apart_of_nothing() {
        assert!(apart_of(SceneBuilder::default()).is_empty());
    }

    #[test]
    fn objects_side_by_side_stay_together() {
        assert!(apart_of(town()).is_empty());
        let mut lone = SceneBuilder::default();
        lone.object("lone", 0, row(Vec3::ZERO, 1));
        assert!(apart_of(lone).is_empty());
    }

    #[test]
    fn domes_in_domes_are_shells() {
        let mut builder = town();
        builder.object("sky", 0, open_box(Vec3::new(50.0, 0.0, 0.0), 300.0));
        builder.object("stars", 0, open_box(Vec3::new(50.0, 0.0, 0.0), 900.0));
        assert_eq!(apart_of(builder), Apart { shells: vec![10, 11], outliers: vec![] });
    }

    #[test]
    fn a_detailed_hull_is_no_shell() {
        let mut builder = town();
        let hull = (0..50).flat_map(|_| open_box(Vec3::new(50.0, 0.0, 0.0), 300.0)).collect();
        builder.object("hull", 0, hull);
        assert!(apart_of(builder).is_empty());
    }

    #[test]
    fn a_far_object_is_an_outlier_and_the_dome_around_the_rest_still_a_shell() {
        let mut builder = town();
        builder.object("sky", 0, open_box(Vec3::new(50.0, 0.0, 0.0), 300.0));
        builder.object("moon", 0, row(Vec3::new(1e5, 0.0, 0.0), 1));
        assert_eq!(apart_of(builder), Apart { shells: vec![10], outliers: vec![11] });
    }

    #[test]
    fn instances_of_a_mesh_are_set_apart_like_others() {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("tree", vec![(0, row(Vec3::ZERO, 2))]);
        (0..2000).for_each(|i| drop(builder.place(mesh, "tree", at(0.0, f64::from(i), 0.0)).name.clone()));
        builder.place(mesh, "far tree", at(1e6, 0.0, 0.0));
        assert_eq!(apart_of(builder), Apart { shells: vec![], outliers: vec![2000] });
    }

    #[test]
    fn many_far_objects_are_no_exceptions() {
        let mut builder = SceneBuilder::default();
        builder.object("middle", 0, row(Vec3::ZERO, 100_000));
        (0..65).for_each(|i| builder.object("star", 0, row(Vec3::new(0.0, 1e7, 1e6 * i as f32), 1)));
        assert!(apart_of(builder).is_empty());
    }

    #[test]
    fn the_rule_does_not_depend_on_the_unit() {
        for scale in [1e-30, 1.0, 1e25] {
            let mut builder = SceneBuilder::default();
            let scaled = |t: Vec<[Vec3; 3]>| t.into_iter().map(|c| c.map(|p| scale * p)).collect::<Vec<_>>();
            builder.object("town", 0, scaled(row(Vec3::ZERO, 2000)));
            builder.object("sky", 0, scaled(open_box(Vec3::new(1000.0, 0.0, 0.0), 3000.0)));
            builder.object("moon", 0, scaled(row(Vec3::new(0.0, 1e6, 0.0), 1)));
            assert_eq!(apart_of(builder), Apart { shells: vec![1], outliers: vec![2] }, "{scale}");
        }
    }
}
