//! Trees over the triangles of a scene's meshes, built once and shared.

use std::sync::Arc;

use glam::Vec3;

use crate::layout::{Content, Layout, PlacedTrees};
use crate::parallel;
use crate::scene::{Bounds, Geometry, Mesh, MeshId, Scene};
use crate::tree::{Quality, Tree};

/// For each mesh of a scene, the tree over its triangles in mesh coordinates, where item `i` is triangle `i`; `None` if
/// users must build it themselves. Trees of large scenes take about 8 bytes per triangle.
#[derive(Clone, Debug, Default)]
pub struct MeshTrees(Vec<Option<Arc<Tree>>>);

impl MeshTrees {
    /// Builds the trees of all meshes.
    pub fn build(scene: &Scene) -> MeshTrees {
        MeshTrees(parallel::map(scene.meshes.len(), &|m| Some(Arc::new(tree(&scene.meshes[m])))))
    }

    /// Returns the trees of `scene`, which was read from the output written for the scene `of`, whose trees are `self`.
    /// A tree is shared if the mesh has the same triangles, bit for bit, as the mesh with the same index in `of`, and
    /// built otherwise. `written` holds the known trees of the last meshes with triangles, in their order.
    pub fn build_for(&self, of: &Scene, scene: &Scene, written: &[Option<Arc<Tree>>]) -> MeshTrees {
        let mut of_written = vec![None; scene.meshes.len()];
        let last = (0..scene.meshes.len()).rev().filter(|&number| scene.meshes[number].triangle_count() > 0);
        last.zip(written.iter().rev()).for_each(|(number, tree)| of_written[number] = tree.clone());
        let tree = |(number, mesh): (usize, &Mesh)| {
            let same = of.meshes.get(number).filter(|other| have_same_triangles(mesh, other));
            let of_same = || same.and_then(|_| self.0.get(number)?.clone());
            let of_written = of_written[number].clone().filter(|tree| tree.order.len() == mesh.triangle_count());
            let known = of_written.or_else(of_same);
            Some(known.unwrap_or_else(|| Arc::new(tree(mesh))))
        };
        MeshTrees(parallel::map(scene.meshes.len(), &|m| tree((m, &scene.meshes[m]))))
    }

    /// Returns the known trees of the meshes that a layout results in ([`crate::layout::stored`]): those of groups that
    /// keep a mesh unchanged, and those known for placed triangles.
    pub fn of_layout(&self, scene: &Scene, layout: &Layout, placed: &PlacedTrees) -> MeshTrees {
        let known = |content: &Content| match content {
            Content::Kept(mesh) => self.0.get(mesh.0 as usize).cloned().flatten(),
            Content::Piece { .. } => None,
            Content::Baked { .. } => placed.of_group(scene, content).map(Arc::new),
        };
        MeshTrees(parallel::map_each(&layout.groups, &|group| known(&group.content)))
    }

    /// Returns the tree of a mesh, if it is known.
    pub fn get(&self, mesh: MeshId) -> Option<&Tree> {
        self.0.get(mesh.0 as usize)?.as_deref()
    }
}

/// Builds the tree over the triangles of a mesh.
fn tree(mesh: &Mesh) -> Tree {
    let bounds = |triangle: u32| Bounds::of(mesh.corners(triangle).map(|p| p.as_dvec3()));
    Tree::build_from(mesh.triangle_count(), Quality::Medium, &bounds)
}

/// Whether two meshes hold the same triangles in the same order, bit for bit.
fn have_same_triangles(a: &Mesh, b: &Mesh) -> bool {
    let bits = |p: &Vec3| p.to_array().map(f32::to_bits);
    let are_same = |(a, b): (&Geometry, &Geometry)| {
        a.triangles == b.triangles && a.positions.iter().map(bits).eq(b.positions.iter().map(bits))
    };
    a.geometries.len() == b.geometries.len() && a.geometries.iter().zip(&b.geometries).all(are_same)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::tests::{grid_mesh, instance, kept, scene};
    use glam::DAffine3;

    fn two_grids() -> Scene {
        scene(vec![grid_mesh(3), grid_mesh(5)], vec![instance(0, DAffine3::IDENTITY), instance(1, DAffine3::IDENTITY)])
    }

    #[test]
    fn trees_are_shared_only_where_triangles_are_the_same() {
        let before = two_grids();
        let trees = MeshTrees::build(&before);
        let mut after = before.clone();
        Arc::make_mut(&mut after.meshes[1].geometries[0].positions)[7].x += 0.25;
        after.meshes.push(grid_mesh(2));
        let others = trees.build_for(&before, &after, &[]);
        let of = |trees: &MeshTrees, mesh: usize| trees.0[mesh].clone().expect("it is built");
        assert!(Arc::ptr_eq(&of(&trees, 0), &of(&others, 0)));
        assert!(!Arc::ptr_eq(&of(&trees, 1), &of(&others, 1)));
        assert_eq!(*of(&others, 2), tree(&after.meshes[2]));
    }

    #[test]
    fn kept_groups_have_the_trees_of_their_meshes() {
        let scene = two_grids();
        let trees = MeshTrees::build(&scene);
        let mut layout = kept(&scene);
        layout.groups.swap(0, 1);
        let content = Content::Piece { mesh: MeshId(0), frame: DAffine3::IDENTITY, geometries: vec![] };
        layout.groups.push(crate::layout::Group { name: String::new(), content });
        let known = trees.of_layout(&scene, &layout, &PlacedTrees::default());
        let len = |mesh: u32| known.get(MeshId(mesh)).map(|tree| tree.order.len());
        assert_eq!([len(0), len(1), len(2), len(3)], [Some(50), Some(18), None, None]);
        assert!(MeshTrees::default().of_layout(&scene, &layout, &PlacedTrees::default()).get(MeshId(0)).is_none());
    }
}
