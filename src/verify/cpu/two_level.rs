//! A scene as two levels of trees, shared by the tracer and the reference.
//!
//! World and meshes are scaled by powers of two so that their largest coordinate lies in [1, 2). This is exact, and
//! keeps products of coordinates of 1e30 or 1e-30 within the range of single precision.

use std::borrow::Cow;
use std::hash::{BuildHasher, Hash, Hasher};
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;
use rustc_hash::{FxBuildHasher, FxHashMap, FxHashSet, FxHasher};

use super::boxes::{BoxNode, boxed, refit};
use crate::cost::mesh_trees::MeshTrees;
use crate::cost::sah::FaceAreas;
use crate::cost::two_level::TwoLevelCost;
use crate::parallel::{self, CHEAP_ELEMENTS};
use crate::scene::{Bounds, Geometry, Instance, Mesh, MeshId, Scene};
use crate::tree::{Quality, Tree};
use crate::verify::rounding::{Magnitude, SINGLE};

/// A bottom tree for each mesh, and a top tree over the instances.
#[derive(Debug, Default)]
pub struct TwoLevel {
    pub(super) bottom: Vec<Arc<Bottom>>,
    pub(super) top: Vec<BoxNode>,
    /// The instances that rays can enter, in the order of the top tree.
    pub(super) entries: Vec<Entry>,
    /// Scaled world units per world unit.
    pub(super) scale: f64,
    /// Largest coordinate of the top tree, in scaled world units.
    pub(super) reach: f64,
    /// Depth of the top tree and of the deepest bottom tree.
    pub(super) depth: [usize; 2],
}

/// The tree of a mesh.
#[derive(Debug, Default)]
pub(super) struct Bottom {
    pub(super) nodes: Vec<BoxNode>,
    /// Corners in tree order, scaled; of equal triangles in one geometry, only the first is kept.
    pub(super) corners: Vec<[Vec3; 3]>,
    /// Index in the mesh of each triangle in tree order; for equal triangles, that of the first.
    pub(super) order: Vec<u32>,
    /// Scaled mesh units per mesh unit.
    scale: f64,
    /// Box of the scaled corners.
    pub(super) bounds: Bounds,
    pub(super) depth: usize,
}

/// How far the boxes of instances extend beyond their contents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Padding {
    Nothing,
    /// Far enough for the error of transforming a ray into the mesh in single precision.
    AsRaysNeed,
}

/// An instance that rays can enter.
#[derive(Debug)]
pub(super) struct Entry {
    /// Index into the scene's instances.
    pub(super) instance: u32,
    pub(super) mesh: u32,
    /// Transform from the scaled mesh to the scaled world.
    pub(super) to_world: DAffine3,
    /// Transform from the scaled world to the scaled mesh.
    pub(super) to_mesh: DAffine3,
    pub(super) mirrored: bool,
}

impl TwoLevel {
    /// Builds the trees. Instances whose transform has no inverse are omitted, because no ray can enter them, and so are
    /// repetitions of an instance in the same place.
    pub fn build(scene: &Scene) -> TwoLevel {
        TwoLevel::build_with(scene, &MeshTrees::default())
    }

    /// Like [`TwoLevel::build`], with given trees of the meshes.
    pub fn build_with(scene: &Scene, trees: &MeshTrees) -> TwoLevel {
        TwoLevel::build_padded(scene, trees, Padding::AsRaysNeed)
    }

    /// Like [`TwoLevel::build_with`], with boxes of instances as tight as a driver's. Far from the origin, rays then
    /// miss a little at the ends of boxes, which does not change the cost, unlike padding as large as an object.
    pub fn build_to_count(scene: &Scene, trees: &MeshTrees) -> TwoLevel {
        TwoLevel::build_padded(scene, trees, Padding::Nothing)
    }

    fn build_padded(scene: &Scene, trees: &MeshTrees, padding: Padding) -> TwoLevel {
        let build = |m: usize| Arc::new(Bottom::build(&scene.meshes[m], trees.get(MeshId(m as u32))));
        TwoLevel::over(parallel::map(scene.meshes.len(), &build), scene, padding)
    }

    /// Places the meshes as a scene does, with boxes of instances that rays of [`super::CpuTracer`] do not miss.
    pub(crate) fn padded(self, scene: &Scene) -> TwoLevel {
        TwoLevel::over(self.bottom, scene, Padding::AsRaysNeed)
    }

    /// Builds the tree over the instances.
    fn over(bottom: Vec<Arc<Bottom>>, scene: &Scene, padding: Padding) -> TwoLevel {
        TwoLevel::over_instances(bottom, scene, distinct_instances(scene), padding)
    }

    /// Builds the tree over some of the instances.
    pub(super) fn over_instances(
        bottom: Vec<Arc<Bottom>>,
        scene: &Scene,
        instances: Vec<usize>,
        padding: Padding,
    ) -> TwoLevel {
        let extent = |i: &Instance| {
            let mesh = &bottom[i.mesh.0 as usize];
            largest_coordinate(&mesh.bounds.transformed(&scaled(&i.transform, 1.0, mesh.scale)))
        };
        let scale = unit_scale(scene.instances.iter().map(extent).fold(0.0, f64::max));
        let placed: Vec<(Entry, Bounds)> = instances
            .into_par_iter()
            .filter_map(|i| Entry::of(i, &scene.instances[i], &bottom, scale, padding))
            .collect();
        let (entries, boxes): (Vec<Entry>, Vec<Bounds>) = placed.into_iter().unzip();
        let tree = Tree::build(&boxes, Quality::Instances);
        let nodes = tree.bounds(&boxes);
        let mut by_index: Vec<Option<Entry>> = entries.into_iter().map(Some).collect();
        let deepest = bottom.iter().map(|b| b.depth).max().unwrap_or(0);
        TwoLevel {
            top: boxed(&tree, &nodes),
            entries: tree.order.iter().filter_map(|&i| by_index[i as usize].take()).collect(),
            scale,
            reach: boxes.iter().map(largest_coordinate).fold(0.0, f64::max),
            depth: [tree.depth(), deepest],
            bottom,
        }
    }
}

/// The box of a node of either level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelBox {
    /// The box, in coordinates of its own.
    pub bounds: Bounds,
    /// World from those coordinates.
    pub to_world: DAffine3,
}

impl TwoLevel {
    /// Returns up to `most` boxes of the nodes at a depth of both levels together: the root of the top tree has depth 0,
    /// and the children of its leaves are the roots of the meshes. A leaf of a mesh that is less deep counts too.
    pub(crate) fn boxes_at(&self, depth: u32, most: usize) -> Vec<LevelBox> {
        let mut found = Vec::new();
        let mut stack: Vec<(Option<usize>, u32, u32)> = if self.top.is_empty() { vec![] } else { vec![(None, 0, 0)] };
        while let Some((entry, at, level)) = stack.pop().filter(|_| found.len() < most) {
            let nodes = entry.map_or(&self.top, |e| &self.bottom[self.entries[e].mesh as usize].nodes);
            let node = &nodes[at as usize];
            match (node.count, entry) {
                (0, _) if level < depth => stack.extend([1, 0].map(|child| (entry, node.first + child, level + 1))),
                (1.., None) if level < depth => stack.extend(node.items().rev().map(|e| (Some(e), 0, level + 1))),
                _ => found.push(LevelBox { bounds: node.bounds(), to_world: self.to_world(entry) }),
            }
        }
        found
    }

    /// Returns world from the scaled world, or from the scaled mesh of an entry.
    fn to_world(&self, entry: Option<usize>) -> DAffine3 {
        let unscaled = DAffine3::from_scale(DVec3::splat(1.0 / self.scale));
        entry.map_or(unscaled, |entry| unscaled * self.entries[entry].to_world)
    }

    /// Returns the two-level cost of the trees over an area of the scene, see [`TwoLevelCost::cost`]. As boxes are
    /// rounded outward, it may be larger by a few parts in a million; padded instances add to it.
    pub fn cost(&self, scene_area: f64) -> f64 {
        let areas = |b: &Arc<Bottom>| FaceAreas::sum(b.nodes.iter().map(|node| (node.count, node.bounds())));
        let of_mesh: Vec<FaceAreas> = parallel::map_each(&self.bottom, &areas);
        let inner = self.top.iter().filter(|node| node.count == 0).map(|node| node.bounds().area());
        let leaves = self.top.iter().filter(|node| node.count > 0);
        let placed = leaves.flat_map(|leaf| self.entries[leaf.items()].iter().map(move |entry| (leaf, entry)));
        let cost_of = |(leaf, entry): (&BoxNode, &Entry)| {
            let areas = &of_mesh[entry.mesh as usize];
            TwoLevelCost::of_placement(leaf.bounds().area(), areas, &entry.to_world.matrix3)
        };
        TwoLevelCost::sum(inner, placed.map(cost_of)).cost(scene_area * self.scale * self.scale)
    }
}

impl Bottom {
    fn build(mesh: &Mesh, tree: Option<&Tree>) -> Bottom {
        let scale = scale_of(mesh);
        let bounds = |t: u32| Bounds::of(scaled_corners(mesh, t, scale).map(|p| p.as_dvec3()));
        let kept = distinct(mesh);
        let tree = match tree.filter(|tree| tree.order.len() == mesh.triangle_count()) {
            Some(tree) if tree.order.len() == kept.len() => Cow::Borrowed(tree),
            Some(tree) => Cow::Owned(tree.retaining(|triangle| kept.binary_search(&triangle).is_ok()).0),
            None => {
                let mut tree = Tree::build_from(kept.len(), Quality::Medium, &|i| bounds(kept[i as usize]));
                tree.order.iter_mut().for_each(|i| *i = kept[*i as usize]);
                Cow::Owned(tree)
            }
        };
        drop(kept);
        Bottom::of(mesh, tree, scale)
    }

    /// Builds the tree over all triangles, for a mesh that deforms: equal triangles may part.
    pub(super) fn build_all(mesh: &Mesh) -> Bottom {
        let scale = scale_of(mesh);
        let bounds = |t: u32| Bounds::of(scaled_corners(mesh, t, scale).map(|p| p.as_dvec3()));
        let tree = Tree::build_from(mesh.triangle_count(), Quality::Medium, &bounds);
        Bottom::of(mesh, Cow::Owned(tree), scale)
    }

    /// Returns the same tree over the deformed mesh; `None` if the mesh has outgrown the scale of the tree.
    pub(super) fn refitted(&self, mesh: &Mesh) -> Option<Bottom> {
        let corners: Vec<[Vec3; 3]> = self.order.iter().map(|&t| scaled_corners(mesh, t, self.scale)).collect();
        let mut nodes = self.nodes.clone();
        refit(&mut nodes, |items| Bounds::of(corners[items].iter().flatten().map(|p| p.as_dvec3())));
        let bounds = nodes.first().map_or(Bounds::EMPTY, BoxNode::bounds);
        let fits = largest_coordinate(&bounds) <= LARGEST;
        fits.then(|| Bottom { nodes, corners, bounds, order: self.order.clone(), ..*self })
    }

    fn of(mesh: &Mesh, tree: Cow<'_, Tree>, scale: f64) -> Bottom {
        let corners = |t: u32| scaled_corners(mesh, t, scale);
        let bounds = |t: u32| Bounds::of(corners(t).map(|p| p.as_dvec3()));
        let nodes = tree.refit(|items| items.iter().fold(Bounds::EMPTY, |b, &t| b.union(&bounds(t))), Bounds::union);
        Bottom {
            bounds: nodes.first().copied().unwrap_or(Bounds::EMPTY),
            nodes: boxed(&tree, &nodes),
            corners: tree.order.par_iter().with_min_len(CHEAP_ELEMENTS).map(|&t| corners(t)).collect(),
            depth: tree.depth(),
            order: tree.into_owned().order,
            scale,
        }
    }
}

/// Largest coordinate of a scaled mesh, which the padding of boxes relies on.
pub(super) const LARGEST: f64 = 2.0;

/// Returns the power of two that scales a mesh into the range of its tree.
fn scale_of(mesh: &Mesh) -> f64 {
    let largest = |g: &Geometry| {
        let corners = g.triangles.par_iter().flatten().map(|&v| g.positions[v as usize].abs().max_element());
        corners.reduce(|| 0.0, f32::max)
    };
    unit_scale(f64::from(mesh.geometries.iter().map(largest).fold(0.0, f32::max)))
}

fn scaled_corners(mesh: &Mesh, triangle: u32, scale: f64) -> [Vec3; 3] {
    mesh.corners(triangle).map(|p| (p.as_dvec3() * scale).as_vec3())
}

impl Entry {
    /// Returns the entry and its padded world box, as a driver computes it.
    pub(super) fn of(
        index: usize,
        instance: &Instance,
        bottom: &[Arc<Bottom>],
        scale: f64,
        padding: Padding,
    ) -> Option<(Entry, Bounds)> {
        let mesh = &bottom[instance.mesh.0 as usize];
        let to_world = scaled(&instance.transform, scale, mesh.scale);
        let to_mesh = inverse(&to_world)?;
        let tight = mesh.bounds.transformed(&to_world);
        let finite = !tight.is_empty() && tight.min.is_finite() && tight.max.is_finite();
        let largest = Magnitude::new(&to_world, &to_mesh, mesh.bounds.min.abs().max(mesh.bounds.max.abs()));
        let pad = match padding {
            Padding::Nothing => DVec3::ZERO,
            // The scaled world lies within two units of the origin.
            Padding::AsRaysNeed => {
                DVec3::splat((8.0 * SINGLE * largest.at(tight.min.abs().max(tight.max.abs()))).min(4.0))
            }
        };
        let entry =
            Entry { instance: index as u32, mesh: instance.mesh.0, mirrored: instance.mirrored(), to_world, to_mesh };
        finite.then_some((entry, Bounds { min: tight.min - pad, max: tight.max + pad }))
    }
}

/// Returns the instances of a scene, in order, except those that place the mesh of an earlier one, or an equal mesh, by
/// a transform equal bit for bit: the earlier one is hit at the same place and wins the tie. A hundred thousand
/// instances in one place would otherwise all be tested by every ray that meets them.
fn distinct_instances(scene: &Scene) -> Vec<usize> {
    let mut seen = FxHashSet::default();
    let equal = first_equal(scene);
    let key = |i: &Instance| (equal[i.mesh.0 as usize], i.transform.to_cols_array().map(f64::to_bits));
    (0..scene.instances.len()).filter(|&i| seen.insert(key(&scene.instances[i]))).collect()
}

/// Returns for each mesh the first one that rays cannot tell from it.
fn first_equal(scene: &Scene) -> Vec<usize> {
    let hash = |mesh: &Mesh| {
        let mut hasher = FxHasher::default();
        (0..mesh.triangle_count() as u32).for_each(|t| bits(mesh.corners(t)).hash(&mut hasher));
        hasher.finish()
    };
    let hashes: Vec<u64> = scene.meshes.par_iter().map(hash).collect();
    let mut firsts = FxHashMap::default();
    let first = |(number, hash): (usize, u64)| {
        let first = *firsts.entry(hash).or_insert(number);
        // Meshes whose hashes collide stay: an unnecessary test changes nothing.
        if are_equal(&scene.meshes[first], &scene.meshes[number]) { first } else { number }
    };
    hashes.into_iter().enumerate().map(first).collect()
}

/// Whether rays pass and hit two meshes alike, and see the same: the same triangles in the same order, with the same
/// materials and opacity.
fn are_equal(a: &Mesh, b: &Mesh) -> bool {
    let corners = |g: &Geometry, t: usize| bits(g.corners(t));
    let alike = |(a, b): (&Geometry, &Geometry)| {
        let count = a.triangles.len();
        let same_look = a.material == b.material && a.opacity == b.opacity && a.alpha == b.alpha;
        same_look && count == b.triangles.len() && (0..count).all(|t| corners(a, t) == corners(b, t))
    };
    a.geometries.len() == b.geometries.len() && a.geometries.iter().zip(&b.geometries).all(alike)
}

fn bits(corners: [Vec3; 3]) -> [[u32; 3]; 3] {
    corners.map(|p| p.to_array().map(f32::to_bits))
}

/// Returns the triangles of a mesh, in order, except those whose corners equal, bit for bit and in order, those of an
/// earlier triangle of the same geometry, which is hit at the same place and wins the tie.
fn distinct(mesh: &Mesh) -> Vec<u32> {
    let key = |t: u32| (mesh.locate(t).0, bits(mesh.corners(t)));
    let hash = |t: u32| FxBuildHasher.hash_one(key(t));
    let mut hashed: Vec<(u64, u32)> =
        (0..mesh.triangle_count() as u32).into_par_iter().with_min_len(CHEAP_ELEMENTS).map(|t| (hash(t), t)).collect();
    hashed.par_sort_unstable();
    // Triangles whose hashes collide stay: an unnecessary test changes nothing.
    let differ = |pair: &&[(u64, u32)]| pair[0].0 != pair[1].0 || key(pair[0].1) != key(pair[1].1);
    let later = hashed.windows(2).filter(differ).map(|pair| pair[1].1);
    let mut kept: Vec<u32> = hashed.first().map(|first| first.1).into_iter().chain(later).collect();
    kept.sort_unstable();
    kept
}

/// Returns the inverse of a transform, if it exists.
fn inverse(transform: &DAffine3) -> Option<DAffine3> {
    let inverse = transform.inverse();
    (transform.matrix3.determinant() != 0.0 && inverse.is_finite()).then_some(inverse)
}

/// Returns a transform between a scaled world and a scaled mesh.
fn scaled(transform: &DAffine3, world: f64, mesh: f64) -> DAffine3 {
    let m = transform.matrix3;
    let by = world / mesh;
    DAffine3 {
        matrix3: DMat3::from_cols(m.x_axis * by, m.y_axis * by, m.z_axis * by),
        translation: transform.translation * world,
    }
}

pub(super) fn largest_coordinate(bounds: &Bounds) -> f64 {
    if bounds.is_empty() { 0.0 } else { bounds.min.abs().max(bounds.max.abs()).max_element() }
}

/// Returns the power of two that scales a positive number into [1, 2); 1 for zero and non-finite numbers.
fn unit_scale(largest: f64) -> f64 {
    if largest.is_normal() {
        let exponent = i64::from((largest.to_bits() >> 52) as u32 & 0x7ff) - 1023;
        f64::from_bits(((1023 - exponent).clamp(1, 2046) as u64) << 52)
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Opacity;
    use crate::verify::test_scenes::{mesh, scene};

    #[test]
    fn unit_scale_is_the_power_of_two() {
        for x in [1.0, 1.5, 1e30, 1e-30, 3.0e-45, 1e300, 1e-300] {
            let s = unit_scale(x);
            assert!((1.0..2.0).contains(&(s * x)), "{x}");
            assert_eq!(s.to_bits() << 12, 0);
        }
        assert_eq!([0.0, f64::NAN, f64::INFINITY].map(unit_scale), [1.0; 3]);
    }

    #[test]
    fn equal_triangles_of_one_geometry_count_once() {
        let at = |x: f32| [Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 0.0, 0.0), Vec3::new(x, 1.0, 0.0)];
        let positions = [at(5.0), at(0.0), at(5.0), at(5.0), at(0.0)].concat();
        let triangles: Vec<[u32; 3]> = (0..5).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let turned = triangles.iter().map(|&[a, b, c]| [b, c, a]).collect();
        let flipped = triangles.iter().map(|&[a, b, c]| [a, c, b]);
        let both = triangles.iter().copied().chain(flipped).collect();
        let mesh = mesh(0, vec![(None, positions.clone(), both), (None, positions, turned)]);
        let mut order = Bottom::build(&mesh, None).order;
        order.sort_unstable();
        assert_eq!(order, [0, 1, 5, 6, 10, 11]);
    }

    #[test]
    fn equal_instances_of_equal_meshes_count_once() {
        let mesh = |source, y| mesh(source, vec![(None, vec![Vec3::ZERO, Vec3::X, y], vec![[0, 1, 2]])]);
        let meshes = vec![mesh(0, Vec3::Y), mesh(1, Vec3::Y), mesh(2, Vec3::Z), mesh(3, Vec3::Y)];
        let at = |mesh, x: f64| (mesh, DAffine3::from_translation(DVec3::X * x));
        let places = [at(0, 0.0), at(1, 0.0), at(0, 0.0), at(0, 1.0), at(1, 0.0), at(2, 0.0), at(3, 0.0)];
        let mut scene = scene(meshes, &places);
        assert_eq!(distinct_instances(&scene), [0, 3, 5]);
        assert_eq!(TwoLevel::build(&scene).entries.len(), 3);
        scene.meshes[3].geometries[0].opacity = Opacity::Blend;
        assert_eq!(distinct_instances(&scene), [0, 3, 5, 6], "rays tell another opacity");
    }

    #[test]
    fn nothing_gives_nothing() {
        let empty = TwoLevel::build(&Scene::default());
        assert!(empty.top.is_empty() && empty.entries.is_empty());
    }
}
