//! The stored triangles of a layout: their order in a group, their source, and their corners in the group's
//! coordinates.
//!
//! All code that measures, limits, races or writes a group uses this module, so that all of it sees the same numbers.

use std::ops::Range;

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::{Content, GroupGeometry};
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::{Bounds, Geometry, MeshId, Origin, Scene, TriangleRef};

/// The triangles of a group in the order of writing.
pub struct Store<'a> {
    scene: &'a Scene,
    content: &'a Content,
    /// For each geometry, the index of its first triangle, counted through all geometries; then the number of all
    /// triangles.
    starts: Vec<usize>,
    /// Group from world for baked content, else group from mesh.
    into: DAffine3,
}

impl<'a> Store<'a> {
    /// Creates the store of a group's content.
    pub fn new(scene: &'a Scene, content: &'a Content) -> Self {
        let (counts, into): (Vec<usize>, DAffine3) = match content {
            Content::Kept(mesh) => {
                let geometries = &scene.meshes[mesh.0 as usize].geometries;
                (geometries.iter().map(|g| g.triangles.len()).collect(), DAffine3::IDENTITY)
            }
            Content::Piece { frame, geometries, .. } | Content::Baked { frame, geometries } => {
                (geometries.iter().map(|g| g.triangles.len()).collect(), frame.inverse())
            }
        };
        let mut starts = vec![0];
        starts.extend(counts.iter().scan(0, |sum, count| {
            *sum += count;
            Some(*sum)
        }));
        Store { scene, content, starts, into }
    }

    /// Returns the number of triangles.
    pub fn len(&self) -> usize {
        self.starts[self.geometries()]
    }

    /// Whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of geometries.
    pub fn geometries(&self) -> usize {
        self.starts.len() - 1
    }

    /// Returns the triangles of a geometry, counted through all geometries.
    pub fn of_geometry(&self, geometry: usize) -> Range<usize> {
        self.starts[geometry]..self.starts[geometry + 1]
    }

    /// Whether positions are stored unchanged from the scene's meshes.
    pub fn is_unmoved(&self) -> bool {
        !matches!(self.content, Content::Baked { .. }) && self.into == DAffine3::IDENTITY
    }

    /// Returns the corners of a triangle in the coordinates of the group, computed from the positions that the file
    /// gives, before rounding to single precision; in the order of the triangle's source mesh, even if that is mirrored.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        let geometry = self.starts.partition_point(|&start| start <= triangle) - 1;
        let at = triangle - self.starts[geometry];
        match self.content {
            Content::Kept(mesh) => self.scene.meshes[mesh.0 as usize].geometries[geometry].exact_corners(at),
            Content::Piece { geometries, .. } | Content::Baked { geometries, .. } => {
                self.corners_of(geometries[geometry].triangles[at])
            }
        }
    }

    /// Like [`Store::corners`], for a triangle of the scene.
    pub fn corners_of(&self, at: TriangleRef) -> [DVec3; 3] {
        let origin = self.origin(at);
        let corners = self.scene.meshes[origin.mesh.0 as usize].exact_corners(origin.triangle);
        let way = self.way(&origin);
        corners.map(|p| way.take(p))
    }

    /// Returns the box of each triangle, in the coordinates of the group.
    pub fn boxes(&self) -> Vec<Bounds> {
        self.par_boxes().collect()
    }

    /// Returns the box around all triangles, in the coordinates of the group.
    pub fn bounds(&self) -> Bounds {
        self.par_boxes().reduce(|| Bounds::EMPTY, |a, b| a.union(&b))
    }

    fn par_boxes(&self) -> impl IndexedParallelIterator<Item = Bounds> {
        let box_of = |triangle| Bounds::of(self.corners(triangle));
        (0..self.len()).into_par_iter().with_min_len(CHEAP_ELEMENTS).map(box_of)
    }

    /// Returns the vertices of a geometry, numbered in the order of first use. Calls `visit` for each triangle, in
    /// order, with the index of its part, the part, and its index in the part's geometry.
    pub fn vertices(&self, of: &GroupGeometry, mut visit: impl FnMut(u32, &Part<'a>, usize)) -> Vertices<'a> {
        let mut numbering = Numbering::default();
        let mut vertices =
            Vertices { parts: Vec::new(), list: Vec::new(), triangles: Vec::with_capacity(of.triangles.len()) };
        for &at in &of.triangles {
            let origin = self.origin(at);
            let (geometry, triangle) = self.scene.meshes[origin.mesh.0 as usize].locate(origin.triangle);
            let instance = self.instance_of(at);
            let next = vertices.parts.len() as u32;
            let number = *numbering.parts.entry((instance.unwrap_or(0), geometry as u32)).or_insert(next);
            if number == next {
                vertices.parts.push(self.part(instance, &origin, geometry));
            }
            let part = &vertices.parts[number as usize];
            visit(number, part, triangle);
            let list = &mut vertices.list;
            vertices.triangles.push(part.corners(triangle).map(|vertex| {
                *numbering.vertices.entry((number, vertex)).or_insert_with(|| {
                    list.push((number, vertex));
                    list.len() as u32 - 1
                })
            }));
        }
        vertices
    }

    /// Returns the instance that a triangle is stored for; `None` if it is stored for all instances of its mesh.
    fn instance_of(&self, at: TriangleRef) -> Option<u32> {
        matches!(self.content, Content::Baked { .. }).then_some(at.instance)
    }

    /// Returns the source of a triangle. Baked triangles come from the mesh that the document places, so that a mesh
    /// that stands in for a copy adds no error of its own; a piece is shared by all instances of its mesh.
    fn origin(&self, at: TriangleRef) -> Origin {
        match self.content {
            Content::Kept(mesh) | Content::Piece { mesh, .. } => {
                Origin { mesh: *mesh, triangle: at.triangle, transform: DAffine3::IDENTITY }
            }
            Content::Baked { .. } => self.scene.origin(at),
        }
    }

    /// Returns the way from a triangle's source into the group.
    fn way(&self, origin: &Origin) -> Way {
        let [world_from_mesh, group_from_world] = match self.content {
            // The way there and back would not give back every bit.
            Content::Baked { frame, .. } if *frame == origin.transform => [DAffine3::IDENTITY; 2],
            Content::Baked { .. } => [origin.transform, self.into],
            Content::Kept(_) | Content::Piece { .. } => [DAffine3::IDENTITY, self.into],
        };
        Way([world_from_mesh, group_from_world].map(|step| (step != DAffine3::IDENTITY).then_some(step)))
    }

    fn part(&self, instance: Option<u32>, origin: &Origin, geometry: usize) -> Part<'a> {
        let way = self.way(origin);
        let group_from_mesh = way.transform();
        Part {
            instance,
            mesh: origin.mesh,
            number: geometry,
            geometry: &self.scene.meshes[origin.mesh.0 as usize].geometries[geometry],
            way,
            group_from_mesh,
            mirrored: group_from_mesh.is_some_and(|t| t.matrix3.determinant() < 0.0),
        }
    }
}

/// The way from a mesh into a group, by the world. Two steps, not one product: positions that are equal in the world are
/// stored equal, whatever instances they come from.
#[derive(Clone, Copy)]
struct Way([Option<DAffine3>; 2]);

impl Way {
    fn take(&self, position: DVec3) -> DVec3 {
        self.0.iter().flatten().fold(position, |p, step| step.transform_point3(p))
    }

    /// Returns the product of both steps; `None` if positions are unchanged.
    fn transform(&self) -> Option<DAffine3> {
        self.0.iter().flatten().copied().reduce(|first, then| then * first)
    }
}

/// Returns the distance by which rounding moves a position, in units of the group. For a position that overflows single
/// precision it is infinite, which exceeds any limit.
pub fn rounding_error(exact: DVec3) -> f64 {
    let moved = exact.as_vec3().as_dvec3().distance(exact);
    if moved.is_finite() { moved } else { f64::INFINITY }
}

/// The vertices of a geometry of a group, each stored once, because drivers connect triangles that share them.
pub struct Vertices<'a> {
    /// The sources of the triangles, in the order of first use.
    pub parts: Vec<Part<'a>>,
    /// For each vertex, its part and its index in the part's geometry.
    pub list: Vec<(u32, u32)>,
    /// For each triangle, its vertices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
}

/// Numbers assigned in the order of first use.
#[derive(Default)]
struct Numbering {
    /// By instance (0 for a piece) and geometry.
    parts: FxHashMap<(u32, u32), u32>,
    /// By part and vertex of its geometry.
    vertices: FxHashMap<(u32, u32), u32>,
}

/// A geometry of the scene, as stored in a group for one of its instances.
pub struct Part<'a> {
    /// The instance; `None` if the geometry is stored for all instances of its mesh.
    pub instance: Option<u32>,
    /// Its mesh.
    pub mesh: MeshId,
    /// Its index in the mesh.
    pub number: usize,
    /// The geometry.
    pub geometry: &'a Geometry,
    way: Way,
    /// Group from mesh; `None` if positions are unchanged.
    pub group_from_mesh: Option<DAffine3>,
    /// Whether `group_from_mesh` reverses handedness.
    pub mirrored: bool,
}

impl Part<'_> {
    /// Returns the position of a vertex in the group, computed from the position that the file gives, before rounding.
    pub fn exact(&self, vertex: u32) -> DVec3 {
        self.way.take(self.geometry.exact(vertex))
    }

    /// Returns the stored position of a vertex: that of the mesh if it stays in its coordinates; otherwise computed in
    /// double precision and rounded once.
    pub fn stored(&self, vertex: u32) -> Vec3 {
        match self.group_from_mesh {
            Some(_) => self.exact(vertex).as_vec3(),
            None => self.geometry.positions[vertex as usize],
        }
    }

    /// Returns the vertices of a triangle, counter-clockwise seen from the front in the group.
    fn corners(&self, triangle: usize) -> [u32; 3] {
        let [a, b, c] = self.geometry.triangles[triangle];
        if self.mirrored { [a, c, b] } else { [a, b, c] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;

    fn geometry(triangles: &[(u32, u32)]) -> GroupGeometry {
        let triangles = triangles.iter().map(|&(instance, triangle)| TriangleRef { instance, triangle }).collect();
        GroupGeometry { triangles, ..GroupGeometry::default() }
    }

    /// One mesh of eight triangles with the given placement.
    fn placed_aside(placed: DAffine3) -> Scene {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("row", vec![(0, row(Vec3::ZERO, 8))]);
        builder.place(mesh, "row", placed);
        builder.scene()
    }

    #[test]
    fn corners_are_those_of_the_mesh_or_of_the_frame() {
        let placed = at(5.0, 6.0, 7.0);
        let scene = placed_aside(placed);
        let mesh_corners = |t| scene.meshes[0].corners(t).map(|p| p.as_dvec3());

        let kept = Content::Kept(MeshId(0));
        let kept = Store::new(&scene, &kept);
        assert_eq!(kept.corners(3), mesh_corners(3));
        assert!(kept.is_unmoved());

        let geometries = vec![geometry(&[(0, 5)]), geometry(&[]), geometry(&[(0, 2), (0, 1)])];
        let piece = Content::Piece { mesh: MeshId(0), frame: DAffine3::IDENTITY, geometries };
        let piece = Store::new(&scene, &piece);
        assert_eq!((piece.len(), piece.of_geometry(2)), (3, 1..3));
        assert_eq!([0, 1, 2].map(|t| piece.corners(t)), [5, 2, 1].map(mesh_corners));

        let baked = |frame| Content::Baked { frame, geometries: vec![geometry(&[(0, 4)])] };
        assert_eq!(Store::new(&scene, &baked(placed)).corners(0), mesh_corners(4));
        let world = baked(DAffine3::IDENTITY);
        let world = Store::new(&scene, &world);
        assert_eq!(world.corners(0), scene.world_corners(TriangleRef { instance: 0, triangle: 4 }));
        assert_eq!(world.bounds(), Bounds::of(world.corners(0)));
        assert!(!world.is_unmoved());
    }

    #[test]
    fn vertices_are_numbered_by_first_use_and_turned_over_where_mirrored() {
        let scene = placed_aside(DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
        let of = geometry(&[(0, 5), (0, 2), (0, 5)]);
        let content = Content::Baked { frame: DAffine3::IDENTITY, geometries: vec![of.clone()] };
        let mut visited = Vec::new();
        let vertices = Store::new(&scene, &content).vertices(&of, |part, _, triangle| visited.push((part, triangle)));
        assert_eq!(visited, [(0, 5), (0, 2), (0, 5)]);
        assert_eq!(vertices.triangles, [[0, 1, 2], [3, 4, 5], [0, 1, 2]]);
        assert_eq!(vertices.list, [15, 17, 16, 6, 8, 7].map(|vertex| (0, vertex)));
        let part = &vertices.parts[0];
        assert_eq!((part.instance, part.mirrored), (Some(0), true));
        let position = scene.meshes[0].geometries[0].positions[15];
        assert_eq!(part.stored(15), position * Vec3::new(-1.0, 1.0, 1.0));
    }

    #[test]
    fn what_overflows_is_off_by_infinity() {
        assert_eq!(rounding_error(DVec3::splat(0.5)), 0.0);
        assert_eq!(rounding_error(DVec3::splat(1e300)), f64::INFINITY);
        assert!((rounding_error(DVec3::X * 0.1) - 1.49e-9).abs() < 1e-11);
    }
}
