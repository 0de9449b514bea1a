//! Trees over placed triangles, kept from the method that built them to make its decisions.
//!
//! Layouts made with them are later ranked, sorted and verified, all of which would rebuild the same trees.

use glam::DMat3;

use crate::layout::{Content, GroupGeometry, axes};
use crate::scene::{InstanceId, Scene, TriangleRef};
use crate::tree::Tree;

/// Trees over the same triangles, each with boxes in its own frame. Trees take about 20 bytes per triangle.
#[derive(Clone, Debug, Default)]
pub struct PlacedTrees {
    triangles: Vec<TriangleRef>,
    /// World from the tree's frame, and the tree, whose item `i` is `triangles[i]`.
    trees: Vec<(DMat3, Tree)>,
}

impl PlacedTrees {
    /// Creates trees in distinct frames; item `i` is `triangles[i]`.
    pub(crate) fn new(triangles: Vec<TriangleRef>, trees: Vec<(DMat3, Tree)>) -> PlacedTrees {
        PlacedTrees { triangles, trees }
    }

    /// Returns the number of triangles.
    pub(crate) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Returns the tree of a baked group, whose item `i` is the group's triangle `i`: a known tree without the
    /// triangles that the group lacks. `None` if there is no tree along the axes of the group's frame, if the group
    /// holds other triangles, or if it holds less than half of the known ones, for which a new tree is better.
    pub fn of_group(&self, scene: &Scene, content: &Content) -> Option<Tree> {
        let Content::Baked { frame, geometries } = content else { return None };
        let (_, known) = self.trees.iter().find(|(rotation, _)| axes::are_alike(rotation, &frame.matrix3))?;
        let count: usize = geometries.iter().map(|g| g.triangles.len()).sum();
        if 2 * count < self.len() {
            return None;
        }
        let places = Places::of(scene, geometries);
        let place = |item: u32| places.get(self.triangles[item as usize]);
        let mut tree = match count == known.order.len() {
            true => known.clone(),
            false => known.retaining(|item| place(item).is_some()).0,
        };
        for item in &mut tree.order {
            *item = place(*item)?;
        }
        (tree.order.len() == count).then_some(tree)
    }
}

/// Positions of the triangles of a group, counted through its geometries.
struct Places {
    /// For each instance, the index in `places` of its mesh's first triangle; [`NONE`] if the group holds none of its
    /// triangles.
    first: Vec<u32>,
    places: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Places {
    fn of(scene: &Scene, geometries: &[GroupGeometry]) -> Places {
        let mut of = Places { first: vec![NONE; scene.instances.len()], places: Vec::new() };
        for (at, place) in geometries.iter().flat_map(|g| &g.triangles).zip(0..) {
            let first = &mut of.first[at.instance as usize];
            if *first == NONE {
                *first = of.places.len() as u32;
                let count = scene.mesh_of(InstanceId(at.instance)).triangle_count();
                of.places.resize(of.places.len() + count, NONE);
            }
            of.places[(*first + at.triangle) as usize] = place;
        }
        of
    }

    fn get(&self, at: TriangleRef) -> Option<u32> {
        let first = Some(self.first[at.instance as usize]).filter(|&first| first != NONE)?;
        Some(self.places[(first + at.triangle) as usize]).filter(|&place| place != NONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::sah;
    use crate::layout::Layout;
    use crate::layout::test_scenes::*;
    use crate::methods::{Cache, Method, Options, run, run_with};
    use crate::scene::Bounds;
    use crate::tree::Quality;
    use glam::{DAffine3, Vec3};

    fn grids() -> Scene {
        let mut builder = SceneBuilder::default();
        for i in 0..6 {
            builder.object("object", i % 2, row(Vec3::new((i * 7 % 5) as f32, i as f32, 0.0), 300));
        }
        builder.scene()
    }

    /// The trees kept from clustering a scene.
    fn left_behind(scene: &Scene) -> PlacedTrees {
        let mut cache = Cache::default();
        run_with(&mut cache, Method::Cluster, scene, &Options::default());
        cache.into_trees()
    }

    fn boxes(scene: &Scene, content: &Content) -> Vec<Bounds> {
        let Content::Baked { geometries, .. } = content else { panic!("not baked") };
        geometries.iter().flat_map(|g| &g.triangles).map(|&at| Bounds::of(scene.world_corners(at))).collect()
    }

    fn single(scene: &Scene) -> Layout {
        run(Method::Single, scene, &Options::default())
    }

    #[test]
    fn one_group_over_all_has_the_tree_that_clustering_built() {
        let scene = grids();
        let layout = single(&scene);
        let content = &layout.groups[0].content;
        let boxes = boxes(&scene, content);
        let tree = left_behind(&scene).of_group(&scene, content).expect("it is known");
        let mut items = tree.order.clone();
        items.sort_unstable();
        assert!(items.into_iter().eq(0..boxes.len() as u32));
        let built = Tree::build(&boxes, Quality::Medium);
        assert!(sah::cost(&tree, &boxes) < 1.02 * sah::cost(&built, &boxes));
    }

    #[test]
    fn a_group_that_lacks_some_has_what_is_left_of_it() {
        let scene = grids();
        let trees = left_behind(&scene);
        let mut content = single(&scene).groups.swap_remove(0).content;
        let Content::Baked { geometries, .. } = &mut content else { panic!("not baked") };
        geometries[0].triangles.retain(|at| at.triangle % 3 > 0);
        let boxes = boxes(&scene, &content);
        let tree = trees.of_group(&scene, &content).expect("most of it is known");
        assert_eq!(tree.order.len(), boxes.len());
        let built = Tree::build(&boxes, Quality::Medium);
        assert!(sah::cost(&tree, &boxes) < 1.1 * sah::cost(&built, &boxes));
    }

    #[test]
    fn no_tree_is_known_of_other_triangles_or_frames_or_of_a_few() {
        let scene = grids();
        let trees = left_behind(&scene);
        let layout = single(&scene);
        let Content::Baked { geometries, .. } = &layout.groups[0].content else { panic!("not baked") };
        let baked = |frame, change: fn(&mut Vec<TriangleRef>)| {
            let mut geometries = geometries.clone();
            geometries.iter_mut().for_each(|g| change(&mut g.triangles));
            Content::Baked { frame, geometries }
        };
        let turned = DAffine3::from_rotation_z(0.5);
        assert!(trees.of_group(&scene, &baked(DAffine3::IDENTITY, |_| ())).is_some());
        assert!(trees.of_group(&scene, &baked(turned, |_| ())).is_none());
        assert!(trees.of_group(&scene, &baked(DAffine3::IDENTITY, |t| t.truncate(100))).is_none());
        let twice: fn(&mut Vec<TriangleRef>) = |t| (t[0], t[2]) = (t[1], t[3]);
        assert!(trees.of_group(&scene, &baked(DAffine3::IDENTITY, twice)).is_none());
        let kept = run(Method::Keep, &scene, &Options::default());
        assert!(trees.of_group(&scene, &kept.groups[0].content).is_none());
        assert!(PlacedTrees::default().of_group(&scene, &layout.groups[0].content).is_none());
    }
}
