//! The acceleration structures of a layout: a tree over the triangles of each group, and one over its placements.

use super::mesh_trees::MeshTrees;
use super::sah::FaceAreas;
use crate::layout::store::Store;
use crate::layout::{Content, Group, Layout, Placement};
use crate::parallel;
use crate::scene::{Bounds, Scene};
use crate::tree::{Quality, Tree};

/// The trees of a layout, as a driver might build them.
#[derive(Clone, Debug, Default)]
pub struct Structure {
    /// The tree of each group of the layout.
    pub blas: Vec<Blas>,
    /// For each placement, the world box of its group's box, as a driver sees it; empty for an empty group.
    pub boxes: Vec<Bounds>,
    /// The tree over `boxes`, one per leaf; omits boxes that are empty or not finite.
    pub tlas: Tree,
}

/// The tree over the triangles of a group.
#[derive(Clone, Debug, Default)]
pub struct Blas {
    /// Item `i` is the group's triangle `i` in the numbering of [`Store`].
    pub tree: Tree,
    /// The box around all triangles, in group space.
    pub bounds: Bounds,
    /// The surface areas of its nodes, in group space.
    pub areas: FaceAreas,
}

impl Structure {
    /// Builds the trees of a layout; equal input gives equal trees.
    pub fn build(scene: &Scene, layout: &Layout) -> Structure {
        Structure::build_with(scene, layout, &MeshTrees::default())
    }

    /// Like [`Structure::build`], with known trees of the scene's meshes.
    pub fn build_with(scene: &Scene, layout: &Layout, trees: &MeshTrees) -> Structure {
        let blas: Vec<Blas> = parallel::map_each(&layout.groups, &|group| Blas::build(scene, group, trees));
        let world_box = |p: &Placement| blas[p.group as usize].bounds.transformed(&p.transform);
        let boxes: Vec<Bounds> = layout.placements.iter().map(world_box).collect();
        let tlas = Tree::build_usable(&boxes, Quality::Instances);
        Structure { blas, boxes, tlas }
    }
}

impl Blas {
    /// Returns the tree of a group: that of the mesh if the group keeps it and it is known, else a new one.
    fn build(scene: &Scene, group: &Group, trees: &MeshTrees) -> Blas {
        let triangles = Store::new(scene, &group.content);
        let known = match group.content {
            Content::Kept(mesh) => trees.get(mesh).cloned(),
            Content::Piece { .. } | Content::Baked { .. } => None,
        };
        let bounds_of = |t: u32| Bounds::of(triangles.corners(t as usize));
        let tree = known.unwrap_or_else(|| Tree::build_from(triangles.len(), Quality::Medium, &bounds_of));
        let around = |items: &[u32]| items.iter().fold(Bounds::EMPTY, |all, &t| all.union(&bounds_of(t)));
        let bounds = tree.refit(around, Bounds::union);
        Blas { areas: FaceAreas::of(&tree, &bounds), bounds: bounds.first().copied().unwrap_or(Bounds::EMPTY), tree }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::tests::{grid_mesh, instance, kept, scene};
    use crate::scene::MeshId;
    use glam::{DAffine3, DVec3};

    #[test]
    fn empty_and_infinite_groups_stay_out_of_the_tlas() {
        let huge = DAffine3::from_scale(DVec3::splat(1e300));
        let scene = scene(vec![grid_mesh(2)], vec![instance(0, DAffine3::IDENTITY), instance(0, huge)]);
        let mut layout = kept(&scene);
        layout.groups.push(Group {
            name: String::new(),
            content: Content::Piece { mesh: MeshId(0), frame: DAffine3::IDENTITY, geometries: vec![] },
        });
        layout.placements.push(Placement { group: 1, instance: None, transform: DAffine3::IDENTITY });
        let structure = Structure::build(&scene, &layout);
        assert_eq!(structure.tlas.order, [0]);
        assert!(structure.boxes[2].is_empty());
        assert_eq!(structure.blas[1].tree, Tree::default());
    }
}
