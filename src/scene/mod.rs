//! [`Scene`]: what a ray tracer sees of a document.

mod alpha;
mod apart;
pub mod bounds;
mod check;
mod known;
mod load;
mod meshes;
mod object;
mod overlay;
mod position_key;
mod reading;
mod scene_core;
mod stand_in;
pub(crate) mod webp;

pub use alpha::{AlphaTest, AlphaTexture, Image, Wrap};
pub(crate) use apart::{Apart, apart};
pub use bounds::Bounds;
pub use check::Broken;
pub use known::Known;
pub use load::{LoadOptions, load};
pub use meshes::Meshes;
pub(crate) use object::{Object, objects};
pub use overlay::Overlay;
pub(crate) use position_key::position_key;
pub use reading::ReadingError;
pub(crate) use reading::most_stretch;

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
pub use raykiln_formats::contents::{Camera, Hold, Opacity, TriangleOrder};
use raykiln_formats::record::{GeometryHash, Provenance};
pub use scene_core::Core;
pub use stand_in::{Origin, StandIn};

/// Index into [`Scene::meshes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MeshId(pub u32);

/// Index into [`Scene::instances`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct InstanceId(pub u32);

/// Triangles placed by instances of mesh groups, as the default scene of a document shows them.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Mesh groups with at least one triangle that an instance of the default scene places, or would place if no other
    /// mesh stood in for it, in document order.
    pub meshes: Meshes,
    /// Placements of the meshes: the TLAS entries, in depth-first order of the node hierarchy.
    pub instances: Vec<Instance>,
    /// The document's materials.
    pub materials: Vec<Material>,
    /// Images of alpha-tested materials.
    pub images: Vec<Image>,
    /// The document's cameras that nodes of the default scene place, in node order.
    pub cameras: Vec<PlacedCamera>,
    /// Number of nodes in the document.
    pub nodes: usize,
    /// Where the triangles come from, if the document is the output of a bake.
    pub provenance: Provenance,
    /// Hash of the document's geometry.
    pub geometry: GeometryHash,
    /// Nodes whose mesh `EXT_mesh_gpu_instancing` copies, in ascending order.
    pub copied_nodes: Vec<u32>,
    /// By instance, what its mesh stands in for, as given by an [`Overlay`]; empty for a scene as loaded.
    pub stand_ins: Arc<Vec<Option<StandIn>>>,
    /// See [`Scene::instance_boxes`] and [`Scene::bounds`].
    pub boxes: Known<Boxes>,
    /// See [`Scene::core`].
    pub core: Known<Core>,
}

/// World boxes of a scene's instances.
#[derive(Clone, Debug, PartialEq)]
pub struct Boxes {
    of_instances: Vec<Bounds>,
    of_all: Bounds,
}

/// A mesh group of the input: the geometries of one BLAS.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file, or empty.
    pub name: String,
    /// Index in the document, or [`Mesh::ELSEWHERE`].
    pub source: u32,
    /// Its geometries, in file order; none is empty.
    pub geometries: Vec<Geometry>,
    /// Whether triangles of the document's mesh were dropped, so that it must not be written unchanged. Points and
    /// lines next to the triangles do not count: they stay in the document's mesh.
    pub dropped: bool,
    /// See [`Mesh::bounds`].
    pub extent: Known<Bounds>,
    /// See [`Mesh::reading_error`].
    pub residual: Known<f64>,
}

/// Triangles with one material, in the coordinates of their mesh.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Index of the primitive in the document's mesh.
    pub primitive: u32,
    /// Index into [`Scene::materials`]; `None` is glTF's default material.
    pub material: Option<u32>,
    /// How rays pass through the material.
    pub opacity: Opacity,
    /// The alpha test, if the material is alpha-tested.
    pub alpha: Option<AlphaTest>,
    /// Geometries with equal material and equal `merge_class` may be joined into one.
    pub merge_class: u32,
    /// Index of its first triangle in the numbering of the mesh's triangles.
    pub first_triangle: u32,
    /// Vertex positions as stored; all referenced ones are finite. Geometries whose primitives refer to the same accessor
    /// share them.
    pub positions: Arc<[Vec3]>,
    /// What rounding to single precision took from each position when the file was read, see
    /// [`Residuals`](raykiln_formats::document::Residuals); `None` if nothing.
    pub residuals: Option<Arc<[Vec3]>>,
    /// Vertices of each triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle, its index in the document's primitive; `None` if the indices are equal.
    pub kept: Option<Vec<u32>>,
}

/// One TLAS entry: a mesh and an affine transform.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Name of the node, or empty.
    pub name: String,
    /// Node of the document.
    pub node: u32,
    /// Index of the copy within the node (`EXT_mesh_gpu_instancing`), else 0.
    pub copy: u32,
    /// The mesh that is placed.
    pub mesh: MeshId,
    /// World from mesh, finite.
    pub transform: DAffine3,
    /// Why the instance must stay unchanged; `None` if it need not.
    pub pinned: Option<Pinned>,
}

/// Why an instance must not be restructured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Pinned {
    /// An animation moves its node or an ancestor.
    Animated,
    /// Its node has a skin.
    Skinned,
    /// Its mesh has morph targets.
    Morphed,
    /// A `--keep` pattern of the user matches its node, an ancestor or its mesh.
    Protected,
    /// Another scene of the file also shows its node.
    OtherScene,
    /// Something refers to it or hangs on it that would lose its meaning.
    Held(Hold),
    /// Its material has lengths in the coordinates of the mesh, which its transform scales.
    MeshUnits,
    /// Its transform is singular, so that no ray can enter it.
    Singular,
    /// Writing its triangles out would exceed the maximum position error.
    Precision,
    /// It shares corners with an instance that stays, placed by the same transform: written out, it would part from it.
    Seam,
}

/// A material, as far as it matters for tracing.
pub type Material = raykiln_formats::contents::Material;

/// A camera and its placement.
#[derive(Clone, Debug)]
pub struct PlacedCamera {
    /// Name of its node, or empty.
    pub name: String,
    /// The camera.
    pub camera: Camera,
    /// World from camera.
    pub transform: DAffine3,
}

/// A triangle placed by an instance; `triangle` counts through all geometries of the instance's mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct TriangleRef {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Triangle of the instance's mesh.
    pub triangle: u32,
}

impl Mesh {
    /// The source of a mesh that the scene's document does not have: neither are its materials.
    pub const ELSEWHERE: u32 = u32::MAX;

    /// Returns the number of triangles in all geometries.
    pub fn triangle_count(&self) -> usize {
        self.geometries.last().map_or(0, |last| last.first_triangle as usize + last.triangles.len())
    }

    /// Returns the box around its triangles in mesh coordinates; computed once.
    pub fn bounds(&self) -> Bounds {
        *self.extent.get_or(|| self.geometries.iter().fold(Bounds::EMPTY, |all, g| all.union(&g.bounds())))
    }

    /// Returns the largest absolute coordinates of its triangles along each axis, in mesh coordinates.
    pub fn reach(&self) -> DVec3 {
        let bounds = self.bounds();
        if bounds.is_empty() { DVec3::ZERO } else { bounds.min.abs().max(bounds.max.abs()) }
    }

    /// Returns the geometry that holds a triangle of the mesh, and the triangle's index in it.
    pub fn locate(&self, triangle: u32) -> (usize, usize) {
        let g = self.geometries.partition_point(|g| g.first_triangle <= triangle) - 1;
        (g, (triangle - self.geometries[g].first_triangle) as usize)
    }

    /// Returns the corners of a triangle in mesh coordinates, as stored.
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        let (g, t) = self.locate(triangle);
        self.geometries[g].corners(t)
    }

    /// Returns the corners of a triangle in mesh coordinates, as the file gives them.
    pub fn exact_corners(&self, triangle: u32) -> [DVec3; 3] {
        let (g, t) = self.locate(triangle);
        self.geometries[g].exact_corners(t)
    }

    /// Returns the largest distance between a corner and where the file has it, in mesh units; computed once.
    pub fn reading_error(&self) -> f64 {
        *self.residual.get_or(|| self.geometries.iter().map(Geometry::reading_error).fold(0.0, f64::max))
    }
}

impl Geometry {
    /// Returns the box around its triangles in mesh coordinates.
    pub fn bounds(&self) -> Bounds {
        Bounds::of(self.triangles.iter().flatten().map(|&v| self.positions[v as usize].as_dvec3()))
    }

    /// Returns the corners of a triangle in mesh coordinates, as stored.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }

    /// Returns the corners of a triangle in mesh coordinates, as the file gives them.
    pub fn exact_corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|v| self.exact(v))
    }

    /// Returns the position of a vertex as the file gives it. Rounded to single precision, it is the stored one.
    pub fn exact(&self, vertex: u32) -> DVec3 {
        let stored = self.positions[vertex as usize].as_dvec3();
        self.residuals.as_ref().map_or(stored, |residuals| stored + residuals[vertex as usize].as_dvec3())
    }

    fn reading_error(&self) -> f64 {
        let Some(residuals) = &self.residuals else { return 0.0 };
        let of_vertex = |&v: &u32| residuals[v as usize].as_dvec3().length();
        self.triangles.iter().flatten().map(of_vertex).fold(0.0, f64::max)
    }
}

impl Scene {
    /// Whether `EXT_mesh_gpu_instancing` copies the mesh of a node: the copies' transforms apply between mesh and node.
    pub fn is_copied(&self, node: u32) -> bool {
        self.copied_nodes.binary_search(&node).is_ok()
    }

    /// Returns the mesh that an instance places.
    pub fn mesh_of(&self, instance: InstanceId) -> &Mesh {
        &self.meshes[self.instances[instance.0 as usize].mesh.0 as usize]
    }

    /// Returns the corners of a placed triangle in world coordinates, as the file gives them, in double precision. For a
    /// mirrored instance the second and third corner are swapped, so that the order stays counter-clockwise seen from the
    /// front.
    pub fn world_corners(&self, at: TriangleRef) -> [DVec3; 3] {
        let instance = &self.instances[at.instance as usize];
        let corners = self.mesh_of(InstanceId(at.instance)).exact_corners(at.triangle);
        let [a, b, c] = corners.map(|p| instance.transform.transform_point3(p));
        if instance.mirrored() { [a, c, b] } else { [a, b, c] }
    }

    /// Returns the number of objects: geometries of all instances, each counted where it is placed.
    pub fn objects(&self) -> u64 {
        self.instances.iter().map(|i| self.meshes[i.mesh.0 as usize].geometries.len() as u64).sum()
    }

    /// Returns the world boxes of all instances, transformed from their meshes' boxes as a driver does; computed once.
    pub fn instance_boxes(&self) -> &[Bounds] {
        &self.boxes().of_instances
    }

    /// Returns the box around the boxes of all instances, never smaller than the box around all placed triangles;
    /// computed once.
    pub fn bounds(&self) -> Bounds {
        self.boxes().of_all
    }

    /// Returns the core of the scene, whose box is not blown up by sky domes or far objects; computed once.
    pub fn core(&self) -> &Core {
        self.core.get_or(|| Core::of(self))
    }

    fn boxes(&self) -> &Boxes {
        self.boxes.get_or(|| {
            let of_instance = |i: &Instance| self.meshes[i.mesh.0 as usize].bounds().transformed(&i.transform);
            let of_instances: Vec<Bounds> = self.instances.iter().map(of_instance).collect();
            let of_all = of_instances.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
            Boxes { of_instances, of_all }
        })
    }

    /// Returns the scene with all instances and cameras moved; it shares all meshes.
    pub fn translated(&self, by: DVec3) -> Scene {
        let mut moved = self.clone();
        moved.instances.iter_mut().for_each(|instance| instance.transform.translation += by);
        moved.cameras.iter_mut().for_each(|camera| camera.transform.translation += by);
        moved
    }

    /// Returns the scene with the world stretched along its axes, without cameras; it shares all meshes.
    pub fn stretched(&self, by: DVec3) -> Scene {
        let mut stretched = Scene { cameras: Default::default(), ..self.clone() };
        let stretch = DAffine3::from_scale(by);
        stretched.instances.iter_mut().for_each(|instance| instance.transform = stretch * instance.transform);
        stretched
    }

    /// Returns the number of triangles stored; each mesh counts once.
    pub fn triangles_stored(&self) -> u64 {
        self.meshes.iter().map(|m| m.triangle_count() as u64).sum()
    }

    /// Returns the number of triangles placed; each instance counts.
    pub fn triangles_placed(&self) -> u64 {
        self.instances.iter().map(|i| self.meshes[i.mesh.0 as usize].triangle_count() as u64).sum()
    }
}

impl Instance {
    /// Returns a name to display: the node's name, or its number, and which copy it is of several.
    pub fn display_name(&self) -> String {
        let copy = if self.copy > 0 { format!(" copy {}", self.copy) } else { String::new() };
        match self.name.as_str() {
            "" => format!("node {}{copy}", self.node),
            name => format!("{name}{copy}"),
        }
    }

    /// Whether the transform reverses handedness.
    pub fn mirrored(&self) -> bool {
        self.transform.matrix3.determinant() < 0.0
    }
}
