//! The acceleration structures of a layout: a tree over the triangles of every group, and one over its placements.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::mesh_trees::MeshTrees;
use super::sah::FaceAreas;
use crate::layout::{Content, Group, Layout, Placement};
use crate::scene::{Bounds, Scene};
use crate::tree::{Quality, Tree};

/// The trees of a layout, as a driver might build them.
#[derive(Clone, Debug, Default)]
pub struct Structure {
    /// For every group of the layout its tree.
    pub blas: Vec<Blas>,
    /// For every placement the world box of its group's box, as a driver sees it; empty for an empty group.
    pub boxes: Vec<Bounds>,
    /// The tree over `boxes`, one a leaf; without boxes that are empty or not finite.
    pub tlas: Tree,
}

/// The tree over the triangles of a group.
#[derive(Clone, Debug, Default)]
pub struct Blas {
    /// Item `i` is the group's triangle `i` as [`GroupTriangles`] counts.
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

    /// As [`Structure::build`], where trees of the scene's meshes are known.
    pub fn build_with(scene: &Scene, layout: &Layout, trees: &MeshTrees) -> Structure {
        let blas: Vec<Blas> = layout.groups.par_iter().map(|group| Blas::build(scene, group, trees)).collect();
        let world_box = |p: &Placement| blas[p.group as usize].bounds.transformed(&p.transform);
        let boxes: Vec<Bounds> = layout.placements.iter().map(world_box).collect();
        let tlas = Tree::build_usable(&boxes, Quality::Instances);
        Structure { blas, boxes, tlas }
    }
}

impl Blas {
    /// The tree of a group, built where it is not that of a mesh that is known.
    fn build(scene: &Scene, group: &Group, trees: &MeshTrees) -> Blas {
        let triangles = GroupTriangles::new(scene, &group.content);
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

/// The triangles of a group in the order in which they are written, with corners in group space: mesh coordinates
/// where the group stands for a mesh or a part of it, else world coordinates, seen from the group's frame, in double
/// precision and not yet rounded as they are stored.
pub struct GroupTriangles<'a> {
    scene: &'a Scene,
    content: &'a Content,
    /// First triangle of every geometry, counted through, and the number of all.
    starts: Vec<usize>,
    /// Group from world or from mesh; `None` where that is the identity.
    into_frame: Option<DAffine3>,
}

impl<'a> GroupTriangles<'a> {
    /// Of what a group holds.
    pub fn new(scene: &'a Scene, content: &'a Content) -> Self {
        let counts: Vec<usize> = match content {
            Content::Kept(mesh) => scene.meshes[mesh.0 as usize].geometries.iter().map(|g| g.triangles.len()).collect(),
            Content::Piece { geometries, .. } | Content::Baked { geometries, .. } => {
                geometries.iter().map(|g| g.triangles.len()).collect()
            }
        };
        let mut starts = vec![0];
        starts.extend(counts.iter().scan(0, |sum, count| {
            *sum += count;
            Some(*sum)
        }));
        let into_frame = match content {
            Content::Baked { frame, .. } | Content::Piece { frame, .. } if *frame != DAffine3::IDENTITY => {
                Some(frame.inverse())
            }
            _ => None,
        };
        GroupTriangles { scene, content, starts, into_frame }
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.starts[self.geometries()]
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of geometries.
    pub fn geometries(&self) -> usize {
        self.starts.len() - 1
    }

    /// The triangles of a geometry, counted through all geometries.
    pub fn of_geometry(&self, geometry: usize) -> std::ops::Range<usize> {
        self.starts[geometry]..self.starts[geometry + 1]
    }

    /// Corners of a triangle in group space.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        let geometry = self.starts.partition_point(|&start| start <= triangle) - 1;
        let at = triangle - self.starts[geometry];
        let corners = match self.content {
            Content::Kept(mesh) => {
                self.scene.meshes[mesh.0 as usize].geometries[geometry].corners(at).map(|p| p.as_dvec3())
            }
            Content::Piece { mesh, geometries, .. } => {
                let of_mesh = geometries[geometry].triangles[at].triangle;
                self.scene.meshes[mesh.0 as usize].corners(of_mesh).map(|p| p.as_dvec3())
            }
            Content::Baked { geometries, .. } => self.scene.world_corners(geometries[geometry].triangles[at]),
        };
        match &self.into_frame {
            Some(into_frame) => corners.map(|p| into_frame.transform_point3(p)),
            None => corners,
        }
    }

    /// The box of every triangle, in group space.
    pub fn boxes(&self) -> Vec<Bounds> {
        (0..self.len()).into_par_iter().map(|t| Bounds::of(self.corners(t))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::tests::{grid_mesh, instance, kept, scene};
    use crate::layout::{GroupGeometry, Placement};
    use crate::scene::{MeshId, TriangleRef};
    use glam::dvec3;

    fn geometry(triangles: &[(u32, u32)]) -> GroupGeometry {
        let triangles = triangles.iter().map(|&(instance, triangle)| TriangleRef { instance, triangle }).collect();
        GroupGeometry { triangles, ..GroupGeometry::default() }
    }

    #[test]
    fn corners_are_those_of_the_mesh_or_of_the_frame() {
        let placed = DAffine3::from_translation(dvec3(5.0, 6.0, 7.0));
        let scene = scene(vec![grid_mesh(2)], vec![instance(0, placed)]);
        let mesh_corners = |t| scene.meshes[0].corners(t).map(|p| p.as_dvec3());

        let kept = GroupTriangles::new(&scene, &Content::Kept(MeshId(0))).corners(3);
        assert_eq!(kept, mesh_corners(3));

        let piece = Content::Piece {
            mesh: MeshId(0),
            frame: DAffine3::IDENTITY,
            geometries: vec![geometry(&[(0, 5)]), geometry(&[]), geometry(&[(0, 2), (0, 1)])],
        };
        let piece = GroupTriangles::new(&scene, &piece);
        assert_eq!((piece.len(), piece.of_geometry(2)), (3, 1..3));
        assert_eq!([0, 1, 2].map(|t| piece.corners(t)), [5, 2, 1].map(mesh_corners));

        let baked = |frame| Content::Baked { frame, geometries: vec![geometry(&[(0, 4)])] };
        assert_eq!(GroupTriangles::new(&scene, &baked(placed)).corners(0), mesh_corners(4));
        let world = GroupTriangles::new(&scene, &baked(DAffine3::IDENTITY)).corners(0);
        assert_eq!(world, scene.world_corners(TriangleRef { instance: 0, triangle: 4 }));
    }

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
