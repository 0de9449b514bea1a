//! Seams: corners that groups share.
//!
//! A device takes a ray into each BLAS by the instance's own transform, which rounds. Rays find no gap between two
//! triangles only if both store their common corners bit for bit alike under the same transform: DirectX Raytracing
//! promises watertight edges for geometries of one BLAS with matching transforms alone. So groups that share a corner,
//! directly or through others, are placed in one frame, with one origin ([`classes`]), and only whole connected
//! components of the surface ([`Components`]) may have a frame of their own. What this costs: `docs/methods.md`.

use glam::DAffine3;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::{Content, Layout};
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::{InstanceId, Mesh, Scene, TriangleRef, position_key};
use crate::tree::Tree;

/// The keys of the corners of a placed triangle, at their places in the world.
pub(crate) fn corner_keys(scene: &Scene, at: TriangleRef) -> [u64; 3] {
    let origin = scene.origin(at);
    let corners = scene.meshes[origin.mesh.0 as usize].corners(origin.triangle);
    corners.map(|p| position_key(origin.transform.transform_point3(p.as_dvec3())))
}

/// Calls `visit` with a key and two different numbers that have it in common, so that all with a key are linked.
fn each_meeting(mut keyed: Vec<(u64, u32)>, mut visit: impl FnMut(u64, u32, u32)) {
    keyed.par_sort_unstable();
    for pair in keyed.windows(2).filter(|pair| pair[0].0 == pair[1].0 && pair[0].1 != pair[1].1) {
        visit(pair[0].0, pair[0].1, pair[1].1);
    }
}

/// The bits of the transform of an instance.
fn transform_bits(scene: &Scene, instance: usize) -> [u64; 12] {
    scene.instances[instance].transform.to_cols_array().map(f64::to_bits)
}

/// Disjoint sets of numbers (R. Tarjan, "Efficiency of a Good But Not Linear Set Union Algorithm", Journal of the ACM
/// 22(2), 1975); the smallest member stands for its set.
struct Sets(Vec<u32>);

impl Sets {
    fn new(count: usize) -> Sets {
        Sets((0..count as u32).collect())
    }

    /// The smallest member of a set; halves the path to it.
    fn root(&mut self, mut at: u32) -> u32 {
        let parents = &mut self.0;
        while parents[at as usize] != at {
            parents[at as usize] = parents[parents[at as usize] as usize];
            at = parents[at as usize];
        }
        at
    }

    fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }

    /// Unites all that have a key in common.
    fn unite_equal(&mut self, keyed: Vec<(u64, u32)>) {
        each_meeting(keyed, |_, a, b| self.unite(a, b));
    }

    /// The sets numbered in the order of their smallest members: the number of the set of each member.
    fn numbered(mut self) -> Vec<u32> {
        let (mut numbers, mut next) = (vec![0; self.0.len()], 0);
        for at in 0..self.0.len() as u32 {
            let root = self.root(at);
            if root == at {
                numbers[at as usize] = next;
                next += 1;
            } else {
                numbers[at as usize] = numbers[root as usize];
            }
        }
        numbers
    }
}

/// Connected components of some triangles: triangles that share a corner, directly or through others.
#[derive(Default)]
pub(crate) struct Components {
    /// The component of each triangle, in the order of their first triangles.
    of: Vec<u32>,
    /// Number of triangles of each component.
    sizes: Vec<u32>,
    /// Whether the component also has triangles outside, which cannot follow it into another frame.
    is_bound: Vec<bool>,
}

impl Components {
    /// The components of triangles given by the keys of their corners; those with a corner in `outside` are bound.
    pub(crate) fn of(corners: &[[u64; 3]], outside: &FxHashSet<u64>) -> Components {
        let keys_of = |(t, corners): (usize, &[u64; 3])| corners.map(|key| (key, t as u32));
        let keyed: Vec<(u64, u32)> =
            corners.par_iter().with_min_len(CHEAP_ELEMENTS).enumerate().flat_map_iter(keys_of).collect();
        let mut sets = Sets::new(corners.len());
        sets.unite_equal(keyed);
        let of = sets.numbered();
        let count = of.iter().max().map_or(0, |last| *last as usize + 1);
        let (mut sizes, mut is_bound) = (vec![0; count], vec![false; count]);
        for (&component, corners) in of.iter().zip(corners) {
            sizes[component as usize] += 1;
            is_bound[component as usize] |= !outside.is_empty() && corners.iter().any(|key| outside.contains(key));
        }
        Components { of, sizes, is_bound }
    }

    /// The components of a mesh's triangles.
    pub(crate) fn of_mesh(mesh: &Mesh) -> Components {
        let keys = |triangle: u32| mesh.corners(triangle).map(|p| position_key(p.as_dvec3()));
        let all = (0..mesh.triangle_count() as u32).into_par_iter().with_min_len(CHEAP_ELEMENTS);
        Components::of(&all.map(keys).collect::<Vec<_>>(), &FxHashSet::default())
    }

    /// The component of a triangle.
    pub(crate) fn component(&self, triangle: u32) -> u32 {
        self.of[triangle as usize]
    }

    /// The number of triangles of a component.
    pub(crate) fn size(&self, component: u32) -> usize {
        self.sizes[component as usize] as usize
    }

    /// The number of components.
    pub(crate) fn len(&self) -> usize {
        self.sizes.len()
    }

    /// The triangles of every component, in the order of their first triangles.
    pub(crate) fn all(&self) -> Vec<Vec<u32>> {
        let mut all: Vec<Vec<u32>> = self.sizes.iter().map(|&size| Vec::with_capacity(size as usize)).collect();
        (0..).zip(&self.of).for_each(|(t, &component)| all[component as usize].push(t));
        all
    }

    /// Those of [`Components::all`] that may have a frame of their own.
    pub(crate) fn free(&self) -> Vec<Vec<u32>> {
        let free = self.all().into_iter().zip(&self.is_bound).filter(|(_, bound)| !**bound);
        free.map(|(triangles, _)| triangles).collect()
    }

    /// Whether some triangles, each given once, are whole components that may have a frame of their own.
    pub(crate) fn are_closed(&self, triangles: &[u32]) -> bool {
        let mut components: Vec<u32> = triangles.iter().map(|&t| self.of[t as usize]).collect();
        components.sort_unstable();
        components.chunk_by(|a, b| a == b).all(|of_one| {
            let component = of_one[0] as usize;
            !self.is_bound[component] && of_one.len() == self.sizes[component] as usize
        })
    }

    /// For every node of a tree over the triangles, whether what is below it is whole components that may have a frame
    /// of their own.
    pub(crate) fn closed_nodes(&self, tree: &Tree) -> Vec<bool> {
        let mut places = vec![0; self.of.len()];
        let mut spans = vec![Span::NOTHING; self.sizes.len()];
        for (place, &t) in (0..).zip(&tree.order) {
            places[t as usize] = place;
            let span = &mut spans[self.of[t as usize] as usize];
            *span = span.with(Span { first: place, last: place });
        }
        // A bound component reaches beyond every node.
        spans.iter_mut().zip(&self.is_bound).filter(|(_, bound)| **bound).for_each(|(span, _)| *span = Span::ALL);
        let leaf = |items: &[u32]| {
            let own = Span { first: places[items[0] as usize], last: places[items[items.len() - 1] as usize] };
            (own, items.iter().fold(Span::NOTHING, |all, &t| all.with(spans[self.of[t as usize] as usize])))
        };
        let nodes = tree.refit(leaf, |a, b| (a.0.with(b.0), a.1.with(b.1)));
        nodes.into_iter().map(|(own, of_components)| own == of_components).collect()
    }
}

/// The first and the last of some places in the order of a tree.
#[derive(Clone, Copy, PartialEq)]
struct Span {
    first: u32,
    last: u32,
}

impl Span {
    const NOTHING: Span = Span { first: u32::MAX, last: 0 };
    const ALL: Span = Span { first: 0, last: u32::MAX };

    fn with(self, other: Span) -> Span {
        Span { first: self.first.min(other.first), last: self.last.max(other.last) }
    }
}

/// Baked groups of a layout that share corners, directly or through others.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Class {
    /// Indices of the groups, ascending.
    pub groups: Vec<u32>,
    /// World from mesh of instances that share corners with the groups and that the layout leaves as they are, although
    /// the input places some of the triangles baked by the same transform; each once.
    pub left: Vec<DAffine3>,
}

/// The classes of the baked groups of a layout, in the order of their first groups.
pub fn classes(scene: &Scene, layout: &Layout) -> Vec<Class> {
    let baked: Vec<u32> =
        (0..).zip(&layout.groups).filter(|(_, g)| matches!(g.content, Content::Baked { .. })).map(|(g, _)| g).collect();
    let mut keyed: Vec<(u64, u32)> = baked.par_iter().flat_map_iter(|&g| keys_of_group(scene, layout, g)).collect();
    let left = left_beside(scene, &baked_instances(scene, layout));
    let first_left = layout.groups.len() as u32;
    let keys_of_left = |(number, &instance): (usize, &InstanceId)| {
        let number = first_left + number as u32;
        keys_of_instance(scene, instance).map(move |key| (key, number))
    };
    keyed.par_extend(left.par_iter().enumerate().flat_map_iter(keys_of_left));
    let mut sets = Sets::new(layout.groups.len() + left.len());
    sets.unite_equal(keyed);
    let mut classes: Vec<Class> = Vec::new();
    let mut number_of = FxHashMap::default();
    for group in baked {
        let number = *number_of.entry(sets.root(group)).or_insert(classes.len());
        if number == classes.len() {
            classes.push(Class::default());
        }
        classes[number].groups.push(group);
    }
    for (number, instance) in (first_left..).zip(&left) {
        if let Some(&class) = number_of.get(&sets.root(number)) {
            let transform = scene.instances[instance.0 as usize].transform;
            if !classes[class].left.contains(&transform) {
                classes[class].left.push(transform);
            }
        }
    }
    classes
}

/// The keys of corners that several of some sets of triangles share.
pub(crate) fn shared_keys(scene: &Scene, sets: &[Vec<TriangleRef>]) -> FxHashSet<u64> {
    let mut keyed: Vec<(u64, u32)> = Vec::new();
    for (number, set) in (0..).zip(sets) {
        let keys = |&at: &TriangleRef| corner_keys(scene, at).map(|key| (key, number));
        keyed.par_extend(set.par_iter().with_min_len(CHEAP_ELEMENTS).flat_map_iter(keys));
    }
    let mut shared = FxHashSet::default();
    each_meeting(keyed, |key, _, _| {
        shared.insert(key);
    });
    shared
}

/// The keys of the corners of a baked group's triangles, each with the number of the group; some repeatedly.
fn keys_of_group(scene: &Scene, layout: &Layout, group: u32) -> impl Iterator<Item = (u64, u32)> {
    let geometries = layout.groups[group as usize].content.baked_geometries();
    let triangles = geometries.iter().flat_map(|g| &g.triangles);
    triangles.flat_map(move |&at| corner_keys(scene, at)).map(move |key| (key, group))
}

fn keys_of_instance(scene: &Scene, instance: InstanceId) -> impl Iterator<Item = u64> {
    let count = scene.mesh_of(instance).triangle_count() as u32;
    (0..count).flat_map(move |triangle| corner_keys(scene, TriangleRef { instance: instance.0, triangle }))
}

/// Whether a layout bakes instances that the input places by the same transform as others that the layout leaves as they
/// are, and that are not placed by the identity, so that what is baked in the coordinates of the world parts from them.
pub fn parts_from_what_stays(scene: &Scene, layout: &Layout) -> bool {
    left_beside(scene, &baked_instances(scene, layout))
        .iter()
        .any(|i| scene.instances[i.0 as usize].transform != DAffine3::IDENTITY)
}

/// The instances that are not baked and that the input places by the same transform as some that are.
pub(crate) fn left_beside(scene: &Scene, baked: &[InstanceId]) -> Vec<InstanceId> {
    let bits = |i: usize| transform_bits(scene, i);
    let mut is_baked = vec![false; scene.instances.len()];
    baked.iter().for_each(|i| is_baked[i.0 as usize] = true);
    let transforms: FxHashSet<[u64; 12]> = baked.iter().map(|i| bits(i.0 as usize)).collect();
    let beside = |i: &usize| !is_baked[*i] && transforms.contains(&bits(*i));
    (0..is_baked.len()).filter(beside).map(|i| InstanceId(i as u32)).collect()
}

/// The instances that a layout bakes: those that no placement names.
fn baked_instances(scene: &Scene, layout: &Layout) -> Vec<InstanceId> {
    let mut is_left = vec![false; scene.instances.len()];
    layout.placements.iter().filter_map(|p| p.instance).for_each(|i| is_left[i.0 as usize] = true);
    (0..is_left.len()).filter(|i| !is_left[*i]).map(|i| InstanceId(i as u32)).collect()
}

/// For each instance whether it shares a stored corner with another one that is placed by the same transform, so that
/// neither may be stored in another frame without the other.
pub(crate) fn touching(scene: &Scene) -> Vec<bool> {
    let mut of_transform: FxHashMap<[u64; 12], Vec<u32>> = FxHashMap::default();
    for i in 0..scene.instances.len() {
        of_transform.entry(transform_bits(scene, i)).or_default().push(i as u32);
    }
    let mut touching = vec![false; scene.instances.len()];
    for instances in of_transform.into_values().filter(|instances| instances.len() > 1) {
        let keys = |&i: &u32| {
            let geometries = scene.mesh_of(InstanceId(i)).geometries.iter();
            let used = geometries.flat_map(|g| g.triangles.iter().flatten().map(|&v| g.positions[v as usize]));
            used.map(move |p| (position_key(p.as_dvec3()), i))
        };
        let keyed: Vec<(u64, u32)> = instances.par_iter().flat_map_iter(keys).collect();
        each_meeting(keyed, |_, a, b| [a, b].into_iter().for_each(|i| touching[i as usize] = true));
    }
    touching
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::layout::test_scenes::*;
    use crate::scene::Bounds;
    use crate::tree::Quality;

    /// Strips of so many triangles each, in which neighbours share an edge, one above the other.
    fn strips(counts: &[usize]) -> Vec<[Vec3; 3]> {
        let corner = |y: f32, i: usize| Vec3::new((i / 2) as f32, y + (i % 2) as f32, 0.0);
        let strip = |(row, &count): (usize, &usize)| {
            let y = 10.0 * row as f32;
            (0..count).map(|i| [0, 1, 2].map(|k| corner(y, i + k))).collect::<Vec<_>>()
        };
        counts.iter().enumerate().flat_map(strip).collect()
    }

    fn keys(triangles: &[[Vec3; 3]]) -> Vec<[u64; 3]> {
        triangles.iter().map(|corners| corners.map(|p| position_key(p.as_dvec3()))).collect()
    }

    #[test]
    fn only_whole_components_are_closed() {
        let triangles = strips(&[3, 5, 2]);
        let none = FxHashSet::default();
        let components = Components::of(&keys(&triangles), &none);
        assert_eq!(components.all(), [vec![0, 1, 2], vec![3, 4, 5, 6, 7], vec![8, 9]]);
        assert!(components.are_closed(&[9, 2, 8, 0, 1]) && components.are_closed(&[]));
        assert!(!components.are_closed(&[3, 4, 5, 6]) && !components.are_closed(&[0, 1, 2, 9]));
        let outside = FxHashSet::from_iter([position_key(triangles[4][0].as_dvec3())]);
        let bound = Components::of(&keys(&triangles), &outside);
        assert_eq!(bound.free(), [vec![0, 1, 2], vec![8, 9]]);
        assert!(bound.are_closed(&[0, 1, 2]) && !bound.are_closed(&[3, 4, 5, 6, 7]));
    }

    #[test]
    fn nodes_of_a_tree_are_closed_as_the_triangles_below_are() {
        let triangles = strips(&[7, 1, 12, 30, 2]);
        let boxes: Vec<Bounds> = triangles.iter().map(|c| Bounds::of(c.map(|p| p.as_dvec3()))).collect();
        let tree = Tree::build(&boxes, Quality::Medium);
        let outside = FxHashSet::from_iter([position_key(triangles[7][0].as_dvec3())]);
        let components = Components::of(&keys(&triangles), &outside);
        let closed = components.closed_nodes(&tree);
        let expected = |node: u32| components.are_closed(&tree.order[tree.items_below(node)]);
        assert!((0..).zip(&closed).all(|(node, closed)| *closed == expected(node)));
        assert!(closed.contains(&true) && !closed[0]);
    }

    #[test]
    fn instances_touch_by_stored_corners_under_one_transform() {
        let mut builder = SceneBuilder::default();
        let [a, b] =
            [0.0, 1.0].map(|x| builder.mesh("strip", vec![(0, vec![[Vec3::X * x, Vec3::X * (x + 1.0), Vec3::Y]])]));
        builder.place(a, "a", at(5.0, 0.0, 0.0));
        builder.place(b, "b", at(5.0, 0.0, 0.0));
        builder.place(a, "moved", at(6.0, 0.0, 0.0));
        let far = builder.mesh("far", vec![(0, row(Vec3::Z, 1))]);
        builder.place(far, "far", at(5.0, 0.0, 0.0));
        assert_eq!(touching(&builder.scene()), [true, true, false, false]);
    }
}
